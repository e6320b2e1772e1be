//! How the steering of a run came to where it is.

use twin::reversals::Reversals;

use crate::bundle::Bundle;
use crate::channel::Channel;
use crate::record::{Line, smoothed};

/// The measured steering angle of a run without most of its noise, which would make turning points; where it was not measured, the
/// one that was asked for.
#[derive(Debug, Clone, Default)]
pub struct SteeringHistory {
    angle_rad: Line,
}

impl SteeringHistory {
    /// Empty for robots without steering.
    pub fn of(bundle: &Bundle) -> SteeringHistory {
        if bundle.run.robot.steering.is_none() {
            return SteeringHistory::default();
        }
        let measured = Line::of(bundle, Channel::Steering).map(|line| smoothed(&line));
        SteeringHistory {
            angle_rad: measured
                .or_else(|| Line::of(bundle, Channel::CommandSteering))
                .unwrap_or_default(),
        }
    }

    /// A pass over the run, from its beginning.
    pub fn walk(&self) -> Walk<'_> {
        Walk {
            angle_rad: &self.angle_rad,
            next: 0,
            reversals: Reversals::default(),
        }
    }
}

/// A pass over the steering of a run: times grow from call to call.
#[derive(Debug, Clone)]
pub struct Walk<'a> {
    angle_rad: &'a Line,
    next: usize,
    reversals: Reversals,
}

impl Walk<'_> {
    /// Turning points up to a time of the run's clock.
    pub fn until(&mut self, time_s: f64) -> Reversals {
        let line = self.angle_rad;
        while line.time_s.get(self.next).is_some_and(|t| *t <= time_s) {
            self.reversals.push(line.values[self.next]);
            self.next += 1;
        }
        self.reversals
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_walk_ends_where_a_walk_begun_anew_does() {
        let history = SteeringHistory {
            angle_rad: Line {
                time_s: (0..200).map(|k| 0.01 * f64::from(k)).collect(),
                values: (0..200).map(|k| 0.3 * libm::sin(0.09 * f64::from(k))).collect(),
            },
        };
        let mut walk = history.walk();
        for at_s in [0.1, 0.35, 0.9, 1.7] {
            assert_eq!(walk.until(at_s), history.walk().until(at_s));
        }
        assert_eq!(history.walk().until(-1.0), Reversals::default());
        // A play of 0.2 rad to each side is dragged behind the last crest.
        let dragged = history.walk().until(0.35).dragged_rad(0.2).expect("angles are known");
        assert!((dragged - (0.3 - 0.2)).abs() < 0.01, "{dragged}");
    }
}
