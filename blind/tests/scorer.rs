//! The scorer on reports made by hand.

use blind::effects::Truth;
use blind::kind::Kind;
use blind::oracle::Visible;
use blind::score::{Facts, score};
use blind::set::Known;
use blind::truth::Sealed;
use identify::report::schema::{NamedEffect, Report};
use serde_json::{Value, json};

/// One named effect: name, index, status, alternatives, parameters (name, value, low, high).
fn effect(name: &str, index: Option<usize>, alternatives: &[&str], parameters: &[(&str, f64, f64, f64)]) -> Value {
    let status = if alternatives.is_empty() {
        "confirmed"
    } else {
        "ambiguous"
    };
    let parameters: Vec<Value> = parameters
        .iter()
        .map(|(name, value, low, high)| json!({"name": name, "value": value, "low": low, "high": high, "unit": "1"}))
        .collect();
    json!({"name": name, "status": status, "index": index, "alternatives": alternatives, "parameters": parameters,
           "evidence": {"gain": 100.0, "threshold": 10.0, "stability": 1.0, "gain_validation": 50.0},
           "excluded": [], "sentence": ""})
}

fn report(verdict: &str, effects: &[Value], untestable: &[&str], channels: &[&str]) -> Report {
    let untestable: Vec<Value> = untestable
        .iter()
        .map(|name| json!({"name": name, "because": "", "run_this": {}}))
        .collect();
    let value = json!({"format": "robopheus.diagnosis/1", "robot": "r", "data": [], "verdict": verdict, "sentence": "",
        "effects": effects, "absorbed": [], "rejected": [], "untestable": untestable,
        "where": {"sentence": "", "channels": channels, "shares": [], "segments": [], "regions": [],
                  "floor_map": {"cell_m": 0.2, "x_m": [], "y_m": [], "energy": []}},
        "gap": [{"channel": "pose", "horizon_s": 2.0, "unit": "m", "floor": 0.01, "before": 0.1, "after": 0.02,
                 "low": 0.01, "high": 0.03, "explained_fraction": 0.9}],
        "explained_fraction": 0.9, "floor_source": "references", "remarks": [], "next_experiment": null,
        "model": {"id": "m", "parent": null}, "seed": 1, "library_version": "1"});
    serde_json::from_value(value).expect("a report")
}

/// A truth whose pose shows `ratio` standard deviations, its yaw a quarter of that.
fn known(name: &str, index: Option<usize>, parameters: &[(&str, f64)], ratio: f64) -> Known {
    let truth = Truth {
        name: name.to_owned(),
        index,
        parameters: parameters
            .iter()
            .map(|(name, value)| ((*name).to_owned(), *value))
            .collect(),
    };
    let visible = Visible {
        ratios: vec![ratio, 0.25 * ratio, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
    };
    Known {
        drawn: truth.clone(),
        best: truth,
        detectable: visible.is_detectable(),
        visible,
        described: 1.0,
    }
}

fn sealed(kind: Kind, known: Vec<Known>) -> Sealed {
    Sealed {
        set: 0,
        seed: 0,
        kind,
        chassis: "diff2".to_owned(),
        known,
        unknown: None,
        unknown_visible: None,
        bundles: Vec::new(),
    }
}

fn never(_: &NamedEffect, _: &Known) -> bool {
    false
}

fn one(facts: &Facts, metric: &str) -> Option<f64> {
    facts.get(metric).map(|samples| {
        assert_eq!(samples.len(), 1, "{metric}");
        samples[0]
    })
}

#[test]
fn a_right_name_counts_with_its_error_interval_and_channel() {
    let sealed = sealed(
        Kind::Single,
        vec![known("wheel_radius", None, &[("relative", 0.04)], 5.0)],
    );
    let right = effect("wheel_radius", None, &[], &[("relative", 0.042, 0.0405, 0.0435)]);
    let facts = score(&sealed, &[report("confirmed", &[right], &[], &["pose"])], &never);
    assert_eq!(one(&facts, "right_first"), Some(1.0));
    assert_eq!(one(&facts, "in_set"), Some(1.0));
    assert_eq!(one(&facts, "in_set_loud"), Some(1.0));
    assert_eq!(one(&facts, "in_set_middle"), None);
    assert_eq!(one(&facts, "in_set_faint"), None);
    assert_eq!(one(&facts, "set_size"), Some(1.0));
    assert_eq!(one(&facts, "wrong_confirmed"), Some(0.0));
    assert!(one(&facts, "parameter_error").is_some_and(|error| (error - 0.05).abs() < 1e-12));
    assert_eq!(one(&facts, "covered"), Some(0.0));
    assert_eq!(one(&facts, "right_channel"), Some(1.0));
    assert_eq!(one(&facts, "explained_one"), Some(0.9));
    assert_eq!(one(&facts, "locked_worse"), Some(0.0));
    // The yaw shows a quarter of what the pose shows.
    let other = report("unexplained", &[], &[], &["yaw"]);
    let facts = score(&sealed, &[other], &never);
    assert_eq!(
        (one(&facts, "right_channel"), one(&facts, "right_first")),
        (Some(0.0), Some(0.0))
    );
}

#[test]
fn a_row_that_gets_worse_below_the_floor_is_told_apart() {
    let sealed = sealed(
        Kind::Single,
        vec![known("wheel_radius", None, &[("relative", 0.04)], 5.0)],
    );
    let right = effect("wheel_radius", None, &[], &[("relative", 0.042, 0.0405, 0.0435)]);
    let mut grown = report("confirmed", &[right], &[], &["pose"]);
    let worse = |report: &Report| {
        let facts = score(&sealed, std::slice::from_ref(report), &never);
        ["locked_worse", "locked_worse_above_floor"].map(|fact| one(&facts, fact))
    };
    let row = grown.gap.first_mut().expect("a row");
    (row.floor, row.before, row.after) = (0.1, 0.04, 0.05);
    assert_eq!(worse(&grown), [Some(1.0), Some(0.0)]);
    let row = grown.gap.first_mut().expect("a row");
    (row.before, row.after) = (0.09, 0.11);
    assert_eq!(worse(&grown), [Some(1.0); 2]);
}

#[test]
fn another_wheel_is_wrong_and_an_alternative_is_in_the_set() {
    let sealed = sealed(
        Kind::Single,
        vec![known("wheel_radius_one", Some(1), &[("relative", 0.02)], 5.0)],
    );
    let wrong = effect("wheel_radius_one", Some(0), &[], &[("relative", 0.02, 0.01, 0.03)]);
    let facts = score(
        &sealed,
        &[report("confirmed", std::slice::from_ref(&wrong), &[], &["pose"])],
        &never,
    );
    assert_eq!(
        (one(&facts, "right_first"), one(&facts, "wrong_confirmed")),
        (Some(0.0), Some(1.0))
    );
    assert_eq!(one(&facts, "wrong_under_confirmed_verdict"), Some(1.0));
    assert_eq!(facts.get("parameter_error"), None);
    // Effects that change the runs alike are one name.
    let alike = |_: &NamedEffect, _: &Known| true;
    let facts = score(&sealed, &[report("partial", &[wrong], &[], &["pose"])], &alike);
    assert_eq!(
        (one(&facts, "right_first"), one(&facts, "wrong_confirmed")),
        (Some(1.0), Some(0.0))
    );
    let open = effect("encoder_scale", Some(1), &["wheel_radius_one"], &[]);
    let facts = score(&sealed, &[report("ambiguous", &[open], &[], &["pose"])], &never);
    assert_eq!(
        (one(&facts, "right_first"), one(&facts, "in_set")),
        (Some(0.0), Some(1.0))
    );
    assert_eq!(
        (one(&facts, "set_size"), one(&facts, "wrong_confirmed")),
        (Some(2.0), Some(0.0))
    );
}

#[test]
fn what_does_not_show_is_not_asked_for() {
    let sealed = sealed(
        Kind::Single,
        vec![known("thermal_drift", None, &[("relative", 0.2)], 0.1)],
    );
    let facts = score(&sealed, &[report("no_discrepancy", &[], &[], &[])], &never);
    assert_eq!(facts.get("right_first"), None);
    assert_eq!(one(&facts, "undetectable_named"), Some(0.0));
}

#[test]
fn components_of_a_vector_count_against_its_length() {
    let sealed = sealed(
        Kind::Single,
        vec![known("floor_tilt", None, &[("x", 0.03), ("y", -0.04)], 9.0)],
    );
    let tilt = effect(
        "floor_tilt",
        None,
        &[],
        &[("x", 0.035, 0.02, 0.04), ("y", -0.04, -0.05, -0.03)],
    );
    let facts = score(&sealed, &[report("confirmed", &[tilt], &[], &["pose"])], &never);
    let errors = facts.get("parameter_error").cloned().unwrap_or_default();
    assert!((errors[0] - 0.1).abs() < 1e-12 && errors[1].abs() < 1e-12, "{errors:?}");
    assert_eq!(facts.get("covered"), Some(&vec![1.0, 1.0]));
}

#[test]
fn nothing_pairs_unknowns_and_poor_runs() {
    let any = effect("floor_friction", None, &[], &[("scale", 0.5, 0.4, 0.6)]);
    let nothing = sealed(Kind::None, Vec::new());
    let facts = score(
        &nothing,
        &[report("confirmed", std::slice::from_ref(&any), &[], &[])],
        &never,
    );
    assert_eq!(
        (one(&facts, "named_nothing_there"), one(&facts, "wrong_confirmed")),
        (Some(1.0), Some(1.0))
    );
    let facts = score(&nothing, &[report("no_discrepancy", &[], &[], &[])], &never);
    assert_eq!(
        (one(&facts, "named_nothing_there"), one(&facts, "wrong_confirmed")),
        (Some(0.0), Some(0.0))
    );

    let two = vec![
        known("floor_friction", None, &[("scale", 0.5)], 9.0),
        known("command_delay", None, &[("delay", 0.05)], 9.0),
    ];
    let facts = score(
        &sealed(Kind::Pair, two),
        &[report("partial", std::slice::from_ref(&any), &[], &[])],
        &never,
    );
    assert_eq!(
        (one(&facts, "both_named"), one(&facts, "one_named")),
        (Some(0.0), Some(1.0))
    );

    let mut unknown = sealed(Kind::Unknown, Vec::new());
    unknown.unknown = Some("force_hill".to_owned());
    unknown.unknown_visible = Some(Visible { ratios: vec![3.0] });
    for (verdict, open) in [
        ("unexplained", 1.0),
        ("partial", 1.0),
        ("confirmed", 0.0),
        ("no_discrepancy", 0.0),
    ] {
        let facts = score(&unknown, &[report(verdict, &[], &[], &[])], &never);
        assert_eq!(one(&facts, "unknown_left_open"), Some(open), "{verdict}");
    }

    let poor = sealed(Kind::Poor, vec![known("gyro_scale", None, &[("relative", 0.02)], 0.01)]);
    let facts = score(&poor, &[report("no_discrepancy", &[], &["gyro_scale"], &[])], &never);
    assert_eq!(
        (
            one(&facts, "unexcited_not_named"),
            one(&facts, "unexcited_listed_untestable")
        ),
        (Some(1.0), Some(1.0))
    );
    let guess = effect("gyro_scale", None, &[], &[]);
    let facts = score(&poor, &[report("confirmed", &[guess], &[], &[])], &never);
    assert_eq!(one(&facts, "unexcited_not_named"), Some(0.0));
}

#[test]
fn halves_and_rounds() {
    let truth = vec![known("floor_friction", None, &[("scale", 0.5)], 9.0)];
    let same = [report("confirmed", &[], &[], &[]), report("confirmed", &[], &[], &[])];
    let facts = score(&sealed(Kind::Halves, truth.clone()), &same, &never);
    assert_eq!(one(&facts, "halves_same_verdict"), Some(1.0));
    let other = [report("confirmed", &[], &[], &[]), report("partial", &[], &[], &[])];
    let facts = score(&sealed(Kind::Halves, truth.clone()), &other, &never);
    assert_eq!(one(&facts, "halves_same_verdict"), Some(0.0));

    let mut rounds = [
        report("confirmed", &[], &[], &[]),
        report("no_discrepancy", &[], &[], &[]),
    ];
    rounds[1].gap[0].before = 0.02;
    let facts = score(&sealed(Kind::Rounds, truth.clone()), &rounds, &never);
    assert_eq!(one(&facts, "gap_rose"), Some(0.0));
    rounds[1].gap[0].before = 0.11;
    let facts = score(&sealed(Kind::Rounds, truth), &rounds, &never);
    assert_eq!(one(&facts, "gap_rose"), Some(1.0));
}

#[test]
fn what_is_in_the_set_is_counted_by_how_far_it_shows() {
    for (ratio, metric) in [(2.0, "in_set_loud"), (1.9, "in_set_middle"), (0.9, "in_set_faint")] {
        let sealed = sealed(Kind::Single, vec![known("gyro_bias", None, &[("bias", 0.02)], ratio)]);
        let named = effect("gyro_bias", None, &[], &[("bias", 0.02, 0.01, 0.03)]);
        let facts = score(&sealed, &[report("confirmed", &[named], &[], &["pose"])], &never);
        assert_eq!(one(&facts, metric), Some(1.0));
        let facts = score(&sealed, &[report("unexplained", &[], &[], &["pose"])], &never);
        assert_eq!(one(&facts, metric), Some(0.0));
        let rows = ["in_set_loud", "in_set_middle", "in_set_faint"];
        assert_eq!(
            rows.iter().filter(|row| facts.contains_key(**row)).count(),
            1,
            "{ratio}"
        );
    }
}
