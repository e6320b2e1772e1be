//! Lines of JSON between a team and its program; one message a line.

use control::law::Fault;
use controllers::answer::Answer;
use controllers::source::Source;
use controllers::view::{Setup, View};
use serde::{Deserialize, Serialize};

/// Longest line in either direction.
pub const MAX_LINE_BYTES: usize = 4 * 1024 * 1024;

/// To the program. The first is the setup, then one view in each tick that the program is asked.
#[derive(Debug, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Ask {
    Setup {
        team: Setup,
        /// Absent for programs that bring their own.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        source: Option<Source>,
    },
    View(View),
}

/// From the program: `ready` or a fault after the setup, then an answer or a fault for every view.
#[derive(Debug, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Told {
    Ready {
        /// Layers of confinement that are in force.
        #[serde(default)]
        confined: Vec<String>,
    },
    Answer {
        tick: u64,
        #[serde(flatten)]
        answer: Answer,
    },
    Fault(Fault),
}
