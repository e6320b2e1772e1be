//! The control loop: tracker and telemetry in, commands out, 120 times a second on a thread of its own.
//!
//! It takes no lock, does no input or output except sending on the robot link, and hands everything it knows to the
//! recorder's queue. A tick that was slept through is dropped, not made up for.

use crate::clock::{monotonic_ns, monotonic_us, wait_until_ns};
use crate::estimator::{Belief, PoseSample, PoseTrack};
use crate::link::{HeldPort, Sent, Still};
use crate::realtime;
use crate::record::{Command, Intervention, LogLevel, Motion, Pose, Record, SafetyKind, Telemetry, Tick};
use crate::recorder::RecorderHandle;
use crate::safety::{Ending, Inputs, Permission, RobotHealth, Safety, Signals};
use crate::schedule::{Due, TickSchedule};
use crate::tracker::PoseFrame;
use control::law::RobotObservation;
use control::safety::Cause;
use control::team::{Team, TeamOutput};
use std::borrow::Cow;
use std::sync::mpsc::Receiver;
use twin::pose::Pose as TwinPose;
use twin::twist::BodyTwist;

/// Stop frames at the end: at least 0.3 s, then until the wheels rest, at most 1.5 s.
const STOP_TICKS_LEAST: i64 = 36;
const STOP_TICKS_MOST: i64 = 180;
/// A robot is at rest when no wheel has turned further than this ...
const REST_TURN_RAD: f64 = 0.02;
/// ... for this long. Angles, not speeds: a motor may chatter in the backlash of its gear while the wheel stands.
const REST_SPAN_US: i64 = 100_000;
/// Time from the start of the thread to the first tick.
const LEAD_NS: i64 = 20_000_000;
/// A tick that begins later than this after its time gets no new commands; see [`Team::missed_tick`].
const DEADLINE_NS: i64 = 4_000_000;
/// Telemetry further apart than this says nothing about the travel between.
const TRAVEL_GAP_S: f64 = 0.05;

/// Everything a run's loop owns.
pub struct Setup {
    pub team: Team,
    /// In the order of the experiment.
    pub robots: Vec<LoopRobot>,
    pub poses: Receiver<PoseFrame>,
    pub telemetry: Receiver<Telemetry>,
    pub recorder: RecorderHandle,
    /// Signals from outside, read once per tick; must not block.
    pub signals: Box<dyn Fn() -> Signals + Send>,
    pub duration_ticks: i64,
}

/// One robot in the loop.
pub struct LoopRobot {
    pub port: HeldPort,
    pub track: PoseTrack,
    /// Newest telemetry; the run starts with a fresh one.
    pub telemetry: Telemetry,
    /// The last telemetry before which a wheel had turned noticeably.
    pub turned: Telemetry,
    pub wheel_radius_m: f64,
    /// Kinds of disbelieved poses that were logged already.
    pub logged: [bool; 2],
}

/// How the loop ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LoopResult {
    pub ending: Ending,
    pub ticks: i64,
    pub missed: i64,
}

/// Runs to the end of the experiment, or to whatever ends it before, and until the wheels are at rest.
pub fn run(setup: Setup) -> LoopResult {
    let realtime = realtime::request();
    let start_ns = monotonic_ns() + LEAD_NS;
    let mut schedule = TickSchedule::new(start_ns);
    let mut control_loop = ControlLoop::new(setup, start_ns / 1000);
    control_loop.setup.recorder.push(Record::Motion(Motion {
        start_us: start_ns / 1000,
        realtime,
    }));
    let mut ticks = 0;
    loop {
        let due_ns = schedule.due_ns();
        wait_until_ns(due_ns);
        let woke_ns = monotonic_ns();
        let missed_before = schedule.missed();
        let Due { slot, late_ns } = schedule.wake(woke_ns);
        let overdue = overdue_ticks(late_ns, schedule.missed() - missed_before);
        ticks += 1;
        let woke_us = woke_ns / 1000;
        let ended = control_loop.tick(slot, overdue);
        schedule.done(monotonic_ns());
        let tick = Tick {
            tick: slot,
            due_us: woke_us - late_ns / 1000,
            woke_us,
            done_us: monotonic_us(),
            missed: schedule.missed(),
        };
        control_loop.setup.recorder.push(Record::Tick(tick));
        if let Some(ending) = ended {
            return LoopResult {
                ending,
                ticks,
                missed: schedule.missed(),
            };
        }
    }
}

struct ControlLoop {
    setup: Setup,
    safety: Safety,
    health: Vec<RobotHealth>,
    observations: Vec<RobotObservation>,
    newest_exposure_us: i64,
    /// First tick of the stopping phase.
    stopping_since: Option<i64>,
    holding: bool,
}

impl ControlLoop {
    fn new(setup: Setup, start_us: i64) -> Self {
        let count = setup.robots.len();
        let poses = setup.robots.iter().filter_map(|robot| robot.track.newest());
        Self {
            newest_exposure_us: poses.map(|pose| pose.exposure_us).max().unwrap_or(start_us),
            setup,
            safety: Safety::default(),
            health: Vec::with_capacity(count),
            observations: Vec::with_capacity(count),
            stopping_since: None,
            holding: false,
        }
    }

    /// One tick; the ending comes out when everything is at rest.
    fn tick(&mut self, slot: i64, overdue: u32) -> Option<Ending> {
        self.take_poses();
        self.take_telemetry();
        let now_us = monotonic_us();
        self.look(now_us);
        let inputs = Inputs {
            now_us,
            tracker_age_us: now_us - self.newest_exposure_us,
            robots: &self.health,
            signals: (self.setup.signals)(),
            team_finished: self.setup.team.is_done(),
            team_stuck: self.setup.team.is_stuck(),
            time_over: slot >= self.setup.duration_ticks,
        };
        match self.safety.tick(&inputs) {
            Permission::Drive => {
                self.note_hold(false);
                self.drive(slot, now_us, overdue);
                None
            }
            Permission::Hold => {
                self.note_hold(true);
                self.rest(slot, now_us, Still::Rest);
                None
            }
            Permission::Ended(ending) => {
                let still = if ending == Ending::ProtectiveStop {
                    Still::Latch
                } else {
                    Still::Rest
                };
                self.rest(slot, now_us, still);
                let stopped_ticks = slot - *self.stopping_since.get_or_insert(slot);
                let resting = stopped_ticks >= STOP_TICKS_LEAST && self.at_rest();
                (resting || stopped_ticks >= STOP_TICKS_MOST).then_some(ending)
            }
        }
    }

    fn take_poses(&mut self) {
        while let Ok(frame) = self.setup.poses.try_recv() {
            self.newest_exposure_us = self.newest_exposure_us.max(frame.exposure_us);
            for pose in &frame.poses {
                let of_run = |robot: &&mut LoopRobot| robot.port.robot().number == pose.number;
                let Some(robot) = self.setup.robots.iter_mut().find(of_run) else {
                    continue;
                };
                let sample = PoseSample {
                    exposure_us: frame.exposure_us,
                    x_m: pose.x_m,
                    y_m: pose.y_m,
                    yaw_rad: pose.yaw_rad,
                };
                let belief = robot.track.observe(sample);
                robot.log_disbelief(belief, &self.setup.recorder);
                self.setup.recorder.push(Record::Pose(Pose {
                    robot: pose.number,
                    frame: frame.frame,
                    camera: frame.camera.clone(),
                    exposure_us: frame.exposure_us,
                    arrival_us: frame.arrival_us,
                    x_m: pose.x_m,
                    y_m: pose.y_m,
                    yaw_rad: pose.yaw_rad,
                    accepted: belief == Belief::Accepted,
                }));
            }
        }
    }

    fn take_telemetry(&mut self) {
        while let Ok(telemetry) = self.setup.telemetry.try_recv() {
            let of_run = |robot: &&mut LoopRobot| robot.port.robot().number == telemetry.robot;
            let Some(robot) = self.setup.robots.iter_mut().find(of_run) else {
                continue;
            };
            robot.note_travel(&telemetry);
            robot.note_turn(&telemetry);
            robot.telemetry = telemetry;
            self.setup.recorder.push(Record::Telemetry(telemetry));
        }
    }

    /// Fills what the safety rules and the team see.
    fn look(&mut self, now_us: i64) {
        self.health.clear();
        self.observations.clear();
        for robot in &self.setup.robots {
            let health = robot.health(now_us);
            let pose = robot.track.newest().map_or(
                TwinPose {
                    x_m: f64::NAN,
                    y_m: f64::NAN,
                    yaw_rad: f64::NAN,
                },
                |pose| TwinPose {
                    x_m: pose.x_m,
                    y_m: pose.y_m,
                    yaw_rad: pose.yaw_rad,
                },
            );
            let [forward_m_per_s, left_m_per_s, yaw_rate_rad_per_s] = robot.track.twist();
            self.observations.push(RobotObservation {
                pose,
                pose_age_s: health.pose_age_us as f64 * 1e-6,
                twist: BodyTwist {
                    forward_m_per_s,
                    left_m_per_s,
                    yaw_rate_rad_per_s,
                },
                online: health.telemetry_age_us < crate::link::ONLINE_US,
            });
            self.health.push(health);
        }
    }

    fn drive(&mut self, slot: i64, now_us: i64, overdue: u32) {
        let Self {
            setup,
            observations,
            health,
            ..
        } = self;
        let Setup {
            team, robots, recorder, ..
        } = setup;
        for _ in 1..overdue {
            team.missed_tick();
        }
        let outputs = if overdue > 0 {
            team.missed_tick()
        } else {
            team.tick(observations)
        };
        for ((robot, output), health) in robots.iter_mut().zip(outputs).zip(health.iter()) {
            let sent = robot.port.drive(&output.safe, link_tick(slot));
            let number = robot.port.robot().number;
            recorder.push(Record::Command(command_record(
                number,
                slot,
                &sent,
                Some(output),
                health,
            )));
        }
        // After the frames: nothing here is as urgent as they are.
        for (robot, output) in robots.iter().zip(outputs) {
            if let Some(intervention) = &output.intervention {
                let (kind, cause, other) = explain(&intervention.cause, robots);
                recorder.push(Record::Intervention(Intervention {
                    tick: slot,
                    at_us: now_us,
                    robot: robot.port.robot().number,
                    kind,
                    cause: Cow::Borrowed(cause),
                    other,
                    change_m_per_s: intervention.change_m_per_s,
                    change_rad_per_s: intervention.change_rad_per_s,
                }));
            }
        }
    }

    fn rest(&mut self, slot: i64, now_us: i64, still: Still) {
        for robot in &mut self.setup.robots {
            let sent = robot.port.still(still, link_tick(slot));
            let health = robot.health(now_us);
            let number = robot.port.robot().number;
            self.setup
                .recorder
                .push(Record::Command(command_record(number, slot, &sent, None, &health)));
        }
        // The team must not believe that its last command is still being followed.
        self.setup.team.stop();
    }

    fn note_hold(&mut self, holding: bool) {
        if self.holding != holding {
            self.holding = holding;
            let message = if holding {
                "tracker silent: robots hold still"
            } else {
                "tracker is back: robots move on"
            };
            self.setup.recorder.log(LogLevel::Warning, message);
        }
    }

    fn at_rest(&self) -> bool {
        let rests = |robot: &LoopRobot| robot.telemetry.sample_us - robot.turned.sample_us >= REST_SPAN_US;
        self.setup.robots.iter().all(rests)
    }
}

impl LoopRobot {
    fn health(&self, now_us: i64) -> RobotHealth {
        RobotHealth {
            telemetry_age_us: now_us - self.telemetry.arrival_us,
            pose_age_us: self.track.newest().map_or(i64::MAX, |pose| now_us - pose.exposure_us),
        }
    }

    /// Tells the estimator how far the wheels rolled since the last telemetry.
    fn note_travel(&mut self, telemetry: &Telemetry) {
        let elapsed_s = (telemetry.sample_us - self.telemetry.sample_us) as f64 * 1e-6;
        if !(0.0..TRAVEL_GAP_S).contains(&elapsed_s) {
            return;
        }
        let fastest = telemetry
            .wheel_rad_per_s
            .iter()
            .fold(0.0, |fastest: f64, speed| fastest.max(speed.abs()));
        self.track.wheels_travelled(fastest * self.wheel_radius_m * elapsed_s);
    }

    fn note_turn(&mut self, telemetry: &Telemetry) {
        let mut wheels = telemetry.wheel_rad.iter().zip(&self.turned.wheel_rad);
        if wheels.any(|(now, before)| (now - before).abs() > REST_TURN_RAD) {
            self.turned = *telemetry;
        }
    }

    fn log_disbelief(&mut self, belief: Belief, recorder: &RecorderHandle) {
        let [jump, frozen] = &mut self.logged;
        let (logged, what) = match belief {
            Belief::Jump | Belief::Broken => (jump, "a pose is further away than the robot can have moved"),
            Belief::Frozen => (frozen, "poses stand still while the wheels turn"),
            Belief::Accepted | Belief::Old => return,
        };
        if !std::mem::replace(logged, true) {
            recorder.log(
                LogLevel::Warning,
                format!("tracker, {}: {what}; not used", self.port.robot().name),
            );
        }
    }
}

/// Ticks in a row, up to this one, that came too late for new commands: none when it is in time, two when ticks before it
/// were dropped.
fn overdue_ticks(late_ns: i64, dropped: i64) -> u32 {
    match (late_ns > DEADLINE_NS, dropped > 0) {
        (false, _) => 0,
        (true, false) => 1,
        (true, true) => 2,
    }
}

/// Tick field of a frame.
fn link_tick(slot: i64) -> u32 {
    u32::try_from(slot).unwrap_or(0)
}

fn command_record(robot: u8, tick: i64, sent: &Sent, output: Option<&TeamOutput>, health: &RobotHealth) -> Command {
    let twist = |twist: BodyTwist| [twist.forward_m_per_s, twist.left_m_per_s, twist.yaw_rate_rad_per_s];
    Command {
        tick,
        robot,
        sent_us: sent.at_us,
        sequence: sent.sequence,
        enable: sent.enable,
        wheel_rad_per_s: sent.wheel_rad_per_s,
        steering_rad: sent.steering_rad,
        twist: output.map_or([0.0; 3], |output| twist(output.safe.twist())),
        desired: output.map_or([0.0; 3], |output| twist(output.desired)),
        target_m: output.map(|output| output.target),
        pose_age_us: health.pose_age_us,
        link_age_us: health.telemetry_age_us,
        finished: output.is_some_and(|output| output.finished),
    }
}

/// Kind, cause and the other robot of an intervention.
fn explain(cause: &Cause, robots: &[LoopRobot]) -> (SafetyKind, &'static str, Option<u8>) {
    use control::safety::WallSide;
    match cause {
        Cause::Robot { other } => {
            let other = robots.get(*other as usize).map(|robot| robot.port.robot().number);
            (SafetyKind::Robot, "robot", other)
        }
        Cause::Wall { side: WallSide::Left } => (SafetyKind::Wall, "wall_left", None),
        Cause::Wall { side: WallSide::Right } => (SafetyKind::Wall, "wall_right", None),
        Cause::Wall { side: WallSide::Bottom } => (SafetyKind::Wall, "wall_bottom", None),
        Cause::Wall { side: WallSide::Top } => (SafetyKind::Wall, "wall_top", None),
        Cause::Geofence { .. } => (SafetyKind::Wall, "geofence", None),
        Cause::FixedObstacle { .. } => (SafetyKind::Wall, "fixed_obstacle", None),
        Cause::PushableObstacle { .. } => (SafetyKind::Wall, "pushable_obstacle", None),
        Cause::Deadlock => (SafetyKind::Robot, "deadlock", None),
        Cause::Speed => (SafetyKind::Speed, "speed", None),
        Cause::Steering => (SafetyKind::Speed, "steering", None),
        Cause::Turn => (SafetyKind::Speed, "turn", None),
        Cause::WheelSpeed => (SafetyKind::Speed, "wheel_speed", None),
        Cause::PoseAge => (SafetyKind::Stop, "pose_age", None),
        Cause::Latency => (SafetyKind::Stop, "latency", None),
        Cause::Offline => (SafetyKind::Stop, "offline", None),
        Cause::NotFinite => (SafetyKind::Stop, "not_finite", None),
        Cause::Infeasible => (SafetyKind::Stop, "infeasible", None),
        Cause::NotConverged => (SafetyKind::Stop, "not_converged", None),
        Cause::Late => (SafetyKind::Stop, "late", None),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tick_in_time_gets_new_commands_whatever_was_dropped_before() {
        assert_eq!(overdue_ticks(DEADLINE_NS, 0), 0);
        assert_eq!(overdue_ticks(DEADLINE_NS, 3), 0);
        assert_eq!(overdue_ticks(DEADLINE_NS + 1, 0), 1);
        assert_eq!(overdue_ticks(DEADLINE_NS + 1, 1), 2);
    }
}
