//! The two cameras of the reference laboratory see all of it.

mod rig;

use emulator::camera::optics::Optics;

/// What misalignment may take from the rim of a picture.
const RIM_PX: f64 = 3.0;

fn cameras() -> [Optics; 2] {
    [0, 1].map(|index| Optics::from(&rig::calibration(index)))
}

fn sees(optics: &Optics, world_m: [f64; 3]) -> bool {
    optics.project(world_m).is_some_and(|[u, v]| {
        let (right, bottom) = (f64::from(optics.width_px) - 1.0, f64::from(optics.height_px) - 1.0);
        u >= RIM_PX && v >= RIM_PX && u <= right - RIM_PX && v <= bottom - RIM_PX
    })
}

#[test]
fn every_floor_point_is_seen_by_one_camera_and_the_overlap_by_both() {
    let cameras = cameras();
    for (i, j) in (-80..=80).flat_map(|i| (-60..=60).map(move |j| (i, j))) {
        let point = [f64::from(i) * 0.025, f64::from(j) * 0.025, 0.0];
        let seen = cameras.map(|camera| sees(&camera, point));
        assert!(seen[0] || seen[1], "{point:?} is not seen");
        assert!(
            !(-8..=8).contains(&i) || (seen[0] && seen[1]),
            "{point:?} is not seen by both"
        );
        assert!(
            sees(&cameras[usize::from(i > 0)], point),
            "{point:?} is not seen by the camera of its half"
        );
    }
}

/// Tag with its margin in any direction, 0.15 m over the floor, on a robot that can stand there.
#[test]
fn every_tag_is_seen_whole_by_one_camera() {
    let (cameras, reach_m, robot_m) = (cameras(), 0.1 * std::f64::consts::SQRT_2, 0.2);
    let end = |half_m: f64| ((half_m - robot_m) / 0.02f64).floor() as i32;
    for (i, j) in (-end(2.0)..=end(2.0)).flat_map(|i| (-end(1.5)..=end(1.5)).map(move |j| (i, j))) {
        let [x, y] = [f64::from(i) * 0.02, f64::from(j) * 0.02];
        let whole = cameras.iter().any(|camera| {
            (0..24).all(|step| {
                let (sin, cos) = (f64::from(step) * std::f64::consts::TAU / 24.0).sin_cos();
                sees(camera, [x + reach_m * cos, y + reach_m * sin, 0.15])
            })
        });
        assert!(whole, "a tag at {x} {y} is not seen whole");
    }
}
