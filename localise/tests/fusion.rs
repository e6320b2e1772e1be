//! Several cameras, one world: order, identity, jumps, freezing, velocities.

#[path = "support/random.rs"]
mod random;

use localise::{
    Admission, CameraHealth, FloorPose, Fusion, FusionSettings, Observation, Rejections, TagOutcome, WorldPose,
    wrap_rad,
};
use random::Random;

/// 120 Hz.
const FRAME_US: i64 = 8333;
const LATENCY_US: i64 = 6000;
const SIGMA_M: f64 = 0.001;
const SIGMA_RAD: f64 = 0.004;

fn pose(robot: u16, x_m: f64, y_m: f64, yaw_rad: f64) -> FloorPose {
    FloorPose {
        robot,
        x_m,
        y_m,
        yaw_rad,
        covariance: [
            [SIGMA_M * SIGMA_M, 0.0, 0.0],
            [0.0, SIGMA_M * SIGMA_M, 0.0],
            [0.0, 0.0, SIGMA_RAD * SIGMA_RAD],
        ],
        residual_px: 0.05,
    }
}

fn observation(sequence: u64, exposure_us: i64, poses: Vec<FloorPose>) -> Observation {
    Observation {
        sequence,
        exposure_us,
        digest: sequence.wrapping_mul(0x9e37_79b9) ^ 0xabcd,
        poses,
        implausible: 0,
        rejections: Rejections::default(),
    }
}

/// A robot on a circle of 0.5 m at 0.5 m/s, looking along its way.
fn circle(robot: u16, time_us: i64) -> [f64; 6] {
    let angle = time_us as f64 * 1e-6 + f64::from(robot);
    let (s, c) = angle.sin_cos();
    [
        0.5 * c,
        0.5 * s,
        wrap_rad(angle + std::f64::consts::FRAC_PI_2),
        -0.5 * s,
        0.5 * c,
        1.0,
    ]
}

fn noisy(robot: u16, time_us: i64, random: &mut Random) -> FloorPose {
    let [x, y, yaw, ..] = circle(robot, time_us);
    pose(
        robot,
        x + SIGMA_M * random.normal(),
        y + SIGMA_M * random.normal(),
        wrap_rad(yaw + SIGMA_RAD * random.normal()),
    )
}

/// Two cameras half a frame apart that see robots 0 to 2; `spoil` may change what a frame tells.
struct Run {
    fusion: Fusion,
    random: Random,
    outcomes: Vec<TagOutcome>,
    step: i64,
}

impl Run {
    fn new(settings: FusionSettings) -> Run {
        Run {
            fusion: Fusion::new(settings).expect("settings are possible"),
            random: Random(5),
            outcomes: Vec::new(),
            step: 0,
        }
    }

    fn now_us(&self) -> i64 {
        self.step * FRAME_US + LATENCY_US
    }

    fn frame(&mut self, camera: u16, spoil: impl FnOnce(&mut Observation)) -> Admission {
        let exposure_us = self.step * FRAME_US - i64::from(camera) * FRAME_US / 2;
        let poses = (0..3)
            .map(|robot| noisy(robot, exposure_us, &mut self.random))
            .collect();
        let mut frame = observation(self.step as u64, exposure_us, poses);
        spoil(&mut frame);
        self.fusion.observe(camera, &frame, self.now_us(), &mut self.outcomes)
    }

    /// One frame of each camera.
    fn good(&mut self, steps: usize) {
        for _ in 0..steps {
            self.step += 1;
            assert_eq!(self.frame(1, |_| ()), Admission::Used);
            assert_eq!(self.frame(0, |_| ()), Admission::Used);
        }
    }

    fn error_m(&self, robot: u16) -> f64 {
        let at = self.fusion.pose(robot, self.now_us()).expect("the robot is known");
        let [x, y, ..] = circle(robot, self.now_us());
        (at.x_m - x).hypot(at.y_m - y)
    }
}

#[test]
fn poses_and_velocities_follow_within_their_covariance() {
    let mut run = Run::new(FusionSettings::default());
    run.good(120);
    let (mut place, mut speed, mut yaw, mut rate, mut normalised, mut count) = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
    for _ in 0..600 {
        run.good(1);
        for robot in 0..3 {
            let now = run.now_us();
            let WorldPose {
                x_m,
                y_m,
                yaw_rad,
                vx_m_per_s,
                vy_m_per_s,
                yaw_rate_rad_per_s,
                covariance,
                age_us,
                ..
            } = run.fusion.pose(robot, now).expect("known");
            let [x, y, angle, vx, vy, w] = circle(robot, now);
            assert_eq!(age_us, LATENCY_US);
            place += (x_m - x).powi(2) + (y_m - y).powi(2);
            speed += (vx_m_per_s - vx).powi(2) + (vy_m_per_s - vy).powi(2);
            yaw += wrap_rad(yaw_rad - angle).powi(2);
            rate += (yaw_rate_rad_per_s - w).powi(2);
            normalised += (x_m - x).powi(2) / covariance[0][0] + (y_m - y).powi(2) / covariance[1][1];
            count += 1.0;
        }
    }
    let rms = [place, speed, yaw, rate].map(|sum: f64| (sum / count).sqrt());
    println!("rms {rms:?}, errors/covariance {}", normalised / count / 2.0);
    assert!(
        rms[0] < 0.0015 && rms[1] < 0.06 && rms[2] < 0.006 && rms[3] < 0.25,
        "{rms:?}"
    );
    assert!((0.2..1.5).contains(&(normalised / count / 2.0)));
    let counts = run.fusion.counts();
    assert_eq!(
        (
            counts.jumps,
            counts.duplicates,
            counts.invalid,
            counts.out_of_order_frames
        ),
        (0, 0, 0, 0)
    );
    // 720 steps, 2 cameras, 3 robots, without the first two sightings of each robot.
    assert_eq!(counts.used, 720 * 2 * 3 - 2 * 3);
}

#[test]
fn a_camera_that_was_switched_off_and_on_counts_anew() {
    let mut run = Run::new(FusionSettings::default());
    run.good(20);
    // Half a second is 60 frames: before that a small sequence is an old picture.
    run.step += 50;
    assert_eq!(run.frame(0, |frame| frame.sequence = 0), Admission::OutOfOrder);
    run.step += 30;
    assert_eq!(run.frame(0, |frame| frame.sequence = 0), Admission::Used);
    run.step += 1;
    assert_eq!(run.frame(0, |frame| frame.sequence = 1), Admission::Used);
    run.step += 1;
    assert_eq!(run.frame(0, |frame| frame.sequence = 1), Admission::OutOfOrder);
    assert_eq!(run.fusion.counts().missed_frames, 0);
}

#[test]
fn old_frames_are_dropped_and_counted_and_missing_ones_too() {
    let mut run = Run::new(FusionSettings::default());
    run.good(20);
    let before = run.fusion.poses(run.now_us());
    run.step += 1;
    assert_eq!(run.frame(0, |frame| frame.sequence = 20), Admission::OutOfOrder);
    assert_eq!(
        run.frame(0, |frame| frame.exposure_us = 20 * FRAME_US),
        Admission::OutOfOrder
    );
    assert_eq!(run.frame(0, |frame| frame.exposure_us -= 200_000), Admission::TooOld);
    assert_eq!(run.frame(0, |frame| frame.exposure_us += 200_000), Admission::TooOld);
    assert_eq!(run.frame(2, |_| ()), Admission::UnknownCamera);
    assert_eq!(run.fusion.poses(20 * FRAME_US + LATENCY_US), before);
    assert_eq!(run.frame(0, |frame| frame.sequence = 25), Admission::Used);
    let counts = run.fusion.counts();
    assert_eq!(
        (
            counts.out_of_order_frames,
            counts.too_old_frames,
            counts.unknown_camera_frames
        ),
        (2, 2, 1)
    );
    assert_eq!(counts.missed_frames, 4);
}

#[test]
fn a_jump_is_not_used_and_a_robot_that_was_carried_away_is_found_again() {
    let mut run = Run::new(FusionSettings::default());
    run.good(60);
    run.step += 1;
    assert_eq!(run.frame(0, |frame| frame.poses[1].x_m += 0.3), Admission::Used);
    assert_eq!(run.outcomes, [TagOutcome::Used, TagOutcome::Jump, TagOutcome::Used]);
    run.frame(1, |_| ());
    assert!(run.error_m(1) < 0.005);
    // Numbers that are none never reach the filter.
    run.step += 1;
    run.frame(0, |frame| {
        (
            frame.poses[0].x_m,
            frame.poses[1].covariance[0][0],
            frame.poses[2].robot,
        ) = (f64::NAN, 0.0, 99)
    });
    assert_eq!(run.outcomes, [TagOutcome::Invalid; 3]);
    // From now on robot 1 stands elsewhere: not believed for half a second, then again.
    let mut back = None;
    for step in 0..90 {
        run.step += 1;
        for camera in [1, 0] {
            run.frame(camera, |frame| frame.poses[1] = pose(1, -1.2, 1.0, 0.5));
        }
        match run.fusion.pose(1, run.now_us()) {
            Some(at) if (at.x_m + 1.2).abs() < 0.01 => back = back.or(Some(step)),
            _ => {}
        }
    }
    let after_us = back.expect("found again") * FRAME_US;
    assert!((470_000..540_000).contains(&after_us), "{after_us} us");
    assert_eq!(run.fusion.counts().relocations, 1);
    assert!(run.error_m(0) < 0.005 && run.error_m(2) < 0.005);
}

#[test]
fn swapped_identities_are_refused_and_the_tracks_stay() {
    let mut run = Run::new(FusionSettings::default());
    run.good(60);
    for _ in 0..12 {
        run.step += 1;
        for camera in [1, 0] {
            run.frame(camera, |frame| {
                (frame.poses[0].robot, frame.poses[1].robot) = (1, 0);
                frame.poses.sort_by_key(|pose| pose.robot);
            });
            assert_eq!(run.outcomes, [TagOutcome::Jump, TagOutcome::Jump, TagOutcome::Used]);
        }
    }
    // A tenth of a second on a circle without measurements: a t^2 / 2 = 0.5 * 0.11^2 / 2 = 3 mm and the velocity's error.
    assert!(
        run.error_m(0) < 0.02 && run.error_m(1) < 0.02,
        "{} {}",
        run.error_m(0),
        run.error_m(1)
    );
    assert!(run.fusion.pose(0, run.now_us()).expect("known").age_us > 90_000);
    assert_eq!((run.fusion.counts().jumps, run.fusion.counts().relocations), (48, 0));
    run.good(20);
    assert!(run.error_m(0) < 0.005 && run.error_m(1) < 0.005);
}

#[test]
fn of_two_places_only_the_one_on_the_track_is_used() {
    let mut run = Run::new(FusionSettings::default());
    // Without a track neither is believed, however often they are seen.
    let twice = |frame: &mut Observation| frame.poses.insert(1, pose(0, 1.5, 1.0, 0.0));
    for _ in 0..20 {
        run.step += 1;
        run.frame(0, twice);
        assert_eq!(run.outcomes[..2], [TagOutcome::Duplicate; 2]);
    }
    assert_eq!(run.fusion.pose(0, run.now_us()), None);
    assert!(run.fusion.pose(1, run.now_us()).is_some());
    assert_eq!(run.fusion.counts().duplicates, 20);
    run.good(40);
    for _ in 0..20 {
        run.step += 1;
        run.frame(0, twice);
        assert_eq!(run.outcomes[..2], [TagOutcome::Used, TagOutcome::Duplicate]);
    }
    assert!(run.error_m(0) < 0.005);
    // Two places that both agree with the track are no better.
    run.step += 1;
    run.frame(0, |frame| frame.poses.insert(1, frame.poses[0]));
    assert_eq!(run.outcomes[..2], [TagOutcome::Duplicate; 2]);
    // Another camera that sees the robot elsewhere: the track decides.
    run.step += 1;
    run.frame(1, |frame| frame.poses[0] = pose(0, 1.5, 1.0, 0.0));
    assert_eq!(run.outcomes[0], TagOutcome::Jump);
}

#[test]
fn a_frozen_camera_is_not_used_and_a_silent_one_has_stalled() {
    let mut run = Run::new(FusionSettings::default());
    assert_eq!(run.fusion.camera(0, 0), Some(CameraHealth::Silent));
    assert_eq!(run.fusion.camera(2, 0), None);
    run.good(60);
    assert_eq!(run.fusion.camera(0, run.now_us()), Some(CameraHealth::Live));
    // Camera 0 repeats its last picture with new numbers and times.
    let last_us = 60 * FRAME_US;
    let stuck: Vec<FloorPose> = (0..3).map(|robot| noisy(robot, last_us, &mut Random(1))).collect();
    for step in 0..30 {
        run.step += 1;
        assert_eq!(run.frame(1, |_| ()), Admission::Used);
        let admission = run.frame(0, |frame| (frame.digest, frame.poses) = (77, stuck.clone()));
        assert_eq!(admission, if step == 0 { Admission::Used } else { Admission::Frozen });
    }
    let since_us = 61 * FRAME_US;
    assert_eq!(
        run.fusion.camera(0, run.now_us()),
        Some(CameraHealth::Frozen { since_us })
    );
    assert_eq!(run.fusion.counts().frozen_frames, 29);
    assert!(run.error_m(0) < 0.006);
    run.good(1);
    assert_eq!(run.fusion.camera(0, run.now_us()), Some(CameraHealth::Live));
    // Sequence that does not advance: dropped, and soon the camera counts as stalled.
    let since_us = run.now_us();
    for _ in 0..10 {
        run.step += 1;
        assert_eq!(run.frame(0, |frame| frame.sequence = 5), Admission::OutOfOrder);
    }
    assert_eq!(
        run.fusion.camera(0, run.now_us()),
        Some(CameraHealth::Stalled { since_us })
    );
    // Nobody sees the robots: their poses age, then they are gone.
    assert_eq!(
        run.fusion.pose(0, since_us + 400_000).expect("carried on").age_us,
        400_000 + LATENCY_US
    );
    assert_eq!(run.fusion.pose(0, since_us + 600_000), None);
}

#[test]
fn a_camera_without_noise_is_frozen_only_when_a_robot_in_it_should_move() {
    let mut run = Run::new(FusionSettings {
        frames_have_noise: false,
        ..FusionSettings::default()
    });
    let still = vec![pose(0, 0.5, 0.0, 0.0)];
    let same = |frame: &mut Observation| (frame.digest, frame.poses) = (9, vec![pose(0, 0.5, 0.0, 0.0)]);
    assert_eq!(still.len(), 1);
    for _ in 0..60 {
        run.step += 1;
        assert_eq!(run.frame(0, same), Admission::Used);
    }
    assert_eq!(run.fusion.pose(0, run.now_us()).expect("known").age_us, LATENCY_US);
    run.fusion.expect_motion(0, 0.3, run.now_us() + 100_000);
    run.step += 1;
    assert_eq!(run.frame(0, same), Admission::Frozen);
    // Frozen stays frozen until the picture changes, even when the command is over.
    run.step += 30;
    assert_eq!(run.frame(0, same), Admission::Frozen);
    run.step += 1;
    assert_eq!(run.frame(0, |frame| frame.poses = still), Admission::Used);
}

#[test]
fn the_same_calls_give_the_same_poses() {
    let poses = || {
        let mut run = Run::new(FusionSettings::default());
        run.good(100);
        serde_json::to_string(&run.fusion.poses(run.now_us())).expect("numbers")
    };
    assert_eq!(poses(), poses());
}

#[test]
fn settings_outside_their_limits_are_refused_by_field() {
    let refused = |spoil: fn(&mut FusionSettings)| {
        let mut settings = FusionSettings::default();
        spoil(&mut settings);
        Fusion::new(settings).expect_err("out of range").field
    };
    assert_eq!(refused(|s| s.cameras = 0), "cameras");
    assert_eq!(refused(|s| s.gate = f64::NAN), "gate");
    assert_eq!(refused(|s| s.lost_after_us = 0), "lost_after_us");
}

#[test]
fn the_spread_is_that_of_the_most_uncertain_direction() {
    let pose = WorldPose {
        robot: 1,
        time_us: 0,
        age_us: 0,
        x_m: 0.0,
        y_m: 0.0,
        yaw_rad: 0.0,
        vx_m_per_s: 0.0,
        vy_m_per_s: 0.0,
        yaw_rate_rad_per_s: 0.0,
        // Along the diagonal 6e-6, across it 2e-6 m^2.
        covariance: [[4e-6, 2e-6, 0.0], [2e-6, 4e-6, 0.0], [0.0, 0.0, 9e-6]],
        velocity_variance: [0.0; 3],
        camera: 0,
    };
    let [place_m, yaw_rad] = pose.spread();
    assert!((place_m - 6e-6_f64.sqrt()).abs() < 1e-12 && (yaw_rad - 3e-3).abs() < 1e-12);
}
