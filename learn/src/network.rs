//! A multi-layer perceptron in f64 with its gradient by hand.

use rand_pcg::Pcg64Mcg;
use rand_pcg::rand_core::{Rng, SeedableRng};
use twin::math;
use twin::residual::{Activation, Layer};

/// Dense layers, tanh between them, the last one linear; summed in the order in which the twin sums.
#[derive(Debug, Clone, PartialEq)]
pub struct Network {
    /// Width of the inputs, then of every layer.
    sizes: Vec<usize>,
    /// Layer by layer: weights row by row, then biases.
    parameters: Vec<f64>,
}

/// What a forward pass leaves for the backward pass.
#[derive(Debug, Clone, Default)]
pub struct Pass {
    /// Inputs and the outputs of every layer, one after the other.
    units: Vec<f64>,
}

impl Network {
    /// Weights uniform in +-sqrt(6 / (inputs + outputs)) of their layer (Glorot, Bengio 2010); those of the last layer and
    /// biases 0, so that it begins with nothing.
    ///
    /// - `sizes`: inputs first, outputs last; at least two, none zero.
    pub fn new(sizes: &[usize], seed: u64) -> Network {
        let mut random = Pcg64Mcg::seed_from_u64(seed);
        let mut parameters = Vec::new();
        for (position, pair) in sizes.windows(2).enumerate() {
            let (width, units) = (pair[0], pair[1]);
            let last = position + 2 == sizes.len();
            let reach = (6.0 / (width + units) as f64).sqrt() * if last { 0.0 } else { 1.0 };
            parameters.extend((0..width * units).map(|_| reach * (2.0 * uniform(&mut random) - 1.0)));
            parameters.extend(core::iter::repeat_n(0.0, units));
        }
        Network {
            sizes: sizes.to_vec(),
            parameters,
        }
    }

    /// Weights and biases, layer by layer.
    pub fn parameters(&self) -> &[f64] {
        &self.parameters
    }

    /// The same to be changed.
    pub fn parameters_mut(&mut self) -> &mut [f64] {
        &mut self.parameters
    }

    /// Widths, inputs first.
    pub fn sizes(&self) -> &[usize] {
        &self.sizes
    }

    /// Number of outputs.
    pub fn outputs(&self) -> usize {
        self.sizes.last().copied().unwrap_or(0)
    }

    /// Outputs of normalised inputs; `pass` keeps what [`Network::backward`] needs.
    pub fn forward<'a>(&self, inputs: &[f64], pass: &'a mut Pass) -> &'a [f64] {
        pass.units.clear();
        pass.units.extend_from_slice(inputs);
        let (mut at, mut before) = (0, 0);
        let layers = self.sizes.len() - 1;
        for (position, pair) in self.sizes.windows(2).enumerate() {
            let (width, units) = (pair[0], pair[1]);
            let (weights, rest) = self.parameters[at..].split_at(width * units);
            let bias = &rest[..units];
            let after = pass.units.len();
            for unit in 0..units {
                let row = &weights[unit * width..(unit + 1) * width];
                let mut sum = bias[unit];
                for (weight, x) in row.iter().zip(&pass.units[before..before + width]) {
                    sum += weight * x;
                }
                let value = if position + 1 == layers { sum } else { math::tanh(sum) };
                pass.units.push(value);
            }
            before = after;
            at += width * units + units;
        }
        &pass.units[before..]
    }

    /// Adds the gradient of a loss to `gradient`, given its gradient in the outputs of the last forward pass; returns that
    /// in the inputs.
    pub fn backward(&self, pass: &Pass, outputs: &[f64], gradient: &mut [f64]) -> Vec<f64> {
        let mut at = self.parameters.len();
        let mut end = pass.units.len();
        let layers = self.sizes.len() - 1;
        let mut slope = outputs.to_vec();
        for position in (0..layers).rev() {
            let (width, units) = (self.sizes[position], self.sizes[position + 1]);
            at -= width * units + units;
            let (mine, below) = (end - units, end - units - width);
            if position + 1 != layers {
                for (slope, y) in slope.iter_mut().zip(&pass.units[mine..end]) {
                    *slope *= 1.0 - y * y;
                }
            }
            let weights = &self.parameters[at..at + width * units];
            let (of_weights, of_bias) = gradient[at..at + width * units + units].split_at_mut(width * units);
            let mut through = vec![0.0; width];
            for unit in 0..units {
                let s = slope[unit];
                of_bias[unit] += s;
                let row = unit * width..(unit + 1) * width;
                for ((g, x), (t, w)) in of_weights[row.clone()]
                    .iter_mut()
                    .zip(&pass.units[below..mine])
                    .zip(through.iter_mut().zip(&weights[row]))
                {
                    *g += s * x;
                    *t += s * w;
                }
            }
            slope = through;
            end = mine;
        }
        slope
    }

    /// The weights a share of the way to another network of the same widths.
    pub fn towards(&self, other: &Network, share: f64) -> Network {
        let mut out = self.clone();
        for (parameter, end) in out.parameters.iter_mut().zip(&other.parameters) {
            *parameter += share * (end - *parameter);
        }
        out
    }

    /// As the layers of a residual document.
    pub fn layers(&self) -> Vec<Layer> {
        let mut at = 0;
        let count = self.sizes.len() - 1;
        let pairs = self.sizes.windows(2).enumerate();
        pairs
            .map(|(position, pair)| {
                let (weights, rest) = self.parameters[at..].split_at(pair[0] * pair[1]);
                at += pair[0] * pair[1] + pair[1];
                Layer {
                    weights: weights.to_vec(),
                    bias: rest[..pair[1]].to_vec(),
                    activation: if position + 1 == count {
                        Activation::Linear
                    } else {
                        Activation::Tanh
                    },
                }
            })
            .collect()
    }
}

/// Uniform in 0..1.
pub(crate) fn uniform(random: &mut Pcg64Mcg) -> f64 {
    (random.next_u64() >> 11) as f64 * (1.0 / 9_007_199_254_740_992.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_gradient_is_that_of_central_differences() {
        let mut network = Network::new(&[4, 7, 5, 3], 11);
        // Weights of the last layer as large as the others, biases not 0.
        for (k, parameter) in network.parameters_mut().iter_mut().enumerate() {
            *parameter += 0.3 * libm::sin(k as f64);
        }
        let inputs = [0.3, -1.2, 0.7, 2.0];
        let slopes = [0.9, -0.4, 1.7];
        let loss = |network: &Network, inputs: &[f64]| {
            let mut pass = Pass::default();
            let outputs = network.forward(inputs, &mut pass);
            outputs
                .iter()
                .zip(slopes)
                .map(|(y, s)| s * y + 0.5 * y * y)
                .sum::<f64>()
        };
        let mut pass = Pass::default();
        let outputs: Vec<f64> = network.forward(&inputs, &mut pass).to_vec();
        let of_outputs: Vec<f64> = outputs.iter().zip(slopes).map(|(y, s)| s + y).collect();
        let mut gradient = vec![0.0; network.parameters().len()];
        let of_inputs = network.backward(&pass, &of_outputs, &mut gradient);
        let step = 1e-5;
        for (k, expected) in gradient.iter().enumerate() {
            let mut moved = network.clone();
            moved.parameters_mut()[k] += step;
            let above = loss(&moved, &inputs);
            moved.parameters_mut()[k] -= 2.0 * step;
            let difference = (above - loss(&moved, &inputs)) / (2.0 * step);
            assert!((difference - expected).abs() < 1e-8, "{k}: {difference} {}", expected);
        }
        for k in 0..inputs.len() {
            let (mut up, mut down) = (inputs, inputs);
            up[k] += step;
            down[k] -= step;
            let difference = (loss(&network, &up) - loss(&network, &down)) / (2.0 * step);
            assert!((difference - of_inputs[k]).abs() < 1e-8);
        }
    }
}
