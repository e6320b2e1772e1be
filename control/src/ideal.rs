//! The ideal robot: it does at once what the law tells it. Where it is at a time is what a run can be held against.

use crate::law::{self, Demand, Drive, Observation, Parameters, RobotObservation};
use crate::scenario::{FieldProblem, Scenario};
use crate::team::REST_TICKS;
use crate::vector::{dot, sub, world_from_body};
use crate::{TICK_RATE_HZ, TICK_S};
use twin::pose::Pose;
use twin::twist::BodyTwist;

/// Longest constant delay that counts as none, ticks, and the steps in which it is looked for.
const DELAY_TICKS: usize = 120;
const DELAY_STEP_TICKS: usize = 3;

/// How the ideal robot drove.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Ideal {
    /// `[x_m, y_m, yaw_rad]`, a control tick apart.
    pub poses: Vec<[f64; 3]>,
    /// The law said that it was at the end.
    pub finished: bool,
}

/// Drives the first robot of a scenario, alone, from its start under the scenario's law.
///
/// - `longest_s`: ends then at the latest.
/// - `None`: the law is not one of those that ship, or there is no robot.
pub fn drive(scenario: &Scenario, longest_s: f64) -> Result<Option<Ideal>, Vec<FieldProblem>> {
    let robots = crate::team::robots(scenario)?;
    let bodies = law::bodies(scenario, &robots);
    let (Some(mut law), Some(robot)) = (law::build(scenario), scenario.experiment.robots.first()) else {
        return Ok(None);
    };
    let (targets, parameters) = (law::goals(scenario), Parameters::of(&scenario.experiment.control));
    let axle_x_m = match bodies.first().map(|body| body.drive) {
        Some(Drive::Steered { axle_x_m, .. }) => axle_x_m,
        _ => 0.0,
    };
    let mut pose = [robot.start.x_m, robot.start.y_m, robot.start.yaw_rad];
    let mut ideal = Ideal::default();
    let (mut twist, mut rest) = (BodyTwist::default(), 0);
    for tick in 0..(longest_s * f64::from(TICK_RATE_HZ)) as u64 {
        ideal.poses.push(pose);
        let seen = RobotObservation {
            pose: Pose {
                x_m: pose[0],
                y_m: pose[1],
                yaw_rad: pose[2],
            },
            pose_age_s: 0.0,
            twist: BodyTwist {
                left_m_per_s: twist.left_m_per_s - axle_x_m * twist.yaw_rate_rad_per_s,
                ..twist
            },
            online: true,
        };
        let observation = Observation {
            tick,
            robots: &[seen],
            bodies: &bodies,
            arena_m: [scenario.arena.width_m, scenario.arena.height_m],
            targets: &targets,
            parameters: &parameters,
        };
        let mut demands = [Demand::default()];
        law.step(&observation, &mut demands);
        twist = demands[0].twist;
        ideal.finished = demands[0].finished;
        rest = if ideal.finished { rest + 1 } else { 0 };
        if rest > REST_TICKS {
            break;
        }
        let yaw_rad = pose[2] + 0.5 * twist.yaw_rate_rad_per_s * TICK_S;
        let left_m_per_s = twist.left_m_per_s - axle_x_m * twist.yaw_rate_rad_per_s;
        let velocity = world_from_body([twist.forward_m_per_s, left_m_per_s], yaw_rad);
        pose[0] += TICK_S * velocity[0];
        pose[1] += TICK_S * velocity[1];
        pose[2] += TICK_S * twist.yaw_rate_rad_per_s;
    }
    Ok(Some(ideal))
}

impl Ideal {
    /// RMS distance of a robot from where the ideal one is at the same time, m; a constant delay, up to 1 s, is taken out.
    ///
    /// - `poses`: of the robot, `[x_m, y_m, yaw_rad]`.
    /// - `ticks_apart`: control ticks from one of them to the next.
    pub fn time_rms_m(&self, poses: &[[f64; 3]], ticks_apart: usize) -> f64 {
        let rms = |delay: usize| {
            let squares = poses.iter().enumerate().map(|(k, pose)| {
                let then = (k * ticks_apart)
                    .saturating_sub(delay)
                    .min(self.poses.len().saturating_sub(1));
                let square = |at: &[f64; 3]| {
                    let away = sub([pose[0], pose[1]], [at[0], at[1]]);
                    dot(away, away)
                };
                self.poses.get(then).map_or(0.0, square)
            });
            (squares.sum::<f64>() / poses.len().max(1) as f64).sqrt()
        };
        let delays = (0..=DELAY_TICKS).step_by(DELAY_STEP_TICKS);
        delays.map(rms).fold(f64::INFINITY, f64::min)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_delayed_robot_is_as_good_as_the_ideal_one_and_one_beside_it_is_not() {
        let ideal = Ideal {
            poses: (0..600).map(|tick| [f64::from(tick) * 0.005, 0.0, 0.0]).collect(),
            finished: true,
        };
        let seen = |delay: u32, beside_m: f64| -> Vec<[f64; 3]> {
            let ticks = (0..600_u32).step_by(4);
            ticks
                .map(|tick| [f64::from(tick.saturating_sub(delay)) * 0.005, beside_m, 0.0])
                .collect()
        };
        assert!(ideal.time_rms_m(&seen(30, 0.0), 4) < 1e-9);
        assert!((ideal.time_rms_m(&seen(60, 0.02), 4) - 0.02).abs() < 1e-9);
        assert!(ideal.time_rms_m(&seen(240, 0.0), 4) > 0.1);
    }
}
