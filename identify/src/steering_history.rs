//! How the steering of a run came to where it is.

use twin::reversals::Reversals;

use crate::bundle::Bundle;
use crate::channel::Channel;

/// Samples of the steering are averaged over this long, so that its noise makes no turning points, s.
const SMOOTHED_S: f64 = 0.04;

/// The measured steering angle of a run, or without it the one that was asked for, smoothed.
#[derive(Debug, Clone, Default)]
pub struct SteeringHistory {
    time_s: Vec<f64>,
    angle_rad: Vec<f64>,
}

impl SteeringHistory {
    /// Empty for robots without steering.
    pub fn of(bundle: &Bundle) -> SteeringHistory {
        let telemetry = &bundle.telemetry;
        let channels = [Channel::Steering, Channel::CommandSteering];
        let series = channels.iter().find_map(|channel| telemetry.series(*channel));
        let Some(series) = series.filter(|_| bundle.run.robot.steering.is_some()) else {
            return SteeringHistory::default();
        };
        let stamps = series.rows.iter().map(|row| telemetry.time_s[*row as usize]);
        let time_s: Vec<f64> = stamps.collect();
        SteeringHistory {
            angle_rad: smoothed(&time_s, &series.values),
            time_s,
        }
    }

    /// Turning points up to a time of the bundle's clock.
    ///
    /// - Times that grow cost one pass over the run: keep the [`Walk`].
    pub fn walk(&self) -> Walk<'_> {
        Walk {
            history: self,
            next: 0,
            reversals: Reversals::default(),
        }
    }
}

/// A pass over the steering of a run.
#[derive(Debug, Clone)]
pub struct Walk<'a> {
    history: &'a SteeringHistory,
    next: usize,
    reversals: Reversals,
}

impl Walk<'_> {
    /// What is known at a time, not before the one asked for last.
    pub fn until(&mut self, time_s: f64) -> Reversals {
        let history = self.history;
        while history.time_s.get(self.next).is_some_and(|t| *t <= time_s) {
            self.reversals.push(history.angle_rad[self.next]);
            self.next += 1;
        }
        self.reversals
    }
}

/// Means over [`SMOOTHED_S`] around every sample.
fn smoothed(time_s: &[f64], values: &[f64]) -> Vec<f64> {
    let (mut from, mut to, mut sum) = (0, 0, 0.0);
    let mut means = Vec::with_capacity(values.len());
    for centre_s in time_s {
        while to < values.len() && time_s[to] <= centre_s + 0.5 * SMOOTHED_S {
            sum += values[to];
            to += 1;
        }
        while time_s[from] < centre_s - 0.5 * SMOOTHED_S {
            sum -= values[from];
            from += 1;
        }
        means.push(sum / (to - from) as f64);
    }
    means
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn means_are_of_the_samples_around() {
        let time_s: Vec<f64> = (0..5).map(|k| 0.02 * f64::from(k)).collect();
        let means = smoothed(&time_s, &[0.0, 3.0, 6.0, 3.0, 12.0]);
        assert_eq!(means, [1.5, 3.0, 4.0, 7.0, 7.5]);
    }

    #[test]
    fn a_walk_ends_where_a_walk_begun_anew_does() {
        let angles: Vec<f64> = (0..200).map(|k| 0.3 * libm::sin(0.09 * f64::from(k))).collect();
        let time_s: Vec<f64> = (0..200).map(|k| 0.01 * f64::from(k)).collect();
        let history = SteeringHistory {
            time_s,
            angle_rad: angles,
        };
        let mut walk = history.walk();
        for at_s in [0.1, 0.35, 0.9, 1.7] {
            assert_eq!(walk.until(at_s), history.walk().until(at_s));
        }
        assert_eq!(history.walk().until(-1.0), Reversals::default());
        // The play of 0.2 rad half is dragged to the near side of the last crest.
        let dragged = history.walk().until(0.35).dragged_rad(0.2).expect("angles are known");
        assert!((dragged - (0.3 - 0.2)).abs() < 0.01, "{dragged}");
    }
}
