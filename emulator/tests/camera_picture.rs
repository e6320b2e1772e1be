//! What a camera's picture shows, against closed forms.

mod rig;

use crc32fast::hash as crc32;
use emulator::camera::lens::Distortion;
use emulator::camera::misalignment::Misalignment;
use emulator::camera::optics::Optics;
use emulator::camera::tag::Tag;
use emulator::camera::tag_codes::CODES;
use emulator::camera::{Calibration, Camera, CameraSettings, RobotInView, RobotShape};
use emulator::plant::Pose;
use rig::{calibration, camera, dot, moments, moving, pose, robot};

/// A camera that is tilted, turned and has every distortion term.
fn crooked() -> Calibration {
    let (tilt_rad, turn_rad) = (0.12f64, 0.3f64);
    let ((s, c), (st, ct)) = (turn_rad.sin_cos(), tilt_rad.sin_cos());
    // columns of the tilt about x times [looking down, turned about the view]
    let down = [[c, s, 0.0], [s, -c, 0.0], [0.0, 0.0, -1.0]];
    let rotation = [
        down[0],
        [0, 1, 2].map(|i| ct * down[1][i] - st * down[2][i]),
        [0, 1, 2].map(|i| st * down[1][i] + ct * down[2][i]),
    ];
    Calibration {
        focal_px: [618.0, 623.5],
        centre_px: [322.1, 236.4],
        distortion: Distortion {
            k1: -0.27,
            k2: 0.08,
            k3: -0.01,
            p1: 0.0012,
            p2: -0.0008,
        },
        position_m: [0.2, -0.1, 2.7],
        rotation,
        ..calibration(0)
    }
}

/// The convention, written out here once more.
fn closed_form(c: &Calibration, world_m: [f64; 3]) -> [f64; 2] {
    let d = [0, 1, 2].map(|i| world_m[i] - c.position_m[i]);
    let [x, y, z] = c.rotation.map(|row| row[0] * d[0] + row[1] * d[1] + row[2] * d[2]);
    let (x, y, k) = (x / z, y / z, c.distortion);
    let r2 = x * x + y * y;
    let radial = 1.0 + k.k1 * r2 + k.k2 * r2 * r2 + k.k3 * r2 * r2 * r2;
    let x_d = x * radial + 2.0 * k.p1 * x * y + k.p2 * (r2 + 2.0 * x * x);
    let y_d = y * radial + k.p1 * (r2 + 2.0 * y * y) + 2.0 * k.p2 * x * y;
    [
        c.focal_px[0] * x_d + c.centre_px[0],
        c.focal_px[1] * y_d + c.centre_px[1],
    ]
}

#[test]
fn a_bright_dot_lies_where_the_closed_form_says() {
    let calibration = crooked();
    let mut camera = Camera::new(&calibration, 0, rig::plain()).expect("a camera");
    let mut worst = 0.0f64;
    for (index, height_m) in (0..49).flat_map(|index| [(index, 0.0), (index, 0.15), (index, 0.6)]) {
        let at = pose(
            0.2 + 0.28 * f64::from(index % 7 - 3),
            -0.4 + 0.23 * f64::from(index / 7 - 3),
            0.0,
        );
        let wanted = closed_form(&calibration, [at.x_m, at.y_m, height_m]);
        if !(10.0..629.0).contains(&wanted[0]) || !(10.0..469.0).contains(&wanted[1]) {
            continue;
        }
        let view = RobotInView {
            tag: None,
            shape: dot(0.009, height_m),
            poses: &[at],
        };
        let picture = camera.expose(0, &[view]).expect("a picture");
        let (_, mean, _) = moments(picture.pixels, 640);
        worst = worst.max((mean[0] - wanted[0]).hypot(mean[1] - wanted[1]));
    }
    println!("worst centroid error {worst:.4} px");
    assert!(worst <= 0.05, "{worst} px");
}

#[test]
fn a_dot_has_the_brightness_of_its_area() {
    let mut camera = camera(0, rig::plain());
    let at = pose(-0.9, 0.0, 0.0);
    let view = RobotInView {
        tag: None,
        shape: dot(0.05, 0.0),
        poses: &[at],
    };
    let (sum, _, _) = moments(camera.expose(0, &[view]).expect("a picture").pixels, 640);
    // straight below: a disc of 0.05 m * 620 px / 2.8 m; the lens shrinks it by 3 k1 r2 < 0.03 %
    let expected = 225.0 * std::f64::consts::PI * (0.05 * 620.0 / 2.8f64).powi(2);
    assert!((sum / expected - 1.0).abs() < 0.003, "{sum} {expected}");
}

/// The variance of a uniform stretch of length L is L^2 / 12; 16 instants of it have 255/256 of that.
#[test]
fn blur_is_as_long_as_speed_times_exposure() {
    for (yaw_rad, speed_m_per_s, exposure_us) in [(0.0, 4.0, 10_000), (1.1, 2.0, 8000), (-2.0, 6.0, 5000)] {
        let mut camera = camera(
            0,
            CameraSettings {
                exposure_us,
                white_dn_per_ms: 225_000.0 / f64::from(exposure_us),
                ..rig::plain()
            },
        );
        let middle = pose(-0.7, 0.3, yaw_rad);
        let mut variances = Vec::new();
        for speed in [0.0, speed_m_per_s] {
            let poses = moving(middle, speed, 0.0, exposure_us, 16);
            let view = RobotInView {
                tag: None,
                shape: dot(0.02, 0.15),
                poses: &poses,
            };
            let (_, _, [uu, uv, vv]) = moments(camera.expose(0, &[view]).expect("a picture").pixels, 640);
            // u lies along world y, v along world x
            let (along_u, along_v) = yaw_rad.sin_cos();
            variances.push(along_u * along_u * uu + 2.0 * along_u * along_v * uv + along_v * along_v * vv);
        }
        let length_px = (12.0 * (variances[1] - variances[0]) * 256.0 / 255.0).sqrt();
        let end = |side: f64| {
            let along_m = side * 0.5 * speed_m_per_s * f64::from(exposure_us) * 1e-6;
            let at = [
                middle.x_m + along_m * yaw_rad.cos(),
                middle.y_m + along_m * yaw_rad.sin(),
                0.15,
            ];
            Optics::from(&calibration(0)).project(at).expect("in front")
        };
        let (from, to) = (end(-1.0), end(1.0));
        let expected_px = (to[0] - from[0]).hypot(to[1] - from[1]);
        println!("blur {length_px:.3} px, v * exposure {expected_px:.3} px");
        assert!(
            (length_px / expected_px - 1.0).abs() < 0.03,
            "{length_px} {expected_px}"
        );
    }
}

/// Column and row of the family's bits within the border's eight by eight cells, most significant first (`tag36h11.c`).
const BIT_X: [usize; 36] = [
    1, 2, 3, 4, 5, 2, 3, 4, 3, 6, 6, 6, 6, 6, 5, 5, 5, 4, 6, 5, 4, 3, 2, 5, 4, 3, 4, 1, 1, 1, 1, 1, 2, 2, 2, 3,
];
const BIT_Y: [usize; 36] = [
    1, 1, 1, 1, 1, 2, 2, 2, 3, 1, 2, 3, 4, 5, 2, 3, 4, 3, 6, 6, 6, 6, 6, 5, 5, 5, 4, 6, 5, 4, 3, 2, 5, 4, 3, 4,
];

/// Reads the tag of a robot whose pose is known: samples each cell's centre.
fn decode(optics: &Optics, pixels: &[u8], at: Pose, height_m: f64) -> Option<usize> {
    let cell = |column: f64, row: f64| {
        // the tag's x is forward, its y to the robot's right; 0.02 m cells, eight within the border
        let (forward, right) = ((column + 0.5 - 4.0) * 0.02, (row + 0.5 - 4.0) * 0.02);
        let (sin, cos) = at.yaw_rad.sin_cos();
        let world_m = [
            at.x_m + cos * forward + sin * right,
            at.y_m + sin * forward - cos * right,
            height_m,
        ];
        let [u, v] = optics.project(world_m)?;
        let value = |du: usize, dv: usize| {
            let index = (v.floor() as usize + dv) * usize::from(optics.width_px) + u.floor() as usize + du;
            pixels.get(index).map(|value| f64::from(*value))
        };
        let (tu, tv) = (u - u.floor(), v - v.floor());
        let top = value(0, 0)? * (1.0 - tu) + value(1, 0)? * tu;
        let bottom = value(0, 1)? * (1.0 - tu) + value(1, 1)? * tu;
        Some(top * (1.0 - tv) + bottom * tv)
    };
    let (mut black, mut white) = (0.0, 0.0);
    for i in 0..8 {
        black += (cell(f64::from(i), 0.0)? + cell(f64::from(i), 7.0)?) / 16.0;
        white += (cell(f64::from(i), -1.0)? + cell(f64::from(i), 8.0)?) / 16.0;
    }
    let mut code = 0u64;
    for (x, y) in BIT_X.iter().zip(BIT_Y) {
        code = code << 1 | u64::from(cell(*x as f64, y as f64)? > (black + white) / 2.0);
    }
    (white > black + 40.0)
        .then(|| CODES.iter().position(|known| *known == code))
        .flatten()
}

#[test]
fn tags_are_read_in_all_quadrants_places_and_ids() {
    let settings = CameraSettings {
        misalignment: Misalignment::default(),
        ..CameraSettings::default()
    };
    let mut camera = camera(0, settings);
    let optics = *camera.true_optics();
    let mut read = 0;
    for (step, id) in (0..587).step_by(23).enumerate() {
        let poses: Vec<Vec<Pose>> = (0..8)
            .map(|place| {
                let (column, row) = (f64::from(place % 2), f64::from(place / 2));
                let yaw_rad = -3.1 + 0.79 * f64::from(place) + 0.05 * step as f64;
                moving(pose(-1.75 + 1.5 * column, -1.2 + 0.8 * row, yaw_rad), 0.5, 1.0, 3000, 4)
            })
            .collect();
        let views: Vec<RobotInView<'_>> = poses.iter().map(|poses| robot(id, poses)).collect();
        let pixels = camera.expose(0, &views).expect("a picture").pixels.to_vec();
        for poses in &poses {
            let middle = pose(
                (poses[1].x_m + poses[2].x_m) / 2.0,
                (poses[1].y_m + poses[2].y_m) / 2.0,
                (poses[1].yaw_rad + poses[2].yaw_rad) / 2.0,
            );
            assert_eq!(
                decode(&optics, &pixels, middle, 0.15),
                Some(usize::from(id)),
                "{middle:?}"
            );
            read += 1;
        }
    }
    assert_eq!(read, 26 * 8);
}

#[test]
fn only_what_changed_is_drawn_anew_and_nothing_is_left_behind() {
    let scene = rig::twelve(3000);
    let views: Vec<RobotInView<'_>> = scene
        .iter()
        .enumerate()
        .map(|(id, poses)| robot(id as u16, poses))
        .collect();
    let (mut one, mut other) = (
        camera(0, CameraSettings::default()),
        camera(0, CameraSettings::default()),
    );
    let elsewhere = [pose(-1.0, 0.1, 0.4)];
    one.expose(0, &[robot(40, &elsewhere), robot(41, &elsewhere)]);
    other.expose(0, &[]);
    assert_eq!(
        one.expose(1, &views).expect("a picture").pixels,
        other.expose(1, &views).expect("a picture").pixels
    );
}

#[test]
fn pictures_repeat_with_their_seed() {
    let scene = rig::twelve(3000);
    let views: Vec<RobotInView<'_>> = scene
        .iter()
        .enumerate()
        .map(|(id, poses)| robot(id as u16, poses))
        .collect();
    let shot = |seed: u64, index: u16| {
        let settings = CameraSettings {
            seed,
            ..CameraSettings::default()
        };
        let mut camera = Camera::new(&calibration(0), index, settings).expect("a camera");
        camera.expose(0, &views).expect("a picture").pixels.to_vec()
    };
    assert_eq!(shot(1, 0), shot(1, 0));
    assert_ne!(shot(1, 0), shot(2, 0));
    assert_ne!(shot(1, 0), shot(1, 1));
}

#[test]
fn frames_of_the_reference_scene_have_their_digests() {
    let scene = rig::twelve(3000);
    let views: Vec<RobotInView<'_>> = scene
        .iter()
        .enumerate()
        .map(|(id, poses)| robot(id as u16, poses))
        .collect();
    let mut camera = camera(0, CameraSettings::default());
    let digests: Vec<String> = (0..3)
        .map(|frame| format!("{:08X}", crc32(camera.expose(frame, &views).expect("a picture").pixels)))
        .collect();
    assert_eq!(digests, ["ACB02126", "AA0F3E77", "71244E93"]);
}

#[test]
fn robots_out_of_view_or_impossible_are_not_drawn() {
    let mut camera = camera(0, rig::plain());
    let tall = RobotShape {
        tag_height_m: 2.8,
        ..RobotShape::default()
    };
    let (far, odd) = ([pose(50.0, -80.0, 0.0)], [pose(f64::NAN, 0.0, 0.0)]);
    let here = [pose(-0.9, 0.0, 0.0)];
    let views = [
        robot(1, &far),
        robot(2, &odd),
        robot(3, &[]),
        RobotInView {
            tag: Tag::new(4),
            shape: tall,
            poses: &here,
        },
    ];
    assert!(
        camera
            .expose(0, &views)
            .expect("a picture")
            .pixels
            .iter()
            .all(|value| *value == 0)
    );
    // half out of the picture is drawn in part
    let edge = [pose(-0.9, 1.55, 0.0)];
    assert!(
        camera
            .expose(0, &[robot(1, &edge)])
            .expect("a picture")
            .pixels
            .iter()
            .any(|value| *value > 100)
    );
}

#[test]
fn both_cameras_write_a_picture() {
    let scene = rig::twelve(3000);
    let mut views: Vec<RobotInView<'_>> = scene
        .iter()
        .enumerate()
        .map(|(id, poses)| robot(id as u16 + 1, poses))
        .collect();
    let (fast, slow) = (moving(pose(0.0, 0.4, 0.8), 2.5, 0.0, 3000, 8), [pose(1.2, -0.5, 2.0)]);
    views.push(robot(20, &fast));
    views.push(robot(21, &slow));
    for index in 0..2 {
        let mut camera = camera(index, CameraSettings::default());
        let picture = camera.expose(0, &views).expect("a picture");
        let file = rig::pictures().join(format!("camera-{index}.png"));
        std::fs::write(&file, rig::png(640, 480, picture.pixels)).expect("a file");
        let mean = picture.pixels.iter().map(|value| f64::from(*value)).sum::<f64>() / 307_200.0;
        assert!((40.0..140.0).contains(&mean), "{}: mean {mean}", file.display());
    }
}
