//! Columns of `telemetry`.

use twin::MAX_WHEELS;

/// What a column holds. Wheel columns carry the position in the robot's `wheels`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Channel {
    CommandWheel(usize),
    CommandForward,
    CommandLeft,
    CommandYawRate,
    CommandSteering,
    Steering,
    WheelSpeed(usize),
    WheelAngle(usize),
    Current(usize),
    Voltage(usize),
    Bus,
    Gyro,
    AccelX,
    AccelY,
    PoseX,
    PoseY,
    PoseYaw,
    CameraId,
    TargetX,
    TargetY,
    TargetForward,
    TargetLeft,
    PoseArrival,
    TelemetryArrival,
    RobotClock,
    SequenceSent,
    SequenceApplied,
}

use Channel as C;

/// Columns without a wheel number.
const PLAIN: [(&str, Channel); 22] = [
    ("command_forward_m_per_s", C::CommandForward),
    ("command_left_m_per_s", C::CommandLeft),
    ("command_yaw_rate_rad_per_s", C::CommandYawRate),
    ("command_steering_rad", C::CommandSteering),
    ("steering_rad", C::Steering),
    ("bus_v", C::Bus),
    ("gyro_z_rad_per_s", C::Gyro),
    ("accel_x_m_per_s2", C::AccelX),
    ("accel_y_m_per_s2", C::AccelY),
    ("pose_x_m", C::PoseX),
    ("pose_y_m", C::PoseY),
    ("pose_yaw_rad", C::PoseYaw),
    ("camera_id", C::CameraId),
    ("target_x_m", C::TargetX),
    ("target_y_m", C::TargetY),
    ("target_forward_m_per_s", C::TargetForward),
    ("target_left_m_per_s", C::TargetLeft),
    ("pose_arrival_s", C::PoseArrival),
    ("telemetry_arrival_s", C::TelemetryArrival),
    ("robot_clock_s", C::RobotClock),
    ("command_seq_sent", C::SequenceSent),
    ("command_seq_applied", C::SequenceApplied),
];

impl Channel {
    /// The channel of a column name; `None` for an unknown name or a wheel number of [`MAX_WHEELS`] and above.
    pub fn parse(name: &str) -> Option<Channel> {
        if let Some((_, channel)) = PLAIN.iter().find(|(plain, _)| *plain == name) {
            return Some(*channel);
        }
        let wheel = |rest: &str, suffix: &str| {
            let digits = rest.strip_suffix(suffix)?;
            let number = digits.parse::<usize>().ok()?;
            // "01" and "+1" are not how the format writes a number.
            (number < MAX_WHEELS && digits == number.to_string()).then_some(number)
        };
        if let Some(rest) = name.strip_prefix("command_wheel_") {
            return wheel(rest, "_rad_per_s").map(C::CommandWheel);
        }
        if let Some(rest) = name.strip_prefix("wheel_") {
            return wheel(rest, "_rad_per_s")
                .map(C::WheelSpeed)
                .or_else(|| wheel(rest, "_rad").map(C::WheelAngle));
        }
        if let Some(rest) = name.strip_prefix("current_") {
            return wheel(rest, "_a").map(C::Current);
        }
        name.strip_prefix("voltage_")
            .and_then(|rest| wheel(rest, "_v"))
            .map(C::Voltage)
    }

    /// Column name.
    pub fn name(self) -> String {
        match self {
            C::CommandWheel(k) => format!("command_wheel_{k}_rad_per_s"),
            C::WheelSpeed(k) => format!("wheel_{k}_rad_per_s"),
            C::WheelAngle(k) => format!("wheel_{k}_rad"),
            C::Current(k) => format!("current_{k}_a"),
            C::Voltage(k) => format!("voltage_{k}_v"),
            plain => PLAIN
                .iter()
                .find(|(_, channel)| *channel == plain)
                .map_or("", |(name, _)| name)
                .to_owned(),
        }
    }

    /// Wheel that the column is about.
    pub fn wheel(self) -> Option<usize> {
        match self {
            C::CommandWheel(k) | C::WheelSpeed(k) | C::WheelAngle(k) | C::Current(k) | C::Voltage(k) => Some(k),
            _ => None,
        }
    }

    /// True for set-points.
    pub fn is_command(self) -> bool {
        matches!(
            self,
            C::CommandWheel(_) | C::CommandForward | C::CommandLeft | C::CommandYawRate | C::CommandSteering
        )
    }

    /// True for angles that a laboratory might have written in degrees, and how large they can be in radians.
    pub fn angle_limit_rad(self) -> Option<f64> {
        match self {
            // Wrapped to +-pi; a little more for rounding.
            C::PoseYaw => Some(core::f64::consts::PI + 1e-3),
            C::Steering | C::CommandSteering => Some(core::f64::consts::FRAC_PI_2),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_round_trip() {
        for name in [
            "command_wheel_0_rad_per_s",
            "wheel_5_rad",
            "wheel_5_rad_per_s",
            "current_2_a",
            "voltage_1_v",
            "pose_yaw_rad",
            "command_seq_applied",
        ] {
            assert_eq!(Channel::parse(name).map(Channel::name).as_deref(), Some(name));
        }
        for name in [
            "",
            "wheel_6_rad",
            "wheel_01_rad",
            "wheel_+1_rad",
            "pose_yaw_deg",
            "current_a",
            "time_s",
        ] {
            assert_eq!(Channel::parse(name), None, "{name}");
        }
    }
}
