//! Robot descriptions and the validated robot.

use serde::{Deserialize, Serialize};

use crate::command::WheelCommand;
use crate::effect::{self, Dynamics, Effect, Runtime, SensorStage};
use crate::free::RobotState;
use crate::kinematics;
use crate::model::Model;
use crate::motor_control::Drives;
pub use crate::motor_control::MotorController;
use crate::parameter;
pub use crate::parameter::ParameterError;
use crate::pose::{Pose, wrapped_rad};
use crate::residual::{Observation, Residual, ResidualDocument};
use crate::tread::Tread;
use crate::twist::BodyTwist;
use crate::world::floor::Floor;
use std::sync::Arc;

/// Iterations of [`Robot::pose_seen_at`].
const INVERSE_STEPS: usize = 10;

/// A robot as it stands in `run.json` (`robot`) and in the laboratory's file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RobotDescription {
    pub name: String,
    /// `omni4`, `diff2`, `diff4`, `fwd`, `rwd` or `awd`.
    pub chassis: String,
    pub mass_kg: f64,
    pub yaw_inertia_kg_m2: f64,
    pub com_height_m: f64,
    pub wheels: Vec<Wheel>,
    /// Absent: wheels follow commands exactly.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub motor: Option<Motor>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub steering: Option<Steering>,
    pub floor_friction: f64,
    /// Absent: the nominal contact.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tread: Option<Tread>,
    /// Time constant of the accelerometer's low-pass filter; absent: it shows what it feels at once. Logs are compared through it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub accelerometer_lag_s: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub noise: Option<Noise>,
}

/// One wheel: contact point in the body frame and how it rolls.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Wheel {
    pub x_m: f64,
    pub y_m: f64,
    /// `beta`: direction in the body frame in which a positive wheel speed rolls the contact.
    pub rolling_direction_rad: f64,
    /// Optional for casters.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub radius_m: Option<f64>,
    /// `J_w`, the reflected rotor inertia included; optional for casters.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub spin_inertia_kg_m2: Option<f64>,
    /// `omni`, `standard` or `caster`.
    pub kind: String,
    pub driven: bool,
    pub steered: bool,
}

/// Motor, gear and speed loop; the same for every driven wheel.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Motor {
    pub gear_ratio: f64,
    pub torque_constant_n_m_per_a: f64,
    pub resistance_ohm: f64,
    /// `None` (`null`) = no limit.
    pub current_limit_a: Option<f64>,
    pub supply_v: f64,
    /// `b_w`, at the wheel.
    pub viscous_n_m_s: f64,
    /// `t_c`, at the wheel.
    pub coulomb_n_m: f64,
    pub speed_loop_kp_v_s_per_rad: f64,
    pub speed_loop_ki_v_per_rad: f64,
    /// Absent: speed PI at 480 Hz with the two gains above, without delay, on the exact speed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub controller: Option<MotorController>,
}

/// Steering gear of the bicycle angle.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Steering {
    pub lag_s: f64,
    /// Time constant of a filter in front of it: with both equal, a critically damped servo of second order. Absent: none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub filter_s: Option<f64>,
    pub rate_limit_rad_per_s: Option<f64>,
    pub angle_limit_rad: Option<f64>,
}

/// One standard deviation each; a missing entry means the sensor is absent or its noise unknown.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Noise {
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pose_xy_m: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pose_yaw_rad: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub wheel_rad_per_s: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub current_a: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gyro_rad_per_s: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub accel_m_per_s2: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bus_v: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub steering_rad: Option<f64>,
}

impl RobotDescription {
    /// Everything that is wrong with this description, in the order of its fields; empty when it can be simulated.
    pub fn check(&self) -> Vec<ParameterError> {
        parameter::check(self)
    }
}

/// A validated robot: description, effects and the constants of its equations.
#[derive(Debug, Clone)]
pub struct Robot {
    description: RobotDescription,
    effects: Vec<Effect>,
    /// The geometry the robot itself works with.
    nominal: Arc<Model>,
    model: Arc<Model>,
    residual: Option<Arc<Residual>>,
    dynamics: Option<Dynamics>,
    sensors: Vec<SensorStage>,
}

impl Robot {
    /// Validates a description.
    ///
    /// - Errors: the first problem of [`RobotDescription::check`].
    pub fn new(description: RobotDescription) -> Result<Robot, ParameterError> {
        Robot::with_effects(description, &[])
    }

    /// Validates a description and the effects of a model; those that are neutral change no bit.
    ///
    /// - Errors: the first problem of the description, then of the effects in their order.
    pub fn with_effects(description: RobotDescription, effects: &[Effect]) -> Result<Robot, ParameterError> {
        Robot::with_model(description, effects, None)
    }

    /// Validates a description, the effects and the learned residual of a model.
    ///
    /// A residual whose output is always zero ([`ResidualDocument::is_neutral`]) changes no bit of the motion.
    ///
    /// - Errors: the first problem of the description, of the effects in their order, of the residual.
    pub fn with_model(
        description: RobotDescription,
        effects: &[Effect],
        residual: Option<&ResidualDocument>,
    ) -> Result<Robot, ParameterError> {
        if let Some(problem) = description.check().into_iter().next() {
            return Err(problem);
        }
        effect::check(&description, effects)?;
        let residual = match residual {
            Some(document) => Some(Arc::new(Residual::new(&description, document)?)),
            None => None,
        };
        let active: Vec<Effect> = effects.iter().filter(|effect| !effect.is_neutral()).cloned().collect();
        let nominal = Model::new(&effect::tracked(&description, &active));
        let mut model = Model::new(&effect::physical(&description, &active));
        model.nominal_friction = description.floor_friction;
        effect::shape(&mut model, &active);
        model.freeze();
        let acting = residual.clone().filter(|residual| !residual.document().is_neutral());
        let filter_s = description.steering.as_ref().and_then(|steering| steering.filter_s);
        let dynamics = Dynamics::new(&model, &active, filter_s.unwrap_or(0.0), acting);
        model.contact_varies |= dynamics.as_ref().is_some_and(Dynamics::changes_radii);
        let sensors = effect::sensor_stages(&active);
        Ok(Robot {
            description,
            effects: effects.to_vec(),
            nominal: Arc::new(nominal),
            model: Arc::new(model),
            residual,
            dynamics,
            sensors,
        })
    }

    /// A robot whose rotors turn as its set-points tell, behind effects that change these: what moves it when encoders at the rotors have said how
    /// they turned. The play of its gears (`gear_backlash`) lies between them and the wheels; [`Start::current_a`](crate::free::Start) tells on
    /// which side. Its description has no motor any more, which `gear_backlash` asks for elsewhere.
    ///
    /// - Errors: as [`Robot::with_effects`].
    pub fn with_told_rotors(description: RobotDescription, effects: &[Effect]) -> Result<Robot, ParameterError> {
        let mut robot = Robot::with_effects(description, effects)?;
        Arc::make_mut(&mut robot.model).follow();
        Arc::make_mut(&mut robot.nominal).motor = None;
        robot.description.motor = None;
        Ok(robot)
    }

    /// The learned residual of its model.
    pub fn residual(&self) -> Option<&Residual> {
        self.residual.as_deref()
    }

    /// What a residual sees at the start of a control tick with these set-points: `state` is that after the tick before.
    pub fn observation(&self, state: &RobotState, command: &WheelCommand) -> Observation {
        Observation::of(&self.nominal, &self.model, state, command)
    }

    /// The effects of its model, in their order.
    pub fn effects(&self) -> &[Effect] {
        &self.effects
    }

    /// Name of the robot.
    pub fn name(&self) -> &str {
        &self.description.name
    }

    /// `omni4`, `diff2`, `diff4`, `fwd`, `rwd` or `awd`.
    pub fn chassis(&self) -> &str {
        &self.description.chassis
    }

    /// Number of entries in `wheels`, casters included.
    pub fn wheel_count(&self) -> usize {
        self.description.wheels.len()
    }

    /// The description this robot was made from.
    pub fn description(&self) -> &RobotDescription {
        &self.description
    }

    /// Radius of the circle around the body origin that holds all wheels, m. A laboratory's own radius may be larger.
    pub fn bounding_radius_m(&self) -> f64 {
        self.description.wheels.iter().fold(0.0, |largest: f64, wheel| {
            let reach = (wheel.x_m * wheel.x_m + wheel.y_m * wheel.y_m).sqrt() + wheel.radius_m.unwrap_or(0.0);
            largest.max(reach)
        })
    }

    /// Slip-free inverse kinematics of the nominal geometry: wheel set-points that move the body with `twist`.
    ///
    /// W_i = (u c_i + v s_i + r (x_i s_i - y_i c_i)) / R_i ;  steering = atan(L r / u)
    ///
    /// - An `omni4` on two wheels takes the part of the twist along [`Robot::drive_axis_rad`] and the yaw rate.
    /// - Undriven wheels get 0. Steering is 0 at u = 0; see [`Robot::wheel_speeds_holding`].
    pub fn wheel_speeds(&self, twist: BodyTwist) -> WheelCommand {
        self.wheel_speeds_holding(twist, 0.0)
    }

    /// As [`Robot::wheel_speeds`], keeping `last_steering_rad` when u = 0 leaves the steering angle undefined.
    pub fn wheel_speeds_holding(&self, twist: BodyTwist, last_steering_rad: f64) -> WheelCommand {
        kinematics::wheel_speeds(&self.nominal, twist, last_steering_rad)
    }

    /// Body twist of slip-free rolling at these wheel speeds (least squares over driven wheels and lateral constraints).
    ///
    /// - An `omni4` on two wheels is taken not to slide across its drive axis: true from rest and while it does not turn.
    pub fn twist_of_wheels(&self, command: &WheelCommand) -> BodyTwist {
        kinematics::twist_of_wheels(&self.nominal, command)
    }

    /// The two-wheel mode of an `omni4` (two opposite wheels driven, the others free): direction in the body frame, from
    /// x, in (-pi/2, pi/2], in which the driven wheels move it. None for all other robots.
    ///
    /// Across this axis nothing but the free wheels' inertia resists, so the robot keeps its sideways velocity and slides
    /// out of arcs; it goes straight along the axis and turns in place.
    pub fn drive_axis_rad(&self) -> Option<f64> {
        kinematics::drive_axis_rad(&self.nominal)
    }

    /// No-load speed of a driven wheel at full supply, friction included, rad/s; infinite without a motor.
    pub fn max_wheel_speed_rad_per_s(&self) -> f64 {
        self.nominal.max_wheel_speed_rad_per_s()
    }

    /// Largest steering angle, rad: 0 without steering, the declared limit or 1.5 when unlimited.
    pub fn max_steering_rad(&self) -> f64 {
        self.nominal
            .steering
            .as_ref()
            .map_or(0.0, |steering| steering.angle_limit_rad)
    }

    pub(crate) fn model(&self) -> &Arc<Model> {
        &self.model
    }

    /// What its effects and motor controllers carry from step to step; none without such effects and controllers.
    pub(crate) fn runtime(&self) -> Option<Runtime> {
        let drives = self.drives();
        if self.dynamics.is_none() && drives.is_none() {
            return None;
        }
        Some(self.plain_runtime())
    }

    /// One for a robot that has no effects of its own.
    pub(crate) fn plain_runtime(&self) -> Runtime {
        let dynamics = self.dynamics.clone().unwrap_or_default();
        Runtime::new(dynamics, self.drives(), &self.nominal, &self.model)
    }

    fn drives(&self) -> Option<Drives> {
        Drives::new(self.description.motor.as_ref(), &self.model)
    }

    /// The same on a floor with regions or tilt, which act like effects.
    pub(crate) fn runtime_on(&self, floor: &Floor) -> Option<Runtime> {
        if floor.is_even() && !floor.is_tilted() {
            return self.runtime();
        }
        let dynamics = self.dynamics.clone().unwrap_or_default().on_floor(floor);
        Some(Runtime::new(dynamics, self.drives(), &self.nominal, &self.model))
    }

    /// Where the tracker sees the body origin when it is at `pose`: marker, its height, lens, scale and seam of the model's sensor
    /// effects; times are left out.
    pub fn seen_pose(&self, pose: Pose) -> Pose {
        effect::seen_pose(&self.sensors, pose)
    }

    /// Inverse of [`Robot::seen_pose`]: fixed-point iteration, exact to 1 um within 3 m for effects of large size; at a seam
    /// one of two sides.
    pub fn pose_seen_at(&self, seen: Pose) -> Pose {
        if !effect::moves_poses(&self.sensors) {
            return seen;
        }
        inverse(seen, |pose| effect::seen_pose(&self.sensors, pose))
    }

    /// All poses that the tracker sees at `seen`: two where either camera may have seen it (tags above the floor near the line between them), the one of
    /// the camera of that side first. The marker may lie up to `beyond_m` on the other camera's side; if there is no such pose, the
    /// result of [`Robot::pose_seen_at`].
    pub fn poses_seen_at(&self, seen: Pose, beyond_m: f64) -> Vec<Pose> {
        if !effect::tells_cameras_apart(&self.sensors) {
            return vec![self.pose_seen_at(seen)];
        }
        let own_side = 1.0_f64.copysign(seen.x_m);
        let mut poses = Vec::with_capacity(2);
        for side in [own_side, -own_side] {
            let pose = inverse(seen, |pose| effect::seen_pose_in(&self.sensors, pose, side));
            if side * effect::marked_pose(&self.sensors, pose).x_m > -beyond_m {
                poses.push(pose);
            }
        }
        if poses.is_empty() {
            poses.push(self.pose_seen_at(seen));
        }
        poses
    }

    pub(crate) fn sensors(&self) -> &[SensorStage] {
        &self.sensors
    }
}

/// The pose that `see` maps to `seen`.
fn inverse(seen: Pose, see: impl Fn(Pose) -> Pose) -> Pose {
    let mut pose = seen;
    for _ in 0..INVERSE_STEPS {
        let now = see(pose);
        pose.x_m += seen.x_m - now.x_m;
        pose.y_m += seen.y_m - now.y_m;
        pose.yaw_rad += wrapped_rad(seen.yaw_rad - now.yaw_rad);
    }
    pose
}
