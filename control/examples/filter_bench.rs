//! CPU time of one call of the safety filter, walls included: `cargo run --release -p control --example filter_bench`.
//!
//! Each call is timed five times on copies of the filter and the least counts: CPU time, not what a busy machine adds.
//! Robots follow their commands exactly; desired twists are random and change twice a second. `scattered`: few rows are
//! active. `dense`: robots fill the arena. `centre`: all robots drive at its middle. `furnished`: with obstacles and fence.
//! Targets of DESIGN section 11: p99 <= 0.1 ms at 10 robots, <= 2 ms at 50.

#![allow(clippy::disallowed_methods, reason = "a benchmark reads the clock")]

use std::time::Instant;

use control::TICK_S;
use control::law::RobotObservation;
use control::safety::{FilterBody, Geofence, Limits, SafetyFilter};
use serde_json::json;
use twin::pose::Pose;
use twin::robot::Robot;
use twin::twist::BodyTwist;

const TICKS: usize = 2400;

struct Lcg(u64);

impl Lcg {
    fn between(&mut self, low: f64, high: f64) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        low + (high - low) * (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }
}

struct Case {
    name: &'static str,
    robots: usize,
    arena_m: [f64; 2],
    radius_m: f64,
    centre: bool,
    furnished: bool,
}

fn main() {
    let case = |name, robots, arena_m, radius_m, centre, furnished| Case {
        name,
        robots,
        arena_m,
        radius_m,
        centre,
        furnished,
    };
    let cases = [
        case("10 scattered, 8 x 6 m", 10, [8.0, 6.0], 0.25, false, false),
        case("10 in the reference arena, 4 x 3 m", 10, [4.0, 3.0], 0.25, false, false),
        case("10 to the centre", 10, [4.0, 3.0], 0.25, true, false),
        case("10 furnished", 10, [4.0, 3.0], 0.15, false, true),
        case("50 scattered, 16 x 12 m", 50, [16.0, 12.0], 0.25, false, false),
        case("50 dense, 4 x 3 m, radius 0.12 m", 50, [4.0, 3.0], 0.12, false, false),
        case("50 to the centre, 8 x 6 m", 50, [8.0, 6.0], 0.25, true, false),
        case("50 furnished, 8 x 6 m", 50, [8.0, 6.0], 0.2, false, true),
    ];
    println!(
        "{:<38} {:>9} {:>9} {:>9} {:>7}",
        "whole call", "p50 us", "p99 us", "max us", "steps"
    );
    for case in cases {
        let (mut times, steps) = measure(&case);
        times.sort_by(f64::total_cmp);
        let at = |share: f64| times[((times.len() - 1) as f64 * share) as usize];
        println!(
            "{:<38} {:>9.1} {:>9.1} {:>9.1} {:>7}",
            case.name,
            at(0.5),
            at(0.99),
            at(1.0),
            steps
        );
    }
}

fn measure(case: &Case) -> (Vec<f64>, u32) {
    let all: Vec<serde_json::Value> = serde_json::from_str(include_str!("../gallery/robots.json")).expect("robots");
    let bodies = (0..case.robots).map(|i| FilterBody {
        robot: Robot::new(serde_json::from_value(all[i % 3]["description"].clone()).expect("description"))
            .expect("robot"),
        bounding_radius_m: case.radius_m,
    });
    let mut filter = SafetyFilter::new(Limits::default(), case.arena_m, bodies.collect());
    if case.furnished {
        let things: Vec<_> = (0..12)
            .map(|k| {
                let place = json!({"x_m": -1.5 + 0.27 * f64::from(k), "y_m": if k % 2 == 0 { -0.7 } else { 0.7 }, "yaw_rad": f64::from(k)});
                json!({"name": format!("box-{k}"), "shape": {"rectangle": {"length_m": 0.1, "width_m": 0.05}}, "pose": place})
            })
            .collect();
        filter = filter.with_contents(&serde_json::from_value(json!({ "fixed": things })).expect("contents"));
        let [w, h] = case.arena_m.map(|side| 0.5 * side - 0.05);
        filter = filter.with_geofence(Geofence::rectangle([-w, -h], [w, h]).expect("fence"));
    }
    let mut random = Lcg(1);
    let columns = (case.robots as f64 * case.arena_m[0] / case.arena_m[1]).sqrt().ceil() as usize;
    let rows = case.robots.div_ceil(columns);
    let mut robots: Vec<RobotObservation> = (0..case.robots)
        .map(|i| RobotObservation {
            pose: Pose {
                x_m: case.arena_m[0] * (((i % columns) as f64 + 0.5) / columns as f64 - 0.5),
                y_m: case.arena_m[1] * (((i / columns) as f64 + 0.5) / rows as f64 - 0.5),
                yaw_rad: random.between(-3.0, 3.0),
            },
            pose_age_s: 0.017,
            twist: BodyTwist::default(),
            online: true,
        })
        .collect();
    let mut wanted = vec![BodyTwist::default(); case.robots];
    let mut times = Vec::with_capacity(TICKS);
    let mut steps = 0;
    for tick in 0..TICKS {
        if tick % 60 == 0 || case.centre {
            for (twist, robot) in wanted.iter_mut().zip(&robots) {
                let (s, c) = (robot.pose.yaw_rad.sin(), robot.pose.yaw_rad.cos());
                let (x, y) = (-robot.pose.x_m, -robot.pose.y_m);
                *twist = if case.centre {
                    BodyTwist {
                        forward_m_per_s: c * x + s * y,
                        left_m_per_s: c * y - s * x,
                        yaw_rate_rad_per_s: random.between(-1.0, 1.0),
                    }
                } else {
                    BodyTwist {
                        forward_m_per_s: random.between(-1.0, 1.0),
                        left_m_per_s: random.between(-1.0, 1.0),
                        yaw_rate_rad_per_s: random.between(-2.0, 2.0),
                    }
                };
            }
        }
        // The same call on copies: the least of five is what it costs when nothing else takes the core.
        let mut least = f64::INFINITY;
        for _ in 0..5 {
            let mut copy = filter.clone();
            let start = Instant::now();
            std::hint::black_box(copy.apply(&robots, &wanted));
            least = least.min(start.elapsed().as_secs_f64() * 1e6);
        }
        times.push(least);
        let filtered = filter.apply(&robots, &wanted);
        for (robot, filtered) in robots.iter_mut().zip(filtered) {
            let twist = filtered.command.twist();
            let (s, c) = (robot.pose.yaw_rad.sin(), robot.pose.yaw_rad.cos());
            robot.pose.x_m += (c * twist.forward_m_per_s - s * twist.left_m_per_s) * TICK_S;
            robot.pose.y_m += (s * twist.forward_m_per_s + c * twist.left_m_per_s) * TICK_S;
            robot.pose.yaw_rad += twist.yaw_rate_rad_per_s * TICK_S;
            robot.twist = twist;
        }
        steps = steps.max(filter.solver_steps());
    }
    (times, steps)
}
