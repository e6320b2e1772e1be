//! Manoeuvres of the catalogue, and how they are driven.

use twin::replay::CommandRow;
use twin::robot::{Robot, RobotDescription};
use twin::twist::BodyTwist;

use crate::random::Random;

/// What a robot is to do.
#[derive(Debug, Clone, Copy)]
pub(super) struct Manoeuvre {
    pub name: &'static str,
    pub duration_s: f64,
    pub what: &'static str,
}

/// By what shows an effect.
pub(super) const CATALOGUE: [Manoeuvre; 9] = [
    Manoeuvre {
        name: "slow_ramps",
        duration_s: 20.0,
        what: "slow ramps of the wheel speeds through zero, both ways, with stops",
    },
    Manoeuvre {
        name: "speed_steps",
        duration_s: 20.0,
        what: "steps between several steady speeds, forward and backward",
    },
    Manoeuvre {
        name: "random_steps",
        duration_s: 30.0,
        what: "randomly spaced steps of all sizes up to the limits",
    },
    Manoeuvre {
        name: "spins",
        duration_s: 20.0,
        what: "turns on the spot at several rates, left and right",
    },
    Manoeuvre {
        name: "straight_lines",
        duration_s: 30.0,
        what: "straight lines over the whole field, forward and backward",
    },
    Manoeuvre {
        name: "compass",
        duration_s: 40.0,
        what: "the same straight line at eight headings",
    },
    Manoeuvre {
        name: "circles",
        duration_s: 30.0,
        what: "circles left and right at rising speed",
    },
    Manoeuvre {
        name: "field_grid",
        duration_s: 60.0,
        what: "slow passes over the whole field in lanes of 0.3 m",
    },
    Manoeuvre {
        name: "strafes",
        duration_s: 20.0,
        what: "sideways and diagonal passes",
    },
];

/// Their places.
const SLOW_RAMPS: usize = 0;
const SPEED_STEPS: usize = 1;
pub(super) const RANDOM_STEPS: usize = 2;
const SPINS: usize = 3;
const STRAIGHT_LINES: usize = 4;
const COMPASS: usize = 5;
const CIRCLES: usize = 6;
const FIELD_GRID: usize = 7;

/// So much of each is driven by the twin, after a rest, s.
pub(super) const TRIAL_S: f64 = 12.0;
const REST_S: f64 = 1.0;
/// Rate of the set-points and of what is measured, Hz.
pub(super) const RATE_HZ: f64 = 120.0;
/// Cars drive at least so fast while they turn, m/s, and turn on no smaller circle, m.
const TURNING_M_PER_S: f64 = 0.3;
const SMALLEST_RADIUS_M: f64 = 0.7;
/// Of the random steps: how long each lasts, s, and the largest speeds, m/s and rad/s.
const STEP_S: f64 = 0.8;
const STEP_M_PER_S: f64 = 0.6;
const STEP_RAD_PER_S: f64 = 1.5;

/// Forward, left and yaw rate of a part of a programme that lasts so long.
type Part = (f64, [f64; 3]);

/// A manoeuvre as a body's twist over time: one cycle of it.
fn cycle(number: usize) -> Vec<Part> {
    let turn = core::f64::consts::FRAC_PI_2;
    let steps =
        |speeds: &[f64], lasts_s: f64| -> Vec<Part> { speeds.iter().map(|v| (lasts_s, [*v, 0.0, 0.0])).collect() };
    match number {
        SLOW_RAMPS => {
            let ramp = [0.03, 0.06, 0.09, 0.12, 0.15, 0.12, 0.09, 0.06, 0.03, 0.0];
            let back = ramp.map(|v| -v);
            [steps(&ramp, 0.25), steps(&back, 0.25)].concat()
        }
        SPEED_STEPS => steps(&[0.2, 0.4, 0.6, 0.3, 0.0, -0.2, -0.4, -0.6, -0.3, 0.0], 1.0),
        RANDOM_STEPS => {
            let mut random = Random::new(1, 0x7472_6961_6c73);
            let mut within = |most: f64| most * (2.0 * random.uniform() - 1.0);
            let parts = 0..(TRIAL_S / STEP_S) as usize;
            parts
                .map(|_| {
                    (
                        STEP_S,
                        [within(STEP_M_PER_S), within(STEP_M_PER_S), within(STEP_RAD_PER_S)],
                    )
                })
                .collect()
        }
        SPINS => {
            let rates = [0.5, 1.0, 1.5, 0.0, -0.5, -1.0, -1.5, 0.0];
            rates.iter().map(|rate| (1.25, [0.0, 0.0, *rate])).collect()
        }
        STRAIGHT_LINES => vec![
            (3.0, [0.5, 0.0, 0.0]),
            (0.5, [0.0; 3]),
            (3.0, [-0.5, 0.0, 0.0]),
            (0.5, [0.0; 3]),
            (1.0, [0.0, 0.0, turn]),
        ],
        COMPASS => vec![(1.5, [0.4, 0.0, 0.0]), (1.5, [-0.4, 0.0, 0.0]), (0.5, [0.0, 0.0, turn])],
        CIRCLES => {
            let speeds = [0.2, 0.3, 0.4, 0.5, 0.6];
            let round = |side: f64| {
                speeds
                    .iter()
                    .map(move |v| (1.2, [*v, 0.0, side * v / SMALLEST_RADIUS_M]))
            };
            round(1.0).chain(round(-1.0)).collect()
        }
        FIELD_GRID => {
            let lane = |side: f64| {
                let turned = (1.0, [0.0, 0.0, side * turn]);
                [(4.0, [0.3, 0.0, 0.0]), turned, (1.0, [0.3, 0.0, 0.0]), turned]
            };
            [lane(1.0), lane(-1.0)].concat()
        }
        // Sideways and diagonal.
        _ => {
            let ways = [
                [0.0, 1.0],
                [0.0, -1.0],
                [0.7, 0.7],
                [-0.7, -0.7],
                [0.7, -0.7],
                [-0.7, 0.7],
            ];
            ways.map(|[forward, left]| (1.5, [0.5 * forward, 0.5 * left, 0.0]))
                .to_vec()
        }
    }
}

/// The twist at a time, as far as the robot can move so: none sideways without omni wheels, cars turn while they drive.
fn twist_at(cycle: &[Part], time_s: f64, robot: &RobotDescription) -> BodyTwist {
    let all_s: f64 = cycle.iter().map(|part| part.0).sum();
    let mut left_s = time_s - libm::floor(time_s / all_s) * all_s;
    let mut wanted = [0.0; 3];
    for (lasts_s, twist) in cycle {
        wanted = *twist;
        if left_s < *lasts_s {
            break;
        }
        left_s -= lasts_s;
    }
    let [mut forward_m_per_s, mut left_m_per_s, mut yaw_rate_rad_per_s] = wanted;
    if !robot.wheels.iter().any(|wheel| wheel.kind == "omni") {
        // What would go sideways goes forward and back.
        if forward_m_per_s == 0.0 {
            forward_m_per_s = left_m_per_s;
        }
        left_m_per_s = 0.0;
    }
    if robot.steering.is_some() && yaw_rate_rad_per_s != 0.0 {
        if forward_m_per_s.abs() < TURNING_M_PER_S {
            forward_m_per_s = TURNING_M_PER_S.copysign(forward_m_per_s);
        }
        let most = forward_m_per_s.abs() / SMALLEST_RADIUS_M;
        yaw_rate_rad_per_s = yaw_rate_rad_per_s.clamp(-most, most);
    }
    BodyTwist {
        forward_m_per_s,
        left_m_per_s,
        yaw_rate_rad_per_s,
    }
}

/// Twists of the manoeuvre, slower where wheels would be told to turn faster than `fastest_rad_per_s`.
pub(super) fn rows(robot: &Robot, number: usize, fastest_rad_per_s: f64) -> Vec<CommandRow> {
    let cycle = cycle(number);
    let description = robot.description();
    let times = (0..((REST_S + TRIAL_S) * RATE_HZ) as usize).map(|k| k as f64 / RATE_HZ);
    let twists: Vec<(f64, BodyTwist)> = times
        .map(|time_s| {
            let since_s = time_s - REST_S;
            let twist = if since_s < 0.0 {
                BodyTwist::default()
            } else {
                twist_at(&cycle, since_s, description)
            };
            (time_s, twist)
        })
        .collect();
    let wheels = twists
        .iter()
        .flat_map(|(_, twist)| robot.wheel_speeds(*twist).wheel_rad_per_s);
    let most = wheels.map(f64::abs).fold(0.0, f64::max);
    let share = if most > fastest_rad_per_s {
        fastest_rad_per_s / most
    } else {
        1.0
    };
    let told = twists.iter().map(|(time_s, twist)| CommandRow {
        time_s: *time_s,
        forward_m_per_s: Some(share * twist.forward_m_per_s),
        left_m_per_s: Some(share * twist.left_m_per_s),
        yaw_rate_rad_per_s: Some(share * twist.yaw_rate_rad_per_s),
        ..CommandRow::default()
    });
    told.collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use twin::golden::reference_robot;
    use twin::pose::Pose;
    use twin::replay::{HeldCommand, ReplayRow, replay};

    /// Every chassis can move as it is told, for all of the trial, and no wheel is told more than is allowed.
    #[test]
    fn every_manoeuvre_is_one_that_the_robot_can_drive() {
        for chassis in ["diff2", "diff4", "omni4", "fwd", "rwd", "awd"] {
            let robot = Robot::new(reference_robot(chassis)).expect("a robot");
            for number in 0..CATALOGUE.len() {
                let told = rows(&robot, number, 8.0);
                assert_eq!(told.len(), ((REST_S + TRIAL_S) * RATE_HZ) as usize);
                let mut held = HeldCommand::default();
                let mut most = 0.0_f64;
                for row in &told {
                    held.apply(&robot, row);
                    most = held
                        .command()
                        .wheel_rad_per_s
                        .iter()
                        .fold(most, |most, w| most.max(w.abs()));
                    let (forward, left) = (row.forward_m_per_s.unwrap_or(0.0), row.left_m_per_s.unwrap_or(0.0));
                    let yaw_rate = row.yaw_rate_rad_per_s.unwrap_or(0.0);
                    assert!(chassis == "omni4" || left == 0.0, "{chassis} {number}");
                    let is_car = robot.description().steering.is_some();
                    assert!(
                        !is_car || yaw_rate.abs() <= forward.abs() / SMALLEST_RADIUS_M + 1e-12,
                        "{chassis} {number}"
                    );
                }
                assert!(most > 0.5 && most <= 8.0 + 1e-9, "{chassis} {number}: {most}");
                let out = replay(&robot, Pose::default(), &told).expect("it can be driven");
                let far = |row: &ReplayRow| row.state.pose.x_m.abs().max(row.state.pose.y_m.abs());
                assert!(out.iter().all(|row| far(row) < 6.0), "{chassis} {number}");
            }
        }
    }
}
