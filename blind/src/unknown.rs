//! Effects that no library has.

use crate::change::Change;
use crate::forces::Hill;
use emulator::noise::Noise;
use twin::robot::RobotDescription;

/// Names of the unknown effects that a chassis can have.
pub fn names(robot: &RobotDescription) -> Vec<&'static str> {
    let mut names = vec![
        "force_hill",
        "periodic_moment",
        "one_sided_loop_gain",
        "sideways_force",
        "air_drag",
    ];
    if robot.steering.is_some() {
        names.push("steering_stiction");
    }
    names
}

/// Draws one between clearly visible and large.
pub fn apply(name: &str, change: &mut Change, robot: &RobotDescription, noise: &mut Noise) {
    let size = 3f64.powf(noise.uniform());
    let mut side = |half: f64| half * (2.0 * noise.uniform() - 1.0);
    match name {
        "force_hill" => {
            change.forces.hill = Some(Hill {
                force_n: 0.4 * robot.mass_kg * size,
                at_m: [side(0.6), side(0.4)],
                width_m: 0.3 + side(0.08),
            });
        }
        "periodic_moment" => {
            let frequency_hz = 1.0 + side(0.6);
            change.forces.throb = Some((1.0 * robot.yaw_inertia_kg_m2 / 0.25 * size, frequency_hz));
        }
        "one_sided_loop_gain" => change.firmware.braking_gain = 0.6 / size,
        "sideways_force" => change.forces.sideways_n_s_per_m = 0.8 * robot.mass_kg * size,
        "air_drag" => change.forces.air_n_s2_per_m2 = 0.8 * robot.mass_kg * size,
        "steering_stiction" => change.firmware.steering_stiction_rad = 0.05 * size,
        _ => {}
    }
}
