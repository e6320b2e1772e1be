//! Parts of a run over which everything follows from what was before.

use crate::anchor::Track;
use crate::bundle::{Bundle, LONG_PAUSE_S};

/// Periods of the rows that are a pause where rows are rare.
const PAUSE_PERIODS: f64 = 5.0;

/// A part of a run without a pause of the rows and without a break of the tracker, both ends in the robot's time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stretch {
    pub from_s: f64,
    pub to_s: f64,
}

impl Stretch {
    /// All of a run, in order, from its first pose on (its first row without poses).
    pub fn of(bundle: &Bundle, track: &Track) -> Vec<Stretch> {
        let times = &bundle.telemetry.time_s;
        let first_s = track.time_s.first().or(times.first()).copied().unwrap_or(0.0);
        Stretch::between(times, first_s, &track.breaks())
    }

    /// - `times`: of the rows, s.
    /// - `breaks`: times at which a new one begins, s, growing.
    fn between(times: &[f64], first_s: f64, breaks: &[f64]) -> Vec<Stretch> {
        let mut periods: Vec<f64> = times.windows(2).map(|pair| pair[1] - pair[0]).collect();
        periods.sort_by(f64::total_cmp);
        let period_s = periods.get(periods.len() / 2).copied().unwrap_or(0.0);
        let pause_s = LONG_PAUSE_S.max(PAUSE_PERIODS * period_s);
        let mut stretches: Vec<Stretch> = Vec::new();
        let mut next = 0;
        for time_s in times.iter().copied().filter(|t| *t >= first_s) {
            let mut broken = false;
            while next < breaks.len() && breaks[next] <= time_s {
                broken = true;
                next += 1;
            }
            match stretches.last_mut() {
                Some(last) if time_s - last.to_s <= pause_s && !broken => last.to_s = time_s,
                _ => stretches.push(Stretch {
                    from_s: time_s,
                    to_s: time_s,
                }),
            }
        }
        stretches
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_that_pause_and_a_tracker_that_breaks_end_a_stretch() {
        let times: Vec<f64> = (0..100)
            .map(|k| 0.1 * f64::from(k))
            .filter(|t| !(3.05..4.05).contains(t))
            .collect();
        let ends = |breaks: &[f64]| -> Vec<(f64, f64)> {
            let stretches = Stretch::between(&times, 0.45, breaks);
            let tenths = |s: f64| (10.0 * s).round() / 10.0;
            stretches.iter().map(|s| (tenths(s.from_s), tenths(s.to_s))).collect()
        };
        assert_eq!(ends(&[]), [(0.5, 3.0), (4.1, 9.9)]);
        assert_eq!(ends(&[6.95]), [(0.5, 3.0), (4.1, 6.9), (7.0, 9.9)]);
        assert_eq!(
            ends(&[0.2, 3.5]),
            [(0.5, 3.0), (4.1, 9.9)],
            "breaks before the first pose and within a pause"
        );
    }
}
