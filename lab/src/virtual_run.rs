//! A run in which the twin stands for the robots: ticks of a rehearsal in, the records of a run out. No clock, no socket.
//!
//! The same laws, the same filter and the same ticks as in the rehearsal that admitted the experiment, so the trace digest at
//! the end is the one of its verdict. What the model's sensors tell is written down without noise.

use crate::archive::parquet::driven_wheels;
use crate::interventions;
use crate::notes;
use crate::pilot::{Sink, parts};
use crate::record::{CameraName, Command, LINK_WHEELS, Pose, Record, Telemetry};
use crate::safety::Ending;
use crate::schedule::TICK_HZ;
use api::lab::Assignment;
use control::rehearsal::Rehearsal;
use control::scenario::{FieldProblem, Scenario};
use control::team::TeamOutput;
use twin::free::RobotState;

/// Name of the camera in the records.
pub const CAMERA: &str = "twin";

/// See the module.
#[derive(Debug)]
pub struct VirtualRun {
    twin: Rehearsal,
    robots: Vec<VirtualRobot>,
    numbers: Vec<u8>,
    camera: CameraName,
    start_us: i64,
    tick: i64,
}

#[derive(Debug)]
struct VirtualRobot {
    number: u8,
    /// Positions in `wheels` of the driven wheels: the order of the records.
    driven: Vec<usize>,
}

impl VirtualRun {
    /// - `start_us`: the time of tick 0 in the records.
    /// - Errors: an experiment that the twin cannot run.
    pub fn new(scenario: &Scenario, assignment: &Assignment, start_us: i64) -> Result<Self, Vec<FieldProblem>> {
        let robot = |robot: &api::robot::LabRobot| VirtualRobot {
            number: robot.number,
            driven: driven_wheels(&robot.description),
        };
        Ok(Self {
            twin: sandbox::start::rehearsal(scenario)?,
            robots: assignment.robots.iter().map(robot).collect(),
            numbers: assignment.robots.iter().map(|robot| robot.number).collect(),
            camera: CAMERA.into(),
            start_us,
            tick: 0,
        })
    }

    /// Number of the next tick.
    pub fn tick(&self) -> i64 {
        self.tick
    }

    /// When a tick is due.
    pub fn due_us(&self, tick: i64) -> i64 {
        self.start_us + tick * 1_000_000 / TICK_HZ
    }

    /// Trace digest so far.
    pub fn digest(&self) -> String {
        self.twin.digest()
    }

    /// Why the user's own controller cannot go on, in words.
    pub fn fault(&self) -> Option<String> {
        self.twin.fault().map(ToString::to_string)
    }

    /// Writes down where everybody stands before the first tick.
    pub fn begin(&self, sink: &mut impl Sink) {
        self.tell_states(0, sink);
    }

    /// One tick; how the run ended, when it did.
    pub fn step(&mut self, sink: &mut impl Sink) -> Option<VirtualEnding> {
        let tick = self.tick;
        let more = self.twin.step();
        self.tell_orders(tick, sink);
        notes::tell(self.twin.notes(), tick, self.due_us(tick), sink);
        if self.twin.is_broken() {
            return Some(VirtualEnding::Broken);
        }
        self.tick += 1;
        self.tell_states(self.tick, sink);
        (!more).then_some(VirtualEnding::As(if self.twin.fault().is_some() {
            Ending::ControllerFault
        } else if self.twin.is_stuck() {
            Ending::Deadlock
        } else {
            Ending::Finished
        }))
    }

    fn tell_orders(&self, tick: i64, sink: &mut impl Sink) {
        let at_us = self.due_us(tick);
        for (robot, output) in self.robots.iter().zip(self.twin.outputs()) {
            sink.push(Record::Command(robot.command(tick, at_us, output)));
            if let Some(intervention) = &output.intervention {
                let record = interventions::record(intervention, &self.numbers, robot.number, tick, at_us);
                sink.push(Record::Intervention(record));
            }
        }
    }

    fn tell_states(&self, tick: i64, sink: &mut impl Sink) {
        let at_us = self.due_us(tick);
        for (place, robot) in self.robots.iter().enumerate() {
            let state = self.twin.state(place);
            sink.push(Record::Telemetry(robot.telemetry(tick, at_us, &state)));
            sink.push(Record::Pose(Pose {
                robot: robot.number,
                frame: tick as u64,
                camera: self.camera.clone(),
                exposure_us: at_us,
                arrival_us: at_us,
                x_m: state.pose.x_m,
                y_m: state.pose.y_m,
                yaw_rad: twin::pose::wrapped_rad(state.pose.yaw_rad),
                accepted: true,
                spread: None,
            }));
        }
    }
}

/// How a run of the twin ends by itself.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum VirtualEnding {
    As(Ending),
    /// The twin's numbers are no longer finite.
    Broken,
}

impl VirtualRobot {
    fn command(&self, tick: i64, at_us: i64, output: &TeamOutput) -> Command {
        let wheels = output.safe.wheel_command();
        Command {
            tick,
            robot: self.number,
            sent_us: at_us,
            sequence: (tick + 1) as u32,
            enable: true,
            wheel_rad_per_s: self.pick(&wheels.wheel_rad_per_s),
            steering_rad: wheels.steering_rad,
            twist: parts(output.safe.twist()),
            desired: parts(output.desired),
            target_m: Some(output.target),
            pose_age_us: control::rehearsal::POSE_AGE_TICKS as i64 * 1_000_000 / TICK_HZ,
            link_age_us: 0,
            finished: output.finished,
            ended: false,
        }
    }

    fn telemetry(&self, tick: i64, at_us: i64, state: &RobotState) -> Telemetry {
        Telemetry {
            robot: self.number,
            arrival_us: at_us,
            sample_us: at_us,
            sample_bound_us: 0,
            robot_clock_ms: (tick * 1000 / TICK_HZ) as u32,
            status: 0,
            applied_sequence: tick as u32,
            wheel_rad_per_s: self.pick(&state.wheel_rad_per_s),
            wheel_rad: self.pick(&state.wheel_rad),
            current_a: self.pick(&state.current_a),
            bus_v: state.bus_v,
            gyro_z_rad_per_s: state.gyro_z_rad_per_s,
            accel_m_per_s2: [state.accel_x_m_per_s2, state.accel_y_m_per_s2],
            steering_rad: state.steering_rad,
        }
    }

    /// Driven wheels' values in the order of the records.
    fn pick(&self, values: &[f64]) -> [f64; LINK_WHEELS] {
        let mut picked = [0.0; LINK_WHEELS];
        for (place, wheel) in picked.iter_mut().zip(&self.driven) {
            *place = values.get(*wheel).copied().unwrap_or(0.0);
        }
        picked
    }
}
