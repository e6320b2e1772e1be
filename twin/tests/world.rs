//! Collisions, digests, snapshots.

mod support;

use support::{all, car, diff2, omni4, robot};
use twin::command::WheelCommand;
use twin::pose::Pose;
use twin::robot::Robot;
use twin::twist::BodyTwist;
use twin::world::{Arena, Snapshot, World};

const ARENA: Arena = Arena {
    width_m: 4.0,
    height_m: 3.0,
};
const RADIUS_M: f64 = 0.25;

fn at(x_m: f64, y_m: f64, yaw_rad: f64) -> Pose {
    Pose { x_m, y_m, yaw_rad }
}

fn world(robots: Vec<(Robot, Pose)>) -> World {
    match World::new(
        ARENA,
        robots
            .into_iter()
            .map(|(robot, pose)| (robot, pose, RADIUS_M))
            .collect(),
    ) {
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

#[test]
fn robots_that_meet_head_on_do_not_pass_into_each_other() {
    for speed in [0.3, 1.0, 1.8] {
        let (a, b) = (robot(diff2()), robot(omni4()));
        let commands = [forward(&a, speed), forward(&b, speed)];
        let mut world = world(vec![(a, at(-1.2, 0.0, 0.0)), (b, at(1.2, 0.0, core::f64::consts::PI))]);
        let (mut smallest, mut touched) = (f64::INFINITY, 0);
        for _ in 0..600 {
            step(&mut world, &commands);
            smallest = smallest.min(world.smallest_separation_m().unwrap_or(f64::INFINITY));
            touched += world
                .contacts_this_tick()
                .iter()
                .filter(|contact| (contact.a, contact.b) == (0, Some(1)))
                .count();
        }
        println!("{speed} m/s: overlap {:.2e} m, {touched} ticks in contact", -smallest);
        assert!(touched > 10, "they never met");
        assert!(smallest > -1e-3, "{speed} m/s: overlap {} m", -smallest);
    }
}

#[test]
fn walls_hold() {
    for (yaw, speed) in [(0.0, 2.0), (0.4, 1.5), (-2.0, 1.0), (core::f64::consts::FRAC_PI_4, 2.0)] {
        let robot = robot(diff2());
        let command = forward(&robot, speed);
        let mut world = world(vec![(robot, at(0.0, 0.0, yaw))]);
        let mut walls = 0;
        let mut smallest = f64::INFINITY;
        for _ in 0..600 {
            step(&mut world, &[command]);
            smallest = smallest.min(world.smallest_wall_distance_m());
            walls += world
                .contacts_this_tick()
                .iter()
                .filter(|contact| contact.b.is_none())
                .count();
        }
        println!("yaw {yaw}: {:.2e} m into the wall", -smallest);
        assert!(
            walls > 10 && smallest > -1e-3,
            "yaw {yaw}: {smallest} m, {walls} contacts"
        );
    }
}

#[test]
fn a_robot_that_is_pushed_moves() {
    let (pusher, pushed) = (robot(diff2()), robot(omni4()));
    let command = forward(&pusher, 0.5);
    let mut world = world(vec![(pusher, at(-0.6, 0.0, 0.0)), (pushed, at(0.0, 0.0, 0.0))]);
    for _ in 0..240 {
        step(&mut world, &[command, WheelCommand::default()]);
    }
    assert!(world.state(1).pose.x_m > 0.05, "{:?}", world.state(1).pose);
}

#[test]
fn a_near_miss_changes_nothing() {
    // Driving past a wall within the swept circle goes through the collision solver and must give the free trace.
    let alone = |wall_gap: f64| {
        let robot = robot(diff2());
        let command = forward(&robot, 0.8);
        let mut world = world(vec![(robot, at(-1.0, 1.5 - RADIUS_M - wall_gap, 0.0))]);
        for _ in 0..120 {
            step(&mut world, &[command]);
            assert!(world.contacts_this_tick().is_empty());
        }
        world.state(0)
    };
    let (near, far) = (alone(0.005), alone(0.9));
    assert_eq!(near.pose.x_m, far.pose.x_m);
    assert_eq!(near.twist, far.twist);
}

/// Six chassis in a pile-up, driven by a fixed pattern.
fn pile_up() -> (World, Vec<Robot>) {
    let robots: Vec<Robot> = all().into_iter().map(robot).collect();
    let poses = [
        at(-1.5, -0.8, 0.6),
        at(0.0, -0.9, 1.6),
        at(1.5, -0.8, 2.5),
        at(-1.5, 0.9, -0.6),
        at(0.0, 0.9, -1.6),
        at(1.5, 0.9, -2.5),
    ];
    (world(robots.iter().cloned().zip(poses).collect()), robots)
}

fn pattern(robots: &[Robot], tick: u64) -> Vec<WheelCommand> {
    let phase = (tick / 90 % 4) as f64;
    let twist = |index: usize| BodyTwist {
        forward_m_per_s: 0.9 - 0.3 * phase,
        left_m_per_s: 0.1 * phase,
        yaw_rate_rad_per_s: 0.4 * index as f64 - 0.3 * phase,
    };
    robots
        .iter()
        .enumerate()
        .map(|(index, robot)| robot.wheel_speeds(twist(index)))
        .collect()
}

#[test]
fn the_same_run_gives_the_same_digest() {
    let run = || {
        let (mut world, robots) = pile_up();
        let mut contacts = 0;
        for tick in 0..600 {
            step(&mut world, &pattern(&robots, tick));
            contacts += world.contacts_this_tick().len();
        }
        assert!(contacts > 50, "only {contacts} contacts");
        world.digest().to_string()
    };
    let digest = run();
    assert_eq!(digest.len(), 32);
    assert_eq!(digest, run());
}

#[test]
fn a_restored_world_is_identical_at_every_later_tick() {
    let (mut world, robots) = pile_up();
    let mut snapshots = Vec::new();
    let mut digests = Vec::new();
    for tick in 0..480 {
        if tick % 37 == 0 {
            snapshots.push((tick, serde_json::to_string(&world.snapshot()).unwrap_or_default()));
        }
        step(&mut world, &pattern(&robots, tick));
        digests.push(world.digest());
    }
    for (from, text) in snapshots {
        let Ok(snapshot) = serde_json::from_str::<Snapshot>(&text) else {
            panic!("{text}")
        };
        let (mut again, _) = pile_up();
        assert!(again.restore(&snapshot).is_ok());
        assert_eq!(again.snapshot(), snapshot);
        for tick in from..480 {
            step(&mut again, &pattern(&robots, tick));
            assert_eq!(
                again.digest(),
                digests[tick as usize],
                "restored at {from}, tick {tick}"
            );
        }
    }
}

#[test]
fn snapshots_of_other_worlds_and_damaged_ones_are_refused() {
    let (mut world, robots) = pile_up();
    step(&mut world, &pattern(&robots, 0));
    let good = world.snapshot();
    let (_, mut others) = pile_up();
    others.swap(0, 1);
    let mut other = self::world(
        others
            .into_iter()
            .zip([at(-1.5, -0.8, 0.6), at(0.0, 0.0, 0.0)])
            .collect(),
    );
    assert!(other.restore(&good).is_err());
    for damage in [0, 1, 2, 3] {
        let mut bad = good.clone();
        match damage {
            0 => bad.twin_version = "twin-0".to_owned(),
            1 => bad.digest.truncate(5),
            2 => bad.robots[2].replace_range(0..16, "7ff8000000000000"),
            _ => bad.robots[3].truncate(16),
        }
        assert!(world.restore(&bad).is_err(), "damage {damage}");
    }
    assert_eq!(world.snapshot(), good);
}

#[test]
fn digests_differ_when_one_bit_of_the_start_differs() {
    let digest = |x_m: f64| {
        let robot = robot(diff2());
        let command = forward(&robot, 0.5);
        let mut world = world(vec![(robot, at(x_m, 0.0, 0.0))]);
        step(&mut world, &[command]);
        world.digest()
    };
    assert_ne!(digest(0.1), digest(f64::from_bits(0.1_f64.to_bits() + 1)));
}

#[test]
fn a_single_robot_in_the_world_is_the_free_robot() {
    let robot = robot(car("awd"));
    let command = robot.wheel_speeds(BodyTwist {
        forward_m_per_s: 0.5,
        left_m_per_s: 0.0,
        yaw_rate_rad_per_s: 0.9,
    });
    let mut free = twin::free::FreeRobot::at_rest(&robot, Pose::default());
    let mut world = world(vec![(robot, Pose::default())]);
    for _ in 0..240 {
        step(&mut world, &[command]);
        (0..4).for_each(|_| free.step(&command));
        assert_eq!(world.state(0).twist, free.state().twist);
        assert_eq!(world.state(0).pose, free.state().pose);
    }
}
