//! The nominal model on references, and what is left.

// Sums over rows and columns read better by their indices.
#![allow(clippy::needless_range_loop)]

use super::metric::{Metric, dot};
use super::modes::Weighting;
use super::noise::NoiseModel;
use super::otherwise::Prior;
use super::variation::{VARIATION_RUNS, prior_variation};
use crate::hypothesis::{Hypothesis, Knob, realised};
use crate::linear::Square;
use crate::record::{Record, Stages};
use crate::screen::{Change, all_residuals, columns};
use crate::workers::{Cancelled, Workers};

/// What a laboratory's description is off by, standard deviation in practical sizes: such errors are below the practical size. A wider prior
/// lets the calibration wander where references do not tell, as among the toes of four wheels, and its width hides what runs differ by.
const DESCRIPTION_SIGMA: f64 = 0.7;
/// The same of what no description tells: tyres, filters inside servos and sensors.
const UNTOLD_SIGMA: f64 = 1.5;
/// Without references: what a description that its laboratory has looked after is off by.
const WORD_SIGMA: f64 = 0.35;
/// The same of the tread.
const TREAD_SIGMA: f64 = 2.5;
/// Steps that are tried from one linearisation, and Marquardt's damping, as a share of the diagonal.
const MOST_TRIALS: usize = 8;
const LEAST_DAMPING: f64 = 0.01;
const MOST_DAMPING: f64 = 100.0;
/// Times that the sensitivities are taken anew at the calibrated model.
const LINEARISATIONS: usize = 2;
/// References that the first of them takes.
const FIRST_REFERENCES: usize = 4;
/// Factor on thresholds where variances are stated: the description's own errors are in the product already, and an effect of three practical
/// sizes gains no more than (3 / [`WORD_SIGMA`])^2 beside them.
const STATED_INFLATION: f64 = 2.5;
/// With fewer references none is left out: the others would say too little.
const FEWEST_LEFT_OUT: usize = 3;

/// The calibrated model with everything that is known about its errors.
#[derive(Debug, Clone)]
pub struct Floor {
    pub model: Hypothesis,
    /// The same without the calibration.
    pub given: Hypothesis,
    pub knobs: Vec<Knob>,
    /// Calibration, in practical sizes, with standard deviations.
    pub values: Vec<f64>,
    pub sigmas: Vec<f64>,
    pub noise: NoiseModel,
    /// The same before runs that are driven otherwise were heard.
    pub(super) noise_of_references: NoiseModel,
    /// The runs' noise is heard: they are driven otherwise than the references, or show what these do not.
    pub(super) is_otherwise: bool,
    /// Tyres and the floor's friction are those that the runs show as well.
    pub(super) is_of_runs: bool,
    /// Surprise of the references before tyres and floor were taken from the runs.
    pub(super) told: Option<f64>,
    /// What is known of the knobs before the calibration.
    pub(super) prior: Vec<Prior>,
    /// What a calibration measures residuals by: the stated noise, or what half of the cells exceeded before it.
    pub(super) yardstick: NoiseModel,
    /// Variances of the knobs from run to run.
    pub variation: Vec<f64>,
    /// Covariance of what the calibration left, a day's difference included.
    pub uncertainty: Square,
    pub references: Vec<Record>,
    /// Of the references under the calibrated model.
    pub residuals: Vec<Vec<f64>>,
    /// The same under a model calibrated on the others, to first order: what runs that nothing was calibrated on are held against.
    pub left_out: Vec<Vec<f64>>,
    /// Sensitivities of the knobs on the references, `[knob][reference]`.
    pub sensitivities: Vec<Vec<Vec<f64>>>,
    /// Effects beyond the knobs that the references have as well; part of the model.
    pub absorbed: Vec<twin::effect::Effect>,
}

/// What the description tells of a knob.
fn prior(knob: &Knob) -> Prior {
    let sigma = if knob.is_untold() {
        UNTOLD_SIGMA
    } else {
        DESCRIPTION_SIGMA
    };
    Prior {
        mean: 0.0,
        precision: 1.0 / (sigma * sigma),
    }
}

/// What a knob is off by without references. No description knows its tyres, and few the filters inside its servo and its sensors.
pub(super) fn word_sigma(knob: &Knob) -> f64 {
    if knob.is_untold() { TREAD_SIGMA } else { WORD_SIGMA }
}

/// Knobs as changes of a hypothesis.
///
/// - `values`: where the knobs of `base` stand.
pub fn knob_changes(base: &Hypothesis, knobs: &[Knob], values: &[f64], stages: &[Stages]) -> Vec<Change> {
    let triples = knobs.iter().zip(values).zip(stages);
    triples
        .map(|((knob, value), stages)| {
            let step = knob.step(*value);
            Change {
                hypothesis: knob.applied(base, step),
                added: 0,
                stages: *stages,
                step,
            }
        })
        .collect()
}

impl Floor {
    /// Without references.
    pub fn stated(given: Hypothesis, knobs: Vec<Knob>) -> Floor {
        let variation: Vec<f64> = knobs
            .iter()
            .map(|knob| prior_variation(knob, &given.description))
            .collect();
        let mut uncertainty = Square::zero(knobs.len());
        for (k, variance) in variation.iter().enumerate() {
            let word = word_sigma(&knobs[k]);
            uncertainty.set(k, k, variance + word * word);
        }
        Floor {
            noise: NoiseModel::prior(&given.description),
            noise_of_references: NoiseModel::prior(&given.description),
            is_otherwise: false,
            is_of_runs: false,
            told: None,
            prior: knobs.iter().map(prior).collect(),
            yardstick: NoiseModel::prior(&given.description),
            model: given.clone(),
            given,
            values: vec![0.0; knobs.len()],
            sigmas: knobs.iter().map(word_sigma).collect(),
            knobs,
            variation,
            uncertainty,
            references: Vec::new(),
            residuals: Vec::new(),
            left_out: Vec::new(),
            sensitivities: Vec::new(),
            absorbed: Vec::new(),
        }
    }

    /// From references.
    pub fn calibrated(
        workers: &dyn Workers,
        given: Hypothesis,
        knobs: Vec<Knob>,
        stages: &[Stages],
        references: Vec<Record>,
    ) -> Result<Floor, Cancelled> {
        Floor::calibrated_from(workers, given, knobs, stages, references, None)
    }

    /// The same, with something known of the knobs before.
    pub(super) fn calibrated_from(
        workers: &dyn Workers,
        given: Hypothesis,
        knobs: Vec<Knob>,
        stages: &[Stages],
        references: Vec<Record>,
        prior: Option<Vec<Prior>>,
    ) -> Result<Floor, Cancelled> {
        let mut floor = Floor::stated(given, knobs);
        if let Some(prior) = prior {
            floor = floor.turned_to(prior.iter().map(|prior| prior.mean).collect());
            floor.prior = prior;
        }
        let simulated = all_residuals(workers, &references, &floor.model)?;
        let pairs = references.into_iter().zip(simulated);
        let (references, start): (Vec<Record>, Vec<Vec<f64>>) =
            pairs.filter_map(|(record, residual)| Some((record, residual?))).unzip();
        if references.is_empty() {
            return Ok(floor);
        }
        floor.references = references;
        floor.residuals = start;
        let (others, their_residuals) = floor.split_off(FIRST_REFERENCES);
        for time in 0..LINEARISATIONS {
            if time == 1 {
                floor.references.extend(others.iter().cloned());
                let simulated = all_residuals(workers, &others, &floor.model)?.into_iter();
                let pairs = simulated.zip(&their_residuals);
                floor
                    .residuals
                    .extend(pairs.map(|(calibrated, given)| calibrated.unwrap_or_else(|| given.clone())));
            }
            let changes = knob_changes(&floor.model, &floor.knobs, &floor.values, stages);
            floor.sensitivities = columns(workers, &floor.references, &floor.residuals, &changes)?;
            floor.yardstick = NoiseModel::prior(&floor.given.description).at_least(&floor.references, &floor.residuals);
            if time == 0 {
                floor.choose_start(workers)?;
            }
            floor.fit(workers)?;
        }
        Ok(floor)
    }

    /// Sets aside all references but the first.
    fn split_off(&mut self, first: usize) -> (Vec<Record>, Vec<Vec<f64>>) {
        let kept = first.min(self.references.len());
        (self.references.split_off(kept), self.residuals.split_off(kept))
    }

    /// The references have some of the effect, and it is in the model.
    pub fn has_absorbed(&self, name: &str) -> bool {
        self.absorbed.iter().any(|effect| effect.name == name)
    }

    /// Takes an effect that the references have as well into the calibrated model.
    pub fn absorb(&mut self, effects: Vec<twin::effect::Effect>, residuals: Vec<Vec<f64>>) {
        self.model.effects.extend(effects.iter().cloned());
        self.absorbed.extend(effects);
        self.residuals = residuals;
        self.noise = NoiseModel::fitted(&self.given.description, &self.references, &self.residuals);
        self.estimate_variation();
        self.leave_out();
    }

    /// Product over records with the knobs' sensitivities `[knob][record]`.
    pub fn metric(&self, records: &[Record], sensitivities: &[Vec<Vec<f64>>]) -> Metric {
        let runs = (0..records.len())
            .map(|run| {
                let weighting = self.noise.weighting(&records[run]);
                let knobs = sensitivities.iter().map(|knob| knob[run].as_slice()).collect();
                (weighting, knobs)
            })
            .collect();
        Metric::new(runs, &self.variation, &self.uncertainty, self.noise.is_prior)
    }

    /// Some knobs elsewhere, and the others calibrated anew with them.
    pub(super) fn hold(
        &mut self,
        workers: &dyn Workers,
        stages: &[Stages],
        held: &[(usize, f64)],
    ) -> Result<(), Cancelled> {
        let mut values = self.values.clone();
        held.iter().for_each(|(k, value)| values[*k] = *value);
        let model = realised(&self.given, &self.knobs, &values);
        let simulated: Option<Vec<Vec<f64>>> = all_residuals(workers, &self.references, &model)?.into_iter().collect();
        let Some(residuals) = simulated else { return Ok(()) };
        (self.values, self.model, self.residuals) = (values, model, residuals);
        let changes = knob_changes(&self.model, &self.knobs, &self.values, stages);
        self.sensitivities = columns(workers, &self.references, &self.residuals, &changes)?;
        self.turn(workers, held)?;
        self.conclude();
        Ok(())
    }

    fn fit(&mut self, workers: &dyn Workers) -> Result<(), Cancelled> {
        self.turn(workers, &[])?;
        self.conclude();
        Ok(())
    }

    /// Turns the knobs but those held as long as the references become likelier.
    fn turn(&mut self, workers: &dyn Workers, held: &[(usize, f64)]) -> Result<(), Cancelled> {
        let mut damping = LEAST_DAMPING;
        let mut simulations = 0;
        while simulations < MOST_TRIALS && damping <= MOST_DAMPING {
            simulations += 1;
            if self.take(workers, held, damping)? {
                damping = (0.1 * damping).max(LEAST_DAMPING);
            } else {
                damping *= 5.0;
            }
        }
        Ok(())
    }

    /// Noise, variation and what is left of the knobs' uncertainty where they stand.
    fn conclude(&mut self) {
        let count = self.knobs.len();
        self.noise = NoiseModel::fitted(&self.given.description, &self.references, &self.residuals);
        self.estimate_variation();
        self.leave_out();
        let (mut information, _) = self.information();
        for k in 0..count {
            information.add(k, k, self.prior[k].precision);
        }
        self.uncertainty = information.cholesky().inverse();
        for k in 0..count {
            self.sigmas[k] = self.uncertainty.at(k, k).sqrt();
            self.uncertainty
                .add(k, k, prior_variation(&self.knobs[k], &self.given.description));
        }
    }

    /// Of residuals of the references under knobs, by the yardstick.
    pub(super) fn surprise(&self, residuals: &[Vec<f64>], values: &[f64]) -> f64 {
        let pairs = self.references.iter().zip(residuals);
        let misfit: f64 = pairs
            .map(|(record, residual)| self.yardstick.surprise(record, residual))
            .sum();
        let pairs = self.prior.iter().zip(values);
        let strange = |(prior, value): (&Prior, &f64)| prior.precision * (value - prior.mean) * (value - prior.mean);
        misfit + pairs.map(strange).sum::<f64>()
    }

    /// Where the knobs are after a step, as far as they go.
    pub(super) fn after(&self, step: &[f64]) -> Vec<f64> {
        let moved = self.values.iter().zip(step).map(|(value, step)| value + step);
        let pairs = moved.zip(&self.knobs);
        pairs.map(|(value, knob)| knob.possible(value)).collect()
    }

    /// Takes the step of a damping when it makes the references likelier; else false.
    fn take(&mut self, workers: &dyn Workers, held: &[(usize, f64)], damping: f64) -> Result<bool, Cancelled> {
        let before = self.surprise(&self.residuals, &self.values);
        let step = self.step(&self.residuals, &self.values, held, damping);
        let values = self.after(&step);
        let model = realised(&self.given, &self.knobs, &values);
        let simulated: Option<Vec<Vec<f64>>> = all_residuals(workers, &self.references, &model)?.into_iter().collect();
        let Some(residuals) = simulated else { return Ok(false) };
        let is_likelier = self.surprise(&residuals, &values) < before;
        if is_likelier {
            self.values = values;
            self.model = model;
            self.residuals = residuals;
        }
        Ok(is_likelier)
    }

    /// S' W S and S' W y of one reference.
    pub(super) fn moments(&self, reference: usize) -> (Square, Vec<f64>) {
        let weighting = self.noise.weighting(&self.references[reference]);
        self.moments_with(reference, &weighting, &self.residuals[reference])
    }

    /// The same with other residuals.
    pub(super) fn moments_with(&self, reference: usize, weighting: &Weighting, residual: &[f64]) -> (Square, Vec<f64>) {
        let turned = |vector: &[f64]| weighting.turned(vector);
        let residual = turned(residual);
        let columns: Vec<Vec<f64>> = self.sensitivities.iter().map(|knob| turned(&knob[reference])).collect();
        let count = self.knobs.len();
        let mut gram = Square::zero(count);
        let mut score = vec![0.0; count];
        for i in 0..count {
            let left: Vec<f64> = weighting.weights.iter().zip(&columns[i]).map(|(w, v)| w * v).collect();
            score[i] = dot(&left, &residual);
            for j in 0..=i {
                let product = dot(&left, &columns[j]);
                gram.set(i, j, product);
                gram.set(j, i, product);
            }
        }
        (gram, score)
    }

    /// S' V^-1 S and S' V^-1 y of one reference.
    fn information_of(&self, reference: usize) -> (Square, Vec<f64>) {
        self.information_from(self.moments(reference))
    }

    /// The same from S' W S and S' W y: the knobs vary from run to run.
    pub(super) fn information_from(&self, (gram, score): (Square, Vec<f64>)) -> (Square, Vec<f64>) {
        let count = self.knobs.len();
        let mut total = Square::zero(count);
        let mut scores = vec![0.0; count];
        let mut inner = gram.clone();
        for (k, variance) in self.variation.iter().enumerate() {
            inner.add(k, k, 1.0 / variance.max(1e-12));
        }
        let inner = inner.cholesky();
        let solved = inner.solve(&score);
        for column in 0..count {
            let g: Vec<f64> = (0..count).map(|row| gram.at(row, column)).collect();
            scores[column] = score[column] - dot(&g, &solved);
            let through = inner.solve(&g);
            for row in 0..count {
                let back: f64 = (0..count).map(|k| gram.at(row, k) * through[k]).sum();
                total.set(row, column, gram.at(row, column) - back);
            }
        }
        (total, scores)
    }

    /// The same of all references.
    fn information(&self) -> (Square, Vec<f64>) {
        let mut total = Square::zero(self.knobs.len());
        let mut scores = vec![0.0; self.knobs.len()];
        for reference in 0..self.references.len() {
            let (information, score) = self.information_of(reference);
            for (sum, more) in total.values.iter_mut().zip(&information.values) {
                *sum += more;
            }
            for (sum, more) in scores.iter_mut().zip(&score) {
                *sum += more;
            }
        }
        (total, scores)
    }

    /// Residuals of every reference as if it had not been calibrated on, and the noise that they show. The calibration turns its many knobs
    /// so that these very runs agree; others do so less.
    ///
    /// To first order: at the optimum the scores of all references cancel, so without reference r the knobs move by -(A - A_r)^-1 s_r.
    fn leave_out(&mut self) {
        self.left_out.clone_from(&self.residuals);
        self.noise_of_references = self.noise.clone();
        if self.references.len() < FEWEST_LEFT_OUT {
            return;
        }
        let count = self.knobs.len();
        let parts: Vec<(Square, Vec<f64>)> = (0..self.references.len()).map(|r| self.information_of(r)).collect();
        for (r, (_, score)) in parts.iter().enumerate() {
            let mut others = Square::zero(count);
            for (_, (information, _)) in parts.iter().enumerate().filter(|(k, _)| *k != r) {
                for (sum, more) in others.values.iter_mut().zip(&information.values) {
                    *sum += more;
                }
            }
            for k in 0..count {
                others.add(k, k, self.prior[k].precision);
            }
            let back = others.cholesky().solve(score);
            for (knob, amount) in self.sensitivities.iter().zip(back) {
                for (value, change) in self.left_out[r].iter_mut().zip(&knob[r]) {
                    *value += amount * change;
                }
            }
        }
        self.noise = NoiseModel::fitted(&self.given.description, &self.references, &self.left_out);
        self.noise_of_references = self.noise.clone();
    }

    /// Factor on thresholds for variances that few references gave, or none: Student's t against the normal at 99.5 %.
    pub fn inflation(&self) -> f64 {
        if self.references.is_empty() {
            return STATED_INFLATION;
        }
        const T: [f64; 12] = [9.92, 5.84, 4.60, 4.03, 3.71, 3.50, 3.36, 3.25, 3.17, 3.11, 3.05, 3.01];
        let degrees = self.references.len() + VARIATION_RUNS as usize - 1;
        let t = T.get(degrees.saturating_sub(2)).copied().unwrap_or(2.9);
        (t / 2.576) * (t / 2.576)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;
    use crate::record::Quantity;
    use crate::record::made::series;

    const CELLS: usize = 300;

    fn record() -> Record {
        series(Quantity::Gyro, CELLS)
    }

    /// Two knobs, and residuals that depend on them linearly: calibrated on `kept`, from what is measured with the knobs at 0.
    fn knobs_of(floor: &Floor, kept: &[usize]) -> Vec<f64> {
        let mut system = Square::zero(2);
        let mut right = vec![0.0; 2];
        for reference in kept {
            let (information, score) = floor.information_of(*reference);
            for k in 0..2 {
                right[k] += score[k];
                for l in 0..2 {
                    system.add(k, l, information.at(k, l));
                }
            }
        }
        for k in 0..2 {
            system.add(k, k, floor.prior[k].precision);
        }
        system.cholesky().solve(&right)
    }

    fn without_knobs(floor: &Floor, measured: &[Vec<f64>], values: &[f64]) -> Vec<Vec<f64>> {
        let cell = |r: usize, i: usize| {
            measured[r][i] - values[0] * floor.sensitivities[0][r][i] - values[1] * floor.sensitivities[1][r][i]
        };
        (0..measured.len())
            .map(|r| (0..CELLS).map(|i| cell(r, i)).collect())
            .collect()
    }

    /// In a linear world the first order is all there is: each is what calibrating on the others really leaves of it.
    #[test]
    fn a_reference_that_is_left_out_is_as_if_it_had_not_been_calibrated_on() {
        let mut random = Random::new(5, 1);
        let mut draw = |size: f64| -> Vec<Vec<f64>> {
            (0..4)
                .map(|_| (0..CELLS).map(|_| size * random.normal()).collect())
                .collect()
        };
        let given = Hypothesis {
            description: twin::golden::reference_robot("diff2"),
            effects: Vec::new(),
            residual: None,
        };
        let mut floor = Floor::stated(given, vec![Knob::Supply(0.02), Knob::Resistance(0.05)]);
        floor.references = vec![record(); 4];
        floor.sensitivities = vec![draw(0.05), draw(0.03)];
        let measured = draw(0.1);
        // The scores are those of what is measured with the knobs at 0; weights and variations stay as stated.
        floor.residuals.clone_from(&measured);
        let all = knobs_of(&floor, &[0, 1, 2, 3]);
        let exact: Vec<Vec<f64>> = (0..4)
            .map(|r| {
                let others: Vec<usize> = (0..4).filter(|k| *k != r).collect();
                without_knobs(&floor, &measured, &knobs_of(&floor, &others)).swap_remove(r)
            })
            .collect();
        floor.residuals = without_knobs(&floor, &measured, &all);
        floor.leave_out();
        let energy = |values: &[f64]| values.iter().map(|value| value * value).sum::<f64>();
        for (r, exact) in exact.iter().enumerate() {
            let apart: Vec<f64> = floor.left_out[r].iter().zip(exact).map(|(a, b)| a - b).collect();
            assert!(energy(&apart) < 1e-18 * energy(exact), "{r}: {}", energy(&apart));
            assert!(
                energy(exact) > energy(&floor.residuals[r]),
                "{r}: calibrated on, it agrees better"
            );
        }
        // With two references the other one alone would say too little.
        floor.references.truncate(2);
        floor.residuals.truncate(2);
        floor.leave_out();
        assert_eq!(floor.left_out, floor.residuals);
        // What runs are heard beside is the noise of these references all the same.
        assert_eq!(floor.noise_of_references, floor.noise);
    }
}
