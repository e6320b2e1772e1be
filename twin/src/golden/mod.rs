//! Scenarios with known digests: the same bits in debug, release and WebAssembly.
//!
//! [`TABLE`] changes only together with [`crate::VERSION`].

mod effects;
mod residual;

pub use effects::effect_digests;
pub use residual::{reference_residual, residual_digests};

use crate::command::WheelCommand;
use crate::pose::Pose;
use crate::replay::ReplayError;
use crate::robot::{Motor, ParameterError, Robot, RobotDescription, Steering, Wheel};
use crate::twist::BodyTwist;
use crate::world::{Arena, Digest, World, WorldError};

/// A scenario and the digest after its last tick.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Golden {
    pub name: &'static str,
    /// 32 hexadecimal characters.
    pub digest: &'static str,
}

/// Digests of [`run`], the same on every platform.
pub const TABLE: [Golden; 5] = [
    Golden {
        name: "omni4-alone",
        digest: "106267b4d3de043583903dd48726ae02",
    },
    Golden {
        name: "diff2-alone",
        digest: "ba635749fe2002737c6d5647b2d1a1d3",
    },
    Golden {
        name: "awd-slippery",
        digest: "a033e7dd4fe49889ef2714c68aa481ef",
    },
    Golden {
        name: "head-on",
        digest: "1558e667909af8d95efce40af4c2d6c3",
    },
    Golden {
        name: "pile-up",
        digest: "2d25b0aad471d9321d6f6a2930b155b3",
    },
];

/// Why a scenario did not run.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum GoldenError {
    #[error("no scenario {0:?}")]
    Unknown(String),
    #[error(transparent)]
    Robot(#[from] ParameterError),
    #[error(transparent)]
    World(#[from] WorldError),
    #[error(transparent)]
    Replay(#[from] ReplayError),
}

const CHASSIS: [&str; 6] = crate::parameter::CHASSIS;

/// Ticks of every scenario.
pub const TICKS: u64 = 600;

/// Runs a scenario of [`TABLE`] for [`TICKS`] and gives its digest.
pub fn run(name: &str) -> Result<Digest, GoldenError> {
    let robots = scenario(name).ok_or_else(|| GoldenError::Unknown(name.to_owned()))?;
    let mut placed = Vec::new();
    for (chassis, friction, pose) in robots {
        let mut description = reference_robot(chassis);
        description.floor_friction = friction;
        placed.push((Robot::new(description)?, pose, 0.25));
    }
    let robots: Vec<Robot> = placed.iter().map(|(robot, _, _)| robot.clone()).collect();
    let mut world = World::new(
        Arena {
            width_m: 4.0,
            height_m: 3.0,
        },
        placed,
    )?;
    for tick in 0..TICKS {
        let commands: Vec<WheelCommand> = robots
            .iter()
            .enumerate()
            .map(|(index, robot)| command(robot, index, tick))
            .collect();
        world.step(&commands)?;
    }
    Ok(world.digest())
}

fn scenario(name: &str) -> Option<Vec<(&'static str, f64, Pose)>> {
    let at = |x_m: f64, y_m: f64, yaw_rad: f64| Pose { x_m, y_m, yaw_rad };
    Some(match name {
        "omni4-alone" => vec![("omni4", 0.8, at(0.1, -0.2, 0.3))],
        "diff2-alone" => vec![("diff2", 0.8, at(-0.4, 0.3, 1.3))],
        "awd-slippery" => vec![("awd", 0.15, at(-0.8, 0.0, 0.2))],
        "head-on" => vec![("diff2", 0.8, at(-1.0, 0.0, 0.0)), ("omni4", 0.8, at(1.0, 0.05, 3.1))],
        "pile-up" => vec![
            ("omni4", 0.8, at(-1.5, -0.8, 0.6)),
            ("diff2", 0.6, at(0.0, -0.9, 1.6)),
            ("diff4", 0.8, at(1.5, -0.8, 2.5)),
            ("fwd", 0.7, at(-1.5, 0.9, -0.6)),
            ("rwd", 0.8, at(0.0, 0.9, -1.6)),
            ("awd", 0.8, at(1.5, 0.9, -2.5)),
        ],
        _ => return None,
    })
}

/// Set-points that change four times in three seconds and differ between robots.
fn command(robot: &Robot, index: usize, tick: u64) -> WheelCommand {
    let phase = (tick / 90 % 4) as f64;
    robot.wheel_speeds(BodyTwist {
        forward_m_per_s: 0.9 - 0.4 * phase,
        left_m_per_s: 0.1 * phase,
        yaw_rate_rad_per_s: 0.4 * index as f64 - 0.3 * phase,
    })
}

/// A robot of each chassis: 12 kg, 50 mm wheels, 24 V motors.
pub fn reference_robot(chassis: &str) -> RobotDescription {
    let car = matches!(chassis, "fwd" | "rwd" | "awd");
    RobotDescription {
        name: format!("{chassis}-reference"),
        chassis: chassis.to_owned(),
        mass_kg: 12.0,
        yaw_inertia_kg_m2: 0.25,
        com_height_m: 0.11,
        wheels: reference_wheels(chassis),
        motor: Some(Motor {
            gear_ratio: 19.2,
            torque_constant_n_m_per_a: 0.031,
            resistance_ohm: 0.6,
            current_limit_a: Some(9.0),
            supply_v: 24.0,
            viscous_n_m_s: 0.0004,
            coulomb_n_m: 0.02,
            speed_loop_kp_v_s_per_rad: 0.8,
            speed_loop_ki_v_per_rad: 6.0,
            controller: None,
        }),
        steering: car.then_some(Steering {
            lag_s: 0.08,
            filter_s: None,
            rate_limit_rad_per_s: Some(6.0),
            angle_limit_rad: Some(0.5),
        }),
        floor_friction: 0.8,
        tread: None,
        accelerometer_lag_s: None,
        noise: None,
    }
}

fn reference_wheels(chassis: &str) -> Vec<Wheel> {
    let quarter = core::f64::consts::FRAC_PI_4;
    let wheel = |x_m: f64, y_m: f64, turns: f64, kind: &str, driven: bool, steered: bool| Wheel {
        x_m,
        y_m,
        rolling_direction_rad: turns * quarter,
        radius_m: Some(0.05),
        spin_inertia_kg_m2: Some(0.0008),
        kind: kind.to_owned(),
        driven,
        steered,
    };
    match chassis {
        "omni4" => [
            (0.12, 0.12, 3.0),
            (-0.12, 0.12, 5.0),
            (-0.12, -0.12, 7.0),
            (0.12, -0.12, 9.0),
        ]
        .map(|(x, y, turns)| wheel(x, y, turns, "omni", true, false))
        .to_vec(),
        "diff2" => vec![
            wheel(0.0, 0.15, 0.0, "standard", true, false),
            wheel(0.0, -0.15, 0.0, "standard", true, false),
            wheel(0.12, 0.0, 0.0, "caster", false, false),
            wheel(-0.12, 0.0, 0.0, "caster", false, false),
        ],
        _ => [(0.12, 0.1), (0.12, -0.1), (-0.12, 0.1), (-0.12, -0.1)]
            .map(|(x, y)| {
                let front = x > 0.0;
                let driven = match chassis {
                    "fwd" => front,
                    "rwd" => !front,
                    _ => true,
                };
                wheel(x, y, 0.0, "standard", driven, front && chassis != "diff4")
            })
            .to_vec(),
    }
}
