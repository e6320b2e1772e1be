//! Pairs of effects of which the second shows on other channels than the first, or the first is another's likeness until the second is known.

mod common;

use common::{diagnosed, named, size};
use identify::report::Report;
use identify::report::schema::Verdict;

/// A car of which the tracker is late, and whose track width moves motor currents and hardly anything else.
#[test]
#[ignore = "one to two minutes: cargo xtask soak names"]
fn a_track_width_is_named_beside_a_latency() {
    let report = diagnosed("pair", 330, 1, &["localization_latency", "track_width"]);
    assert_eq!(named(&report), [("localization_latency", None), ("track_width", None)]);
    let width = size(&report, 1);
    assert!((width + 0.0815).abs() < 0.01, "{width}");
}

/// A car with a toe of 0.0228 rad of a rear wheel and a marker turned by 0.0180 rad: alone an offset of the steering explains more than the toe, and
/// the marker beside it is half as far off.
#[test]
#[ignore = "one to two minutes: cargo xtask soak names"]
fn a_toe_that_a_steering_offset_stood_in_for_is_named_beside_a_marker() {
    let report = diagnosed("pair", 334, 6, &["wheel_misalignment", "marker_offset"]);
    assert_eq!(
        named(&report),
        [("wheel_misalignment", Some(2)), ("marker_offset", None)]
    );
    assert!((size(&report, 0) - 0.0228).abs() < 0.004, "toe {}", size(&report, 0));
    assert!((size(&report, 1) - 0.0180).abs() < 0.003, "yaw {}", size(&report, 1));
    let others: Vec<&str> = report.effects[0]
        .excluded
        .iter()
        .map(|other| other.name.as_str())
        .collect();
    assert!(others.contains(&"steering_offset"), "{others:?}");
}

/// A robot with wheels 0.7 % larger, of which the tracker is 17 ms late: with the wheels six points less of the validation runs' gap are explained, and a scale of
/// the poses, which explains less of the runs, once stood in their place.
#[test]
#[ignore = "one to two minutes: cargo xtask soak names"]
fn larger_wheels_that_both_sides_agree_on_are_named_although_the_gap_grows() {
    let report = diagnosed("pair", 337, 16, &["wheel_radius", "localization_latency"]);
    assert_eq!(named(&report), [("localization_latency", None), ("wheel_radius", None)]);
    assert!(
        (size(&report, 0) - 0.01745).abs() < 0.003,
        "latency {}",
        size(&report, 0)
    );
    assert!(
        (size(&report, 1) - 0.00706).abs() < 0.001,
        "radius {}",
        size(&report, 1)
    );
}

/// A robot with an eccentric wheel that loses a quarter of its set-points: the wheel is a small part of what is wrong, and losses explain half of the rest.
#[test]
fn lost_set_points_are_found_beside_an_eccentric_wheel() {
    let report = diagnosed("pair", 338, 17, &["wheel_eccentricity", "command_hold"]);
    assert_eq!(
        named(&report),
        [("wheel_eccentricity", Some(0)), ("command_hold", None)]
    );
    assert!(
        (size(&report, 0) - 0.0183).abs() < 0.003,
        "amplitude {}",
        size(&report, 0)
    );
    assert!((size(&report, 1) - 0.235).abs() < 0.06, "share {}", size(&report, 1));
}

/// A robot 6 % wider than described with a turned marker: the width that explains most differs from stretch to stretch, and its interval is wide for that alone.
#[test]
#[ignore = "one to two minutes: cargo xtask soak names"]
fn a_size_that_differs_from_stretch_to_stretch_is_listed_beside_a_sure_one() {
    let report = diagnosed("pair", 337, 19, &["marker_offset", "track_width"]);
    assert_eq!(named(&report), [("marker_offset", None), ("track_width", None)]);
    assert!((size(&report, 1) - 0.0616).abs() < 0.01, "width {}", size(&report, 1));
    assert_eq!(report.effects[1].status, "ambiguous");
}

/// A car that may not speed up as fast as it did, and beside that a load, or none.
#[test]
#[ignore = "one to two minutes: cargo xtask soak names"]
fn what_may_be_none_is_not_confirmed_beside_what_explains_more() {
    let report = diagnosed("single:acceleration_limit", 402, 168, &["acceleration_limit"]);
    let status = |name: &str| {
        let found = report.effects.iter().find(|effect| effect.name == name);
        found.map(|effect| effect.status.as_str())
    };
    assert_eq!(status("acceleration_limit"), Some("confirmed"));
    assert_eq!(status("payload"), Some("ambiguous"));
    let is_told =
        |remark: &String| remark.starts_with("payload") && remark.contains("make up for what acceleration_limit");
    assert!(report.remarks.iter().any(is_told), "{:?}", report.remarks);
}

/// A battery that runs down, on a robot whose gears have some play as ever.
#[test]
#[ignore = "one to two minutes: cargo xtask soak names"]
fn what_the_references_have_as_well_is_no_name_beside_another() {
    let report = diagnosed("single:battery_droop", 402, 2, &["battery_droop"]);
    assert_eq!(named(&report), [("battery_droop", None)]);
    assert_eq!(report.verdict, Verdict::Confirmed);
    assert!(report.absorbed.iter().any(|absorbed| absorbed.name == "gear_backlash"));
}

/// Why an effect is none beside the first name.
fn refused<'a>(report: &'a Report, name: &str) -> &'a str {
    let mut all = report.effects[0].excluded.iter().chain(&report.rejected);
    let other = all.find(|other| other.name == name);
    other.map_or("", |other| other.because.as_str())
}

/// Wheels that do not run straight, beside which a floor with a tenth too little grip once stood, or none: the references have it as well. A steering that
/// stands off its middle is still the same to these runs.
#[test]
#[ignore = "one to two minutes: cargo xtask soak names"]
fn a_floor_that_the_references_have_as_well_is_no_name_beside_another() {
    let report = diagnosed("single:wheel_misalignment", 402, 82, &["wheel_misalignment"]);
    assert_eq!(named(&report), [("wheel_misalignment", Some(0))]);
    assert_eq!(report.effects[0].alternatives, ["steering_offset"]);
    let because = refused(&report, "floor_friction");
    assert!(because.contains("is in the references as well"), "{because}");
}

/// Wheels 3.5 % smaller, beside which a moment of sliding once became a confirmed floor with 0.87 of its friction.
#[test]
#[ignore = "one to two minutes: cargo xtask soak names"]
fn a_moment_of_sliding_is_no_floor_beside_larger_wheels() {
    let report = diagnosed("single:wheel_radius", 401, 165, &["wheel_radius"]);
    assert_eq!(named(&report), [("wheel_radius", None)]);
    assert_eq!(report.effects[0].status, "confirmed");
    assert_eq!(report.verdict, Verdict::Confirmed);
    let because = refused(&report, "floor_friction");
    assert!(because.contains("is in the references as well"), "{because}");
}
