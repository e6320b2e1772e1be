//! `robopheus-camera`: the edge computer of one camera, and the tool that calibrates it.

use anyhow::{Context, Result, bail};
use clap::{Parser, Subcommand};
use lab::camera::eye::Eye;
use lab::camera::frame_stream::{FrameError, Received, read_frame};
use lab::camera::identity::Identity;
use lab::camera::outlet::Outlet;
use lab::camera::refusals::{PictureRefusals, RefusalLine};
use lab::camera::sighting::Sighting;
use lab::camera::tool;
use lab::clock::monotonic_us;
use std::fs::File;
use std::io::{self, BufReader, Read, Write};
use std::os::unix::fs::FileTypeExt;
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Wait before connecting to the camera again.
const RECONNECT: Duration = Duration::from_millis(200);
/// A camera that sends nothing for this long is connected anew.
const SILENCE: Duration = Duration::from_secs(2);

/// Finds robots in one camera's pictures, and calibrates cameras.
#[derive(Debug, Parser)]
#[command(name = "robopheus-camera", version)]
struct Settings {
    #[command(subcommand)]
    verb: Verb,
}

#[derive(Debug, Subcommand)]
enum Verb {
    /// Reads a camera's frames and tells where the robots are, one line of JSON a picture.
    Serve(Serve),
    /// Makes a calibration file from pictures of a tag board.
    Calibrate {
        /// Name of the camera.
        #[arg(long)]
        camera: String,
        /// The board, robopheus.board/1.
        #[arg(long)]
        board: PathBuf,
        /// Calibration file to write.
        #[arg(long)]
        out: PathBuf,
        /// Pictures of the board (8-bit PGM): the first with the board at its places in the world, the others tilted.
        #[arg(required = true)]
        pictures: Vec<PathBuf>,
    },
}

#[derive(Debug, Parser)]
struct Serve {
    /// Calibration of the camera, robopheus.camera/1.
    #[arg(long)]
    calibration: PathBuf,
    /// The camera's frames: a socket, or a file with a recorded stream.
    #[arg(long)]
    frames: PathBuf,
    /// Socket to tell the poses on; standard output when left out.
    #[arg(long)]
    poses: Option<PathBuf>,
    /// Height of the tags above the floor.
    #[arg(long, default_value_t = 0.15)]
    tag_height_m: f64,
    /// Number of the camera in its frames; left out: the digits at the end of its name in the calibration file, if it has any.
    #[arg(long)]
    camera_number: Option<u16>,
    /// Tags from this number on are not robots.
    #[arg(long, default_value_t = 256)]
    robots: u16,
}

fn main() -> Result<()> {
    let settings = Settings::parse();
    let filter = tracing_subscriber::EnvFilter::try_from_default_env().unwrap_or_else(|_| "info".into());
    tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_writer(io::stderr)
        .init();
    match settings.verb {
        Verb::Serve(serve) => run(&serve),
        Verb::Calibrate {
            camera,
            board,
            out,
            pictures,
        } => tool::calibrate_files(&camera, &board, &pictures, &out),
    }
}

/// Between two lines about pictures that are not used.
const REFUSAL_PERIOD_US: i64 = 1_000_000;

/// Why a stream is not read any further.
#[derive(Debug, thiserror::Error)]
enum Trouble {
    #[error(transparent)]
    Frame(#[from] FrameError),
    #[error("{0}")]
    OtherCamera(String),
}

/// Where the lines go.
enum Lines {
    Socket(Outlet),
    Standard,
}

impl Lines {
    fn send(&mut self, document: &impl serde::Serialize) -> io::Result<()> {
        let mut line = serde_json::to_vec(document)?;
        line.push(b'\n');
        match self {
            Self::Socket(outlet) => outlet.send(&line),
            Self::Standard => io::stdout().write_all(&line)?,
        }
        Ok(())
    }
}

fn run(serve: &Serve) -> Result<()> {
    let path = &serve.calibration;
    let text = std::fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))?;
    let camera = localise::CameraDocument::from_json(&text)
        .and_then(|document| document.check())
        .with_context(|| format!("{} is not a camera's calibration", path.display()))?;
    let identity = Identity::new(path, camera.name(), serve.camera_number);
    let lines = match &serve.poses {
        Some(path) => Lines::Socket(Outlet::listen(path)?),
        None => Lines::Standard,
    };
    let mut watch = Watch {
        eye: Eye::new(camera, serve.tag_height_m, serve.robots)?,
        identity,
        lines,
        refused: PictureRefusals::default(),
        told_us: i64::MIN,
    };
    let is_socket = std::fs::metadata(&serve.frames).is_ok_and(|data| data.file_type().is_socket());
    if !is_socket && serve.frames.is_file() {
        let file = File::open(&serve.frames).with_context(|| serve.frames.display().to_string())?;
        return match watch.follow(&mut BufReader::new(file)) {
            Err(Trouble::Frame(FrameError::Io(error))) if error.kind() == io::ErrorKind::UnexpectedEof => Ok(()),
            Err(error) => Err(error).with_context(|| serve.frames.display().to_string()),
            Ok(never) => match never {},
        };
    }
    tracing::info!(camera = watch.eye.name(), frames = %serve.frames.display(), "camera's process is up");
    let mut quiet = false;
    loop {
        let Err(error) = connect(&serve.frames)
            .map_err(|error| Trouble::Frame(error.into()))
            .and_then(|mut stream| watch.follow(&mut stream));
        if let Trouble::OtherCamera(words) = error {
            bail!("{words}");
        }
        let connects = !matches!(&error, Trouble::Frame(FrameError::Io(error)) if matches!(error.kind(), io::ErrorKind::NotFound | io::ErrorKind::ConnectionRefused));
        if connects || !quiet {
            tracing::warn!(camera = watch.eye.name(), %error, "no frames");
        }
        quiet = !connects;
        std::thread::sleep(RECONNECT);
    }
}

fn connect(path: &Path) -> io::Result<UnixStream> {
    let stream = UnixStream::connect(path)?;
    stream.set_read_timeout(Some(SILENCE))?;
    Ok(stream)
}

/// One camera's pictures on their way to sightings.
struct Watch {
    eye: Eye,
    identity: Identity,
    lines: Lines,
    refused: PictureRefusals,
    /// When refusals were last told; least before the first.
    told_us: i64,
}

impl Watch {
    /// Picture after picture, in their order, until the stream fails.
    fn follow(&mut self, stream: &mut impl Read) -> std::result::Result<std::convert::Infallible, Trouble> {
        let mut pixels = Vec::new();
        let mut refused = false;
        loop {
            let received = read_frame(stream, &mut pixels)?;
            let received_us = monotonic_us();
            let header = match received {
                Received::Frame(header) => header,
                Received::PixelsLost(header) => {
                    tracing::warn!(
                        camera = self.eye.name(),
                        frame = header.sequence,
                        "pixels damaged on the way; not used"
                    );
                    self.refused.pixels += 1;
                    self.tell_refusals(received_us, self.refused.pixels == 1)?;
                    continue;
                }
            };
            self.identity.check(header.camera).map_err(Trouble::OtherCamera)?;
            match self.eye.look(&header, &pixels) {
                Ok(observation) => {
                    let sighting = Sighting {
                        camera: self.eye.name().to_owned(),
                        received_us,
                        located_us: monotonic_us(),
                        observation,
                    };
                    self.lines.send(&sighting).map_err(FrameError::Io)?;
                }
                Err(problem) => {
                    if !std::mem::replace(&mut refused, true) {
                        tracing::error!(camera = self.eye.name(), %problem, "the pictures cannot be used");
                    }
                    self.refused.size += 1;
                    self.tell_refusals(received_us, self.refused.size == 1)?;
                }
            }
        }
    }

    /// - `first`: of its kind.
    fn tell_refusals(&mut self, now_us: i64, first: bool) -> std::result::Result<(), Trouble> {
        if !first && now_us.saturating_sub(self.told_us) < REFUSAL_PERIOD_US {
            return Ok(());
        }
        self.told_us = now_us;
        let line = RefusalLine {
            camera: self.eye.name().to_owned(),
            refused: self.refused,
        };
        Ok(self.lines.send(&line).map_err(FrameError::Io)?)
    }
}
