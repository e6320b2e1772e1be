//! How well a recorded run kept to its path: figures, the error over time, the trail.

use crate::course::Course;
use crate::error_measure::BAND_M;
use api::verdict::ReplayRobot;
use control::TICK_RATE_HZ;
use control::ideal::Ideal;

/// Figures of a run along a path.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Figures {
    /// Root of the mean squared distance to the active part of the path, m.
    pub rms_m: f64,
    pub largest_m: f64,
    /// Share of the time further away than the band is wide on one side.
    pub outside: f64,
    pub seconds: f64,
    /// Came onto the last part of the path.
    pub finished: bool,
    /// RMS distance from the ideal robot under the same law at the same time, m, a constant delay taken out; none for laws that an
    /// ideal robot cannot be driven with.
    pub time_rms_m: Option<f64>,
}

impl Figures {
    /// Inside the band all the time, to the end of the path.
    pub fn inside(&self) -> bool {
        self.finished && self.outside == 0.0
    }
}

/// What is shown of a run along a path.
#[derive(Debug, Clone, PartialEq)]
pub struct Tracking {
    pub figures: Figures,
    /// `[time_s, metres]`.
    pub errors: Vec<[f64; 2]>,
    /// Where the robot was, m.
    pub trail: Vec<[f64; 2]>,
}

impl Tracking {
    /// - `recorded`: as measured; `period_s` from one pose to the next.
    /// - `None`: nothing was recorded.
    pub fn new(course: &Course, ideal: Option<&Ideal>, recorded: &ReplayRobot, period_s: f64) -> Option<Self> {
        if recorded.poses.is_empty() {
            return None;
        }
        let trail: Vec<[f64; 2]> = recorded.poses.iter().map(|pose| [pose[0], pose[1]]).collect();
        let (errors_m, finished) = course.errors_m(trail.iter().copied());
        let count = errors_m.len() as f64;
        let squares: f64 = errors_m.iter().map(|error_m| error_m * error_m).sum();
        let ticks_apart = (period_s * f64::from(TICK_RATE_HZ)).round().max(1.0) as usize;
        let figures = Figures {
            rms_m: (squares / count).sqrt(),
            largest_m: errors_m.iter().copied().fold(0.0, f64::max),
            outside: errors_m.iter().filter(|error_m| **error_m > BAND_M).count() as f64 / count,
            seconds: count * period_s,
            finished,
            time_rms_m: ideal.map(|ideal| ideal.time_rms_m(&recorded.poses, ticks_apart)),
        };
        let moments = errors_m.into_iter().enumerate();
        Some(Self {
            figures,
            errors: moments
                .map(|(frame, error_m)| [frame as f64 * period_s, error_m])
                .collect(),
            trail,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::course::courses;
    use crate::state::{Clock, State, Template};
    use uuid::Uuid;

    fn course() -> Course {
        let clock = Clock {
            time_s: 0.0,
            utc: chrono::DateTime::UNIX_EPOCH,
        };
        let lab = State::new(Uuid::nil(), clock, false).lab;
        courses(&Template::PaperPath.experiment(), &lab)
            .remove(0)
            .expect("the template has a way")
    }

    /// Along the whole path, this far to its left.
    fn beside(left_m: f64) -> ReplayRobot {
        let corners = course().line;
        let mut poses = Vec::new();
        for leg in corners.windows(2) {
            let length_m = crate::error_measure::distance(leg[0], leg[1]);
            let along = [(leg[1][0] - leg[0][0]) / length_m, (leg[1][1] - leg[0][1]) / length_m];
            for step in 0..=100 {
                let at_m = length_m * f64::from(step) / 100.0;
                poses.push([
                    leg[0][0] + along[0] * at_m - along[1] * left_m,
                    leg[0][1] + along[1] * at_m + along[0] * left_m,
                    0.0,
                ]);
            }
        }
        ReplayRobot {
            name: "omni-01".to_owned(),
            poses,
            targets: Vec::new(),
        }
    }

    #[test]
    fn a_robot_beside_its_path_is_that_far_away_and_inside_or_outside_the_band() {
        let near = Tracking::new(&course(), None, &beside(0.02), 0.033)
            .expect("recorded")
            .figures;
        assert!((near.rms_m - 0.02).abs() < 0.002, "{near:?}");
        assert!(near.inside() && near.time_rms_m.is_none());
        let far = Tracking::new(&course(), None, &beside(0.1), 0.033)
            .expect("recorded")
            .figures;
        assert!(far.outside > 0.9 && !far.inside(), "{far:?}");
    }

    #[test]
    fn half_of_the_path_is_not_the_path() {
        let mut half = beside(0.0);
        half.poses.truncate(150);
        let found = Tracking::new(&course(), None, &half, 0.033).expect("recorded");
        assert!(!found.figures.finished && !found.figures.inside());
        half.poses.clear();
        assert_eq!(Tracking::new(&course(), None, &half, 0.033), None);
    }
}
