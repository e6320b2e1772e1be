//! The residual as it stands in a model document.

use serde::{Deserialize, Serialize};

use super::FORMAT;

/// A network with its inputs, outputs and validity region; checked when a robot is made with it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ResidualDocument {
    /// `robopheus.residual/1`.
    pub format: String,
    pub inputs: Vec<Input>,
    /// Width of the zone in which the outputs fade out, as a share of each input's range.
    pub fade: f64,
    /// From the inputs to the outputs.
    pub layers: Vec<Layer>,
    /// One per row of the last layer.
    pub outputs: Vec<Output>,
}

/// One quantity that the network sees.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Input {
    /// A name of [`super::INPUTS`].
    pub name: String,
    /// Position in the robot's `wheels`, for quantities of one wheel.
    #[serde(default)]
    pub wheel: Option<usize>,
    /// How many control ticks ago; before the first tick the first value stands for all earlier ones.
    #[serde(default)]
    pub ticks_ago: usize,
    /// Normalisation, in the quantity's unit: (value - mean) / scale.
    pub mean: f64,
    pub scale: f64,
    /// Validity range, in the quantity's unit.
    pub low: f64,
    pub high: f64,
}

/// A dense layer: activation(bias + weights x).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Layer {
    /// Row by row, one row per unit of this layer.
    pub weights: Vec<f64>,
    /// One per unit.
    pub bias: Vec<f64>,
    pub activation: Activation,
}

/// What a unit does with its sum.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Activation {
    Linear,
    Tanh,
    /// x / (1 + |x|)
    Softsign,
}

impl Activation {
    /// Its value for a sum.
    pub fn of(self, sum: f64) -> f64 {
        match self {
            Self::Linear => sum,
            Self::Tanh => crate::math::tanh(sum),
            Self::Softsign => sum / (1.0 + sum.abs()),
        }
    }
}

/// One acceleration in the body frame, at the centre of mass.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Output {
    /// A name of [`super::OUTPUTS`].
    pub name: String,
    /// Acceleration per unit of the network's output, in the output's unit.
    pub scale: f64,
    /// Bound on the magnitude, in the output's unit.
    pub limit: f64,
}

impl ResidualDocument {
    /// A document of this format.
    pub fn new(inputs: Vec<Input>, fade: f64, layers: Vec<Layer>, outputs: Vec<Output>) -> ResidualDocument {
        ResidualDocument {
            format: FORMAT.to_owned(),
            inputs,
            fade,
            layers,
            outputs,
        }
    }

    /// True when no input can give an acceleration: the last layer or every output's scale is zero.
    pub fn is_neutral(&self) -> bool {
        let silent = self.layers.last().is_some_and(|last| {
            let mut numbers = last.weights.iter().chain(&last.bias);
            numbers.all(|number| *number == 0.0)
        });
        silent || self.outputs.iter().all(|output| output.scale == 0.0)
    }
}

impl Input {
    /// A quantity of the robot now, with mean 0 and scale 1.
    pub fn new(name: &str, low: f64, high: f64) -> Input {
        Input {
            name: name.to_owned(),
            wheel: None,
            ticks_ago: 0,
            mean: 0.0,
            scale: 1.0,
            low,
            high,
        }
    }

    /// The same of one wheel.
    pub fn at(mut self, wheel: usize) -> Input {
        self.wheel = Some(wheel);
        self
    }

    /// The same some control ticks ago.
    pub fn ago(mut self, ticks: usize) -> Input {
        self.ticks_ago = ticks;
        self
    }

    /// The same with another normalisation.
    pub fn normalised(mut self, mean: f64, scale: f64) -> Input {
        (self.mean, self.scale) = (mean, scale);
        self
    }
}
