//! What the size of a named effect goes with: a law of another kind, imitated, asks for another size where the robot is driven otherwise.
//!
//! A score test of a size that is 1 + b z of itself, z being a state variable; its variance is that between windows ("sandwich":
//! White, A heteroskedasticity-consistent covariance matrix estimator, 1980), so that it knows no noise.

use super::evenness::FEWEST;
use crate::floor::Metric;
use crate::locate::{VARIABLES, Variable};
use crate::record::Record;

/// A slope counts from this share of the size per standard deviation of the variable, and when chance gives one like it for one variable in a hundred
/// and fifty (chi-squared of one): six are asked.
const STEEP: f64 = 0.1;
const SURE: f64 = 7.4;
/// By itself, where windows do not differ by much, it keeps a name from being confirmed when chance gives one like it for one variable in four hundred, which is
/// one name in sixty, from a smaller slope on.
const STEEP_ALONE: f64 = 0.075;
const SURE_ALONE: f64 = 9.0;

/// How a size goes with a state variable.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Trend {
    /// Position in [`VARIABLES`]; its magnitude counts, whichever the direction.
    pub variable: usize,
    /// Change of the size for one standard deviation of the variable, as a share of the size.
    pub slope: f64,
    /// Chi-squared of one.
    pub surprise: f64,
}

impl Trend {
    /// Enough by itself, whatever else the size differs by.
    pub fn is_sure(&self) -> bool {
        self.slope.abs() >= STEEP_ALONE && self.surprise >= SURE_ALONE
    }

    /// Worth a word where the size differs from window to window for sure.
    fn is_told(&self) -> bool {
        self.slope.abs() >= STEEP && self.surprise >= SURE
    }

    pub fn words(&self) -> String {
        let (_, variable, _) = VARIABLES[self.variable];
        let grows = if self.slope > 0.0 { "grows" } else { "falls" };
        format!("{grows} with the {variable}")
    }
}

/// One residual: what the effect changes there, what is left with it, and the state.
#[derive(Debug, Clone, Copy)]
struct Point {
    change: f64,
    left: f64,
    state: [f64; VARIABLES.len()],
}

/// The variable that the size goes with most surely; `None` when it goes with none.
///
/// - `states`: of every residual, per run ([`crate::locate::states`]).
/// - `changes`: what the effect changes of the residuals, per run.
/// - `residuals`: what is left with the effect.
pub(super) fn trend(
    metric: &Metric,
    records: &[Record],
    states: &[Vec<[f64; VARIABLES.len()]>],
    changes: &[Vec<f64>],
    residuals: &[Vec<f64>],
) -> Option<Trend> {
    let mut windows: Vec<Vec<Point>> = Vec::new();
    for (run, record) in records.iter().enumerate() {
        let change = metric.rest(run, &changes[run]);
        let left = metric.rest(run, &residuals[run]);
        for cells in record.cells_of_windows() {
            let points = cells.map(|cell| Point {
                change: change[cell],
                left: left[cell],
                state: states[run][cell],
            });
            windows.push(points.collect());
        }
    }
    steepest(&windows)
}

fn steepest(windows: &[Vec<Point>]) -> Option<Trend> {
    let points = || windows.iter().flatten();
    let evidence: f64 = points().map(|point| point.change * point.change).sum();
    if windows.len() < FEWEST || evidence <= 0.0 {
        return None;
    }
    let mean_size = points().map(|point| point.change * point.left).sum::<f64>() / evidence;
    let mut best: Option<Trend> = None;
    for (variable, (kind, _, _)) in VARIABLES.iter().enumerate() {
        if *kind == Variable::Heading {
            continue;
        }
        let value = |point: &Point| point.state[variable].abs();
        let weighed = |of: &dyn Fn(f64) -> f64| {
            let sum: f64 = points()
                .map(|point| point.change * point.change * of(value(point)))
                .sum();
            sum / evidence
        };
        let mean = weighed(&|value| value);
        let deviation = weighed(&|value| (value - mean) * (value - mean)).sqrt();
        if deviation <= 1e-6 * (1.0 + mean.abs()) {
            continue;
        }
        let score = |point: &Point| {
            let along = point.change * (point.left - mean_size * point.change);
            along * (value(point) - mean) / deviation
        };
        let of_windows: Vec<f64> = windows.iter().map(|window| window.iter().map(score).sum()).collect();
        let sum: f64 = of_windows.iter().sum();
        let variance: f64 = of_windows.iter().map(|score| score * score).sum();
        let slope = sum / evidence;
        let surprise = sum * sum / variance.max(1e-300);
        let found = Trend {
            variable,
            slope,
            surprise,
        };
        let is_more = best.is_none_or(|best| surprise > best.surprise);
        if (found.is_told() || found.is_sure()) && is_more {
            best = Some(found);
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    const FORWARD: usize = 0;
    const ELAPSED: usize = 5;

    /// Windows of forty residuals each at a speed of its own, in which the size is `1 + size(speed)` of itself.
    fn windows(size: impl Fn(f64) -> f64) -> Vec<Vec<Point>> {
        so_many_windows(80, size)
    }

    fn so_many_windows(count: usize, size: impl Fn(f64) -> f64) -> Vec<Vec<Point>> {
        let mut random = Random::new(7, 3);
        let window = |number: usize| -> Vec<Point> {
            let speed = 0.1 * (1.0 + (number % 10) as f64);
            let point = |_| {
                let change = 0.5 * random.normal();
                let mut state = [0.0; VARIABLES.len()];
                (state[FORWARD], state[ELAPSED]) = (-speed, number as f64);
                Point {
                    change,
                    left: size(speed) * change + random.normal(),
                    state,
                }
            };
            (0..40).map(point).collect()
        };
        (0..count).map(window).collect::<Vec<_>>()
    }

    #[test]
    fn a_size_that_goes_with_speed_is_told_with_its_direction() {
        for (sign, words) in [
            (1.0, "grows with the commanded forward speed"),
            (-1.0, "falls with the commanded forward speed"),
        ] {
            let found = steepest(&windows(|speed| sign * (speed - 0.55))).expect("a trend");
            assert_eq!((found.variable, found.words().as_str()), (FORWARD, words));
            assert!((found.slope.abs() - 0.287).abs() < 0.08, "{found:?}");
        }
    }

    #[test]
    fn a_size_that_is_the_same_everywhere_goes_with_nothing() {
        let gentle = steepest(&so_many_windows(320, |speed| 0.3 * (speed - 0.55))).expect("a gentle trend");
        assert!(gentle.is_sure() && !gentle.is_told(), "{gentle:?}");
        assert_eq!(steepest(&windows(|_| 0.0)), None);
        assert_eq!(steepest(&windows(|_| 0.4)), None, "another size is no trend");
        assert_eq!(steepest(&windows(|speed| speed)[..FEWEST - 1]), None, "too few windows");
        assert_eq!(steepest(&[]), None);
    }

    #[test]
    fn a_gentle_trend_counts_by_itself_when_it_is_no_chance() {
        let trend = |slope: f64, surprise: f64| Trend {
            variable: FORWARD,
            slope,
            surprise,
        };
        assert!(trend(-0.08, 9.5).is_sure());
        assert!(
            !trend(0.3, 7.5).is_sure() && trend(0.3, 7.5).is_told(),
            "a word beside a doubt"
        );
        assert!(!trend(0.02, 50.0).is_sure(), "real laws are off by as much");
    }
}
