//! `robopheus-emulator`: an arena with robots and a tracker, in software.

use anyhow::Context;
use clap::Parser;
use emulator::applied::AppliedLog;
use emulator::camera::{CameraSet, CameraSettings};
use emulator::hand::Hand;
use emulator::hidden::Hidden;
use emulator::keys::{Keys, make_keys};
use emulator::link::Link;
use emulator::plant::TICK_HZ;
use emulator::tracker::TrackerStream;
use emulator::watchdog_log::WatchdogLog;
use emulator::{Laboratory, clock};
use robot::medium::{MediumKind, MediumProfile};
use std::net::IpAddr;
use std::path::PathBuf;

/// Telemetry and tracker run at a quarter of the firmware's rate: 120 Hz.
const TICKS_PER_PICTURE: u64 = 4;
/// A backlog longer than this (the process was stopped) is not made up for: the robots stood still meanwhile.
const MAX_BACKLOG_TICKS: i64 = 120;

/// Robots and tracker of a laboratory in software, speaking the hardware's bytes.
#[derive(Debug, Parser)]
#[command(name = "robopheus-emulator", version)]
struct Settings {
    /// The laboratory's file, robopheus.lab/1.
    #[arg(long, env = "ROBOPHEUS_LAB")]
    lab: PathBuf,
    /// Docks with chargers, robopheus.docks/1.
    #[arg(long, env = "ROBOPHEUS_DOCKS")]
    docks: Option<PathBuf>,
    /// Link keys, one per robot.
    #[arg(long, env = "ROBOPHEUS_KEYS")]
    keys: PathBuf,
    /// Make the key file if there is none.
    #[arg(long)]
    make_keys: bool,
    /// Robot n listens on this UDP port + n.
    #[arg(long, env = "ROBOPHEUS_ROBOT_UDP_BASE", default_value_t = 9000)]
    robot_udp_base: u16,
    /// Address that the robots listen on.
    #[arg(long, default_value = "127.0.0.1")]
    bind: IpAddr,
    /// Socket of the tracker stream; no tracker when left out.
    #[arg(long, env = "ROBOPHEUS_TRACKER")]
    tracker: Option<PathBuf>,
    /// A camera: calibration file and socket of its frames, with a comma between; once for each camera.
    #[arg(long, value_parser = calibration_and_socket)]
    camera: Vec<(PathBuf, PathBuf)>,
    /// Write down when each robot began to follow each command: robot, sequence, microseconds.
    #[arg(long)]
    applied_log: Option<PathBuf>,
    /// Write down when each robot's watchdog changed its state, and when it was fed last.
    #[arg(long)]
    watchdog_log: Option<PathBuf>,
    /// Pictures per second of each camera.
    #[arg(long, default_value_t = 60.0)]
    camera_hz: f64,
    /// What the cameras are like, `CameraSettings` as JSON; the usual ones when left out.
    #[arg(long)]
    camera_settings: Option<PathBuf>,
    /// Socket of the hand that puts robots on the floor.
    #[arg(long, env = "ROBOPHEUS_HAND")]
    hand: PathBuf,
    /// Hidden configuration of robots and floors; the built-in one when left out.
    #[arg(long)]
    plant: Option<PathBuf>,
    /// What carries the frames: ideal, wifi, wifi-bursty, digimesh or serial.
    #[arg(long, env = "ROBOPHEUS_MEDIUM", default_value = "wifi", value_parser = medium)]
    medium: MediumKind,
    /// Seed of noise and of the variation from run to run.
    #[arg(long, default_value_t = 1)]
    seed: u64,
}

fn calibration_and_socket(text: &str) -> Result<(PathBuf, PathBuf), String> {
    let (calibration, socket) = text
        .split_once(',')
        .ok_or("give calibration file and socket with a comma between")?;
    Ok((calibration.into(), socket.into()))
}

fn medium(name: &str) -> Result<MediumKind, String> {
    MediumProfile::named(name).map(|profile| profile.kind).ok_or_else(|| {
        let names: Vec<_> = MediumProfile::all().iter().map(|profile| profile.name).collect();
        format!("choose one of {}", names.join(", "))
    })
}

fn main() -> anyhow::Result<()> {
    let settings = Settings::parse();
    let filter = tracing_subscriber::EnvFilter::try_from_default_env().unwrap_or_else(|_| "info".into());
    tracing_subscriber::fmt()
        .with_writer(std::io::stderr)
        .with_env_filter(filter)
        .init();
    let text =
        std::fs::read_to_string(&settings.lab).with_context(|| format!("cannot read {}", settings.lab.display()))?;
    let description: api::lab::LabDescription = serde_json::from_str(&text)
        .with_context(|| format!("{} is not a laboratory's file", settings.lab.display()))?;
    if settings.make_keys && make_keys(&settings.keys, description.robots.iter().map(|robot| robot.number))? {
        tracing::info!(path = %settings.keys.display(), "link keys made");
    }
    let keys = Keys::read(&settings.keys).with_context(|| format!("cannot use {}", settings.keys.display()))?;
    let hidden = settings.plant.as_deref().map_or_else(Hidden::reference, Hidden::read)?;
    let mut laboratory = Laboratory::new(&description, hidden, &keys, settings.seed)?;
    if let Some(path) = &settings.docks {
        let text = std::fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))?;
        let docks = serde_json::from_str(&text).with_context(|| format!("{} holds no docks", path.display()))?;
        laboratory.set_docks(&docks)?;
    }
    clock::catch_end_signals();
    let mut link = Link::bind(
        settings.bind,
        settings.robot_udp_base,
        &laboratory,
        settings.medium,
        settings.seed,
    )?;
    let mut tracker = settings
        .tracker
        .as_deref()
        .map(|path| TrackerStream::listen(path, settings.seed))
        .transpose()?;
    let mut cameras = start_cameras(&settings)?;
    let mut logs = Logs {
        applied: settings.applied_log.as_deref().map(AppliedLog::create).transpose()?,
        watchdog: settings.watchdog_log.as_deref().map(WatchdogLog::create).transpose()?,
    };
    let mut hand = Hand::listen(&settings.hand)?;
    tracing::info!(
        robots = description.robots.len(),
        cameras = settings.camera.len(),
        udp_base = settings.robot_udp_base,
        "emulated laboratory is up"
    );
    run(
        &mut laboratory,
        &mut link,
        tracker.as_mut(),
        &mut cameras,
        &mut hand,
        &mut logs,
    );
    tracing::info!("emulated laboratory ends");
    Ok(())
}

/// What is written down for measurements.
struct Logs {
    applied: Option<AppliedLog>,
    watchdog: Option<WatchdogLog>,
}

impl Logs {
    /// Firmware steps are over.
    fn note(&mut self, laboratory: &Laboratory) {
        if let Some(log) = &mut self.applied
            && let Err(error) = log.note(clock::monotonic_us(), laboratory.units())
        {
            tracing::warn!(%error, "the log of applied commands cannot be written");
            self.applied = None;
        }
        if let Some(log) = &mut self.watchdog
            && let Err(error) = log.note(clock::monotonic_us(), laboratory.units())
        {
            tracing::warn!(%error, "the log of the watchdogs cannot be written");
            self.watchdog = None;
        }
    }
}

fn start_cameras(settings: &Settings) -> anyhow::Result<CameraSet> {
    let camera_settings: CameraSettings = match &settings.camera_settings {
        None => CameraSettings {
            seed: settings.seed,
            ..CameraSettings::default()
        },
        Some(path) => {
            let text = std::fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))?;
            serde_json::from_str(&text).with_context(|| format!("{} is not a camera's settings", path.display()))?
        }
    };
    Ok(CameraSet::start(
        &settings.camera,
        &camera_settings,
        settings.camera_hz,
        clock::monotonic_us(),
    )?)
}

/// Firmware and plant at 480 Hz against absolute deadlines, telemetry and pictures every fourth tick.
fn run(
    laboratory: &mut Laboratory,
    link: &mut Link,
    mut tracker: Option<&mut TrackerStream>,
    cameras: &mut CameraSet,
    hand: &mut Hand,
    logs: &mut Logs,
) {
    let tick_us = |tick: i64| tick * 1_000_000 / i64::from(TICK_HZ);
    let (mut start_us, mut done, mut pictures) = (clock::monotonic_us(), 0i64, 0u64);
    while !clock::end_requested() {
        // With nothing on the floor, four firmware steps at a time are fine enough.
        let stride = if laboratory.is_floor_empty() {
            TICKS_PER_PICTURE as i64
        } else {
            1
        };
        link.run_until(start_us + tick_us(done + stride), laboratory);
        let now_us = clock::monotonic_us();
        let mut due = (now_us - start_us) * i64::from(TICK_HZ) / 1_000_000 - done;
        if due > MAX_BACKLOG_TICKS {
            tracing::warn!(ticks = due, "the emulator was held up; robots stood still meanwhile");
            start_us += tick_us(due - 1);
            due = 1;
        }
        for _ in 0..due {
            laboratory.tick(now_us);
            done += 1;
            // The plant stands at its last tick, not at this moment.
            cameras.note(start_us + tick_us(done), laboratory.units());
        }
        if due > 0 {
            logs.note(laboratory);
        }
        let picture = done as u64 / TICKS_PER_PICTURE;
        if picture > pictures {
            pictures = picture;
            hand.poll(laboratory, cameras);
            link.send_telemetry(laboratory, clock::monotonic_us);
            if let Some(tracker) = &mut tracker {
                tracker.expose(start_us + tick_us(done), laboratory.expose());
            }
        }
        if let Some(tracker) = &mut tracker {
            tracker.poll(clock::monotonic_us());
        }
    }
}
