//! The run that would tell more.

use serde_json::{Value, json};
use twin::effect::library::{EffectEntry, find};
use twin::robot::RobotDescription;

use super::Case;
use super::nearest::suspect;
use crate::report::schema::{NamedEffect, NextExperiment, Untestable, Verdict};

/// Manoeuvres by what shows an effect: name, duration, s, and what is done.
const CATALOGUE: [(&str, f64, &str); 9] = [
    (
        "slow_ramps",
        20.0,
        "slow ramps of the wheel speeds through zero, both ways, with stops",
    ),
    (
        "speed_steps",
        20.0,
        "steps between several steady speeds, forward and backward",
    ),
    (
        "random_steps",
        30.0,
        "randomly spaced steps of all sizes up to the limits",
    ),
    ("spins", 20.0, "turns on the spot at several rates, left and right"),
    (
        "straight_lines",
        30.0,
        "straight lines over the whole field, forward and backward",
    ),
    ("compass", 40.0, "the same straight line at eight headings"),
    ("circles", 30.0, "circles left and right at rising speed"),
    ("field_grid", 60.0, "slow passes over the whole field in lanes of 0.3 m"),
    ("strafes", 20.0, "sideways and diagonal passes"),
];

/// Which manoeuvre shows an effect.
fn of(name: &str) -> usize {
    match name {
        "coulomb_friction" | "stribeck_friction" | "command_dead_band" | "gear_backlash" | "steering_backlash" => 0,
        "viscous_friction" | "asymmetric_friction" | "battery_droop" | "thermal_drift" | "wheel_eccentricity" => 1,
        "track_width" | "gyro_bias" | "gyro_scale" | "localization_latency" | "caster_swivel" => 3,
        "wheel_radius" | "wheel_radius_one" | "wheel_misalignment" | "encoder_scale" | "marker_offset" => 4,
        "pose_scale" | "lens_distortion" | "camera_seam" | "tag_height" | "rolling_shutter" | "low_friction_patch" => 7,
        "floor_tilt" | "carpet_grain" | "cable_drag" | "rolling_resistance" => 5,
        "lateral_slip" | "floor_friction" | "center_of_mass_offset" | "steering_offset" | "steering_scale" => 6,
        "roller_drag" => 8,
        _ => 2,
    }
}

/// A catalogue entry as a draft of an experiment.
fn experiment(number: usize, robot: &RobotDescription) -> Value {
    let (name, duration_s, what) = CATALOGUE[number];
    json!({
        "format": "robopheus.experiment/1",
        "manoeuvre": name,
        "what": what,
        "robots": [{"name": robot.name, "chassis": robot.chassis}],
        "duration_s": duration_s,
        "repeat": 3,
    })
}

/// The run for an untestable effect.
pub(super) fn manoeuvre(entry: &EffectEntry, robot: &RobotDescription) -> Value {
    experiment(of(entry.name), robot)
}

/// The run that separates what is left open.
pub(super) fn next_experiment(
    case: &Case,
    verdict: Verdict,
    effects: &[NamedEffect],
    untestable: &[Untestable],
) -> Option<NextExperiment> {
    let robot = &case.floor.given.description;
    let pick = |name: &str, why: String| NextExperiment {
        why,
        experiment: experiment(of(name), robot),
    };
    if let Some(effect) = effects.iter().find(|effect| !effect.alternatives.is_empty()) {
        let other = &effect.alternatives[0];
        // The manoeuvre of the one that the present runs show less.
        let name = if of(&effect.name) == of(other) {
            other
        } else {
            weaker(case, &effect.name, other)
        };
        return Some(pick(
            name,
            format!(
                "tells {} from {}",
                effect.name.replace('_', " "),
                effect.alternatives.join(", ").replace('_', " ")
            ),
        ));
    }
    if let (Verdict::Partial | Verdict::Unexplained, Some(suspect)) = (verdict, suspect(case)) {
        let name = suspect.member.candidate.entry.name;
        let plain = name.replace('_', " ");
        let is_weak = case.taken.iter().any(|taken| taken.is_shown_together);
        let why = if suspect.is_unshown {
            format!("shows whether it is {plain}: too few of these runs do")
        } else if is_weak {
            format!("shows whether it is {plain}: these runs show it too little to check it")
        } else {
            format!("shows whether it is {plain}, and how much: these runs do not agree on it")
        };
        return Some(pick(name, why));
    }
    if let (Verdict::Unexplained, Some(name)) = (verdict, case.alike) {
        let plain = name.replace('_', " ");
        return Some(pick(
            name,
            format!("shows whether it is {plain}: another calibration does without it, and leaves a gap"),
        ));
    }
    if verdict == Verdict::Partial {
        return Some(NextExperiment {
            why: "shows the gap once more, to prove the effect on runs that were not used".to_owned(),
            experiment: experiment(2, robot),
        });
    }
    let open = untestable.iter().find(|open| {
        let known = find(&open.name).is_some_and(|entry| crate::hypothesis::applies(entry, robot));
        known && open.name != "command_hold"
    })?;
    Some(pick(
        &open.name,
        format!("makes {} testable", open.name.replace('_', " ")),
    ))
}

fn weaker<'a>(case: &Case, a: &'a str, b: &'a str) -> &'a str {
    let sensitivity = |name: &str| {
        case.candidates
            .iter()
            .zip(&case.first_scores)
            .filter(|(candidate, _)| candidate.entry.name == name)
            .map(|(_, score)| score.sensitivity)
            .fold(0.0, f64::max)
    };
    if sensitivity(a) < sensitivity(b) { a } else { b }
}
