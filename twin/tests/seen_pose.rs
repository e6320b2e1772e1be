//! Where a tracker sees a robot, and back.

use twin::effect::Effect;
use twin::golden::reference_robot;
use twin::pose::Pose;
use twin::robot::Robot;

#[test]
fn the_place_that_a_tracker_sees_can_be_undone() {
    let effects = [
        Effect::new("marker_offset", &[("x", 0.03), ("y", -0.02), ("yaw", 0.1)]),
        Effect::new("tag_height", &[("z", 0.2)]),
        Effect::new("lens_distortion", &[("k1", 0.01), ("x", 0.2), ("y", 0.1)]),
        Effect::new("pose_scale", &[("relative", -0.034)]),
    ];
    let robot = Robot::with_effects(reference_robot("diff2"), &effects).unwrap();
    let mut beside_the_seam = 0;
    for k in 0..50 {
        let k = f64::from(k);
        let pose = Pose {
            x_m: 2.0 * libm::sin(1.7 * k),
            y_m: 1.5 * libm::cos(2.3 * k),
            yaw_rad: 3.0 * libm::sin(0.9 * k),
        };
        // Tags higher than calibrated are seen apart by each camera: between both fields places are seen twice or not at all.
        if pose.x_m.abs() < 0.4 {
            continue;
        }
        beside_the_seam += 1;
        let seen = robot.seen_pose(pose);
        assert!(seen.distance_m(&pose) > 1e-4, "{pose:?}");
        let back = robot.pose_seen_at(seen);
        assert!(back.distance_m(&pose) < 1e-6, "{pose:?} comes back as {back:?}");
        assert!((back.yaw_rad - pose.yaw_rad).abs() < 1e-9);
    }
    assert!(beside_the_seam > 30, "{beside_the_seam}");
    let plain = Robot::new(reference_robot("diff2")).unwrap();
    let pose = Pose {
        x_m: 0.1,
        y_m: 0.7,
        yaw_rad: 0.3,
    };
    assert_eq!((plain.seen_pose(pose), plain.pose_seen_at(pose)), (pose, pose));
}

/// A tag 20 cm above the floor is seen 8.7 cm aside between two cameras 2 m apart and 2.5 m up.
#[test]
fn between_two_cameras_a_place_is_seen_by_either() {
    let tag = [Effect::new("tag_height", &[("z", 0.2)])];
    let robot = Robot::with_effects(reference_robot("diff2"), &tag).unwrap();
    let at = |x_m: f64| Pose {
        x_m,
        y_m: 0.3,
        yaw_rad: 0.2,
    };
    for x_m in [-0.06, -0.01, 0.01, 0.06] {
        let seen = robot.seen_pose(at(x_m));
        let poses = robot.poses_seen_at(seen, 0.0);
        assert_eq!(poses.len(), 2, "{x_m}: {poses:?}");
        assert!(poses.iter().any(|pose| pose.distance_m(&at(x_m)) < 1e-6), "{poses:?}");
        for pose in &poses {
            assert!(robot.seen_pose(*pose).distance_m(&seen) < 1e-6);
        }
        assert!(poses[0].x_m * seen.x_m > 0.0, "the camera of that side first");
    }
    for x_m in [-1.4, -0.2, 0.2, 1.4] {
        let poses = robot.poses_seen_at(robot.seen_pose(at(x_m)), 0.0);
        assert!(poses.len() == 1 && poses[0].distance_m(&at(x_m)) < 1e-6, "{poses:?}");
    }
    // Calibrated too low, nothing is seen between them.
    let low = [Effect::new("tag_height", &[("z", -0.2)])];
    let low = Robot::with_effects(reference_robot("diff2"), &low).unwrap();
    assert_eq!(low.poses_seen_at(at(0.01), 0.0).len(), 1);
    assert_eq!(low.poses_seen_at(at(0.01), 0.1).len(), 2, "told to look so far beyond");
    let plain = Robot::new(reference_robot("diff2")).unwrap();
    assert_eq!(plain.poses_seen_at(at(0.01), 0.1), [at(0.01)]);
}
