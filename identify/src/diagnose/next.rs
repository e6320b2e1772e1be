//! The run that would tell more.

use serde_json::{Value, json};
use twin::effect::library::{EffectEntry, find};
use twin::robot::RobotDescription;

use super::Case;
use super::nearest::suspect;
use crate::hypothesis::{LOST, applies};
use crate::record::{CHANNELS, Stages};
use crate::report::schema::{NamedEffect, NextExperiment, Untestable, Verdict};

/// So many effects a sentence names.
const LISTED: usize = 3;

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
    let open: Vec<&str> = untestable
        .iter()
        .map(|open| open.name.as_str())
        .filter(|name| find(name).is_some_and(|entry| applies(entry, robot)))
        .collect();
    // What may be behind an open gap comes before what is merely not known.
    let suspects: Vec<&str> = match case.located.channels.first() {
        Some((class, _)) if verdict == Verdict::Unexplained => open
            .iter()
            .copied()
            .filter(|name| acts_on(case, name, *class))
            .collect(),
        _ => Vec::new(),
    };
    let (number, shown) = most_shown(&suspects).or_else(|| most_shown(&open))?;
    Some(NextExperiment {
        why: format!("makes {} testable", listed(&shown)),
        experiment: experiment(number, robot),
    })
}

/// An effect may change a channel.
fn acts_on(case: &Case, name: &str, class: usize) -> bool {
    let is_rolling = matches!(CHANNELS[class], "gyro" | "pose" | "yaw");
    let mut own = case.candidates.iter().filter(|candidate| candidate.entry.name == name);
    let acts = |stages: Stages| if is_rolling { stages.rolling } else { stages.drive };
    own.any(|candidate| acts(candidate.stages)) || (name == LOST && !is_rolling)
}

/// The manoeuvre that shows most of some effects, the shortest of several, and which ones.
fn most_shown<'a>(open: &[&'a str]) -> Option<(usize, Vec<&'a str>)> {
    let shown = |number: usize| -> Vec<&'a str> { open.iter().copied().filter(|name| of(name) == number).collect() };
    let all = (0..CATALOGUE.len()).map(|number| (number, shown(number)));
    all.filter(|(_, shown)| !shown.is_empty()).min_by(|a, b| {
        let by_count = b.1.len().cmp(&a.1.len());
        by_count.then(CATALOGUE[a.0].1.total_cmp(&CATALOGUE[b.0].1))
    })
}

/// Effects in words; of many the first ones.
fn listed(names: &[&str]) -> String {
    let mut words: Vec<String> = names.iter().take(LISTED).map(|name| name.replace('_', " ")).collect();
    if names.len() > LISTED {
        words.push(format!("{} more", names.len() - LISTED));
    }
    match words.split_last() {
        Some((last, others)) if !others.is_empty() => format!("{} and {last}", others.join(", ")),
        _ => words.concat(),
    }
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_manoeuvre_that_shows_most_is_next_and_the_shorter_of_two() {
        let open = [
            "thermal_drift",
            "gyro_scale",
            "pose_scale",
            "rolling_shutter",
            "asymmetric_friction",
            "lens_distortion",
        ];
        let (number, shown) = most_shown(&open).expect("something is open");
        assert_eq!(CATALOGUE[number].0, "field_grid");
        assert_eq!(shown, ["pose_scale", "rolling_shutter", "lens_distortion"]);
        let (number, _) = most_shown(&open[..3]).expect("something is open");
        assert_eq!(CATALOGUE[number].0, "speed_steps", "20 s, not 60");
        assert_eq!(most_shown(&[]), None);
    }

    #[test]
    fn a_sentence_names_three_effects() {
        assert_eq!(listed(&["gyro_scale"]), "gyro scale");
        assert_eq!(listed(&["gyro_scale", "pose_scale"]), "gyro scale and pose scale");
        let many = ["gyro_scale", "pose_scale", "payload", "floor_tilt", "cable_drag"];
        assert_eq!(listed(&many), "gyro scale, pose scale, payload and 2 more");
    }
}
