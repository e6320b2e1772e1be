//! Fixed and pushable obstacles against mechanics.

mod support;

use support::drive::assert_close;
use support::furnished::{
    RADIUS_M, at, circle, fixed, forward, furnished, in_world, pushable, pushables, rectangle, step, velocity,
};
use support::{diff2, diff4, omni4, robot};
use twin::command::WheelCommand;
use twin::robot::RobotDescription;
use twin::world::{Contents, Obstacle, ObstacleContact, World};

const G: f64 = 9.81;
/// n k_t of the test motor, N m/A.
const TORQUE_PER_CURRENT: f64 = 19.2 * 0.031;

/// Sum of the wheels' forces on the floor from what the motors draw: (n k_t i - t_c tanh(W/0.3) - b W)/R at steady speed.
fn wheel_force_n(world: &World) -> f64 {
    let state = world.state(0);
    (0..2).fold(0.0, |sum, wheel| {
        let speed = state.wheel_rad_per_s[wheel];
        let drag = 0.02 * libm::tanh(speed / 0.3) + 0.0004 * speed;
        sum + (TORQUE_PER_CURRENT * state.current_a[wheel] - drag) / 0.05
    })
}

#[test]
fn pushing_at_constant_speed_takes_the_floor_friction_of_the_box() {
    // F = mu m g: 0.4 x 4 x 9.81 = 15.7 N and 0.6 x 2 x 9.81 = 11.8 N; the rest of the motor's torque is its own drag.
    for (mass_kg, friction, shape) in [(4.0, 0.4, rectangle(0.4, 0.3)), (2.0, 0.6, circle(0.2))] {
        let pusher = robot(diff2());
        let command = forward(&pusher, 0.4);
        let contents = pushables(vec![pushable(shape, at(-3.0, 0.0, 0.0), mass_kg, friction)]);
        let mut world = furnished(10.0, 3.0, contents, vec![(pusher, at(-4.0, 0.0, 0.0))]);
        let (mut force_n, mut samples) = (0.0, 0.0);
        for tick in 0..1200 {
            step(&mut world, &[command]);
            if tick >= 960 {
                force_n += wheel_force_n(&world);
                samples += 1.0;
                let pushed = in_world(world.obstacle(0).pose, world.obstacle(0).twist);
                let speed = velocity(&world.state(0)).0;
                assert!(
                    (pushed.0 - speed).abs() < 1e-3 && (speed - 0.4).abs() < 0.02,
                    "{pushed:?} {speed}"
                );
            }
        }
        // The speed loop has settled to 1e-3 of its force after 8 s of integral action.
        assert_close("pushing force, N", force_n / samples, friction * mass_kg * G, 5e-3);
    }
}

#[test]
fn a_released_box_slides_on_for_v2_over_2_mu_g() {
    // The robot brakes at up to mu g/2 = 3.9 m/s^2 (half its load is on casters), the box at 0.15 g: it leaves.
    let pusher = robot(diff2());
    let (go, stop) = (forward(&pusher, 1.2), WheelCommand::default());
    let contents = pushables(vec![pushable(rectangle(0.3, 0.4), at(-3.0, 0.0, 0.0), 3.0, 0.15)]);
    let mut world = furnished(12.0, 3.0, contents, vec![(pusher, at(-4.0, 0.0, 0.0))]);
    for _ in 0..240 {
        step(&mut world, &[go]);
    }
    let mut left = world.obstacle(0);
    for _ in 0..360 {
        step(&mut world, &[stop]);
        if !world.obstacle_contacts_this_tick().is_empty() {
            left = world.obstacle(0);
        }
    }
    let speed = left.twist.speed_m_per_s();
    let rest = world.obstacle(0);
    assert!(speed > 0.8 && rest.twist.speed_m_per_s() == 0.0, "{speed}");
    let slid_m = rest.pose.x_m - left.pose.x_m;
    // The law is integrated exactly but for the last step: at most mu g h^2 = 6 um.
    let expected_m = speed * speed / (2.0 * 0.15 * G);
    println!("slid {slid_m:.6} m, expected {expected_m:.6} m");
    assert!((slid_m - expected_m).abs() < 1e-5, "{slid_m} against {expected_m}");
    assert!(rest.pose.y_m.abs() < 1e-6 && rest.pose.yaw_rad.abs() < 1e-6);
}

#[test]
fn a_box_that_friction_holds_does_not_move_by_a_bit() {
    // It starts at the box: a run-up would move it, as an impact is stronger than any friction. The robot can push with mu N = 0.8 x 59 N = 47 N; the box holds 0.8 x 10 x 9.81 = 78 N.
    let pusher = robot(diff2());
    let command = forward(&pusher, 1.5);
    let start = at(0.0, 0.0, 0.0);
    let contents = pushables(vec![pushable(rectangle(0.4, 0.6), start, 10.0, 0.8)]);
    let mut world = furnished(6.0, 3.0, contents, vec![(pusher, at(-0.45, 0.0, 0.0))]);
    let mut touched = 0;
    for _ in 0..600 {
        step(&mut world, &[command]);
        touched += world.obstacle_contacts_this_tick().len();
        assert_eq!(world.obstacle(0).pose, start);
    }
    assert!(touched > 500 && velocity(&world.state(0)).0.abs() < 1e-6, "{touched}");
}

/// `diff4` of a mass on a floor so slippery (mu = 0.01) that wheels do not matter during a collision.
fn on_ice(mass_kg: f64) -> RobotDescription {
    let mut description = diff4();
    description.mass_kg = mass_kg;
    description.floor_friction = 0.01;
    description
}

#[test]
fn a_robot_and_a_box_share_the_momentum() {
    // Restitution 0: m1 u1 = (m1 + m2) u'. The floor takes at most mu (m1 + m2) g/120 in the tick, at 0.01 each.
    for (first, second) in [(12.0, 6.0), (12.0, 0.5), (5.0, 20.0)] {
        let runner = robot(on_ice(first));
        let command = forward(&runner, 1.5);
        let contents = pushables(vec![pushable(circle(0.2), at(0.0, 0.0, 0.0), second, 0.01)]);
        let mut world = furnished(6.0, 3.0, contents, vec![(runner, at(-1.5, 0.0, 0.0))]);
        let mut before = 0.0;
        while world.obstacle_contacts_this_tick().is_empty() {
            assert!(world.tick() < 2400, "they never met");
            before = velocity(&world.state(0)).0;
            step(&mut world, &[command]);
        }
        let pair = ObstacleContact {
            robot: 0,
            obstacle: Obstacle::Pushable(0),
        };
        assert_eq!(world.obstacle_contacts_this_tick(), [pair]);
        let floor_m_per_s = 2.0 * 0.01 * G / 120.0;
        let expected = first * before / (first + second);
        let after = (velocity(&world.state(0)).0, world.obstacle(0).twist.forward_m_per_s);
        println!("{first} kg at {before:.4} m/s on {second} kg: {after:.5?}, expected {expected:.5}");
        assert!(
            (after.0 - expected).abs() < floor_m_per_s,
            "{after:?} against {expected}"
        );
        assert!(
            (after.1 - expected).abs() < floor_m_per_s,
            "{after:?} against {expected}"
        );
        let lost = first * (before - after.0) - second * after.1;
        assert!(lost.abs() < (first + second) * 0.01 * G / 120.0 * 1.01, "{lost} N s");
    }
}

/// Wheels follow their set-points and grip with mu = 3, so that 5 m/s are reached on a short way.
fn fast() -> RobotDescription {
    let mut description = diff4();
    (description.motor, description.floor_friction, description.com_height_m) = (None, 3.0, 0.02);
    description
}

#[test]
fn nothing_is_tunnelled_at_5_m_per_s() {
    let thin = [
        (rectangle(0.01, 3.0), at(0.0, 0.0, 0.0)),
        (rectangle(0.01, 3.0), at(0.0, 0.0, 0.7)),
        (circle(0.01), at(0.0, 0.02, 0.0)),
        (rectangle(0.01, 0.01), at(0.0, -0.01, 0.4)),
    ];
    for (shape, pose) in thin {
        for heavy in [false, true] {
            let contents = if heavy {
                pushables(vec![pushable(shape, pose, 2000.0, 3.0)])
            } else {
                Contents {
                    fixed: vec![fixed(shape, pose)],
                    ..Contents::default()
                }
            };
            let runner = robot(fast());
            let command = forward(&runner, 5.0);
            let mut world = furnished(10.0, 6.0, contents.clone(), vec![(runner, at(-3.0, 0.0, 0.0))]);
            let (mut fastest, mut touched, mut deepest) = (0.0_f64, 0, 0.0_f64);
            for _ in 0..240 {
                step(&mut world, &[command]);
                fastest = fastest.max(world.state(0).twist.forward_m_per_s);
                touched += world.obstacle_contacts_this_tick().len();
                let place = world.state(0).pose;
                let now = Contents {
                    fixed: vec![fixed(shape, if heavy { world.obstacle(0).pose } else { pose })],
                    ..Contents::default()
                };
                if let Some((_, overlap_m)) = now.fixed_overlap_m(place.x_m, place.y_m, RADIUS_M) {
                    deepest = deepest.max(overlap_m);
                }
            }
            println!("{shape:?} heavy {heavy}: {fastest:.3} m/s, {touched} contacts, {deepest:.2e} m deep");
            assert!(fastest > 4.9 && touched > 0, "{fastest} m/s, {touched} contacts");
            assert!(deepest < 2e-3, "{deepest} m deep");
        }
    }
}

#[test]
fn a_row_of_boxes_is_pushed_to_the_wall_and_stays_there() {
    let pusher = robot(diff2());
    let command = forward(&pusher, 0.8);
    let boxes = [-0.5, -0.15, 0.2].map(|x| pushable(rectangle(0.3, 0.3), at(x, 0.0, 0.0), 1.0, 0.3));
    let mut world = furnished(4.0, 3.0, pushables(boxes.to_vec()), vec![(pusher, at(-1.2, 0.0, 0.0))]);
    for _ in 0..960 {
        step(&mut world, &[command]);
    }
    // Three boxes of 0.3 m before the wall at 2 m, and the robot behind them.
    let left = [0, 1, 2].map(|index| world.obstacle(index).pose.x_m);
    println!("{left:?} {:?}", world.state(0).pose);
    for (index, expected) in [1.25, 1.55, 1.85].into_iter().enumerate() {
        assert!((left[index] - expected).abs() < 1e-3, "{left:?}");
    }
    assert!((world.state(0).pose.x_m - (1.1 - RADIUS_M)).abs() < 1e-3);
    // The speed loop's integral goes on pressing; pressed, nothing moves.
    let before = world.obstacle(1);
    for _ in 0..120 {
        step(&mut world, &[WheelCommand::default()]);
    }
    let moved_m = (world.obstacle(1).pose.x_m - before.pose.x_m).abs();
    let speed = world.obstacle(1).twist.speed_m_per_s();
    assert!(moved_m < 1e-4 && speed < 1e-4, "{moved_m} m, {speed} m/s");
}

#[test]
fn a_push_beside_the_centre_turns_the_box_and_its_mirror_image_the_other_way() {
    let run = |mirror: f64| {
        let pusher = robot(omni4());
        let command = forward(&pusher, 0.5);
        let contents = pushables(vec![
            pushable(rectangle(0.3, 0.5), at(0.0, 0.18 * mirror, 0.2 * mirror), 2.0, 0.3),
            pushable(circle(0.15), at(0.7, 0.3 * mirror, 0.0), 1.0, 0.4),
        ]);
        let mut world = furnished(6.0, 4.0, contents, vec![(pusher, at(-1.0, 0.0, 0.0))]);
        for _ in 0..360 {
            step(&mut world, &[command]);
        }
        (world.state(0).pose, [0, 1].map(|index| world.obstacle(index).pose))
    };
    let (left, right) = (run(1.0), run(-1.0));
    assert!(left.1[0].yaw_rad > 0.3, "the box turned to {}", left.1[0].yaw_rad);
    for (one, other) in [(left.0, right.0), (left.1[0], right.1[0]), (left.1[1], right.1[1])] {
        let apart = (one.x_m - other.x_m).abs() + (one.y_m + other.y_m).abs() + (one.yaw_rad + other.yaw_rad).abs();
        // The solver takes contact points in an order of its own: no bits, but far below a millimetre.
        assert!(apart < 1e-6, "{one:?} {other:?}");
    }
}

#[test]
fn a_box_that_nobody_touches_keeps_every_bit_and_robots_pass_as_without_it() {
    let run = |contents: Contents| {
        let passer = robot(diff2());
        let command = forward(&passer, 1.0);
        let mut world = furnished(8.0, 4.0, contents, vec![(passer, at(-2.0, 0.0, 0.0))]);
        for _ in 0..400 {
            step(&mut world, &[command]);
            assert!(world.obstacle_contacts_this_tick().is_empty());
        }
        world
    };
    // 1 mm beside the way, and a pillar on the other side: through the solver's hands without a touch.
    let beside = at(0.0, RADIUS_M + 0.151, 0.0);
    let contents = Contents {
        pushable: vec![pushable(rectangle(0.3, 0.3), beside, 1.0, 0.2)],
        fixed: vec![fixed(circle(0.2), at(0.5, -RADIUS_M - 0.201, 0.0))],
        ..Contents::default()
    };
    let (with, without) = (run(contents), run(Contents::default()));
    assert_eq!(with.obstacle(0).pose, beside);
    assert_eq!(with.state(0), without.state(0));
}
