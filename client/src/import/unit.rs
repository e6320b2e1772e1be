//! Units that other laboratories write, and what they are in the units of a run bundle.

use core::f64::consts::{PI, TAU};
use identify::channel::Channel;

/// What a column measures.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Dimension {
    Time,
    Length,
    Angle,
    Speed,
    AngularSpeed,
    Acceleration,
    Current,
    Voltage,
    Count,
}

/// Standard gravity, m/s2.
const GRAVITY: f64 = 9.806_65;

/// Dimension, unit, factor to the unit of the bundle. The first of a dimension is the bundle's own.
const UNITS: [(Dimension, &str, f64); 31] = [
    (Dimension::Time, "s", 1.0),
    (Dimension::Time, "ms", 1e-3),
    (Dimension::Time, "us", 1e-6),
    (Dimension::Time, "ns", 1e-9),
    (Dimension::Length, "m", 1.0),
    (Dimension::Length, "cm", 1e-2),
    (Dimension::Length, "mm", 1e-3),
    (Dimension::Angle, "rad", 1.0),
    (Dimension::Angle, "mrad", 1e-3),
    (Dimension::Angle, "deg", PI / 180.0),
    (Dimension::Angle, "turn", TAU),
    (Dimension::Speed, "m/s", 1.0),
    (Dimension::Speed, "cm/s", 1e-2),
    (Dimension::Speed, "mm/s", 1e-3),
    (Dimension::Speed, "km/h", 1.0 / 3.6),
    (Dimension::AngularSpeed, "rad/s", 1.0),
    (Dimension::AngularSpeed, "mrad/s", 1e-3),
    (Dimension::AngularSpeed, "deg/s", PI / 180.0),
    (Dimension::AngularSpeed, "turn/s", TAU),
    (Dimension::AngularSpeed, "rpm", TAU / 60.0),
    (Dimension::Acceleration, "m/s2", 1.0),
    (Dimension::Acceleration, "cm/s2", 1e-2),
    (Dimension::Acceleration, "g", GRAVITY),
    (Dimension::Acceleration, "mg", 1e-3 * GRAVITY),
    (Dimension::Current, "A", 1.0),
    (Dimension::Current, "mA", 1e-3),
    (Dimension::Current, "uA", 1e-6),
    (Dimension::Voltage, "V", 1.0),
    (Dimension::Voltage, "mV", 1e-3),
    (Dimension::Voltage, "uV", 1e-6),
    (Dimension::Count, "1", 1.0),
];

/// Dimension of a channel of the format.
pub fn dimension(channel: Channel) -> Dimension {
    match channel {
        Channel::CommandForward | Channel::CommandLeft | Channel::TargetForward | Channel::TargetLeft => {
            Dimension::Speed
        }
        Channel::CommandWheel(_) | Channel::WheelSpeed(_) | Channel::CommandYawRate | Channel::Gyro => {
            Dimension::AngularSpeed
        }
        Channel::CommandSteering | Channel::Steering | Channel::WheelAngle(_) | Channel::PoseYaw => Dimension::Angle,
        Channel::Current(_) => Dimension::Current,
        Channel::Voltage(_) | Channel::Bus => Dimension::Voltage,
        Channel::AccelX | Channel::AccelY => Dimension::Acceleration,
        Channel::PoseX | Channel::PoseY | Channel::TargetX | Channel::TargetY => Dimension::Length,
        Channel::PoseArrival | Channel::TelemetryArrival | Channel::RobotClock => Dimension::Time,
        Channel::CameraId | Channel::SequenceSent | Channel::SequenceApplied => Dimension::Count,
    }
}

/// Factor from a unit to the bundle's; `None` when the unit is not of this dimension.
pub fn factor(dimension: Dimension, unit: &str) -> Option<f64> {
    let known = UNITS.iter().find(|(own, name, _)| *own == dimension && *name == unit);
    known.map(|(_, _, factor)| *factor)
}

/// The units of a dimension, for messages.
pub fn names(dimension: Dimension) -> String {
    let own = UNITS.iter().filter(|(of, _, _)| *of == dimension);
    own.map(|(_, name, _)| *name).collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn factors_are_those_of_the_units() {
        for (dimension, unit, value, si) in [
            (Dimension::AngularSpeed, "rpm", 60.0, TAU),
            (Dimension::Angle, "deg", 180.0, PI),
            (Dimension::Speed, "km/h", 36.0, 10.0),
            (Dimension::Time, "us", 2_500_000.0, 2.5),
            (Dimension::Current, "mA", 1500.0, 1.5),
        ] {
            let found = factor(dimension, unit).map(|factor| factor * value);
            assert!(found.is_some_and(|found| (found - si).abs() < 1e-12), "{unit}");
        }
        assert_eq!(factor(Dimension::Length, "rad"), None);
    }
}
