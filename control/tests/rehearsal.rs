//! The shipped examples in the twin.

mod common;

use common::{EXPERIMENTS, example, parsed};
use control::rehearsal::{Outcome, PATH_BAND_M, Rehearsal, rehearse_json};

fn rehearsed(name: &str) -> Outcome {
    rehearse_json(&example(name).to_string()).unwrap_or_else(|problems| panic!("{name}: {problems:#?}"))
}

#[test]
fn every_example_is_accepted_without_findings_and_repeats_bit_for_bit() {
    for (name, _) in EXPERIMENTS {
        let first = rehearsed(name);
        println!(
            "{name}: {} ({:.2} s, path error {:?}, separation {:?}, wall {:.3} m)",
            first.verdict.sentence,
            first.verdict.ticks as f64 / 120.0,
            first.verdict.largest_path_error_m,
            first.verdict.smallest_separation_m,
            first.verdict.smallest_wall_distance_m
        );
        assert!(
            first.verdict.accepted && first.verdict.findings.is_empty(),
            "{name}: {:#?}",
            first.verdict
        );
        assert_eq!(first.verdict.digest.len(), 32);
        assert_eq!(first, rehearsed(name), "{name}");
    }
}

#[test]
fn paths_stay_inside_the_band() {
    for name in ["rectangle-omni4", "rectangle-diff2"] {
        let error_m = rehearsed(name).verdict.largest_path_error_m.expect("a path");
        assert!(error_m < PATH_BAND_M, "{name}: {error_m} m");
    }
}

#[test]
fn corner_swap_finishes_in_time_and_apart() {
    let verdict = rehearsed("swap-corners").verdict;
    assert!(verdict.ticks < 30 * 120, "{} ticks", verdict.ticks);
    assert!(
        verdict.smallest_separation_m.expect("several robots") > 0.02,
        "{verdict:#?}"
    );
    assert_eq!(verdict.largest_path_error_m, None);
}

#[test]
fn verdict_and_replay_are_the_wire_types() {
    for (name, _) in EXPERIMENTS {
        let outcome = rehearsed(name);
        let verdict = serde_json::to_value(&outcome.verdict).expect("verdict");
        let wire: api::verdict::Verdict = serde_json::from_value(verdict.clone()).expect("api verdict");
        assert_eq!(serde_json::to_value(&wire).expect("wire"), verdict, "{name}");
        let replay = serde_json::to_value(&outcome.replay).expect("replay");
        let wire: api::verdict::Replay = serde_json::from_value(replay.clone()).expect("api replay");
        assert_eq!(serde_json::to_value(&wire).expect("wire"), replay, "{name}");
        let frames = wire.robots[0].poses.len() as u64;
        assert!(
            frames >= outcome.verdict.ticks / 4 && frames <= outcome.verdict.ticks / 4 + 2,
            "{frames} frames"
        );
    }
}

#[test]
fn too_short_a_run_warns_about_the_target() {
    let mut document = example("rectangle-omni4");
    document["experiment"]["duration_s"] = serde_json::json!(2.0);
    let verdict = rehearse_json(&document.to_string()).expect("rehearsal").verdict;
    assert!(verdict.accepted);
    assert_eq!(verdict.ticks, 240);
    let finding = &verdict.findings[0];
    assert_eq!(
        (
            finding.code.as_str(),
            finding.robots[0].as_str(),
            finding.unit.as_deref()
        ),
        ("target_not_reached", "omni-01", Some("m"))
    );
    assert!((finding.at_s - 2.0).abs() < 1e-9 && finding.value.expect("figure") > 0.03);
}

/// A law of one's own cannot get past the filter: full speed into a wall and into each other ends without contact.
#[test]
fn a_reckless_law_makes_no_contact() {
    let document = example("swap-corners");
    let scenario = parsed(&document);
    for (forward, left) in [
        (5.0, 0.0),
        (-5.0, 3.0),
        (0.0, 9.0),
        (f64::NAN, 0.0),
        (f64::INFINITY, 1.0),
    ] {
        let twist = twin::twist::BodyTwist {
            forward_m_per_s: forward,
            left_m_per_s: left,
            yaw_rate_rad_per_s: 1.0,
        };
        let law = Box::new(control::law::Push { twists: vec![twist; 4] });
        let team = control::team::Team::with_law(&scenario, law).expect("team");
        let mut rehearsal = Rehearsal::with_team(&scenario, team).expect("rehearsal");
        while rehearsal.step() {}
        let verdict = rehearsal.finish().verdict;
        println!(
            "{forward} {left}: separation {:?} wall {:.4}",
            verdict.smallest_separation_m, verdict.smallest_wall_distance_m
        );
        assert!(verdict.accepted, "{forward} {left}: {:#?}", verdict.findings);
        assert!(verdict.smallest_wall_distance_m > 0.0 && verdict.smallest_separation_m.expect("robots") > 0.0);
    }
}
