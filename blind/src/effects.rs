//! The library's effects in the plant: which sizes a set draws, and what they change.

use crate::change::Change;
use crate::firmware::Firmware;
use crate::forces::Cable;
use crate::sensing::Sensing;
use emulator::hidden::FrictionPatch;
use emulator::noise::Noise;
use emulator::plant::TICK_HZ;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use twin::effect::library::{EffectEntry, LIBRARY, Needs, find};
use twin::robot::RobotDescription;

/// An effect with the library's names.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Truth {
    pub name: String,
    pub index: Option<usize>,
    /// As drawn, then as the best fit of the twin where the plant's law is another.
    pub parameters: BTreeMap<String, f64>,
}

impl Truth {
    pub fn value(&self, parameter: &str) -> f64 {
        self.parameters.get(parameter).copied().unwrap_or_else(|| {
            let entry = find(&self.name).and_then(|entry| entry.parameter(parameter));
            entry.map_or(0.0, |entry| entry.neutral)
        })
    }

    /// As the twin takes it.
    pub fn effect(&self) -> twin::effect::Effect {
        let values: Vec<(&str, f64)> = self
            .parameters
            .iter()
            .map(|(name, value)| (name.as_str(), *value))
            .collect();
        let effect = twin::effect::Effect::new(&self.name, &values);
        match self.index {
            Some(index) => effect.at(index),
            None => effect,
        }
    }
}

/// Effects that a chassis can have, in the library's order.
pub fn applicable(robot: &RobotDescription) -> Vec<&'static EffectEntry> {
    let kind = |kind: &str| robot.wheels.iter().any(|wheel| wheel.kind == kind);
    LIBRARY
        .iter()
        .filter(|entry| match entry.needs {
            Needs::Nothing => true,
            Needs::Motor => robot.motor.is_some(),
            Needs::Steering => robot.steering.is_some(),
            Needs::OmniWheel => kind("omni"),
            Needs::StandardWheel => kind("standard"),
            Needs::Caster => kind("caster"),
        })
        .collect()
}

/// Effects that scale a friction which the reference robot hardly has.
pub fn wants_stiff_gears(name: &str) -> bool {
    matches!(name, "stribeck_friction" | "asymmetric_friction")
}

/// Draws an effect between practical and large, log-uniform in its distance from neutral.
pub fn draw(name: &str, robot: &RobotDescription, noise: &mut Noise) -> Truth {
    let entry = find(name).unwrap_or(&LIBRARY[0]);
    let share = noise.uniform();
    let mut parameters = BTreeMap::new();
    for parameter in entry.parameters {
        let (practical, large) = parameter.size.values(robot);
        let value = if practical == large {
            practical
        } else {
            let from = |end: f64| {
                if parameter.neutral.is_finite() {
                    end - parameter.neutral
                } else {
                    end
                }
            };
            let size = from(practical) * (from(large) / from(practical)).powf(share);
            if parameter.neutral.is_finite() {
                parameter.neutral + size
            } else {
                size
            }
        };
        parameters.insert(parameter.name.to_owned(), value);
    }
    let mut truth = Truth {
        name: name.to_owned(),
        index: entry.indexed.then(|| wheel(name, robot, noise)),
        parameters,
    };
    place(&mut truth, robot, noise);
    truth
}

fn wheel(name: &str, robot: &RobotDescription, noise: &mut Noise) -> usize {
    let fits = |index: &usize| {
        let wheel = &robot.wheels[*index];
        wheel.kind != "caster" && (wheel.driven || name == "wheel_misalignment")
    };
    let wheels: Vec<usize> = (0..robot.wheels.len()).filter(fits).collect();
    wheels[((noise.uniform() * wheels.len() as f64) as usize).min(wheels.len() - 1)]
}

/// Signs, directions and places.
fn place(truth: &mut Truth, robot: &RobotDescription, noise: &mut Noise) {
    let sign = if noise.uniform() < 0.5 { -1.0 } else { 1.0 };
    let turn = std::f64::consts::TAU * noise.uniform();
    let (a, b) = (noise.uniform(), noise.uniform());
    let before = truth.parameters.clone();
    let old = |name: &str| before.get(name).copied().unwrap_or(0.0);
    let Truth { name, parameters, .. } = truth;
    let mut set = |name: &str, value: f64| {
        parameters.insert(name.to_owned(), value);
    };
    match name.as_str() {
        "wheel_radius" | "wheel_radius_one" | "track_width" | "gyro_scale" | "pose_scale" | "encoder_scale" => {
            set("relative", sign * old("relative"));
        }
        "wheel_misalignment" => set("toe", sign * old("toe")),
        "steering_offset" => set("offset", sign * old("offset")),
        "steering_scale" if sign < 0.0 => set("scale", 1.0 / old("scale")),
        "gyro_bias" => set("bias", sign * old("bias")),
        "lens_distortion" => set("k1", sign * old("k1")),
        "rolling_shutter" => set("readout", sign * old("readout")),
        "imu_yaw" => set("yaw", sign * old("yaw")),
        "asymmetric_friction" => set("difference", sign * old("difference")),
        "clock_offset" => set("offset", sign * old("offset")),
        "current_sensor" => {
            set("bias", sign * old("bias"));
            set("relative", old("relative") * if a < 0.5 { -1.0 } else { 1.0 });
        }
        "marker_offset" => {
            set("yaw", sign * old("yaw"));
            set("y", old("x") * turn.sin());
            set("x", old("x") * turn.cos());
        }
        "center_of_mass_offset" | "floor_tilt" | "camera_seam" => {
            set("y", old("x") * turn.sin());
            set("x", old("x") * turn.cos());
        }
        "low_friction_patch" => {
            set("x", 1.4 * (a - 0.5));
            set("y", 1.0 * (b - 0.5));
            set("radius", 0.25 + 0.35 * noise.uniform());
        }
        "wheel_eccentricity" => set("phase", turn - std::f64::consts::PI),
        "carpet_grain" => set("direction", 0.5 * turn),
        "cable_drag" => {
            set("x", 2.0 * turn.cos());
            set("y", 1.5 * turn.sin());
            set("slack", 0.2 + 0.6 * a);
        }
        "thermal_drift" => set("time_constant", 8.0 + 30.0 * a),
        "stribeck_friction" => set("speed", 1.0 + 3.0 * a),
        "caster_swivel" => set("trail", 0.015 + 0.015 * a),
        "command_delay" => {
            let ticks = (old("delay") * f64::from(TICK_HZ)).round();
            set("delay", ticks / f64::from(TICK_HZ));
        }
        "body_speed_saturation" if !robot.wheels.iter().any(|wheel| wheel.kind == "omni") => {
            parameters.remove("left");
        }
        _ => {}
    }
}

/// Changes the plant, the firmware or the sensors by an effect.
pub fn apply(change: &mut Change, truth: &Truth, robot: &RobotDescription) {
    command(&mut change.firmware, truth, motor_of(truth, robot));
    sense(&mut change.sensing, truth);
    wear(change, truth, robot);
}

/// Position among the driven wheels of an effect's wheel.
fn motor_of(truth: &Truth, robot: &RobotDescription) -> usize {
    let before = robot.wheels.iter().take(truth.index.unwrap_or(0));
    before.filter(|wheel| wheel.driven).count()
}

/// Robot, floor and forces.
fn wear(change: &mut Change, truth: &Truth, robot: &RobotDescription) {
    let value = |name: &str| truth.value(name);
    let (wheel, motor) = (truth.index.unwrap_or(0), motor_of(truth, robot));
    let mass_kg = robot.mass_kg * change.hidden.mass_scale;
    let h = &mut change.hidden;
    match truth.name.as_str() {
        "coulomb_friction" => h.wear.coulomb_n_m += value("torque"),
        "viscous_friction" => h.wear.viscous_n_m_s += value("coefficient"),
        "stribeck_friction" => {
            h.wear.breakaway_ratio = value("ratio");
            h.wear.breakaway_rad_per_s = value("speed");
        }
        "asymmetric_friction" => h.wear.friction_asymmetry = value("difference"),
        "battery_sag" => h.battery_resistance_ohm += value("resistance"),
        "battery_droop" => change.droop_v_per_s += value("rate"),
        "wheel_radius" => h
            .wheel_radius_scale
            .iter_mut()
            .for_each(|scale| *scale *= 1.0 + value("relative")),
        "wheel_radius_one" => h.wheel_radius_scale[wheel] *= 1.0 + value("relative"),
        "track_width" => h.wear.track_scale *= 1.0 + value("relative"),
        "longitudinal_slip" => h.wear.slip_ratio_at_full_force = value("slip_ratio_at_full_force"),
        "lateral_slip" => h.wear.side_friction_scale = value("side_friction") / robot.floor_friction,
        "floor_friction" => change.floor.friction_scale *= value("scale"),
        "low_friction_patch" => change.floor.patches.push(FrictionPatch {
            x_m: value("x"),
            y_m: value("y"),
            radius_m: value("radius"),
            friction_scale: value("scale"),
        }),
        "payload" => {
            h.mass_scale *= 1.0 + value("mass") / mass_kg;
            h.yaw_inertia_scale += value("inertia") / robot.yaw_inertia_kg_m2;
        }
        "center_of_mass_offset" => {
            h.com_x_m += value("x");
            h.com_y_m += value("y");
        }
        "floor_tilt" => {
            change.floor.slope[0] -= value("x");
            change.floor.slope[1] -= value("y");
        }
        "wheel_misalignment" => h.wheel_direction_error_rad[wheel] += value("toe"),
        "steering_offset" => h.wear.steering_offset_rad += value("offset"),
        "steering_scale" => h.wear.steering_scale *= value("scale"),
        "steering_lag" => h.wear.steering_lag_s += value("time_constant"),
        // The plant's play is to each side.
        "steering_backlash" => h.steering_play_rad += 0.5 * value("play"),
        "gear_backlash" => h.half_backlash_rad += 0.5 * value("play"),
        "roller_drag" => h.wear.roller_viscous_n_s_per_m += value("per_wheel"),
        "wheel_eccentricity" => h.wear.run_out[wheel] = [value("amplitude"), value("phase")],
        "weak_motor" => h.torque_constant_scale[motor] *= value("gain"),
        "thermal_drift" => (h.wear.heating, h.wear.heating_s) = (value("relative"), value("time_constant")),
        "rolling_resistance" => change.floor.rolling_resistance += value("coefficient"),
        "caster_swivel" => (h.wear.swivel_n_m, h.wear.swivel_trail_m) = (value("torque"), value("trail")),
        "carpet_grain" => change.forces.grain = Some((value("force"), value("direction"))),
        "cable_drag" => {
            change.forces.cable = Some(Cable {
                stiffness_n_per_m: value("stiffness"),
                anchor_m: [value("x"), value("y")],
                slack_m: value("slack"),
            });
        }
        _ => {}
    }
}

/// Set-points and encoders.
fn command(f: &mut Firmware, truth: &Truth, motor: usize) {
    let value = |name: &str| truth.value(name);
    match truth.name.as_str() {
        "command_dead_band" => f.dead_band_rad_per_s = value("width"),
        "wheel_speed_saturation" => f.wheel_limit_rad_per_s = value("limit"),
        "body_speed_saturation" => f.body_limit = [value("forward"), value("left"), value("yaw_rate")],
        "acceleration_limit" => f.slew_m_per_s2 = value("limit"),
        "motor_lag" => f.lag_s = value("time_constant"),
        "command_delay" => f.delay_ticks += (value("delay") * f64::from(TICK_HZ)).round() as usize,
        "command_hold" => (f.loss_rate, f.loss_burst_s) = (value("loss_rate"), value("burst")),
        "encoder_scale" => f.encoder_scale[motor] *= 1.0 + value("relative"),
        _ => {}
    }
}

/// Sensors and clocks.
fn sense(s: &mut Sensing, truth: &Truth) {
    let value = |name: &str| truth.value(name);
    match truth.name.as_str() {
        "localization_latency" => s.latency_s += value("latency"),
        "rolling_shutter" => s.readout_s += value("readout"),
        "clock_offset" => s.clock_offset_s += value("offset"),
        "gyro_bias" => s.gyro_bias_rad_per_s += value("bias"),
        "gyro_scale" => s.gyro_scale *= 1.0 + value("relative"),
        "imu_yaw" => s.imu_yaw_rad += value("yaw"),
        "current_sensor" => {
            s.current_scale *= 1.0 + value("relative");
            s.current_bias_a += value("bias");
        }
        "marker_offset" => {
            for (axis, name) in ["yaw", "x", "y"].into_iter().enumerate() {
                s.marker[axis] += value(name);
            }
        }
        "tag_height" => s.tag_height_m += value("z"),
        "lens_distortion" => s.lens_per_m2 += value("k1"),
        "pose_scale" => s.pose_scale *= 1.0 + value("relative"),
        "camera_seam" => {
            for (axis, name) in ["x", "y", "yaw"].into_iter().enumerate() {
                s.seam[axis] += value(name);
            }
        }
        _ => {}
    }
}
