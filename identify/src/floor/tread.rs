//! The tyres' curve of references: where it is far from the nominal contact, slopes there do not lead to it.

use super::Floor;
use super::calibrate::PRIOR_PRECISION;
use super::metric::dot;
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
/// Energy that another curve must take off, beyond what four further numbers do by chance.
const LEAST_GAIN: f64 = 30.0;

impl Floor {
    /// How the references' tyres creep and slide, in words.
    pub fn tyres(&self) -> Option<String> {
        let tread = self.model.description.tread?;
        Some(format!(
            "tyres as calibrated on the references: slip scale {:.1} mm/s, creep {:.3}, sliding friction {:.2} of grip",
            1e3 * tread.slip_scale_m_per_s,
            tread.creep,
            tread.sliding
        ))
    }

    /// Goes to the curve with which the references agree best, all other knobs turned as their slopes say.
    pub(super) fn choose_tread(&mut self, workers: &dyn Workers) -> Result<(), Cancelled> {
        let system = self.system();
        let mut best = (
            self.energy_turned(&system, &self.residuals, &self.values).0 - LEAST_GAIN,
            None,
        );
        for curve in CURVES {
            let values = self.with_curve(&self.values, curve);
            let Some(residuals) = self.simulated(workers, &values)? else {
                continue;
            };
            let (energy, step) = self.energy_turned(&system, &residuals, &values);
            if energy < best.0 {
                let turned: Vec<f64> = values.iter().zip(&step).map(|(value, step)| value + step).collect();
                best = (energy, Some((curve, turned)));
            }
        }
        let Some((curve, turned)) = best.1 else { return Ok(()) };
        let possible = self
            .knobs
            .iter()
            .zip(turned)
            .map(|(knob, value)| knob.possible(value))
            .collect::<Vec<f64>>();
        let values = self.with_curve(&possible, curve);
        if let Some(residuals) = self.simulated(workers, &values)? {
            self.model = realised(&self.given, &self.knobs, &values);
            (self.values, self.residuals) = (values, residuals);
        }
        Ok(())
    }

    fn with_curve(&self, values: &[f64], curve: [f64; 4]) -> Vec<f64> {
        let number = |knob: &Knob| match knob {
            Knob::Tread(own) => TreadKnob::ALL
                .iter()
                .zip(curve)
                .find(|(knob, _)| *knob == own)
                .map(|(_, value)| value),
            _ => None,
        };
        let pairs = self.knobs.iter().zip(values);
        pairs.map(|(knob, value)| number(knob).unwrap_or(*value)).collect()
    }

    fn simulated(&self, workers: &dyn Workers, values: &[f64]) -> Result<Option<Vec<Vec<f64>>>, Cancelled> {
        let model = realised(&self.given, &self.knobs, values);
        Ok(all_residuals(workers, &self.references, &model)?.into_iter().collect())
    }

    /// S' W S of all references with the prior; knobs of the tread stay where they are.
    fn system(&self) -> Square {
        let count = self.knobs.len();
        let mut system = Square::zero(count);
        for reference in 0..self.references.len() {
            let (gram, _) = self.moments(reference);
            for (sum, more) in system.values.iter_mut().zip(&gram.values) {
                *sum += more;
            }
        }
        for (k, knob) in self.knobs.iter().enumerate() {
            let held = matches!(knob, Knob::Tread(_));
            system.add(k, k, if held { 1e12 } else { PRIOR_PRECISION });
        }
        system
    }

    /// Energy of the references and of the prior when all knobs are turned as the slopes say, and the turn.
    fn energy_turned(&self, system: &Square, residuals: &[Vec<f64>], values: &[f64]) -> (f64, Vec<f64>) {
        let mut score: Vec<f64> = values.iter().map(|value| -PRIOR_PRECISION * value).collect();
        let mut energy = PRIOR_PRECISION * dot(values, values);
        for (reference, residual) in residuals.iter().enumerate() {
            let weighting = self.noise.weighting(&self.references[reference]);
            let turned = weighting.turned(residual);
            let weighted: Vec<f64> = weighting.weights.iter().zip(&turned).map(|(w, r)| w * r).collect();
            energy += dot(&weighted, &turned);
            for (sum, knob) in score.iter_mut().zip(&self.sensitivities) {
                *sum += dot(&weighted, &weighting.turned(&knob[reference]));
            }
        }
        let step = system.cholesky().solve(&score);
        (energy - dot(&step, &score), step)
    }
}
