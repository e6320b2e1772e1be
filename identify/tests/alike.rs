//! What seems to have happened to the floor may be a calibration that references left open: one robot then explains references and runs alike.

mod plant;
mod threads;

use identify::diagnose::{Run, calibrated_floor};
use identify::floor::{Floor, Named};
use identify::hypothesis::{Knob, realised};
use identify::record::{Record, Stages};
use plant::replayed::of_the_twin_with;
use plant::{Change, robot, run};
use threads::Threads;
use twin::effect::Effect;
use twin::robot::RobotDescription;
use twin::tread::Tread;

const CHASSIS: &str = "omni4";
/// Gain that an effect needs to be named: of a library without an effect.
const LEAST: f64 = 35.0;
const SLIPPERY: f64 = 0.75;

/// Runs of the twin on sliding tyres and a floor a little grippier than described.
fn runs(first_seed: u64, effects: &[Effect]) -> Vec<Run> {
    let description = robot(CHASSIS);
    let changed = RobotDescription {
        floor_friction: 1.05 * description.floor_friction,
        tread: Some(Tread {
            slip_scale_m_per_s: 0.005,
            creep: 0.02,
            tail: 0.3,
            sliding: 0.9,
        }),
        ..description.clone()
    };
    let driven = |k: u64| {
        run(
            &format!("run-{k}"),
            &description,
            &Change::none(),
            first_seed + k,
            20,
            true,
        )
    };
    (0..4)
        .map(|k| of_the_twin_with(driven(k), changed.clone(), effects, first_seed + k))
        .collect()
}

/// The friction of a floor over the described one, and what one calibration of references and runs makes of `scale`.
///
/// - `least`: gain that an effect needs.
fn alike(floor: &Floor, runs: &[Run], scale: f64, least: f64) -> Option<f64> {
    alike_beside(floor, runs, &[], scale, least)
}

/// The same with others named in the runs.
fn alike_beside(floor: &Floor, runs: &[Run], others: &[Effect], scale: f64, least: f64) -> Option<f64> {
    let with = [others, &[Effect::new("floor_friction", &[("scale", scale)])]].concat();
    let named = Named {
        with: &with,
        without: others,
        scale,
    };
    let records: Vec<Record> = runs.iter().map(|run| Record::of(&run.path, &run.bundle)).collect();
    let stages = vec![Stages::BOTH; floor.knobs.len()];
    let found = floor.alike(&Threads(2), &stages, &records, named, least);
    let found = found.unwrap_or_else(|error| panic!("{error}"));
    found.map(|found| found.model.description.floor_friction / robot(CHASSIS).floor_friction)
}

#[test]
fn a_calibration_that_is_off_is_found_out_and_a_slippery_floor_is_not_explained_away() {
    let references = runs(840, &[]);
    let floor = calibrated_floor(&Threads(2), &references, None).unwrap_or_else(|error| panic!("{error}"));
    let slippery = [Effect::new("floor_friction", &[("scale", SLIPPERY)])];
    let slippery = runs(850, &slippery);
    assert_eq!(alike(&floor, &slippery, SLIPPERY, LEAST), None, "the floor has changed");
    assert_eq!(
        alike(&floor, &slippery, SLIPPERY, f64::MAX),
        None,
        "and the references speak against it, whatever the runs gain"
    );
    let hardly = 0.95;
    let changed = runs(850, &[Effect::new("floor_friction", &[("scale", hardly)])]);
    assert!(
        alike(&floor, &changed, hardly, f64::MAX).is_some(),
        "of a floor that is hardly slippery nothing but what the effect is better by speaks for it"
    );

    // As a calibration on references that slide too little may end: a floor as much grippier as the effect takes away.
    let mut off = floor.clone();
    let friction = off.knobs.iter().position(Knob::is_friction).expect("a knob");
    let Knob::Parameter { practical, .. } = off.knobs[friction] else {
        panic!("of an effect");
    };
    off.values[friction] = ((1.0 + practical * off.values[friction]) / SLIPPERY - 1.0) / practical;
    off.model = realised(&off.given, &off.knobs, &off.values);
    let found = alike(&off, &runs(850, &[]), SLIPPERY, LEAST).expect("one robot explains all");
    let was = off.model.description.floor_friction / robot(CHASSIS).floor_friction;
    println!("friction {found}, the calibration's {was}");
    assert!((found - 1.05).abs() < 0.1 && was > 1.2, "{found} {was}");

    let load = [Effect::new("payload", &[("mass", 3.0), ("inertia", 0.05)])];
    let loaded = runs(850, &load);
    let found = alike_beside(&off, &loaded, &load, SLIPPERY, LEAST).expect("one robot with a load explains all");
    assert!((found - 1.05).abs() < 0.1, "{found} beside a load");
}
