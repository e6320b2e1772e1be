//! What is driven: the paper's L, and paths that nobody trained on.

use crate::{Scene, SceneRobot};
use anyhow::{Context, Result};
use control::law::{Piece, path};
use control::scenario::Scenario;
use serde_json::{Value, json};

/// Metres of a pixel of the paper, and the arena's origin in its picture.
const PIXEL_M: f64 = 0.0025;
const ORIGIN_M: [f64; 2] = [-2.25, -1.75];
/// Longest run.
const LONGEST_S: f64 = 90.0;

/// A path through corners in the paper's pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Course {
    /// The paper's: an L out and back.
    L,
    /// For learning: a zigzag out and back.
    Zigzag,
    /// For learning: bends of 45 to 70 degrees, out and back; a robot that keeps its heading drives in other directions than
    /// along its wheels.
    Weave,
    /// Unseen: three bends of 45 degrees and one of 90.
    Bends,
    /// Unseen: a large L to the other side.
    Hook,
}

impl Course {
    pub const fn name(self) -> &'static str {
        match self {
            Self::L => "L",
            Self::Zigzag => "zigzag",
            Self::Weave => "weave",
            Self::Bends => "bends",
            Self::Hook => "hook",
        }
    }

    /// Corners, the first one the start.
    pub const fn corners_px(self) -> &'static [[f64; 2]] {
        match self {
            Self::L => &[
                [500.0, 500.0],
                [500.0, 900.0],
                [1300.0, 900.0],
                [500.0, 900.0],
                [500.0, 500.0],
            ],
            Self::Zigzag => &[
                [350.0, 450.0],
                [850.0, 950.0],
                [1300.0, 500.0],
                [1550.0, 750.0],
                [1300.0, 500.0],
                [850.0, 950.0],
                [350.0, 450.0],
            ],
            Self::Weave => &[
                [350.0, 450.0],
                [600.0, 450.0],
                [770.0, 744.0],
                [1065.0, 692.0],
                [1270.0, 835.0],
                [1065.0, 692.0],
                [770.0, 744.0],
                [600.0, 450.0],
                [350.0, 450.0],
            ],
            Self::Bends => &[
                [350.0, 500.0],
                [700.0, 500.0],
                [1000.0, 800.0],
                [1350.0, 800.0],
                [1000.0, 800.0],
                [700.0, 500.0],
                [350.0, 500.0],
            ],
            Self::Hook => &[
                [1350.0, 950.0],
                [1350.0, 500.0],
                [650.0, 500.0],
                [1350.0, 500.0],
                [1350.0, 950.0],
            ],
        }
    }

    /// The same in the arena, m.
    pub fn corners_m(self) -> Vec<[f64; 2]> {
        let corners = self.corners_px().iter();
        corners
            .map(|[x, y]| [PIXEL_M * x + ORIGIN_M[0], PIXEL_M * y + ORIGIN_M[1]])
            .collect()
    }

    /// Direction in which the path begins.
    pub fn first_yaw_rad(self) -> f64 {
        match self.corners_m().as_slice() {
            [from, to, ..] => (to[1] - from[1]).atan2(to[0] - from[0]),
            _ => 0.0,
        }
    }

    /// One robot on this path under `path_following`.
    pub fn scene(self, chassis: &str, setting: &Setting) -> Result<Scene> {
        let corners = self.corners_m();
        let start = *corners.first().context("a start")?;
        let steered = ["fwd", "rwd", "awd"].contains(&chassis);
        let turned_rad = if steered { 0.0 } else { setting.start_yaw_rad };
        let robot = SceneRobot {
            start: [start[0], start[1], self.first_yaw_rad() + turned_rad],
            goal: start,
        };
        let mut scene = Scene::new(chassis, &[robot], LONGEST_S)?;
        let name = scene.experiment()["robots"][0]["name"].clone();
        let target = |[x_m, y_m]: &[f64; 2]| json!({"robot": name, "x_m": x_m, "y_m": y_m});
        let targets: Vec<Value> = corners.iter().skip(1).map(target).collect();
        let experiment = scene.experiment_mut();
        experiment["control"] = json!({"law": "path_following", "parameters": setting.parameters()});
        experiment["targets"] = json!(targets);
        Ok(scene)
    }
}

/// Gains, speed and start of a run.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Setting {
    pub speed_m_per_s: f64,
    pub distance_gain_per_s: f64,
    pub integral_gain_per_s2: f64,
    pub derivative_gain: f64,
    pub yaw_gain_per_s: f64,
    /// From the direction in which the path begins; car-like robots begin along it.
    pub start_yaw_rad: f64,
}

impl Setting {
    fn parameters(&self) -> Value {
        json!({
            "speed_m_per_s": self.speed_m_per_s,
            "distance_gain_per_s": self.distance_gain_per_s,
            "integral_gain_per_s2": self.integral_gain_per_s2,
            "derivative_gain": self.derivative_gain,
            "yaw_gain_per_s": self.yaw_gain_per_s,
        })
    }
}

/// The path as the robot of a scenario can drive it.
pub fn pieces(scenario: &Scenario) -> Vec<Piece> {
    path(scenario, 0)
}

#[cfg(test)]
mod tests {
    use super::super::settings::committed;
    use super::*;

    #[test]
    fn the_dashboard_s_template_is_the_drill() {
        let template: Value =
            serde_json::from_str(include_str!("../../../examples/experiments/paper-path.json")).unwrap();
        let scene = Course::L.scene("omni4", &committed().unwrap()["omni4"]).unwrap();
        let drill = scene.experiment();
        assert_eq!(template["robots"][0]["start"], drill["robots"][0]["start"]);
        assert_eq!(template["control"]["law"], drill["control"]["law"]);
        assert_eq!(template["control"]["parameters"], drill["control"]["parameters"]);
        assert_eq!(template["duration_s"].as_f64(), drill["duration_s"].as_f64());
        let corners = |experiment: &Value| -> Vec<[f64; 2]> {
            let targets = experiment["targets"].as_array().unwrap();
            let at = |target: &Value, key: &str| target[key].as_f64().unwrap();
            targets
                .iter()
                .map(|target| [at(target, "x_m"), at(target, "y_m")])
                .collect()
        };
        assert_eq!(corners(&template), corners(drill));
        assert_eq!(
            template["control"]["feedback_alone"], true,
            "A of the drill looks nowhere ahead"
        );
    }
}
