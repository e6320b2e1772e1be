//! One control tick: poses and telemetry in, one order per robot out. No clock, socket or thread: times are arguments,
//! orders go to an [`Outlet`], records to a [`Sink`]. The running loop and the drills in virtual time use the same pilot.

use crate::commander::{Sent, Still};
use crate::delay::DelayMeter;
use crate::ear::{STATUS_LATCHED, STATUS_STOPPED};
use crate::estimator::{Belief, PoseSample, PoseTrack};
use crate::interventions;
use crate::notes;
use crate::pose_frame::{PoseFrame, SeenPose};
use crate::record::{Command, Log, LogLevel, Picture, Pose, Record, Telemetry};
use crate::robot_limits::RobotLimits;
use crate::safety::{Ending, Inputs, Permission, RobotHealth, Safety, Signals};
use crate::strangers::{self, Strangers};
use control::law::RobotObservation;
use control::safety::SafeCommand;
use control::team::{Team, TeamOutput};
use twin::pose::Pose as TwinPose;
use twin::twist::BodyTwist;

/// Stop frames at the end: at least 0.3 s, then until the wheels rest, at most 1.5 s.
const STOP_TICKS_LEAST: i64 = 36;
const STOP_TICKS_MOST: i64 = 180;
/// A robot is at rest when no wheel has turned further than this ...
const REST_TURN_RAD: f64 = 0.02;
/// ... for this long. Angles, not speeds: a motor may chatter in the backlash of its gear while the wheel stands.
const REST_SPAN_US: i64 = 100_000;
/// Telemetry further apart than this says nothing about the travel between.
const TRAVEL_GAP_S: f64 = 0.05;
/// Nor does telemetry whose moment is less certain than this.
const TRAVEL_BOUND_US: i64 = 50_000;

/// The way to the robots, by their place in the experiment.
pub trait Outlet {
    /// Sends a command of the safety filter.
    fn drive(&mut self, place: usize, command: &SafeCommand, tick: u32) -> Sent;
    /// Sends a frame without motion.
    fn still(&mut self, place: usize, still: Still, tick: u32) -> Sent;
    /// All robots have their order of this tick: what was kept back for a group goes out now.
    fn finish(&mut self, _tick: u32) {}
}

/// Takes records down; never waits.
pub trait Sink {
    fn push(&mut self, record: Record);
}

impl Sink for Vec<Record> {
    fn push(&mut self, record: Record) {
        self.push(record);
    }
}

/// One robot of the run.
#[derive(Debug, Clone)]
pub struct PilotRobot {
    pub number: u8,
    pub name: String,
    pub track: PoseTrack,
    /// Newest telemetry; the run starts with a fresh one.
    pub telemetry: Telemetry,
    pub wheel_radius_m: f64,
    /// How late it does what it is told.
    pub delay: DelayMeter,
    /// The last telemetry before which a wheel had turned noticeably.
    turned: Telemetry,
    /// Kinds of disbelieved poses that were logged already.
    logged: [bool; 2],
}

impl PilotRobot {
    /// - `track`: holds the first pose already.
    pub fn new(number: u8, name: String, track: PoseTrack, telemetry: Telemetry, limits: &RobotLimits) -> Self {
        Self {
            number,
            name,
            track,
            telemetry,
            wheel_radius_m: limits.wheel_radius_m,
            delay: DelayMeter::new(limits.answer_s, limits.nominal),
            turned: telemetry,
            logged: [false; 2],
        }
    }
}

/// See the module.
#[derive(Debug)]
pub struct Pilot {
    team: Team,
    /// In the order of the experiment.
    robots: Vec<PilotRobot>,
    numbers: Vec<u8>,
    duration_ticks: i64,
    /// Added to the number of a tick in the records.
    first_tick: i64,
    safety: Safety,
    health: Vec<RobotHealth>,
    observations: Vec<RobotObservation>,
    newest_exposure_us: i64,
    /// First tick of the stopping phase.
    stopping_since: Option<i64>,
    holding: bool,
    overdue: u32,
    /// The law sees poses of when its commands take effect, not of the past.
    looks_ahead: bool,
    strangers: Strangers,
}

impl Pilot {
    /// - `robots`: in the order of the experiment, as many as the team has.
    /// - `start_us`: when the first tick is due.
    pub fn new(team: Team, robots: Vec<PilotRobot>, duration_ticks: i64, start_us: i64) -> Self {
        let count = robots.len();
        let poses = robots.iter().filter_map(|robot| robot.track.newest());
        Self {
            newest_exposure_us: poses.map(|pose| pose.exposure_us).max().unwrap_or(start_us),
            team: team.with_moving(strangers::MOST).learning(),
            numbers: robots.iter().map(|robot| robot.number).collect(),
            robots,
            duration_ticks,
            first_tick: 0,
            safety: Safety::default(),
            health: Vec::with_capacity(count),
            observations: Vec::with_capacity(count),
            stopping_since: None,
            holding: false,
            overdue: 0,
            looks_ahead: true,
            strangers: Strangers::default(),
        }
    }

    /// Who else may stand on the floor; without it their sizes are assumed.
    #[must_use]
    pub fn among(mut self, strangers: Strangers) -> Self {
        self.strangers = strangers;
        self
    }

    /// Whether the law sees where robots will be when its commands take effect (the default) or where they were measured;
    /// the safety filter sees what was measured either way.
    #[must_use]
    pub fn looking_ahead(mut self, looks_ahead: bool) -> Self {
        self.looks_ahead = looks_ahead;
        self
    }

    /// Nothing is learnt of the robots during the run, in place of the share of its yaw rate that each turns (the default).
    #[must_use]
    pub fn without_learning(mut self) -> Self {
        self.team = self.team.without_learning();
        self
    }

    /// The laws' team.
    pub fn team(&self) -> &Team {
        &self.team
    }

    /// Numbers the ticks of the records from here instead of 0.
    #[must_use]
    pub fn numbered_from(mut self, first_tick: i64) -> Self {
        self.first_tick = first_tick;
        self
    }

    /// In the order of the experiment.
    pub fn robots(&self) -> &[PilotRobot] {
        &self.robots
    }

    /// Mid-exposure of the newest picture.
    pub fn newest_exposure_us(&self) -> i64 {
        self.newest_exposure_us
    }

    /// Says that the next tick, and as many before it as make up `ticks`, came too late for new commands: the last ones are
    /// decelerated, from the second in a row on the robots stop. 0: it is in time.
    pub fn overdue(&mut self, ticks: u32) {
        self.overdue = ticks;
    }

    /// One tick; the ending comes out when everything is at rest.
    ///
    /// - `slot`: number of the tick on the 120 Hz grid.
    pub fn tick(
        &mut self,
        slot: i64,
        now_us: i64,
        signals: Signals,
        outlet: &mut impl Outlet,
        sink: &mut impl Sink,
    ) -> Option<Ending> {
        self.look(now_us);
        let inputs = Inputs {
            now_us,
            tracker_age_us: now_us - self.newest_exposure_us,
            robots: &self.health,
            signals,
            team_finished: self.team.is_done(),
            team_stuck: self.team.is_stuck(),
            team_faulty: self.team.fault().is_some(),
            time_over: slot >= self.duration_ticks,
        };
        match self.safety.tick(&inputs) {
            Permission::Drive => {
                self.note_hold(false, now_us, sink);
                self.drive(slot, now_us, outlet, sink);
                None
            }
            Permission::Hold => {
                self.note_hold(true, now_us, sink);
                self.rest(slot, Still::Rest, outlet, sink);
                None
            }
            Permission::Ended(ending) => {
                let still = if ending == Ending::ProtectiveStop {
                    Still::Latch
                } else {
                    Still::Rest
                };
                let stopped_ticks = slot - *self.stopping_since.get_or_insert(slot);
                self.rest(slot, still, outlet, sink);
                let resting = stopped_ticks >= STOP_TICKS_LEAST && self.at_rest();
                (resting || stopped_ticks >= STOP_TICKS_MOST).then_some(ending)
            }
        }
    }

    /// Takes a picture's poses.
    pub fn see(&mut self, frame: &PoseFrame, now_us: i64, sink: &mut impl Sink) {
        self.newest_exposure_us = self.newest_exposure_us.max(frame.exposure_us);
        sink.push(Record::Picture(Picture {
            camera: frame.camera.clone(),
            frame: frame.frame,
            exposure_us: frame.exposure_us,
            received_us: frame.received_us,
            located_us: frame.located_us,
            arrival_us: frame.arrival_us,
            robots: frame.poses.len() as u32,
        }));
        let sample = |pose: &SeenPose| PoseSample {
            exposure_us: frame.exposure_us,
            x_m: pose.x_m,
            y_m: pose.y_m,
            yaw_rad: pose.yaw_rad,
        };
        for pose in &frame.refused {
            if let Some(robot) = self.robots.iter_mut().find(|robot| robot.number == pose.number) {
                robot.track.refused(sample(pose));
            }
        }
        for pose in &frame.poses {
            let Some(robot) = self.robots.iter_mut().find(|robot| robot.number == pose.number) else {
                self.strangers.see(pose, frame.exposure_us);
                continue;
            };
            let belief = robot.track.observe(sample(pose), pose.velocity);
            robot.log_disbelief(belief, now_us, sink);
            if belief == Belief::Accepted {
                robot.delay.seen(frame.exposure_us, robot.track.twist());
            }
            sink.push(Record::Pose(Pose {
                robot: pose.number,
                frame: frame.frame,
                camera: frame.camera.clone(),
                exposure_us: frame.exposure_us,
                arrival_us: frame.arrival_us,
                x_m: pose.x_m,
                y_m: pose.y_m,
                yaw_rad: pose.yaw_rad,
                accepted: belief == Belief::Accepted,
                spread: pose.spread,
            }));
        }
    }

    /// Takes a robot's telemetry.
    pub fn hear(&mut self, telemetry: Telemetry, sink: &mut impl Sink) {
        let Some(robot) = self.robots.iter_mut().find(|robot| robot.number == telemetry.robot) else {
            return;
        };
        robot.note_travel(&telemetry);
        robot.note_turn(&telemetry);
        robot.delay.heard(&telemetry);
        robot.telemetry = telemetry;
        sink.push(Record::Telemetry(telemetry));
    }

    /// Fills what the safety rules and the team see.
    fn look(&mut self, now_us: i64) {
        self.health.clear();
        self.observations.clear();
        for robot in &self.robots {
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

    fn drive(&mut self, slot: i64, now_us: i64, outlet: &mut impl Outlet, sink: &mut impl Sink) {
        for (place, robot) in self.robots.iter().enumerate() {
            self.team.filter_mut().set_latency_s(place, robot.delay.latency_s());
            self.team
                .set_answer(place, self.looks_ahead.then(|| robot.delay.answer()));
        }
        self.team.filter_mut().see_moving(self.strangers.discs(now_us));
        let overdue = std::mem::take(&mut self.overdue);
        for _ in 1..overdue {
            self.team.missed_tick(&self.observations);
        }
        let outputs = if overdue > 0 {
            self.team.missed_tick(&self.observations)
        } else {
            self.team.tick(&self.observations)
        };
        let robots = self.robots.iter_mut().zip(outputs).zip(&self.health);
        for (place, ((robot, output), health)) in robots.enumerate() {
            let sent = outlet.drive(place, &output.safe, link_tick(slot));
            robot.delay.sent(sent.sequence, sent.at_us, parts(output.safe.twist()));
            let record = command_record(robot.number, self.first_tick + slot, &sent, Some(output), health);
            sink.push(Record::Command(record));
        }
        outlet.finish(link_tick(slot));
        // After the frames: nothing here is as urgent as they are.
        for (robot, output) in self.robots.iter().zip(outputs) {
            if let Some(intervention) = &output.intervention {
                let tick = self.first_tick + slot;
                let record = interventions::record(intervention, &self.numbers, robot.number, tick, now_us);
                sink.push(Record::Intervention(record));
            }
        }
        if overdue == 0 {
            notes::tell(self.team.notes(), self.first_tick + slot, now_us, sink);
        }
    }

    fn rest(&mut self, slot: i64, still: Still, outlet: &mut impl Outlet, sink: &mut impl Sink) {
        for (place, (robot, health)) in self.robots.iter_mut().zip(&self.health).enumerate() {
            let sent = outlet.still(place, still, link_tick(slot));
            robot.delay.sent(sent.sequence, sent.at_us, [0.0; 3]);
            sink.push(Record::Command(Command {
                ended: self.stopping_since.is_some(),
                ..command_record(robot.number, self.first_tick + slot, &sent, None, health)
            }));
        }
        outlet.finish(link_tick(slot));
        // The team must not believe that its last command is still being followed.
        self.team.stop();
    }

    fn note_hold(&mut self, holding: bool, now_us: i64, sink: &mut impl Sink) {
        if self.holding != holding {
            self.holding = holding;
            let message = if holding {
                "localisation silent: robots hold still"
            } else {
                "localisation is back: robots move on"
            };
            sink.push(warning(now_us, message.to_owned()));
        }
    }

    fn at_rest(&self) -> bool {
        let rests = |robot: &PilotRobot| robot.telemetry.sample_us - robot.turned.sample_us >= REST_SPAN_US;
        self.robots.iter().all(rests)
    }
}

impl PilotRobot {
    fn health(&self, now_us: i64) -> RobotHealth {
        RobotHealth {
            telemetry_age_us: now_us - self.telemetry.arrival_us,
            pose_age_us: self.track.newest().map_or(i64::MAX, |pose| now_us - pose.exposure_us),
            deaf: self.telemetry.status & (STATUS_LATCHED | STATUS_STOPPED) == STATUS_LATCHED,
        }
    }

    /// Tells the estimator how far the wheels rolled since the last telemetry.
    fn note_travel(&mut self, telemetry: &Telemetry) {
        let elapsed_s = (telemetry.sample_us - self.telemetry.sample_us) as f64 * 1e-6;
        if !(0.0..TRAVEL_GAP_S).contains(&elapsed_s) || telemetry.sample_bound_us > TRAVEL_BOUND_US {
            self.track.wheels_unknown();
            return;
        }
        let fastest = telemetry
            .wheel_rad_per_s
            .iter()
            .fold(0.0, |fastest: f64, speed| fastest.max(speed.abs()));
        let known_until_us = telemetry.sample_us.saturating_sub(telemetry.sample_bound_us);
        self.track
            .wheels_travelled_until(fastest * self.wheel_radius_m * elapsed_s, known_until_us);
    }

    fn note_turn(&mut self, telemetry: &Telemetry) {
        let mut wheels = telemetry.wheel_rad.iter().zip(&self.turned.wheel_rad);
        if wheels.any(|(now, before)| (now - before).abs() > REST_TURN_RAD) {
            self.turned = *telemetry;
        }
    }

    fn log_disbelief(&mut self, belief: Belief, now_us: i64, sink: &mut impl Sink) {
        let [jump, frozen] = &mut self.logged;
        let (logged, what) = match belief {
            Belief::Jump | Belief::Broken => (jump, "a pose is further away than the robot can have moved"),
            Belief::Frozen => (frozen, "poses stand still while the wheels turn"),
            Belief::Accepted | Belief::Old => return,
        };
        if !std::mem::replace(logged, true) {
            sink.push(warning(
                now_us,
                format!("localisation, {}: {what}; not used", self.name),
            ));
        }
    }
}

fn warning(at_us: i64, message: String) -> Record {
    Record::Log(Log {
        at_us,
        level: LogLevel::Warning,
        message,
    })
}

/// Forward m/s, left m/s, yaw rate rad/s.
pub(crate) const fn parts(twist: BodyTwist) -> [f64; 3] {
    [twist.forward_m_per_s, twist.left_m_per_s, twist.yaw_rate_rad_per_s]
}

/// Tick field of a frame.
fn link_tick(slot: i64) -> u32 {
    u32::try_from(slot).unwrap_or(0)
}

fn command_record(robot: u8, tick: i64, sent: &Sent, output: Option<&TeamOutput>, health: &RobotHealth) -> Command {
    Command {
        tick,
        robot,
        sent_us: sent.at_us,
        sequence: sent.sequence,
        enable: sent.enable,
        wheel_rad_per_s: sent.wheel_rad_per_s,
        steering_rad: sent.steering_rad,
        twist: output.map_or([0.0; 3], |output| parts(output.safe.twist())),
        desired: output.map_or([0.0; 3], |output| parts(output.desired)),
        target_m: output.map(|output| output.target),
        pose_age_us: health.pose_age_us,
        link_age_us: health.telemetry_age_us,
        finished: output.is_some_and(|output| output.finished),
        ended: false,
    }
}
