//! Whether a channel errs more in the runs than in the references, beyond what runs differ among themselves.
//!
//! A disagreement that no effect of the library explains shows in one or two channels and drowns in the energy of all of them. So every
//! channel is compared for itself: logarithms of the energies of what the knobs leave, whose scatter from run to run is about alike for all
//! robots, with a stated scatter beside the measured one. Only runs that are driven as the references are: twins are worse where more happens.

use crate::floor::Metric;
use crate::record::{CHANNELS, CLASSES, Record};

/// Cells of a channel that a run needs.
const FEWEST_CELLS: usize = 20;
/// References and runs that are needed.
const FEWEST_RUNS: usize = 2;
/// Runs whose wheels change their speed more than this many times as much as the liveliest reference's are left out.
const LIVELIER: f64 = 1.1;
/// Runs are not calibrated on, references are: difference of the logarithms that says nothing.
const SLACK: f64 = 0.2;
/// Scatter of the logarithm from run to run before any is seen, worth so many runs.
const SCATTER: f64 = 0.3;
const SCATTER_RUNS: f64 = 6.0;
/// Difference in standard errors that chance does not give: Student's t, 12 degrees, eight channels, about 1 in 150.
const LOUD: f64 = 4.0;

/// A run in short.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct RunLevel {
    /// Logarithm of the energy a cell by class, in units of the floor's noise.
    log_energy: [Option<f64>; CLASSES],
    /// Root mean square change of measured wheel speeds in 0.15 s, rad/s; without encoders of the gyro.
    liveliness: f64,
}

#[cfg(test)]
impl RunLevel {
    pub fn sample(log_energy: [Option<f64>; CLASSES]) -> RunLevel {
        RunLevel {
            log_energy,
            liveliness: 1.0,
        }
    }
}

/// Runs beside the references, both under the same model and in the same units of noise.
#[derive(Debug, Clone, Default)]
pub(super) struct Compared {
    /// Empty without references.
    pub references: Vec<RunLevel>,
    pub runs: Vec<RunLevel>,
}

/// A channel that is louder than in the references.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Louder {
    pub class: usize,
    /// Energy over that in the references.
    pub ratio: f64,
    /// Difference in standard errors.
    pub score: f64,
}

impl Louder {
    /// For the report.
    pub fn words(self) -> String {
        format!(
            "{}: what everyday differences leave has {:.1} times the energy that it has in the references",
            CHANNELS[self.class], self.ratio
        )
    }
}

/// Levels of the runs of a product.
pub(super) fn levels(metric: &Metric, records: &[Record], residuals: &[Vec<f64>]) -> Vec<RunLevel> {
    let runs = records.iter().zip(residuals).enumerate();
    runs.map(|(run, (record, residual))| level(record, &metric.rest(run, residual)))
        .collect()
}

fn level(record: &Record, rest: &[f64]) -> RunLevel {
    let mut sums = [(0.0, 0_usize); CLASSES];
    let mut lively = [(0.0, 0_usize); CLASSES];
    let cells = record.places().into_iter().zip(record.activities()).zip(rest);
    for ((place, activity), value) in cells {
        let Some(quantity) = place.quantity else { continue };
        let class = quantity.class();
        sums[class] = (sums[class].0 + value * value, sums[class].1 + 1);
        lively[class] = (lively[class].0 + activity * activity, lively[class].1 + 1);
    }
    let rms = |(sum, count): (f64, usize)| (sum / count.max(1) as f64).sqrt();
    let of = |channel: &str| CHANNELS.iter().position(|name| *name == channel).unwrap_or(0);
    let (wheel, gyro) = (lively[of("wheel")], lively[of("gyro")]);
    RunLevel {
        log_energy: sums
            .map(|(sum, count)| (count >= FEWEST_CELLS && sum > 0.0).then(|| libm::log(sum / count as f64))),
        liveliness: rms(if wheel.1 > 0 { wheel } else { gyro }),
    }
}

/// The channel that is louder most clearly, if any is.
pub(super) fn louder(compared: &Compared) -> Option<Louder> {
    let found = all_louder(compared).into_iter();
    found.max_by(|a, b| a.score.total_cmp(&b.score))
}

/// All channels that are louder, in their order.
pub(super) fn all_louder(compared: &Compared) -> Vec<Louder> {
    let Compared { references, runs } = compared;
    let liveliest = references.iter().map(|run| run.liveliness).fold(0.0, f64::max);
    let alike: Vec<&RunLevel> = runs
        .iter()
        .filter(|run| run.liveliness <= LIVELIER * liveliest)
        .collect();
    let found = (0..CLASSES).filter_map(|class| {
        let known: Vec<f64> = references.iter().filter_map(|run| run.log_energy[class]).collect();
        let new: Vec<f64> = alike.iter().filter_map(|run| run.log_energy[class]).collect();
        if known.len() < FEWEST_RUNS || new.len() < FEWEST_RUNS {
            return None;
        }
        let ((low, low_squares), (high, high_squares)) = (moments(&known), moments(&new));
        let (n, m) = (known.len() as f64, new.len() as f64);
        let squares = low_squares + high_squares + SCATTER_RUNS * SCATTER * SCATTER;
        let variance = squares / (n + m - 2.0 + SCATTER_RUNS);
        let score = (high - low - SLACK) / (variance * (1.0 / n + 1.0 / m)).sqrt();
        Some(Louder {
            class,
            ratio: libm::exp(high - low),
            score,
        })
    });
    found.filter(|louder| louder.score >= LOUD).collect()
}

/// Share of what made a channel louder that is there still: of the energy above the references', each in units of its own floor.
pub(super) fn share_left(before: &Compared, after: &Compared, class: usize) -> f64 {
    let excess = |compared: &Compared| {
        let mean = |runs: &[RunLevel]| {
            let known: Vec<f64> = runs.iter().filter_map(|run| run.log_energy[class]).collect();
            moments(&known).0
        };
        libm::exp(mean(&compared.runs) - mean(&compared.references)) - 1.0
    };
    excess(after) / excess(before).max(1e-9)
}

/// Mean and sum of squares about it.
fn moments(values: &[f64]) -> (f64, f64) {
    let mean = values.iter().sum::<f64>() / values.len().max(1) as f64;
    (mean, values.iter().map(|v| (v - mean) * (v - mean)).sum())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    const GYRO: usize = 4;

    fn runs(count: usize, gyro: f64, liveliness: f64, random: &mut Random) -> Vec<RunLevel> {
        (0..count)
            .map(|_| {
                let mut log_energy = [(); CLASSES].map(|()| Some(0.3 * random.normal()));
                log_energy[GYRO] = log_energy[GYRO].map(|level| level + gyro);
                log_energy[1] = None;
                RunLevel { log_energy, liveliness }
            })
            .collect()
    }

    fn beside(references: &[RunLevel], runs: Vec<RunLevel>) -> Compared {
        Compared {
            references: references.to_vec(),
            runs,
        }
    }

    /// Levels that scatter as stated: hardly ever louder; a gyro of twelve times the energy: always.
    #[test]
    fn chance_is_not_louder_and_a_loud_channel_is() {
        let mut random = Random::new(5, 1);
        let (mut chance, mut missed) = (0, 0);
        for _ in 0..2000 {
            let references = runs(4, 0.0, 2.0, &mut random);
            chance += usize::from(louder(&beside(&references, runs(4, 0.0, 2.0, &mut random))).is_some());
            let loud = louder(&beside(&references, runs(4, 2.5, 2.0, &mut random)));
            missed += usize::from(loud.is_none_or(|loud| loud.class != GYRO || loud.ratio < 4.0));
        }
        assert!(chance <= 20 && missed <= 2, "{chance} {missed}");
    }

    /// Wheels are asked for themselves: another channel may be louder more clearly.
    #[test]
    fn all_channels_that_are_louder_are_told() {
        let of = |gyro: f64, wheel: f64| {
            let mut log_energy = [Some(0.0); CLASSES];
            (log_energy[GYRO], log_energy[0]) = (Some(gyro), Some(wheel));
            let run = RunLevel {
                log_energy,
                liveliness: 1.0,
            };
            vec![run; 3]
        };
        let all = all_louder(&beside(&of(0.0, 0.0), of(6.0, 3.0)));
        assert_eq!(all.iter().map(|louder| louder.class).collect::<Vec<_>>(), [0, GYRO]);
        let first = louder(&beside(&of(0.0, 0.0), of(6.0, 3.0)));
        assert_eq!(first.map(|louder| louder.class), Some(GYRO));
    }

    #[test]
    fn livelier_runs_and_single_ones_say_nothing() {
        let mut random = Random::new(6, 1);
        let references = runs(4, 0.0, 2.0, &mut random);
        assert!(louder(&beside(&references, runs(4, 4.0, 2.3, &mut random))).is_none());
        assert!(louder(&beside(&references, runs(1, 4.0, 2.0, &mut random))).is_none());
        assert!(louder(&beside(&references[..1], runs(4, 4.0, 2.0, &mut random))).is_none());
        assert!(louder(&beside(&references, runs(4, 4.0, 2.1, &mut random))).is_some());
    }

    /// Nine times the energy of the references before; twice it after, when the references themselves have become ten times quieter.
    #[test]
    fn what_is_left_is_counted_above_the_references_of_its_own_model() {
        let of = |level: f64| {
            vec![RunLevel {
                log_energy: [Some(libm::log(level)); CLASSES],
                liveliness: 1.0,
            }]
        };
        let share = share_left(&beside(&of(1.0), of(9.0)), &beside(&of(0.1), of(0.2)), GYRO);
        assert!((share - 0.125).abs() < 1e-12, "{share}");
        let share = share_left(&beside(&of(1.0), of(9.0)), &beside(&of(1.0), of(3.0)), GYRO);
        assert!((share - 0.25).abs() < 1e-12, "{share}");
    }
}
