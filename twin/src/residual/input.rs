//! What a network can see of a robot.

use crate::MAX_WHEELS;
use crate::command::WheelCommand;
use crate::free::RobotState;
use crate::kinematics;
use crate::model::Model;
use crate::twist::BodyTwist;

/// A quantity by its meaning.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quantity {
    X,
    Y,
    HeadingCos,
    HeadingSin,
    Forward,
    Left,
    YawRate,
    YawRateForward,
    YawRateLeft,
    WheelSpeed,
    RollingForward,
    RollingLeft,
    RollingYawRate,
    Current,
    Load,
    Steering,
    CommandWheel,
    CommandForward,
    CommandLeft,
    CommandYawRate,
    CommandSteering,
}

/// What a quantity belongs to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Of {
    Robot,
    /// A robot with a steering gear.
    SteeredRobot,
    /// Any wheel, casters included.
    Wheel,
    /// A wheel that is no caster.
    RollingWheel,
    DrivenWheel,
    /// A driven wheel of a robot with a motor description.
    Motor,
}

/// One row of [`INPUTS`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct InputEntry {
    pub name: &'static str,
    pub unit: &'static str,
    pub of: Of,
    pub quantity: Quantity,
    pub meaning: &'static str,
}

const fn entry(
    name: &'static str,
    unit: &'static str,
    of: Of,
    quantity: Quantity,
    meaning: &'static str,
) -> InputEntry {
    InputEntry {
        name,
        unit,
        of,
        quantity,
        meaning,
    }
}

/// Everything a network can be given.
pub const INPUTS: [InputEntry; 21] = [
    entry(
        "x_m",
        "m",
        Of::Robot,
        Quantity::X,
        "place of the body origin in the world",
    ),
    entry("y_m", "m", Of::Robot, Quantity::Y, "the same"),
    entry("heading_cos", "1", Of::Robot, Quantity::HeadingCos, "cosine of the yaw"),
    entry("heading_sin", "1", Of::Robot, Quantity::HeadingSin, "sine of the yaw"),
    entry(
        "forward_m_per_s",
        "m/s",
        Of::Robot,
        Quantity::Forward,
        "body twist of the body origin",
    ),
    entry("left_m_per_s", "m/s", Of::Robot, Quantity::Left, "the same"),
    entry("yaw_rate_rad_per_s", "rad/s", Of::Robot, Quantity::YawRate, "the same"),
    entry(
        "yaw_rate_times_forward_m_per_s2",
        "m/s^2",
        Of::Robot,
        Quantity::YawRateForward,
        "centripetal acceleration r u",
    ),
    entry(
        "yaw_rate_times_left_m_per_s2",
        "m/s^2",
        Of::Robot,
        Quantity::YawRateLeft,
        "centripetal acceleration r v",
    ),
    entry(
        "wheel_rad_per_s",
        "rad/s",
        Of::RollingWheel,
        Quantity::WheelSpeed,
        "as the encoder gives it",
    ),
    entry(
        "rolling_forward_m_per_s",
        "m/s",
        Of::Robot,
        Quantity::RollingForward,
        "twist of slip-free rolling at the wheel speeds and the steering angle, nominal geometry",
    ),
    entry(
        "rolling_left_m_per_s",
        "m/s",
        Of::Robot,
        Quantity::RollingLeft,
        "the same",
    ),
    entry(
        "rolling_yaw_rate_rad_per_s",
        "rad/s",
        Of::Robot,
        Quantity::RollingYawRate,
        "the same",
    ),
    entry("current_a", "A", Of::Motor, Quantity::Current, "motor current"),
    entry(
        "load_n",
        "N",
        Of::Wheel,
        Quantity::Load,
        "normal load at the acceleration of the last physics step",
    ),
    entry(
        "steering_rad",
        "rad",
        Of::SteeredRobot,
        Quantity::Steering,
        "bicycle angle at the servo",
    ),
    entry(
        "command_wheel_rad_per_s",
        "rad/s",
        Of::DrivenWheel,
        Quantity::CommandWheel,
        "set-point as sent",
    ),
    entry(
        "command_forward_m_per_s",
        "m/s",
        Of::Robot,
        Quantity::CommandForward,
        "twist of slip-free rolling at the set-points as sent, nominal geometry",
    ),
    entry(
        "command_left_m_per_s",
        "m/s",
        Of::Robot,
        Quantity::CommandLeft,
        "the same",
    ),
    entry(
        "command_yaw_rate_rad_per_s",
        "rad/s",
        Of::Robot,
        Quantity::CommandYawRate,
        "the same",
    ),
    entry(
        "command_steering_rad",
        "rad",
        Of::SteeredRobot,
        Quantity::CommandSteering,
        "set-point as sent",
    ),
];

/// Entry of an input by its name.
pub(super) fn find(name: &str) -> Option<&'static InputEntry> {
    INPUTS.iter().find(|entry| entry.name == name)
}

/// The robot at the start of a control tick: its state, and the set-points of that tick.
#[derive(Debug, Clone, Copy)]
pub struct Observation {
    state: RobotState,
    command: WheelCommand,
    load_n: [f64; MAX_WHEELS],
    /// `[sin, cos]` of the yaw.
    heading: (f64, f64),
    rolling: BodyTwist,
    commanded: BodyTwist,
}

impl Observation {
    pub(crate) fn of(nominal: &Model, model: &Model, state: &RobotState, command: &WheelCommand) -> Observation {
        let loads = model.load.loads_n(state.accel_x_m_per_s2, state.accel_y_m_per_s2);
        let mut load_n = [0.0; MAX_WHEELS];
        for (place, load) in loads.into_iter().enumerate().take(model.load.count()) {
            load_n[model.wheel_of_lane[place]] = load;
        }
        let measured = WheelCommand {
            wheel_rad_per_s: state.wheel_rad_per_s,
            steering_rad: state.steering_rad,
        };
        Observation {
            state: *state,
            command: *command,
            load_n,
            heading: libm::sincos(state.pose.yaw_rad),
            rolling: kinematics::twist_of_wheels(nominal, &measured),
            commanded: kinematics::twist_of_wheels(nominal, command),
        }
    }

    /// A quantity in its unit; `wheel` counts for quantities of a wheel only.
    pub fn value(&self, quantity: Quantity, wheel: usize) -> f64 {
        let wheel = wheel.min(MAX_WHEELS - 1);
        let (state, twist) = (&self.state, &self.state.twist);
        match quantity {
            Quantity::X => state.pose.x_m,
            Quantity::Y => state.pose.y_m,
            Quantity::HeadingCos => self.heading.1,
            Quantity::HeadingSin => self.heading.0,
            Quantity::Forward => twist.forward_m_per_s,
            Quantity::Left => twist.left_m_per_s,
            Quantity::YawRate => twist.yaw_rate_rad_per_s,
            Quantity::YawRateForward => twist.yaw_rate_rad_per_s * twist.forward_m_per_s,
            Quantity::YawRateLeft => twist.yaw_rate_rad_per_s * twist.left_m_per_s,
            Quantity::WheelSpeed => state.wheel_rad_per_s[wheel],
            Quantity::RollingForward => self.rolling.forward_m_per_s,
            Quantity::RollingLeft => self.rolling.left_m_per_s,
            Quantity::RollingYawRate => self.rolling.yaw_rate_rad_per_s,
            Quantity::Current => state.current_a[wheel],
            Quantity::Load => self.load_n[wheel],
            Quantity::Steering => state.steering_rad,
            Quantity::CommandWheel => self.command.wheel_rad_per_s[wheel],
            Quantity::CommandForward => self.commanded.forward_m_per_s,
            Quantity::CommandLeft => self.commanded.left_m_per_s,
            Quantity::CommandYawRate => self.commanded.yaw_rate_rad_per_s,
            Quantity::CommandSteering => self.command.steering_rad,
        }
    }
}
