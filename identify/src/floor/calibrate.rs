//! The nominal model on references, and what is left.

// Sums over rows and columns read better by their indices.
#![allow(clippy::needless_range_loop)]

use super::metric::{Metric, dot};
use super::modes::Weighting;
use super::noise::NoiseModel;
use crate::hypothesis::{Hypothesis, Knob, realised};
use crate::linear::Square;
use crate::record::{Record, Stages};
use crate::screen::{Change, all_residuals, columns};
use crate::workers::{Cancelled, Workers};
use twin::robot::RobotDescription;

/// What a laboratory's description is off by, standard deviation in practical sizes: such errors are below the practical size. A wider prior
/// lets the calibration wander where references do not tell, as among the toes of four wheels, and its width hides what runs differ by.
const DESCRIPTION_SIGMA: f64 = 0.7;
/// The same of what no description tells: tyres, filters inside servos and sensors.
const UNTOLD_SIGMA: f64 = 1.5;
/// Without references: what a description that its laboratory has looked after is off by.
const WORD_SIGMA: f64 = 0.35;
/// The same of the tread.
const TREAD_SIGMA: f64 = 2.5;
/// From run to run and from day to day, in practical sizes: stated prior, worth this many references.
const VARIATION_SIGMA: f64 = 0.12;
const VARIATION_RUNS: f64 = 3.0;
/// The same of what does not change by itself: what a few references seem to say of it is errors of the laws.
const RIGID_RUNS: f64 = 20.0;
/// The same for friction, as a share of the described one, and the least in practical sizes.
const FRICTION_VARIATION: f64 = 0.1;
const LEAST_VARIATION: f64 = 0.01;
/// The same for what is bolted, built in or programmed: no rigid body changes between two runs by more than a little warmth and wear, and no firmware's timing
/// by itself. Clocks do.
const RIGID_VARIATION: f64 = 0.03;
const RIGID: [&str; 17] = [
    "command_delay",
    "motor_lag",
    "steering_lag",
    "localization_latency",
    "wheel_radius",
    "wheel_radius_one",
    "track_width",
    "wheel_misalignment",
    "marker_offset",
    "imu_yaw",
    "gyro_scale",
    "pose_scale",
    "steering_offset",
    "steering_scale",
    "steering_backlash",
    "camera_seam",
    "tag_height",
];
/// The same for battery and temperature, in knobs.
const WEATHER_SIGMA: f64 = 1.0;
/// Steps that are tried from one linearisation, and Marquardt's damping, as a share of the diagonal.
const MOST_TRIALS: usize = 8;
const LEAST_DAMPING: f64 = 0.01;
const MOST_DAMPING: f64 = 100.0;
/// Times that the sensitivities are taken anew at the calibrated model.
const LINEARISATIONS: usize = 2;
/// References that the first of them takes.
const FIRST_REFERENCES: usize = 4;
const EXPECTATION_STEPS: usize = 12;
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

/// Variance of a knob from run to run before any reference. Friction of a drive varies with what there is of it, and its practical size is many
/// times that on a robot that runs freely.
fn prior_variation(knob: &Knob, robot: &RobotDescription) -> f64 {
    let of_friction = |nominal: Option<f64>, practical: f64| {
        let share = FRICTION_VARIATION * nominal.unwrap_or(0.0) / practical;
        share.clamp(LEAST_VARIATION, VARIATION_SIGMA)
    };
    let motor = robot.motor.as_ref();
    match knob {
        Knob::Parameter { name, practical, .. } => {
            let sigma = match *name {
                "coulomb_friction" => of_friction(motor.map(|motor| motor.coulomb_n_m), *practical),
                "viscous_friction" => of_friction(motor.map(|motor| motor.viscous_n_m_s), *practical),
                rigid if RIGID.contains(&rigid) => RIGID_VARIATION,
                _ => VARIATION_SIGMA,
            };
            sigma * sigma
        }
        Knob::Supply(_) | Knob::Resistance(_) => WEATHER_SIGMA * WEATHER_SIGMA,
        Knob::Tread(_) | Knob::SteeringFilter(_) | Knob::AccelerometerLag(_) => RIGID_VARIATION * RIGID_VARIATION,
    }
}

/// True of what no day changes by itself.
fn is_rigid(knob: &Knob) -> bool {
    match knob {
        Knob::Parameter { name, .. } => RIGID.contains(name),
        other => other.is_untold(),
    }
}

/// References that the stated variation of a knob is worth.
fn prior_runs(knob: &Knob) -> f64 {
    if is_rigid(knob) { RIGID_RUNS } else { VARIATION_RUNS }
}

/// Precision with which the description tells a knob.
pub(super) fn prior_precision(knob: &Knob) -> f64 {
    let sigma = if knob.is_untold() {
        UNTOLD_SIGMA
    } else {
        DESCRIPTION_SIGMA
    };
    1.0 / (sigma * sigma)
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
        let simulated = all_residuals(workers, &references, &given)?;
        let pairs = references.into_iter().zip(simulated);
        let (references, start): (Vec<Record>, Vec<Vec<f64>>) =
            pairs.filter_map(|(record, residual)| Some((record, residual?))).unzip();
        let mut floor = Floor::stated(given, knobs);
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

    fn fit(&mut self, workers: &dyn Workers) -> Result<(), Cancelled> {
        let count = self.knobs.len();
        let mut damping = LEAST_DAMPING;
        let mut simulations = 0;
        while simulations < MOST_TRIALS && damping <= MOST_DAMPING {
            simulations += 1;
            if self.take(workers, damping)? {
                damping = (0.1 * damping).max(LEAST_DAMPING);
            } else {
                damping *= 5.0;
            }
        }
        self.noise = NoiseModel::fitted(&self.given.description, &self.references, &self.residuals);
        self.estimate_variation();
        self.leave_out();
        let (mut information, _) = self.information();
        for k in 0..count {
            information.add(k, k, prior_precision(&self.knobs[k]));
        }
        self.uncertainty = information.cholesky().inverse();
        for k in 0..count {
            self.sigmas[k] = self.uncertainty.at(k, k).sqrt();
            self.uncertainty
                .add(k, k, prior_variation(&self.knobs[k], &self.given.description));
        }
        Ok(())
    }

    /// Of residuals of the references under knobs, by the yardstick.
    pub(super) fn surprise(&self, residuals: &[Vec<f64>], values: &[f64]) -> f64 {
        let pairs = self.references.iter().zip(residuals);
        let misfit: f64 = pairs
            .map(|(record, residual)| self.yardstick.surprise(record, residual))
            .sum();
        let pairs = self.knobs.iter().zip(values);
        misfit
            + pairs
                .map(|(knob, value)| prior_precision(knob) * value * value)
                .sum::<f64>()
    }

    /// Takes the step of a damping when it makes the references likelier; else false.
    fn take(&mut self, workers: &dyn Workers, damping: f64) -> Result<bool, Cancelled> {
        let before = self.surprise(&self.residuals, &self.values);
        let step = self.step(&self.residuals, &self.values, &[], damping);
        let moved = self.values.iter().zip(&step).map(|(v, s)| v + s);
        let values: Vec<f64> = moved
            .zip(&self.knobs)
            .map(|(value, knob)| knob.possible(value))
            .collect();
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
    fn moments(&self, reference: usize) -> (Square, Vec<f64>) {
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
                others.add(k, k, prior_precision(&self.knobs[k]));
            }
            let back = others.cholesky().solve(score);
            for (knob, amount) in self.sensitivities.iter().zip(back) {
                for (value, change) in self.left_out[r].iter_mut().zip(&knob[r]) {
                    *value += amount * change;
                }
            }
        }
        self.noise = NoiseModel::fitted(&self.given.description, &self.references, &self.left_out);
    }

    /// Variances from run to run by expectation and maximisation, with the stated prior as further runs.
    fn estimate_variation(&mut self) {
        let count = self.knobs.len();
        let moments: Vec<(Square, Vec<f64>)> = (0..self.references.len()).map(|r| self.moments(r)).collect();
        for _ in 0..EXPECTATION_STEPS {
            let mut sums: Vec<f64> = self
                .knobs
                .iter()
                .map(|knob| prior_runs(knob) * prior_variation(knob, &self.given.description))
                .collect();
            for (gram, score) in &moments {
                let mut inner = gram.clone();
                for (k, variance) in self.variation.iter().enumerate() {
                    inner.add(k, k, 1.0 / variance.max(1e-12));
                }
                let covariance = inner.cholesky().inverse();
                for (k, sum) in sums.iter_mut().enumerate() {
                    let mean: f64 = (0..count).map(|j| covariance.at(k, j) * score[j]).sum();
                    *sum += mean * mean + covariance.at(k, k);
                }
            }
            let runs = moments.len() as f64;
            let knobs = sums.into_iter().zip(&self.knobs);
            self.variation = knobs.map(|(sum, knob)| sum / (runs + prior_runs(knob))).collect();
        }
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
    use twin::effect::library::find;

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
            system.add(k, k, prior_precision(&floor.knobs[k]));
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
    }

    #[test]
    fn rigid_parts_vary_least() {
        let robot = twin::golden::reference_robot("diff2");
        let of = |name: &'static str| {
            let knob = Knob::Parameter {
                name,
                index: None,
                parameter: "",
                neutral: 0.0,
                practical: 1.0,
                low: -1.0,
                high: 1.0,
            };
            prior_variation(&knob, &robot).sqrt()
        };
        for name in RIGID {
            assert!(find(name).is_some(), "{name} is no effect");
            assert!(of(name) < 0.3 * of("payload"), "{name}");
        }
    }
}
