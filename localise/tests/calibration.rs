//! Calibration from pictures of a board: what comes back, how exactly, and what is refused.

mod support;

use localise::{
    Board, BoardTag, BoardView, CalibrationSettings, CameraDocument, Detector, DetectorSettings, Frame, Lens,
    TagDetection, calibrate,
};
use support::{Place, Plane, Random, Renderer, Style, Truth, camera_over_half};

/// 5 x 4 tags of 0.2 m, 0.3 m apart, around the origin of the board.
fn board() -> Board {
    let tags = (0..20).map(|index| BoardTag {
        id: index,
        x_m: 0.3 * (f64::from(index % 5) - 2.0),
        y_m: 0.3 * (f64::from(index / 5) - 1.5),
        yaw_rad: 0.0,
        edge_m: 0.2,
    });
    Board {
        tags: tags.collect(),
        z_m: 0.0,
    }
}

/// Board on the floor in front of the camera, shifted in the camera frame and tilted around its own middle.
fn plane(tilt: [f64; 2], shift: [f64; 3]) -> Plane {
    let ((sa, ca), (sb, cb)) = (tilt[0].sin_cos(), tilt[1].sin_cos());
    // Facing the camera (x right, y up, z to the camera), turned about x, then y.
    let facing = [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]];
    let about_x = [[1.0, 0.0, 0.0], [0.0, ca, -sa], [0.0, sa, ca]];
    let about_y = [[cb, 0.0, sb], [0.0, 1.0, 0.0], [-sb, 0.0, cb]];
    Plane {
        rotation: times(times(facing, about_y), about_x),
        shift,
    }
}

fn times(a: [[f64; 3]; 3], b: [[f64; 3]; 3]) -> [[f64; 3]; 3] {
    [0, 1, 2].map(|i| [0, 1, 2].map(|j| (0..3).map(|k| a[i][k] * b[k][j]).sum()))
}

/// Planes of the board for the views: the floor first, then tilted near the middle and the borders.
fn planes(truth: &Truth) -> Vec<Plane> {
    let mut out = vec![truth.floor(0.0)];
    let tilts = [
        [0.5, 0.0],
        [-0.5, 0.2],
        [0.1, 0.55],
        [0.0, -0.5],
        [0.4, 0.4],
        [-0.4, -0.4],
        [0.35, -0.4],
        [-0.3, 0.45],
    ];
    let shifts = [
        [0.0, 0.0],
        [-0.5, -0.3],
        [0.5, 0.3],
        [0.5, -0.3],
        [-0.5, 0.3],
        [0.0, 0.4],
        [0.0, -0.4],
        [0.6, 0.0],
    ];
    for (tilt, [x, y]) in tilts.into_iter().zip(shifts) {
        out.push(plane(tilt, [x, y, 1.9]));
    }
    out
}

fn settings() -> CalibrationSettings {
    CalibrationSettings::default()
}

/// Corners without pictures: projected, with noise.
fn ideal_views(truth: &Truth, sigma_px: f64, random: &mut Random) -> Vec<BoardView> {
    let mut floor = board();
    for tag in &mut floor.tags {
        tag.x_m -= 0.9;
    }
    let mut out = Vec::new();
    for (index, plane) in planes(truth).into_iter().enumerate() {
        let board = if index == 0 { floor.clone() } else { board() };
        let detections = board.tags.iter().filter_map(|tag| {
            let mut corners_px = [[0.0; 2]; 4];
            for (corner, [x, y]) in corners_px
                .iter_mut()
                .zip([[-0.1, -0.1], [0.1, -0.1], [0.1, 0.1], [-0.1, 0.1]])
            {
                let at = truth.pixel(plane.camera_from_plane([tag.x_m + x, tag.y_m + y, 0.0]))?;
                if at[0] < 2.0 || at[1] < 2.0 || at[0] > 637.0 || at[1] > 477.0 {
                    return None;
                }
                *corner = at.map(|value| value + sigma_px * random.normal());
            }
            Some(TagDetection {
                id: tag.id,
                hamming: 0,
                margin: 1.0,
                contrast: 200.0,
                corners_px,
                corners: corners_px,
                edge_rms_px: 0.0,
            })
        });
        let detections = detections.collect();
        out.push(BoardView { board, detections });
    }
    out
}

/// Largest distance between where two cameras put the same pixel at the tags' height, over the camera's half of the floor.
fn floor_error_m(truth: &Truth, document: &CameraDocument) -> f64 {
    let camera = document.check().expect("a camera");
    let exact = truth.camera();
    let mut worst: f64 = 0.0;
    for step in 0..400 {
        let pixel = [f64::from(step % 20) * 32.0 + 15.0, f64::from(step / 20) * 23.0 + 20.0];
        let place = |camera: &localise::Camera| camera.on_plane(camera.lens().undistort(pixel)?, 0.1);
        let (a, b) = (place(&camera).expect("floor"), place(&exact).expect("floor"));
        if (-1.9..0.1).contains(&b[0]) && b[1].abs() < 1.4 {
            worst = worst.max((a[0] - b[0]).hypot(a[1] - b[1]));
        }
    }
    worst
}

#[test]
fn noisy_corners_give_the_camera_back_within_the_stated_deviations() {
    let truth = camera_over_half(false);
    let views = ideal_views(&truth, 0.1, &mut Random(4));
    let fit = calibrate(&views, &settings()).expect("good views");
    let d = &fit.document;
    println!("{fit:#?}, worst on the floor {:.2} mm", 1e3 * floor_error_m(&truth, d));
    // The corners' noise and nothing else: 0.1 px per coordinate is 0.141 px per corner.
    assert!((d.rms_px - 0.141).abs() < 0.02, "{}", d.rms_px);
    for axis in 0..2 {
        assert!((d.focal_px[axis] - truth.focal[axis]).abs() < 4.0 * fit.deviation.focal_px[axis]);
        assert!((d.centre_px[axis] - truth.centre[axis]).abs() < 4.0 * fit.deviation.centre_px[axis]);
    }
    for axis in 0..3 {
        assert!((d.position_m[axis] - truth.position[axis]).abs() < 4.0 * fit.deviation.position_m[axis]);
    }
    assert!((d.distortion.k1 - truth.lens[0]).abs() < 4.0 * fit.deviation.k1);
    assert!((d.distortion.k2 - truth.lens[1]).abs() < 4.0 * fit.deviation.k2);
    assert!(fit.deviation.focal_px[0] < 1.0 && fit.deviation.position_m[2] < 0.005);
    assert!(floor_error_m(&truth, d) < 0.002);
}

#[test]
fn exact_corners_give_the_exact_camera() {
    let truth = camera_over_half(false);
    let views = ideal_views(&truth, 0.0, &mut Random(4));
    let fit = calibrate(&views, &settings()).expect("good views");
    assert!(fit.document.rms_px < 1e-6 && floor_error_m(&truth, &fit.document) < 1e-6);
}

#[test]
fn rendered_boards_are_calibrated_to_a_millimetre() {
    let truth = camera_over_half(false);
    let mut renderer = Renderer::new(truth.clone());
    let mut detector = Detector::new(DetectorSettings::default());
    let mut random = Random(9);
    let mut pictures = Vec::new();
    let style = Style {
        body_m: 0.0,
        floor: 215.0,
        exposure_s: 0.0,
        ..Style::default()
    };
    for (index, plane) in planes(&truth).into_iter().enumerate() {
        let mut board = board();
        for tag in board.tags.iter_mut().filter(|_| index == 0) {
            tag.x_m -= 0.9;
        }
        let places = board.tags.iter().map(|tag| Place {
            edge_m: tag.edge_m,
            ..Place::tag(tag.id, tag.x_m, tag.y_m, tag.yaw_rad)
        });
        renderer.render(&plane, &places.collect::<Vec<_>>(), &style, &mut random);
        pictures.push((board, renderer.pixels.clone()));
    }
    // The lens is unknown at first: edges are bent. With the first result they are straight, so a second round is exact.
    let mut lens = Lens::ideal(640, 480);
    let mut errors_m = Vec::new();
    for _ in 0..2 {
        let views: Vec<BoardView> = pictures
            .iter()
            .map(|(board, pixels)| BoardView {
                board: board.clone(),
                detections: detector
                    .search(&Frame::new(640, 480, pixels).expect("size"), &lens)
                    .tags,
            })
            .collect();
        let fit = calibrate(&views, &settings()).expect("good views");
        lens = *fit.document.check().expect("a camera").lens();
        errors_m.push(floor_error_m(&truth, &fit.document));
        println!(
            "rms {:.3} px, {} corners, worst {:.2} mm",
            fit.document.rms_px,
            fit.corners,
            1e3 * errors_m[errors_m.len() - 1]
        );
    }
    assert!(errors_m[1] < 0.0015, "{errors_m:?}");
}

#[test]
fn a_misplaced_tag_is_left_out() {
    let truth = camera_over_half(false);
    let mut views = ideal_views(&truth, 0.05, &mut Random(4));
    for corner in &mut views[3].detections[2].corners_px {
        corner[0] += 6.0;
    }
    let fit = calibrate(&views, &settings()).expect("one bad tag");
    assert_eq!(fit.left_out, 4);
    assert!(fit.document.rms_px < 0.1);
}

#[test]
fn views_that_determine_nothing_are_refused_with_the_reason() {
    let truth = camera_over_half(false);
    let good = ideal_views(&truth, 0.05, &mut Random(4));
    let refused = |views: &[BoardView]| calibrate(views, &settings()).expect_err("refused");
    assert_eq!(refused(&good[..2]).field, "views");
    // The floor again and again, seen squarely.
    let squarely = Truth {
        rotation: [[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]],
        lens: [0.0; 5],
        ..truth.clone()
    };
    let floor = &ideal_views(&squarely, 0.05, &mut Random(4))[0];
    let problem = calibrate(
        &vec![floor.clone(); 5],
        &CalibrationSettings {
            span_min: 0.3,
            ..settings()
        },
    );
    assert!(problem.expect_err("no tilt").message.contains("squarely"));
    let mut twice = good.clone();
    let copy = twice[1].detections[0].clone();
    twice[1].detections.push(copy);
    assert!(refused(&twice).message.contains("twice"));
    let mut line = good.clone();
    line[2].detections.retain(|tag| tag.id < 5);
    line[2].board.tags.iter_mut().for_each(|tag| tag.edge_m = 0.02);
    assert!(refused(&line).message.contains("line"));
    let mut middle = good.clone();
    for view in &mut middle {
        view.detections
            .retain(|tag| tag.corners_px.iter().all(|at| (130.0..510.0).contains(&at[0])));
    }
    let field = refused(&middle).field;
    assert!(field.contains("span") || field.contains("detections"), "{field}");
    let mut wrong = good.clone();
    wrong[0].board.tags.iter_mut().for_each(|tag| tag.x_m *= 1.05);
    assert_eq!(refused(&wrong).field, "rms_px");
    let mut outside = settings();
    outside.world_view = 40;
    assert_eq!(
        calibrate(&good, &outside).expect_err("no such view").field,
        "world_view"
    );
}
