//! What the robot might be: a description and effects on top of it.

mod candidate;
mod knob;
mod tread;

pub use candidate::{Axis, Candidate, Column, Excitation, Kind, applies, candidates};
pub use knob::{Knob, knobs, realised};
pub use tread::TreadKnob;

use twin::effect::Effect;
use twin::residual::ResidualDocument;
use twin::robot::{Robot, RobotDescription};

/// A model that can be simulated.
#[derive(Debug, Clone, PartialEq)]
pub struct Hypothesis {
    pub description: RobotDescription,
    /// In the order in which they act.
    pub effects: Vec<Effect>,
    pub residual: Option<ResidualDocument>,
}

impl Hypothesis {
    /// The nominal twin of a description.
    pub fn nominal(description: &RobotDescription) -> Hypothesis {
        Hypothesis {
            description: description.clone(),
            effects: Vec::new(),
            residual: None,
        }
    }

    /// The same with one more effect.
    pub fn with(&self, effect: Effect) -> Hypothesis {
        let mut more = self.clone();
        more.effects.push(effect);
        more
    }

    /// The twin; `None` when a number is out of the library's range.
    pub fn robot(&self) -> Option<Robot> {
        Robot::with_model(self.description.clone(), &self.effects, self.residual.as_ref()).ok()
    }
}
