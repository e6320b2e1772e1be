//! `robopheus-camera`: the edge computer of one camera, and the tool that calibrates it.

use anyhow::{Context, Result};
use clap::{Parser, Subcommand};
use lab::camera::eye::Eye;
use lab::camera::frame_stream::{FrameError, Received, read_frame};
use lab::camera::outlet::Outlet;
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

/// Where the lines go.
enum Lines {
    Socket(Outlet),
    Standard,
}

impl Lines {
    fn send(&mut self, line: &[u8]) -> io::Result<()> {
        match self {
            Self::Socket(outlet) => outlet.send(line),
            Self::Standard => io::stdout().write_all(line)?,
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
    let mut eye = Eye::new(camera, serve.tag_height_m, serve.robots)?;
    let mut lines = match &serve.poses {
        Some(path) => Lines::Socket(Outlet::listen(path)?),
        None => Lines::Standard,
    };
    let is_socket = std::fs::metadata(&serve.frames).is_ok_and(|data| data.file_type().is_socket());
    if !is_socket && serve.frames.is_file() {
        let file = File::open(&serve.frames).with_context(|| serve.frames.display().to_string())?;
        return match watch(&mut eye, &mut BufReader::new(file), &mut lines) {
            Err(FrameError::Io(error)) if error.kind() == io::ErrorKind::UnexpectedEof => Ok(()),
            Err(error) => Err(error).with_context(|| serve.frames.display().to_string()),
            Ok(never) => match never {},
        };
    }
    tracing::info!(camera = eye.name(), frames = %serve.frames.display(), "camera's process is up");
    let mut quiet = false;
    loop {
        let Err(error) = connect(&serve.frames)
            .map_err(FrameError::Io)
            .and_then(|mut stream| watch(&mut eye, &mut stream, &mut lines));
        let connects = !matches!(&error, FrameError::Io(error) if matches!(error.kind(), io::ErrorKind::NotFound | io::ErrorKind::ConnectionRefused));
        if connects || !quiet {
            tracing::warn!(camera = eye.name(), %error, "no frames");
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

/// Picture after picture, in their order, until the stream fails.
fn watch(
    eye: &mut Eye,
    stream: &mut impl Read,
    lines: &mut Lines,
) -> std::result::Result<std::convert::Infallible, FrameError> {
    let mut pixels = Vec::new();
    let mut refused = false;
    loop {
        let received = read_frame(stream, &mut pixels)?;
        let received_us = monotonic_us();
        let header = match received {
            Received::Frame(header) => header,
            Received::PixelsLost(header) => {
                tracing::warn!(
                    camera = eye.name(),
                    frame = header.sequence,
                    "pixels damaged on the way; not used"
                );
                continue;
            }
        };
        match eye.look(&header, &pixels) {
            Ok(observation) => {
                let sighting = Sighting {
                    camera: eye.name().to_owned(),
                    received_us,
                    located_us: monotonic_us(),
                    observation,
                };
                let mut line = serde_json::to_vec(&sighting).map_err(io::Error::from)?;
                line.push(b'\n');
                lines.send(&line)?;
            }
            Err(problem) => {
                if !std::mem::replace(&mut refused, true) {
                    tracing::error!(camera = eye.name(), %problem, "the pictures cannot be used");
                }
            }
        }
    }
}
