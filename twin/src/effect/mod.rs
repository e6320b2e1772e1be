//! Effects: what a real robot, floor or sensor does that the nominal equations leave out.
//!
//! A model is the nominal description and an ordered list of effects. The same code runs in the twin and under the
//! identification. [`library::LIBRARY`] names every effect with its parameters, units, neutral values and sizes; an effect
//! whose parameters are all neutral is left out before anything is computed, so it gives the unmodified bits.

mod check;
mod command;
mod dynamics;
pub mod library;
mod parametric;
mod sensor;
pub mod size;

use crate::robot::RobotDescription;
use library::EffectEntry;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

pub(crate) use check::check;
pub(crate) use dynamics::{Dynamics, Runtime};
pub(crate) use parametric::{physical, shape, tracked};
pub(crate) use sensor::{
    History, SensorStage, marked_pose, moves_poses, seen_pose, seen_pose_in, stages as sensor_stages,
    tells_cameras_apart,
};

/// One effect as it stands in a model document.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Effect {
    /// A name of [`library::LIBRARY`].
    pub name: String,
    /// Position in the robot's `wheels`, for effects of one wheel.
    #[serde(default)]
    pub index: Option<usize>,
    /// By name; `null` stands for an infinite limit. What is left out is neutral.
    pub parameters: BTreeMap<String, Option<f64>>,
}

impl Effect {
    /// An effect with some of its parameters; the rest is neutral.
    pub fn new(name: &str, parameters: &[(&str, f64)]) -> Effect {
        let parameters = parameters
            .iter()
            .map(|(name, value)| ((*name).to_owned(), value.is_finite().then_some(*value)));
        Effect {
            name: name.to_owned(),
            index: None,
            parameters: parameters.collect(),
        }
    }

    /// An effect of the library at the sizes that `choose` takes of each parameter's (practical, large); an effect of one
    /// wheel acts on the first driven one.
    pub fn sized(entry: &EffectEntry, robot: &RobotDescription, choose: fn((f64, f64)) -> f64) -> Effect {
        let mut effect = Effect::new(entry.name, &[]);
        for parameter in entry.parameters {
            let size = choose(parameter.size.values(robot));
            let value = size.is_finite().then_some(size);
            effect.parameters.insert(parameter.name.to_owned(), value);
        }
        let driven = robot.wheels.iter().position(|wheel| wheel.driven).unwrap_or(0);
        if entry.indexed { effect.at(driven) } else { effect }
    }

    /// The same for one wheel.
    pub fn at(mut self, index: usize) -> Effect {
        self.index = Some(index);
        self
    }

    /// Value of a parameter, neutral when it is left out; infinite for `null`.
    pub fn value(&self, parameter: &str) -> f64 {
        match self.parameters.get(parameter) {
            Some(value) => value.unwrap_or(f64::INFINITY),
            None => library::find(&self.name)
                .and_then(|entry| entry.parameter(parameter))
                .map_or(0.0, |entry| entry.neutral),
        }
    }

    /// True when nothing is changed by it: all parameters that carry its size are neutral; those of place and shape do not count.
    pub fn is_neutral(&self) -> bool {
        let Some(entry) = library::find(&self.name) else {
            return false;
        };
        entry
            .parameters
            .iter()
            .filter(|parameter| parameter.carries_size)
            .all(|parameter| self.value(parameter.name) == parameter.neutral)
    }
}
