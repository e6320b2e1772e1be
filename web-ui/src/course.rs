//! The way along which an experiment leads each of its robots, and how far a robot is from it.

use crate::error_measure::{path, path_errors_m};
use crate::scenario::scenario_json;
use crate::state::Lab;
use api::experiment::Experiment;
use control::law::PATH_FOLLOWING;
use control::path_error::PathError;
use control::scenario::Scenario;

/// Points closer than this are one point of the line.
const SAME_M: f64 = 1e-6;

/// A robot's way.
#[derive(Debug, Clone)]
pub struct Course {
    /// From start to end, m; arcs as short straight parts.
    pub line: Vec<[f64; 2]>,
    measure: Measure,
}

/// How the distance to the active part is found.
#[derive(Debug, Clone)]
enum Measure {
    /// Of `waypoints`: straight legs, a search ahead of the progress made.
    Legs,
    /// Of `path_following`: straight lines and arcs, one active at a time; the measure of the drills.
    Pieces(PathError),
}

impl Course {
    /// Distance of each position to the part of the way that is active then, m, and whether the last part became active.
    pub fn errors_m(&self, positions: impl Iterator<Item = [f64; 2]>) -> (Vec<f64>, bool) {
        match &self.measure {
            Measure::Legs => {
                let positions: Vec<[f64; 2]> = positions.collect();
                let last = positions.last().copied();
                let errors = path_errors_m(&self.line, positions.into_iter());
                // Whoever left out a leg is far from the way at the end.
                let is_there = last.zip(self.line.last()).is_some_and(|(here, end)| {
                    crate::error_measure::distance(here, *end) < crate::error_measure::BAND_M
                        && errors
                            .last()
                            .is_some_and(|error_m| *error_m < crate::error_measure::BAND_M)
                });
                (errors, is_there)
            }
            Measure::Pieces(measure) => {
                let mut measure = measure.clone();
                let errors = positions.map(|here| measure.at(here)).collect();
                (errors, measure.is_last())
            }
        }
    }
}

/// Ways of all robots, in the order of the experiment; `None` for robots that have none, and where the law leads along none.
pub fn courses(experiment: &Experiment, lab: &Lab) -> Vec<Option<Course>> {
    let count = experiment.robots.len();
    if experiment.control.law == PATH_FOLLOWING {
        let Some(scenario) = scenario_of(experiment, lab) else {
            return vec![None; count];
        };
        return (0..count).map(|robot| of_pieces(&scenario, robot)).collect();
    }
    let legs = |robot| {
        path(experiment, robot).map(|line| Course {
            line,
            measure: Measure::Legs,
        })
    };
    (0..count).map(legs).collect()
}

/// The experiment as the control laws take it; `None` while the laboratory does not know its robots.
pub fn scenario_of(experiment: &Experiment, lab: &Lab) -> Option<Scenario> {
    Scenario::parse(&scenario_json(experiment, lab).ok()?).ok()
}

fn of_pieces(scenario: &Scenario, robot: usize) -> Option<Course> {
    let measure = PathError::new(&control::law::path(scenario, robot));
    let mut line: Vec<[f64; 2]> = Vec::new();
    for point in measure.lines().iter().flatten() {
        let is_new = |last: &[f64; 2]| crate::error_measure::distance(*last, *point) > SAME_M;
        if line.last().is_none_or(is_new) {
            line.push(*point);
        }
    }
    (line.len() > 1).then_some(Course {
        line,
        measure: Measure::Pieces(measure),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::paper_path;
    use crate::state::{Clock, State, Template};
    use uuid::Uuid;

    fn lab() -> Lab {
        let clock = Clock {
            time_s: 0.0,
            utc: chrono::DateTime::UNIX_EPOCH,
        };
        State::new(Uuid::nil(), clock, false).lab
    }

    fn of(robot: &str) -> Course {
        let lab = lab();
        let experiment = paper_path::on(lab.robot(robot).expect("of the reference laboratory"));
        courses(&experiment, &lab).remove(0).expect("a way")
    }

    #[test]
    fn a_robot_that_turns_drives_the_corners_and_a_car_arcs() {
        let corners = [[-1.0, -0.5], [-1.0, 0.5], [1.0, 0.5], [-1.0, 0.5], [-1.0, -0.5]];
        let straight = of("omni-01").line;
        assert_eq!(straight.len(), corners.len());
        assert!(
            straight
                .iter()
                .zip(corners)
                .all(|(a, b)| crate::error_measure::distance(*a, b) < 1e-9)
        );
        let round = of("fwd-01");
        let from_corner = round
            .line
            .iter()
            .map(|at| crate::error_measure::distance(*at, [-1.0, 0.5]));
        let nearest_m = from_corner.fold(f64::INFINITY, f64::min);
        assert!(nearest_m > 0.05, "an arc leaves the corner out: {nearest_m} m");
        let (errors, ended) = round.errors_m(round.line.iter().copied());
        assert!(ended && errors.iter().all(|error_m| *error_m < 1e-6));
    }

    #[test]
    fn whoever_stays_on_the_way_out_does_not_come_to_the_end() {
        let course = of("omni-01");
        let (errors, ended) = course.errors_m((0..=100).map(|n| [-1.0, -0.5 + 0.01 * f64::from(n)]));
        assert!(!ended && errors.iter().all(|error_m| *error_m < 1e-9));
        // Straight back after the first corner: the long legs are missing, so it is ever further from the active one.
        let short = (0..=100).map(|n| [-1.0, -0.5 + 0.01 * f64::from(n)]);
        let back = (0..=100).rev().map(|n| [-1.0, -0.5 + 0.01 * f64::from(n)]);
        let (errors, ended) = course.errors_m(short.chain(back));
        assert!(!ended && (errors.last().copied().unwrap_or_default() - 1.0).abs() < 1e-9);
    }

    #[test]
    fn laws_without_a_path_have_none() {
        let found = courses(&Template::SwapCorners.experiment(), &lab());
        assert!(found.len() == 4 && found.iter().all(Option::is_none));
    }
}
