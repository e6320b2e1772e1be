//! Before a run: robots stand at their starts, answer, and are seen.

use crate::commander::Still;
use crate::ear::{STATUS_CLOCK_KNOWN, STATUS_LATCHED};
use crate::estimator::wrap_rad;
use crate::hand::{self, Placement};
use crate::lab::Lab;
use crate::lease::Lease;
use crate::link::HeldPort;
use crate::record::LogLevel;
use crate::recorder::RecorderHandle;
use crate::run::{Conclusion, outside_ending};
use api::experiment::Pose;
use api::lab::Assignment;
use api::run::Whose;
use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;
use tokio::time::Instant;

/// Everything must be in place within this time.
const TIME_LIMIT: Duration = Duration::from_secs(15);
/// The hand may be tried again after this.
const HAND_RETRY: Duration = Duration::from_millis(500);
/// Between two looks.
const LOOK_PERIOD: Duration = Duration::from_millis(20);
/// Everything must have been in place for this long.
const SETTLED: Duration = Duration::from_millis(300);
/// Between two frames without motion: robots need a few to know the laboratory's clock.
const FRAME_PERIOD: Duration = Duration::from_millis(16);
/// Older poses and telemetry do not count.
const FRESH_US: i64 = 100_000;
/// Distance and angle from the start.
const START_TOLERANCE_M: f64 = 0.05;
const START_TOLERANCE_RAD: f64 = 0.1;

/// Keeps robots awake and still on a thread of its own until a loop takes over.
#[derive(Debug)]
pub struct Keeper {
    over: Arc<AtomicBool>,
    thread: JoinHandle<Vec<HeldPort>>,
}

impl Keeper {
    /// Starts sending frames without motion; the protective stop turns them into stop frames.
    pub fn start(lab: Arc<Lab>, mut ports: Vec<HeldPort>) -> io::Result<Self> {
        let over = Arc::new(AtomicBool::new(false));
        let seen = over.clone();
        let thread = std::thread::Builder::new()
            .name("keep-still".to_owned())
            .spawn(move || {
                while !seen.load(Ordering::Acquire) {
                    let still = if lab.latch.is_pressed() {
                        Still::Latch
                    } else {
                        Still::Release
                    };
                    for port in &mut ports {
                        port.still(still, 0);
                    }
                    std::thread::sleep(FRAME_PERIOD);
                }
                ports
            })?;
        Ok(Self { over, thread })
    }

    /// Gives the ports on. Blocks for up to one frame period.
    pub fn stop(self) -> Vec<HeldPort> {
        self.over.store(true, Ordering::Release);
        // After a panic the ports are back with the link, and a run without ports cannot start.
        self.thread.join().unwrap_or_default()
    }
}

/// Places robots and waits until they are ready.
pub async fn prepare(
    lab: &Lab,
    assignment: &Assignment,
    lease: &Lease,
    recorder: &RecorderHandle,
) -> Result<(), Conclusion> {
    let deadline = Instant::now() + TIME_LIMIT;
    place(lab, assignment, lease, recorder, deadline).await?;
    let mut settled_since: Option<Instant> = None;
    loop {
        if let Some(conclusion) = outside_ending(lab, lease) {
            return Err(conclusion);
        }
        let missing = assignment.experiment.robots.iter().zip(&assignment.robots);
        let mut missing = missing.filter_map(|(wanted, robot)| unready(lab, robot.number, &wanted.name, &wanted.start));
        let missing = missing.next().or_else(|| (!lease.is_confirmed()).then(unconfirmed));
        match missing {
            None => {
                let since = *settled_since.get_or_insert_with(Instant::now);
                if since.elapsed() >= SETTLED {
                    recorder.log(LogLevel::Info, "robots are at their starts, seen and connected");
                    return Ok(());
                }
            }
            Some(conclusion) if Instant::now() >= deadline => return Err(conclusion),
            Some(_) => settled_since = None,
        }
        tokio::time::sleep(LOOK_PERIOD).await;
    }
}

async fn place(
    lab: &Lab,
    assignment: &Assignment,
    lease: &Lease,
    recorder: &RecorderHandle,
    deadline: Instant,
) -> Result<(), Conclusion> {
    let starts = assignment.experiment.robots.iter().zip(&assignment.robots);
    let placements: Vec<_> = starts
        .map(|(wanted, robot)| Placement {
            number: robot.number,
            x_m: wanted.start.x_m,
            y_m: wanted.start.y_m,
            yaw_rad: wanted.start.yaw_rad,
        })
        .collect();
    loop {
        let error = match hand::place(&lab.hand, &placements).await {
            Ok(()) => return Ok(()),
            Err(error) => error,
        };
        if let Some(conclusion) = outside_ending(lab, lease) {
            return Err(conclusion);
        }
        if Instant::now() + HAND_RETRY >= deadline {
            let message = format!("The robots could not be put at their starts: {error}.");
            return Err(Conclusion::failed(Whose::Platform, "placing_failed", message));
        }
        recorder.log(LogLevel::Warning, format!("placing the robots: {error}; trying again"));
        tokio::time::sleep(HAND_RETRY).await;
    }
}

/// What a robot still lacks, as the end of the run if it stays so.
fn unready(lab: &Lab, number: u8, name: &str, start: &Pose) -> Option<Conclusion> {
    let telemetry = lab.link.robot(number).and_then(|robot| robot.newest());
    let now_us = crate::clock::monotonic_us();
    let Some(telemetry) = telemetry.filter(|telemetry| now_us - telemetry.arrival_us < FRESH_US) else {
        let message = format!("Robot {name} does not answer on the robot link.");
        return Some(Conclusion::failed(Whose::Robot, "robot_silent", message));
    };
    if telemetry.status & STATUS_LATCHED != 0 || telemetry.status & STATUS_CLOCK_KNOWN == 0 {
        let message = format!("Robot {name} answers but does not accept commands.");
        return Some(Conclusion::failed(Whose::Robot, "robot_not_ready", message));
    }
    if lab.localisation.age_us().is_none_or(|age_us| age_us > FRESH_US) {
        return Some(Conclusion::failed(
            Whose::Platform,
            "localisation_silent",
            "The cameras tell nothing.".to_owned(),
        ));
    }
    let Some((pose, _)) = lab.localisation.pose(number).filter(|(_, age_us)| *age_us < FRESH_US) else {
        let message = format!("No camera sees robot {name}.");
        return Some(Conclusion::failed(Whose::Platform, "robot_not_seen", message));
    };
    let distance_m = f64::hypot(pose.x_m - start.x_m, pose.y_m - start.y_m);
    let angle_rad = wrap_rad(pose.yaw_rad - start.yaw_rad).abs();
    // Written so that a pose that is not a number is off, too.
    let is_there = distance_m <= START_TOLERANCE_M && angle_rad <= START_TOLERANCE_RAD;
    (!is_there).then(|| {
        let message = format!("Robot {name} stands {distance_m:.3} m and {angle_rad:.3} rad from its start.");
        Conclusion::failed(Whose::Platform, "start_not_reached", message)
    })
}

fn unconfirmed() -> Conclusion {
    Conclusion::failed(
        Whose::Platform,
        "lease_lost",
        "No heartbeat of the run got through.".to_owned(),
    )
}
