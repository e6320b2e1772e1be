use super::search::{NEAR, Steps, TICK_S, covers, halve};
use super::*;

fn outlook(iteration: usize, gain: f64, promised: f64) -> Outlook {
    Outlook {
        iteration,
        gain,
        promised,
    }
}

#[test]
fn a_fit_ends_where_its_slopes_promise_nothing() {
    assert!(outlook(1, 100.0, 0.9 * LEAST_GAIN).is_best());
    assert!(outlook(1, 10_000.0, 0.9 * LEAST_SHARE * 10_000.0).is_best());
    assert!(!outlook(1, 100.0, 1.0).is_best());
}

#[test]
fn a_fit_ends_when_what_it_may_still_gain_is_not_enough_and_not_before() {
    assert!(outlook(1, 10.0, 4.0).is_hopeless(30.0));
    assert!(!outlook(1, 10.0, 6.0).is_hopeless(30.0), "{HOPE} times 6 may be enough");
    assert!(!outlook(0, -50.0, 1.0).is_hopeless(30.0), "the start is no step");
    assert!(
        outlook(PATIENCE, -1.0, 1e6).is_hopeless(30.0),
        "worse than nothing for long"
    );
    assert!(
        !outlook(PATIENCE, -1.0, 1e6).is_hopeless(f64::NEG_INFINITY),
        "nothing is wanted"
    );
}

#[test]
fn shifts_of_time_are_searched_in_ticks_once_before_anything_finer() {
    let tick = Steps::Seconds(TICK_S);
    assert_eq!(steps_of_search(false, false, &TICKS, 0)[0], tick);
    assert_eq!(steps_of_search(false, false, &TICKS, 0).len(), TICKS.len() + NEAR.len());
    assert_eq!(steps_of_search(false, false, &[], 0), [Steps::Sizes(NEAR[0])]);
    assert!(steps_of_search(false, false, &TICKS, 1).is_empty());
}

#[test]
fn corrected_slopes_tell_what_the_step_did_and_nothing_else_new() {
    let mut slopes = vec![vec![vec![1.0, 2.0]], vec![vec![0.5, -1.0]]];
    let (before, after) = (vec![vec![3.0, 4.0]], vec![vec![1.5, 4.5]]);
    let step = [2.0, -1.0];
    let across = [1.0, 2.0];
    let told =
        |slopes: &[Vec<Vec<f64>>], step: &[f64], row: usize| slopes[0][0][row] * step[0] + slopes[1][0][row] * step[1];
    let old: Vec<f64> = (0..2).map(|row| told(&slopes, &across, row)).collect();
    correct(&mut slopes, &before, &after, &step);
    for row in 0..2 {
        assert!((told(&slopes, &step, row) - (before[0][row] - after[0][row])).abs() < 1e-12);
        assert!(
            (told(&slopes, &across, row) - old[row]).abs() < 1e-12,
            "nothing across the step"
        );
    }
}

#[test]
fn slopes_tell_the_decrease_of_a_parabola() {
    // energy (3 - x)^2 + 2 (1 - y)^2, at 0
    let mut normal = Square::zero(2);
    normal.set(0, 0, 1.0);
    normal.set(1, 1, 2.0);
    let right = [3.0, 2.0];
    assert!((told(&normal, &right, &[3.0, 1.0]) - 11.0).abs() < 1e-12);
    assert!((told(&normal, &right, &[1.0, 0.0]) - 5.0).abs() < 1e-12);
}

#[test]
fn a_patch_is_the_floor_when_runs_were_hardly_ever_beside_it() {
    let track = |beside: usize| (0..100).map(move |k| [if k < beside { 2.0 } else { 0.01 * k as f64 }, 0.3]);
    assert!(covers([0.5, 0.3], 0.6, track(0)) && covers([0.5, 0.3], 0.6, track(3)));
    assert!(!covers([0.5, 0.3], 0.6, track(4)), "a patch beside which runs were");
    assert!(!covers([0.5, 0.3], 0.2, track(0)), "a patch in the middle of the track");
    assert!(
        !covers([0.0, 0.0], 9.0, std::iter::empty()),
        "runs without poses say nothing"
    );
}

#[test]
fn sizes_are_halved_towards_none_and_places_and_limits_stay() {
    let robot = twin::golden::reference_robot("rwd");
    let all = crate::hypothesis::candidates(&robot, &crate::hypothesis::Excitation::default());
    let halved = |name: &str, values: &[f64]| {
        let candidate = all
            .iter()
            .find(|candidate| candidate.entry.name == name)
            .expect("a candidate");
        let mut values = values.to_vec();
        halve(&candidate.axes, &mut values);
        values
    };
    assert_eq!(halved("weak_motor", &[0.9]), [0.95]);
    assert_eq!(
        halved("low_friction_patch", &[1.0, -0.5, 0.4, 0.6]),
        [1.0, -0.5, 0.4, 0.8]
    );
    assert_eq!(halved("acceleration_limit", &[2.0]), [2.0]);
}

#[test]
fn limits_alone_are_scaled_and_what_is_not_limited_stays_so() {
    let robot = twin::golden::reference_robot("rwd");
    let driven = crate::hypothesis::Excitation {
        wheel_rad_per_s: 20.0,
        twist: [1.0, 0.0, 3.0],
        extent_m: [-1.0, 1.0, -1.0, 1.0],
    };
    let all = crate::hypothesis::candidates(&robot, &driven);
    let member = |name: &str, values: &[f64]| Member {
        candidate: all
            .iter()
            .find(|candidate| candidate.entry.name == name)
            .expect("a candidate")
            .clone(),
        values: values.to_vec(),
    };
    let body = member("body_speed_saturation", &[0.8, f64::INFINITY, f64::INFINITY]);
    let motor = member("weak_motor", &[0.9]);
    assert!(with_limits(core::slice::from_ref(&motor), RAISED).is_none());
    let scaled = with_limits(&[motor, body], RAISED).expect("one of them is a limit");
    assert_eq!(scaled[0].values, [0.9]);
    assert!((scaled[1].values[0] - RAISED * 0.8).abs() < 1e-12 && scaled[1].values[1].is_infinite());
}

/// Three runs of which the first asks for more of it and the others for less: without the first it is less.
#[test]
fn members_without_a_run_are_those_of_the_others() {
    use crate::floor::Floor;
    use crate::hypothesis::{Excitation, candidates};
    use crate::record::Quantity;
    use crate::record::made::series;
    let description = twin::golden::reference_robot("diff2");
    let all = candidates(&description, &Excitation::default());
    let friction = all
        .into_iter()
        .find(|candidate| candidate.entry.name == "viscous_friction");
    let candidate = friction.expect("a diff2 has it");
    let axis = candidate.axes[0];
    let records: Vec<Record> = (0..3).map(|_| series(Quantity::Wheel(0), 50)).collect();
    let floor = Floor::stated(Hypothesis::nominal(&description), Vec::new());
    let metric = floor.metric(&records, &[]);
    let value = 3.0 * axis.practical;
    let fit = Fit {
        members: vec![Member {
            candidate,
            values: vec![value],
        }],
        gain: 100.0,
        residuals: vec![vec![1.0; 50], vec![-0.5; 50], vec![-0.5; 50]],
        covariance: Square::zero(1),
        free: vec![(0, 0)],
        jacobian: vec![vec![vec![1.0; 50]; 3]],
        simulations: 0,
        is_given_up: false,
    };
    let sizes: Vec<f64> = (0..3)
        .map(|run| (fit.without(&metric, run).expect("slopes")[0].values[0] - value) / axis.practical)
        .collect();
    for (found, expected) in sizes.iter().zip([-0.5, 0.25, 0.25]) {
        assert!((found - expected).abs() < 0.002, "{sizes:?}");
    }
    let evaluated = Fit {
        jacobian: Vec::new(),
        ..fit
    };
    assert!(evaluated.without(&metric, 0).is_none(), "no slopes");
}

/// Of a load whose mass is known and whose inertia hardly is, the mass says how large it is.
#[test]
fn a_size_is_sure_as_far_as_its_interval_says() {
    let robot = twin::golden::reference_robot("rwd");
    let all = crate::hypothesis::candidates(&robot, &crate::hypothesis::Excitation::default());
    let candidate = all.into_iter().find(|candidate| candidate.entry.name == "payload");
    let candidate = candidate.expect("a robot can carry a load");
    let [mass, inertia] = [0, 1].map(|axis| candidate.axes[axis].practical);
    let mut fit = Fit {
        members: vec![Member {
            values: vec![3.0 * mass, -20.0 * inertia],
            candidate,
        }],
        gain: 100.0,
        residuals: Vec::new(),
        covariance: Square::zero(2),
        free: vec![(0, 0), (0, 1)],
        jacobian: Vec::new(),
        simulations: 0,
        is_given_up: false,
    };
    let unit = |axis: usize| scale(&fit.members[0].candidate.axes[axis], fit.members[0].values[axis]);
    let sigmas = [0.5 * mass / unit(0), 10.0 * inertia / unit(1)];
    let size = |fit: &Fit| fit.sure_size(0);
    assert!((size(&fit) - 20.0).abs() < 1e-9, "both are known exactly");
    fit.covariance.set(0, 0, sigmas[0] * sigmas[0]);
    fit.covariance.set(1, 1, sigmas[1] * sigmas[1]);
    assert!((size(&fit) - (3.0 - 1.96 * 0.5)).abs() < 1e-9, "{}", size(&fit));
    fit.free.clear();
    assert!(
        (size(&fit) - 20.0).abs() < 1e-9,
        "intervals are not known: the values count"
    );
}

/// A load of two sizes beside a gyro's bias: what is said of the second is its own.
#[test]
fn what_a_fit_says_of_one_member_is_that_member_s() {
    let all = crate::hypothesis::candidates(
        &twin::golden::reference_robot("diff2"),
        &crate::hypothesis::Excitation::default(),
    );
    let member = |name: &str, values: Vec<f64>| {
        let candidate = all.iter().find(|candidate| candidate.entry.name == name);
        Member {
            candidate: candidate.cloned().expect("a candidate"),
            values,
        }
    };
    let mut covariance = Square::zero(3);
    for axis in 0..3 {
        covariance.set(axis, axis, [4.0, 9.0, 0.25][axis]);
    }
    let fit = Fit {
        members: vec![member("payload", vec![3.0, 0.1]), member("gyro_bias", vec![0.02])],
        gain: 5.0,
        residuals: Vec::new(),
        covariance,
        free: vec![(0, 0), (0, 1), (1, 0)],
        jacobian: (0..3).map(|axis| vec![vec![f64::from(axis)]]).collect(),
        simulations: 1,
        is_given_up: false,
    };
    let bias = fit.clone().only(1);
    assert_eq!(bias.members[0].candidate.entry.name, "gyro_bias");
    assert_eq!(
        (&bias.free[..], &bias.jacobian[..]),
        (&[(0, 0)][..], &[vec![vec![2.0]]][..])
    );
    assert!((bias.sigma(0, 0) - fit.sigma(1, 0)).abs() < 1e-15 && bias.sigma(0, 0) > 0.0);
    let load = fit.clone().only(0);
    assert_eq!(load.free, [(0, 0), (0, 1)]);
    assert!((load.sigma(0, 1) - fit.sigma(0, 1)).abs() < 1e-15);
}
