//! What the robot might be: a description and effects on top of it.

mod candidate;
mod knob;
mod tread;

pub use candidate::{Axis, Candidate, Column, Excitation, Kind, applies, candidates, lost_set_points};
pub use knob::{Knob, knobs, realised};
pub use tread::TreadKnob;

use twin::effect::Effect;
use twin::residual::ResidualDocument;
use twin::robot::{Robot, RobotDescription};

/// The effect of set-points that do not arrive.
pub const LOST: &str = "command_hold";

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

    /// From the body's origin to the wheel that is farthest from it, m.
    pub fn reach_m(&self) -> f64 {
        let wheels = self.description.wheels.iter();
        wheels
            .map(|wheel| libm::hypot(wheel.x_m, wheel.y_m))
            .fold(0.0, f64::max)
    }

    /// The same with one more effect.
    pub fn with(&self, effect: Effect) -> Hypothesis {
        let mut more = self.clone();
        more.effects.push(effect);
        more
    }

    /// The twin; `None` when a number is out of the library's range. Which set-points were lost is of a run, not of a model, and a run is
    /// simulated with those that arrived ([`crate::lost`]): the twin's own dice for [`LOST`] are left out.
    pub fn robot(&self) -> Option<Robot> {
        let with =
            |effects: &[Effect]| Robot::with_model(self.description.clone(), effects, self.residual.as_ref()).ok();
        if self.effects.iter().all(|effect| effect.name != LOST) {
            return with(&self.effects);
        }
        let others = self.effects.iter().filter(|effect| effect.name != LOST);
        with(&others.cloned().collect::<Vec<Effect>>())
    }
}
