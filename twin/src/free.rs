//! One robot on an open floor.

use wide::f64x4;

use crate::command::WheelCommand;
use crate::effect::Runtime;
use crate::lanes::{LANES, four};
use crate::model::Model;
use crate::motor_control;
use crate::pose::Pose;
use crate::reversals::Reversals;
use crate::robot::Robot;
use crate::state::BodyState;
pub use crate::state::RobotState;
use crate::told::Told;
use crate::twist::BodyTwist;
use crate::{MAX_WHEELS, PHYSICS_PERIOD_S, SUBSTEPS, kernel};

/// Where a robot starts when it is not at rest.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Start {
    pub pose: Pose,
    pub twist: BodyTwist,
    /// By position in `wheels`.
    pub wheel_rad_per_s: [f64; MAX_WHEELS],
    /// By position in `wheels`; the control's integrals are set so that it holds this current at this wheel speed. 0 where it is not
    /// known.
    pub current_a: [f64; MAX_WHEELS],
    pub steering_rad: f64,
    /// The steering up to the start: on which side of its play the wheels lie. Empty: where a turn from straight ahead left
    /// them.
    pub steering_history: Reversals,
}

/// Errors of a speed loop at a start that are more than this many deviations of the encoder's noise are errors, and that noise where it is
/// not described, rad/s.
const NOISE_SIGMAS: f64 = 3.0;
const WHEEL_NOISE_RAD_PER_S: f64 = 0.05;

/// One robot on a floor without walls, stepped at 480 Hz by the same kernel as in [`crate::world::World`].
#[derive(Debug, Clone)]
pub struct FreeRobot {
    model: Model,
    runtime: Option<Runtime>,
    state: BodyState,
    steps: u64,
    refinement: u32,
}

impl FreeRobot {
    /// A robot at rest.
    pub fn at_rest(robot: &Robot, pose: Pose) -> FreeRobot {
        FreeRobot {
            model: Model::clone(robot.model()),
            runtime: robot.runtime(),
            state: BodyState::at_rest(robot.model(), pose),
            steps: 0,
            refinement: 1,
        }
    }

    /// A robot in motion.
    pub fn moving(robot: &Robot, start: &Start) -> FreeRobot {
        let mut free = FreeRobot::at_rest(robot, start.pose);
        let (model, state) = (&free.model, &mut free.state);
        state.set_twist(model, start.twist);
        state.steering_rad = model
            .steering
            .as_ref()
            .map_or(0.0, |steering| steering.limited_rad(start.steering_rad));
        for lane in 0..model.lanes {
            let wheel = model.wheel_of_lane[lane];
            state.wheel[lane] = start.wheel_rad_per_s[wheel] / model.encoder[lane];
            if let (Some(motor), true) = (&model.motor, model.powered[lane] > 0.0) {
                let current_a = start.current_a[wheel];
                let voltage_v = current_a / model.per_ohm[lane] + model.torque_per_current[lane] * state.wheel[lane];
                state.current[lane] = current_a;
                state.voltage[lane] = voltage_v;
                state.integral[lane] = motor.settled_integral_rad(voltage_v, 0.0);
            }
        }
        if let Some(runtime) = &mut free.runtime {
            runtime.settle(start, state);
            if let Some(drives) = &mut runtime.drives {
                drives.take_over(&runtime.live, state);
            }
        }
        free
    }

    /// Takes over what `other` is and remembers, without allocating; both must be made from the same robot. A robot with a
    /// motor controller of its own allocates.
    pub fn copy_from(&mut self, other: &FreeRobot) {
        self.state = other.state;
        self.steps = other.steps;
        self.refinement = other.refinement;
        match (&mut self.runtime, &other.runtime) {
            (Some(own), Some(other)) => own.copy_from(other),
            (own, other) => own.clone_from(other),
        }
    }

    /// Lays the robot elsewhere; how it moves and what it remembers stay as they are.
    pub fn lay(&mut self, pose: Pose) {
        let at_rest = BodyState::at_rest(self.model_now(), pose);
        let state = &mut self.state;
        (state.x_m, state.y_m, state.yaw_rad) = (at_rest.x_m, at_rest.y_m, at_rest.yaw_rad);
        (state.cos_yaw, state.sin_yaw) = (at_rest.cos_yaw, at_rest.sin_yaw);
    }

    /// Pose of the body origin after the last step.
    pub fn pose(&self) -> Pose {
        let (x_m, y_m) = self.state.origin_m(self.model_now());
        Pose {
            x_m,
            y_m,
            yaw_rad: self.state.yaw_rad,
        }
    }

    /// Lets the effects of commands (delay, lag, slew) remember that `command` has been in force for long.
    pub fn after_holding(mut self, command: &WheelCommand) -> FreeRobot {
        if let Some(runtime) = &mut self.runtime {
            runtime.prime(command);
        }
        self
    }

    /// Sets the integrals of the speed loops anew from how far the wheels are behind their set-points: a start in the middle of an
    /// acceleration. Motors with a controller of their own stay as they are.
    pub(crate) fn settle_loops(&mut self, robot: &Robot, told: &Told) {
        let runtime = self.runtime.as_ref();
        let (model, state) = (runtime.map_or(&self.model, |runtime| &*runtime.live), &mut self.state);
        let has_own = runtime.is_some_and(|runtime| runtime.drives.is_some());
        let Some(motor) = model.motor.as_ref().filter(|_| !has_own) else {
            return;
        };
        let noise = robot.description().noise.as_ref();
        let sigma = noise
            .and_then(|noise| noise.wheel_rad_per_s)
            .unwrap_or(WHEEL_NOISE_RAD_PER_S);
        // Without its current nothing tells how hard a motor pulls: the error alone has to.
        let is_known = |lane: usize| robot.model().powered[lane] > 0.0 && state.current[lane] != 0.0;
        for lane in (0..model.lanes).filter(|lane| is_known(*lane)) {
            let seen = model.encoder_speed(state, lane);
            let error = told.error_rad_per_s(model.wheel_of_lane[lane], seen);
            let error = (error.abs() - NOISE_SIGMAS * sigma).max(0.0).copysign(error);
            state.integral[lane] = motor.settled_integral_rad(state.voltage[lane], error);
        }
    }

    /// True when an effect of commands remembers what was sent.
    pub fn remembers_commands(&self) -> bool {
        self.runtime.as_ref().is_some_and(Runtime::remembers_commands)
    }

    /// Lets the effects of commands see a set-point that was in force `to_go` steps before the first step: for starts in
    /// motion, called step by step after [`FreeRobot::after_holding`]. What the speed loops saw then.
    pub fn remember(&mut self, command: &WheelCommand, to_go: u64) -> WheelCommand {
        match &mut self.runtime {
            Some(runtime) => runtime.remember(command, to_go),
            None => *command,
        }
    }

    /// Accelerations of the centre of mass from now on besides all others, `[m/s^2, m/s^2, rad/s^2]` in the body frame.
    ///
    /// - `robot`: the one it was made from.
    pub fn push(&mut self, robot: &Robot, accelerations: [f64; 3]) {
        let runtime = self.runtime.get_or_insert_with(|| robot.plain_runtime());
        let (mass_kg, inertia) = (self.model.mass_kg, self.model.yaw_inertia_kg_m2);
        runtime.push.force = [
            mass_kg * accelerations[0],
            mass_kg * accelerations[1],
            inertia * accelerations[2],
        ];
    }

    /// Twist of slip-free rolling that the wheels do from now on besides what they are told, `[m/s, m/s, rad/s]`.
    ///
    /// - `robot`: the one it was made from.
    pub fn shift(&mut self, robot: &Robot, twist: [f64; 3]) {
        self.runtime.get_or_insert_with(|| robot.plain_runtime()).shift = twist;
    }

    /// Integrates every 480 Hz sample of the speed loops in `refinement` equal steps (1 in the world). For convergence tests.
    pub fn with_refinement(mut self, refinement: u32) -> FreeRobot {
        self.refinement = refinement.max(1);
        self
    }

    /// One sample of the speed loops and the physics up to the next one, 1/480 s.
    pub fn step(&mut self, command: &WheelCommand) {
        if self.steps.is_multiple_of(u64::from(SUBSTEPS)) {
            self.state.refresh_heading();
        }
        match &mut self.runtime {
            None => substep_refined(&self.model, &mut self.state, command, self.refinement),
            Some(runtime) => substep_with(runtime, &mut self.state, command, self.refinement),
        }
        self.steps += 1;
    }

    /// Physics steps taken.
    pub fn steps(&self) -> u64 {
        self.steps
    }

    /// State after the last step.
    pub fn state(&self) -> RobotState {
        self.state.view(self.model_now())
    }

    /// The same, written into `out`.
    pub(crate) fn write_state(&self, out: &mut RobotState) {
        self.state.write_view(self.model_now(), out);
    }

    fn model_now(&self) -> &Model {
        self.runtime.as_ref().map_or(&self.model, |runtime| &runtime.live)
    }

    /// Kinetic energy of body and wheels, J.
    pub fn kinetic_energy_j(&self) -> f64 {
        let s = &self.state;
        let mut energy =
            0.5 * self.model.mass_kg * (s.u * s.u + s.v * s.v) + 0.5 * self.model.yaw_inertia_kg_m2 * s.r * s.r;
        for lane in 0..self.model.lanes {
            energy += 0.5 * self.model.spin_inertia_kg_m2[lane] * s.wheel[lane] * s.wheel[lane];
        }
        energy
    }

    /// Energy in the deflections of sticking contacts, J, with the loads at rest.
    pub fn stored_energy_j(&self) -> f64 {
        kernel::bristle::stored_j(&self.model, &self.state)
    }

    /// True while every number is finite.
    pub fn is_finite(&self) -> bool {
        self.state.is_finite()
    }
}

/// One sample of the speed loops, steering and physics over 1/480 s.
#[inline(always)]
pub(crate) fn substep(model: &Model, runtime: &mut Option<Runtime>, state: &mut BodyState, command: &WheelCommand) {
    match runtime {
        None => substep_refined(model, state, command, 1),
        Some(runtime) => substep_with(runtime, state, command, 1),
    }
}

/// The same with effects that change from step to step.
#[inline(never)]
fn substep_with(runtime: &mut Runtime, state: &mut BodyState, command: &WheelCommand, refinement: u32) {
    let mut command = *command;
    runtime.command(&mut command);
    runtime.prepare(state);
    runtime.shift(&mut command);
    match &mut runtime.drives {
        Some(drives) => motor_control::substep(drives, &runtime.live, state, &command, refinement),
        None => substep_refined(&runtime.live, state, &command, refinement),
    }
    runtime.finish(state, &command);
}

#[inline(always)]
fn substep_refined(model: &Model, state: &mut BodyState, command: &WheelCommand, refinement: u32) {
    sample_controls(model, state, command);
    let period_s = PHYSICS_PERIOD_S / f64::from(refinement);
    for _ in 0..refinement {
        integrate(model, state, command, period_s);
    }
}

/// Steering and physics over a step with the voltages held.
#[inline(always)]
pub(crate) fn integrate(model: &Model, state: &mut BodyState, command: &WheelCommand, period_s: f64) {
    let Some(steering) = &model.steering else {
        kernel::advance(model, state, period_s);
        return;
    };
    // The contact sees the steering angle in the middle of the step.
    let end_rad = steering.advanced_rad(state.steering_rad, command.steering_rad, period_s);
    state.steering_rad = steering.advanced_rad(state.steering_rad, command.steering_rad, 0.5 * period_s);
    kernel::advance(model, state, period_s);
    state.steering_rad = end_rad;
}

/// Speed loops at their sampling instant; without a motor model the driven wheels take their commanded speed.
#[inline(always)]
fn sample_controls(model: &Model, state: &mut BodyState, command: &WheelCommand) {
    let wanted = [0, 1, 2, 3].map(|lane| command.wheel_rad_per_s[model.wheel_of_lane[lane]]);
    let Some(motor) = &model.motor else {
        for lane in (0..model.lanes).filter(|lane| model.free[*lane] == 0.0) {
            state.wheel[lane] = wanted[lane] / model.encoder[lane];
        }
        return;
    };
    let seen = four(&model.encoder) * (four(&state.wheel) + four(&model.gear_rate_rad_per_s));
    let (integral, voltage) = motor.sample(f64x4::new(wanted) - seen, four(&state.integral));
    let driven = model.fixed.driven();
    state.integral[..LANES].copy_from_slice(&(driven * integral).to_array());
    state.voltage[..LANES].copy_from_slice(&(driven * voltage).to_array());
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::Effect;
    use crate::residual::ResidualDocument;
    use crate::robot::RobotDescription;

    /// A robot with stages, laws and a controller that remember.
    fn remembering() -> Robot {
        let text = include_str!("../../examples/robots/rwd-sam3x.json");
        let document: serde_json::Value = serde_json::from_str(text).expect("a document");
        let description: RobotDescription = serde_json::from_value(document["robot"].clone()).expect("a robot");
        let effects = [
            Effect::new("command_delay", &[("delay", 0.03)]),
            Effect::new("motor_lag", &[("time_constant", 0.05)]),
            Effect::new("steering_backlash", &[("play", 0.05)]),
            Effect::new("center_of_mass_offset", &[("x", 0.02), ("y", 0.01)]),
        ];
        let residual: Option<&ResidualDocument> = None;
        Robot::with_model(description, &effects, residual).expect("a robot")
    }

    #[test]
    fn a_copy_goes_on_as_the_original_wherever_it_was_before() {
        let robot = remembering();
        let command = |tick: u32| {
            robot.wheel_speeds(BodyTwist {
                forward_m_per_s: 0.4,
                yaw_rate_rad_per_s: 0.5 * libm::sin(0.05 * f64::from(tick)),
                ..BodyTwist::default()
            })
        };
        let mut original = FreeRobot::at_rest(&robot, Pose::default());
        let mut copy = FreeRobot::at_rest(&robot, Pose::default());
        (0..301).for_each(|tick| original.step(&command(tick)));
        (0..77).for_each(|tick| copy.step(&command(3 * tick)));
        copy.copy_from(&original);
        for tick in 301..900 {
            original.step(&command(tick));
            copy.step(&command(tick));
            assert_eq!(copy.state(), original.state(), "step {tick}");
        }
    }

    #[test]
    fn rotors_start_on_the_side_of_their_play_that_the_current_tells() {
        let play = [Effect::new("gear_backlash", &[("play", 0.04)])];
        let robot = Robot::with_effects(crate::golden::reference_robot("diff2"), &play).expect("a robot");
        let model = robot.model();
        let friction_a = model.coulomb_n_m[0] / model.torque_per_current[0];
        let place_rad = |wheel_rad_per_s: f64, current_a: f64| {
            let mut start = Start::default();
            (start.wheel_rad_per_s[0], start.current_a[0]) = (wheel_rad_per_s, current_a);
            let free = FreeRobot::moving(&robot, &start);
            // The encoder sits at the rotor and starts at zero.
            assert_eq!(free.state().wheel_rad[0], 0.0);
            free.model_now().gear_place_rad[0]
        };
        assert_eq!(place_rad(5.0, 10.0 * friction_a), 0.02, "it accelerates");
        assert_eq!(place_rad(5.0, friction_a), 0.02, "steady");
        assert_eq!(place_rad(5.0, 0.0), -0.02, "it coasts: friction holds the rotor back");
        assert_eq!(place_rad(-5.0, -friction_a), -0.02, "the other way");
        assert_eq!(place_rad(0.0, 0.0), 0.0, "nothing tells");
    }

    #[test]
    fn a_robot_that_is_laid_elsewhere_moves_on_as_before() {
        let robot = remembering();
        let command = robot.wheel_speeds(BodyTwist {
            forward_m_per_s: 0.5,
            yaw_rate_rad_per_s: 0.4,
            ..BodyTwist::default()
        });
        let mut free = FreeRobot::at_rest(&robot, Pose::default());
        (0..200).for_each(|_| free.step(&command));
        let there = Pose {
            x_m: -1.0,
            y_m: 0.7,
            yaw_rad: 2.0,
        };
        let before = free.state();
        free.lay(there);
        let after = free.state();
        assert!(after.pose.distance_m(&there) < 1e-12 && after.pose.yaw_rad == 2.0);
        assert_eq!(free.pose(), after.pose);
        assert_eq!(after.twist, before.twist);
    }
}
