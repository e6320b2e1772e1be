//! More of the filter: symmetry, obstacles, geofence, late ticks, steering, deadlocks, many robots.

mod common;

use common::{Pcg, lab_robot};
use control::TICK_S;
use control::law::RobotObservation;
use control::safety::{Cause, FilterBody, Filtered, Geofence, Limits, MAX_PRESSURES, SafetyFilter};
use serde_json::json;
use twin::pose::Pose;
use twin::robot::Robot;
use twin::twist::BodyTwist;
use twin::world::Contents;

const ARENA_M: [f64; 2] = [4.0, 3.0];

fn description(like: &str) -> serde_json::Value {
    if like == "awd" {
        let all: serde_json::Value = serde_json::from_str(include_str!("../gallery/robots.json")).expect("robots");
        let found = all
            .as_array()
            .expect("robots")
            .iter()
            .find(|r| r["description"]["chassis"] == "awd");
        return found.expect("awd")["description"].clone();
    }
    lab_robot(like, "r")["description"].clone()
}

fn body(like: &str, bounding_radius_m: f64) -> FilterBody {
    FilterBody {
        robot: Robot::new(serde_json::from_value(description(like)).expect("description")).expect("robot"),
        bounding_radius_m,
    }
}

fn seen(x_m: f64, y_m: f64, yaw_rad: f64) -> RobotObservation {
    RobotObservation {
        pose: Pose { x_m, y_m, yaw_rad },
        pose_age_s: 0.0,
        twist: BodyTwist::default(),
        online: true,
    }
}

fn twist(forward_m_per_s: f64, left_m_per_s: f64, yaw_rate_rad_per_s: f64) -> BodyTwist {
    BodyTwist {
        forward_m_per_s,
        left_m_per_s,
        yaw_rate_rad_per_s,
    }
}

/// Follows the command exactly; a steered robot's origin slides sideways ahead of its fixed axle.
fn follow(robot: &mut RobotObservation, filtered: &Filtered, ahead_m: f64) {
    let twist = filtered.command.twist();
    let (s, c) = (libm::sin(robot.pose.yaw_rad), libm::cos(robot.pose.yaw_rad));
    let left = twist.left_m_per_s + ahead_m * twist.yaw_rate_rad_per_s;
    robot.pose.x_m += (c * twist.forward_m_per_s - s * left) * TICK_S;
    robot.pose.y_m += (s * twist.forward_m_per_s + c * left) * TICK_S;
    robot.pose.yaw_rad += twist.yaw_rate_rad_per_s * TICK_S;
    robot.twist = twist;
    robot.twist.left_m_per_s = left;
}

fn random_team(random: &mut Pcg, n: usize) -> (Vec<RobotObservation>, Vec<BodyTwist>) {
    let robots = (0..n)
        .map(|_| {
            let mut robot = seen(
                random.between(-1.7, 1.7),
                random.between(-1.2, 1.2),
                random.between(-3.0, 3.0),
            );
            robot.twist = twist(random.between(-0.3, 0.3), random.between(-0.3, 0.3), 0.0);
            robot
        })
        .collect();
    let wanted = (0..n)
        .map(|_| {
            twist(
                random.between(-1.0, 1.0),
                random.between(-1.0, 1.0),
                random.between(-2.0, 2.0),
            )
        })
        .collect();
    (robots, wanted)
}

const KINDS: [&str; 3] = ["omni-01", "diff-01", "awd"];

fn apart(a: &BodyTwist, b: &BodyTwist) -> f64 {
    (a.forward_m_per_s - b.forward_m_per_s)
        .abs()
        .max((a.left_m_per_s - b.left_m_per_s).abs())
        .max((a.yaw_rate_rad_per_s - b.yaw_rate_rad_per_s).abs())
}

/// Another order of the robots or the mirror image of everything: the same commands, to rounding.
#[test]
fn permuted_and_mirrored_teams_get_permuted_and_mirrored_commands() {
    let mut random = Pcg(31);
    let mut acted = 0;
    for round in 0..400 {
        let n = 2 + round % 7;
        let (robots, wanted) = random_team(&mut random, n);
        let kinds: Vec<&str> = (0..n).map(|i| KINDS[i % 3]).collect();
        let filter = |kinds: &[&str]| {
            SafetyFilter::new(
                Limits::default(),
                ARENA_M,
                kinds.iter().map(|kind| body(kind, 0.25)).collect(),
            )
        };
        let mut plain = filter(&kinds);
        let plain: Vec<Filtered> = plain.apply(&robots, &wanted).to_vec();
        acted += plain.iter().filter(|f| f.intervention.is_some()).count();
        let turned: Vec<usize> = (0..n).map(|i| (3 * i + round) % n).collect();
        let order: Vec<usize> = if n % 3 == 0 { (0..n).rev().collect() } else { turned };
        let mut permuted = filter(&order.iter().map(|i| kinds[*i]).collect::<Vec<_>>());
        let robots_permuted: Vec<_> = order.iter().map(|i| robots[*i]).collect();
        let wanted_permuted: Vec<_> = order.iter().map(|i| wanted[*i]).collect();
        for (filtered, i) in permuted.apply(&robots_permuted, &wanted_permuted).iter().zip(&order) {
            let off = apart(&filtered.command.twist(), &plain[*i].command.twist());
            assert!(off < 1e-6, "{round} {n} robot {i}: {off} {filtered:?} {:?}", plain[*i]);
        }
        let mirror = |t: &BodyTwist| twist(t.forward_m_per_s, -t.left_m_per_s, -t.yaw_rate_rad_per_s);
        let mirrored: Vec<_> = robots
            .iter()
            .map(|robot| RobotObservation {
                pose: Pose {
                    x_m: robot.pose.x_m,
                    y_m: -robot.pose.y_m,
                    yaw_rad: -robot.pose.yaw_rad,
                },
                twist: mirror(&robot.twist),
                ..*robot
            })
            .collect();
        let wanted_mirrored: Vec<_> = wanted.iter().map(mirror).collect();
        let mut other = filter(&kinds);
        for (filtered, plain) in other.apply(&mirrored, &wanted_mirrored).iter().zip(&plain) {
            let off = apart(&mirror(&filtered.command.twist()), &plain.command.twist());
            assert!(off < 1e-6, "{round}: {off} {filtered:?} {plain:?}");
        }
    }
    assert!(acted > 1000, "{acted}");
}

fn things() -> Contents {
    serde_json::from_value(json!({
        "fixed": [{"name": "shelf", "shape": {"rectangle": {"length_m": 0.2, "width_m": 1.0}}, "pose": {"x_m": 0.6, "y_m": 0.0, "yaw_rad": 0.0}}],
        "pushable": [{"name": "ball", "shape": {"circle": {"radius_m": 0.1}}, "pose": {"x_m": -1.2, "y_m": 0.8, "yaw_rad": 0.0}, "mass_kg": 1.0, "floor_friction": 0.3}]
    }))
    .expect("contents")
}

#[test]
fn obstacles_are_kept_off_and_named_with_their_pressure() {
    // 0.6 - 0.1 - 0.25 leaves 0.05 m at x = 0.2.
    let mut filter =
        SafetyFilter::new(Limits::default(), ARENA_M, vec![body("omni-01", 0.25)]).with_contents(&things());
    let filtered = filter.apply(&[seen(0.2, 0.0, 0.0)], &[twist(0.5, 0.3, 0.0)])[0];
    let intervention = filtered.intervention.expect("an intervention");
    assert_eq!(intervention.cause, Cause::FixedObstacle { index: 0 });
    assert_eq!(intervention.label(), "wall");
    let pressure = intervention.pressures[0].expect("a row");
    assert!(
        (pressure.push_m_per_s - intervention.change_m_per_s).abs() < 1e-6,
        "{pressure:?}"
    );
    assert!((filtered.command.twist().left_m_per_s - 0.3).abs() < 1e-9);
    assert!(filtered.command.twist().forward_m_per_s < 0.06);
    assert!(intervention.pressures.len() <= MAX_PRESSURES);
}

#[test]
fn a_tracked_obstacle_that_comes_is_given_way_and_an_untracked_one_stands_at_its_start() {
    let filter = || SafetyFilter::new(Limits::default(), ARENA_M, vec![body("omni-01", 0.25)]).with_contents(&things());
    let still = filter().apply(&[seen(-0.8, 0.8, 0.0)], &[twist(-0.5, 0.0, 0.0)])[0];
    assert_eq!(
        still.intervention.expect("held").cause,
        Cause::PushableObstacle { index: 0 }
    );
    let mut tracked = filter();
    let away = Pose {
        x_m: -1.8,
        y_m: -1.2,
        yaw_rad: 0.0,
    };
    tracked.see_pushable(0, away, [0.0, 0.0], 0.0);
    assert_eq!(
        tracked.apply(&[seen(-0.8, 0.8, 0.0)], &[twist(-0.3, 0.0, 0.0)])[0].intervention,
        None
    );
    let near = Pose {
        x_m: -1.2,
        y_m: 0.8,
        yaw_rad: 0.0,
    };
    tracked.see_pushable(0, near, [0.5, 0.0], 0.0);
    let fled = tracked.apply(&[seen(-0.8, 0.8, 0.0)], &[twist(0.0, 0.0, 0.0)])[0];
    assert!(fled.command.twist().forward_m_per_s > 0.3, "{fled:?}");
    // What is not finite is not believed.
    let nowhere = Pose { x_m: f64::NAN, ..near };
    tracked.see_pushable(0, nowhere, [f64::INFINITY, 0.0], 0.0);
    assert_eq!(
        tracked.apply(&[seen(-0.8, 0.8, 0.0)], &[twist(0.0, 0.0, 0.0)])[0]
            .command
            .twist(),
        twist(0.0, 0.0, 0.0)
    );
}

/// Between a wall and something that comes faster than it can flee from: no solution, so it comes to rest.
#[test]
fn without_a_solution_only_the_robots_concerned_come_to_rest_along_a_deceleration() {
    let bodies = vec![body("omni-01", 0.25), body("omni-02", 0.25)];
    let mut filter = SafetyFilter::new(Limits::default(), ARENA_M, bodies).with_contents(&things());
    let robots = [seen(-1.7, 0.8, 0.0), seen(1.3, -0.8, 0.0)];
    let wanted = [twist(0.0, -0.4, 0.0), twist(0.2, 0.0, 0.0)];
    assert_eq!(filter.apply(&robots, &wanted)[1].intervention, None);
    // Both sides at once: the ball from the right, faster than the wall leaves room for.
    let near = Pose {
        x_m: -1.3,
        y_m: 0.8,
        yaw_rad: 0.0,
    };
    filter.see_pushable(0, near, [-0.9, 0.0], 0.0);
    let before = filter.apply(&robots, &wanted)[0];
    assert_eq!(
        before.intervention.expect("held").cause,
        Cause::Infeasible,
        "{before:?}"
    );
    let speed = before.command.twist().speed_m_per_s();
    assert!((speed - (0.4 - 2.0 * TICK_S)).abs() < 1e-9, "{speed}");
    let after = filter.apply(&robots, &wanted).to_vec();
    assert!((after[0].command.twist().speed_m_per_s() - (0.4 - 4.0 * TICK_S)).abs() < 1e-9);
    assert_eq!(after[1].command.twist(), wanted[1], "the other one drives on");
    for _ in 0..30 {
        filter.apply(&robots, &wanted);
    }
    assert_eq!(filter.apply(&robots, &wanted)[0].command.twist().speed_m_per_s(), 0.0);
}

#[test]
fn a_missed_tick_decelerates_and_the_second_stops() {
    let mut filter = SafetyFilter::new(
        Limits::default(),
        ARENA_M,
        vec![body("omni-01", 0.25), body("awd", 0.25)],
    );
    let robots = [seen(-1.0, 0.0, 0.0), seen(1.0, 0.0, 1.0)];
    let wanted = [twist(0.3, 0.4, 0.0), twist(0.5, 0.0, 0.25)];
    filter.apply(&robots, &wanted);
    let late = filter.missed_tick(&robots).to_vec();
    let factor = late[0].command.twist().forward_m_per_s / 0.3;
    // The second robot's rim is the fastest: 0.5 m/s and 0.25 m at 0.25 rad/s. Both keep the same share.
    assert!((factor - (1.0 - 2.0 * TICK_S / 0.5625)).abs() < 1e-9, "{factor}");
    assert!((late[1].command.twist().forward_m_per_s / 0.5 - factor).abs() < 1e-9);
    assert_eq!(late[0].intervention.expect("record").cause, Cause::Late);
    let arc = late[1].command.twist();
    assert!(
        (arc.yaw_rate_rad_per_s / arc.forward_m_per_s - 0.5).abs() < 1e-9,
        "the arc is kept"
    );
    for filtered in filter.missed_tick(&robots) {
        assert_eq!(filtered.command.twist(), BodyTwist::default());
    }
    filter.apply(&robots, &wanted);
    assert!(
        filter.missed_tick(&robots)[0].command.twist().speed_m_per_s() > 0.4,
        "counted anew after a tick in time"
    );
}

#[test]
fn a_robot_that_is_not_seen_stops_on_a_missed_tick_too() {
    let old = Limits::default().oldest_pose_s + 1e-3;
    for (cause, unseen) in [
        (Cause::PoseAge, |robot: &mut RobotObservation, old: f64| {
            robot.pose_age_s = old
        }),
        (Cause::Offline, |robot: &mut RobotObservation, _| robot.online = false),
        (Cause::NotFinite, |robot: &mut RobotObservation, _| {
            robot.pose.x_m = f64::NAN
        }),
    ] as [(Cause, fn(&mut RobotObservation, f64)); 3]
    {
        let bodies = vec![body("omni-01", 0.25), body("omni-01", 0.25)];
        let mut filter = SafetyFilter::new(Limits::default(), ARENA_M, bodies);
        let mut robots = [seen(-1.0, 0.0, 0.0), seen(1.0, 0.0, 1.0)];
        filter.apply(&robots, &[twist(0.3, 0.4, 0.0), twist(0.5, 0.0, 0.0)]);
        unseen(&mut robots[0], old);
        let late = filter.missed_tick(&robots);
        assert_eq!(late[0].command.twist(), BodyTwist::default(), "{cause:?}");
        assert_eq!(late[0].intervention.expect("record").cause, cause);
        assert!(late[1].command.twist().speed_m_per_s() > 0.4, "{cause:?}");
        assert_eq!(late[1].intervention.expect("record").cause, Cause::Late);
    }
    let mut filter = SafetyFilter::new(Limits::default(), ARENA_M, vec![body("omni-01", 0.25)]);
    filter.apply(&[seen(0.0, 0.0, 0.0)], &[twist(0.3, 0.4, 0.0)]);
    assert_eq!(filter.missed_tick(&[])[0].command.twist(), BodyTwist::default());
}

/// After mixing: wheels within their share, and the wheels move the body exactly as the command's twist says.
#[test]
fn nothing_is_clipped_after_the_filter() {
    let mut random = Pcg(8);
    let weak = |like: &str| {
        let mut description = description(like);
        // A slow motor, so that wheels and not the body speed set the limit.
        description["motor"]["supply_v"] = json!(7.0);
        let robot = Robot::new(serde_json::from_value(description).expect("description")).expect("robot");
        FilterBody {
            robot,
            bounding_radius_m: 0.2,
        }
    };
    let mut at_limit = 0;
    for round in 0..600 {
        let n = 1 + round % 6;
        let bodies: Vec<FilterBody> = (0..n).map(|i| weak(KINDS[(i + round) % 3])).collect();
        let robots: Vec<Robot> = bodies.iter().map(|body| body.robot.clone()).collect();
        let mut filter = SafetyFilter::new(Limits::default(), ARENA_M, bodies);
        for _ in 0..5 {
            let (seen, mut wanted) = random_team(&mut random, n);
            for twist in &mut wanted {
                twist.forward_m_per_s *= 1.5;
                twist.yaw_rate_rad_per_s *= 3.0;
            }
            for (filtered, robot) in filter.apply(&seen, &wanted).iter().zip(&robots) {
                let (twist, wheels) = (filtered.command.twist(), filtered.command.wheel_command());
                let limit = robot.max_wheel_speed_rad_per_s() * Limits::default().wheel_share;
                let largest = wheels.wheel_rad_per_s.iter().fold(0.0_f64, |m, w| m.max(w.abs()));
                assert!(largest <= limit * (1.0 + 1e-6), "{largest} {limit}");
                at_limit += u32::from(largest > limit * (1.0 - 1e-6));
                assert!(wheels.steering_rad.abs() <= robot.max_steering_rad());
                if robot.max_steering_rad() > 0.0 {
                    // The arc of the steering angle, wheelbase 0.24 m, is the twist's.
                    let yaw_rate = twist.forward_m_per_s * libm::tan(wheels.steering_rad) / 0.24;
                    assert!(
                        (yaw_rate - twist.yaw_rate_rad_per_s).abs() < 1e-9,
                        "{yaw_rate} {twist:?}"
                    );
                } else {
                    let back = robot.twist_of_wheels(&wheels);
                    assert!(
                        (back.forward_m_per_s - twist.forward_m_per_s).abs() < 1e-9,
                        "{back:?} {twist:?}"
                    );
                    assert!(
                        (back.left_m_per_s - twist.left_m_per_s).abs() < 1e-9,
                        "{back:?} {twist:?}"
                    );
                    assert!(
                        (back.yaw_rate_rad_per_s - twist.yaw_rate_rad_per_s).abs() < 1e-9,
                        "{back:?} {twist:?}"
                    );
                }
                assert!(twist.yaw_rate_rad_per_s.abs() <= Limits::default().yaw_rate_rad_per_s + 1e-9);
            }
        }
    }
    println!("{at_limit} commands at the wheels' limit");
    assert!(at_limit > 300, "{at_limit}");
}

/// A steered robot at full lock near a wall: its origin slides towards the wall although it points along it.
#[test]
fn the_origin_of_a_steered_robot_slides_and_the_filter_knows() {
    let mut filter = SafetyFilter::new(Limits::default(), ARENA_M, vec![body("awd", 0.25)]);
    let mut robot = seen(0.0, 1.2, 0.0);
    for _ in 0..600 {
        let filtered = filter.apply(&[robot], &[twist(0.6, 0.0, 1.3)])[0];
        follow(&mut robot, &filtered, 0.12);
        assert!(robot.pose.y_m + 0.25 < 1.5, "{:?}", robot.pose);
    }
}

#[test]
fn a_stopped_and_a_reset_filter_forget() {
    let bodies = || vec![body("omni-01", 0.25), body("diff-01", 0.25)];
    let mut random = Pcg(3);
    let runs: Vec<_> = (0..40).map(|_| random_team(&mut random, 2)).collect();
    let mut filter = SafetyFilter::new(Limits::default(), ARENA_M, bodies());
    let drive = |filter: &mut SafetyFilter| -> Vec<Filtered> {
        runs.iter()
            .flat_map(|(robots, wanted)| filter.apply(robots, wanted).to_vec())
            .collect()
    };
    let first = drive(&mut filter);
    assert_ne!(drive(&mut filter), first, "what was sent before counts");
    filter.reset();
    assert_eq!(drive(&mut filter), first);
}

/// Robots on a circle that want to change sides, with no manners of their own.
fn antipodal(n: usize, seed: u64, kinds: &[&str]) -> (bool, f64, u32) {
    let mut random = Pcg(seed);
    let radius_m = 0.15;
    let bodies: Vec<FilterBody> = (0..n).map(|i| body(kinds[i % kinds.len()], radius_m)).collect();
    let mut filter = SafetyFilter::new(Limits::default(), ARENA_M, bodies);
    let turn = random.between(0.0, core::f64::consts::TAU);
    let angle =
        |i: usize, random: &mut Pcg| turn + core::f64::consts::TAU * i as f64 / n as f64 + random.between(-0.02, 0.02);
    let mut robots = Vec::new();
    let mut goals = Vec::new();
    for i in 0..n {
        let a = angle(i, &mut random);
        let [x_m, y_m] = [libm::cos(a), libm::sin(a)];
        robots.push(seen(x_m, y_m, a + core::f64::consts::PI));
        goals.push([-x_m, -y_m]);
    }
    let mut gap_m = f64::INFINITY;
    let mut attempts = 0;
    for _ in 0..120 * 90 {
        let wanted: Vec<BodyTwist> = robots
            .iter()
            .zip(&goals)
            .enumerate()
            .map(|(i, (robot, goal))| {
                let (dx, dy) = (goal[0] - robot.pose.x_m, goal[1] - robot.pose.y_m);
                let size = (dx * dx + dy * dy).sqrt();
                let speed = if size < 0.02 { 0.0 } else { size.min(0.4) };
                let (x, y) = (speed * dx / size.max(1e-9), speed * dy / size.max(1e-9));
                let (s, c) = (libm::sin(robot.pose.yaw_rad), libm::cos(robot.pose.yaw_rad));
                let (forward, left) = (c * x + s * y, c * y - s * x);
                if kinds[i % kinds.len()] == "omni-01" {
                    twist(forward, left, 0.0)
                } else {
                    let error = libm::atan2(left, forward);
                    let share = (1.0 - error.abs() / 0.5).max(0.0);
                    twist(
                        speed * share,
                        0.0,
                        if speed > 0.0 {
                            (3.0 * error).clamp(-1.8, 1.8)
                        } else {
                            0.0
                        },
                    )
                }
            })
            .collect();
        let filtered = filter.apply(&robots, &wanted).to_vec();
        for (robot, filtered) in robots.iter_mut().zip(&filtered) {
            follow(robot, filtered, 0.0);
        }
        attempts = attempts.max(filter.deadlocks().map(|one| one.attempts).max().unwrap_or(0));
        for j in 0..n {
            for i in 0..j {
                gap_m = gap_m.min(robots[i].pose.distance_m(&robots[j].pose) - 2.0 * radius_m);
            }
        }
        let arrived = |(robot, goal): (&RobotObservation, &[f64; 2])| {
            (robot.pose.x_m - goal[0]).abs() < 0.05 && (robot.pose.y_m - goal[1]).abs() < 0.05
        };
        if robots.iter().zip(&goals).all(arrived) {
            return (true, gap_m, attempts);
        }
    }
    (false, gap_m, attempts)
}

/// S9: at least 95 % of antipodal swaps of 2 to 6 robots end, and no distance falls below the margin.
#[test]
fn swaps_that_block_themselves_are_resolved_without_getting_closer() {
    let runs: u64 = std::env::var("FILTER_SOAK")
        .ok()
        .and_then(|text| text.parse().ok())
        .unwrap_or(60);
    let (mut resolved, mut smallest_m, mut held) = (0, f64::INFINITY, 0);
    let mut failed = Vec::new();
    for seed in 0..runs {
        let n = 2 + (seed % 5) as usize;
        let kinds: &[&str] = if seed % 2 == 0 {
            &["omni-01"]
        } else {
            &["omni-01", "diff-01"]
        };
        let (done, gap_m, attempts) = antipodal(n, seed, kinds);
        smallest_m = smallest_m.min(gap_m);
        held += u32::from(attempts > 0);
        if done {
            resolved += 1;
        } else {
            failed.push((seed, n, attempts));
        }
    }
    println!(
        "{resolved} of {runs} resolved, {held} were held; smallest gap {smallest_m:.4} m; failed (seed, robots, attempts) {failed:?}"
    );
    assert!(resolved * 100 >= runs * 95 && held > 0, "{resolved}");
    assert!(smallest_m > Limits::default().robot_margin_m, "{smallest_m}");
}

/// Fifty robots, dense, for five seconds: no contact, and no step of the solver's bound is ever needed.
#[test]
fn fifty_robots_in_a_crowd_stay_apart() {
    let mut random = Pcg(50);
    let radius_m = 0.12;
    let bodies: Vec<FilterBody> = (0..50).map(|i| body(KINDS[i % 2], radius_m)).collect();
    let mut filter = SafetyFilter::new(Limits::default(), ARENA_M, bodies);
    let mut robots: Vec<_> = (0..50)
        .map(|i| {
            let (column, row) = ((i % 10) as f64, (i / 10) as f64);
            seen(-1.75 + 0.385 * column, -1.2 + 0.58 * row, random.between(-3.0, 3.0))
        })
        .collect();
    let mut wanted = vec![BodyTwist::default(); 50];
    let (mut gap_m, mut most_steps) = (f64::INFINITY, 0);
    for tick in 0..600 {
        if tick % 60 == 0 {
            wanted.fill_with(|| {
                twist(
                    random.between(-1.0, 1.0),
                    random.between(-1.0, 1.0),
                    random.between(-2.0, 2.0),
                )
            });
        }
        let filtered = filter.apply(&robots, &wanted).to_vec();
        most_steps = most_steps.max(filter.solver_steps());
        for (robot, filtered) in robots.iter_mut().zip(&filtered) {
            let cause = filtered.intervention.map(|one| one.cause);
            assert!(
                cause != Some(Cause::NotConverged) && cause != Some(Cause::Infeasible),
                "{tick}"
            );
            follow(robot, filtered, 0.0);
        }
        for j in 0..50 {
            for i in 0..j {
                gap_m = gap_m.min(robots[i].pose.distance_m(&robots[j].pose) - 2.0 * radius_m);
            }
        }
    }
    println!("smallest gap {gap_m:.4} m, at most {most_steps} steps");
    assert!(gap_m > 0.0);
}

#[test]
fn the_way_back_into_a_fence_is_free() {
    let fence = Geofence::rectangle([-1.0, -1.0], [1.0, 1.0]).expect("fence");
    let mut filter = SafetyFilter::new(Limits::default(), ARENA_M, vec![body("omni-01", 0.25)]).with_geofence(fence);
    let outside = seen(1.2, 0.0, 0.0);
    let out = filter.apply(&[outside], &[twist(0.3, 0.0, 0.0)])[0];
    assert_eq!(out.intervention.expect("held").cause, Cause::Geofence { side: 1 });
    assert!(out.command.twist().speed_m_per_s() < 1e-9);
    filter.reset();
    assert_eq!(filter.apply(&[outside], &[twist(-0.3, 0.0, 0.0)])[0].intervention, None);
}

#[test]
fn a_robot_whose_delay_is_longer_than_what_is_remembered_stands_still() {
    let bodies = vec![body("omni-01", 0.25), body("omni-02", 0.25)];
    let mut filter = SafetyFilter::new(Limits::default(), ARENA_M, bodies);
    let longest_s = filter.longest_latency_s();
    let robots = [seen(-1.0, 0.0, 0.0), seen(1.0, 0.0, 0.0)];
    let wanted = [twist(0.3, 0.0, 0.0); 2];
    for latency_s in [longest_s + 1e-3, -1e-3, f64::NAN, f64::INFINITY] {
        filter.set_latency_s(1, latency_s);
        let filtered = filter.apply(&robots, &wanted).to_vec();
        assert_eq!(filtered[0].command.twist(), wanted[0]);
        assert_eq!(filtered[1].command.twist(), BodyTwist::default());
        assert_eq!(filtered[1].intervention.expect("record").cause, Cause::Latency);
    }
    filter.set_latency_s(1, longest_s);
    assert!(filter.apply(&robots, &wanted)[1].command.twist().forward_m_per_s > 0.1);
    filter.set_latency_s(7, 0.1);
}
