//! What a program sees. The same values for scripts, modules and programs behind a pipe.

use control::law::{Body, Drive, Goal, Observation};
use serde::{Deserialize, Deserializer, Serialize};

use crate::ranges::{BEAMS, Surroundings};

/// What does not change during a run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Setup {
    /// Control ticks per second.
    pub rate_hz: u32,
    /// Width and height of the arena around the origin.
    pub arena_m: [f64; 2],
    pub robots: Vec<Member>,
    /// Numbers of the experiment by name, in the order of their names.
    pub parameters: Vec<(String, f64)>,
}

/// A robot as it does not change during a run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Member {
    pub name: String,
    pub drive: Chassis,
    /// Smallest radius of an arc; 0 for robots that turn on the spot.
    pub turning_radius_m: f64,
    /// Of the bounding circle.
    pub radius_m: f64,
    pub targets: Vec<Place>,
}

/// How a robot can move.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Chassis {
    /// Any direction at once.
    Holonomic,
    /// Forward and back, turns on the spot.
    TurnInPlace,
    /// Forward and back on arcs.
    Steered,
}

/// A target.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Place {
    pub x_m: f64,
    pub y_m: f64,
    /// Free when absent.
    pub yaw_rad: Option<f64>,
}

/// One control tick.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct View {
    pub tick: u64,
    /// Since the run began.
    pub time_s: f64,
    /// In the order of the experiment.
    pub robots: Vec<Seen>,
}

/// A robot at one tick; numbers that are not known are not a number, in JSON `null`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Seen {
    #[serde(deserialize_with = "number")]
    pub x_m: f64,
    #[serde(deserialize_with = "number")]
    pub y_m: f64,
    #[serde(deserialize_with = "number")]
    pub yaw_rad: f64,
    /// Since the pose was measured; negative of one that is predicted so far ahead.
    #[serde(deserialize_with = "number")]
    pub age_s: f64,
    #[serde(deserialize_with = "number")]
    pub forward_m_per_s: f64,
    #[serde(deserialize_with = "number")]
    pub left_m_per_s: f64,
    #[serde(deserialize_with = "number")]
    pub yaw_rate_rad_per_s: f64,
    pub online: bool,
    /// [`crate::ranges`]; from the front counter-clockwise.
    pub ranges_m: [f64; BEAMS],
}

fn number<'de, D: Deserializer<'de>>(from: D) -> Result<f64, D::Error> {
    Ok(Option::<f64>::deserialize(from)?.unwrap_or(f64::NAN))
}

impl Setup {
    /// What the program of a team will see.
    pub fn new(bodies: &[Body], targets: &[Vec<Goal>], arena_m: [f64; 2], parameters: Vec<(String, f64)>) -> Setup {
        let place = |goal: &Goal| Place {
            x_m: goal.place_m[0],
            y_m: goal.place_m[1],
            yaw_rad: goal.yaw_rad,
        };
        let member = |(body, targets): (&Body, &Vec<Goal>)| {
            let (drive, turning_radius_m) = match body.drive {
                Drive::Holonomic => (Chassis::Holonomic, 0.0),
                Drive::TurnInPlace { .. } => (Chassis::TurnInPlace, 0.0),
                Drive::Steered { turning_radius_m, .. } => (Chassis::Steered, turning_radius_m),
            };
            Member {
                name: body.name.clone(),
                drive,
                turning_radius_m,
                radius_m: body.bounding_radius_m,
                targets: targets.iter().map(place).collect(),
            }
        };
        Setup {
            rate_hz: control::TICK_RATE_HZ,
            arena_m,
            robots: bodies.iter().zip(targets).map(member).collect(),
            parameters,
        }
    }
}

impl View {
    /// Fills in an observation.
    pub fn update(&mut self, observation: &Observation<'_>, surroundings: &Surroundings) {
        self.tick = observation.tick;
        self.time_s = observation.tick as f64 * control::TICK_S;
        self.robots.clear();
        let seen = observation.robots.iter().map(|robot| Seen {
            x_m: robot.pose.x_m,
            y_m: robot.pose.y_m,
            yaw_rad: robot.pose.yaw_rad,
            age_s: robot.pose_age_s,
            forward_m_per_s: robot.twist.forward_m_per_s,
            left_m_per_s: robot.twist.left_m_per_s,
            yaw_rate_rad_per_s: robot.twist.yaw_rate_rad_per_s,
            online: robot.online,
            ranges_m: [0.0; BEAMS],
        });
        self.robots.extend(seen);
        surroundings.measure(observation.bodies, &mut self.robots);
    }
}
