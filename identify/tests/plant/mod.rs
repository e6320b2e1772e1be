//! Runs of another plant: the emulator's body with firmware, sensors and faults of its own, as bundles.
#![allow(dead_code)]

pub mod replayed;

use emulator::hidden::{FrictionPatch, HiddenFloor, HiddenRobot, RunVariation};
use emulator::noise::Noise;
use emulator::plant::body::{Body, Drive, Ground, Push};
use emulator::plant::contents::PlantContents;
use emulator::plant::{Pose, SUBSTEPS, Step, TICK_HZ};
use identify::bundle::Bundle;
use identify::diagnose::{Input, Run};
use std::collections::VecDeque;
use std::fmt::Write;
use twin::golden::reference_robot;
use twin::robot::{Robot, RobotDescription};
use twin::twist::BodyTwist;

/// What is changed, beyond every robot's own errors.
#[derive(Debug, Clone, Default)]
pub struct Change {
    pub hidden: HiddenRobot,
    pub floor: HiddenFloor,
    pub delay_s: f64,
    pub latency_s: f64,
    pub dead_band_rad_per_s: f64,
    pub wheel_limit_rad_per_s: f64,
    pub lag_s: f64,
    pub slew_m_per_s2: f64,
    pub gyro_scale: f64,
    pub marker_yaw_rad: f64,
    pub steering_offset_rad: f64,
    pub pose_scale: f64,
    /// Every piece begins with a gentle ramp.
    pub is_smooth: bool,
}

impl Change {
    pub fn none() -> Change {
        Change {
            wheel_limit_rad_per_s: f64::INFINITY,
            slew_m_per_s2: f64::INFINITY,
            gyro_scale: 1.0,
            pose_scale: 1.0,
            ..Change::default()
        }
    }
}

/// A reference robot with sensors.
pub fn robot(chassis: &str) -> RobotDescription {
    let mut description = reference_robot(chassis);
    description.noise = serde_json::from_str(
        r#"{"pose_xy_m":0.001,"pose_yaw_rad":0.003,"wheel_rad_per_s":0.05,"current_a":0.03,"gyro_rad_per_s":0.006,
            "accel_m_per_s2":0.05,"bus_v":0.03,"steering_rad":0.002}"#,
    )
    .ok();
    description
}

/// Errors below the practical sizes, other for every seed.
pub fn background(seed: u64, wheels: usize, driven: usize) -> Change {
    let mut noise = Noise::new(seed, 99);
    let mut near = |size: f64| size * (2.0 * noise.uniform() - 1.0);
    let mut change = Change::none();
    let h = &mut change.hidden;
    h.mass_scale = 1.0 + near(0.05);
    h.yaw_inertia_scale = 1.0 + near(0.05);
    h.com_x_m = near(0.002);
    h.com_y_m = near(0.002);
    let radius = near(0.002);
    h.wheel_radius_scale = (0..wheels).map(|_| 1.0 + radius + near(0.0008)).collect();
    h.wheel_direction_error_rad = (0..wheels).map(|_| near(0.003)).collect();
    h.torque_constant_scale = (0..driven).map(|_| 1.0 + near(0.015)).collect();
    h.coulomb_scale = 1.0 + near(0.5);
    h.cogging_n_m = 0.0003;
    h.half_backlash_rad = 0.001;
    h.battery_resistance_ohm = 0.02;
    h.gyro_bias_rad_per_s = near(0.0015);
    change.floor.friction_scale = 1.0 + near(0.05);
    change.delay_s = 0.004;
    change.latency_s = 0.002;
    change
}

/// A robot with errors of its own below what matters.
pub fn healthy(description: &RobotDescription) -> Change {
    let driven = description.wheels.iter().filter(|wheel| wheel.driven).count();
    background(5, description.wheels.len(), driven)
}

/// Runs to be diagnosed beside references, none kept back by hand.
pub fn input(references: Vec<Run>, runs: Vec<Run>) -> Input {
    Input {
        references,
        runs,
        locked: Vec::new(),
        model: None,
        seed: 1,
    }
}

/// Adds a named change to a robot's own errors. Sizes as the effect library's parameters.
pub fn with_effect(base: &Change, name: &str, size: f64, robot: &RobotDescription) -> Change {
    let mut c = base.clone();
    let motor = robot.motor.as_ref();
    match name {
        "none" => {}
        "wheel_radius" => c
            .hidden
            .wheel_radius_scale
            .iter_mut()
            .for_each(|scale| *scale *= 1.0 + size),
        "wheel_radius_one" => {
            let driven = robot.wheels.iter().position(|wheel| wheel.driven).unwrap_or(0);
            c.hidden.wheel_radius_scale[driven] *= 1.0 + size;
        }
        "floor_friction" => c.floor.friction_scale *= size,
        "low_friction_patch" => c.floor.patches.push(FrictionPatch {
            x_m: 0.3,
            y_m: -0.2,
            radius_m: 0.45,
            friction_scale: size,
        }),
        "payload" => {
            let scale = (robot.mass_kg * c.hidden.mass_scale + size) / (robot.mass_kg * c.hidden.mass_scale);
            c.hidden.mass_scale *= scale;
        }
        "coulomb_friction" => c.hidden.coulomb_scale += size / motor.map_or(1.0, |motor| motor.coulomb_n_m),
        "command_delay" => c.delay_s += size,
        "localization_latency" => c.latency_s += size,
        "wheel_speed_saturation" => c.wheel_limit_rad_per_s = size,
        "command_dead_band" => c.dead_band_rad_per_s = size,
        "motor_lag" => c.lag_s = size,
        "acceleration_limit" => c.slew_m_per_s2 = size,
        "gyro_bias" => c.hidden.gyro_bias_rad_per_s += size,
        "gyro_scale" => c.gyro_scale = 1.0 + size,
        "marker_offset" => c.marker_yaw_rad = size,
        "floor_tilt" => c.floor.slope[0] -= size,
        "rolling_resistance" => c.floor.rolling_resistance += size,
        "weak_motor" => c.hidden.torque_constant_scale[0] *= size,
        "center_of_mass_offset" => c.hidden.com_x_m += size,
        "wheel_misalignment" => {
            let driven = robot.wheels.iter().position(|wheel| wheel.driven).unwrap_or(0);
            c.hidden.wheel_direction_error_rad[driven] += size;
        }
        "gear_backlash" => c.hidden.half_backlash_rad += 0.5 * size,
        "battery_sag" => c.hidden.battery_resistance_ohm += size,
        "steering_offset" => c.steering_offset_rad = size,
        "pose_scale" => c.pose_scale = 1.0 + size,
        other => panic!("the plant has no {other}"),
    }
    c
}

/// Wheel set-points in 1 s pieces that stay on the floor, and some slow ones.
fn plan(robot: &Robot, noise: &mut Noise, seconds: usize) -> Vec<BodyTwist> {
    let omni = robot.chassis() == "omni4";
    let car = robot.description().steering.is_some();
    let mut at = [0.0_f64; 3];
    let mut out = Vec::new();
    for piece in 0..seconds {
        if piece < 1 || piece % 9 == 8 {
            out.push(BodyTwist::default());
            continue;
        }
        let mut best: Option<(f64, BodyTwist, [f64; 3])> = None;
        for _ in 0..12 {
            let slow = if noise.uniform() < 0.25 { 0.1 } else { 1.0 };
            let mut any = |size: f64| slow * size * (2.0 * noise.uniform() - 1.0);
            let mut twist = BodyTwist {
                forward_m_per_s: any(0.9),
                left_m_per_s: if omni { any(0.7) } else { 0.0 },
                yaw_rate_rad_per_s: any(2.0),
            };
            if car {
                twist.yaw_rate_rad_per_s = twist.forward_m_per_s * any(1.4) / slow;
            }
            let mut end = at;
            for _ in 0..20 {
                let (s, c) = libm::sincos(end[2]);
                end[0] += 0.05 * (c * twist.forward_m_per_s - s * twist.left_m_per_s);
                end[1] += 0.05 * (s * twist.forward_m_per_s + c * twist.left_m_per_s);
                end[2] += 0.05 * twist.yaw_rate_rad_per_s;
            }
            let out_m = (end[0].abs() - 1.4).max(end[1].abs() - 1.1).max(0.0);
            if best.as_ref().is_none_or(|b| out_m < b.0) {
                best = Some((out_m, twist, end));
            }
            if out_m == 0.0 {
                break;
            }
        }
        if let Some((_, twist, end)) = best {
            out.push(twist);
            at = end;
        }
    }
    out
}

/// One run of the plant.
pub fn run(
    path: &str,
    description: &RobotDescription,
    change: &Change,
    seed: u64,
    seconds: usize,
    reference: bool,
) -> Run {
    let mut noise = Noise::new(seed, 1);
    let variation = RunVariation {
        friction: 0.02,
        mass: 0.003,
        torque_constant: 0.004,
        battery_charge: 0.08,
    };
    let text = serde_json::to_string(description).unwrap_or_default();
    let Ok(own) = serde_json::from_str(&text) else {
        panic!("description")
    };
    let mut body = match Body::new(&own, 0.25, &change.hidden, &variation, &mut noise) {
        Ok(body) => body,
        Err(error) => panic!("{error}"),
    };
    let yaw = 6.0 * noise.uniform();
    body.place(Pose {
        x_m: 0.0,
        y_m: 0.0,
        yaw_rad: yaw,
    });
    let robot = match Robot::new(description.clone()) {
        Ok(robot) => robot,
        Err(problem) => panic!("{problem}"),
    };
    let twists = plan(&robot, &mut noise, seconds);
    let driven: Vec<usize> = (0..description.wheels.len())
        .filter(|k| description.wheels[*k].driven)
        .collect();
    let csv = record(&mut body, &robot, &twists, &driven, change, &mut noise);
    let json = format!(
        "{{\"format\":\"robopheus.run/1\",\"robot\":{text},\"floor\":\"hall\",\"label\":\"random\",\"started\":\"2026-01-01T00:00:00Z\",\"change_free_reference\":{reference}}}"
    );
    match Bundle::parse(&json, csv.as_bytes()) {
        Ok(bundle) => Run {
            path: path.to_owned(),
            sha256: format!("{seed:064x}"),
            bundle,
        },
        Err(error) => panic!("{error}"),
    }
}

fn record(
    body: &mut Body,
    robot: &Robot,
    twists: &[BodyTwist],
    driven: &[usize],
    change: &Change,
    noise: &mut Noise,
) -> String {
    let description = robot.description();
    let Some(motor) = &description.motor else {
        panic!("motor")
    };
    let sigma = description.noise.clone().unwrap_or_default();
    let steered = description.steering.is_some();
    let mut csv = "time_s".to_owned();
    for k in driven {
        let _ = write!(
            csv,
            ",command_wheel_{k}_rad_per_s,wheel_{k}_rad_per_s,wheel_{k}_rad,current_{k}_a"
        );
    }
    if steered {
        csv.push_str(",command_steering_rad,steering_rad");
    }
    csv.push_str(",bus_v,gyro_z_rad_per_s,accel_x_m_per_s2,accel_y_m_per_s2,pose_x_m,pose_y_m,pose_yaw_rad\n");
    let contents = PlantContents::default();
    let step = Step {
        dt_s: 1.0 / f64::from(TICK_HZ * SUBSTEPS),
    };
    let period = 1.0 / f64::from(TICK_HZ);
    let mut integral = [0.0; 6];
    let mut lagged = [0.0; 6];
    let mut slewed = [0.0; 6];
    let mut sent: VecDeque<([f64; 6], f64)> = VecDeque::new();
    let mut seen: VecDeque<Pose> = VecDeque::new();
    let delay = (change.delay_s * f64::from(TICK_HZ)).round() as usize;
    let latency = (change.latency_s * f64::from(TICK_HZ)).round() as usize;
    let mut accel = [0.0; 2];
    let mut steering = 0.0;
    let mut twist = BodyTwist::default();
    for tick in 0..twists.len() as u32 * TICK_HZ {
        let piece = (tick / TICK_HZ) as usize;
        // Every fourth piece begins with a step, the others with a ramp.
        let rate = match (change.is_smooth, piece % 4) {
            (true, _) => 0.5 * period,
            (false, 2) => 1e3,
            (false, _) => 2.0 * period,
        };
        let toward = |now: f64, goal: f64, most: f64| now + (goal - now).clamp(-most, most);
        let goal = twists[piece];
        twist.forward_m_per_s = toward(twist.forward_m_per_s, goal.forward_m_per_s, rate);
        twist.left_m_per_s = toward(twist.left_m_per_s, goal.left_m_per_s, rate);
        twist.yaw_rate_rad_per_s = toward(twist.yaw_rate_rad_per_s, goal.yaw_rate_rad_per_s, 5.0 * rate);
        let command = robot.wheel_speeds_holding(twist, steering);
        steering = command.steering_rad;
        let mut wheels = [0.0; 6];
        for (m, k) in driven.iter().enumerate() {
            wheels[m] = command.wheel_rad_per_s[*k];
        }
        sent.push_back((wheels, steering));
        while sent.len() > delay + 1 {
            sent.pop_front();
        }
        let (mut wanted, steer) = sent[0];
        let mut voltage = [0.0; robot_motors()];
        let states: Vec<_> = body.driven_wheels().copied().collect();
        let bus = body.battery.bus_v();
        for m in 0..driven.len() {
            let w = &mut wanted[m];
            if w.abs() < change.dead_band_rad_per_s {
                *w = 0.0;
            }
            *w = w.clamp(-change.wheel_limit_rad_per_s, change.wheel_limit_rad_per_s);
            if change.slew_m_per_s2.is_finite() {
                let most = change.slew_m_per_s2 * period / description.wheels[driven[m]].radius_m.unwrap_or(0.05);
                slewed[m] += (*w - slewed[m]).clamp(-most, most);
                *w = slewed[m];
            }
            if change.lag_s > 0.0 {
                lagged[m] += (1.0 - libm::exp(-period / change.lag_s)) * (*w - lagged[m]);
                *w = lagged[m];
            }
            let error = *w - states[m].motor.speed_rad_per_s;
            let ki = motor.speed_loop_ki_v_per_rad;
            integral[m] = (integral[m] + error * period).clamp(-bus / ki, bus / ki);
            voltage[m] = (motor.speed_loop_kp_v_s_per_rad * error + ki * integral[m]).clamp(-bus, bus);
        }
        if tick % 4 == 0 || tick % 5 == 0 {
            let _ = write!(csv, "{:.6}", f64::from(tick) * period);
            let board = tick % 5 == 0;
            let mut n = |s: Option<f64>| s.unwrap_or(0.0) * noise.normal();
            for m in 0..driven.len() {
                if tick % 4 == 0 {
                    let _ = write!(csv, ",{:.5}", wheels[m]);
                } else {
                    csv.push(',');
                }
                if board {
                    let state = &states[m];
                    let _ = write!(
                        csv,
                        ",{:.4},{:.4},{:.4}",
                        state.motor.speed_rad_per_s + n(sigma.wheel_rad_per_s),
                        state.motor.angle_rad,
                        state.motor.current_a + n(sigma.current_a)
                    );
                } else {
                    csv.push_str(",,,");
                }
            }
            if steered {
                let _ = if tick % 4 == 0 {
                    write!(csv, ",{steering:.5}")
                } else {
                    write!(csv, ",")
                };
                let _ = if board {
                    write!(
                        csv,
                        ",{:.5}",
                        body.steering_rad() - change.steering_offset_rad + n(sigma.steering_rad)
                    )
                } else {
                    write!(csv, ",")
                };
            }
            if board {
                let _ = write!(
                    csv,
                    ",{:.3},{:.5},{:.4},{:.4}",
                    bus + n(sigma.bus_v),
                    body.yaw_rate_rad_per_s() * change.gyro_scale
                        + change.hidden.gyro_bias_rad_per_s
                        + n(sigma.gyro_rad_per_s),
                    accel[0] + n(sigma.accel_m_per_s2),
                    accel[1] + n(sigma.accel_m_per_s2)
                );
            } else {
                csv.push_str(",,,,");
            }
            if tick % 4 == 0 {
                let pose = seen.front().copied().unwrap_or_else(|| body.pose());
                let yaw = twin::pose::wrapped_rad(pose.yaw_rad + change.marker_yaw_rad + n(sigma.pose_yaw_rad));
                let _ = write!(
                    csv,
                    ",{:.5},{:.5},{yaw:.5}",
                    change.pose_scale * pose.x_m + n(sigma.pose_xy_m),
                    change.pose_scale * pose.y_m + n(sigma.pose_xy_m)
                );
            } else {
                csv.push_str(",,,");
            }
            csv.push('\n');
        }
        let drive = Drive {
            motor_v: Some(voltage),
            steering_rad: steer + change.steering_offset_rad,
            stuck_wheel: None,
        };
        for _ in 0..SUBSTEPS {
            let ground = Ground {
                floor: &change.floor,
                contents: &contents,
            };
            body.step(&drive, &ground, &Push::default(), step);
        }
        let force = body.specific_force_m_per_s2();
        for axis in 0..2 {
            accel[axis] += 0.3 * (force[axis] - accel[axis]);
        }
        seen.push_back(body.pose());
        while seen.len() > latency + 1 {
            seen.pop_front();
        }
    }
    csv
}

const fn robot_motors() -> usize {
    4
}
