//! Floor regions and tilt.

mod support;

use support::drive::assert_close;
use support::furnished::{at, circle, forward, furnished, pushable, rectangle, region, step};
use support::{all, diff4, robot};
use twin::effect::Effect;
use twin::robot::Robot;
use twin::world::Contents;

const G: f64 = 9.81;

#[test]
fn wheels_that_slip_brake_with_the_friction_of_the_region() {
    // All wheels of diff4 are driven: with all of them slipping the robot brakes at mu scale g, load transfer or not.
    // At 12 s0 of slip and more tanh is 1 to 1e-10.
    for scale in [0.05, 0.25, 0.6] {
        let driver = robot(diff4());
        let contents = Contents {
            regions: vec![region(rectangle(6.0, 4.0), at(5.0, 0.0, 0.0), scale)],
            ..Contents::default()
        };
        let (go, reverse) = (forward(&driver, 1.6), forward(&driver, -1.6));
        let mut world = furnished(16.0, 6.0, contents, vec![(driver, at(-2.0, 0.0, 0.0))]);
        while world.state(0).pose.x_m < 2.3 {
            step(&mut world, &[go]);
        }
        for _ in 0..12 {
            step(&mut world, &[reverse]);
        }
        let speed = |world: &twin::world::World| world.state(0).twist.forward_m_per_s;
        let before = speed(&world);
        let ticks = 12;
        for _ in 0..ticks {
            step(&mut world, &[reverse]);
        }
        let braking = (before - speed(&world)) * 120.0 / f64::from(ticks);
        assert!(speed(&world) > 0.05, "still rolling forward");
        assert_close(&format!("braking at scale {scale}"), braking, 0.8 * scale * G, 1e-6);
    }
}

#[test]
fn the_last_region_that_holds_a_wheel_decides() {
    // The whole floor is ice but for a region of scale 1 over all of it: no bit differs from the bare floor.
    let everywhere = rectangle(8.0, 4.0);
    let run = |regions: Vec<f64>| {
        let regions = regions
            .into_iter()
            .map(|scale| region(everywhere, at(0.0, 0.0, 0.0), scale));
        let contents = Contents {
            regions: regions.collect(),
            ..Contents::default()
        };
        let driver = robot(diff4());
        let command = forward(&driver, 1.2);
        let mut world = furnished(8.0, 4.0, contents, vec![(driver, at(-2.0, 0.0, 0.3))]);
        for _ in 0..120 {
            step(&mut world, &[command]);
        }
        world.state(0)
    };
    assert_eq!(run(vec![0.1, 1.0]), run(vec![]));
    assert_eq!(run(vec![0.1, 0.3]), run(vec![0.3]));
    assert!(run(vec![0.3, 0.1]).pose.x_m < run(vec![0.3]).pose.x_m - 0.01);
}

#[test]
fn a_region_under_one_side_turns_the_robot_and_a_round_one_is_the_patch_effect() {
    let description = diff4();
    let patch = [("x", 0.3), ("y", 0.25), ("radius", 0.3), ("scale", 0.2)];
    let effect = [Effect::new("low_friction_patch", &patch)];
    let on_patch = match Robot::with_effects(description.clone(), &effect) {
        Ok(robot) => robot,
        Err(problem) => panic!("{problem}"),
    };
    let contents = Contents {
        regions: vec![region(circle(0.3), at(0.3, 0.25, 0.0), 0.2)],
        ..Contents::default()
    };
    let bare = robot(description);
    let command = forward(&bare, 1.5);
    let start = at(0.2, 0.0, 0.0);
    let mut a = furnished(8.0, 4.0, contents, vec![(bare, start)]);
    let mut b = furnished(8.0, 4.0, Contents::default(), vec![(on_patch, start)]);
    for _ in 0..200 {
        step(&mut a, &[command]);
        step(&mut b, &[command]);
        assert_eq!(a.state(0), b.state(0));
    }
    // The left wheels stand on it and push less: the robot turns left.
    assert!(a.state(0).pose.yaw_rad > 1e-2, "{:?}", a.state(0).pose);
}

#[test]
fn the_tilt_of_the_world_is_the_tilt_effect_of_every_robot() {
    for description in all() {
        let effect = [Effect::new("floor_tilt", &[("x", 0.03), ("y", -0.05)])];
        let tilted = match Robot::with_effects(description.clone(), &effect) {
            Ok(robot) => robot,
            Err(problem) => panic!("{problem}"),
        };
        let contents = Contents {
            tilt_x_rad: 0.03,
            tilt_y_rad: -0.05,
            ..Contents::default()
        };
        let level = robot(description);
        let command = forward(&level, 0.6);
        let start = at(-1.0, 0.5, 0.4);
        let mut a = furnished(8.0, 6.0, contents, vec![(level, start)]);
        let mut b = furnished(8.0, 6.0, Contents::default(), vec![(tilted, start)]);
        for _ in 0..240 {
            step(&mut a, &[command]);
            step(&mut b, &[command]);
            assert_eq!(a.state(0), b.state(0));
        }
    }
}

#[test]
fn a_box_on_a_tilt_slides_at_g_times_tilt_less_friction() {
    // Linear in the tilt: a = g (|tilt| - mu) along it, from rest: x = a t^2/2. Below the friction it does not move.
    let contents = |friction: f64| Contents {
        pushable: vec![pushable(rectangle(0.4, 0.2), at(0.0, 0.0, 0.3), 5.0, friction)],
        tilt_x_rad: 0.09,
        tilt_y_rad: 0.12,
        ..Contents::default()
    };
    let bystander = || vec![(robot(diff4()), at(-6.0, -3.0, 0.0))];
    let mut sliding = furnished(20.0, 12.0, contents(0.05), bystander());
    let mut resting = furnished(20.0, 12.0, contents(0.151), bystander());
    for _ in 0..120 {
        step(&mut sliding, &[Default::default()]);
        step(&mut resting, &[Default::default()]);
    }
    let (state, expected) = (sliding.obstacle(0), 0.5 * G * (0.15 - 0.05));
    assert!((state.pose.x_m - 0.6 * expected).abs() < 1e-9, "{state:?}");
    assert!((state.pose.y_m - 0.8 * expected).abs() < 1e-9, "{state:?}");
    assert!((state.twist.speed_m_per_s() - 2.0 * expected).abs() < 1e-9, "{state:?}");
    assert_eq!(resting.obstacle(0).pose, at(0.0, 0.0, 0.3));
    // It ends at the wall, not beyond it.
    for _ in 0..960 {
        step(&mut sliding, &[Default::default()]);
    }
    let corner = sliding.obstacle(0).pose;
    assert!(corner.x_m > 5.0 && corner.y_m + 0.1 < 6.0 + 1e-3, "{corner:?}");
}
