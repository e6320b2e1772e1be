//! Constant body twists, whatever happens: makes contacts for the scenario gallery. No experiment can name it.

use twin::twist::BodyTwist;

use super::{Demand, Law, Observation, PUSH};

/// Constant body twist per robot.
#[derive(Debug, Clone, PartialEq)]
pub struct Push {
    /// In the order of the robots; robots without an entry stand still.
    pub twists: Vec<BodyTwist>,
}

impl Law for Push {
    fn name(&self) -> &'static str {
        PUSH
    }

    fn step(&mut self, observation: &Observation<'_>, demands: &mut [Demand]) {
        for ((demand, twist), robot) in demands.iter_mut().zip(&self.twists).zip(observation.robots) {
            demand.twist = *twist;
            demand.target = [robot.pose.x_m, robot.pose.y_m];
        }
    }
}
