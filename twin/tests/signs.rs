//! Which way actuators, sensors and effects act.

mod support;

use support::{car, diff2, omni4};
use twin::command::WheelCommand;
use twin::effect::Effect;
use twin::pose::Pose;
use twin::replay::{CommandRow, ReplayRow, replay};
use twin::robot::{Robot, RobotDescription};
use twin::world::RobotState;

/// Two seconds of one set-point, 120 rows a second.
fn drive(robot: RobotDescription, effects: &[Effect], command: WheelCommand) -> Vec<ReplayRow> {
    let robot = Robot::with_effects(robot, effects).expect("effects");
    let rows: Vec<CommandRow> = (0..=240)
        .map(|tick| CommandRow {
            time_s: f64::from(tick) / 120.0,
            wheel_rad_per_s: command.wheel_rad_per_s.map(Some),
            steering_rad: Some(command.steering_rad),
            ..CommandRow::default()
        })
        .collect();
    replay(&robot, Pose::default(), &rows).expect("finite")
}

fn end(robot: RobotDescription, effects: &[Effect], command: WheelCommand) -> RobotState {
    drive(robot, effects, command).last().expect("rows").state
}

/// Both wheels of `diff2`.
fn both(left: f64, right: f64) -> WheelCommand {
    let mut command = WheelCommand::default();
    command.wheel_rad_per_s[..2].copy_from_slice(&[left, right]);
    command
}

/// All wheels of a car, with a steering angle.
fn car_command(speed: f64, steering_rad: f64) -> WheelCommand {
    let mut command = WheelCommand {
        steering_rad,
        ..WheelCommand::default()
    };
    command.wheel_rad_per_s[..4].fill(speed);
    command
}

fn one(name: &str, parameter: &str, value: f64) -> [Effect; 1] {
    [Effect::new(name, &[(parameter, value)])]
}

#[test]
fn actuators_and_sensors_have_the_signs_of_the_notation() {
    let ahead = drive(diff2(), &[], both(8.0, 8.0));
    let last = ahead[240].state;
    assert!(last.pose.x_m > 0.5 && last.pose.y_m.abs() < 1e-9);
    assert!(last.wheel_rad[0] > 10.0 && last.current_a[0] > 0.0 && last.voltage_v[0] > 0.0);
    assert!(ahead[12].state.accel_x_m_per_s2 > 0.1, "speeding up is forward");
    let back = end(diff2(), &[], both(-8.0, -8.0));
    assert!(back.pose.x_m < -0.5 && back.current_a[0] < 0.0);
    let left = end(diff2(), &[], both(-2.0, 2.0));
    assert!(left.pose.yaw_rad > 0.5 && left.gyro_z_rad_per_s > 0.3);
    let arc = drive(diff2(), &[], both(6.0, 8.0));
    assert!(arc[200].state.accel_y_m_per_s2 > 0.05, "a left turn pushes to the left");
    for chassis in ["fwd", "rwd", "awd"] {
        let turned = end(car(chassis), &[], car_command(6.0, 0.2));
        assert!(
            turned.pose.x_m > 0.3 && turned.pose.yaw_rad > 0.2 && turned.steering_rad > 0.19,
            "{chassis}"
        );
    }
    let mut strafe = WheelCommand::default();
    // Rolling directions 135, 225, 315, 45 degrees: left is + - - +.
    strafe.wheel_rad_per_s[..4].copy_from_slice(&[6.0, -6.0, -6.0, 6.0]);
    assert!(end(omni4(), &[], strafe).pose.y_m > 0.3);
}

#[test]
fn friction_and_motors() {
    let command = both(10.0, 10.0);
    let plain = end(diff2(), &[], command);
    for effect in [
        one("coulomb_friction", "torque", 0.3),
        one("viscous_friction", "coefficient", 0.03),
        one("rolling_resistance", "coefficient", 0.03),
    ] {
        let changed = end(diff2(), &effect, command);
        assert!(changed.current_a[0] > plain.current_a[0] + 0.05, "{}", effect[0].name);
    }
    let forward = end(diff2(), &one("asymmetric_friction", "difference", 0.5), command);
    let backward = end(
        diff2(),
        &one("asymmetric_friction", "difference", 0.5),
        both(-10.0, -10.0),
    );
    assert!(forward.current_a[0] > plain.current_a[0] && -backward.current_a[0] < plain.current_a[0]);
    let slow = both(0.5, 0.5);
    let sticky = [Effect::new("stribeck_friction", &[("ratio", 3.0), ("speed", 5.0)])];
    assert!(end(diff2(), &sticky, slow).current_a[0] > end(diff2(), &[], slow).current_a[0]);
    let weak = [Effect::new("weak_motor", &[("gain", 0.7)]).at(0)];
    let friction = Effect::new("coulomb_friction", &[("torque", 0.3)]);
    let weak = end(diff2(), &[weak[0].clone(), friction], command);
    assert!(
        weak.current_a[0] > weak.current_a[1],
        "the weak motor takes more current"
    );
    let sagging = drive(diff2(), &one("battery_sag", "resistance", 0.2), both(30.0, 30.0));
    assert!(sagging[6].state.bus_v < 23.9 && sagging[6].state.bus_v > 12.0);
    let drooping = end(diff2(), &one("battery_droop", "rate", 1.0), command);
    assert!((drooping.bus_v - 22.0).abs() < 0.02, "{}", drooping.bus_v);
    let hot = [Effect::new(
        "thermal_drift",
        &[("relative", 1.0), ("time_constant", 0.5)],
    )];
    let burst = both(60.0, 60.0);
    assert!(end(diff2(), &hot, burst).wheel_rad_per_s[0] < end(diff2(), &[], burst).wheel_rad_per_s[0]);
}

#[test]
fn commands() {
    let command = both(10.0, 10.0);
    let plain = drive(diff2(), &[], command);
    let early = |effects: &[Effect]| drive(diff2(), effects, command)[24].state.wheel_rad[0];
    for effect in [
        one("command_delay", "delay", 0.05),
        one("motor_lag", "time_constant", 0.1),
        one("acceleration_limit", "limit", 1.0),
        one("wheel_speed_saturation", "limit", 5.0),
        one("body_speed_saturation", "forward", 0.2),
        one("command_dead_band", "width", 11.0),
    ] {
        assert!(early(&effect) < plain[24].state.wheel_rad[0], "{}", effect[0].name);
    }
    // The delay is the delay: the trace is the plain one, 6 rows of 120 Hz later.
    let delayed = drive(diff2(), &one("command_delay", "delay", 0.05), command);
    assert!((delayed[106].state.pose.x_m - plain[100].state.pose.x_m).abs() < 1e-9);
    let limited = end(diff2(), &one("acceleration_limit", "limit", 0.2), command);
    // A PI speed loop follows a ramp n k_e / k_i late.
    let late_s = 19.2 * 0.031 / 6.0;
    let expected = 0.2 * (2.0 - late_s);
    assert!((limited.twist.forward_m_per_s - expected).abs() < 0.003, "{expected}");
}

#[test]
fn geometry_and_floor() {
    let command = both(8.0, 8.0);
    let plain = end(diff2(), &[], command);
    let larger = end(diff2(), &one("wheel_radius", "relative", 0.1), command);
    assert!((larger.pose.x_m / plain.pose.x_m - 1.1).abs() < 0.01);
    let right = [Effect::new("wheel_radius_one", &[("relative", 0.05)]).at(1)];
    assert!(
        end(diff2(), &right, command).pose.yaw_rad > 0.05,
        "a larger right wheel turns left"
    );
    let spin = both(-3.0, 3.0);
    let wide = end(diff2(), &one("track_width", "relative", 0.2), spin);
    assert!((end(diff2(), &[], spin).pose.yaw_rad / wide.pose.yaw_rad - 1.2).abs() < 0.02);
    let toe = [Effect::new("wheel_misalignment", &[("toe", 0.03)]).at(0)];
    assert!(end(car("rwd"), &toe, car_command(8.0, 0.0)).pose.yaw_rad.abs() > 0.01);
    let hard = both(40.0, 40.0);
    let grip = |effects: &[Effect]| drive(diff2(), effects, hard)[36].state.pose.x_m;
    assert!(grip(&one("floor_friction", "scale", 0.3)) < 0.8 * grip(&[]));
    assert!(grip(&one("longitudinal_slip", "slip_ratio_at_full_force", 0.2)) < grip(&[]));
    let patch = [Effect::new(
        "low_friction_patch",
        &[("x", 0.0), ("y", 0.15), ("radius", 0.1), ("scale", 0.1)],
    )];
    let turned = drive(diff2(), &patch, hard)[24].state.pose.yaw_rad;
    assert!(
        turned > 0.02,
        "the left wheel slips, the right one pushes round to the left: {turned}"
    );
    let fast = car_command(24.0, 0.3);
    let plain = end(car("rwd"), &[], fast).gyro_z_rad_per_s.abs();
    assert!(
        end(car("rwd"), &one("lateral_slip", "side_friction", 0.3), fast)
            .gyro_z_rad_per_s
            .abs()
            < plain
    );
}

#[test]
fn body_forces() {
    let rest = WheelCommand::default();
    let tilt = end(diff2(), &one("floor_tilt", "x", 0.05), rest);
    assert!(
        tilt.pose.x_m > 0.0 && tilt.accel_x_m_per_s2 < -0.4,
        "at rest it reads minus the tilt: {tilt:?}"
    );
    let command = both(8.0, 8.0);
    let plain = end(diff2(), &[], command);
    let heavy = drive(diff2(), &one("payload", "mass", 6.0), command);
    assert!(heavy[6].state.current_a[0] >= drive(diff2(), &[], command)[6].state.current_a[0]);
    let cable = [Effect::new(
        "cable_drag",
        &[("stiffness", 10.0), ("x", -1.0), ("slack", 0.5)],
    )];
    assert!(
        end(diff2(), &cable, command).current_a[0] > plain.current_a[0] + 0.1,
        "the cable pulls back"
    );
    let grain = [Effect::new("carpet_grain", &[("force", 4.0), ("direction", 0.0)])];
    assert!(end(diff2(), &grain, command).current_a[0] > plain.current_a[0] + 0.05);
    let across = [Effect::new(
        "carpet_grain",
        &[("force", 4.0), ("direction", core::f64::consts::FRAC_PI_2)],
    )];
    assert!(
        (end(diff2(), &across, command).current_a[0] - plain.current_a[0]).abs() < 0.01,
        "not along the grain"
    );
    let mut diagonal = WheelCommand::default();
    diagonal.wheel_rad_per_s[..4].copy_from_slice(&[0.0, -8.0, 0.0, 8.0]);
    let dragged = end(omni4(), &one("roller_drag", "per_wheel", 6.0), diagonal);
    assert!(dragged.current_a[3] > end(omni4(), &[], diagonal).current_a[3] + 0.1);
    // A mass ahead of the axle is carried round by it: its acceleration gains r^2 x backwards.
    let ahead = [Effect::new("center_of_mass_offset", &[("x", 0.05)])];
    let turning = drive(diff2(), &ahead, both(6.0, 8.0))[200].state;
    let centred = drive(diff2(), &[], both(6.0, 8.0))[200].state;
    let inward = turning.accel_x_m_per_s2 - centred.accel_x_m_per_s2;
    let expected = -0.05 * turning.gyro_z_rad_per_s * turning.gyro_z_rad_per_s;
    assert!(
        (inward / expected - 1.0).abs() < 0.02,
        "towards the turning centre: {inward}, {expected}"
    );
}

#[test]
fn steering() {
    let command = car_command(6.0, 0.1);
    let plain = end(car("rwd"), &[], command).pose.yaw_rad;
    assert!(
        end(car("rwd"), &one("steering_offset", "offset", 0.05), command)
            .pose
            .yaw_rad
            > plain
    );
    assert!(
        end(car("rwd"), &one("steering_scale", "scale", 1.3), command)
            .pose
            .yaw_rad
            > plain
    );
    assert!(
        end(car("rwd"), &one("steering_lag", "time_constant", 0.3), command)
            .pose
            .yaw_rad
            < plain
    );
    assert!(
        end(car("rwd"), &one("steering_backlash", "play", 0.05), command)
            .pose
            .yaw_rad
            < plain
    );
}

#[test]
fn sensors() {
    let command = both(6.0, 8.0);
    let plain = drive(diff2(), &[], command);
    let seen = |effects: &[Effect]| drive(diff2(), effects, command)[200].state;
    let (now, before) = (plain[200].state, plain[194].state);
    let late = seen(&one("localization_latency", "latency", 0.05));
    assert!((late.pose.x_m - before.pose.x_m).abs() < 1e-12 && late.gyro_z_rad_per_s == now.gyro_z_rad_per_s);
    let clock = seen(&one("clock_offset", "offset", 0.05));
    assert!((clock.wheel_rad[0] - before.wheel_rad[0]).abs() < 1e-12 && clock.pose == now.pose);
    assert!((seen(&one("gyro_bias", "bias", 0.1)).gyro_z_rad_per_s - now.gyro_z_rad_per_s - 0.1).abs() < 1e-12);
    assert!((seen(&one("gyro_scale", "relative", 0.1)).gyro_z_rad_per_s / now.gyro_z_rad_per_s - 1.1).abs() < 1e-12);
    assert!((seen(&one("pose_scale", "relative", 0.1)).pose.x_m / now.pose.x_m - 1.1).abs() < 1e-12);
    assert!(seen(&one("lens_distortion", "k1", 0.01)).pose.x_m > now.pose.x_m);
    assert!((seen(&one("marker_offset", "yaw", 0.1)).pose.yaw_rad - now.pose.yaw_rad - 0.1).abs() < 1e-12);
    let moved = drive(diff2(), &one("marker_offset", "x", 0.03), WheelCommand::default())[0]
        .state
        .pose;
    assert!(
        (moved.x_m - 0.03).abs() < 1e-12,
        "the marker is ahead of the body origin"
    );
    assert!((seen(&one("current_sensor", "bias", 0.2)).current_a[0] - now.current_a[0] - 0.2).abs() < 1e-12);
    let encoder = [Effect::new("encoder_scale", &[("relative", 0.1)]).at(0)];
    let spun = seen(&encoder);
    assert!(
        (spun.wheel_rad_per_s[0] - now.wheel_rad_per_s[0]).abs() < 0.01,
        "the loop holds what the encoder says"
    );
    assert!(spun.pose.yaw_rad > now.pose.yaw_rad, "so the left wheel is slower");
    let imu = seen(&one("imu_yaw", "yaw", 0.2));
    assert!(
        imu.accel_x_m_per_s2 > now.accel_x_m_per_s2,
        "part of the leftward push shows along x"
    );
    assert!(seen(&one("tag_height", "z", 0.2)).pose.y_m > now.pose.y_m);
    assert!((seen(&one("camera_seam", "x", 0.02)).pose.x_m - now.pose.x_m - 0.02).abs() < 1e-12);
}
