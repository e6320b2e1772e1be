//! What the targets of an experiment mean to a law.

use serde::Serialize;

/// Whose the targets are.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Owner {
    /// Each target names its robot (it may be left out when there is only one).
    Robot,
    /// All belong to the first robot of the experiment.
    First,
    /// They belong to the team and name no robot.
    Team,
}

/// What the yaw of a target does.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum YawUse {
    /// May be given.
    Free,
    /// Must be given.
    Needed,
    /// Has no effect and is refused.
    Unused,
}

/// Targets that a law takes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct TargetRule {
    pub owner: Owner,
    /// Fewest targets in all.
    pub least: u32,
    /// Most targets of one robot (of the team, if they belong to it).
    pub most_each: u32,
    pub yaw: YawUse,
    /// Robots stand on their targets at the same time, so these must not be closer than the robots are large.
    pub apart: bool,
    /// In one sentence.
    pub meaning: &'static str,
}
