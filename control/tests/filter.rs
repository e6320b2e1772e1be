//! The safety filter against seeded random states: circles never touch, limits hold, nothing panics.

mod common;

use common::{Pcg, lab_robot};
use control::TICK_S;
use control::law::RobotObservation;
use control::safety::{Cause, FilterBody, Limits, SafetyFilter};
use twin::pose::Pose;
use twin::robot::Robot;
use twin::twist::BodyTwist;

const ARENA_M: [f64; 2] = [4.0, 3.0];

fn body(like: &str, bounding_radius_m: f64) -> FilterBody {
    let description = serde_json::from_value(lab_robot(like, "r")["description"].clone()).expect("description");
    FilterBody {
        robot: Robot::new(description).expect("robot"),
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

fn moved(pose: &Pose, twist: &BodyTwist) -> Pose {
    let (s, c) = (libm::sin(pose.yaw_rad), libm::cos(pose.yaw_rad));
    Pose {
        x_m: pose.x_m + (c * twist.forward_m_per_s - s * twist.left_m_per_s) * TICK_S,
        y_m: pose.y_m + (s * twist.forward_m_per_s + c * twist.left_m_per_s) * TICK_S,
        yaw_rad: pose.yaw_rad + twist.yaw_rate_rad_per_s * TICK_S,
    }
}

/// Robots that answer only after `delay` ticks drive wherever random commands of up to 1.5 m/s send them.
fn chase(seed: u64, n: usize, delay: usize, ticks: usize) -> (f64, f64) {
    let mut random = Pcg(seed);
    let radius_m = if n > 8 { 0.12 } else { 0.25 };
    let bodies: Vec<FilterBody> = (0..n)
        .map(|i| body(if i % 3 == 2 { "diff-01" } else { "omni-01" }, radius_m))
        .collect();
    let mut filter = SafetyFilter::new(Limits::default(), ARENA_M, bodies);
    let mut robots: Vec<RobotObservation> = Vec::new();
    while robots.len() < n {
        let place = seen(
            random.between(-1.7, 1.7),
            random.between(-1.2, 1.2),
            random.between(-3.0, 3.0),
        );
        if robots
            .iter()
            .all(|other| other.pose.distance_m(&place.pose) > 2.0 * radius_m + 0.01)
        {
            robots.push(place);
        }
    }
    let mut pipeline = vec![vec![BodyTwist::default(); n]; delay];
    let mut wanted = vec![BodyTwist::default(); n];
    let (mut gap_m, mut wall_m) = (f64::INFINITY, f64::INFINITY);
    for tick in 0..ticks {
        if tick % 60 == 0 {
            wanted.fill_with(|| {
                twist(
                    random.between(-1.5, 1.5),
                    random.between(-1.5, 1.5),
                    random.between(-4.0, 4.0),
                )
            });
        }
        pipeline.push(
            filter
                .apply(&robots, &wanted)
                .iter()
                .map(|f| f.command.twist())
                .collect(),
        );
        let now = pipeline.remove(0);
        for (robot, twist) in robots.iter_mut().zip(&now) {
            robot.pose = moved(&robot.pose, twist);
            robot.twist = *twist;
        }
        for (j, a) in robots.iter().enumerate() {
            for b in &robots[..j] {
                gap_m = gap_m.min(a.pose.distance_m(&b.pose) - 2.0 * radius_m);
            }
            let inside_m = (ARENA_M[0] / 2.0 - a.pose.x_m.abs()).min(ARENA_M[1] / 2.0 - a.pose.y_m.abs());
            wall_m = wall_m.min(inside_m - radius_m);
        }
    }
    (gap_m, wall_m)
}

/// Ten simulated minutes each: 2 and 4 large robots, 10 and 20 small ones, with 6 ticks (50 ms) of dead time.
#[test]
fn circles_never_touch_each_other_or_a_wall() {
    for (n, seeds, ticks) in [
        (1, 20, 1200),
        (2, 60, 1200),
        (4, 60, 1200),
        (10, 10, 1200),
        (20, 4, 1200),
    ] {
        let (mut gap_m, mut wall_m) = (f64::INFINITY, f64::INFINITY);
        for seed in 0..seeds {
            let (gap, wall) = chase(1000 * n as u64 + seed, n, 6, ticks);
            gap_m = gap_m.min(gap);
            wall_m = wall_m.min(wall);
        }
        println!("{n} robots, {seeds} runs: smallest gap {gap_m:.4} m, smallest wall distance {wall_m:.4} m");
        assert!(gap_m > 0.0 && wall_m > 0.0, "{n}: {gap_m} {wall_m}");
    }
}

/// Any state at all, also overlapping, outside and not finite: commands are finite, within wheel limits, never approach.
#[test]
fn total_on_random_states_and_admissible_after_the_last_transform() {
    let mut random = Pcg(99);
    let odd = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e300, -1e300, 0.0, 1e-320];
    let mut interventions = 0_u32;
    for round in 0..4000 {
        let n = 1 + (random.next() % 8) as usize;
        let bodies: Vec<FilterBody> = (0..n)
            .map(|i| body(if i % 2 == 0 { "omni-01" } else { "diff-01" }, 0.25))
            .collect();
        let limits: Vec<f64> = bodies.iter().map(|b| b.robot.max_wheel_speed_rad_per_s()).collect();
        let mut filter = SafetyFilter::new(Limits::default(), ARENA_M, bodies);
        let strange = |random: &mut Pcg, low: f64, high: f64| {
            if random.next().is_multiple_of(40) {
                odd[(random.next() as usize) % odd.len()]
            } else {
                random.between(low, high)
            }
        };
        let mut robots = Vec::new();
        let mut wanted = Vec::new();
        for _ in 0..n {
            let mut robot = seen(
                strange(&mut random, -2.2, 2.2),
                strange(&mut random, -1.7, 1.7),
                strange(&mut random, -4.0, 4.0),
            );
            robot.pose_age_s = strange(&mut random, 0.0, 0.15);
            robot.online = !random.next().is_multiple_of(10);
            robot.twist = twist(strange(&mut random, -1.0, 1.0), strange(&mut random, -1.0, 1.0), 0.0);
            robots.push(robot);
            wanted.push(twist(
                strange(&mut random, -3.0, 3.0),
                strange(&mut random, -3.0, 3.0),
                strange(&mut random, -9.0, 9.0),
            ));
        }
        if n > 1 && round % 7 == 0 {
            robots[1] = robots[0];
        }
        for (i, filtered) in filter.apply(&robots, &wanted).iter().enumerate() {
            let command = filtered.command.wheel_command();
            assert_eq!(command.non_finite_field(), None);
            let largest = command.wheel_rad_per_s.iter().fold(0.0_f64, |m, w| m.max(w.abs()));
            assert!(largest <= limits[i], "{largest} > {}", limits[i]);
            assert!(filtered.command.twist().speed_m_per_s() <= Limits::default().speed_m_per_s + 1e-9);
            interventions += u32::from(filtered.intervention.is_some());
            let stale =
                !robots[i].online || !(0.0..=0.1).contains(&robots[i].pose_age_s) || !robots[i].pose.is_finite();
            if stale {
                assert_eq!(filtered.command.twist(), BodyTwist::default());
            }
        }
    }
    assert!(interventions > 10_000, "{interventions}");
}

/// The pairwise and wall constraints hold for what is sent, to rounding.
#[test]
fn overlapping_robots_never_approach() {
    let mut random = Pcg(5);
    for _ in 0..4000 {
        let n = 2 + (random.next() % 5) as usize;
        let bodies: Vec<FilterBody> = (0..n).map(|_| body("omni-01", 0.25)).collect();
        let mut filter = SafetyFilter::new(Limits::default(), ARENA_M, bodies);
        let robots: Vec<_> = (0..n)
            .map(|_| {
                seen(
                    random.between(-0.5, 0.5),
                    random.between(-0.5, 0.5),
                    random.between(-3.0, 3.0),
                )
            })
            .collect();
        let wanted: Vec<_> = (0..n)
            .map(|_| twist(random.between(-1.0, 1.0), random.between(-1.0, 1.0), 0.0))
            .collect();
        let sent: Vec<BodyTwist> = filter
            .apply(&robots, &wanted)
            .iter()
            .map(|f| f.command.twist())
            .collect();
        for j in 0..n {
            for i in 0..j {
                let before_m = robots[i].pose.distance_m(&robots[j].pose);
                let (a, b) = (moved(&robots[i].pose, &sent[i]), moved(&robots[j].pose, &sent[j]));
                if before_m < 0.5 {
                    assert!(
                        a.distance_m(&b) >= before_m - 1e-9,
                        "{before_m} -> {}",
                        a.distance_m(&b)
                    );
                }
            }
        }
    }
}

#[test]
fn one_robot_is_kept_from_the_wall_and_the_record_says_so() {
    let mut filter = SafetyFilter::new(Limits::default(), ARENA_M, vec![body("omni-01", 0.25)]);
    let filtered = filter.apply(&[seen(1.70, 0.0, 0.0)], &[twist(0.5, 0.2, 0.0)])[0];
    let intervention = filtered.intervention.expect("an intervention");
    assert_eq!(
        intervention.cause,
        Cause::Wall {
            side: control::safety::WallSide::Right
        }
    );
    assert_eq!(intervention.label(), "wall");
    assert!(
        filtered.command.twist().forward_m_per_s < 0.05 && (filtered.command.twist().left_m_per_s - 0.2).abs() < 1e-9
    );
    assert!((intervention.change_m_per_s - (0.5 - filtered.command.twist().forward_m_per_s)).abs() < 1e-9);
}

#[test]
fn free_motion_is_left_alone() {
    let mut filter = SafetyFilter::new(
        Limits::default(),
        ARENA_M,
        vec![body("omni-01", 0.25), body("diff-01", 0.25)],
    );
    let wanted = [twist(0.3, 0.1, 0.5), twist(0.3, 0.0, -0.5)];
    for (filtered, wanted) in filter
        .apply(&[seen(-1.0, 0.0, 0.4), seen(1.0, 0.0, 0.0)], &wanted)
        .iter()
        .zip(wanted)
    {
        assert_eq!(filtered.intervention, None);
        let sent = filtered.command.twist();
        assert!(
            (sent.forward_m_per_s - wanted.forward_m_per_s).abs() < 1e-12
                && (sent.left_m_per_s - wanted.left_m_per_s).abs() < 1e-12
        );
        assert_eq!(sent.yaw_rate_rad_per_s, wanted.yaw_rate_rad_per_s);
    }
}

#[test]
fn a_stale_or_silent_robot_stops_and_the_others_keep_clear() {
    let bodies = || vec![body("omni-01", 0.25), body("omni-02", 0.25)];
    let wanted = [twist(0.4, 0.0, 0.0), twist(0.4, 0.0, 0.0)];
    let stale = |age_s: f64, online: bool| RobotObservation {
        pose_age_s: age_s,
        online,
        ..seen(0.5, 0.0, 0.0)
    };
    for (age_s, online, cause) in [
        (0.101, true, Cause::PoseAge),
        (0.0, false, Cause::Offline),
        (f64::NAN, true, Cause::PoseAge),
    ] {
        let mut filter = SafetyFilter::new(Limits::default(), ARENA_M, bodies());
        let filtered = filter.apply(&[seen(-0.1, 0.0, 0.0), stale(age_s, online)], &wanted);
        assert_eq!(filtered[1].command.twist(), BodyTwist::default());
        assert_eq!(filtered[1].intervention.expect("record").cause, cause);
        assert!(filtered[0].command.twist().forward_m_per_s < 0.2, "the gap is 0.1 m");
        assert_eq!(
            filtered[0].intervention.expect("record").cause,
            Cause::Robot { other: 1 }
        );
    }
    let mut filter = SafetyFilter::new(Limits::default(), ARENA_M, bodies());
    let never_seen = RobotObservation {
        pose: Pose {
            x_m: f64::NAN,
            y_m: 0.0,
            yaw_rad: 0.0,
        },
        ..stale(0.0, true)
    };
    for filtered in filter.apply(&[seen(-1.0, 0.0, 0.0), never_seen], &wanted) {
        assert_eq!(
            filtered.command.twist(),
            BodyTwist::default(),
            "a robot that was never seen could be anywhere"
        );
    }
}
