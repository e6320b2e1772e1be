//! The filter on any state at all, all six chassis: nothing panics, every command is finite and within every limit, and what
//! is sent keeps the rows that can be checked from outside. 10 million calls with
//! `cargo test -p control --test filter_total -- --ignored`; fewer on every run.

mod common;

use common::{CHASSIS, Pcg, chassis_robot};
use control::law::RobotObservation;
use control::safety::{FilterBody, Filtered, Geofence, Limits, SafetyFilter};
use twin::pose::Pose;
use twin::robot::Robot;
use twin::twist::BodyTwist;
use twin::world::Contents;

const ARENA_M: [f64; 2] = [4.0, 3.0];
const RADIUS_M: f64 = 0.25;
/// Oldest pose that a robot may be driven by.
const OLDEST_S: f64 = 0.1;
/// What the rows may be missed by in what is sent.
const RESIDUAL_M_PER_S: f64 = 1e-6;
/// Also what a learned model or a broken tracker may say.
const ODD: [f64; 9] = [
    f64::NAN,
    f64::INFINITY,
    f64::NEG_INFINITY,
    1e300,
    -1e300,
    1e30,
    f64::MAX,
    0.0,
    1e-320,
];

struct Team {
    filter: SafetyFilter,
    robots: Vec<Robot>,
    /// Middle of the axle that cannot slide, ahead of the body origin; it has no sideways velocity.
    axles_x_m: Vec<f64>,
}

fn team(number: usize) -> Team {
    let n = [1, 2, 3, 4, 5, 6, 10][number % 7];
    let robots: Vec<Robot> = (0..n)
        .map(|i| {
            let chassis = CHASSIS[(i + number / 7 + number) % 6];
            let description = chassis_robot(chassis, "r")["description"].clone();
            Robot::new(serde_json::from_value(description).expect("description")).expect("robot")
        })
        .collect();
    let bodies = robots.iter().map(|robot| FilterBody {
        robot: robot.clone(),
        bounding_radius_m: RADIUS_M,
    });
    let mut filter = SafetyFilter::new(Limits::default(), ARENA_M, bodies.collect());
    if number % 3 == 1 {
        filter = filter.with_contents(&contents());
    }
    if number % 4 == 3 {
        let corners = [
            [-1.9, -1.4],
            [1.9, -1.4],
            [1.9, 0.5],
            [0.6, 0.5],
            [0.6, 1.4],
            [-1.9, 1.4],
        ];
        filter = filter.with_geofence(Geofence::polygon(&corners).expect("fence"));
    }
    let axles_x_m = robots.iter().map(axle_x_m).collect();
    Team {
        filter,
        robots,
        axles_x_m,
    }
}

fn contents() -> Contents {
    serde_json::from_value(serde_json::json!({
        "fixed": [{"name": "shelf", "shape": {"rectangle": {"length_m": 0.5, "width_m": 0.2}}, "pose": {"x_m": 0.6, "y_m": 0.0, "yaw_rad": 0.4}}],
        "pushable": [{"name": "ball", "shape": {"circle": {"radius_m": 0.1}}, "pose": {"x_m": -1.2, "y_m": 0.8, "yaw_rad": 0.0},
            "mass_kg": 1.0, "floor_friction": 0.3}]
    }))
    .expect("contents")
}

fn axle_x_m(robot: &Robot) -> f64 {
    let wheels = robot.description().wheels.iter();
    let holding: Vec<f64> = wheels
        .filter(|wheel| !wheel.steered && wheel.kind == "standard")
        .map(|wheel| wheel.x_m)
        .collect();
    holding.iter().sum::<f64>() / holding.len().max(1) as f64
}

fn strange(random: &mut Pcg, low: f64, high: f64, one_in: u32) -> f64 {
    if random.next().is_multiple_of(one_in) {
        ODD[random.next() as usize % ODD.len()]
    } else {
        random.between(low, high)
    }
}

/// States from tame (close together, all fresh) to hopeless; some robots stand in one place.
fn states(random: &mut Pcg, n: usize) -> (Vec<RobotObservation>, Vec<BodyTwist>) {
    let one_in = [2_000_000, 200, 20][random.next() as usize % 3];
    let spread = [0.3, 1.0][random.next() as usize % 2];
    let mut robots: Vec<RobotObservation> = (0..n)
        .map(|_| RobotObservation {
            pose: Pose {
                x_m: spread * strange(random, -2.2, 2.2, one_in),
                y_m: spread * strange(random, -1.7, 1.7, one_in),
                yaw_rad: strange(random, -4.0, 4.0, one_in),
            },
            pose_age_s: if one_in > 1000 {
                0.017
            } else {
                strange(random, 0.0, 0.11, one_in)
            },
            twist: BodyTwist {
                forward_m_per_s: strange(random, -0.6, 0.6, one_in),
                left_m_per_s: strange(random, -0.6, 0.6, one_in),
                yaw_rate_rad_per_s: strange(random, -2.0, 2.0, one_in),
            },
            online: one_in > 1000 || !random.next().is_multiple_of(20),
        })
        .collect();
    let wanted = (0..n)
        .map(|_| BodyTwist {
            forward_m_per_s: strange(random, -3.0, 3.0, one_in),
            left_m_per_s: strange(random, -3.0, 3.0, one_in),
            yaw_rate_rad_per_s: strange(random, -9.0, 9.0, one_in),
        })
        .collect();
    if n > 1 && random.next().is_multiple_of(40) {
        robots[1].pose = robots[0].pose;
    }
    (robots, wanted)
}

#[derive(Debug, Default)]
struct Seen {
    calls: u64,
    commands: u64,
    stopped: u64,
    pair_rows: u64,
    wall_rows: u64,
    worst_m_per_s: f64,
}

impl Seen {
    fn row(&mut self, value_m_per_s: f64) {
        self.worst_m_per_s = self.worst_m_per_s.min(value_m_per_s);
        assert!(value_m_per_s >= -RESIDUAL_M_PER_S, "{value_m_per_s} {self:?}");
    }

    /// Limits of every command, after the last transform.
    fn limits(&mut self, filtered: &Filtered, robot: &Robot) {
        let limits = Limits::default();
        let (twist, wheels) = (filtered.command.twist(), filtered.command.wheel_command());
        assert_eq!(wheels.non_finite_field(), None);
        let most = robot.max_wheel_speed_rad_per_s() * limits.wheel_share * (1.0 + 1e-6);
        assert!(
            wheels.wheel_rad_per_s.iter().all(|speed| speed.abs() <= most),
            "{wheels:?}"
        );
        assert!(wheels.steering_rad.abs() <= robot.max_steering_rad() + 1e-12);
        assert!(twist.speed_m_per_s() <= limits.speed_m_per_s + 1e-9, "{twist:?}");
        assert!(
            twist.yaw_rate_rad_per_s.abs() <= limits.yaw_rate_rad_per_s + 1e-9,
            "{twist:?}"
        );
        self.commands += 1;
    }

    /// Velocity of the body origin in the world; none of a robot that the filter stops.
    fn velocity(&mut self, filtered: &Filtered, seen: &RobotObservation, axle_x_m: f64) -> Option<[f64; 2]> {
        if filtered.intervention.is_some_and(|one| one.label() == "stop") {
            self.stopped += 1;
            return None;
        }
        let twist = filtered.command.twist();
        let (s, c) = (libm::sin(seen.pose.yaw_rad), libm::cos(seen.pose.yaw_rad));
        let left = twist.left_m_per_s - axle_x_m * twist.yaw_rate_rad_per_s;
        Some([
            c * twist.forward_m_per_s - s * left,
            s * twist.forward_m_per_s + c * left,
        ])
    }

    /// Circles that overlap do not approach, and those behind a wall go no further.
    fn rows(&mut self, team: &Team, robots: &[RobotObservation], filtered: &[Filtered]) {
        let velocities: Vec<_> = (0..robots.len())
            .map(|i| self.velocity(&filtered[i], &robots[i], team.axles_x_m[i]))
            .collect();
        for (j, b) in robots.iter().enumerate() {
            let Some(v_b) = velocities[j] else { continue };
            let half = [0.5 * ARENA_M[0] - RADIUS_M, 0.5 * ARENA_M[1] - RADIUS_M];
            for (axis, at) in [b.pose.x_m, b.pose.y_m].into_iter().enumerate() {
                if at.abs() > half[axis] {
                    self.wall_rows += 1;
                    self.row(-v_b[axis] * at.signum());
                }
            }
            for (i, a) in robots[..j].iter().enumerate() {
                let Some(v_a) = velocities[i] else { continue };
                let line = [a.pose.x_m - b.pose.x_m, a.pose.y_m - b.pose.y_m];
                let distance_m = (line[0] * line[0] + line[1] * line[1]).sqrt();
                if distance_m < 2.0 * RADIUS_M {
                    self.pair_rows += 1;
                    let opening = line[0] * (v_a[0] - v_b[0]) + line[1] * (v_a[1] - v_b[1]);
                    if opening / distance_m < -RESIDUAL_M_PER_S {
                        println!(
                            "{i} {j} {:?} {:?}\n{a:?}\n{b:?}\n{:?}\n{:?}",
                            team.robots[i].description().chassis,
                            team.robots[j].description().chassis,
                            filtered[i],
                            filtered[j]
                        );
                    }
                    self.row(opening / distance_m);
                }
            }
        }
    }
}

/// Calls on filters that remember what came before; new ones now and then.
fn attack(calls: u64, seed: u64) -> Seen {
    let mut random = Pcg(seed);
    let mut teams: Vec<Team> = (0..84).map(team).collect();
    let mut seen = Seen::default();
    while seen.calls < calls {
        seen.calls += 1;
        let at = random.next() as usize % teams.len();
        let team = &mut teams[at];
        let n = team.robots.len();
        match random.next() % 64 {
            0 => team.filter.reset(),
            1 => {
                let (robots, _) = states(&mut random, n);
                let filtered = team.filter.missed_tick(&robots).to_vec();
                let unseen = |robot: &RobotObservation| !robot.online || !(0.0..=OLDEST_S).contains(&robot.pose_age_s);
                for (f, _) in filtered.iter().zip(&robots).filter(|(_, robot)| unseen(robot)) {
                    assert_eq!(f.command.twist(), BodyTwist::default(), "driven unseen");
                }
                filtered
                    .iter()
                    .zip(&team.robots)
                    .for_each(|(f, robot)| seen.limits(f, robot));
            }
            2 => {
                let pose = Pose {
                    x_m: strange(&mut random, -2.0, 2.0, 8),
                    y_m: strange(&mut random, -1.5, 1.5, 8),
                    yaw_rad: strange(&mut random, -4.0, 4.0, 8),
                };
                let velocity = [strange(&mut random, -1.0, 1.0, 8), strange(&mut random, -1.0, 1.0, 8)];
                let turn = strange(&mut random, -3.0, 3.0, 8);
                team.filter
                    .see_pushable(random.next() as usize % 2, pose, velocity, turn);
            }
            3 => {
                let latency_s = strange(&mut random, 0.0, 0.2, 8);
                team.filter.set_latency_s(random.next() as usize % n, latency_s);
            }
            4 => (0..n).for_each(|i| team.filter.set_latency_s(i, 0.1)),
            _ => {}
        }
        let (robots, wanted) = states(&mut random, n);
        let filtered = team.filter.apply(&robots, &wanted).to_vec();
        filtered
            .iter()
            .zip(&team.robots)
            .for_each(|(f, robot)| seen.limits(f, robot));
        seen.rows(team, &robots, &filtered);
    }
    println!("{seen:?}");
    assert!(seen.pair_rows > calls / 10 && seen.wall_rows > calls / 10, "{seen:?}");
    seen
}

#[test]
fn any_state_gives_admissible_commands() {
    attack(60_000, 3);
}

#[test]
#[ignore = "10 million calls: minutes"]
fn ten_million_states_give_admissible_commands() {
    attack(10_000_000, 4);
}
