//! What a user's own controller says besides its commands: log lines and drawings on the arena.

use serde::{Deserialize, Serialize};

/// One log line or drawing. Places in the world frame, m; colours 0 to 7 from the page's palette.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub enum Note {
    Log {
        text: String,
    },
    Point {
        at_m: [f64; 2],
        colour: u8,
    },
    Line {
        from_m: [f64; 2],
        to_m: [f64; 2],
        colour: u8,
    },
    Text {
        at_m: [f64; 2],
        text: String,
        colour: u8,
    },
}

/// What was said and drawn in one control tick.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct TickNotes {
    /// Control ticks since the run began.
    pub tick: i64,
    pub notes: Vec<Note>,
}
