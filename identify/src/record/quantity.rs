//! What is compared between twin and measurement.

use twin::free::RobotState;

/// One compared number.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Quantity {
    Wheel(usize),
    Steering,
    Current(usize),
    Bus,
    Gyro,
    AccelX,
    AccelY,
    /// Of the pose, in the measured body frame.
    Forward,
    Left,
    Yaw,
}

/// Quantities that share a noise level.
pub const CLASSES: usize = 8;
/// Channel names of the report, by class.
pub const CHANNELS: [&str; CLASSES] = ["wheel", "steering", "current", "bus", "gyro", "accel", "pose", "yaw"];
/// Units of the channels.
pub const UNITS: [&str; CLASSES] = ["rad/s", "rad", "A", "V", "rad/s", "m/s2", "m", "rad"];

impl Quantity {
    /// Position in [`CHANNELS`].
    pub fn class(self) -> usize {
        match self {
            Quantity::Wheel(_) => 0,
            Quantity::Steering => 1,
            Quantity::Current(_) => 2,
            Quantity::Bus => 3,
            Quantity::Gyro => 4,
            Quantity::AccelX | Quantity::AccelY => 5,
            Quantity::Forward | Quantity::Left => 6,
            Quantity::Yaw => 7,
        }
    }

    /// Channel name of the report.
    pub fn channel(self) -> &'static str {
        CHANNELS[self.class()]
    }

    /// In words.
    pub fn words(self) -> String {
        match self {
            Quantity::Wheel(k) => format!("speed of wheel {k}"),
            Quantity::Steering => "steering angle".to_owned(),
            Quantity::Current(k) => format!("current of motor {k}"),
            Quantity::Bus => "bus voltage".to_owned(),
            Quantity::Gyro => "gyro".to_owned(),
            Quantity::AccelX => "forward acceleration".to_owned(),
            Quantity::AccelY => "left acceleration".to_owned(),
            Quantity::Forward => "forward position".to_owned(),
            Quantity::Left => "left position".to_owned(),
            Quantity::Yaw => "yaw".to_owned(),
        }
    }

    /// The number in a state of the twin; poses are compared after alignment and are not read here.
    pub fn of(self, state: &RobotState) -> f64 {
        match self {
            Quantity::Wheel(k) => state.wheel_rad_per_s[k],
            Quantity::Steering => state.steering_rad,
            Quantity::Current(k) => state.current_a[k],
            Quantity::Bus => state.bus_v,
            Quantity::Gyro => state.gyro_z_rad_per_s,
            Quantity::AccelX => state.accel_x_m_per_s2,
            Quantity::AccelY => state.accel_y_m_per_s2,
            Quantity::Forward => state.pose.x_m,
            Quantity::Left => state.pose.y_m,
            Quantity::Yaw => state.pose.yaw_rad,
        }
    }
}
