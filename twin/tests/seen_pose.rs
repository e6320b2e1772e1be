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
