//! Parameters of the control laws as sliders: keys, units, ranges and defaults.

use api::experiment::Experiment;

/// One parameter of a law.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spec {
    /// Name in `control.parameters`.
    pub key: &'static str,
    /// For people.
    pub title: &'static str,
    /// Empty for a pure number.
    pub unit: &'static str,
    pub min: f64,
    pub max: f64,
    pub default: f64,
    pub meaning: &'static str,
}

const SPEED: Spec = Spec { key: "speed_m_per_s", title: "Speed", unit: "m/s", min: 0.05, max: 0.7, default: 0.4, meaning: "Largest speed of the robot along its way." };
const REACH_RADIUS: Spec = Spec { key: "reach_radius_m", title: "Reach radius", unit: "m", min: 0.005, max: 0.5, default: 0.03, meaning: "A target counts as reached when the robot is this close." };
const YAW_GAIN: Spec = Spec { key: "yaw_gain_per_s", title: "Yaw gain", unit: "1/s", min: 0.1, max: 8.0, default: 3.0, meaning: "Yaw rate for each radian of heading error." };

const WAYPOINTS: &[Spec] = &[
    Spec { key: "epsilon_p", title: "Reference step \u{03b5}", unit: "", min: 0.001, max: 0.2, default: 0.02, meaning: "Share of its way to the waypoint that the reference point moves in one tick." },
    SPEED,
    Spec { key: "tracking_gain_per_s", title: "Tracking gain", unit: "1/s", min: 0.2, max: 8.0, default: 3.0, meaning: "Speed for each metre between robot and reference point." },
    YAW_GAIN,
    REACH_RADIUS,
    Spec { key: "look_ahead_m", title: "Look-ahead", unit: "m", min: 0.05, max: 1.0, default: 0.15, meaning: "How far ahead of the reference point a robot that cannot move sideways aims." },
];

const GO_TO_POINT: &[Spec] = &[
    SPEED,
    Spec { key: "goal_gain_per_s", title: "Goal gain", unit: "1/s", min: 0.1, max: 5.0, default: 1.5, meaning: "Speed for each metre between robot and goal." },
    YAW_GAIN,
    REACH_RADIUS,
    Spec { key: "keep_right", title: "Keep right", unit: "", min: 0.0, max: 3.0, default: 1.5, meaning: "How strongly a robot swerves to the right of another one in its way; 0 switches it off." },
];

/// The table of a law; empty for a law that is not known here.
pub fn specs(law: &str) -> &'static [Spec] {
    match law {
        "waypoints" => WAYPOINTS,
        "go_to_point" => GO_TO_POINT,
        _ => &[],
    }
}

pub fn law_title(law: &str) -> &'static str {
    match law {
        "waypoints" => "Waypoints: a reference point is pulled to the active waypoint and the robot follows it.",
        "go_to_point" => "Go to point: every robot drives to its own goal, keeping right of the others.",
        _ => "",
    }
}

/// The value in the document, or the default where it says nothing.
pub fn value(experiment: &Experiment, spec: &Spec) -> f64 {
    experiment.control.parameters.get(spec.key).and_then(serde_json::Value::as_f64).unwrap_or(spec.default)
}

/// Writes a value into the document; the default leaves no trace there.
pub fn set(experiment: &mut Experiment, key: &str, value: f64) {
    let Some(spec) = specs(&experiment.control.law).iter().find(|s| s.key == key) else { return };
    let value = value.clamp(spec.min, spec.max);
    if !experiment.control.parameters.is_object() {
        experiment.control.parameters = serde_json::json!({});
    }
    let Some(entries) = experiment.control.parameters.as_object_mut() else { return };
    if value == spec.default {
        entries.remove(key);
    } else {
        entries.insert(key.to_owned(), serde_json::json!(value));
    }
}
