//! Range sensors against closed forms: walls, circles, boxes, and what hides what.

mod support;

use core::f64::consts::{FRAC_PI_6, PI};

use proptest::prelude::{ProptestConfig, any, prop_assert, proptest};
use support::{omni4, robot};
use twin::free::FreeRobot;
use twin::pose::{Pose, wrapped_rad};
use twin::sensor::range::{RANGE_SENSORS, RangeMount};
use twin::sensor::surroundings::{Circle, OrientedBox};
use twin::sensor::{NoiseStreams, SensorSettings, SensorSuite, Surroundings};
use twin::world::Arena;

const OPEN_FLOOR: Surroundings<'static> = Surroundings {
    arena: None,
    circles: &[],
    boxes: &[],
};
const ARENA: Arena = Arena {
    width_m: 4.0,
    height_m: 3.0,
};
/// Distance of the sensors from the body origin.
const RING_M: f64 = 0.15;

fn pose(x_m: f64, y_m: f64, yaw_rad: f64) -> Pose {
    Pose { x_m, y_m, yaw_rad }
}

fn close(got: f64, want: f64, tolerance: f64) {
    assert!((got - want).abs() <= tolerance, "{got} against {want}");
}

fn ranges(at: Pose, surroundings: &Surroundings<'_>) -> [Option<f64>; RANGE_SENSORS] {
    let robot = robot(omni4());
    let mut settings = SensorSettings::of(&robot);
    if let Some(range) = &mut settings.range {
        range.mounts = RangeMount::ring(RING_M);
    }
    let mut suite = match SensorSuite::new(&robot, settings) {
        Ok(suite) => suite,
        Err(problem) => panic!("test sensors refused: {problem}"),
    };
    let state = FreeRobot::at_rest(&robot, at).state();
    let readings = suite.sample(&state, surroundings, 0, &mut NoiseStreams::new(1, 0));
    readings.range_m.unwrap_or_default()
}

#[test]
fn walls_are_seen_at_their_distance_at_every_angle() {
    let walls = Surroundings {
        arena: Some(ARENA),
        ..OPEN_FLOOR
    };
    for (x, y, yaw) in [(0.0, 0.0, 0.0), (0.5, 0.2, 0.3), (-1.2, 0.9, -2.5), (1.7, -1.2, 3.1)] {
        for (index, got) in ranges(pose(x, y, yaw), &walls).into_iter().enumerate() {
            let angle = yaw + (index as f64 - 3.0) * FRAC_PI_6;
            let (sin, cos) = libm::sincos(angle);
            let to_x = if cos >= 0.0 { (2.0 - x) / cos } else { (-2.0 - x) / cos };
            let to_y = if sin >= 0.0 { (1.5 - y) / sin } else { (-1.5 - y) / sin };
            let want = to_x.min(to_y) - RING_M;
            assert_eq!(got.is_some(), want <= 4.0, "{want}");
            close(got.unwrap_or(want), want, 1e-12);
        }
    }
}

#[test]
fn right_is_first_and_left_is_last() {
    let at_left = [Circle {
        x_m: 0.0,
        y_m: 1.0,
        radius_m: 0.2,
    }];
    let seen = Surroundings {
        circles: &at_left,
        ..OPEN_FLOOR
    };
    let ranges_m = ranges(Pose::default(), &seen);
    close(ranges_m[6].unwrap_or(f64::NAN), 1.0 - 0.2 - RING_M, 1e-15);
    assert_eq!(ranges_m[..6], [None; 6]);
    let turned = ranges(pose(0.0, 0.0, PI), &seen);
    close(turned[0].unwrap_or(f64::NAN), 1.0 - 0.2 - RING_M, 1e-15);
    assert_eq!(turned[1..], [None; 6]);
}

#[test]
fn a_tangent_circle_is_seen_where_it_touches_and_a_hair_farther_it_is_not() {
    for (radius_m, seen) in [(0.5, true), (0.5 - 1e-9, false), (0.5 + 1e-9, true)] {
        let circle = [Circle {
            x_m: 1.3,
            y_m: 0.5,
            radius_m,
        }];
        let surroundings = Surroundings {
            circles: &circle,
            ..OPEN_FLOOR
        };
        let forward = ranges(Pose::default(), &surroundings)[3];
        assert_eq!(forward.is_some(), seen, "{radius_m}");
        if let Some(forward) = forward {
            close(forward, 1.3 - RING_M, 1e-4);
        }
    }
}

#[test]
fn the_nearest_thing_hides_the_others() {
    let circles = [
        Circle {
            x_m: 1.5,
            y_m: 0.0,
            radius_m: 0.1,
        },
        Circle {
            x_m: 1.0,
            y_m: 0.0,
            radius_m: 0.1,
        },
    ];
    let boxes = [OrientedBox {
        pose: pose(0.7, 0.0, 0.0),
        length_m: 0.2,
        width_m: 2.0,
    }];
    let mut seen = Surroundings {
        arena: Some(ARENA),
        ..OPEN_FLOOR
    };
    close(ranges(Pose::default(), &seen)[3].unwrap_or(0.0), 2.0 - RING_M, 1e-15);
    seen.circles = &circles;
    close(ranges(Pose::default(), &seen)[3].unwrap_or(0.0), 0.9 - RING_M, 1e-15);
    seen.boxes = &boxes;
    close(ranges(Pose::default(), &seen)[3].unwrap_or(0.0), 0.6 - RING_M, 1e-15);
}

#[test]
fn beyond_the_range_nothing_is_seen_and_below_it_the_minimum_is_read() {
    let at = |x_m: f64| {
        let circles = [Circle {
            x_m,
            y_m: 0.0,
            radius_m: 0.1,
        }];
        let seen = Surroundings {
            circles: &circles,
            ..OPEN_FLOOR
        };
        ranges(Pose::default(), &seen)[3]
    };
    assert_eq!(at(4.26), None);
    assert!(at(4.24).is_some());
    assert_eq!(at(0.26), Some(0.02));
    assert_eq!(at(0.15), Some(0.02), "a sensor inside a body");
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, failure_persistence: None, ..ProptestConfig::default() })]
    #[test]
    fn ranges_know_no_compass(turn in -3.0..3.0_f64, x in -1.0..1.0_f64, y in -1.0..1.0_f64, seed in any::<u16>()) {
        let (sin, cos) = libm::sincos(turn);
        let moved = |at: Pose| pose(
            x + at.x_m * cos - at.y_m * sin,
            y + at.x_m * sin + at.y_m * cos,
            wrapped_rad(at.yaw_rad + turn),
        );
        let yaw = f64::from(seed) * 1e-4;
        let box_pose = pose(1.1, 0.3, yaw);
        let circle_pose = pose(-0.4, -1.2, 0.0);
        let scene = |robot: Pose, circle: Pose, oriented: Pose| {
            let circles = [Circle { x_m: circle.x_m, y_m: circle.y_m, radius_m: 0.35 }];
            let boxes = [OrientedBox { pose: oriented, length_m: 0.8, width_m: 0.5 }];
            ranges(robot, &Surroundings { arena: None, circles: &circles, boxes: &boxes })
        };
        let near = |yaw_offset: f64| scene(pose(0.1, 0.0, -0.5 + yaw_offset), circle_pose, box_pose);
        let (here, right, left) = (near(0.0), near(-1e-7), near(1e-7));
        let there = scene(moved(pose(0.1, 0.0, -0.5)), moved(circle_pose), moved(box_pose));
        let or_far = |range_m: Option<f64>| range_m.unwrap_or(100.0);
        for index in 0..RANGE_SENSORS {
            // A ray that grazes an edge may fall on either side of it.
            if (or_far(left[index]) - or_far(right[index])).abs() < 1e-4 {
                let (a, b) = (or_far(here[index]), or_far(there[index]));
                prop_assert!((a - b).abs() < 1e-9, "sensor {index}: {a} {b}");
            }
        }
    }
}
