//! A network on linearised windows: Adam on batches, early stopping on the windows of other runs.

use std::ops::Range;

use rand_pcg::Pcg64Mcg;
use rand_pcg::rand_core::SeedableRng;

use crate::adam::Adam;
use crate::inputs::Frame;
use crate::linear::{AXES, Problem};
use crate::network::{Network, Pass, uniform};

/// How it is trained.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Settings {
    /// Units of the hidden layers.
    pub hidden: Vec<usize>,
    pub epochs: usize,
    /// Epochs without a better validation loss after which it stops.
    pub patience: usize,
    /// Windows a step.
    pub batch: usize,
    pub rate: f64,
    /// Weight decay per unit of the rate.
    pub decay: f64,
    /// Weight of the mean square of the outputs, in units of their scales: where nothing is known nothing is added.
    pub rest: f64,
    pub seed: u64,
}

impl Default for Settings {
    fn default() -> Settings {
        Settings {
            hidden: vec![16, 16],
            epochs: 120,
            patience: 30,
            batch: 8,
            rate: 2e-3,
            decay: 0.1,
            rest: 3e-3,
            seed: 1,
        }
    }
}

/// A network with its frame and the scales of its outputs.
#[derive(Debug, Clone, PartialEq)]
pub struct Learner {
    pub network: Network,
    pub frame: Frame,
    /// Its first output among [`AXES`].
    pub first: usize,
    /// Acceleration, or set-point, per unit of the outputs.
    pub scale: [f64; AXES],
}

impl Learner {
    /// Outputs of a row of inputs in their units, without fade and limits; 0 for those that the robot does not have.
    pub fn outputs(&self, inputs: &[f64], normalised: &mut Vec<f64>, pass: &mut Pass) -> [f64; AXES] {
        self.frame.normalised(inputs, normalised);
        let units = self.network.forward(normalised, pass);
        core::array::from_fn(|axis| {
            let unit = axis.checked_sub(self.first).and_then(|place| units.get(place));
            unit.map_or(0.0, |unit| self.scale[axis] * unit)
        })
    }

    /// Its outputs among [`AXES`].
    pub fn axes(&self) -> Range<usize> {
        self.first..self.first + self.network.outputs()
    }

    /// Mean outputs of every block of a problem.
    pub fn block_outputs(&self, problem: &Problem) -> Vec<f64> {
        let width = self.frame.eyes.len();
        let (mut normalised, mut pass) = (Vec::new(), Pass::default());
        let mut out = Vec::with_capacity(AXES * problem.blocks);
        for block in problem.inputs.chunks_exact(width * problem.rows) {
            let mut sums = [0.0; AXES];
            for row in block.chunks_exact(width) {
                let values = self.outputs(row, &mut normalised, &mut pass);
                for (sum, value) in sums.iter_mut().zip(values) {
                    *sum += value / problem.rows as f64;
                }
            }
            out.extend(sums);
        }
        out
    }

    /// Loss of a problem; adds its gradient in the parameters when there is room for it.
    ///
    /// - `before`: outputs at which it was linearised.
    fn loss(&self, problem: &Problem, before: &[f64], rest: f64, gradient: Option<&mut [f64]>) -> f64 {
        let outputs = self.block_outputs(problem);
        let change: Vec<f64> = outputs.iter().zip(before).map(|(a, b)| a - b).collect();
        let mut slope = vec![0.0; change.len()];
        let mut loss = problem.loss(&change, &mut slope);
        let share = rest / (problem.blocks * self.network.outputs()) as f64;
        for (k, output) in outputs.iter().enumerate() {
            let scale = self.scale[k % AXES];
            loss += share * output * output / (scale * scale);
            slope[k] += 2.0 * share * output / (scale * scale);
        }
        let Some(gradient) = gradient else { return loss };
        let width = self.frame.eyes.len();
        let (mut normalised, mut pass) = (Vec::new(), Pass::default());
        for (number, block) in problem.inputs.chunks_exact(width * problem.rows).enumerate() {
            let of_units: Vec<f64> = self
                .axes()
                .map(|axis| slope[AXES * number + axis] * self.scale[axis] / problem.rows as f64)
                .collect();
            for row in block.chunks_exact(width) {
                self.frame.normalised(row, &mut normalised);
                self.network.forward(&normalised, &mut pass);
                self.network.backward(&pass, &of_units, gradient);
            }
        }
        loss
    }
}

/// How the training went.
#[derive(Debug, Clone, Default, PartialEq, serde::Serialize)]
pub struct Course {
    pub epochs: usize,
    /// Epoch whose weights were kept.
    pub kept: usize,
    /// Mean linearised loss of the training windows at the end, and of the validation windows before and at best.
    pub train: f64,
    pub validation_before: f64,
    pub validation: f64,
}

/// Trains from where the learner stands.
///
/// - `go_on`: called after every epoch with its number and validation loss; false ends the training with the best so far.
/// - A loss that is not finite ends it as well.
pub fn train(
    learner: &mut Learner,
    problems: &[Problem],
    validation: &[Problem],
    settings: &Settings,
    go_on: &mut dyn FnMut(usize, f64) -> bool,
) -> Course {
    let before: Vec<Vec<f64>> = problems.iter().map(|problem| learner.block_outputs(problem)).collect();
    let before_validation: Vec<Vec<f64>> = validation.iter().map(|p| learner.block_outputs(p)).collect();
    let mean = |learner: &Learner, problems: &[Problem], before: &[Vec<f64>]| {
        let pairs = problems.iter().zip(before);
        pairs.map(|(p, b)| learner.loss(p, b, 0.0, None)).sum::<f64>() / problems.len().max(1) as f64
    };
    let mut course = Course {
        validation_before: mean(learner, validation, &before_validation),
        ..Course::default()
    };
    course.validation = course.validation_before;
    let mut best = learner.network.clone();
    let mut adam = Adam::new(best.parameters().len());
    let mut random = Pcg64Mcg::seed_from_u64(settings.seed ^ 0x7261_696e);
    let mut order: Vec<usize> = (0..problems.len()).collect();
    for epoch in 1..=settings.epochs {
        for place in (1..order.len()).rev() {
            order.swap(place, ((uniform(&mut random) * (place + 1) as f64) as usize).min(place));
        }
        let rate =
            settings.rate * 0.5 * (1.0 + libm::cos(core::f64::consts::PI * epoch as f64 / settings.epochs as f64));
        let mut total = 0.0;
        for batch in order.chunks(settings.batch.max(1)) {
            let mut gradient = vec![0.0; best.parameters().len()];
            for number in batch {
                total += learner.loss(&problems[*number], &before[*number], settings.rest, Some(&mut gradient));
            }
            let size = batch.len() as f64;
            gradient.iter_mut().for_each(|g| *g /= size);
            adam.step(learner.network.parameters_mut(), &gradient, rate, settings.decay);
        }
        course.epochs = epoch;
        course.train = total / problems.len().max(1) as f64;
        let now = mean(learner, validation, &before_validation);
        if now < course.validation {
            (course.validation, course.kept) = (now, epoch);
            best.clone_from(&learner.network);
        }
        let hopeless = epoch > course.kept + settings.patience;
        if !now.is_finite() || hopeless || !go_on(epoch, now) {
            break;
        }
    }
    learner.network = best;
    course
}
