//! Where a calibration begins: on which curve of the tyres and with which delay. Where these are far from the described ones, slopes there do not lead to them.

use super::Floor;
use crate::hypothesis::{Knob, TreadKnob, realised};
use crate::linear::Square;
use crate::screen::all_residuals;
use crate::workers::{Cancelled, Workers};

/// Curves to begin from: values of the knobs of slip scale, creep, tail and sliding.
const CURVES: [[f64; 4]; 6] = [
    [0.0, 2.5, 0.0, 0.0],
    [2.0, 0.0, 0.0, 0.0],
    [2.0, 2.5, 0.0, 1.0],
    [2.0, 2.5, 3.0, 1.0],
    [2.0, 2.5, 3.0, 3.0],
    [2.0, 5.0, 2.0, 1.0],
];
/// Friction of the floor to begin from besides the described one, practical sizes: how far tyres slide and how hard they hold are told by the same few
/// moments, and slopes do not lead from one way to explain these to another.
const FRICTIONS: [f64; 2] = [-2.0, 2.0];
/// Energy on the references from which such a change of the friction is worth a start.
const SHOWN: f64 = 25.0;
/// Delays of commands to begin from, practical sizes.
const DELAYS: [f64; 6] = [0.0, 0.25, 0.5, 1.0, 2.0, 4.0];
/// Times that knobs are turned from each curve.
const TURNS: usize = 2;
/// Precision of what is not to move.
const HELD: f64 = 1e12;

/// A calibration of the references.
#[derive(Debug, Clone)]
struct Likely {
    surprise: f64,
    values: Vec<f64>,
    residuals: Vec<Vec<f64>>,
}

impl Floor {
    /// How tyres creep and slide, in words.
    pub fn tyres(&self) -> Option<String> {
        let tread = self.model.description.tread?;
        let source = match (self.references.is_empty(), self.is_of_runs) {
            (true, _) => "training runs",
            (false, true) => "references and runs",
            (false, false) => "references",
        };
        Some(format!(
            "tyres as calibrated on the {source}: slip scale {:.1} mm/s, creep {:.3}, sliding friction {:.2} of grip",
            1e3 * tread.slip_scale_m_per_s,
            tread.creep,
            tread.sliding
        ))
    }

    /// Goes to the curve, and then to the delay, with which the references surprise least, all other knobs turned as their slopes say.
    pub(super) fn choose_start(&mut self, workers: &dyn Workers) -> Result<(), Cancelled> {
        let known: Vec<f64> = self.prior.iter().map(|prior| prior.mean).collect();
        let mut best: Option<Likely> = None;
        let known_curve: Vec<f64> = self.tread().map(|k| known[k]).collect();
        let curves = core::iter::once(known_curve).chain(CURVES.map(Vec::from));
        let frictions = self.frictions();
        for curve in curves {
            let held: Vec<(usize, f64)> = self.tread().zip(curve).collect();
            best = likelier(best, self.turned(workers, &known, &held, None)?);
            for friction in &frictions {
                best = likelier(best, self.turned(workers, &known, &held, Some(*friction))?);
            }
        }
        // Delays are held against what they hide: a wheel that is late for ramps looks like a poor sensor, and then does not ask for its delay.
        let delay = self.knobs.iter().position(Knob::is_delay);
        if let (Some(found), Some(delay)) = (best.clone(), delay) {
            let curve: Vec<(usize, f64)> = self.tread().map(|k| (k, found.values[k])).collect();
            for value in DELAYS {
                let held = [&curve[..], &[(delay, value)]].concat();
                best = likelier(best, self.turned(workers, &known, &held, None)?);
            }
        }
        if let Some(best) = best {
            self.model = realised(&self.given, &self.knobs, &best.values);
            (self.values, self.residuals) = (best.values, best.residuals);
        }
        Ok(())
    }

    /// The knob of the floor's friction and where it may begin, as far as the references feel it.
    fn frictions(&self) -> Vec<(usize, f64)> {
        let Some(friction) = self.knobs.iter().position(Knob::is_friction) else {
            return Vec::new();
        };
        let energy = |reference: usize| -> f64 {
            let weighting = self
                .yardstick
                .robust_weighting(&self.references[reference], &self.residuals[reference]);
            let column = weighting.turned(&self.sensitivities[friction][reference]);
            let pairs = weighting.weights.iter().zip(&column);
            pairs.map(|(weight, value)| weight * value * value).sum()
        };
        let energy: f64 = (0..self.references.len()).map(energy).sum();
        let starts = FRICTIONS.iter().filter(|start| energy * *start * *start > SHOWN);
        starts.map(|start| (friction, *start)).collect()
    }

    /// Knobs of the tread.
    fn tread(&self) -> impl Iterator<Item = usize> + '_ {
        TreadKnob::ALL
            .into_iter()
            .filter_map(|own| self.knobs.iter().position(|knob| *knob == Knob::Tread(own)))
    }

    /// From values, all knobs but those held turned as their slopes say.
    ///
    /// - `first`: a knob and where it is until the others have been turned once.
    fn turned(
        &self,
        workers: &dyn Workers,
        from: &[f64],
        held: &[(usize, f64)],
        first: Option<(usize, f64)>,
    ) -> Result<Option<Likely>, Cancelled> {
        let hold = |values: &[f64], knobs: &[Knob], held: &[(usize, f64)]| -> Vec<f64> {
            let mut values: Vec<f64> = values
                .iter()
                .zip(knobs)
                .map(|(value, knob)| knob.possible(*value))
                .collect();
            held.iter().for_each(|(knob, value)| values[*knob] = *value);
            values
        };
        let held_first: Vec<(usize, f64)> = held.iter().copied().chain(first).collect();
        let mut values = hold(from, &self.knobs, &held_first);
        let Some(mut residuals) = self.simulated(workers, &values)? else {
            return Ok(None);
        };
        let mut best = None;
        for turn in 0..TURNS {
            let held = if turn == 0 { &held_first[..] } else { held };
            let step = self.step(&residuals, &values, held, 0.0);
            let moved: Vec<f64> = values.iter().zip(&step).map(|(value, step)| value + step).collect();
            values = hold(&moved, &self.knobs, held);
            let Some(simulated) = self.simulated(workers, &values)? else {
                break;
            };
            residuals = simulated;
            let likely = Likely {
                surprise: self.surprise(&residuals, &values),
                values: values.clone(),
                residuals: residuals.clone(),
            };
            best = likelier(best, Some(likely));
        }
        Ok(best)
    }

    fn simulated(&self, workers: &dyn Workers, values: &[f64]) -> Result<Option<Vec<Vec<f64>>>, Cancelled> {
        let model = realised(&self.given, &self.knobs, values);
        Ok(all_residuals(workers, &self.references, &model)?.into_iter().collect())
    }

    /// How far the slopes say that the knobs are to be turned, but for those held.
    ///
    /// - `damping`: share of the diagonal that is added to it (Marquardt 1963).
    pub(super) fn step(&self, residuals: &[Vec<f64>], values: &[f64], held: &[(usize, f64)], damping: f64) -> Vec<f64> {
        let count = self.knobs.len();
        let mut system = Square::zero(count);
        let priors = values.iter().zip(&self.prior);
        let mut score: Vec<f64> = priors
            .map(|(value, prior)| prior.precision * (prior.mean - value))
            .collect();
        for (reference, residual) in residuals.iter().enumerate() {
            let weighting = self.yardstick.robust_weighting(&self.references[reference], residual);
            let (gram, own) = self.moments_with(reference, &weighting, residual);
            for (sum, more) in system.values.iter_mut().zip(&gram.values) {
                *sum += more;
            }
            for (sum, more) in score.iter_mut().zip(&own) {
                *sum += more;
            }
        }
        for k in 0..count {
            let is_held = held.iter().any(|(knob, _)| *knob == k);
            let prior = self.prior[k].precision;
            system.add(k, k, if is_held { HELD } else { prior });
            system.add(k, k, damping * system.at(k, k));
        }
        system.cholesky().solve(&score)
    }
}

/// The less surprising one.
fn likelier(one: Option<Likely>, other: Option<Likely>) -> Option<Likely> {
    match (one, other) {
        (Some(one), Some(other)) => Some(if other.surprise < one.surprise { other } else { one }),
        (one, other) => one.or(other),
    }
}
