//! Which controller can drive which chassis, with which sensors.
//!
//! A pair is refused when a budget does not suffice: connector pins, ports, compute or memory. No pair is listed as
//! good or bad; every refusal says what needs how much of what, how much there is, and what to do. The figures and
//! their sources stand beside them; `docs/pairing.md` has the tables.

pub mod budget;
pub mod connector;
pub mod controller;
pub mod document;
pub mod problem;
pub mod program;
pub mod seat;
pub mod sensor;
pub mod task;

pub use budget::Budget;
pub use connector::PinAssignment;
pub use controller::ControllerKind;
pub use document::RobotDocument;
pub use problem::PairingProblem;
pub use sensor::SensorKind;

use crate::robot::RobotDescription;

/// A controller on a chassis.
#[derive(Debug, Clone, PartialEq)]
pub struct Pairing {
    pub controller: ControllerKind,
    pub sensors: Vec<SensorKind>,
    pub robot: RobotDescription,
}

/// Places the actuators on the connector if every budget suffices.
///
/// - Only what drives, steers and feeds the motors is read of the description; [`RobotDocument::pairing`] checks
///   the rest.
/// - Errors: every budget that does not suffice. Another sensor never makes an error vanish.
pub fn check(pair: &Pairing) -> Result<PinAssignment, Vec<PairingProblem>> {
    let problems = problem::problems(pair);
    let assignment = connector::assign(&connector::actuators(&pair.robot));
    match assignment {
        Some(assignment) if problems.is_empty() => Ok(assignment),
        _ => Err(problems),
    }
}
