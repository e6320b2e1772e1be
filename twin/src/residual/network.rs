//! A checked network, laid out for evaluation: fixed order, no allocation.

use super::document::{Activation, Layer, ResidualDocument};
use super::input::Observation;
use super::source::Source;
use super::{AXES, MAX_UNITS, OUTPUTS, SHIFTS, check};
use crate::parameter::ParameterError;
use crate::robot::RobotDescription;

/// A residual that fits a robot.
#[derive(Debug, Clone)]
pub struct Residual {
    document: ResidualDocument,
    inputs: Vec<Source>,
    layers: Vec<Dense>,
    /// By position in [`OUTPUTS`], then [`SHIFTS`]: row of the last layer, scale, limit.
    outputs: [Option<(usize, f64, f64)>; AXES],
}

#[derive(Debug, Clone)]
struct Dense {
    /// Column by column: all units take the same input at once, each sum still grows in the order of the inputs.
    by_input: Vec<f64>,
    bias: Vec<f64>,
    activation: Activation,
}

impl Residual {
    /// Checks a document against a robot.
    ///
    /// - Errors: the first thing that is wrong, by its path from `residual`: format, inputs the robot does not have or
    ///   that are named twice, numbers out of range, shapes that do not fit, too many layers or units.
    pub fn new(robot: &RobotDescription, document: &ResidualDocument) -> Result<Residual, ParameterError> {
        check::check(robot, document)?;
        let inputs = document
            .inputs
            .iter()
            .filter_map(|input| Source::new(document, input))
            .collect();
        let mut outputs = [None; AXES];
        for (slot, (name, _, _)) in outputs.iter_mut().zip(OUTPUTS.iter().chain(&SHIFTS)) {
            let row = document.outputs.iter().position(|output| output.name == *name);
            *slot = row.map(|row| (row, document.outputs[row].scale, document.outputs[row].limit));
        }
        Ok(Residual {
            document: document.clone(),
            inputs,
            layers: document.layers.iter().map(Dense::new).collect(),
            outputs,
        })
    }

    /// The document it was made from.
    pub fn document(&self) -> &ResidualDocument {
        &self.document
    }

    /// The accelerations among [`Residual::outputs`].
    pub fn accelerations(&self, inputs: &[f64]) -> [f64; OUTPUTS.len()] {
        let [forward, left, yaw, ..] = self.outputs(inputs);
        [forward, left, yaw]
    }

    /// Accelerations in the order of [`OUTPUTS`], m/s^2, m/s^2, rad/s^2, then [`SHIFTS`], m/s, m/s, rad/s; 0 for an output that
    /// the document does not have.
    ///
    /// - `inputs`: by position in the document, in their units; missing ones count as 0. Always finite.
    pub fn outputs(&self, inputs: &[f64]) -> [f64; AXES] {
        let mut units = [0.0; MAX_UNITS];
        let mut fade = 1.0;
        for ((unit, source), value) in units.iter_mut().zip(&self.inputs).zip(padded(inputs)) {
            *unit = source.normalised(value);
            fade *= source.fade(value);
        }
        let mut width = self.inputs.len();
        for layer in &self.layers {
            layer.apply(&mut units, width);
            width = layer.bias.len();
        }
        self.outputs.map(|output| {
            output.map_or(0.0, |(row, scale, limit)| {
                fade * (scale * units[row]).max(-limit).min(limit)
            })
        })
    }

    /// Values of the inputs at one tick, in their units, in the document's order; inputs of an earlier tick as they are now.
    pub fn values<'a>(&'a self, seen: &'a Observation) -> impl Iterator<Item = f64> + 'a {
        self.inputs.iter().map(|source| source.value(seen))
    }

    /// Outputs that are in force between ticks: without set-points the accelerations alone.
    fn held(&self) -> usize {
        let shifts = self.outputs.iter().skip(OUTPUTS.len());
        if shifts.flatten().next().is_some() {
            AXES
        } else {
            OUTPUTS.len()
        }
    }

    /// The set-points in force, in the memory of [`Residual::tick`].
    pub(crate) fn shift(&self, memory: &[f64]) -> [f64; SHIFTS.len()] {
        core::array::from_fn(|axis| {
            let at = OUTPUTS.len() + axis;
            if at < self.held() { memory[at] } else { 0.0 }
        })
    }

    /// Numbers kept between ticks: outputs in force, then for each input that looks back its values, oldest first.
    pub(crate) fn words(&self) -> usize {
        self.held() + self.inputs.iter().map(Source::ticks_ago).sum::<usize>()
    }

    /// One control tick: takes in what is seen now and leaves the outputs of this tick in front of `memory`.
    pub(crate) fn tick(&self, seen: &Observation, memory: &mut [f64], first: bool) {
        let (held, mut past) = memory.split_at_mut(self.held());
        let mut inputs = [0.0; MAX_UNITS];
        for ((input, source), now) in inputs.iter_mut().zip(&self.inputs).zip(self.values(seen)) {
            *input = now;
            let ticks_ago = source.ticks_ago();
            if ticks_ago == 0 {
                continue;
            }
            let (own, rest) = past.split_at_mut(ticks_ago);
            past = rest;
            if first {
                own.fill(now);
            }
            *input = own[0];
            own.copy_within(1.., 0);
            own[ticks_ago - 1] = now;
        }
        let outputs = self.outputs(&inputs[..self.inputs.len()]);
        held.copy_from_slice(&outputs[..held.len()]);
    }
}

fn padded(inputs: &[f64]) -> impl Iterator<Item = f64> + '_ {
    inputs.iter().copied().chain(core::iter::repeat(0.0))
}

impl Dense {
    fn new(layer: &Layer) -> Dense {
        let units = layer.bias.len();
        let columns = layer.weights.len() / units.max(1);
        let by_input = (0..columns)
            .flat_map(|column| (0..units).map(move |unit| layer.weights[unit * columns + column]))
            .collect();
        Dense {
            by_input,
            bias: layer.bias.clone(),
            activation: layer.activation,
        }
    }

    fn apply(&self, units: &mut [f64], width: usize) {
        let mut sums = [0.0; MAX_UNITS];
        let sums = &mut sums[..self.bias.len()];
        sums.copy_from_slice(&self.bias);
        for (x, column) in units[..width].iter().zip(self.by_input.chunks_exact(sums.len())) {
            for (sum, weight) in sums.iter_mut().zip(column) {
                *sum += weight * x;
            }
        }
        for (unit, sum) in units.iter_mut().zip(sums.iter()) {
            *unit = self.activation.of(*sum);
        }
    }
}
