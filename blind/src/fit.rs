//! Which parameters of the library describe best what the plant does, by the twin; and which effects are one name on a run.

use crate::drive::Trace;
use crate::effects::Truth;
use crate::oracle::{CHANNELS, Pair, sigmas};
use crate::sensing::{Sensing, Values};
use emulator::plant::TICK_HZ;
use twin::effect::library::find;
use twin::free::Start;
use twin::replay::{CommandRow, HeldCommand, replay_from};
use twin::reversals::Reversals;
use twin::robot::{Robot, RobotDescription};
use twin::twist::BodyTwist;

/// Effects whose law in the plant is not the library's: their truth is a fit.
const FITTED: &[(&str, &[&str])] = &[
    ("coulomb_friction", &["torque"]),
    ("viscous_friction", &["coefficient"]),
    ("stribeck_friction", &["ratio", "speed", "ratio"]),
    ("asymmetric_friction", &["difference"]),
    ("battery_sag", &["resistance"]),
    ("longitudinal_slip", &["slip_ratio_at_full_force"]),
    ("lateral_slip", &["side_friction"]),
    ("floor_friction", &["scale"]),
    ("low_friction_patch", &["scale"]),
    ("roller_drag", &["per_wheel"]),
    ("carpet_grain", &["force"]),
    ("rolling_resistance", &["coefficient"]),
    ("gear_backlash", &["play"]),
    ("steering_lag", &["time_constant"]),
    ("caster_swivel", &["torque"]),
];

/// Length of the pieces that the twin is laid on.
const PIECE_S: f64 = 2.0;
/// Golden sections; each leaves 62 % of the range.
const SECTIONS: usize = 16;
const GOLDEN: f64 = 0.618_033_988_749_895;
/// Range of a fitted size, as factors of the drawn one.
const RANGE: (f64, f64) = (0.15, 4.0);

/// The library's best parameters for plant-with minus plant-without, by the twin; those drawn where the laws agree. And
/// the share of the change, in squares over the sensors' noise, that the twin explains with them.
pub fn best(robot: &RobotDescription, truth: &Truth, pair: &Pair<'_>) -> (Truth, f64) {
    let names = FITTED
        .iter()
        .find(|(name, _)| *name == truth.name)
        .map_or(&[] as &[&str], |(_, names)| names);
    let nominal = Twin::new(robot, &[]);
    let base = misfit(nominal.as_ref(), pair.without);
    let cost = |truth: &Truth| {
        let twin = Twin::new(robot, &[truth.effect()]);
        let (now, sigma) = (misfit(twin.as_ref(), pair.with), sigmas(robot));
        weighted_square(&now, &base, &sigma)
    };
    let mut best = truth.clone();
    for name in names {
        let Some(parameter) = find(&truth.name).and_then(|entry| entry.parameter(name)) else {
            continue;
        };
        // Ratios count from 1, everything else from nothing.
        let from = if parameter.neutral.is_finite() {
            parameter.neutral
        } else {
            0.0
        };
        let drawn = truth.value(name) - from;
        let at = |log: f64| {
            let mut other = best.clone();
            let value = (from + drawn * log.exp()).clamp(parameter.low, parameter.high);
            other.parameters.insert((*name).to_owned(), value);
            other
        };
        let (mut low, mut high) = (RANGE.0.ln(), RANGE.1.ln());
        let (mut a, mut b) = (high - GOLDEN * (high - low), low + GOLDEN * (high - low));
        let (mut at_a, mut at_b) = (cost(&at(a)), cost(&at(b)));
        for _ in 0..SECTIONS {
            if at_a < at_b {
                (high, b, at_b) = (b, a, at_a);
                a = high - GOLDEN * (high - low);
                at_a = cost(&at(a));
            } else {
                (low, a, at_a) = (a, b, at_b);
                b = low + GOLDEN * (high - low);
                at_b = cost(&at(b));
            }
        }
        best = at(0.5 * (low + high));
    }
    let none = weighted_square(&misfit(nominal.as_ref(), pair.with), &base, &sigmas(robot));
    let left = cost(&best);
    // Where the laws agree the drawn parameters are the truth, however the paths differ.
    let share = if names.is_empty() {
        1.0
    } else if none > 0.0 && left.is_finite() {
        1.0 - left / none
    } else {
        0.0
    };
    (best, (1e4 * share).round() / 1e4)
}

/// Cosine between what two effects change in the twin on a run, weighted by the sensors' noise.
pub fn cosine(robot: &RobotDescription, a: &Truth, b: &Truth, run: (&Trace, &Sensing)) -> f64 {
    let change = |truth: &Truth| {
        let with = misfit(Twin::new(robot, &[truth.effect()]).as_ref(), run);
        let without = misfit(Twin::new(robot, &[]).as_ref(), run);
        (with, without)
    };
    let ((a, base), (b, _), sigma) = (change(a), change(b), sigmas(robot));
    let (mut ab, mut aa, mut bb) = (0.0, 0.0, 0.0);
    for ((a, b), base) in a.iter().zip(&b).zip(&base) {
        let (da, db) = ((a.1 - base.1) / sigma[a.0], (b.1 - base.1) / sigma[a.0]);
        ab += da * db;
        aa += da * da;
        bb += db * db;
    }
    ab / (aa * bb).sqrt().max(1e-300)
}

fn weighted_square(now: &[(usize, f64)], base: &[(usize, f64)], sigma: &[f64; CHANNELS.len()]) -> f64 {
    if now.len() != base.len() {
        return f64::INFINITY;
    }
    now.iter()
        .zip(base)
        .map(|(a, b)| ((a.1 - b.1) / sigma[a.0]).powi(2))
        .sum()
}

/// A twin with effects; `None` when it cannot be.
struct Twin {
    robot: Robot,
}

impl Twin {
    fn new(robot: &RobotDescription, effects: &[twin::effect::Effect]) -> Option<Twin> {
        let robot = Robot::with_effects(robot.clone(), effects).ok()?;
        Some(Twin { robot })
    }
}

/// Twin minus plant by channel, piece after piece, each started from the plant's true state.
fn misfit(twin: Option<&Twin>, (trace, sensing): (&Trace, &Sensing)) -> Vec<(usize, f64)> {
    let mut out = Vec::new();
    let Some(twin) = twin else { return out };
    let robot = &twin.robot;
    let driven: Vec<usize> = (0..robot.wheel_count())
        .filter(|wheel| robot.description().wheels[*wheel].driven)
        .collect();
    let pieces = (trace.duration_s() / PIECE_S) as usize;
    let mut steered = Reversals::default();
    let mut seen = 0;
    for piece in 0..pieces {
        let from_s = piece as f64 * PIECE_S;
        let ticks = (from_s * f64::from(TICK_HZ)) as usize + 1;
        trace.ticks[seen..ticks]
            .iter()
            .for_each(|tick| steered.push(tick.steering_rad));
        seen = ticks;
        let rows = rows(trace, from_s, &driven);
        let mut held = HeldCommand::default();
        if let Some(first) = rows.first() {
            held.apply(robot, first);
        }
        let Ok(states) = replay_from(robot, &start(trace, from_s, &driven, steered), held, &rows) else {
            return Vec::new();
        };
        for state in states.iter().skip(6).step_by(6) {
            let plant = sensing.values(trace, state.time_s);
            compare(&state.state, &plant, &driven, &mut out);
        }
    }
    out
}

fn rows(trace: &Trace, from_s: f64, driven: &[usize]) -> Vec<CommandRow> {
    let rate = f64::from(crate::drive::SET_POINTS_HZ);
    let first = (from_s * rate).round() as usize;
    let count = (PIECE_S * rate) as usize;
    let sent = trace.sent.iter().enumerate().skip(first).take(count);
    sent.map(|(index, sent)| {
        let mut row = CommandRow {
            time_s: index as f64 / rate,
            steering_rad: Some(sent.steering_rad),
            ..CommandRow::default()
        };
        for (m, wheel) in driven.iter().enumerate() {
            row.wheel_rad_per_s[*wheel] = Some(sent.wheel_rad_per_s[m]);
        }
        row
    })
    .collect()
}

fn start(trace: &Trace, from_s: f64, driven: &[usize], steering_history: Reversals) -> Start {
    let values = trace.at(from_s);
    let [x_m, y_m, yaw_rad] = values.pose;
    let (sin, cos) = yaw_rad.sin_cos();
    let [vx, vy] = values.velocity_m_per_s;
    let mut start = Start {
        pose: twin::pose::Pose { x_m, y_m, yaw_rad },
        twist: BodyTwist {
            forward_m_per_s: cos * vx + sin * vy,
            left_m_per_s: cos * vy - sin * vx,
            yaw_rate_rad_per_s: values.gyro_rad_per_s,
        },
        steering_rad: values.steering_rad,
        steering_history,
        ..Start::default()
    };
    for (m, wheel) in driven.iter().enumerate() {
        start.wheel_rad_per_s[*wheel] = values.wheel_rad_per_s[m];
        start.current_a[*wheel] = values.current_a[m];
    }
    start
}

fn compare(twin: &twin::free::RobotState, plant: &Values, driven: &[usize], out: &mut Vec<(usize, f64)>) {
    let [x, y, yaw] = plant.pose;
    out.push((0, twin.pose.x_m - x));
    out.push((0, twin.pose.y_m - y));
    out.push((1, twin::pose::wrapped_rad(twin.pose.yaw_rad - yaw)));
    for (m, wheel) in driven.iter().enumerate() {
        out.push((2, twin.wheel_rad_per_s[*wheel] - plant.wheel_rad_per_s[m]));
        out.push((4, twin.current_a[*wheel] - plant.current_a[m]));
    }
    out.push((3, twin.steering_rad - plant.steering_rad));
    out.push((5, twin.bus_v - plant.bus_v));
    out.push((6, twin.gyro_z_rad_per_s - plant.gyro_rad_per_s));
    out.push((7, twin.accel_x_m_per_s2 - plant.accel_m_per_s2[0]));
    out.push((7, twin.accel_y_m_per_s2 - plant.accel_m_per_s2[1]));
}
