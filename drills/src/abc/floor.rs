//! Hidden floors: what the plant really is, drawn from a seed. Nothing but the plant reads them.

use emulator::hidden::{FrictionPatch, Hidden, HiddenFloor, HiddenRobot, RunVariation, Wear};
use emulator::noise::Noise;

/// Floor of the reference laboratory.
const FLOOR: &str = "lab-floor";
/// Changes of a floor.
const CHANGES: usize = 3;

/// What can be wrong.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Change {
    Slippery,
    Patch,
    Tilt,
    Rolling,
    Payload,
    WeakMotor,
    Wheels,
    DryFriction,
    Steering,
    Play,
}

const ANY: [Change; 9] = [
    Change::Slippery,
    Change::Payload,
    Change::Wheels,
    Change::WeakMotor,
    Change::DryFriction,
    Change::Tilt,
    Change::Rolling,
    Change::Patch,
    Change::Play,
];

/// A robot that just left the workshop, on the floor it was measured on: tolerances of a healthy one.
pub fn reference(name: &str, seed: u64) -> Hidden {
    let mut random = Noise::new(seed, 0x0F_100F);
    let mut near = |spread: f64| 1.0 + spread * random.normal().clamp(-2.0, 2.0);
    let robot = HiddenRobot {
        mass_scale: near(0.02),
        yaw_inertia_scale: near(0.03),
        com_x_m: 0.005 * (near(1.0) - 1.0),
        com_y_m: 0.005 * (near(1.0) - 1.0),
        wheel_radius_scale: (0..4).map(|_| near(0.003)).collect(),
        wheel_direction_error_rad: (0..4).map(|_| near(0.003) - 1.0).collect(),
        torque_constant_scale: (0..4).map(|_| near(0.015)).collect(),
        coulomb_scale: 1.3,
        half_backlash_rad: 0.006,
        cogging_n_m: 0.0015,
        roller_drag: 0.015,
        battery_resistance_ohm: 0.09,
        ..HiddenRobot::default()
    };
    let mut hidden = Hidden::neutral();
    hidden.run_variation = RunVariation {
        friction: 0.03,
        mass: 0.005,
        torque_constant: 0.01,
        battery_charge: 0.03,
    };
    hidden.robots.insert(name.to_owned(), robot);
    hidden.floors.insert(
        FLOOR.to_owned(),
        HiddenFloor {
            friction_scale: 0.95,
            rolling_resistance: 0.01,
            ..HiddenFloor::default()
        },
    );
    hidden
}

/// The same robot on another floor and after some use: three changes.
///
/// - `number`: of the floor; the first one is slippery whatever else it is.
pub fn floor(name: &str, steered: bool, number: u64, seed: u64) -> Hidden {
    let mut hidden = reference(name, seed);
    let mut random = Noise::new(seed ^ (number << 20), 0x0F_100A);
    let mut ground = hidden.floor(FLOOR);
    let mut robot = hidden.robot(name);
    let mut left = ANY.to_vec();
    let mut chosen = Vec::new();
    if number.is_multiple_of(3) {
        chosen.push(left.remove(0));
    }
    if steered {
        chosen.push(Change::Steering);
    }
    while chosen.len() < CHANGES {
        chosen.push(left.remove((random.uniform() * left.len() as f64) as usize % left.len()));
    }
    for change in chosen {
        worsen(change, &mut ground, &mut robot, &mut random);
    }
    hidden.floors.insert(FLOOR.to_owned(), ground);
    hidden.robots.insert(name.to_owned(), robot);
    hidden
}

fn worsen(change: Change, ground: &mut HiddenFloor, robot: &mut HiddenRobot, random: &mut Noise) {
    let mut between = |least: f64, most: f64| least + (most - least) * random.uniform();
    match change {
        Change::Slippery => ground.friction_scale *= between(0.25, 0.5),
        Change::Patch => ground.patches.push(FrictionPatch {
            x_m: between(-1.0, 0.5),
            y_m: between(0.2, 0.6),
            radius_m: between(0.3, 0.5),
            friction_scale: between(0.2, 0.4),
        }),
        Change::Tilt => {
            let along = between(0.0, std::f64::consts::TAU);
            let rise = between(0.015, 0.035);
            ground.slope = [rise * along.cos(), rise * along.sin()];
        }
        Change::Rolling => ground.rolling_resistance += between(0.02, 0.05),
        Change::Payload => {
            let share = between(0.25, 0.5);
            robot.mass_scale *= 1.0 + share;
            robot.yaw_inertia_scale *= 1.0 + share;
            robot.com_x_m += between(-0.02, 0.02);
        }
        Change::WeakMotor => {
            let gain = between(0.5, 0.75);
            if let Some(first) = robot.torque_constant_scale.first_mut() {
                *first *= gain;
            }
        }
        Change::Wheels => {
            let (all, one) = (between(0.95, 0.98), between(0.95, 0.98));
            robot.wheel_radius_scale.iter_mut().for_each(|scale| *scale *= all);
            if let Some(first) = robot.wheel_radius_scale.first_mut() {
                *first *= one;
            }
        }
        Change::DryFriction => {
            robot.wear = Wear {
                coulomb_n_m: between(0.3, 0.7),
                ..robot.wear.clone()
            }
        }
        Change::Steering => {
            let side = if between(0.0, 1.0) < 0.5 { -1.0 } else { 1.0 };
            robot.wear = Wear {
                steering_offset_rad: side * between(0.03, 0.06),
                steering_lag_s: between(0.02, 0.06),
                ..robot.wear.clone()
            };
        }
        Change::Play => robot.half_backlash_rad += between(0.01, 0.03),
    }
}
