//! The twin's error in a window, linear in the network's outputs: accelerations of its body, and set-points where it has no motors.
//!
//! ```text
//! e(a) = e_0 - J (a - a_0)          a: outputs per block of 0.2 s, a_0: those of the network then
//! loss = sum w e^2 = energy - 2 pull . (a - a_0) + (a - a_0)' gram (a - a_0)
//! ```
//!
//! J by finite differences: one simulation per block and output. The twin stays a black box to the training, wheels
//! that hold their speed and slip answer as they do, and errors of the pose count over the whole horizon, so that noise of
//! the measurements is never differentiated.

use std::ops::Range;

pub use twin::residual::AXES;
use twin::residual::OUTPUTS;
use twin::robot::Robot;

use crate::compare::{CLASSES, Difference, differences};
use crate::inputs::{Eye, Watch};
use crate::rollout::driven;
use crate::window::Window;

/// Control ticks of a block.
const BLOCK_TICKS: u64 = 24;
/// Every which control tick's inputs the network is trained on.
const SAMPLED_TICKS: u64 = 3;
/// Outputs of a probe, in the order of [`AXES`].
const PROBE: [f64; AXES] = [0.2, 0.2, 1.0, 0.02, 0.02, 0.1];
/// Differences beyond this many typical errors count less, as if they grew linearly (Huber 1964).
const HUBER: f64 = 3.0;

/// 90 % of the sizes of a normal distribution are below this many deviations.
const NORMAL_90: f64 = 1.645;

/// What the network is taught by.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Target {
    /// Poses, wheel speeds and gyro over a second.
    Path,
    /// Twist, wheel speeds and gyro 0.35 s after the start: one acceleration a window.
    Twist,
}

/// Typical error of physics alone by [`crate::compare::Class`], in its unit; infinite for a class that nothing was measured of.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scales(pub [f64; CLASSES]);

/// One window as a quadratic in the network's outputs.
#[derive(Debug, Clone)]
pub struct Problem {
    pub blocks: usize,
    /// Rows of inputs of each block.
    pub rows: usize,
    /// `rows` times `blocks` rows of inputs, in their units.
    pub inputs: Vec<f64>,
    /// Row by row, AXES times `blocks` wide.
    pub gram: Vec<f64>,
    pub pull: Vec<f64>,
    pub energy: f64,
}

impl Scales {
    /// Of each class over windows, as for a normal distribution, from its 90 % quantile: a few wild windows do not set it.
    pub fn of<'a>(all: impl Iterator<Item = &'a [Difference]>) -> Scales {
        let mut sizes: [Vec<f64>; CLASSES] = Default::default();
        for difference in all.flatten() {
            sizes[difference.class as usize].push(difference.value.abs());
        }
        Scales(sizes.map(|mut sizes| {
            sizes.sort_by(f64::total_cmp);
            let size = sizes.get(sizes.len() * 9 / 10).map(|size| size / NORMAL_90);
            size.filter(|size| *size > 0.0).unwrap_or(f64::INFINITY)
        }))
    }

    /// Weights of the differences of a window: every class the same, outliers less.
    fn weights(&self, differences: &[Difference]) -> Vec<f64> {
        let mut counts = [0.0_f64; CLASSES];
        for difference in differences {
            counts[difference.class as usize] += 1.0;
        }
        let weight = |difference: &Difference| {
            let class = difference.class as usize;
            let share = difference.value.abs() / self.0[class];
            let robust = if share > HUBER { HUBER / share } else { 1.0 };
            robust / (counts[class] * self.0[class] * self.0[class])
        };
        differences.iter().map(weight).collect()
    }

    /// Mean over windows of the mean square by class in units of the scales, robust: 1 or less for physics alone.
    pub fn loss(&self, windows: &[Vec<Difference>]) -> f64 {
        windows.iter().map(|window| self.loss_of(window)).sum::<f64>() / windows.len().max(1) as f64
    }

    /// The same of one window.
    pub fn loss_of(&self, differences: &[Difference]) -> f64 {
        let classes = self.0.iter().filter(|scale| scale.is_finite()).count().max(1) as f64;
        let weights = self.weights(differences);
        let pairs = weights.iter().zip(differences);
        pairs.map(|(w, d)| w * d.value * d.value).sum::<f64>() / classes
    }
}

/// Blocks of a window and control ticks of each.
fn blocks(window: &Window, target: Target) -> (usize, u64) {
    let ticks = (window.end_s() * f64::from(twin::CONTROL_RATE_HZ)) as u64 + 1;
    match target {
        Target::Path => (ticks.div_ceil(BLOCK_TICKS) as usize, BLOCK_TICKS),
        Target::Twist => (1, ticks),
    }
}

/// Linearises a window; `None` when the twin cannot be driven through it.
///
/// - `axes`: outputs of the network among [`AXES`]; the others stay 0.
pub fn linearised(
    robot: &Robot,
    window: &Window,
    (eyes, axes): (&[Eye], &Range<usize>),
    scales: &Scales,
    target: Target,
) -> Option<Problem> {
    let (blocks, ticks) = blocks(window, target);
    let poses = target == Target::Path;
    let mut watch = Watch::new(robot, eyes);
    let mut inputs = Vec::new();
    let base = driven(robot, window, &mut |tick| {
        watch.take(tick);
        if tick.number % SAMPLED_TICKS == 0 && tick.number < blocks as u64 * ticks {
            watch.inputs(&mut inputs);
        }
        Some([0.0; AXES])
    })?;
    let base = differences(window, &base, poses)?;
    let width = AXES * blocks;
    let rows = ticks.div_ceil(SAMPLED_TICKS) as usize;
    // The last block may be longer than the window: its last inputs stand for the rest.
    let row = eyes.len();
    while inputs.len() < blocks * rows * row {
        let last = inputs.len().checked_sub(row)?;
        inputs.extend_from_within(last..);
    }
    let mut columns: Vec<Vec<f64>> = Vec::with_capacity(width);
    for block in 0..blocks as u64 {
        for axis in 0..AXES {
            if !axes.contains(&axis) {
                columns.push(vec![0.0; base.len()]);
                continue;
            }
            let mut push = [0.0; AXES];
            push[axis] = PROBE[axis];
            let probed = driven(robot, window, &mut |tick| {
                let inside = tick.number / ticks == block;
                Some(if inside { push } else { [0.0; AXES] })
            })?;
            let probed = differences(window, &probed, poses)?;
            let pairs = base.iter().zip(&probed);
            columns.push(pairs.map(|(a, b)| (a.value - b.value) / PROBE[axis]).collect());
        }
    }
    let weights = scales.weights(&base);
    let mut gram = vec![0.0; width * width];
    let mut pull = vec![0.0; width];
    for i in 0..width {
        let weighted: Vec<f64> = weights.iter().zip(&columns[i]).map(|(w, c)| w * c).collect();
        pull[i] = weighted.iter().zip(&base).map(|(c, d)| c * d.value).sum();
        for j in 0..=i {
            let product: f64 = weighted.iter().zip(&columns[j]).map(|(a, b)| a * b).sum();
            gram[i * width + j] = product;
            gram[j * width + i] = product;
        }
    }
    let energy = weights.iter().zip(&base).map(|(w, d)| w * d.value * d.value).sum();
    let all = pull.iter().chain(&gram).chain(&inputs);
    let finite = all.chain([&energy]).all(|number| number.is_finite());
    finite.then_some(Problem {
        blocks,
        rows,
        inputs,
        gram,
        pull,
        energy,
    })
}

impl Problem {
    /// The one constant acceleration that explains the window best, and the one constant change of the set-points, each alone,
    /// with a little weight on none.
    pub fn constant(&self) -> [f64; AXES] {
        let width = AXES * self.blocks;
        let (mut matrix, mut right) = ([[0.0; AXES]; AXES], [0.0; AXES]);
        for i in 0..width {
            right[i % AXES] += self.pull[i];
            for j in 0..width {
                matrix[i % AXES][j % AXES] += self.gram[i * width + j];
            }
        }
        let mut constant = [0.0; AXES];
        for first in [0, OUTPUTS.len()] {
            let axes = first..(first + OUTPUTS.len()).min(AXES);
            let mut square = identify::linear::Square::zero(axes.len());
            for (i, row) in matrix[axes.clone()].iter().enumerate() {
                for (j, value) in row[axes.clone()].iter().enumerate() {
                    // An axis that nothing answers to stays 0.
                    square.set(i, j, if i == j { value * 1.001 + 1e-6 } else { *value });
                }
            }
            let found = square.cholesky().solve(&right[axes.clone()]);
            constant[axes].copy_from_slice(&found);
        }
        constant
    }

    /// Loss and its gradient in the outputs, for a change of the outputs.
    pub fn loss(&self, change: &[f64], gradient: &mut [f64]) -> f64 {
        let width = change.len();
        let mut loss = self.energy;
        for i in 0..width {
            let row = &self.gram[i * width..(i + 1) * width];
            let through: f64 = row.iter().zip(change).map(|(g, c)| g * c).sum();
            loss += change[i] * (through - 2.0 * self.pull[i]);
            gradient[i] = 2.0 * (through - self.pull[i]);
        }
        loss
    }
}
