//! Robots that nobody has seen: a description drawn for every set, so that no method is right about one robot only.
//!
//! Sizes are drawn around what small laboratory robots have: 3 to 15 kg, wheels of 28 to 60 mm, motors that reach 1.3 to 2.4 m/s and push
//! with 4 to 14 N a kilogram, speed loops that settle in 20 to 100 ms.

use emulator::noise::Noise;
use twin::robot::{RobotDescription, Wheel};

/// Speed-loop gain that a rotor hanging free in its play bears at 480 Hz.
const LOOSE_ROTOR_PER_S: f64 = 380.0;
/// Lightest rotor that the plant's gear carries at its step.
const LEAST_INERTIA_KG_M2: f64 = 0.000_14;

/// One draw after the other from one stream.
struct Draw<'a>(&'a mut Noise);

impl Draw<'_> {
    fn between(&mut self, least: f64, most: f64) -> f64 {
        least + (most - least) * self.0.uniform()
    }

    fn log_between(&mut self, least: f64, most: f64) -> f64 {
        least * (most / least).powf(self.0.uniform())
    }

    fn one_of(&mut self, choices: &[f64]) -> f64 {
        choices[((self.0.uniform() * choices.len() as f64) as usize).min(choices.len() - 1)]
    }
}

/// A robot of a chassis.
///
/// - `stiff`: with gears in which dry friction matters, for the effects that scale it.
pub fn drawn_robot(chassis: &str, stiff: bool, noise: &mut Noise) -> RobotDescription {
    let mut robot = twin::golden::reference_robot(chassis);
    let mut draw = Draw(noise);
    robot.name = format!("{chassis}-{:02}", draw.between(1.0, 99.0) as u32);
    robot.mass_kg = draw.log_between(3.0, 15.0);
    let size = (robot.mass_kg / 12.0).cbrt();
    let [longer, wider] = [0, 0].map(|_| size * draw.between(0.85, 1.2));
    for wheel in &mut robot.wheels {
        wheel.x_m *= longer;
        wheel.y_m *= if chassis == "omni4" { longer } else { wider };
    }
    let reach = robot.wheels.iter().map(|wheel| wheel.x_m.hypot(wheel.y_m));
    let reach_m = reach.fold(0.0, f64::max);
    robot.yaw_inertia_kg_m2 = robot.mass_kg * reach_m * reach_m * draw.between(0.55, 0.8);
    robot.com_height_m = draw.between(0.4, 0.9) * reach_m;
    robot.floor_friction = draw.between(0.6, 0.9);
    motors(&mut robot, stiff, &mut draw);
    if let Some(steering) = &mut robot.steering {
        steering.lag_s = draw.between(0.06, 0.1);
        steering.rate_limit_rad_per_s = Some(draw.between(5.0, 7.0));
        steering.angle_limit_rad = Some(draw.between(0.42, 0.52));
    }
    let limit_a = robot.motor.as_ref().and_then(|motor| motor.current_limit_a);
    robot.noise = Some(twin::robot::Noise {
        pose_xy_m: Some(draw.between(0.0008, 0.0015)),
        pose_yaw_rad: Some(draw.between(0.0025, 0.004)),
        wheel_rad_per_s: Some(draw.between(0.03, 0.06)),
        current_a: limit_a.map(|limit_a| limit_a * draw.between(0.004, 0.009)),
        gyro_rad_per_s: Some(draw.between(0.005, 0.008)),
        accel_m_per_s2: Some(draw.between(0.04, 0.07)),
        bus_v: Some(draw.between(0.02, 0.04)),
        steering_rad: Some(draw.between(0.0015, 0.003)),
    });
    robot
}

/// Wheels, motors and speed loops that move such a mass.
fn motors(robot: &mut RobotDescription, stiff: bool, draw: &mut Draw) {
    let driven = robot.wheels.iter().filter(|wheel| wheel.driven).count() as f64;
    let radius_m = draw.log_between(0.028, 0.06);
    let spin_inertia = (draw.between(0.13, 0.3) * radius_m * radius_m).max(LEAST_INERTIA_KG_M2);
    let is_rolling = |wheel: &&mut Wheel| wheel.radius_m.is_some();
    for wheel in robot.wheels.iter_mut().filter(is_rolling) {
        wheel.radius_m = Some(radius_m);
        wheel.spin_inertia_kg_m2 = Some(if wheel.driven { spin_inertia } else { 0.5 * spin_inertia });
    }
    let mass_kg = robot.mass_kg;
    let Some(motor) = &mut robot.motor else { return };
    motor.supply_v = draw.one_of(&[12.0, 24.0]);
    motor.gear_ratio = draw.one_of(&[10.0, 14.0, 19.2, 27.0]);
    let no_load_rad_per_s = draw.log_between(1.3, 2.4) / radius_m;
    let constant = motor.supply_v / no_load_rad_per_s;
    motor.torque_constant_n_m_per_a = constant / motor.gear_ratio;
    let stall_n_m = draw.log_between(4.0, 14.0) * mass_kg * radius_m / driven;
    let limit_a = stall_n_m / constant;
    motor.current_limit_a = Some(limit_a);
    motor.resistance_ohm = draw.between(0.25, 0.65) * motor.supply_v / limit_a;
    let dry = if stiff {
        draw.between(0.08, 0.12)
    } else {
        draw.between(0.02, 0.05)
    };
    motor.coulomb_n_m = dry * stall_n_m;
    motor.viscous_n_m_s = draw.between(0.01, 0.04) * stall_n_m / no_load_rad_per_s;
    let carried = spin_inertia + mass_kg * radius_m * radius_m / driven;
    let loose = LOOSE_ROTOR_PER_S * spin_inertia;
    let gain = (draw.log_between(10.0, 50.0) * carried).min(loose);
    motor.speed_loop_kp_v_s_per_rad = gain * motor.resistance_ohm / constant;
    motor.speed_loop_ki_v_per_rad = draw.between(5.0, 8.0) * motor.speed_loop_kp_v_s_per_rad;
}

/// As its laboratory describes it: what nobody measured is not there.
pub fn described(robot: &RobotDescription, noise: &mut Noise) -> RobotDescription {
    let mut described = robot.clone();
    if let Some(sigmas) = described.noise.as_mut().filter(|_| noise.uniform() < 0.5) {
        (sigmas.bus_v, sigmas.steering_rad) = (None, None);
    }
    described
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::background::CHASSIS;

    #[test]
    fn two_hundred_drawn_robots_are_ones_that_the_twin_takes_and_no_two_are_alike() {
        for (c, chassis) in CHASSIS.into_iter().enumerate() {
            let mut masses = Vec::new();
            for number in 0..34 {
                let mut noise = Noise::new(number, 100 + c as u64);
                let robot = drawn_robot(chassis, number % 4 == 0, &mut noise);
                masses.push(robot.mass_kg);
                let taken = twin::robot::Robot::new(robot);
                assert!(taken.is_ok(), "{chassis} {number}: {:?}", taken.err());
            }
            masses.sort_by(f64::total_cmp);
            assert!(masses.windows(2).all(|pair| pair[0] < pair[1]));
            assert!(masses[0] > 3.0 && masses[33] < 15.0 && masses[33] > 2.0 * masses[0]);
        }
    }
}
