//! A residual split at its last layer: features that stay, weights that are learned.

use super::OnlineError;
use std::collections::VecDeque;
use twin::residual::{Activation, Layer, MAX_TICKS_AGO, OUTPUTS, Observation, ResidualDocument, Source};

/// Axes of an acceleration: forward, left, yaw.
pub const AXES: usize = OUTPUTS.len();

/// See the module. Weights are row by row, the bias of a row first.
#[derive(Debug, Clone)]
pub struct Law {
    sources: Vec<Source>,
    hidden: Vec<Layer>,
    outputs: Vec<Output>,
    /// Of one row: the bias and one per unit of the last hidden layer.
    features: usize,
}

#[derive(Debug, Clone, Copy)]
struct Output {
    axis: usize,
    scale: f64,
    limit: f64,
}

/// What the law sees at one tick: features of a row, bias first, and how far inside the validity region.
#[derive(Debug, Clone, PartialEq)]
pub struct Seen {
    pub features: Vec<f64>,
    pub fade: f64,
    /// The inputs in their units, by position in the document.
    pub inputs: Vec<f64>,
}

/// Inputs of the ticks before, newest last.
#[derive(Debug, Clone, Default)]
pub struct Past(VecDeque<Vec<f64>>);

impl Law {
    /// Splits a residual that has been checked against its robot; the second part are the weights that it has.
    ///
    /// - Errors: [`OnlineError::NotLinear`], [`OnlineError::Model`] when it was not checked.
    pub fn new(document: &ResidualDocument) -> Result<(Law, Vec<f64>), OnlineError> {
        let unknown = |name: &str| OnlineError::Model(format!("there is nothing called {name:?}"));
        let mut sources = Vec::with_capacity(document.inputs.len());
        for input in &document.inputs {
            sources.push(Source::new(document, input).ok_or_else(|| unknown(&input.name))?);
        }
        let Some((last, hidden)) = document.layers.split_last() else {
            return Err(OnlineError::Model("the residual has no layer".to_owned()));
        };
        if last.activation != Activation::Linear {
            return Err(OnlineError::NotLinear);
        }
        let mut outputs = Vec::with_capacity(document.outputs.len());
        for output in &document.outputs {
            let axis = OUTPUTS.iter().position(|(name, _, _)| *name == output.name);
            outputs.push(Output {
                axis: axis.ok_or_else(|| unknown(&output.name))?,
                scale: output.scale,
                limit: output.limit,
            });
        }
        let width = hidden.last().map_or(sources.len(), |layer| layer.bias.len());
        let rows = last.weights.chunks_exact(width.max(1)).zip(&last.bias);
        let weights = rows.flat_map(|(row, bias)| std::iter::once(*bias).chain(row.iter().copied()));
        let law = Law {
            sources,
            hidden: hidden.to_vec(),
            outputs,
            features: width + 1,
        };
        Ok((law, weights.collect()))
    }

    /// Features of one row, the bias included.
    pub fn features(&self) -> usize {
        self.features
    }

    /// Weights there are.
    pub fn weights(&self) -> usize {
        self.features * self.outputs.len()
    }

    /// Of each row of weights: its axis, and the acceleration per unit.
    pub fn rows(&self) -> impl Iterator<Item = (usize, f64)> + '_ {
        self.outputs.iter().map(|output| (output.axis, output.scale))
    }

    /// The last layer with these weights.
    pub fn last_layer(&self, weights: &[f64]) -> Layer {
        let rows = weights.chunks_exact(self.features);
        Layer {
            bias: rows.clone().filter_map(|row| row.first().copied()).collect(),
            weights: rows.flat_map(|row| row.iter().skip(1).copied()).collect(),
            activation: Activation::Linear,
        }
    }

    /// Looks at one control tick.
    pub fn see(&self, observation: &Observation, past: &mut Past) -> Seen {
        let now: Vec<f64> = self.sources.iter().map(|source| source.value(observation)).collect();
        let mut fade = 1.0;
        let mut units = Vec::with_capacity(self.features);
        let mut inputs = Vec::with_capacity(now.len());
        for (place, source) in self.sources.iter().enumerate() {
            let value = past.ago(source.ticks_ago(), &now)[place];
            inputs.push(value);
            units.push(source.normalised(value));
            fade *= source.fade(value);
        }
        past.push(now);
        for layer in &self.hidden {
            units = apply(layer, &units);
        }
        units.insert(0, 1.0);
        Seen {
            features: units,
            fade,
            inputs,
        }
    }

    /// Accelerations of the body, m/s^2, m/s^2, rad/s^2, as the twin evaluates the residual with these weights.
    pub fn accelerations(&self, weights: &[f64], seen: &Seen) -> [f64; AXES] {
        let mut out = [0.0; AXES];
        for (output, row) in self.outputs.iter().zip(weights.chunks_exact(self.features)) {
            // From the bias through the features in order.
            let sum: f64 = row
                .iter()
                .zip(&seen.features)
                .map(|(weight, feature)| weight * feature)
                .sum();
            out[output.axis] = seen.fade * (output.scale * sum).max(-output.limit).min(output.limit);
        }
        out
    }
}

impl Past {
    /// The inputs of a tick some ticks before `now`; the first one stands for all earlier ones.
    fn ago<'a>(&'a self, ticks: usize, now: &'a [f64]) -> &'a [f64] {
        match ticks {
            0 => now,
            ticks => {
                let place = self.0.len().saturating_sub(ticks);
                self.0.get(place).map_or(now, Vec::as_slice)
            }
        }
    }

    fn push(&mut self, now: Vec<f64>) {
        self.0.push_back(now);
        if self.0.len() > MAX_TICKS_AGO {
            self.0.pop_front();
        }
    }
}

fn apply(layer: &Layer, units: &[f64]) -> Vec<f64> {
    let rows = layer.weights.chunks_exact(units.len().max(1)).zip(&layer.bias);
    rows.map(|(row, bias)| {
        let sum = row
            .iter()
            .zip(units)
            .fold(*bias, |sum, (weight, unit)| sum + weight * unit);
        layer.activation.of(sum)
    })
    .collect()
}
