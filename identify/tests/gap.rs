//! The end-to-end gap on runs made here and on examples of others.

mod support;

use identify::bundle::Bundle;
use identify::channel::Channel;
use identify::gap::{GapError, HORIZONS_S, end_to_end};
use support::{recorded, run_json};
use twin::golden::reference_robot;

#[test]
fn the_true_model_has_almost_no_gap() {
    let robot = reference_robot("diff2");
    let Ok(gap) = end_to_end(&recorded(&robot, &robot)) else {
        panic!("no gap")
    };
    println!("{:?}", gap.horizons);
    assert_eq!(gap.horizons.iter().map(|h| h.horizon_s).collect::<Vec<_>>(), HORIZONS_S);
    assert!(gap.horizons.iter().all(|h| h.samples >= 7));
    // Left are the state before the run-in and the unknown integral of the speed loop.
    assert!(
        gap.horizons.iter().all(|h| h.position_m < 2e-3 && h.yaw_rad < 2e-3),
        "{:?}",
        gap.horizons
    );
    assert_eq!((gap.anchors_skipped, gap.pose_outliers), (0, 0));
}

#[test]
fn flips_of_the_tracker_do_not_count() {
    let robot = reference_robot("diff2");
    let mut bundle = recorded(&robot, &robot);
    let Some(yaw) = bundle.telemetry.channels.get_mut(&Channel::PoseYaw) else {
        panic!("no yaw")
    };
    yaw.values
        .iter_mut()
        .skip(20)
        .step_by(37)
        .for_each(|value| *value = twin::pose::wrapped_rad(*value + core::f64::consts::PI));
    let Some(x) = bundle.telemetry.channels.get_mut(&Channel::PoseX) else {
        panic!("no x")
    };
    x.values.iter_mut().skip(31).step_by(53).for_each(|value| *value += 0.4);
    let Ok(gap) = end_to_end(&bundle) else { panic!("no gap") };
    assert!((100..120).contains(&gap.pose_outliers), "{}", gap.pose_outliers);
    assert!(
        gap.horizons.iter().all(|h| h.position_m < 2e-3 && h.yaw_rad < 2e-3),
        "{:?}",
        gap.horizons
    );
}

/// A tracker that takes up the robot elsewhere and stays there says nothing of how far predictions are off.
#[test]
fn nothing_is_predicted_over_a_place_where_the_tracker_broke() {
    let robot = reference_robot("diff2");
    let whole = recorded(&robot, &robot);
    let mut bundle = whole.clone();
    let Some(x) = bundle.telemetry.channels.get_mut(&Channel::PoseX) else {
        panic!("no x")
    };
    let half = x.values.len() / 2;
    x.values.iter_mut().skip(half).for_each(|value| *value += 6.0);
    let broken_s = bundle.telemetry.time_s[x.rows[half] as usize];
    let (Ok(whole), Ok(gap)) = (end_to_end(&whole), end_to_end(&bundle)) else {
        panic!("no gap")
    };
    assert!(
        gap.horizons.iter().all(|h| h.position_m < 2e-3 && h.yaw_rad < 2e-3),
        "{:?}",
        gap.horizons
    );
    // All that neither begin before and end after the break, nor begin while poses of both sides would be fitted.
    let is_left = |anchor_s: f64, horizon_s: f64| anchor_s + horizon_s < broken_s || anchor_s > broken_s + 0.5;
    let expected = whole
        .samples
        .iter()
        .filter(|s| is_left(s.anchor_s, s.horizon_s))
        .count();
    assert_eq!(gap.samples.len(), expected);
    assert!(
        expected < whole.samples.len() && expected > whole.samples.len() / 2,
        "{expected}"
    );
}

#[test]
fn a_wrong_wheel_radius_shows_and_grows_with_the_horizon() {
    let truth = reference_robot("diff2");
    let mut described = truth.clone();
    described
        .wheels
        .iter_mut()
        .for_each(|wheel| wheel.radius_m = wheel.radius_m.map(|radius| 1.03 * radius));
    let Ok(gap) = end_to_end(&recorded(&truth, &described)) else {
        panic!("no gap")
    };
    println!("{:?}", gap.horizons);
    let position: Vec<f64> = gap.horizons.iter().map(|h| h.position_m).collect();
    assert!(position.windows(2).all(|pair| pair[1] > 1.3 * pair[0]), "{position:?}");
    // 3 % of about 0.3 m/s over 2 s.
    assert!((0.012..0.03).contains(&position[2]), "{position:?}");
    // The twin is ahead.
    let ahead: f64 = gap
        .samples
        .iter()
        .filter(|sample| sample.horizon_s == 1.0)
        .map(|sample| sample.forward_m)
        .sum();
    assert!(ahead > 0.0);
}

#[test]
fn runs_without_poses_or_commands_are_refused() {
    let gap = |csv: &str| Bundle::parse(&run_json(), csv.as_bytes()).map(|bundle| end_to_end(&bundle));
    assert_eq!(
        gap("time_s,command_wheel_0_rad_per_s\n0,1\n"),
        Ok(Err(GapError::NoPoses))
    );
    assert_eq!(
        gap("time_s,pose_x_m,pose_y_m,pose_yaw_rad\n0,1,1,0\n"),
        Ok(Err(GapError::NoCommands))
    );
    assert_eq!(
        gap("time_s,command_wheel_0_rad_per_s,pose_x_m,pose_y_m,pose_yaw_rad\n0,1,1,1,0\n"),
        Ok(Err(GapError::TooShort(0.8)))
    );
}

#[test]
fn example_runs_of_others() {
    let Some(folder) = std::env::var_os("ROBOPHEUS_REAL_LOGS") else {
        println!("skipped: ROBOPHEUS_REAL_LOGS does not name the folder with bundle_examples");
        return;
    };
    for run in ["omni4/run_01", "omni4/run_02", "rwd/run_01", "rwd/run_02"] {
        let path = std::path::Path::new(&folder).join("bundle_examples").join(run);
        let (Ok(json), Ok(csv)) = (
            std::fs::read_to_string(path.join("run.json")),
            std::fs::read(path.join("telemetry.csv")),
        ) else {
            panic!("{} has no run.json and telemetry.csv", path.display());
        };
        let bundle = match Bundle::parse(&json, &csv) {
            Ok(bundle) => bundle,
            Err(error) => panic!("{run}: {error}"),
        };
        let gap = match end_to_end(&bundle) {
            Ok(gap) => gap,
            Err(error) => panic!("{run}: {error}"),
        };
        for h in &gap.horizons {
            println!(
                "{run}: {:.1} s: {:.1} mm, {:.2} mrad, {} anchors",
                h.horizon_s,
                1e3 * h.position_m,
                1e3 * h.yaw_rad,
                h.samples
            );
        }
        println!(
            "{run}: {} remarks, {} anchors skipped, {} poses left out",
            bundle.remarks.len(),
            gap.anchors_skipped,
            gap.pose_outliers
        );
        // Nothing is hidden in these runs: two seconds ahead the nominal twin is within a few centimetres.
        assert!(
            gap.horizons[2].samples >= 9 && gap.horizons[2].position_m < 0.1,
            "{run}: {:?}",
            gap.horizons[2]
        );
    }
}
