//! The collision solver against the contact-free kernel and against mechanics.

mod support;

use core::f64::consts::{FRAC_PI_2, PI};

use support::drive::assert_close;
use support::{all, diff2, diff4, omni4, robot, wheels};
use twin::command::WheelCommand;
use twin::free::FreeRobot;
use twin::pose::Pose;
use twin::robot::{Robot, RobotDescription};
use twin::twist::BodyTwist;
use twin::world::{Arena, RobotState, World};

const RADIUS_M: f64 = 0.25;

fn at(x_m: f64, y_m: f64, yaw_rad: f64) -> Pose {
    Pose { x_m, y_m, yaw_rad }
}

fn world(width_m: f64, height_m: f64, robots: Vec<(Robot, Pose)>) -> World {
    let robots = robots
        .into_iter()
        .map(|(robot, pose)| (robot, pose, RADIUS_M))
        .collect();
    match World::new(Arena { width_m, height_m }, robots) {
        Ok(world) => world,
        Err(error) => panic!("{error}"),
    }
}

fn step(world: &mut World, commands: &[WheelCommand]) {
    if let Err(error) = world.step(commands) {
        panic!("{error}");
    }
}

fn forward(robot: &Robot, speed: f64) -> WheelCommand {
    robot.wheel_speeds(BodyTwist {
        forward_m_per_s: speed,
        ..BodyTwist::default()
    })
}

/// Velocity in the world, m/s.
fn velocity(state: &RobotState) -> (f64, f64) {
    let (sin, cos) = libm::sincos(state.pose.yaw_rad);
    let (u, v) = (state.twist.forward_m_per_s, state.twist.left_m_per_s);
    (u * cos - v * sin, u * sin + v * cos)
}

fn assert_same(name: &str, got: &RobotState, free: &RobotState) {
    let pose = got.pose.distance_m(&free.pose) + (got.pose.yaw_rad - free.pose.yaw_rad).abs();
    let (a, b) = (velocity(got), velocity(free));
    let twist = (a.0 - b.0).abs() + (a.1 - b.1).abs();
    assert!(pose < 1e-9 && twist < 1e-9, "{name}: {pose:e} m, {twist:e} m/s");
    for (got, free) in got.wheel_rad.iter().zip(free.wheel_rad) {
        assert!((got - free).abs() < 1e-9, "{name}: wheel {got} against {free}");
    }
}

#[test]
fn along_a_wall_without_touching_is_the_free_trajectory() {
    // The gap of 0.5 mm is below the sweep's margin of 1 mm, so every tick goes through the solver; there is no contact.
    for description in all() {
        let robot = robot(description);
        let start = at(-2.0, 1.5 - RADIUS_M - 5e-4, 0.0);
        let mut free = FreeRobot::at_rest(&robot, start);
        let mut world = world(6.0, 3.0, vec![(robot.clone(), start)]);
        for tick in 0..360 {
            let command = forward(&robot, if tick < 200 { 1.8 } else { -0.7 });
            step(&mut world, &[command]);
            (0..4).for_each(|_| free.step(&command));
            assert!(world.contacts_this_tick().is_empty(), "{} touched", robot.name());
            assert_same(robot.name(), &world.state(0), &free.state());
        }
        assert!((free.state().pose.x_m + 2.0).abs() > 0.5);
    }
}

#[test]
fn turning_and_leaving_beside_a_wall_is_the_free_trajectory() {
    // Turns in place beside the wall, then drives away from it: in and out of the solver's hands.
    for description in [diff2(), diff4(), omni4()] {
        let robot = robot(description);
        let start = at(0.0, 1.5 - RADIUS_M - 5e-4, 0.0);
        let turn = if robot.chassis() == "omni4" {
            wheels(&[-9.0; 4])
        } else {
            wheels(&[9.0, -9.0, 9.0, -9.0])
        };
        let mut free = FreeRobot::at_rest(&robot, start);
        let mut world = world(6.0, 3.0, vec![(robot.clone(), start)]);
        for _ in 0..300 {
            let heading = free.state().pose.yaw_rad;
            let turned = (-2.0..-1.2).contains(&heading);
            let command = if turned { forward(&robot, 1.0) } else { turn };
            step(&mut world, &[command]);
            (0..4).for_each(|_| free.step(&command));
            assert!(world.contacts_this_tick().is_empty(), "{} touched", robot.name());
            assert_same(robot.name(), &world.state(0), &free.state());
        }
        assert!(
            free.state().pose.y_m < 1.0,
            "{} stayed: {:?}",
            robot.name(),
            free.state().pose
        );
    }
}

#[test]
fn passing_another_robot_without_touching_is_the_free_trajectory() {
    // 0.5 mm between the circles at the moment of passing.
    for description in all() {
        let (a, b) = (robot(description.clone()), robot(description));
        let starts = [at(-1.0, 0.0, 0.0), at(1.0, 2.0 * RADIUS_M + 5e-4, PI)];
        let mut frees = starts.map(|start| FreeRobot::at_rest(&a, start));
        let commands = [forward(&a, 1.5), forward(&b, 1.5)];
        let mut world = world(12.0, 6.0, vec![(a, starts[0]), (b, starts[1])]);
        let mut closest = f64::INFINITY;
        for _ in 0..200 {
            step(&mut world, &commands);
            closest = closest.min(world.smallest_separation_m().unwrap_or(f64::INFINITY));
            for (index, free) in frees.iter_mut().enumerate() {
                (0..4).for_each(|_| free.step(&commands[index]));
                assert_same("passing", &world.state(index), &free.state());
            }
            assert!(world.contacts_this_tick().is_empty());
        }
        assert!(closest < 2e-3, "they passed at {closest} m");
    }
}

/// `diff4` of a mass on a floor so slippery (mu = 0.01) that wheels do not matter during a collision.
fn on_ice(mass_kg: f64) -> RobotDescription {
    let mut description = diff4();
    description.mass_kg = mass_kg;
    description.floor_friction = 0.01;
    description
}

/// Drives robot 0 (and 1) until they touch; the states before the tick of the contact and after it.
fn until_contact(world: &mut World, commands: &[WheelCommand]) -> ([RobotState; 2], [RobotState; 2]) {
    for _ in 0..2400 {
        let before = [world.state(0), world.state(1)];
        step(world, commands);
        if !world.contacts_this_tick().is_empty() {
            return (before, [world.state(0), world.state(1)]);
        }
    }
    panic!("they never met");
}

/// What friction with the floor can change of a speed in one tick, m/s: mu g/120.
const FLOOR_M_PER_S: f64 = 0.01 * 9.81 / 120.0;

#[test]
fn a_head_on_push_shares_the_momentum() {
    // Restitution 0: m1 u1 = (m1 + m2) u'.
    for (first, second) in [(12.0, 12.0), (12.0, 4.0), (5.0, 20.0)] {
        let (a, b) = (robot(on_ice(first)), robot(on_ice(second)));
        let commands = [forward(&a, 1.5), WheelCommand::default()];
        let mut world = world(6.0, 3.0, vec![(a, at(-1.5, 0.0, 0.0)), (b, at(0.0, 0.0, 0.0))]);
        let (before, after) = until_contact(&mut world, &commands);
        let u = velocity(&before[0]).0;
        let expected = first * u / (first + second);
        println!("{first} kg at {u:.4} m/s on {second} kg");
        for (index, state) in after.iter().enumerate() {
            let got = velocity(state).0;
            println!("robot {index}: expected {expected:.5}, got {got:.5}");
            // The floor acts on both during the tick of the contact, and the loop may push once more: two ticks' worth.
            assert!(
                (got - expected).abs() < 2.0 * FLOOR_M_PER_S,
                "robot {index}: {got} against {expected}"
            );
        }
        let momentum = first * velocity(&after[0]).0 + second * velocity(&after[1]).0;
        let floor = (first + second) * FLOOR_M_PER_S;
        assert!(
            (momentum - first * u).abs() < floor * 1.01,
            "{momentum} against {}",
            first * u
        );
    }
}

#[test]
fn a_symmetric_collision_stops_both() {
    for description in all() {
        let (a, b) = (robot(description.clone()), robot(description));
        let commands = [forward(&a, 1.2), forward(&b, 1.2)];
        let mut world = world(6.0, 3.0, vec![(a, at(-1.0, 0.0, 0.0)), (b, at(1.0, 0.0, PI))]);
        let (mut touched, mut deepest) = (0, 0.0_f64);
        for _ in 0..480 {
            step(&mut world, &commands);
            touched += world.contacts_this_tick().len();
            deepest = deepest.max(-world.smallest_separation_m().unwrap_or(0.0));
            let (left, right) = (world.state(0), world.state(1));
            let (l, r) = (velocity(&left), velocity(&right));
            // The sum of momenta is zero by symmetry; the solver takes the pair one after the other.
            assert!((l.0 + r.0).abs() < 1e-6 && (l.1 + r.1).abs() < 1e-6, "{l:?} {r:?}");
            assert!((left.pose.x_m + right.pose.x_m).abs() < 1e-6);
        }
        println!(
            "{}: {touched} ticks in contact, {deepest:.2e} m deep",
            world.state(0).pose.x_m
        );
        assert!(touched > 100 && deepest < 1e-3, "{touched} ticks, {deepest} m");
        assert!((world.state(0).pose.x_m + RADIUS_M).abs() < 1e-3);
    }
}

#[test]
fn an_oblique_hit_keeps_both_momenta() {
    // Linear and angular momentum about the world's origin: sum m v, sum m (x v_y - y v_x) + J r. The hulls' friction
    // turns the robots, so the angular part is not idle.
    let (a, b) = (robot(on_ice(12.0)), robot(on_ice(8.0)));
    let commands = [forward(&a, 1.5), WheelCommand::default()];
    let mut world = world(8.0, 6.0, vec![(a, at(-2.0, 0.0, 0.0)), (b, at(0.0, 0.3, FRAC_PI_2))]);
    let (before, after) = until_contact(&mut world, &commands);
    let momenta = |states: &[RobotState; 2]| {
        let mut sums = [0.0; 3];
        for (state, mass) in states.iter().zip([12.0, 8.0]) {
            let (vx, vy) = velocity(state);
            sums[0] += mass * vx;
            sums[1] += mass * vy;
            sums[2] += mass * (state.pose.x_m * vy - state.pose.y_m * vx) + 0.25 * state.twist.yaw_rate_rad_per_s;
        }
        sums
    };
    let (first, last) = (momenta(&before), momenta(&after));
    println!(
        "{first:.4?} -> {last:.4?}, yaw rates {:.3} {:.3}",
        after[0].twist.yaw_rate_rad_per_s, after[1].twist.yaw_rate_rad_per_s
    );
    // The floor's impulse in the tick is mu (m1 + m2) g/120 = 0.016 N s at arms below 0.5 m plus the wheels' own 0.17 m.
    let floor = 20.0 * FLOOR_M_PER_S;
    for (first, last) in first.iter().zip(last) {
        assert!((first - last).abs() < floor, "{first} -> {last}");
    }
    assert!(after[0].twist.yaw_rate_rad_per_s.abs() > 0.05, "the hulls did not rub");
    // Friction cone: the tangential impulse is at most 0.2 of the normal one.
    let (x, y) = (
        after[1].pose.x_m - after[0].pose.x_m,
        after[1].pose.y_m - after[0].pose.y_m,
    );
    let distance = (x * x + y * y).sqrt();
    let impulse = velocity(&after[1]);
    let (normal, tangent) = (
        (impulse.0 * x + impulse.1 * y) / distance,
        (impulse.1 * x - impulse.0 * y) / distance,
    );
    assert!(
        normal > 0.1 && tangent.abs() < 0.2 * normal + 2.0 * FLOOR_M_PER_S,
        "{normal} {tangent}"
    );
    // They rub all the way, at the cone's edge; the floor's 1 mm/s of 0.2 m/s is within 5 %.
    assert_close("tangential over normal impulse", tangent.abs() / normal, 0.2, 0.05);
}

#[test]
fn nothing_sinks_in_by_a_millimetre() {
    // Three in a row pressed between walls, and everyone driven into a corner at full speed.
    let robots: Vec<Robot> = all().into_iter().map(robot).collect();
    for first in 0..robots.len() {
        let trio = [0, 1, 2].map(|index| robots[(first + index) % robots.len()].clone());
        let commands = [forward(&trio[0], 2.0), forward(&trio[1], 0.0), forward(&trio[2], 2.0)];
        let [a, b, c] = trio;
        let mut row = world(
            4.0,
            3.0,
            vec![
                (a, at(-1.2, 0.0, 0.0)),
                (b, at(0.0, 0.02, 0.3)),
                (c, at(1.2, -0.01, PI)),
            ],
        );
        let (mut pairs, mut touched) = (f64::INFINITY, 0);
        for _ in 0..480 {
            step(&mut row, &commands);
            touched += row.contacts_this_tick().len();
            pairs = pairs.min(row.smallest_separation_m().unwrap_or(f64::INFINITY));
        }
        let mut corner = world(4.0, 3.0, vec![(robots[first].clone(), at(0.5, 0.0, 0.7))]);
        let mut wall = f64::INFINITY;
        for _ in 0..480 {
            step(&mut corner, &[forward(&robots[first], 2.0)]);
            touched += corner.contacts_this_tick().len();
            wall = wall.min(corner.smallest_wall_distance_m());
        }
        println!(
            "{}: pairs {pairs:.2e} m, wall {wall:.2e} m, {touched} contacts",
            robots[first].name()
        );
        assert!(touched > 100, "only {touched} contacts");
        assert!(
            pairs > -1e-3 && wall > -1e-3,
            "{}: {pairs} m, {wall} m",
            robots[first].name()
        );
    }
}
