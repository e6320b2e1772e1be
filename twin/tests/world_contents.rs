//! Description, determinism and limits of arenas with contents.

mod support;

use proptest::prelude::*;
use support::furnished::{
    RADIUS_M, at, circle, fixed, forward, furnished, pushable, pushables, rectangle, region, step, velocity,
};
use support::{all, diff2, diff4, omni4, robot};
use twin::pose::Pose;
use twin::sensor::surroundings::Ray;
use twin::world::{Arena, Contents, MAX_REGIONS, Shape, Snapshot, World, WorldError};

const ARENA: Arena = Arena {
    width_m: 4.0,
    height_m: 3.0,
};

#[test]
fn the_example_of_the_documentation_is_possible() {
    let page = include_str!("../../docs/world.md");
    let json = page.split("```json").nth(1).and_then(|rest| rest.split("```").next());
    let contents: Contents = match serde_json::from_str(json.unwrap_or_default()) {
        Ok(contents) => contents,
        Err(error) => panic!("{error}"),
    };
    assert!(contents.check(&ARENA).is_empty(), "{:?}", contents.check(&ARENA));
    assert!(!contents.fixed.is_empty() && !contents.pushable.is_empty() && !contents.regions.is_empty());
    assert!(contents.tilt_x_rad != 0.0);
    let again: Result<Contents, _> = serde_json::from_str(&serde_json::to_string(&contents).unwrap_or_default());
    assert_eq!(again.ok(), Some(contents));
    assert_eq!(serde_json::to_string(&Contents::default()).unwrap_or_default(), "{}");
    for text in [
        r#"{"walls":[]}"#,
        r#"{"regions":[{"shape":{"circle":{"radius_m":1,"x":2}}}]}"#,
    ] {
        assert!(serde_json::from_str::<Contents>(text).is_err(), "{text}");
    }
}

#[test]
fn each_limit_names_its_field() {
    let box_at = |x_m: f64, y_m: f64| pushable(rectangle(0.4, 0.2), at(x_m, y_m, 0.0), 1.0, 0.3);
    let tilt = |tilt_x_rad: f64| Contents {
        tilt_x_rad,
        ..Contents::default()
    };
    let pillar = |shape: Shape, pose: Pose| Contents {
        fixed: vec![fixed(shape, pose)],
        ..Contents::default()
    };
    let one = |change: &dyn Fn(&mut twin::world::PushableObstacle)| {
        let mut changed = box_at(0.0, 0.0);
        change(&mut changed);
        pushables(vec![changed])
    };
    let cases = [
        (one(&|one| one.mass_kg = 0.0), "pushable[0].mass_kg"),
        (one(&|one| one.mass_kg = f64::NAN), "pushable[0].mass_kg"),
        (one(&|one| one.floor_friction = -0.1), "pushable[0].floor_friction"),
        (one(&|one| one.name.clear()), "pushable[0].name"),
        (
            one(&|one| one.shape = rectangle(-1.0, 0.2)),
            "pushable[0].shape.rectangle.length_m",
        ),
        (one(&|one| one.pose.yaw_rad = f64::INFINITY), "pushable[0].pose.yaw_rad"),
        (one(&|one| one.pose.x_m = 1.81), "pushable[0].pose.x_m"),
        (one(&|one| one.pose.y_m = -1.45), "pushable[0].pose.y_m"),
        (pushables(vec![box_at(0.0, 0.0), box_at(0.39, 0.0)]), "pushable[1].pose"),
        (pillar(circle(0.0), at(0.0, 0.0, 0.0)), "fixed[0].shape.circle.radius_m"),
        (pillar(circle(0.2), at(0.0, 1.4, 0.0)), "fixed[0].pose.y_m"),
        (pillar(rectangle(9.0, 0.1), at(0.0, 0.0, 0.0)), "fixed[0].pose.x_m"),
        (tilt(0.21), "tilt_x_rad"),
        (tilt(f64::NAN), "tilt_x_rad"),
        (
            Contents {
                regions: vec![region(circle(1.0), at(0.0, 0.0, 0.0), 2.5)],
                ..Contents::default()
            },
            "regions[0].friction_scale",
        ),
        (
            Contents {
                regions: vec![region(circle(1.0), at(0.0, 0.0, 0.0), 0.5); MAX_REGIONS + 1],
                ..Contents::default()
            },
            "regions",
        ),
        (
            Contents {
                fixed: vec![fixed(circle(0.1), at(0.29, 0.0, 0.0))],
                ..one(&|_| {})
            },
            "pushable[0].pose",
        ),
    ];
    for (contents, field) in cases {
        let problems = contents.check(&ARENA);
        assert_eq!(problems.len(), 1, "{field}: {problems:?}");
        assert_eq!(problems[0].field, field);
        assert!(!problems[0].limit.is_empty() && !problems[0].remedy.is_empty());
        let refused = World::furnished(ARENA, contents, vec![(robot(diff2()), at(-1.0, -1.0, 0.0), RADIUS_M)]);
        assert!(matches!(refused, Err(WorldError::Contents(problem)) if problem.field == field));
    }
}

#[test]
fn a_robot_that_starts_in_an_obstacle_is_refused() {
    let near = |pose: Pose| {
        let contents = Contents {
            fixed: vec![fixed(rectangle(0.4, 0.4), at(0.5, 0.0, 0.0))],
            ..pushables(vec![pushable(circle(0.2), at(-0.5, 0.0, 0.0), 1.0, 0.3)])
        };
        World::furnished(ARENA, contents, vec![(robot(diff2()), pose, RADIUS_M)]).map(|_| ())
    };
    assert_eq!(near(at(0.04, 0.0, 0.0)), Ok(()));
    for (x_m, field) in [
        (0.06, "fixed[0].pose"),
        (-0.06, "pushable[0].pose"),
        (0.5, "fixed[0].pose"),
    ] {
        match near(at(x_m, 0.0, 0.0)) {
            Err(WorldError::Contents(problem)) => assert_eq!(problem.field, field),
            other => panic!("{x_m}: {other:?}"),
        }
    }
}

#[test]
fn empty_contents_are_the_empty_arena_and_others_have_a_fingerprint_of_their_own() {
    let place = || vec![(robot(omni4()), at(0.0, 0.0, 0.0), RADIUS_M)];
    let digest = |world: Result<World, WorldError>| match world {
        Ok(world) => world.digest(),
        Err(error) => panic!("{error}"),
    };
    let empty = digest(World::new(ARENA, place()));
    assert_eq!(digest(World::furnished(ARENA, Contents::default(), place())), empty);
    let tilted = |tilt_x_rad: f64| Contents {
        tilt_x_rad,
        ..Contents::default()
    };
    let first = digest(World::furnished(ARENA, tilted(0.01), place()));
    assert_ne!(first, empty);
    assert_ne!(first, digest(World::furnished(ARENA, tilted(0.02), place())));
}

/// Three robots, four boxes, a pillar, a region and a tilt that lets the round ones roll off.
fn busy() -> (World, Vec<twin::robot::Robot>) {
    let robots: Vec<_> = [diff2(), omni4(), support::car("awd")].into_iter().map(robot).collect();
    let poses = [at(-1.5, 0.0, 0.0), at(1.4, 0.2, 3.0), at(0.0, -1.1, 1.5)];
    let contents = Contents {
        fixed: vec![fixed(rectangle(0.3, 0.2), at(0.0, 1.0, 0.4))],
        pushable: vec![
            pushable(rectangle(0.3, 0.4), at(-0.8, 0.1, 0.2), 2.0, 0.4),
            pushable(circle(0.15), at(0.0, -0.3, 0.0), 1.0, 0.02),
            pushable(rectangle(0.2, 0.2), at(0.7, 0.2, 0.0), 0.5, 0.3),
            pushable(circle(0.1), at(0.3, 0.4, 0.0), 0.3, 0.5),
        ],
        regions: vec![region(circle(0.5), at(0.5, 0.0, 0.0), 0.4)],
        tilt_x_rad: -0.01,
        tilt_y_rad: 0.03,
        geofence: Vec::new(),
    };
    let placed = robots.iter().cloned().zip(poses).collect();
    (furnished(4.0, 3.0, contents, placed), robots)
}

fn pattern(robots: &[twin::robot::Robot], tick: u64) -> Vec<twin::command::WheelCommand> {
    let speed = 1.0 - 0.5 * (tick / 100 % 4) as f64;
    robots.iter().map(|robot| forward(robot, speed)).collect()
}

#[test]
fn a_restored_world_with_contents_is_identical_at_every_later_tick() {
    let (mut world, robots) = busy();
    let (mut snapshots, mut digests, mut touched) = (Vec::new(), Vec::new(), 0);
    for tick in 0..360 {
        if tick % 29 == 0 {
            snapshots.push((tick, serde_json::to_string(&world.snapshot()).unwrap_or_default()));
        }
        step(&mut world, &pattern(&robots, tick));
        touched += world.obstacle_contacts_this_tick().len();
        digests.push(world.digest());
    }
    assert!(touched > 50, "only {touched} contacts");
    for (from, text) in snapshots {
        let Ok(snapshot) = serde_json::from_str::<Snapshot>(&text) else {
            panic!("{text}")
        };
        let (mut again, _) = busy();
        assert!(again.restore(&snapshot).is_ok());
        assert_eq!(again.snapshot(), snapshot);
        for tick in from..360 {
            step(&mut again, &pattern(&robots, tick));
            assert_eq!(
                again.digest(),
                digests[tick as usize],
                "restored at {from}, tick {tick}"
            );
        }
    }
    let mut bad = world.snapshot();
    bad.obstacles[1].replace_range(0..16, "7ff8000000000000");
    let mut missing = world.snapshot();
    missing.obstacles.pop();
    for snapshot in [bad, missing] {
        assert!(world.restore(&snapshot).is_err());
    }
}

#[test]
fn the_order_of_the_robots_changes_no_more_than_rounding() {
    // The solver takes bodies in robot order: bits differ as soon as bodies touch, the motion does not.
    let run = |order: [usize; 3]| {
        let (_, robots) = busy();
        let poses = [at(-1.5, 0.0, 0.0), at(1.4, 0.2, 3.0), at(0.0, -1.1, 1.5)];
        let contents = pushables(vec![
            pushable(rectangle(0.3, 0.4), at(-0.8, 0.1, 0.2), 2.0, 0.4),
            pushable(rectangle(0.2, 0.2), at(0.7, 0.2, 0.0), 0.5, 0.3),
        ]);
        let placed = order
            .iter()
            .map(|index| (robots[*index].clone(), poses[*index]))
            .collect();
        let mut world = furnished(4.0, 3.0, contents, placed);
        let mut touched = 0;
        for _ in 0..240 {
            let commands: Vec<_> = order.iter().map(|index| forward(&robots[*index], 0.4)).collect();
            step(&mut world, &commands);
            touched += world.obstacle_contacts_this_tick().len();
        }
        assert!(touched > 20, "only {touched} contacts");
        let mut states = vec![Pose::default(); 3];
        for (place, index) in order.iter().enumerate() {
            states[*index] = world.state(place).pose;
        }
        states.extend([0, 1].map(|index| world.obstacle(index).pose));
        states
    };
    let first = run([0, 1, 2]);
    for order in [[1, 0, 2], [2, 1, 0], [1, 2, 0]] {
        for (a, b) in first.iter().zip(run(order)) {
            let apart = a.distance_m(&b) + (a.yaw_rad - b.yaw_rad).abs();
            assert!(apart < 1e-6, "{order:?}: {a:?} {b:?}");
        }
    }
}

#[test]
fn range_sensors_see_obstacles_where_they_are_now() {
    let pusher = robot(diff2());
    let command = forward(&pusher, 0.6);
    let contents = Contents {
        fixed: vec![fixed(circle(0.2), at(-1.0, 1.0, 0.0))],
        ..pushables(vec![pushable(rectangle(0.4, 0.6), at(0.0, 0.0, 0.0), 1.0, 0.3)])
    };
    let mut world = furnished(4.0, 3.0, contents, vec![(pusher, at(-1.0, 0.0, 0.0))]);
    let look = |world: &World, direction: [f64; 2]| {
        let pose = world.state(0).pose;
        let ray = Ray {
            x_m: pose.x_m,
            y_m: pose.y_m,
            direction_x: direction[0],
            direction_y: direction[1],
        };
        world.scene_around(0).surroundings().distances_m(&[ray])[0]
    };
    assert!((look(&world, [1.0, 0.0]) - 0.8).abs() < 1e-12);
    assert!((look(&world, [0.0, 1.0]) - 0.8).abs() < 1e-12);
    assert!((look(&world, [0.0, -1.0]) - 1.5).abs() < 1e-12);
    for _ in 0..300 {
        step(&mut world, &[command]);
    }
    assert!(world.obstacle(0).pose.x_m > 0.1);
    assert!(
        (look(&world, [1.0, 0.0]) - RADIUS_M).abs() < 2e-3,
        "{}",
        look(&world, [1.0, 0.0])
    );
}

#[test]
fn a_thousand_robots_among_a_hundred_obstacles() {
    let kinds: Vec<_> = all().into_iter().map(robot).collect();
    let grid = |index: u64| {
        let (column, row) = ((index % 34) as f64, (index / 34) as f64);
        at(0.9 * (column - 16.5), 0.9 * (row - 16.5), 0.7 * index as f64)
    };
    let mut contents = Contents::default();
    let mut placed = Vec::new();
    for index in 0..1100 {
        let pose = Pose {
            yaw_rad: (0.7 * index as f64) % 6.0,
            ..grid(index)
        };
        match index % 22 {
            3 => contents.fixed.push(fixed(rectangle(0.3, 0.02), pose)),
            14 if index % 44 < 22 => contents.pushable.push(pushable(circle(0.2), pose, 1.0, 0.3)),
            14 => contents.pushable.push(pushable(rectangle(0.4, 0.2), pose, 3.0, 0.5)),
            _ => placed.push((kinds[(index % 6) as usize].clone(), pose)),
        }
    }
    assert_eq!(
        (placed.len(), contents.fixed.len() + contents.pushable.len()),
        (1000, 100)
    );
    let fixed_only = Contents {
        fixed: contents.fixed.clone(),
        ..Contents::default()
    };
    let commands: Vec<_> = placed.iter().map(|(robot, _)| forward(robot, 1.8)).collect();
    let mut world = furnished(32.0, 32.0, contents, placed).without_digest();
    let (mut touched, mut deepest, mut fastest) = (0, 0.0_f64, 0.0_f64);
    for _ in 0..240 {
        step(&mut world, &commands);
        touched += world.obstacle_contacts_this_tick().len();
        for index in 0..1000 {
            let state = world.state(index);
            let speed = velocity(&state);
            fastest = fastest.max(speed.0 * speed.0 + speed.1 * speed.1);
            if let Some((_, overlap_m)) = fixed_only.fixed_overlap_m(state.pose.x_m, state.pose.y_m, RADIUS_M) {
                deepest = deepest.max(overlap_m);
            }
        }
    }
    let moved = (0..50).filter(|index| world.obstacle(*index).pose != world.contents().pushable[*index].pose);
    println!(
        "{touched} contacts, {} moved, {deepest:.2e} m into fixed ones, {:.2} m/s",
        moved.clone().count(),
        fastest.sqrt()
    );
    assert!(touched > 1000 && moved.count() > 20, "{touched}");
    // Robots are 0.5 m wide and a pile pushes: no one passes, few millimetres deep.
    assert!(deepest < 5e-3 && world.smallest_wall_distance_m() > -5e-3, "{deepest}");
    assert!(fastest.sqrt() < 3.0, "{fastest}");
}

fn number() -> impl Strategy<Value = f64> {
    prop_oneof![
        Just(f64::NAN),
        Just(f64::INFINITY),
        Just(f64::NEG_INFINITY),
        Just(0.0),
        Just(-1.0),
        Just(f64::MAX),
        Just(f64::MIN_POSITIVE),
        0.02..0.4_f64,
        -1.5..1.5_f64,
    ]
}

fn shape() -> impl Strategy<Value = Shape> {
    prop_oneof![
        number().prop_map(|radius_m| Shape::Circle { radius_m }),
        (number(), number()).prop_map(|(length_m, width_m)| Shape::Rectangle { length_m, width_m }),
    ]
}

fn pose() -> impl Strategy<Value = Pose> {
    (number(), number(), number()).prop_map(|(x_m, y_m, yaw_rad)| Pose { x_m, y_m, yaw_rad })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn whatever_is_described_is_refused_or_can_be_stepped(
        fixed_ones in prop::collection::vec((shape(), pose()), 0..3),
        pushed in prop::collection::vec((shape(), pose(), number(), number()), 0..3),
        regions in prop::collection::vec((shape(), pose(), number()), 0..3),
        tilt in (number(), number()),
    ) {
        let contents = Contents {
            fixed: fixed_ones.into_iter().map(|(shape, pose)| fixed(shape, pose)).collect(),
            pushable: pushed.into_iter().map(|(shape, pose, mass, mu)| pushable(shape, pose, mass, mu)).collect(),
            regions: regions.into_iter().map(|(shape, pose, scale)| region(shape, pose, scale)).collect(),
            tilt_x_rad: tilt.0,
            tilt_y_rad: tilt.1,
            geofence: Vec::new(),
        };
        let possible = contents.check(&ARENA).is_empty();
        let driver = robot(diff4());
        let command = forward(&driver, 1.0);
        match World::furnished(ARENA, contents, vec![(driver, at(1.6, 1.1, 0.5), 0.25)]) {
            Ok(mut world) => {
                prop_assert!(possible);
                for _ in 0..24 {
                    prop_assert!(world.step(&[command]).is_ok());
                }
            }
            // Possible by itself: then the robot stands in the way.
            Err(WorldError::Contents(problem)) => prop_assert!(!possible || problem.message.contains("robot 0")),
            Err(other) => prop_assert!(false, "{}", other),
        }
    }
}
