//! Parameters of the laws: one table for validation, defaults, sliders and the user guide.

use serde::Serialize;

use super::targets::{Owner, TargetRule, YawUse};
use super::{GO_TO_POINT, OWN, WAYPOINTS};
use super::{
    consensus, coverage, formation, go_to_pose, goal_assignment, leader_follower, own, path_following,
    trajectory_tracking,
};
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
    /// Names of the values `min`, `min + 1`, ... of a parameter that chooses; empty for a quantity.
    pub choices: &'static [&'static str],
}

impl ParameterSpec {
    /// A quantity with a range `[min, default, max]`.
    pub(super) const fn quantity(
        key: &'static str,
        unit: &'static str,
        [min, default, max]: [f64; 3],
        meaning: &'static str,
    ) -> ParameterSpec {
        ParameterSpec {
            key,
            unit,
            min,
            max,
            default,
            meaning,
            choices: &[],
        }
    }

    /// A choice; the first one is the default and has the number 0.
    pub(super) const fn choice(
        key: &'static str,
        choices: &'static [&'static str],
        meaning: &'static str,
    ) -> ParameterSpec {
        ParameterSpec {
            key,
            unit: "",
            min: 0.0,
            max: choices.len() as f64 - 1.0,
            default: 0.0,
            meaning,
            choices,
        }
    }

    /// Allowed values in words.
    pub fn limit(&self) -> String {
        if self.choices.is_empty() {
            return format!("{} to {} {}", self.min, self.max, self.unit)
                .trim_end()
                .to_owned();
        }
        let named = self.choices.iter().enumerate().map(|(k, name)| format!("{k} ({name})"));
        named.collect::<Vec<_>>().join(", ")
    }
}

/// A law and its parameters.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct LawSpec {
    pub name: &'static str,
    pub title: &'static str,
    /// Where its equations come from.
    pub source: &'static str,
    /// What its targets mean and how many there must be.
    pub targets: TargetRule,
    pub parameters: &'static [ParameterSpec],
}

pub(super) const SPEED: ParameterSpec = ParameterSpec {
    key: "speed_m_per_s",
    unit: "m/s",
    min: 0.05,
    max: 0.7,
    default: 0.4,
    meaning: "Largest speed of the robot along its way.",
    choices: &[],
};
pub(super) const REACH_RADIUS: ParameterSpec = ParameterSpec {
    key: "reach_radius_m",
    unit: "m",
    min: 0.005,
    max: 0.5,
    default: 0.03,
    meaning: "A target counts as reached when the robot is this close.",
    choices: &[],
};
pub(super) const YAW_GAIN: ParameterSpec = ParameterSpec {
    key: "yaw_gain_per_s",
    unit: "1/s",
    min: 0.1,
    max: 8.0,
    default: 3.0,
    meaning: "Yaw rate for each radian of heading error.",
    choices: &[],
};

pub(super) const KEEP_RIGHT: ParameterSpec = ParameterSpec::quantity(
    "keep_right",
    "",
    [0.0, 1.5, 3.0],
    "How strongly a robot swerves to the right of another one in its way; 0 switches it off.",
);
pub(super) const GRAPH: ParameterSpec = ParameterSpec::choice(
    "graph",
    super::graph::CHOICES,
    "Which robots know of each other, in the order of the experiment.",
);

/// Every law that an experiment can name, besides the user's own.
pub const LAWS: &[LawSpec] = &[
    LawSpec {
        name: WAYPOINTS,
        title: "Waypoints: a reference point is pulled to the active waypoint and the robot follows it",
        source: "Ding et al. 2021, eq. 1",
        targets: TargetRule {
            owner: Owner::Robot,
            least: 1,
            most_each: u32::MAX,
            yaw: YawUse::Free,
            apart: false,
            meaning: "Waypoints of each robot, passed in order; a robot without any stands still.",
        },
        parameters: &[
            ParameterSpec {
                key: "epsilon_p",
                unit: "",
                min: 0.001,
                max: 0.2,
                default: 0.02,
                meaning: "Share of its way to the waypoint that the reference point moves in one tick.",
                choices: &[],
            },
            SPEED,
            ParameterSpec {
                key: "tracking_gain_per_s",
                unit: "1/s",
                min: 0.2,
                max: 8.0,
                default: 3.0,
                meaning: "Speed for each metre between robot and reference point.",
                choices: &[],
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
                choices: &[],
            },
        ],
    },
    LawSpec {
        name: GO_TO_POINT,
        title: "Go to point: every robot drives to its own goal, keeping right of the others",
        source: "proportional control of a single integrator; swerving as in a roundabout",
        targets: TargetRule {
            owner: Owner::Robot,
            least: 1,
            most_each: 1,
            yaw: YawUse::Free,
            apart: true,
            meaning: "The goal of each robot; a robot without one stands still.",
        },
        parameters: &[
            SPEED,
            ParameterSpec {
                key: "goal_gain_per_s",
                unit: "1/s",
                min: 0.1,
                max: 5.0,
                default: 1.5,
                meaning: "Speed for each metre between robot and goal.",
                choices: &[],
            },
            YAW_GAIN,
            REACH_RADIUS,
            KEEP_RIGHT,
        ],
    },
    go_to_pose::SPEC,
    path_following::SPEC,
    trajectory_tracking::SPEC,
    consensus::SPEC,
    leader_follower::SPEC,
    formation::SPEC,
    coverage::SPEC,
    goal_assignment::SPEC,
];

/// The table of a law.
pub fn law_spec(law: &str) -> Option<&'static LawSpec> {
    let all = LAWS.iter().chain(std::iter::once(&own::SPEC));
    all.into_iter().find(|spec| spec.name == law)
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

    /// Number of a choice, counted from 0.
    pub fn choice(&self, key: &str) -> usize {
        self.get(key) as usize
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
    if control.law == OWN {
        return own::check(control, report);
    }
    let Some(spec) = law_spec(&control.law) else {
        let names: Vec<&str> = LAWS.iter().map(|spec| spec.name).chain([OWN]).collect();
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
        let range = known.limit();
        match value.as_f64() {
            Some(number) if !known.choices.is_empty() && number.fract() != 0.0 => {
                report(
                    field,
                    format!("{number} is not a whole number"),
                    range,
                    "give the number of a choice".into(),
                );
            }
            Some(number) if (known.min..=known.max).contains(&number) => {}
            Some(number) => {
                let value = format!("{number} {}", known.unit);
                let message = format!("{} is outside the range", value.trim_end());
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
                assert!(p.choices.is_empty() || p.max + 1.0 == p.choices.len() as f64);
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
