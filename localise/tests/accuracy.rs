//! Rendered pictures of 12 tags: how many are found, how exactly, and that nothing else is.

mod support;

use localise::{CameraLocaliser, DetectorSettings, Expected, FloorSettings, Frame, code, wrap_rad};
use support::{CODES_PUBLISHED, Place, Random, Renderer, Style, camera_over_half, spread_out};

const HEIGHT_M: f64 = 0.1;

fn localiser(renderer: &Renderer) -> CameraLocaliser {
    CameraLocaliser::new(
        renderer.truth.camera(),
        DetectorSettings::default(),
        FloorSettings::default(),
    )
}

#[derive(Debug, Default)]
struct Score {
    wanted: u64,
    found: u64,
    foreign: u64,
    square_m2: f64,
    square_rad2: f64,
    worst_m: f64,
    /// Sum of squared errors over their variances: 3 per pose if the covariance is honest.
    normalised: f64,
    residual_px: f64,
}

impl Score {
    fn add(&mut self, places: &[Place], poses: &[localise::FloorPose]) {
        self.wanted += places.len() as u64;
        for pose in poses {
            let at = places.iter().find(|place| code(pose.robot) == Some(place.bits));
            let near = at.filter(|at| (at.x_m - pose.x_m).hypot(at.y_m - pose.y_m) < 0.05);
            let Some(at) = near else {
                self.foreign += 1;
                continue;
            };
            self.found += 1;
            let (dx, dy) = (pose.x_m - at.x_m, pose.y_m - at.y_m);
            let turn = wrap_rad(pose.yaw_rad - at.yaw_rad);
            self.square_m2 += dx * dx + dy * dy;
            self.square_rad2 += turn * turn;
            self.worst_m = self.worst_m.max(dx.hypot(dy));
            let c = pose.covariance;
            self.normalised += dx * dx / c[0][0] + dy * dy / c[1][1] + turn * turn / c[2][2];
            self.residual_px += pose.residual_px;
        }
    }

    fn report(&self) -> (f64, f64, f64) {
        let found = self.found as f64;
        let (rms_mm, rms_deg) = (
            (self.square_m2 / found).sqrt() * 1e3,
            (self.square_rad2 / found).sqrt().to_degrees(),
        );
        let share = found / self.wanted as f64;
        println!(
            "found {share:.5} rms {rms_mm:.3} mm {rms_deg:.3} deg worst {:.3} mm foreign {} errors/covariance {:.2} residual {:.3} px",
            self.worst_m * 1e3,
            self.foreign,
            self.normalised / found / 3.0,
            self.residual_px / found,
        );
        (share, rms_mm, rms_deg)
    }
}

#[test]
fn twelve_tags_with_blur_and_noise_are_found_within_two_millimetres() {
    for right in [false, true] {
        let mut renderer = Renderer::new(camera_over_half(right));
        let mut localiser = localiser(&renderer);
        let floor = renderer.truth.floor(HEIGHT_M);
        let mut random = Random(11 + u64::from(right));
        let (mut full, mut tracked) = (Score::default(), Score::default());
        for sequence in 0..120 {
            let places = spread_out(&mut random, right, (sequence % 5) as u16 * 12, 12);
            renderer.render(&floor, &places, &Style::default(), &mut random);
            let frame = Frame::new(640, 480, &renderer.pixels).expect("size fits");
            let seen = localiser.locate(&frame, sequence, 0, None).expect("size fits");
            full.add(&places, &seen.poses);
            let expected: Vec<Expected> = places
                .iter()
                .map(|place| Expected {
                    x_m: place.x_m + random.between(-0.02, 0.02),
                    y_m: place.y_m + random.between(-0.02, 0.02),
                    reach_m: 0.03,
                })
                .collect();
            let seen = localiser
                .locate(&frame, sequence, 0, Some(&expected))
                .expect("size fits");
            tracked.add(&places, &seen.poses);
        }
        for score in [full, tracked] {
            let (share, rms_mm, rms_deg) = score.report();
            assert!(share >= 0.995 && rms_mm <= 2.0 && rms_deg <= 0.5);
            assert_eq!(score.foreign, 0);
            let honest = score.normalised / score.found as f64 / 3.0;
            assert!((0.2..1.5).contains(&honest), "covariance is off by {honest}");
        }
    }
}

/// The pictures of the family that everybody prints: without this, renderer and detector could be wrong together.
#[test]
fn tags_drawn_from_the_published_codes_have_their_numbers() {
    let mut renderer = Renderer::new(camera_over_half(false));
    let mut localiser = localiser(&renderer);
    let floor = renderer.truth.floor(HEIGHT_M);
    let mut random = Random(3);
    let places: Vec<Place> = CODES_PUBLISHED
        .iter()
        .enumerate()
        .map(|(index, &bits)| Place {
            bits,
            ..Place::tag(
                0,
                -1.0 + 0.02 * index as f64,
                -1.2 + 0.7 * index as f64,
                index as f64 * std::f64::consts::FRAC_PI_2,
            )
        })
        .collect();
    renderer.render(&floor, &places, &Style::default(), &mut random);
    let frame = Frame::new(640, 480, &renderer.pixels).expect("size fits");
    let seen = localiser.locate(&frame, 1, 0, None).expect("size fits");
    assert_eq!(
        seen.poses.iter().map(|pose| pose.robot).collect::<Vec<_>>(),
        [0, 1, 2, 3]
    );
    for (pose, place) in seen.poses.iter().zip(&places) {
        assert!(wrap_rad(pose.yaw_rad - place.yaw_rad).abs() < 0.02, "{pose:?}");
        assert!((pose.x_m - place.x_m).hypot(pose.y_m - place.y_m) < 0.003);
    }
}

#[test]
fn a_tag_of_another_height_or_size_and_a_frame_of_another_size_are_refused() {
    let mut renderer = Renderer::new(camera_over_half(false));
    let mut localiser = localiser(&renderer);
    let mut random = Random(5);
    let mut places = [Place::tag(1, -1.0, 0.5, 0.3), Place::tag(2, -1.0, -0.5, 0.3)];
    places[1].edge_m = 0.13;
    renderer.render(&renderer.truth.floor(HEIGHT_M), &places, &Style::default(), &mut random);
    let frame = Frame::new(640, 480, &renderer.pixels).expect("size fits");
    let seen = localiser.locate(&frame, 1, 0, None).expect("size fits");
    assert_eq!((seen.poses.len(), seen.poses[0].robot, seen.implausible), (1, 1, 1));
    renderer.render(&renderer.truth.floor(0.6), &places[..1], &Style::default(), &mut random);
    let frame = Frame::new(640, 480, &renderer.pixels).expect("size fits");
    let seen = localiser.locate(&frame, 2, 0, None).expect("size fits");
    assert_eq!((seen.poses.len(), seen.implausible), (0, 1));
    let small = vec![0; 320 * 240];
    let frame = Frame::new(320, 240, &small).expect("a frame");
    assert_eq!(
        localiser.locate(&frame, 3, 0, None).expect_err("wrong size").field,
        "frame"
    );
}

#[test]
fn the_same_tag_twice_is_reported_as_a_duplicate() {
    let mut renderer = Renderer::new(camera_over_half(false));
    let mut random = Random(6);
    let places = [
        Place::tag(7, -1.0, 0.5, 0.3),
        Place::tag(7, -0.6, -0.5, 2.0),
        Place::tag(8, -1.4, 0.0, 1.0),
    ];
    renderer.render(&renderer.truth.floor(HEIGHT_M), &places, &Style::default(), &mut random);
    let frame = Frame::new(640, 480, &renderer.pixels).expect("size fits");
    let mut detector = localise::Detector::new(DetectorSettings::default());
    let found = detector.search(&frame, renderer.truth.camera().lens());
    assert_eq!(found.duplicates, [7]);
    assert_eq!(found.tags.iter().map(|tag| tag.id).collect::<Vec<_>>(), [7, 7, 8]);
    // One tag in two overlapping regions is one tag.
    let at = found.tags[2].centre_px();
    let regions = [-6.0, 6.0].map(|shift| localise::Region {
        centre_px: [at[0] + shift, at[1]],
        half_px: 40.0,
    });
    let found = detector.search_around(&frame, renderer.truth.camera().lens(), &regions);
    assert_eq!((found.tags.len(), found.duplicates.len()), (1, 0));
}

/// Dark squares with random modules, half tags, tags that nobody carries: frames times three chances of a false identity.
fn soak(frames: u64) {
    let mut renderer = Renderer::new(camera_over_half(false));
    let mut localiser = localiser(&renderer);
    let floor = renderer.truth.floor(HEIGHT_M);
    let mut random = Random(23);
    let mut score = Score::default();
    let mut candidates = 0u64;
    for sequence in 0..frames {
        let mut places = spread_out(&mut random, false, (sequence % 4) as u16 * 15, 15);
        let style = Style {
            blur_px: random.between(0.4, 1.0) as f32,
            noise: random.between(1.0, 5.0) as f32,
            white: random.between(150.0, 240.0) as f32,
            uneven: random.between(0.0, 0.9) as f32,
            ..Style::default()
        };
        // Three of the places become things that are no robot.
        places[12].bits = random.next() >> 28;
        places[13].bits ^= 0b101 << random.below(30);
        places[14].bits = code(64 + random.below(500) as u16).expect("a tag of the family");
        renderer.render(&floor, &places, &style, &mut random);
        let frame = Frame::new(640, 480, &renderer.pixels).expect("size fits");
        let seen = localiser.locate(&frame, sequence, 0, None).expect("size fits");
        candidates += u64::from(seen.rejections.candidates);
        // A tag with two wrong bits is not accepted either: it would be nobody's.
        score.add(&places[..12], &seen.poses);
        if sequence % 5_000 == 4_999 {
            println!(
                "{} frames: {} of {} found, {} foreign",
                sequence + 1,
                score.found,
                score.wanted,
                score.foreign
            );
        }
    }
    let (share, rms_mm, rms_deg) = score.report();
    println!("{frames} frames, {candidates} candidates");
    assert_eq!(score.foreign, 0);
    assert!(share >= 0.995 && rms_mm <= 2.0 && rms_deg <= 0.5);
    assert!(candidates >= 14 * frames, "the decoys were looked at");
}

#[test]
fn nothing_but_the_robots_tags_is_reported() {
    soak(400);
}

/// `cargo nextest run -p localise --run-ignored only`: about a quarter of an hour.
#[test]
#[ignore = "a quarter of an hour"]
fn nothing_but_the_robots_tags_is_reported_in_a_hundred_thousand_frames() {
    soak(100_000);
}
