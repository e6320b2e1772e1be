//! Obstacles, floor regions and tilt of an arena in the plant.

mod bench;

use api::arena::{Contents, FixedObstacle, FloorRegion, PushableObstacle, Shape};
use api::experiment::Pose;
use api::lab::LabDescription;
use bench::{Bench, forward, reference, wheels};
use emulator::Laboratory;
use emulator::hidden::Hidden;

fn at(x_m: f64, y_m: f64, yaw_rad: f64) -> Pose {
    Pose { x_m, y_m, yaw_rad }
}

fn with(contents: Contents) -> LabDescription {
    let mut description = reference();
    for robot in &mut description.robots {
        robot.description.noise = None;
    }
    description.arena.contents = Some(contents);
    description
}

fn pillar(shape: Shape, pose: Pose) -> Contents {
    Contents {
        fixed: vec![FixedObstacle {
            name: "pillar".to_owned(),
            shape,
            pose,
        }],
        ..Contents::default()
    }
}

#[test]
fn a_robot_stops_at_a_fixed_obstacle_and_slides_along_a_slanted_one() {
    let post = with(pillar(Shape::Circle { radius_m: 0.12 }, at(0.5, 0.0, 0.0)));
    let mut bench = Bench::new(&post, Hidden::neutral(), 1);
    bench.place(&[(1, -0.5, 0.0, 0.0)]);
    let set_points = forward(&post.robots[0].description, 0.4);
    bench.drive_for(3.0, |_| wheels(set_points));
    // Bumper radius 0.25 against a post of 0.12 at 0.5; pressed in by a few millimetres at most.
    let gap_m = (bench.pose(0).x_m - 0.5).hypot(bench.pose(0).y_m) - 0.37;
    println!("post: gap {gap_m} m");
    assert!((-5e-3..0.02).contains(&gap_m), "{:?}", bench.pose(0));
    let wall = with(pillar(
        Shape::Rectangle {
            length_m: 2.0,
            width_m: 0.1,
        },
        at(0.6, 0.3, 2.2),
    ));
    let mut bench = Bench::new(&wall, Hidden::neutral(), 1);
    bench.place(&[(1, -0.6, 0.0, 0.0)]);
    bench.drive_for(4.0, |_| wheels(set_points));
    let pose = bench.pose(0);
    let (sin, cos) = 2.2f64.sin_cos();
    let across_m = cos * (pose.y_m - 0.3) - sin * (pose.x_m - 0.6);
    println!("slanted wall: {across_m} m from its middle line, {pose:?}");
    assert!(across_m.abs() > 0.3 - 5e-3, "went through: {pose:?}");
    assert!(pose.y_m < -0.1, "slid along: {pose:?}");
}

#[test]
fn a_region_changes_the_grip_of_the_wheels_inside_it_and_the_last_one_holds() {
    let slippery = |regions: Vec<FloorRegion>| {
        with(Contents {
            regions,
            ..Contents::default()
        })
    };
    let region = |half_m: f64, scale: f64| FloorRegion {
        shape: Shape::Rectangle {
            length_m: 2.0 * half_m,
            width_m: 2.0 * half_m,
        },
        pose: at(0.0, 0.0, 0.0),
        friction_scale: scale,
    };
    // Full speed at once: the way in the first half second is mu g t^2 / 2 at the friction limit.
    let way_m = |description: &LabDescription| {
        let mut bench = Bench::new(description, Hidden::neutral(), 1);
        bench.place(&[(1, -0.4, 0.0, 0.0)]);
        bench.drive_for(0.2, |_| wheels([0.0; 4]));
        let start_m = bench.pose(0).x_m;
        let set_points = forward(&description.robots[0].description, 2.0);
        bench.drive_for(0.5, |_| wheels(set_points));
        bench.pose(0).x_m - start_m
    };
    let (rough_m, slippery_m) = (way_m(&slippery(vec![])), way_m(&slippery(vec![region(1.9, 0.1)])));
    let hole_m = way_m(&slippery(vec![region(1.9, 0.1), region(1.8, 1.0)]));
    // mu = 0.8 x 0.1; an omni robot at 45 degrees pushes with mu m g / sqrt 2 forward. The creep of the contact takes some.
    let by_hand_m = 0.5 * 0.08 * 9.81 / 2f64.sqrt() * 0.25;
    println!("rough {rough_m} m, slippery {slippery_m} m of {by_hand_m} m, hole {hole_m} m");
    assert!(slippery_m < 1.05 * by_hand_m && slippery_m > 0.7 * by_hand_m);
    assert!(rough_m > 2.0 * slippery_m && (hole_m - rough_m).abs() < 1e-9);
}

#[test]
fn a_tilt_pulls_towards_positive_x() {
    let tilted = with(Contents {
        tilt_x_rad: 0.05,
        ..Contents::default()
    });
    let mut bench = Bench::new(&tilted, Hidden::neutral(), 1);
    bench.place(&[(5, -1.0, 0.0, 0.0)]);
    // No frames: the power stage is on at zero set-points, so the wheels hold; without it the robot rolls at g tilt m / (m + 2 J / R^2).
    bench
        .laboratory
        .set_fault(emulator::faults::FaultRequest {
            number: 5,
            kind: emulator::faults::FaultKind::Dead,
        })
        .unwrap();
    bench.drive_for(2.0, |_| None);
    let rolled_m = bench.pose(4).x_m + 1.0;
    let most_m = 0.5 * 9.81 * 0.05 * 4.0;
    println!("rolled {rolled_m} m, at most {most_m} m without friction");
    assert!(rolled_m > 0.1 && rolled_m < most_m, "{rolled_m}");
}

#[test]
fn what_the_plant_cannot_have_is_refused() {
    let crate_on_floor = PushableObstacle {
        name: "crate".to_owned(),
        shape: Shape::Circle { radius_m: 0.1 },
        pose: at(0.0, 0.0, 0.0),
        mass_kg: 1.0,
        floor_friction: 0.3,
    };
    let pushable = with(Contents {
        pushable: vec![crate_on_floor],
        ..Contents::default()
    });
    let refused = Laboratory::new(&pushable, Hidden::neutral(), &bench::keys(), 1).unwrap_err();
    assert!(refused.to_string().contains("crate"), "{refused}");
    let flat = with(pillar(Shape::Circle { radius_m: 0.0 }, at(0.0, 0.0, 0.0)));
    let refused = Laboratory::new(&flat, Hidden::neutral(), &bench::keys(), 1).unwrap_err();
    assert!(refused.to_string().contains("fixed[0]"), "{refused}");
    let post = with(pillar(Shape::Circle { radius_m: 0.12 }, at(0.5, 0.0, 0.0)));
    let mut laboratory = Laboratory::new(&post, Hidden::neutral(), &bench::keys(), 1).unwrap();
    let line = br#"{"place":[{"number":1,"x_m":0.2,"y_m":0,"yaw_rad":0}]}"#;
    let mut cameras =
        emulator::camera::CameraSet::start(&[], &emulator::camera::CameraSettings::default(), 60.0, 0).unwrap();
    let reply = String::from_utf8(emulator::hand::answer(line, &mut laboratory, &mut cameras)).unwrap();
    assert!(reply.contains("fixed obstacle"), "{reply}");
}
