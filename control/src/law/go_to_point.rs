//! `go_to_point`: every robot drives to its own goal.
//!
//! v = min(k |goal - x|, speed) towards the goal, bent to the right of robots in the way.

use super::motion::{Wish, twist_for};
use super::{Demand, Drive, GO_TO_POINT, Goal, Law, Observation, circulation};
use crate::vector::{clip, length, scale, sub, wrap};

/// A wanted yaw counts as reached this close.
const YAW_TOLERANCE_RAD: f64 = 0.05;
/// How far ahead a robot that cannot move sideways aims.
const AIM_M: f64 = 0.3;

#[derive(Debug)]
pub struct GoToPoint {
    robots: Vec<Progress>,
}

#[derive(Debug, Clone, Copy, Default)]
struct Progress {
    /// Yaw at the first tick; kept when the goal leaves the yaw free.
    first_yaw_rad: Option<f64>,
    finished: bool,
}

impl GoToPoint {
    pub fn new(robots: usize) -> GoToPoint {
        GoToPoint {
            robots: vec![Progress::default(); robots],
        }
    }
}

impl Law for GoToPoint {
    fn name(&self) -> &'static str {
        GO_TO_POINT
    }

    fn step(&mut self, observation: &Observation<'_>, demands: &mut [Demand]) {
        for (i, (progress, demand)) in self.robots.iter_mut().zip(demands).enumerate() {
            let (Some(robot), Some(body)) = (observation.robots.get(i), observation.bodies.get(i)) else {
                continue;
            };
            if !robot.pose.is_finite() {
                demand.finished = progress.finished;
                continue;
            }
            match observation.targets.get(i).and_then(|goals| goals.first()) {
                Some(goal) => drive(i, goal, body.drive, progress, observation, demand),
                None => {
                    demand.target = [robot.pose.x_m, robot.pose.y_m];
                    demand.finished = true;
                }
            }
        }
    }
}

fn drive(
    i: usize,
    goal: &Goal,
    drive: Drive,
    progress: &mut Progress,
    observation: &Observation<'_>,
    demand: &mut Demand,
) {
    let parameters = observation.parameters;
    let pose = &observation.robots[i].pose;
    let first_yaw_rad = *progress.first_yaw_rad.get_or_insert(pose.yaw_rad);
    let way = sub(goal.place_m, [pose.x_m, pose.y_m]);
    let arrived = length(way) <= parameters.get("reach_radius_m");
    let turned = goal
        .yaw_rad
        .is_none_or(|yaw_rad| wrap(yaw_rad - pose.yaw_rad).abs() <= YAW_TOLERANCE_RAD);
    progress.finished |= arrived && turned;
    demand.finished = progress.finished;
    demand.target = goal.place_m;
    let straight = clip(
        scale(way, parameters.get("goal_gain_per_s")),
        parameters.get("speed_m_per_s"),
    );
    let velocity = circulation::keep_right(straight, i, goal.place_m, parameters.get("keep_right"), observation);
    let holonomic = drive == Drive::Holonomic;
    let speed = length(velocity);
    let aim = match (arrived && !holonomic, speed > 1e-6) {
        (true, _) | (_, false) => [0.0, 0.0],
        _ => scale(velocity, length(way).min(AIM_M) / speed),
    };
    let yaw_rad = goal.yaw_rad.or(holonomic.then_some(first_yaw_rad));
    let wish = Wish { velocity, aim, yaw_rad };
    demand.twist = twist_for(drive, pose, &wish, parameters.get("yaw_gain_per_s"));
}
