//! One run from its claim to its end.

use crate::carry_out::{self, carry_out, refused, report_running, scenario};
use crate::clock::monotonic_us;
use crate::edge::Edge;
use crate::estimator::{PoseSample, PoseTrack};
use crate::lab::{Activity, Lab};
use crate::ladder;
use crate::lease::Lease;
use crate::link::HeldPort;
use crate::loop_120hz::{self, LoopEnd, LoopResult, Setup};
use crate::medium;
use crate::parked::Parked;
use crate::pilot::PilotRobot;
use crate::prepare::{self, Keeper};
use crate::record::LogLevel;
use crate::recorder::RecorderHandle;
use crate::robot_limits::RobotLimits;
use crate::safety::{Ending, Signals};
use crate::schedule::TICK_HZ;
use crate::sleep_probe::SleepProbe;
use crate::strangers::Strangers;
use api::lab::Assignment;
use api::run::{Fault, RunState, Whose};
use sandbox::start::RUN_PATIENCE;
use std::sync::{Arc, PoisonError};

/// How a run ended.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Conclusion {
    pub state: RunState,
    pub fault: Option<Fault>,
}

impl Conclusion {
    /// Adds a reason in words to what it says of a fault.
    #[must_use]
    pub fn because(mut self, reason: Option<String>) -> Self {
        if let (Some(fault), Some(reason)) = (&mut self.fault, reason) {
            fault.message = format!("{}: {reason}.", fault.message.trim_end_matches('.'));
        }
        self
    }

    /// An end that the laboratory reports as `failed`.
    pub fn failed(whose: Whose, code: &str, message: String) -> Self {
        Self {
            state: RunState::Failed,
            fault: Some(Fault {
                whose,
                code: code.to_owned(),
                message,
            }),
        }
    }

    /// The end that the safety rules decided on.
    pub fn of(ending: Ending, robots: &[String]) -> Self {
        let (state, fault) = ending.report(robots);
        Self { state, fault }
    }
}

/// An end from outside while robots stand still: stop, shutdown, lease, cancel.
pub fn outside_ending(lab: &Lab, lease: &Lease) -> Option<Conclusion> {
    let pressed = lab.latch.is_pressed().then_some(Ending::ProtectiveStop);
    let ending = pressed.or_else(|| carry_out::outside_ending(&lab.desk, lease))?;
    Some(Conclusion::of(ending, &[]))
}

/// Carries a run out on the robots; how it ended comes back once that is reported and the files are handed in.
pub async fn run(lab: &Arc<Lab>, assignment: &Assignment) -> Conclusion {
    let run_id = assignment.run_id;
    let tell = |phase| lab.set_activity(Some(Activity { run_id, phase }));
    let drive = async |lease: &Arc<Lease>, recorder: &RecorderHandle| attempt(lab, assignment, lease, recorder).await;
    let conclusion = carry_out(&lab.desk, assignment, tell, drive).await;
    lab.set_activity(None);
    conclusion
}

/// Everything that can move robots; returns when they are at rest.
async fn attempt(lab: &Arc<Lab>, assignment: &Assignment, lease: &Arc<Lease>, recorder: &RecorderHandle) -> Conclusion {
    let parked = Parked::beside(lab, assignment).await;
    for robot in &parked.0 {
        let message = format!("{} stays at its dock, an obstacle for the safety filter", robot.name);
        recorder.log(LogLevel::Info, message);
    }
    let before = Edge::of(lab);
    let (Ok(conclusion) | Err(conclusion)) =
        try_attempt(lab, &parked.with(assignment), &parked.numbers(), lease, recorder).await;
    let robots = assignment.robots.iter();
    let robots: Vec<String> = robots.map(|robot| robot.description.name.clone()).collect();
    recorder.push(Edge::of(lab).since(&before, &robots).record());
    conclusion
}

async fn try_attempt(
    lab: &Arc<Lab>,
    assignment: &Assignment,
    parked: &[u8],
    lease: &Arc<Lease>,
    recorder: &RecorderHandle,
) -> Result<Conclusion, Conclusion> {
    let scenario = scenario(assignment).map_err(refused)?;
    // Half a second at worst for a program of the user's: it is compiled in its own process before anything moves.
    let team = tokio::task::spawn_blocking(move || sandbox::start::team(&scenario, RUN_PATIENCE))
        .await
        .map_err(|_| Conclusion::failed(Whose::Platform, "start_failed", "The team cannot be set up.".to_owned()))?
        .map_err(refused)?;
    let ports = take_ports(lab, assignment)?;
    let grouped = ports.len() > 1 && ports.iter().all(|port| port.takes_groups());
    medium::check(lab.medium, ports.len(), TICK_HZ as f64, grouped)?;
    let ports = prepare::prepare(lab, assignment, parked, lease, recorder, ports).await?;
    let keeper = keep(lab, ports)?;
    let running = report_running(&lab.desk, assignment, || outside_ending(lab, lease)).await;
    // The keeper holds the robots still up to here; the loop takes over within milliseconds.
    let poses = lab.localisation.listen();
    let telemetry = lab.link.listen();
    let ports = keeper.stop();
    running?;
    lab.set_activity(Some(Activity {
        run_id: assignment.run_id,
        phase: "running",
    }));
    let setup = Setup {
        team,
        robots: pilot_robots(lab, &ports, &limits(assignment)?)?,
        strangers: strangers(lab, assignment),
        ports,
        poses,
        telemetry,
        recorder: recorder.clone(),
        signals: signals(lab, lease, recorder, assignment),
        duration_ticks: (assignment.experiment.duration_s * TICK_HZ as f64).round() as i64,
        first_tick: 0,
        phase_us: lab.localisation.tick_phase_us(1e6 / TICK_HZ as f64),
    };
    recorder.log(
        LogLevel::Info,
        format!("motion begins: {}", assignment.experiment.control.law),
    );
    let probe = SleepProbe::start(recorder.clone());
    if let Err(error) = &probe {
        recorder.log(LogLevel::Warning, format!("the sleep probe does not run: {error}"));
    }
    let names: Vec<_> = assignment
        .experiment
        .robots
        .iter()
        .map(|robot| robot.name.clone())
        .collect();
    let LoopEnd { result, fault, .. } = run_loop(setup).await?;
    drop(probe);
    let LoopResult { ending, ticks, missed } = result;
    recorder.log(
        LogLevel::Info,
        format!("robots at rest after {ticks} ticks, {missed} missed"),
    );
    Ok(Conclusion::of(ending, &names).because(fault))
}

/// Motion limits of each robot.
pub(crate) fn limits(assignment: &Assignment) -> Result<Vec<RobotLimits>, Conclusion> {
    let robots = control::team::robots(&scenario(assignment).map_err(refused)?).map_err(refused)?;
    Ok(robots.iter().map(RobotLimits::of).collect())
}

/// Robots stand still and stay awake until something else takes over.
pub(crate) fn keep(lab: &Arc<Lab>, ports: Vec<HeldPort>) -> Result<Keeper, Conclusion> {
    Keeper::start(lab.clone(), ports).map_err(|error| {
        Conclusion::failed(
            Whose::Platform,
            "thread_refused",
            format!("A thread cannot be started: {error}."),
        )
    })
}

/// The right to send to all robots of the run, under its epoch.
fn take_ports(lab: &Lab, assignment: &Assignment) -> Result<Vec<HeldPort>, Conclusion> {
    let failed = |code: &str, message: String| Conclusion::failed(Whose::Platform, code, message);
    let numbers: Vec<u8> = assignment.robots.iter().map(|robot| robot.number).collect();
    let mut ports = Vec::new();
    for robot in &assignment.robots {
        let name = &robot.description.name;
        let link = lab.link.robot(robot.number).filter(|link| link.name == *name);
        let link = link.ok_or_else(|| failed("robot_unknown", format!("This laboratory has no robot {name}.")))?;
        ports.push(
            link.take_port()
                .ok_or_else(|| failed("robot_busy", format!("Robot {name} is in another run.")))?,
        );
    }
    let mut book = lab.book.lock().unwrap_or_else(PoisonError::into_inner);
    let epoch = book
        .begin(&numbers, assignment.epoch)
        .map_err(|error| failed("epoch_refused", format!("{error}.")))?;
    for port in &mut ports {
        port.begin_epoch(epoch);
    }
    Ok(ports)
}

pub(crate) fn pilot_robots(
    lab: &Lab,
    ports: &[HeldPort],
    limits: &[RobotLimits],
) -> Result<Vec<PilotRobot>, Conclusion> {
    let gone = || {
        Conclusion::failed(
            Whose::Platform,
            "robot_not_seen",
            "A robot vanished before the start.".to_owned(),
        )
    };
    if ports.len() != limits.len() {
        return Err(gone());
    }
    let made = ports.iter().zip(limits).map(|(port, limits)| {
        let robot = port.robot();
        let (pose, age_us) = lab.localisation.pose(robot.number)?;
        let telemetry = robot.newest()?;
        let mut track = PoseTrack::new(limits.motion);
        let sample = PoseSample {
            exposure_us: monotonic_us() - age_us,
            x_m: pose.x_m,
            y_m: pose.y_m,
            yaw_rad: pose.yaw_rad,
        };
        track.observe(sample, pose.velocity);
        let name = robot.name.clone();
        Some(PilotRobot::new(robot.number, name, track, telemetry, limits))
    });
    made.collect::<Option<_>>().ok_or_else(gone)
}

/// Sizes of the laboratory's robots: those that are not in the run may stand on the floor. Parked ones are obstacles of the
/// assignment under their names.
pub(crate) fn strangers(lab: &Lab, assignment: &Assignment) -> Strangers {
    let robots = lab.description.robots.iter();
    let known: Vec<_> = robots.map(|robot| (robot.number, robot.bounding_radius_m)).collect();
    let fixed = assignment.arena.contents.iter().flat_map(|contents| &contents.fixed);
    let parked = fixed.filter_map(|obstacle| {
        let mut robots = lab.description.robots.iter();
        let robot = robots.find(|robot| robot.description.name == obstacle.name)?;
        Some((robot.number, [obstacle.pose.x_m, obstacle.pose.y_m]))
    });
    Strangers::new(&known).beside(parked.collect())
}

pub(crate) fn signals(
    lab: &Arc<Lab>,
    lease: &Arc<Lease>,
    recorder: &RecorderHandle,
    assignment: &Assignment,
) -> Box<dyn Fn() -> Signals + Send> {
    let (lab, lease, recorder) = (lab.clone(), lease.clone(), recorder.clone());
    let numbers = assignment.robots.iter().map(|robot| robot.number);
    let robots: Vec<_> = numbers.filter_map(|number| lab.link.robot(number).cloned()).collect();
    Box::new(move || Signals {
        protective_stop: lab.latch.is_pressed(),
        shutdown: lab.desk.shutdown.is_requested(),
        stale_epoch: lease.is_stale(),
        cancel: lease.is_cancelled(),
        lease_until_us: lease.until_us(),
        recorder_failed: recorder.failed(),
        robot_finding: ladder::gravest(robots.iter().map(|robot| robot.finding())),
    })
}

pub(crate) async fn run_loop(setup: Setup) -> Result<LoopEnd, Conclusion> {
    let failed = |message: String| Conclusion::failed(Whose::Platform, "loop_failed", message);
    let (done, result) = tokio::sync::oneshot::channel();
    std::thread::Builder::new()
        .name("loop-120hz".to_owned())
        .spawn(move || {
            // Nobody waits any more only when the process ends.
            let _waiting = done.send(loop_120hz::run(setup));
        })
        .map_err(|error| failed(format!("The control loop cannot be started: {error}.")))?;
    result
        .await
        .map_err(|_| failed("The control loop failed; the robots stopped by themselves.".to_owned()))
}
