//! Control laws: one interface for those that ship and for controllers that users write.
//!
//! A law sees what the laboratory (or the twin) measured and says which body twist each robot should have. It may ask
//! for anything: limits, walls and other robots are the safety filter's business.

pub mod assignment;
mod circulation;
mod consensus;
mod corner;
mod coverage;
mod detour;
mod driver;
mod fault;
mod formation;
mod go_to_point;
mod go_to_pose;
mod goal_assignment;
mod graph;
mod leader_follower;
mod manoeuvre;
mod motion;
mod note;
pub mod own;
mod parameters;
mod path_following;
mod piece;
mod push;
mod reeds_shepp;
mod shape;
mod targets;
mod trajectory;
mod trajectory_tracking;
mod waypoints;

use twin::pose::Pose;
use twin::robot::Robot;
use twin::twist::BodyTwist;

pub use driver::{Driver, Request};
pub use fault::{Fault, FaultKind, Standing, place_in};
pub use motion::Drive;
pub use note::Note;
pub use parameters::{LAWS, LawSpec, ParameterSpec, Parameters, law_spec};
pub use piece::{Piece, Place};
pub use push::Push;
pub use targets::{Owner, TargetRule, YawUse};
pub use waypoints::path_error_m;

pub(crate) use parameters::check;

use crate::scenario::{FieldProblem, Scenario};

/// Name of the law that follows waypoints (the paper's eq. 1).
pub const WAYPOINTS: &str = "waypoints";
/// Name of the law that drives each robot to its own goal.
pub const GO_TO_POINT: &str = "go_to_point";
/// Name of the law that drives each robot to its own pose.
pub const GO_TO_POSE: &str = "go_to_pose";
/// Name of the law that follows a path of waypoints by PID on the distance to it.
pub const PATH_FOLLOWING: &str = "path_following";
/// Name of the law that is at each target at its time.
pub const TRAJECTORY_TRACKING: &str = "trajectory_tracking";
/// Name of the law by which robots agree on a place.
pub const CONSENSUS: &str = "consensus";
/// Name of the law by which each robot follows the one before it.
pub const LEADER_FOLLOWER: &str = "leader_follower";
/// Name of the law that makes a shape without a leader.
pub const FORMATION: &str = "formation";
/// Name of the law that spreads robots over the arena.
pub const COVERAGE: &str = "coverage";
/// Name of the law that shares goals out.
pub const GOAL_ASSIGNMENT: &str = "goal_assignment";
/// Name of the law that a user wrote: [`own`].
pub const OWN: &str = "own";
/// Constant body twists; used by the scenario gallery only and refused in experiments.
pub const PUSH: &str = "push";

/// What is known about one robot at a control tick.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RobotObservation {
    pub pose: Pose,
    /// Time since the pose was measured; negative of one that is predicted so far ahead, see [`crate::prediction`].
    pub pose_age_s: f64,
    /// Estimated twist in the body frame.
    pub twist: BodyTwist,
    /// The link to the robot works.
    pub online: bool,
}

/// What a law must know about a robot's body; constant during a run.
#[derive(Debug, Clone, PartialEq)]
pub struct Body {
    pub name: String,
    pub drive: Drive,
    pub bounding_radius_m: f64,
    /// Point about which a robot that turns on the spot does so, ahead of the body origin, as the model that corrects its
    /// commands has it; 0 without a model.
    pub turn_point_x_m: f64,
}

/// A waypoint or goal of one robot.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Goal {
    /// `[x_m, y_m]` in the world frame.
    pub place_m: [f64; 2],
    /// Yaw on arrival; free when `None`.
    pub yaw_rad: Option<f64>,
}

/// Everything a law may look at; robots, bodies and targets share one order.
#[derive(Debug, Clone, Copy)]
pub struct Observation<'a> {
    pub tick: u64,
    /// All robots of the experiment: a law's own and its neighbours.
    pub robots: &'a [RobotObservation],
    pub bodies: &'a [Body],
    /// Width and height of the arena around the origin.
    pub arena_m: [f64; 2],
    /// Targets of each robot, in order.
    pub targets: &'a [Vec<Goal>],
    pub parameters: &'a Parameters,
}

/// What a law wants from one robot.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Demand {
    /// Desired twist in the body frame.
    pub twist: BodyTwist,
    /// Moving reference point, for display: `[x_m, y_m]`.
    pub target: [f64; 2],
    /// Active segment of the path that the robot should stay on, `[from, to]`, for laws that follow a path.
    pub segment: Option<[[f64; 2]; 2]>,
    /// The robot has reached the last of its targets.
    pub finished: bool,
}

/// A control law for a whole team. Called once per control tick; must be deterministic and must not allocate.
pub trait Law: std::fmt::Debug + Send {
    /// Name as in `control.law`.
    fn name(&self) -> &'static str;
    /// Writes one demand per robot; `demands` has as many entries as `observation.robots` and is zero on entry.
    fn step(&mut self, observation: &Observation<'_>, demands: &mut [Demand]);
    /// How it stands after the step; laws that ship always answer.
    fn standing(&self) -> Standing<'_> {
        Standing::Answered
    }
    /// What it said and drew on the last step.
    fn notes(&self) -> &[Note] {
        &[]
    }
}

/// The law that a checked scenario names.
pub fn build(scenario: &Scenario) -> Option<Box<dyn Law>> {
    let robots = scenario.experiment.robots.len();
    match scenario.experiment.control.law.as_str() {
        WAYPOINTS => Some(Box::new(waypoints::Waypoints::new(robots))),
        GO_TO_POINT => Some(Box::new(go_to_point::GoToPoint::new(robots))),
        GO_TO_POSE => Some(Box::new(go_to_pose::GoToPose::new(scenario))),
        PATH_FOLLOWING => Some(Box::new(path_following::PathFollowing::new(scenario))),
        TRAJECTORY_TRACKING => Some(Box::new(trajectory_tracking::TrajectoryTracking::new(scenario))),
        CONSENSUS => Some(Box::new(consensus::Consensus::new(scenario))),
        LEADER_FOLLOWER => Some(Box::new(leader_follower::LeaderFollower::new(scenario))),
        FORMATION => Some(Box::new(formation::Formation::new(scenario))),
        COVERAGE => Some(Box::new(coverage::Coverage::new(scenario))),
        GOAL_ASSIGNMENT => Some(Box::new(goal_assignment::GoalAssignment::new(scenario))),
        _ => None,
    }
}

/// The rules that only the law of a scenario knows; the scenario has passed all others.
pub(crate) fn check_scenario(scenario: &Scenario) -> Vec<FieldProblem> {
    match scenario.experiment.control.law.as_str() {
        PATH_FOLLOWING => corner::check(scenario),
        TRAJECTORY_TRACKING => trajectory_tracking::check(scenario),
        CONSENSUS => consensus::check(scenario),
        LEADER_FOLLOWER => leader_follower::check(scenario),
        FORMATION => shape::check(scenario),
        GOAL_ASSIGNMENT => goal_assignment::check(scenario),
        _ => Vec::new(),
    }
}

/// Drives of a scenario's robots; those whose description cannot be used count as holonomic.
pub(crate) fn drives(scenario: &Scenario) -> Vec<Drive> {
    let of = |robot: &crate::scenario::ScenarioRobot| {
        Robot::new(robot.description.clone()).map_or(Drive::Holonomic, |robot| Drive::of(&robot))
    };
    scenario.robots.iter().map(of).collect()
}

/// The way along which `path_following` leads a robot: through its corners as its chassis can drive them; empty without any.
pub fn path(scenario: &Scenario, robot: usize) -> Vec<Piece> {
    let drive = drives(scenario).get(robot).copied().unwrap_or(Drive::Holonomic);
    corner::pieces(&corner::corners(scenario, robot), drive).unwrap_or_default()
}

/// Bodies of a scenario's robots.
pub fn bodies(scenario: &Scenario, robots: &[Robot]) -> Vec<Body> {
    let radii = scenario.robots.iter().map(|robot| robot.bounding_radius_m);
    robots
        .iter()
        .zip(radii)
        .map(|(robot, bounding_radius_m)| Body {
            name: robot.name().to_owned(),
            drive: Drive::of(robot),
            bounding_radius_m,
            turn_point_x_m: 0.0,
        })
        .collect()
}

/// Targets of every robot of a scenario.
pub fn goals(scenario: &Scenario) -> Vec<Vec<Goal>> {
    (0..scenario.experiment.robots.len())
        .map(|i| {
            scenario
                .targets_of(i)
                .map(|t| Goal {
                    place_m: [t.x_m, t.y_m],
                    yaw_rad: t.yaw_rad,
                })
                .collect()
        })
        .collect()
}
