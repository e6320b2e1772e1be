//! The camera tracker: what it averages, when its frames arrive and in which order.

mod support;

use core::f64::consts::PI;

use support::{omni4, robot};
use twin::PHYSICS_PERIOD_S;
use twin::free::{FreeRobot, RobotState};
use twin::pose::Pose;
use twin::sensor::tracked_pose::{TrackedPose, TrackedPoseSettings};
use twin::sensor::{NoiseStreams, SensorSettings, SensorSuite, Surroundings};

/// 120 Hz, shutter open for 3 of 4 steps, 20 ms from mid-exposure to arrival.
fn camera() -> TrackedPoseSettings {
    TrackedPoseSettings {
        every_steps: 4,
        exposure_steps: 3,
        latency_s: 0.02,
        latency_jitter_s: 0.0,
        noise_xy_m: 0.0,
        noise_yaw_rad: 0.0,
        drop_probability: 0.0,
    }
}

fn still() -> RobotState {
    FreeRobot::at_rest(&robot(omni4()), Pose::default()).state()
}

/// A frame and the step at which it was handed over.
struct Handed {
    step: u64,
    frame: TrackedPose,
}

/// Frames of a robot whose pose is `path` of the step, seen every `stride` steps.
fn frames(settings: TrackedPoseSettings, steps: u64, stride: usize, path: impl Fn(f64) -> Pose) -> Vec<Handed> {
    let tracked = SensorSettings {
        tracked_pose: Some(settings),
        ..SensorSettings::default()
    };
    let mut suite = match SensorSuite::new(&robot(omni4()), tracked) {
        Ok(suite) => suite,
        Err(problem) => panic!("test tracker refused: {problem}"),
    };
    let mut streams = NoiseStreams::new(21, 0);
    let mut state = still();
    let mut handed = Vec::new();
    for step in (0..steps).step_by(stride) {
        state.pose = path(step as f64);
        let readings = suite.sample(&state, &Surroundings::default(), step, &mut streams);
        let arrived = readings.tracked_poses.into_iter();
        handed.extend(arrived.map(|frame| Handed { step, frame }));
    }
    handed
}

fn straight(step: f64) -> Pose {
    Pose {
        x_m: 0.5 + 0.01 * step,
        y_m: -0.002 * step,
        yaw_rad: 0.001 * step - 0.3,
    }
}

#[test]
fn a_frame_shows_the_pose_of_mid_exposure_and_says_when_that_was() {
    for stride in [1, 2, 4] {
        let handed = frames(camera(), 400, stride, straight);
        assert!(handed.len() > 95);
        for (index, Handed { frame, .. }) in handed.iter().enumerate() {
            let mid_step = 4.0 * index as f64 + 1.5;
            let want = straight(mid_step);
            assert!((frame.exposure_s - mid_step * PHYSICS_PERIOD_S).abs() < 1e-15);
            assert!(frame.pose.distance_m(&want) < 1e-14, "{:?} {want:?}", frame.pose);
            assert!((frame.pose.yaw_rad - want.yaw_rad).abs() < 1e-14);
        }
    }
}

#[test]
fn tracked_x_y_and_yaw_have_the_signs_of_the_world() {
    let handed = frames(camera(), 100, 1, straight);
    let (Some(first), Some(last)) = (handed.first(), handed.last()) else {
        panic!("no frames")
    };
    assert!(last.frame.pose.x_m > first.frame.pose.x_m);
    assert!(last.frame.pose.y_m < first.frame.pose.y_m);
    assert!(last.frame.pose.yaw_rad > first.frame.pose.yaw_rad);
}

/// x = k t^2 over an exposure from s to s + e: mean k (s^2 + s e + e^2/3), and the trapezoids of a step add k/6.
#[test]
fn a_frame_is_the_mean_over_the_exposure_and_not_its_middle() {
    let settings = TrackedPoseSettings {
        every_steps: 24,
        exposure_steps: 24,
        latency_s: 0.025,
        ..camera()
    };
    let parabola = |step: f64| Pose {
        x_m: 1e-3 * step * step,
        ..Pose::default()
    };
    let handed = frames(settings, 480, 1, parabola);
    assert!(handed.len() > 15);
    for (index, Handed { frame, .. }) in handed.iter().enumerate() {
        let (start, exposure) = (24.0 * index as f64, 24.0);
        let want = 1e-3 * (start * start + start * exposure + exposure * exposure / 3.0 + 1.0 / 6.0);
        assert!((frame.pose.x_m - want).abs() < 1e-9 * want, "{} {want}", frame.pose.x_m);
    }
}

#[test]
fn yaw_is_averaged_across_the_wrap() {
    let turning = |step: f64| Pose {
        yaw_rad: twin::pose::wrapped_rad(PI - 0.05 + 0.02 * step),
        ..Pose::default()
    };
    for (index, Handed { frame, .. }) in frames(camera(), 60, 1, turning).iter().enumerate() {
        let want = twin::pose::wrapped_rad(PI - 0.05 + 0.02 * (4.0 * index as f64 + 1.5));
        assert!((frame.pose.yaw_rad - want).abs() < 1e-12, "{index}");
    }
}

#[test]
fn a_frame_is_handed_over_at_the_first_step_after_its_latency() {
    for Handed { step, frame } in frames(camera(), 400, 1, straight) {
        assert!((frame.arrival_s - frame.exposure_s - 0.02).abs() < 1e-12);
        let now_s = step as f64 * PHYSICS_PERIOD_S;
        assert!(frame.arrival_s <= now_s && now_s - frame.arrival_s < PHYSICS_PERIOD_S);
    }
}

#[test]
fn jitter_spreads_the_latency_and_never_reorders_frames() {
    let settings = TrackedPoseSettings {
        latency_jitter_s: 0.05,
        ..camera()
    };
    let handed = frames(settings, 48_000, 1, straight);
    assert!(handed.len() > 11_900);
    let mut waited = 0;
    for pair in handed.windows(2) {
        let (first, second) = (&pair[0].frame, &pair[1].frame);
        assert!(first.exposure_s < second.exposure_s && first.arrival_s <= second.arrival_s);
        waited += u32::from(first.arrival_s == second.arrival_s);
    }
    assert!(waited > 1000, "frames wait for the ones before them");
    let latencies: Vec<f64> = handed.iter().map(|h| h.frame.arrival_s - h.frame.exposure_s).collect();
    assert!(latencies.iter().all(|latency| (0.02..0.07 + 1e-9).contains(latency)));
    let slow = TrackedPoseSettings {
        every_steps: 48,
        ..settings_with_jitter()
    };
    // Frames 0.1 s apart cannot catch up: the jitter shows as it is drawn.
    let handed = frames(slow, 480_000, 1, straight);
    let count = handed.len() as f64;
    let mean = handed
        .iter()
        .map(|h| h.frame.arrival_s - h.frame.exposure_s)
        .sum::<f64>()
        / count;
    assert!((mean - 0.045).abs() < 5.0 * 0.05 / f64::sqrt(12.0 * count), "{mean}");
}

fn settings_with_jitter() -> TrackedPoseSettings {
    TrackedPoseSettings {
        latency_jitter_s: 0.05,
        ..camera()
    }
}

#[test]
fn frames_are_lost_at_the_given_rate_and_the_others_keep_their_noise() {
    let noisy = TrackedPoseSettings {
        noise_xy_m: 0.001,
        noise_yaw_rad: 0.003,
        drop_probability: 1e-300,
        ..camera()
    };
    let complete = frames(noisy.clone(), 80_000, 1, straight);
    let lossy = TrackedPoseSettings {
        drop_probability: 0.2,
        ..noisy
    };
    let kept = frames(lossy, 80_000, 1, straight);
    let count = complete.len() as f64;
    let lost = 1.0 - kept.len() as f64 / count;
    assert!((lost - 0.2).abs() < 5.0 * f64::sqrt(0.2 * 0.8 / count), "{lost}");
    let mut all = complete.iter();
    for Handed { frame, .. } in &kept {
        let same = all.find(|other| other.frame.exposure_s == frame.exposure_s);
        assert_eq!(same.map(|other| other.frame), Some(*frame));
    }
    let always = TrackedPoseSettings {
        drop_probability: 1.0,
        ..camera()
    };
    assert!(frames(always, 4000, 1, straight).is_empty());
}
