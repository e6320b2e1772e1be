//! Choosing: roles of runs, acceptance of an effect, what the data cannot tell apart.

mod beyond;
mod curve;
mod evidence;
mod finalist;
mod fits;
mod in_place;
mod in_turn;
mod kept;
mod law_rest;
mod lists;
mod loud_starts;
mod overlooked;
mod round;
mod split;
mod survey;
mod suspect;

pub use evidence::window_energies;
pub use finalist::Finalist;
pub use in_place::{in_place, scores_beside};
pub use kept::Kept;
pub use law_rest::{Energies, Explained, decrease, energies, expected};
pub use round::{Round, Side, Stop, difference, round, slack_of};
pub use split::{Role, roles};
pub use suspect::{PLACE, Question, Suspect};
