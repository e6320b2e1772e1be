//! Parameters of the laws: one table for validation, defaults, sliders and the user guide.

use serde::Serialize;

use super::{GO_TO_POINT, WAYPOINTS};
use crate::scenario::Control;

/// One parameter of a law.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ParameterSpec {
    /// Name in `control.parameters`; ends in its unit.
    pub key: &'static str,
    /// Unit for people; empty for a pure number.
    pub unit: &'static str,
    pub min: f64,
    pub max: f64,
    pub default: f64,
    /// What it does, in one sentence.
    pub meaning: &'static str,
}

/// A law and its parameters.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct LawSpec {
    pub name: &'static str,
    pub title: &'static str,
    pub parameters: &'static [ParameterSpec],
}

const SPEED: ParameterSpec = ParameterSpec {
    key: "speed_m_per_s",
    unit: "m/s",
    min: 0.05,
    max: 0.7,
    default: 0.4,
    meaning: "Largest speed of the robot along its way.",
};
const REACH_RADIUS: ParameterSpec = ParameterSpec {
    key: "reach_radius_m",
    unit: "m",
    min: 0.005,
    max: 0.5,
    default: 0.03,
    meaning: "A target counts as reached when the robot is this close.",
};
const YAW_GAIN: ParameterSpec = ParameterSpec {
    key: "yaw_gain_per_s",
    unit: "1/s",
    min: 0.1,
    max: 8.0,
    default: 3.0,
    meaning: "Yaw rate for each radian of heading error.",
};

/// Every law that an experiment can name.
pub const LAWS: &[LawSpec] = &[
    LawSpec {
        name: WAYPOINTS,
        title: "Waypoints: a reference point is pulled to the active waypoint and the robot follows it",
        parameters: &[
            ParameterSpec {
                key: "epsilon_p",
                unit: "",
                min: 0.001,
                max: 0.2,
                default: 0.02,
                meaning: "Share of its way to the waypoint that the reference point moves in one tick.",
            },
            SPEED,
            ParameterSpec {
                key: "tracking_gain_per_s",
                unit: "1/s",
                min: 0.2,
                max: 8.0,
                default: 3.0,
                meaning: "Speed for each metre between robot and reference point.",
            },
            YAW_GAIN,
            REACH_RADIUS,
            ParameterSpec {
                key: "look_ahead_m",
                unit: "m",
                min: 0.05,
                max: 1.0,
                default: 0.15,
                meaning: "How far ahead of the reference point a robot that cannot move sideways aims.",
            },
        ],
    },
    LawSpec {
        name: GO_TO_POINT,
        title: "Go to point: every robot drives to its own goal, keeping right of the others",
        parameters: &[
            SPEED,
            ParameterSpec {
                key: "goal_gain_per_s",
                unit: "1/s",
                min: 0.1,
                max: 5.0,
                default: 1.5,
                meaning: "Speed for each metre between robot and goal.",
            },
            YAW_GAIN,
            REACH_RADIUS,
            ParameterSpec {
                key: "keep_right",
                unit: "",
                min: 0.0,
                max: 3.0,
                default: 1.5,
                meaning: "How strongly a robot swerves to the right of another one in its way; 0 switches it off.",
            },
        ],
    },
];

/// The table of a law.
pub fn law_spec(law: &str) -> Option<&'static LawSpec> {
    LAWS.iter().find(|spec| spec.name == law)
}

/// Values of a law's parameters, defaults filled in.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Parameters {
    values: Vec<(&'static str, f64)>,
}

impl Parameters {
    /// Parameters of a checked `control` section.
    pub fn of(control: &Control) -> Parameters {
        let specs = law_spec(&control.law).map_or(&[][..], |spec| spec.parameters);
        let value = |spec: &ParameterSpec| {
            control
                .parameters
                .get(spec.key)
                .and_then(serde_json::Value::as_f64)
                .unwrap_or(spec.default)
        };
        Parameters {
            values: specs.iter().map(|spec| (spec.key, value(spec))).collect(),
        }
    }

    /// Value of a parameter; 0 for a key that the law does not have.
    pub fn get(&self, key: &str) -> f64 {
        self.values
            .iter()
            .find(|(known, _)| *known == key)
            .map_or(0.0, |(_, value)| *value)
    }
}

/// Checks law and parameters; `report(field, message, limit, remedy)` for each problem.
pub(crate) fn check(control: &Control, report: &mut dyn FnMut(String, String, String, String)) {
    let Some(spec) = law_spec(&control.law) else {
        let names: Vec<&str> = LAWS.iter().map(|spec| spec.name).collect();
        let message = format!("the control law {:?} is not known", control.law);
        report(
            "control.law".into(),
            message,
            names.join(", "),
            "choose one of these".into(),
        );
        return;
    };
    let keys = || spec.parameters.iter().map(|p| p.key).collect::<Vec<_>>().join(", ");
    let entries = match &control.parameters {
        serde_json::Value::Object(entries) => entries,
        _ => {
            let message = "the parameters are not an object".to_owned();
            report(
                "control.parameters".into(),
                message,
                keys(),
                "write {} for the defaults".into(),
            );
            return;
        }
    };
    for (key, value) in entries {
        let field = format!("control.parameters.{key}");
        let Some(known) = spec.parameters.iter().find(|p| p.key == key) else {
            let message = format!("the law {} has no parameter {key:?}", spec.name);
            report(field, message, keys(), "remove it or use one of these".into());
            continue;
        };
        let range = format!("{} to {} {}", known.min, known.max, known.unit)
            .trim_end()
            .to_owned();
        match value.as_f64() {
            Some(number) if (known.min..=known.max).contains(&number) => {}
            Some(number) => {
                let message = format!("{number} {} is outside the range", known.unit);
                report(
                    field,
                    message,
                    range,
                    format!("choose a value in the range; the default is {}", known.default),
                );
            }
            None => report(field, format!("{value} is not a number"), range, "give a number".into()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn defaults_lie_in_their_ranges_and_keys_are_unique() {
        for law in LAWS {
            for (i, p) in law.parameters.iter().enumerate() {
                assert!(p.min <= p.default && p.default <= p.max, "{}.{}", law.name, p.key);
                assert!(
                    law.parameters[..i].iter().all(|q| q.key != p.key),
                    "{}.{}",
                    law.name,
                    p.key
                );
            }
        }
    }
}
