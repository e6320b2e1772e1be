//! `waypoints`: the paper's eq. 1 as a moving reference point.
//!
//! x_ref(k+1) = x_ref(k) + eps_p (x_waypoint - x_ref(k))       [Ding et al. 2021, eq. 1]
//!
//! The step of the reference point is capped by speed and acceleration, waits for a robot that fell behind or is still
//! turning, and the robot follows with v = v_ref + k (x_ref - x). Waypoints are passed in order and never again.

use super::motion::{Wish, pointing_error_rad, pointing_share, twist_for};
use super::{Body, Demand, Drive, Goal, Law, Observation, Parameters, RobotObservation, WAYPOINTS, circulation};
use crate::TICK_S;
use crate::vector::{Vector, add, clip, direction, distance_to_segment, length, scale, sub, wrap};

/// How fast the reference point gains speed.
const ACCELERATION_M_PER_S2: f64 = 0.8;
/// The reference point waits when the robot is this far behind.
const LONGEST_LEAD_M: f64 = 0.25;
/// A wanted yaw counts as reached this close.
const YAW_TOLERANCE_RAD: f64 = 0.05;
const KEEP_RIGHT: f64 = 1.5;

#[derive(Debug)]
pub struct Waypoints {
    robots: Vec<Progress>,
}

/// Where a robot is on its path.
#[derive(Debug, Clone, Copy, Default)]
struct Progress {
    begun: bool,
    /// Active waypoint.
    index: usize,
    /// Start of the active segment.
    from_m: Vector,
    reference_m: Vector,
    reference_speed_m_per_s: f64,
    first_yaw_rad: f64,
    finished: bool,
}

impl Waypoints {
    pub fn new(robots: usize) -> Waypoints {
        Waypoints {
            robots: vec![Progress::default(); robots],
        }
    }
}

impl Law for Waypoints {
    fn name(&self) -> &'static str {
        WAYPOINTS
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
            let here = [robot.pose.x_m, robot.pose.y_m];
            let waypoints = observation.targets.get(i).map_or(&[][..], Vec::as_slice);
            if waypoints.is_empty() {
                *demand = Demand {
                    target: here,
                    finished: true,
                    ..Demand::default()
                };
                continue;
            }
            progress.begin(here, robot.pose.yaw_rad);
            progress.pass_reached(robot, waypoints, observation.parameters);
            *demand = progress.follow(i, robot, body, waypoints, observation);
        }
    }
}

impl Progress {
    fn begin(&mut self, here: Vector, yaw_rad: f64) {
        if !self.begun {
            *self = Progress {
                begun: true,
                from_m: here,
                reference_m: here,
                first_yaw_rad: yaw_rad,
                ..Progress::default()
            };
        }
    }

    /// Steps to the next waypoint when the robot has reached the active one.
    fn pass_reached(&mut self, robot: &RobotObservation, waypoints: &[Goal], parameters: &Parameters) {
        let here = [robot.pose.x_m, robot.pose.y_m];
        while !self.finished {
            let Some(active) = waypoints.get(self.index) else { break };
            let close = length(sub(active.place_m, here)) <= parameters.get("reach_radius_m");
            let turned = active
                .yaw_rad
                .is_none_or(|yaw_rad| wrap(yaw_rad - robot.pose.yaw_rad).abs() <= YAW_TOLERANCE_RAD);
            if !(close && turned) {
                break;
            }
            if self.index + 1 == waypoints.len() {
                self.finished = true;
            } else {
                self.index += 1;
                self.from_m = active.place_m;
                self.reference_m = active.place_m;
                self.reference_speed_m_per_s = 0.0;
            }
        }
    }

    fn follow(
        &mut self,
        i: usize,
        robot: &RobotObservation,
        body: &Body,
        waypoints: &[Goal],
        observation: &Observation<'_>,
    ) -> Demand {
        let parameters = observation.parameters;
        let pose = &robot.pose;
        let here = [pose.x_m, pose.y_m];
        let active = waypoints[self.index];
        let look_ahead_m = parameters.get("look_ahead_m");
        let ahead = clip(sub(active.place_m, self.reference_m), look_ahead_m);
        let aim = sub(add(self.reference_m, ahead), here);
        let reference_velocity = self.pull(&active, self.share(robot, body, aim), parameters);

        let lag = sub(self.reference_m, here);
        let speed_limit = parameters.get("speed_m_per_s") * 1.25;
        let straight = clip(
            add(reference_velocity, scale(lag, parameters.get("tracking_gain_per_s"))),
            speed_limit,
        );
        let velocity = circulation::keep_right(straight, i, active.place_m, KEEP_RIGHT, observation);
        let swerves = length(sub(velocity, straight)) > 1e-3;
        let aim = match direction(velocity) {
            Some(way) if swerves => scale(way, look_ahead_m),
            _ => aim,
        };
        let holonomic = body.drive == Drive::Holonomic;
        let parked = self.finished && !holonomic;
        let wish = Wish {
            velocity: if parked { [0.0, 0.0] } else { velocity },
            aim: if parked || self.turns_on_the_spot(here, &active, parameters) {
                [0.0, 0.0]
            } else {
                aim
            },
            yaw_rad: active.yaw_rad.or(holonomic.then_some(self.first_yaw_rad)),
        };
        Demand {
            twist: twist_for(body.drive, pose, &wish, parameters.get("yaw_gain_per_s")),
            target: self.reference_m,
            segment: Some([self.from_m, active.place_m]),
            finished: self.finished,
        }
    }

    /// The robot stands on its waypoint and only its yaw is missing.
    fn turns_on_the_spot(&self, here: Vector, active: &Goal, parameters: &Parameters) -> bool {
        active.yaw_rad.is_some() && length(sub(active.place_m, here)) <= parameters.get("reach_radius_m")
    }

    /// Share of its step that the reference point may make: it waits for the robot.
    fn share(&self, robot: &RobotObservation, body: &Body, aim: Vector) -> f64 {
        let here = [robot.pose.x_m, robot.pose.y_m];
        let behind_m = length(sub(self.reference_m, here));
        let near = ((LONGEST_LEAD_M - behind_m) / (0.5 * LONGEST_LEAD_M)).clamp(0.0, 1.0);
        match body.drive {
            Drive::TurnInPlace { .. } => near * pointing_error_rad(&robot.pose, aim).map_or(1.0, pointing_share),
            Drive::Holonomic | Drive::Steered { .. } => near,
        }
    }

    /// Eq. 1 with its step capped; returns the velocity of the reference point.
    fn pull(&mut self, active: &Goal, share: f64, parameters: &Parameters) -> Vector {
        let step = scale(
            sub(active.place_m, self.reference_m),
            parameters.get("epsilon_p") * share,
        );
        let fastest = (self.reference_speed_m_per_s + ACCELERATION_M_PER_S2 * TICK_S)
            .min(parameters.get("speed_m_per_s") * share);
        let step = clip(step, fastest * TICK_S);
        self.reference_m = add(self.reference_m, step);
        self.reference_speed_m_per_s = length(step) / TICK_S;
        scale(step, 1.0 / TICK_S)
    }
}

/// Distance of a place from the active segment of a path.
pub fn path_error_m(place_m: Vector, segment: [Vector; 2]) -> f64 {
    distance_to_segment(place_m, segment[0], segment[1])
}
