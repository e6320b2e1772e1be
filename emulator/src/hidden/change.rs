//! Changes on demand: what happens to a robot or to the floor while nobody looks.
//!
//! Sizes are those of the diagnosis's effect library where it has the effect; the laws are the plant's own. Changes add up on
//! the configuration that the emulator was started with, until `none` takes all of them away.

use super::{FrictionPatch, Hidden, HiddenRobot};
use api::robot::RobotDescription;
use serde::{Deserialize, Serialize};

/// `{"hide": {"effect": "payload", "robot": "omni-01", "mass_share": 0.25}}`
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "effect", rename_all = "snake_case")]
pub enum Change {
    /// All wheels of a robot are larger by this share.
    WheelRadius { robot: String, relative: f64 },
    /// Torque constant of one driven wheel's motor times `gain`; `motor` is its position among the driven wheels.
    WeakMotor { robot: String, motor: usize, gain: f64 },
    /// Load over the middle, as a share of the robot's own mass.
    Payload { robot: String, mass_share: f64 },
    /// Dry friction added to every motor, at the wheel.
    CoulombFriction { robot: String, torque_n_m: f64 },
    /// Added to the time with which the motors' controllers smooth their set-points.
    MotorLag { robot: String, time_constant_s: f64 },
    /// Viscous friction added to every motor, at the wheel.
    ViscousFriction { robot: String, coefficient_n_m_s: f64 },
    /// Play added between every motor and its wheel, at the wheel.
    GearBacklash { robot: String, play_rad: f64 },
    /// One wheel is larger by this share; `wheel` is its position in the description.
    WheelRadiusOne { robot: String, wheel: usize, relative: f64 },
    /// One wheel points this far to the left of where it is described.
    WheelMisalignment { robot: String, wheel: usize, toe_rad: f64 },
    /// Distances of the wheels from the middle, of omni wheels along both axes and of others to the side, are larger by this share.
    TrackWidth { robot: String, relative: f64 },
    /// Against the free direction of each omni wheel.
    RollerDrag { robot: String, per_wheel_n_s_per_m: f64 },
    /// The middle of the mass lies this much further forward and left.
    CenterOfMassOffset { robot: String, x_m: f64, y_m: f64 },
    /// Added to what battery and wires resist with.
    BatterySag { robot: String, resistance_ohm: f64 },
    /// Added to what the gyro says.
    GyroBias { robot: String, bias_rad_per_s: f64 },
    /// Between servo and wheels; positive steers left of what the servo says.
    SteeringOffset { robot: String, offset_rad: f64 },
    /// What the servo says times `scale` is what the wheels do.
    SteeringScale { robot: String, scale: f64 },
    /// Added to the servo's lag.
    SteeringLag { robot: String, time_constant_s: f64 },
    /// Play added between servo and wheels.
    SteeringBacklash { robot: String, play_rad: f64 },
    /// Friction of the whole floor times `scale`.
    FloorFriction { scale: f64 },
    /// A round spot with another friction.
    LowFrictionPatch {
        x_m: f64,
        y_m: f64,
        radius_m: f64,
        scale: f64,
    },
    /// Rise of the floor per metre along x and y.
    FloorTilt { x: f64, y: f64 },
    /// Added to the force of rolling over the load, of the whole floor.
    RollingResistance { coefficient: f64 },
    /// Takes every change away, of all robots and the floor.
    None,
}

/// A size outside of what the plant is made for.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{name} {value} is outside {range}")]
pub struct ChangeProblem {
    pub name: &'static str,
    pub value: f64,
    pub range: &'static str,
}

impl Change {
    /// Name of the robot that is changed; none when it is the floor.
    pub fn robot(&self) -> Option<&str> {
        match self {
            Self::WheelRadius { robot, .. }
            | Self::WeakMotor { robot, .. }
            | Self::Payload { robot, .. }
            | Self::CoulombFriction { robot, .. }
            | Self::MotorLag { robot, .. }
            | Self::ViscousFriction { robot, .. }
            | Self::GearBacklash { robot, .. }
            | Self::WheelRadiusOne { robot, .. }
            | Self::WheelMisalignment { robot, .. }
            | Self::TrackWidth { robot, .. }
            | Self::RollerDrag { robot, .. }
            | Self::CenterOfMassOffset { robot, .. }
            | Self::BatterySag { robot, .. }
            | Self::GyroBias { robot, .. }
            | Self::SteeringOffset { robot, .. }
            | Self::SteeringScale { robot, .. }
            | Self::SteeringLag { robot, .. }
            | Self::SteeringBacklash { robot, .. } => Some(robot),
            Self::FloorFriction { .. }
            | Self::LowFrictionPatch { .. }
            | Self::FloorTilt { .. }
            | Self::RollingResistance { .. }
            | Self::None => None,
        }
    }

    /// What this robot would need to be changed so and does not have, in words.
    pub fn missing_part(&self, robot: &RobotDescription) -> Option<String> {
        let wheels = robot.wheels.len();
        let motors = robot.wheels.iter().filter(|wheel| wheel.driven).count();
        match *self {
            Self::WeakMotor { motor, .. } if motor >= motors => Some(format!("motor {motor}; it has {motors}, from 0")),
            Self::WheelRadiusOne { wheel, .. } | Self::WheelMisalignment { wheel, .. } if wheel >= wheels => {
                Some(format!("wheel {wheel}; it has {wheels}, from 0"))
            }
            Self::WheelRadiusOne { wheel, .. } | Self::WheelMisalignment { wheel, .. }
                if robot.wheels.get(wheel).is_some_and(|wheel| wheel.kind == "caster") =>
            {
                Some(format!("direction or radius of its own at wheel {wheel}, a caster"))
            }
            Self::RollerDrag { .. } if robot.wheels.iter().all(|wheel| wheel.kind != "omni") => {
                Some("omni wheel".to_owned())
            }
            Self::SteeringOffset { .. }
            | Self::SteeringScale { .. }
            | Self::SteeringLag { .. }
            | Self::SteeringBacklash { .. }
                if robot.steering.is_none() =>
            {
                Some("steered wheel".to_owned())
            }
            _ => None,
        }
    }

    /// - Errors: the first size that is out of range or no number.
    pub fn check(&self) -> Result<(), ChangeProblem> {
        let within = |name, value: f64, [least, most]: [f64; 2], range| {
            let fits = (least..=most).contains(&value);
            if fits {
                Ok(())
            } else {
                Err(ChangeProblem { name, value, range })
            }
        };
        match *self {
            Self::WheelRadius { relative, .. } => within("relative", relative, [-0.3, 0.3], "-0.3..=0.3"),
            Self::WeakMotor { motor, gain, .. } => {
                within("motor", motor as f64, [0.0, 3.0], "0..=3")?;
                within("gain", gain, [0.2, 1.5], "0.2..=1.5")
            }
            Self::Payload { mass_share, .. } => within("mass_share", mass_share, [-0.5, 2.0], "-0.5..=2"),
            Self::CoulombFriction { torque_n_m, .. } => within("torque_n_m", torque_n_m, [0.0, 3.0], "0..=3"),
            Self::ViscousFriction { coefficient_n_m_s, .. } => {
                within("coefficient_n_m_s", coefficient_n_m_s, [0.0, 3.0], "0..=3")
            }
            Self::GearBacklash { play_rad, .. } | Self::SteeringBacklash { play_rad, .. } => {
                within("play_rad", play_rad, [0.0, 0.3], "0..=0.3")
            }
            Self::WheelRadiusOne { wheel, relative, .. } => {
                within("wheel", wheel as f64, [0.0, WHEELS_MOST as f64 - 1.0], "0..=7")?;
                within("relative", relative, [-0.3, 0.3], "-0.3..=0.3")
            }
            Self::WheelMisalignment { wheel, toe_rad, .. } => {
                within("wheel", wheel as f64, [0.0, WHEELS_MOST as f64 - 1.0], "0..=7")?;
                within("toe_rad", toe_rad, [-0.3, 0.3], "-0.3..=0.3")
            }
            Self::TrackWidth { relative, .. } => within("relative", relative, [-0.3, 0.3], "-0.3..=0.3"),
            Self::RollerDrag {
                per_wheel_n_s_per_m, ..
            } => within("per_wheel_n_s_per_m", per_wheel_n_s_per_m, [0.0, 50.0], "0..=50"),
            Self::CenterOfMassOffset { x_m, y_m, .. } => {
                within("x_m", x_m, [-0.1, 0.1], "-0.1..=0.1")?;
                within("y_m", y_m, [-0.1, 0.1], "-0.1..=0.1")
            }
            Self::BatterySag { resistance_ohm, .. } => within("resistance_ohm", resistance_ohm, [0.0, 3.0], "0..=3"),
            Self::SteeringScale { scale, .. } => within("scale", scale, [0.3, 2.0], "0.3..=2"),
            Self::MotorLag { time_constant_s, .. } | Self::SteeringLag { time_constant_s, .. } => {
                within("time_constant_s", time_constant_s, [0.0, 1.0], "0..=1")
            }
            Self::RollingResistance { coefficient } => within("coefficient", coefficient, [0.0, 0.3], "0..=0.3"),
            Self::GyroBias { bias_rad_per_s, .. } => {
                within("bias_rad_per_s", bias_rad_per_s, [-0.5, 0.5], "-0.5..=0.5")
            }
            Self::SteeringOffset { offset_rad, .. } => within("offset_rad", offset_rad, [-0.3, 0.3], "-0.3..=0.3"),
            Self::FloorFriction { scale } => within("scale", scale, [0.05, 2.0], "0.05..=2"),
            Self::LowFrictionPatch {
                x_m,
                y_m,
                radius_m,
                scale,
            } => {
                within("x_m", x_m, [-10.0, 10.0], "-10..=10")?;
                within("y_m", y_m, [-10.0, 10.0], "-10..=10")?;
                within("radius_m", radius_m, [0.01, 5.0], "0.01..=5")?;
                within("scale", scale, [0.05, 2.0], "0.05..=2")
            }
            Self::FloorTilt { x, y } => {
                within("x", x, [-0.1, 0.1], "-0.1..=0.1")?;
                within("y", y, [-0.1, 0.1], "-0.1..=0.1")
            }
            Self::None => Ok(()),
        }
    }
}

impl Hidden {
    /// Adds a change.
    ///
    /// - `floor`: the arena's floor, which changes of the floor are of.
    pub fn change(&mut self, change: &Change, floor: &str) {
        if let Some(name) = change.robot() {
            let mut robot = self.robot(name);
            change_robot(&mut robot, change);
            self.robots.insert(name.to_owned(), robot);
            return;
        }
        let mut ground = self.floor(floor);
        match *change {
            Change::FloorFriction { scale } => ground.friction_scale *= scale,
            Change::LowFrictionPatch {
                x_m,
                y_m,
                radius_m,
                scale,
            } => ground.patches.push(FrictionPatch {
                x_m,
                y_m,
                radius_m,
                friction_scale: scale,
            }),
            Change::FloorTilt { x, y } => {
                ground.slope[0] += x;
                ground.slope[1] += y;
            }
            Change::RollingResistance { coefficient } => ground.rolling_resistance += coefficient,
            _ => return,
        }
        self.floors.insert(floor.to_owned(), ground);
    }
}

fn change_robot(robot: &mut HiddenRobot, change: &Change) {
    match *change {
        Change::WheelRadius { relative, .. } => {
            for place in 0..WHEELS_MOST {
                *entry(&mut robot.wheel_radius_scale, place, 1.0) *= 1.0 + relative;
            }
        }
        Change::WeakMotor { motor, gain, .. } => *entry(&mut robot.torque_constant_scale, motor, 1.0) *= gain,
        // A load over the middle, spread as the robot itself is.
        Change::Payload { mass_share, .. } => {
            robot.mass_scale *= 1.0 + mass_share;
            robot.yaw_inertia_scale *= 1.0 + mass_share;
        }
        Change::CoulombFriction { torque_n_m, .. } => robot.wear.coulomb_n_m += torque_n_m,
        Change::GyroBias { bias_rad_per_s, .. } => robot.gyro_bias_rad_per_s += bias_rad_per_s,
        Change::MotorLag { time_constant_s, .. } => robot.wear.motor_lag_s += time_constant_s,
        Change::ViscousFriction { coefficient_n_m_s, .. } => robot.wear.viscous_n_m_s += coefficient_n_m_s,
        Change::GearBacklash { play_rad, .. } => robot.half_backlash_rad += 0.5 * play_rad,
        Change::WheelRadiusOne { wheel, relative, .. } => {
            *entry(&mut robot.wheel_radius_scale, wheel, 1.0) *= 1.0 + relative;
        }
        Change::WheelMisalignment { wheel, toe_rad, .. } => {
            *entry(&mut robot.wheel_direction_error_rad, wheel, 0.0) += toe_rad;
        }
        Change::TrackWidth { relative, .. } => robot.wear.track_scale *= 1.0 + relative,
        Change::RollerDrag {
            per_wheel_n_s_per_m, ..
        } => robot.wear.roller_viscous_n_s_per_m += per_wheel_n_s_per_m,
        Change::CenterOfMassOffset { x_m, y_m, .. } => {
            robot.com_x_m += x_m;
            robot.com_y_m += y_m;
        }
        Change::BatterySag { resistance_ohm, .. } => robot.battery_resistance_ohm += resistance_ohm,
        Change::SteeringOffset { offset_rad, .. } => robot.wear.steering_offset_rad += offset_rad,
        Change::SteeringScale { scale, .. } => robot.wear.steering_scale *= scale,
        Change::SteeringLag { time_constant_s, .. } => robot.wear.steering_lag_s += time_constant_s,
        // The plant's play is to each side of the servo.
        Change::SteeringBacklash { play_rad, .. } => robot.steering_play_rad += 0.5 * play_rad,
        Change::FloorFriction { .. }
        | Change::LowFrictionPatch { .. }
        | Change::FloorTilt { .. }
        | Change::RollingResistance { .. }
        | Change::None => {}
    }
}

/// Wheels and casters of the largest robot.
const WHEELS_MOST: usize = 8;

/// A place of a list that may end early, and goes on with the neutral value.
fn entry(list: &mut Vec<f64>, place: usize, neutral: f64) -> &mut f64 {
    if list.len() <= place {
        list.resize(place + 1, neutral);
    }
    &mut list[place]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn changes_add_up_on_what_the_robot_is_anyway() {
        let mut hidden = Hidden::reference().unwrap();
        let before = hidden.robot("diff-01");
        let change: Change =
            serde_json::from_str(r#"{"effect":"wheel_radius","robot":"diff-01","relative":0.05}"#).unwrap();
        hidden.change(&change, "lab-floor");
        hidden.change(&change, "lab-floor");
        let after = hidden.robot("diff-01");
        assert!((after.wheel_radius_scale[1] / before.wheel_radius_scale[1] - 1.1025).abs() < 1e-12);
        assert_eq!(
            hidden.robot("diff-02").wheel_radius_scale,
            Hidden::reference().unwrap().robot("diff-02").wheel_radius_scale
        );
        let toe = |wheel, toe_rad| Change::WheelMisalignment {
            robot: "diff-01".to_owned(),
            wheel,
            toe_rad,
        };
        hidden.change(&toe(3, 0.02), "lab-floor");
        let directions = hidden.robot("diff-01").wheel_direction_error_rad;
        assert_eq!(
            directions[2..],
            [0.0, 0.02],
            "a list that ended early goes on with no error"
        );
        let friction = hidden.floor("lab-floor").friction_scale;
        hidden.change(&Change::FloorFriction { scale: 0.5 }, "lab-floor");
        assert!((hidden.floor("lab-floor").friction_scale - 0.5 * friction).abs() < 1e-12);
        assert_eq!(hidden.floor("another").friction_scale, 1.0);
    }

    #[test]
    fn sizes_without_sense_are_refused_by_name() {
        let weak = |gain| Change::WeakMotor {
            robot: "omni-01".to_owned(),
            motor: 0,
            gain,
        };
        assert_eq!(weak(0.8).check(), Ok(()));
        assert_eq!(weak(0.0).check().map_err(|problem| problem.name), Err("gain"));
        assert_eq!(weak(f64::NAN).check().map_err(|problem| problem.name), Err("gain"));
        let wheel = Change::WheelRadiusOne {
            robot: "omni-01".to_owned(),
            wheel: 8,
            relative: 0.01,
        };
        assert_eq!(wheel.check().map_err(|problem| problem.name), Err("wheel"));
        let far = Change::LowFrictionPatch {
            x_m: 0.0,
            y_m: 0.0,
            radius_m: 50.0,
            scale: 0.2,
        };
        assert_eq!(far.check().map_err(|problem| problem.name), Err("radius_m"));
    }
}
