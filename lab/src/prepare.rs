//! Before a run: robots stand at their starts, answer, and are seen.

use crate::approach::{self, Approach};
use crate::commander::Still;
use crate::ear::{STATUS_CLOCK_KNOWN, STATUS_LATCHED};
use crate::estimator::wrap_rad;
use crate::gather::{gather, nobody_carries, place};
use crate::lab::Lab;
use crate::lease::Lease;
use crate::link::HeldPort;
use crate::pose_frame::SeenPose;
use crate::record::LogLevel;
use crate::recorder::RecorderHandle;
use crate::run::{self, Conclusion, outside_ending};
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
pub(crate) const TIME_LIMIT: Duration = Duration::from_secs(15);
/// Between two looks.
const LOOK_PERIOD: Duration = Duration::from_millis(20);
/// Everything must have been in place for this long.
const SETTLED: Duration = Duration::from_millis(300);
/// Between two frames without motion: robots need a few to know the laboratory's clock.
const FRAME_PERIOD: Duration = Duration::from_millis(16);
/// Older poses and telemetry do not count.
pub(crate) const FRESH_US: i64 = 100_000;
/// Distance and angle from the start.
const START_TOLERANCE_M: f64 = 0.05;
const START_TOLERANCE_RAD: f64 = 0.1;

/// Keeps robots awake and still on a thread of its own until a loop takes over.
#[derive(Debug)]
pub struct Keeper {
    over: Arc<AtomicBool>,
    thread: Option<JoinHandle<Vec<HeldPort>>>,
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
        Ok(Self {
            over,
            thread: Some(thread),
        })
    }

    /// Gives the ports on. Blocks for up to one frame period.
    pub fn stop(mut self) -> Vec<HeldPort> {
        self.over.store(true, Ordering::Release);
        // After a panic the ports are back with the link, and a run without ports cannot start.
        self.thread
            .take()
            .and_then(|thread| thread.join().ok())
            .unwrap_or_default()
    }
}

/// A preparation that fails gives the ports back to the link, for the next run.
impl Drop for Keeper {
    fn drop(&mut self) {
        self.over.store(true, Ordering::Release);
    }
}

/// Brings the robots to their starts and waits until they are ready: those on the floor drive, the others are carried.
///
/// - `parked`: robots of no run that stay where they are.
/// - `ports`: of the run's robots, in the order of the experiment; they come back.
pub async fn prepare(
    lab: &Arc<Lab>,
    assignment: &Assignment,
    parked: &[u8],
    lease: &Arc<Lease>,
    recorder: &RecorderHandle,
    ports: Vec<HeldPort>,
) -> Result<Vec<HeldPort>, Conclusion> {
    let mut keeper = run::keep(lab, ports)?;
    if gather(lab, assignment, parked, lease, recorder).await? {
        wait_ready(lab, assignment, lease, Place::Anywhere).await?;
        if !all_at_starts(lab, assignment) {
            let (ports, stuck) = match approach::drive(lab, assignment, lease, recorder, keeper.stop()).await? {
                Approach::Arrived(ports) => (ports, None),
                Approach::Stuck(ports, why) => (ports, Some(why)),
            };
            keeper = run::keep(lab, ports)?;
            if !all_at_starts(lab, assignment) {
                let why = stuck.unwrap_or_else(|| "they stopped elsewhere".to_owned());
                if lab.hand.is_none() {
                    return Err(nobody_carries(lab, assignment, &why));
                }
                recorder.log(LogLevel::Warning, format!("robots are carried to their starts: {why}"));
                place(lab, assignment, parked, lease, recorder).await?;
            }
        }
    }
    wait_ready(lab, assignment, lease, Place::Start).await?;
    recorder.log(LogLevel::Info, "robots are at their starts, seen and connected");
    Ok(keeper.stop())
}

/// Where robots must be.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Place {
    Anywhere,
    Start,
}

fn all_at_starts(lab: &Lab, assignment: &Assignment) -> bool {
    let starts = assignment.experiment.robots.iter().zip(&assignment.robots);
    let mut starts = starts.map(|(wanted, robot)| (robot.number, &wanted.start));
    starts.all(|(number, start)| {
        let seen = lab.localisation.pose(number);
        seen.is_some_and(|(pose, _)| is_at(&pose, start))
    })
}

pub(crate) async fn wait_ready(
    lab: &Lab,
    assignment: &Assignment,
    lease: &Lease,
    place: Place,
) -> Result<(), Conclusion> {
    let deadline = Instant::now() + TIME_LIMIT;
    let mut settled_since: Option<Instant> = None;
    loop {
        if let Some(conclusion) = outside_ending(lab, lease) {
            return Err(conclusion);
        }
        let missing = assignment.experiment.robots.iter().zip(&assignment.robots);
        let mut missing = missing.filter_map(|(wanted, robot)| {
            let start = (place == Place::Start).then_some(&wanted.start);
            unready(lab, robot.number, &wanted.name, start)
        });
        let missing = missing.next().or_else(|| (!lease.is_confirmed()).then(unconfirmed));
        match missing {
            None => {
                let since = *settled_since.get_or_insert_with(Instant::now);
                if since.elapsed() >= SETTLED {
                    return Ok(());
                }
            }
            Some(conclusion) if Instant::now() >= deadline => return Err(conclusion),
            Some(_) => settled_since = None,
        }
        tokio::time::sleep(LOOK_PERIOD).await;
    }
}

/// Within the tolerances of a start.
pub(crate) fn is_at(pose: &SeenPose, start: &Pose) -> bool {
    let distance_m = f64::hypot(pose.x_m - start.x_m, pose.y_m - start.y_m);
    let angle_rad = wrap_rad(pose.yaw_rad - start.yaw_rad).abs();
    // Written so that a pose that is not a number is off, too.
    distance_m <= START_TOLERANCE_M && angle_rad <= START_TOLERANCE_RAD
}

/// What a robot still lacks, as the end of the run if it stays so.
///
/// - `start`: where it must stand; anywhere when none.
fn unready(lab: &Lab, number: u8, name: &str, start: Option<&Pose>) -> Option<Conclusion> {
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
        return Some(if lab.hand.is_some() {
            let message = format!("No camera sees robot {name}.");
            Conclusion::failed(Whose::Platform, "robot_not_seen", message)
        } else {
            let message = format!(
                "No camera sees robot {name}, and this laboratory has no hand that puts it on the floor. Put it where cameras see it \
                 and submit again."
            );
            Conclusion::failed(Whose::Operator, "placing_failed", message)
        });
    };
    let start = start.filter(|start| !is_at(&pose, start))?;
    let distance_m = f64::hypot(pose.x_m - start.x_m, pose.y_m - start.y_m);
    let angle_rad = wrap_rad(pose.yaw_rad - start.yaw_rad).abs();
    let message = format!("Robot {name} stands {distance_m:.3} m and {angle_rad:.3} rad from its start.");
    Some(Conclusion::failed(Whose::Platform, "start_not_reached", message))
}

fn unconfirmed() -> Conclusion {
    Conclusion::failed(
        Whose::Platform,
        "lease_lost",
        "No heartbeat of the run got through.".to_owned(),
    )
}
