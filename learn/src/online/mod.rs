//! Learning while a run goes on: fixed cost per pose, no clock, the same input gives the same bits.
//!
//! Commands and believed poses in, by physics step; every 0.1 s a prediction 0.5 s ahead ends and is compared with what was
//! seen there ([`span`]). The last layer of a residual is linear in its weights w, and so, nearly, is where the robot gets to:
//!
//! ```text
//! e   = seen - predicted with the weights of the beginning, (x, y, yaw)
//! J   = change of the end by a constant acceleration of the body, by driving the twin again (three times)
//! phi = means of the last hidden layer over the span
//! e  ~= J (w - w_then) phi        three rows of a recursive least squares ([`recursion`]) with forgetting
//! ```
//!
//! The parent's weights stay beside the learnt ones. When the learnt ones predict worse they are thrown away
//! ([`watchdog`]); at the end the last third of the run says whether they are worth a version ([`closing`]). Every figure is
//! of a prediction made before its end was seen.

pub mod closing;
pub mod draft;
pub mod law;
pub mod learner;
pub mod recursion;
pub mod span;
pub mod track;
pub mod watchdog;

pub use closing::Closing;
pub use learner::{OnlineLearner, Prediction};

use twin::PHYSICS_RATE_HZ;

/// How far ahead is predicted, physics steps: 0.5 s.
pub const HORIZON_STEPS: i64 = PHYSICS_RATE_HZ as i64 / 2;
/// From one prediction to the next, physics steps: 0.1 s.
pub const STRIDE_STEPS: i64 = PHYSICS_RATE_HZ as i64 / 10;
/// Driven before a prediction begins, so that wheels and looks back are settled, physics steps: 0.1 s.
pub const RUN_IN_STEPS: i64 = PHYSICS_RATE_HZ as i64 / 10;

/// Why nothing can be learned of a robot.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum OnlineError {
    #[error("model: {0}")]
    Model(String),
    #[error(
        "the residual of the parent ends in a layer that is not linear: its weights cannot be learned during a run"
    )]
    NotLinear,
}
