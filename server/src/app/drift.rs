//! Whether a robot has moved away from its model: its newest runs against its runs before.

use api::model::{Drift, RunGap};

/// Newest runs that must agree.
const NEWEST: usize = 3;
/// Runs before them: fewest, and most that count.
const BEFORE_LEAST: usize = 4;
const BEFORE_MOST: usize = 20;
/// An alarm from here on.
const FACTOR: f64 = 2.0;
/// Smaller gaps than this are the cameras', not the robot's, m.
const SMALLEST_M: f64 = 0.002;

/// An alarm when the median gap of the newest three runs is at least twice that of the runs before.
///
/// - `runs`: newest first, against one model; those without a gap are passed over.
/// - `horizon_s`: of the gaps that are compared.
pub fn drift(runs: &[RunGap], horizon_s: f64) -> Option<Drift> {
    let at = |run: &RunGap| {
        let found = run
            .horizons
            .iter()
            .find(|gap| gap.horizon_s == horizon_s && gap.samples > 0);
        found.map(|gap| gap.position_m)
    };
    let known: Vec<(&RunGap, f64)> = runs.iter().filter_map(|run| Some((run, at(run)?))).collect();
    let (newest, before) = known.split_at_checked(NEWEST)?;
    let before = &before[..before.len().min(BEFORE_MOST)];
    if before.len() < BEFORE_LEAST {
        return None;
    }
    let [newest_m, before_m] = [newest, before].map(median_m);
    if newest_m < FACTOR * before_m.max(SMALLEST_M) {
        return None;
    }
    // The first of the newest runs in a row that are that far off.
    let limit_m = FACTOR * before_m.max(SMALLEST_M);
    let first = known.iter().take_while(|(_, gap_m)| *gap_m >= limit_m).last();
    Some(Drift {
        since: first.or(newest.last()).and_then(|(run, _)| run.ended_at),
        newest_m,
        before_m,
        factor: newest_m / before_m.max(f64::MIN_POSITIVE),
    })
}

fn median_m(runs: &[(&RunGap, f64)]) -> f64 {
    let mut gaps_m: Vec<f64> = runs.iter().map(|(_, gap_m)| *gap_m).collect();
    gaps_m.sort_unstable_by(f64::total_cmp);
    gaps_m.get(gaps_m.len() / 2).copied().unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;
    use api::model::HorizonGap;
    use uuid::Uuid;

    const HORIZON_S: f64 = 2.0;

    /// Newest first; the n-th before now ended n hours earlier. None: no gap.
    fn runs(gaps_m: &[Option<f64>]) -> Vec<RunGap> {
        let now: chrono::DateTime<chrono::Utc> = "2026-03-01T12:00:00Z".parse().expect("a date");
        let gap = |position_m: &f64| HorizonGap {
            horizon_s: HORIZON_S,
            position_m: *position_m,
            yaw_rad: 0.0,
            samples: 9,
        };
        let run = |(place, gap_m): (usize, &Option<f64>)| RunGap {
            run: Uuid::from_u128(place as u128),
            label: String::new(),
            submitted_by: String::new(),
            ended_at: Some(now - chrono::TimeDelta::hours(place as i64)),
            is_reference: false,
            horizons: gap_m.iter().map(gap).collect(),
            problem: None,
        };
        gaps_m.iter().enumerate().map(run).collect()
    }

    #[test]
    fn three_runs_at_twice_the_median_are_a_drift_since_the_first_of_them() {
        let mut gaps_m = vec![Some(0.025), None, Some(0.021), Some(0.030)];
        gaps_m.extend([0.010, 0.011, 0.009, 0.010, 0.2].map(Some));
        let alarm = drift(&runs(&gaps_m), HORIZON_S).expect("an alarm");
        assert_eq!((alarm.newest_m, alarm.before_m), (0.025, 0.010));
        assert!((alarm.factor - 2.5).abs() < 1e-12);
        assert_eq!(alarm.since.expect("a date").to_rfc3339(), "2026-03-01T09:00:00+00:00");
    }

    #[test]
    fn one_bad_run_a_short_history_and_small_gaps_are_none() {
        let one = [0.05, 0.010, 0.011, 0.010, 0.011, 0.009, 0.010].map(Some);
        assert_eq!(drift(&runs(&one), HORIZON_S), None);
        let short = [0.05, 0.05, 0.05, 0.010, 0.011, 0.009].map(Some);
        assert_eq!(drift(&runs(&short), HORIZON_S), None);
        let small = [0.003, 0.003, 0.003, 0.0005, 0.0004, 0.0005, 0.0005].map(Some);
        assert_eq!(drift(&runs(&small), HORIZON_S), None);
        assert_eq!(drift(&runs(&[None, None]), HORIZON_S), None);
        assert_eq!(
            drift(&runs(&[0.05, 0.05, 0.05, 0.010, 0.011, 0.009, 0.01].map(Some)), 5.0),
            None
        );
    }
}
