//! The residual that a run begins with when the parent has none, and the one that it ends with.

use super::law::{Law, Seen};
use twin::GRAVITY_M_PER_S2;
use twin::residual::{Activation, INPUTS, Input, Layer, OUTPUTS, Of, Output, ResidualDocument};
use twin::robot::RobotDescription;

/// Look back of the set-points, control ticks: 0.05 s.
const AGO: usize = 6;
/// Name, ticks ago, size that counts as 1, bound far beyond what robots do.
const SEEN: [(&str, usize, f64, f64); 15] = [
    ("forward_m_per_s", 0, 0.5, 20.0),
    ("left_m_per_s", 0, 0.5, 20.0),
    ("yaw_rate_rad_per_s", 0, 1.0, 100.0),
    ("yaw_rate_times_forward_m_per_s2", 0, 0.5, 200.0),
    ("yaw_rate_times_left_m_per_s2", 0, 0.5, 200.0),
    ("command_forward_m_per_s", 0, 0.5, 20.0),
    ("command_left_m_per_s", 0, 0.5, 20.0),
    ("command_yaw_rate_rad_per_s", 0, 1.0, 100.0),
    ("command_forward_m_per_s", AGO, 0.5, 20.0),
    ("command_left_m_per_s", AGO, 0.5, 20.0),
    ("command_yaw_rate_rad_per_s", AGO, 1.0, 100.0),
    ("heading_cos", 0, 1.0, 2.0),
    ("heading_sin", 0, 1.0, 2.0),
    ("steering_rad", 0, 0.3, 10.0),
    ("command_steering_rad", 0, 0.3, 10.0),
];
/// Acceleration per unit of an output: m/s^2, m/s^2, rad/s^2.
const SCALES: [f64; 3] = [1.0, 1.0, 5.0];
/// Outputs stay below this share of what the grip gives.
const GRIP_SHARE: f64 = 0.6;
/// Width of the fade and room beyond the data, as shares of the range.
const FADE: f64 = 0.25;
const ROOM: f64 = 0.05;
/// An input whose range is less than this share of its size is left out.
const DULL: f64 = 0.04;

/// A linear residual that gives nothing yet.
pub fn empty(robot: &RobotDescription) -> ResidualDocument {
    let mut inputs = Vec::new();
    for (name, ago, size, bound) in SEEN {
        let entry = INPUTS.iter().find(|entry| entry.name == name);
        let fits = entry.is_some_and(|entry| match entry.of {
            Of::Robot => true,
            Of::SteeredRobot => robot.steering.is_some(),
            _ => false,
        });
        if fits {
            inputs.push(Input::new(name, -bound, bound).ago(ago).normalised(0.0, size));
        }
    }
    let layer = Layer {
        weights: vec![0.0; SCALES.len() * inputs.len()],
        bias: vec![0.0; SCALES.len()],
        activation: Activation::Linear,
    };
    let limits = limits(robot);
    let outputs = OUTPUTS.iter().zip(SCALES).zip(limits);
    let outputs = outputs.map(|(((name, _, _), scale), limit)| Output {
        name: (*name).to_owned(),
        scale,
        limit,
    });
    ResidualDocument::new(inputs, FADE, vec![layer], outputs.collect())
}

/// Bounds of the outputs: what the floor's grip can bring about.
fn limits(robot: &RobotDescription) -> [f64; 3] {
    let grip_m_per_s2 = GRIP_SHARE * robot.floor_friction * GRAVITY_M_PER_S2;
    let arm_m = robot
        .wheels
        .iter()
        .map(|wheel| (wheel.x_m * wheel.x_m + wheel.y_m * wheel.y_m).sqrt())
        .fold(0.05, f64::max);
    let turn_rad_per_s2 = grip_m_per_s2 * robot.mass_kg * arm_m / robot.yaw_inertia_kg_m2;
    let [forward, left, turn] = OUTPUTS.map(|(_, _, largest)| largest);
    let bounded = |value: f64, largest: f64| value.max(0.1).min(largest);
    [
        bounded(grip_m_per_s2, forward),
        bounded(grip_m_per_s2, left),
        bounded(turn_rad_per_s2, turn),
    ]
}

/// What the inputs were in the spans that were learned from.
#[derive(Debug, Clone, Default)]
pub struct Ranges {
    /// Low, high, sum, by position in the document.
    inputs: Vec<[f64; 3]>,
    ticks: f64,
}

impl Ranges {
    pub fn take(&mut self, seen: &Seen) {
        self.inputs
            .resize(seen.inputs.len(), [f64::INFINITY, f64::NEG_INFINITY, 0.0]);
        for ([low, high, sum], value) in self.inputs.iter_mut().zip(&seen.inputs) {
            *low = low.min(*value);
            *high = high.max(*value);
            *sum += value;
        }
        self.ticks += 1.0;
    }
}

/// A document with learned weights. Where all layers are new (`fresh`) the validity is what the run held, and inputs that hardly varied
/// go into the bias; otherwise the parent's validity stays.
///
/// - Returns `None` when nothing varied.
pub fn settled(
    document: &ResidualDocument,
    law: &Law,
    weights: &[f64],
    ranges: &Ranges,
    fresh: bool,
) -> Option<ResidualDocument> {
    let mut settled = document.clone();
    let mut last = law.last_layer(weights);
    if fresh {
        let width = document.inputs.len();
        let mut kept = vec![true; width];
        for (place, [low, high, sum]) in ranges.inputs.iter().enumerate() {
            let input = &mut settled.inputs[place];
            let mean = sum / ranges.ticks.max(1.0);
            kept[place] = high - low >= DULL * input.scale;
            if !kept[place] {
                for (bias, row) in last.bias.iter_mut().zip(last.weights.chunks_exact(width)) {
                    *bias += row[place] * (mean - input.mean) / input.scale;
                }
            }
            let room = ROOM * (high - low);
            (input.low, input.high) = (low - room, high + room);
        }
        let mut keep = kept.iter().copied().cycle();
        last.weights.retain(|_| keep.next().unwrap_or(true));
        let mut keep = kept.iter().copied();
        settled.inputs.retain(|_| keep.next().unwrap_or(true));
        if ranges.inputs.is_empty() || settled.inputs.is_empty() {
            return None;
        }
    }
    *settled.layers.last_mut()? = last;
    Some(settled)
}
