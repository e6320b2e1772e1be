//! Choosing: roles of runs, acceptance of an effect, what the data cannot tell apart.

mod evidence;
mod fits;
mod round;
mod split;

pub use round::{Finalist, Round, Sensitivities, Side, Stop, round, slack_of};
pub use split::{Role, roles};
