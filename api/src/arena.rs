//! The place where robots drive.

use serde::{Deserialize, Serialize};

/// Rectangular arena, world origin at its centre, x right and y up as seen from above.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct Arena {
    /// Name used in experiments, for example `reference`.
    pub name: String,
    /// Extent along x in metres.
    pub width_m: f64,
    /// Extent along y in metres.
    pub height_m: f64,
    /// Floor covering, for example `lab-floor`; models belong to a robot and a floor.
    pub floor: String,
}

/// An arena and what it is doing now.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct ArenaView {
    #[serde(flatten)]
    pub arena: Arena,
    /// `free`, `leased`, `held` (waiting for a self-check or an operator) or `offline` (no laboratory connected).
    pub state: String,
    /// Why, in words, when it is not free.
    pub message: Option<String>,
}
