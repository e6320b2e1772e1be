//! Energy of the runs beside that of the references: of all windows, and of the quieter ones.

use super::prepared::Prepared;
use crate::floor::{Floor, Metric};
use crate::record::Record;
use crate::select::window_energies;

/// Share of a run's windows, the loudest, that are none of its quieter ones. A wheel that lets go makes one window worth a hundred others.
const LOUDEST: f64 = 0.2;
/// Standard deviations of the references' energies that chance keeps below.
const CHANCE: f64 = 3.0;
/// Few references do not show their whole scatter: at least this share of the mean.
const LEAST_SCATTER: f64 = 0.25;
/// Energy as small as the noise itself is no gap, however quiet the references were.
const NO_GAP: f64 = 1.5;
/// The limit without references.
const STATED_LIMIT: f64 = 4.0;

/// Whitened energy a residual, everyday differences taken out: means over runs, before and after effects are named, over the references, and
/// what chance keeps below.
#[derive(Debug, Clone, Copy)]
pub(super) struct Energy {
    pub before: f64,
    pub after: f64,
    pub floor: f64,
    pub limit: f64,
}

impl Energy {
    const NOTHING: Energy = Energy {
        before: 0.0,
        after: 0.0,
        floor: 1.0,
        limit: 1.0,
    };

    /// Excess that is left of what there was.
    pub fn left(&self) -> f64 {
        (self.after - self.floor) / (self.before - self.floor).max(1e-9)
    }
}

/// Of all windows, and of the quieter ones.
#[derive(Debug, Clone, Copy)]
pub(super) struct Energies {
    pub all: Energy,
    pub quiet: Energy,
}

impl Energies {
    pub const NOTHING: Energies = Energies {
        all: Energy::NOTHING,
        quiet: Energy::NOTHING,
    };

    /// The same with nothing named.
    pub fn unnamed(&self) -> Energies {
        let of = |energy: &Energy| Energy {
            after: energy.before,
            ..*energy
        };
        Energies {
            all: of(&self.all),
            quiet: of(&self.quiet),
        }
    }

    /// What runs have before anything is named, beside their references.
    pub fn before(floor: &Floor, references: Option<&Metric>, train: &Prepared, validation: &Prepared) -> Energies {
        let of = |is_quiet: bool| {
            let (expected, limit) = match references {
                Some(metric) => {
                    let energies = energies(metric, &floor.references, &floor.left_out, is_quiet);
                    limits(&energies, floor.inflation())
                }
                None => (1.0, STATED_LIMIT),
            };
            Energy {
                before: of_runs(train, validation, is_quiet),
                after: 0.0,
                floor: expected,
                limit,
            }
        };
        Energies {
            all: of(false),
            quiet: of(true),
        }
    }

    /// The same runs with what was named.
    pub fn name(&mut self, train: &Prepared, validation: &Prepared) {
        self.all.after = of_runs(train, validation, false);
        self.quiet.after = of_runs(train, validation, true);
    }
}

/// Mean of the references, and the limit.
fn limits(energies: &[f64], inflation: f64) -> (f64, f64) {
    let n = energies.len() as f64;
    let mean = energies.iter().sum::<f64>() / n;
    let variance = energies.iter().map(|e| (e - mean) * (e - mean)).sum::<f64>() / (n - 1.0).max(1.0);
    let sigma = variance.sqrt().max(LEAST_SCATTER * mean);
    (mean, (mean + CHANCE * sigma * inflation.sqrt()).max(NO_GAP))
}

fn of_runs(train: &Prepared, validation: &Prepared, is_quiet: bool) -> f64 {
    let of = |side: &Prepared| energies(&side.metric, &side.records, &side.residuals, is_quiet);
    let mut runs = of(train);
    runs.extend(of(validation));
    runs.iter().sum::<f64>() / runs.len().max(1) as f64
}

fn energies(metric: &Metric, records: &[Record], residuals: &[Vec<f64>], is_quiet: bool) -> Vec<f64> {
    let runs = records.iter().zip(residuals).enumerate();
    runs.map(|(run, (record, residual))| {
        let expected = metric.expected(run).max(1.0);
        if is_quiet {
            quieter(window_energies(metric, run, record, residual)) / expected
        } else {
            metric.gram_of_run(run, &[residual]).at(0, 0) / expected
        }
    })
    .collect()
}

/// Energy of a run whose loudest windows were like the others.
fn quieter(mut windows: Vec<f64>) -> f64 {
    let all = windows.len();
    windows.sort_by(f64::total_cmp);
    windows.truncate(all - (LOUDEST * all as f64).ceil().min(all.saturating_sub(1) as f64) as usize);
    windows.iter().sum::<f64>() * all as f64 / windows.len().max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_loud_window_of_ten_is_none_of_the_quieter_ones() {
        let mut windows = vec![2.0; 9];
        windows.push(5000.0);
        assert!((quieter(windows) - 20.0).abs() < 1e-9);
        assert!((quieter(vec![3.0]) - 3.0).abs() < 1e-9, "a single window stays");
        assert!(quieter(Vec::new()).abs() < 1e-9);
    }

    #[test]
    fn references_alike_are_given_a_scatter() {
        let (mean, limit) = limits(&[2.0; 4], 1.0);
        assert!((mean - 2.0).abs() < 1e-9 && (limit - 3.5).abs() < 1e-9, "{limit}");
        assert!((limits(&[0.2; 4], 1.0).1 - NO_GAP).abs() < 1e-9);
    }

    #[test]
    fn what_is_left_is_a_share_of_the_excess() {
        let energy = Energy {
            before: 5.0,
            after: 2.0,
            floor: 1.0,
            limit: 1.5,
        };
        assert!((energy.left() - 0.25).abs() < 1e-9);
    }
}
