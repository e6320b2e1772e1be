//! The paper's path, an L out and back, on any robot of the laboratory: the experiment of the drills, with their settings.

use crate::state::Template;
use api::experiment::Experiment;
use api::robot::LabRobot;
use serde::Deserialize;
use std::collections::BTreeMap;

/// Metres of one of the paper's pixels.
pub const PIXEL_M: f64 = 0.0025;
/// The choice that was committed before any plant was driven: the best of a published grid on the nominal twin.
const SETTINGS: &str = include_str!("../../drills/src/abc/settings.json");

/// Gains, speed and start of a chassis.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
struct Setting {
    speed_m_per_s: f64,
    distance_gain_per_s: f64,
    integral_gain_per_s2: f64,
    derivative_gain: f64,
    yaw_gain_per_s: f64,
    /// From the direction in which the path begins; a car-like robot begins along it.
    start_yaw_rad: f64,
}

fn setting(chassis: &str) -> Option<Setting> {
    let settings: BTreeMap<String, Setting> =
        serde_json::from_str(SETTINGS).expect("embedded settings are valid; a test reads them");
    settings.get(chassis).cloned()
}

/// A robot can drive the path with published settings.
pub fn has_settings(chassis: &str) -> bool {
    setting(chassis).is_some()
}

/// The template's experiment with this robot in place of its own; a chassis without settings keeps those of the template.
pub fn on(robot: &LabRobot) -> Experiment {
    let mut experiment = Template::PaperPath.experiment();
    let first_yaw_rad = first_yaw_rad(&experiment);
    if let Some(setting) = setting(&robot.description.chassis) {
        experiment.control.parameters = serde_json::json!({
            "speed_m_per_s": setting.speed_m_per_s,
            "distance_gain_per_s": setting.distance_gain_per_s,
            "integral_gain_per_s2": setting.integral_gain_per_s2,
            "derivative_gain": setting.derivative_gain,
            "yaw_gain_per_s": setting.yaw_gain_per_s,
        });
        if let Some(own) = experiment.robots.first_mut() {
            own.start.yaw_rad = first_yaw_rad + setting.start_yaw_rad;
        }
    }
    if let Some(own) = experiment.robots.first_mut() {
        own.name.clone_from(&robot.description.name);
        own.chassis.clone_from(&robot.description.chassis);
        own.controller.clone_from(&robot.controller);
    }
    experiment
}

/// Direction in which the path begins.
fn first_yaw_rad(experiment: &Experiment) -> f64 {
    let start = experiment.robots.first().map(|robot| robot.start);
    let ends = start.zip(experiment.targets.first());
    ends.map_or(0.0, |(from, to)| (to.y_m - from.y_m).atan2(to.x_m - from.x_m))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::state::{Clock, State};
    use uuid::Uuid;

    fn reference() -> Vec<LabRobot> {
        let clock = Clock {
            time_s: 0.0,
            utc: chrono::DateTime::UNIX_EPOCH,
        };
        State::new(Uuid::nil(), clock, false).lab.reference.robots
    }

    #[test]
    fn the_template_is_the_omni_robots_own() {
        let robots = reference();
        assert_eq!(on(&robots[0]), Template::PaperPath.experiment());
    }

    #[test]
    fn the_corners_are_the_papers_pixels() {
        let experiment = Template::PaperPath.experiment();
        let start = experiment.robots[0].start;
        let mut corners = vec![[start.x_m, start.y_m]];
        corners.extend(experiment.targets.iter().map(|target| [target.x_m, target.y_m]));
        let paper = [[500, 500], [500, 900], [1300, 900], [500, 900], [500, 500]];
        let pixels = corners
            .iter()
            .map(|[x_m, y_m]| [(x_m + 2.25) / PIXEL_M, (y_m + 1.75) / PIXEL_M].map(|px| px.round() as i64));
        assert_eq!(pixels.collect::<Vec<_>>(), paper);
    }

    #[test]
    fn every_chassis_of_the_laboratory_has_settings_and_a_sound_experiment() {
        let clock = Clock {
            time_s: 0.0,
            utc: chrono::DateTime::UNIX_EPOCH,
        };
        let lab = State::new(Uuid::nil(), clock, false).lab;
        for robot in reference() {
            assert!(
                has_settings(&robot.description.chassis),
                "{}",
                robot.description.chassis
            );
            let text = crate::scenario::scenario_json(&on(&robot), &lab).expect("known");
            let scenario = control::scenario::Scenario::from_json(&text);
            assert!(scenario.is_ok(), "{}: {scenario:?}", robot.description.name);
        }
    }
}
