//! A healthy robot: errors of everything below the size worth naming, drawn anew for every set.

use crate::change::Change;
use emulator::noise::Noise;
use twin::robot::RobotDescription;

/// The six chassis.
pub const CHASSIS: [&str; 6] = ["omni4", "diff2", "diff4", "fwd", "rwd", "awd"];
/// Of the link and the loop, in the plant's ticks.
const DELAY_TICKS: usize = 2;
/// Gears whose dry friction matters: at the wheel.
const STIFF_COULOMB_N_M: f64 = 0.2;
const STIFF_VISCOUS_N_M_S: f64 = 0.01;

/// The reference robot with sensors.
///
/// - `stiff`: with gears in which dry friction matters, for the effects that scale it.
pub fn robot(chassis: &str, stiff: bool) -> RobotDescription {
    let mut description = twin::golden::reference_robot(chassis);
    description.noise = Some(twin::robot::Noise {
        pose_xy_m: Some(0.001),
        pose_yaw_rad: Some(0.003),
        wheel_rad_per_s: Some(0.05),
        current_a: Some(0.03),
        gyro_rad_per_s: Some(0.006),
        accel_m_per_s2: Some(0.05),
        bus_v: Some(0.03),
        steering_rad: Some(0.002),
    });
    if let (true, Some(motor)) = (stiff, &mut description.motor) {
        motor.coulomb_n_m = STIFF_COULOMB_N_M;
        motor.viscous_n_m_s = STIFF_VISCOUS_N_M_S;
    }
    description
}

/// Torque of a blocked motor, and the practical size of viscous friction.
fn motor_sizes(robot: &RobotDescription) -> (f64, f64) {
    let Some(motor) = &robot.motor else { return (0.0, 0.0) };
    let constant = motor.gear_ratio * motor.torque_constant_n_m_per_a;
    let stall_n_m = constant * limit_a(robot);
    (stall_n_m, 0.05 * stall_n_m * constant / motor.supply_v)
}

fn limit_a(robot: &RobotDescription) -> f64 {
    robot.motor.as_ref().map_or(0.0, |motor| {
        let free = motor.supply_v / motor.resistance_ohm;
        motor.current_limit_a.map_or(free, |limit| limit.min(free))
    })
}

/// Resistance in which all motors at their limits lose the supply voltage once.
fn full_load_ohm(robot: &RobotDescription) -> f64 {
    let driven = robot.wheels.iter().filter(|wheel| wheel.driven).count().max(1) as f64;
    robot
        .motor
        .as_ref()
        .map_or(0.0, |motor| motor.supply_v / (driven * limit_a(robot)))
}

/// Everything a little off.
pub fn background(seed: u64, robot: &RobotDescription) -> Change {
    let mut noise = Noise::new(seed, 99);
    let mut near = |size: f64| size * (2.0 * noise.uniform() - 1.0);
    let (stall_n_m, practical_viscous) = motor_sizes(robot);
    let mut change = Change::default();
    let h = &mut change.hidden;
    h.mass_scale = 1.0 + near(0.05);
    h.yaw_inertia_scale = 1.0 + near(0.05);
    (h.com_x_m, h.com_y_m) = (near(0.002), near(0.002));
    let radius = near(0.002);
    let wheels = robot.wheels.len();
    h.wheel_radius_scale = (0..wheels).map(|_| 1.0 + radius + near(0.0008)).collect();
    h.wheel_direction_error_rad = (0..wheels).map(|_| near(0.003)).collect();
    h.spring_stiffness_scale = (0..wheels).map(|_| 1.0 + near(0.1)).collect();
    h.torque_constant_scale = (0..wheels).map(|_| 1.0 + near(0.015)).collect();
    h.coulomb_scale = 1.0 + near(0.4);
    h.cogging_n_m = (0.000_06 + near(0.000_06)) * stall_n_m;
    h.half_backlash_rad = 0.0012 + near(0.0008);
    h.battery_resistance_ohm = full_load_ohm(robot) * (0.006 + near(0.003));
    h.roller_drag = 0.002 + near(0.002);
    h.steering_play_rad = 0.0012 + near(0.001);
    let wear = &mut h.wear;
    // A third of the treads hardly creep, as the nominal ones do not.
    wear.creep_scale = (0.5 + near(0.75)).clamp(0.0, 1.0);
    wear.track_scale = 1.0 + near(0.008);
    wear.viscous_n_m_s = practical_viscous * (0.3 + near(0.3));
    wear.steering_offset_rad = near(0.003);
    wear.steering_scale = 1.0 + near(0.008);
    wear.run_out = (0..wheels).map(|_| [0.0008 + near(0.0008), near(3.0)]).collect();
    change.floor.friction_scale = 1.0 + near(0.05);
    change.floor.slope = [near(0.002), near(0.002)];
    change.floor.rolling_resistance = 0.001 + near(0.001);
    change.firmware.delay_ticks = DELAY_TICKS;
    let s = &mut change.sensing;
    s.latency_s = 0.002 + near(0.001);
    s.clock_offset_s = near(0.001);
    s.gyro_bias_rad_per_s = near(0.0015);
    s.gyro_scale = 1.0 + near(0.002);
    s.imu_yaw_rad = near(0.006);
    s.current_bias_a = limit_a(robot) * near(0.0022);
    s.current_scale = 1.0 + near(0.008);
    s.marker = [near(0.003), near(0.0008), near(0.0008)];
    s.pose_scale = 1.0 + near(0.0008);
    s.lens_per_m2 = near(0.0002);
    s.seam = [near(0.001), near(0.001), 0.0];
    s.tag_height_m = near(0.008);
    change
}
