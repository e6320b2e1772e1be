//! Record of what the safety filter changed.

use serde::Serialize;
use twin::twist::BodyTwist;

/// Most rows named in one record.
pub const MAX_PRESSURES: usize = 3;

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum WallSide {
    Left,
    Right,
    Bottom,
    Top,
}

/// Which constraint changed a command.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Cause {
    /// Another robot, by its position in the experiment.
    Robot {
        other: u32,
    },
    Wall {
        side: WallSide,
    },
    /// A side of the geofence, by its position.
    Geofence {
        side: u32,
    },
    /// A fixed obstacle, by its position in the arena's contents.
    FixedObstacle {
        index: u32,
    },
    /// A pushable obstacle, by its position in the arena's contents.
    PushableObstacle {
        index: u32,
    },
    /// Something that others move, by the number that its observer gave it.
    MovingObstacle {
        id: u32,
    },
    /// Body speed or yaw rate above the limit.
    Speed,
    /// A wheel would turn faster than it can.
    WheelSpeed,
    /// The arc is tighter than the steering allows.
    Steering,
    /// Turning on would swing the velocity into something before the next commands arrive.
    Turn,
    /// Robots held each other; this one was sent round.
    Deadlock,
    /// The pose is too old or was never known.
    PoseAge,
    /// The measured delay of link and robot is longer than the filter can answer for.
    Latency,
    /// The link to the robot is down.
    Offline,
    /// Pose or desired twist is not a finite number.
    NotFinite,
    /// No motion satisfies every constraint.
    Infeasible,
    /// The solver did not finish within its bound.
    NotConverged,
    /// The tick came too late: the command of the tick before, decelerated, or a stop.
    Late,
}

/// How much one row moved the command of one robot.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Pressure {
    #[serde(flatten)]
    pub cause: Cause,
    pub push_m_per_s: f64,
}

/// One change of one robot's command on one tick.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Intervention {
    /// What changed the command most.
    #[serde(flatten)]
    pub cause: Cause,
    /// Size of the change of the body velocity.
    pub change_m_per_s: f64,
    /// Size of the change of the yaw rate.
    pub change_rad_per_s: f64,
    pub requested: BodyTwist,
    /// The rows that acted, strongest first; weaker ones beyond [`MAX_PRESSURES`] are left out.
    pub pressures: [Option<Pressure>; MAX_PRESSURES],
}

impl Intervention {
    /// One word for live pictures: `wall`, `robot`, `speed` or `stop`.
    pub fn label(&self) -> &'static str {
        self.cause.label()
    }
}

impl Cause {
    /// One word for live pictures: `wall` (with obstacles and geofence), `robot`, `speed` or `stop`.
    pub fn label(self) -> &'static str {
        match self {
            Cause::Robot { .. } | Cause::Deadlock => "robot",
            Cause::Wall { .. }
            | Cause::Geofence { .. }
            | Cause::FixedObstacle { .. }
            | Cause::PushableObstacle { .. }
            | Cause::MovingObstacle { .. } => "wall",
            Cause::Speed | Cause::WheelSpeed | Cause::Steering | Cause::Turn => "speed",
            Cause::PoseAge
            | Cause::Latency
            | Cause::Offline
            | Cause::NotFinite
            | Cause::Infeasible
            | Cause::NotConverged
            | Cause::Late => "stop",
        }
    }
}

/// The strongest rows of one robot so far.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Strongest(pub [Option<Pressure>; MAX_PRESSURES]);

impl Strongest {
    pub const NONE: Strongest = Strongest([None; MAX_PRESSURES]);

    /// Adds a row in its place; of equal ones the first comes first.
    pub fn add(&mut self, cause: Cause, push_m_per_s: f64) {
        let mut carried = Pressure { cause, push_m_per_s };
        for slot in &mut self.0 {
            match slot {
                Some(there) if there.push_m_per_s >= carried.push_m_per_s => {}
                Some(there) => std::mem::swap(there, &mut carried),
                None => {
                    *slot = Some(carried);
                    return;
                }
            }
        }
    }

    pub fn first(&self) -> Option<Pressure> {
        self.0[0]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keeps_the_strongest_in_order() {
        let mut strongest = Strongest::NONE;
        for (other, push) in [(0, 0.1), (1, 0.4), (2, 0.2), (3, 0.3), (4, 0.4)] {
            strongest.add(Cause::Robot { other }, push);
        }
        let kept: Vec<_> = strongest.0.iter().flatten().map(|p| p.cause).collect();
        assert_eq!(kept, [1, 4, 3].map(|other| Cause::Robot { other }));
    }
}
