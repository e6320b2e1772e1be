//! The run that would tell more.

use serde_json::{Value, json};
use twin::effect::library::{EffectEntry, find};
use twin::robot::RobotDescription;

use super::Case;
use super::apart::{REPEAT, furthest};
use super::manoeuvre::{CATALOGUE, Manoeuvre, RANDOM_STEPS};
use super::nearest::suspect;
use crate::fit::Member;
use crate::hypothesis::{Candidate, LOST, applies};
use crate::record::{CHANNELS, Stages};
use crate::report::plain;
use crate::report::schema::{NamedEffect, NextExperiment, Untestable, Verdict};
use crate::select::{Finalist, PLACE};
use crate::workers::{Cancelled, Workers};

/// So many effects a sentence names.
const LISTED: usize = 3;

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
    let Manoeuvre { name, duration_s, what } = CATALOGUE[number];
    json!({
        "format": "robopheus.experiment/1",
        "manoeuvre": name,
        "what": what,
        "robots": [{"name": robot.name, "chassis": robot.chassis}],
        "duration_s": duration_s,
        "repeat": REPEAT,
    })
}

/// The run for an untestable effect.
pub(super) fn manoeuvre(entry: &EffectEntry, robot: &RobotDescription) -> Value {
    experiment(of(entry.name), robot)
}

/// What is proposed.
pub(super) struct Proposed {
    pub next: Option<NextExperiment>,
    /// Names that these runs cannot tell apart would not be told apart by any manoeuvre either.
    pub is_told_by_none: bool,
}

/// The run that separates what is left open.
///
/// Of names that these runs cannot tell apart, and of what is suspected, all manoeuvres are driven by the twin with each of them at its fitted size;
/// the one after which they are furthest apart, in noise and everyday differences, is taken (DISCREPANCY 2.9).
pub(super) fn next_experiment(
    workers: &dyn Workers,
    case: &Case,
    verdict: Verdict,
    effects: &[NamedEffect],
    untestable: &[Untestable],
) -> Result<Proposed, Cancelled> {
    let of_runs = |next: Option<NextExperiment>| Proposed {
        next,
        is_told_by_none: false,
    };
    if let Some(effect) = effects.iter().find(|effect| !effect.alternatives.is_empty()) {
        let is_alone = suspect(case).is_none() && effects.iter().filter(|one| one.status != "confirmed").count() == 1;
        return telling(workers, case, effect, is_alone);
    }
    if let (Verdict::Partial | Verdict::Unexplained, Some(suspect)) = (verdict, suspect(case)) {
        return Ok(of_runs(Some(showing(workers, case, suspect)?)));
    }
    Ok(of_runs(without_trial(case, verdict, untestable)))
}

/// The run that tells a name from those that these runs cannot tell from it.
fn telling(workers: &dyn Workers, case: &Case, effect: &NamedEffect, is_alone: bool) -> Result<Proposed, Cancelled> {
    let taken = case.taken.iter().find(|taken| taken.is(&effect.name, effect.index));
    let members = members_of(case);
    let own = taken.map(|taken| &taken.finalist.member.candidate);
    let rivals: Vec<&Member> = taken.map_or_else(Vec::new, |taken| {
        let is_told = |rival: &&Member| {
            effect
                .alternatives
                .iter()
                .any(|other| other == rival.candidate.entry.name)
        };
        taken.rivals.iter().filter(is_told).collect()
    });
    let is_known = own.is_some_and(|own| members.iter().any(|member| member.candidate.is_same(own)));
    let name = plain(&effect.name);
    if is_known {
        let others = without(&members, own);
        let with = |rival: &Member| [&others[..], core::slice::from_ref(rival)].concat();
        let models: Vec<(&str, Vec<Member>)> = rivals
            .iter()
            .map(|rival| (rival.candidate.entry.name, with(rival)))
            .collect();
        if let Some(apart) = furthest(workers, case, &members, &models)? {
            let why = match apart.told.is_empty() {
                false => format!("tells {name} from {}: {}", listed(&apart.told), apart.words("them")),
                true => format!(
                    "comes nearest to telling {name} from {}: {}",
                    plain(apart.furthest),
                    apart.words("them")
                ),
            };
            return Ok(Proposed {
                next: Some(pick(case, apart.number, why)),
                is_told_by_none: is_alone && apart.is_vain,
            });
        }
    }
    // The manoeuvre of the one that the present runs show less.
    let other = &effect.alternatives[0];
    let shown = if of(&effect.name) == of(other) {
        other
    } else {
        weaker(case, &effect.name, other)
    };
    let why = format!("tells {name} from {}", plain(&effect.alternatives.join(", ")));
    Ok(Proposed {
        next: Some(pick(case, of(shown), why)),
        is_told_by_none: false,
    })
}

/// The run that shows whether there is what is suspected.
fn showing(workers: &dyn Workers, case: &Case, suspect: &Finalist) -> Result<NextExperiment, Cancelled> {
    let name = suspect.member.candidate.entry.name;
    let words = plain(name);
    let is_weak = case.taken.iter().any(|taken| taken.is_shown_together);
    let why = if suspect.is_unshown {
        format!("shows whether it is {words}: too few of these runs do")
    } else if is_weak {
        format!("shows whether it is {words}: these runs show it too little to check it")
    } else {
        format!("shows whether it is {words}, and how much: these runs do not agree on it")
    };
    // It acts somewhere alone, where a trial may not come by.
    if name == PLACE {
        return Ok(pick(case, of(name), why));
    }
    let others = without(&members_of(case), Some(&suspect.member.candidate));
    let with = [&others[..], core::slice::from_ref(&suspect.member)].concat();
    let apart = furthest(workers, case, &others, &[(name, with)])?;
    Ok(match apart.filter(|apart| !apart.told.is_empty()) {
        Some(apart) => {
            let words = apart.words("the twin with it and the twin without");
            pick(case, apart.number, format!("{why}; {words}"))
        }
        None => pick(case, of(name), why),
    })
}

/// Where nothing is to be told from anything.
fn without_trial(case: &Case, verdict: Verdict, untestable: &[Untestable]) -> Option<NextExperiment> {
    let robot = &case.floor.given.description;
    if let (Verdict::Unexplained, Some(name)) = (verdict, case.alike) {
        let why = format!(
            "shows whether it is {}: another calibration does without it, and leaves a gap",
            plain(name)
        );
        return Some(pick(case, of(name), why));
    }
    if verdict == Verdict::Partial {
        let why = "shows the gap once more, to prove the effect on runs that were not used";
        return Some(pick(case, RANDOM_STEPS, why.to_owned()));
    }
    let open: Vec<&str> = untestable
        .iter()
        .map(|open| open.name.as_str())
        .filter(|name| *name != LOST && find(name).is_some_and(|entry| applies(entry, robot)))
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
    Some(pick(case, number, format!("makes {} testable", listed(&shown))))
}

fn pick(case: &Case, number: usize, why: String) -> NextExperiment {
    NextExperiment {
        why,
        experiment: experiment(number, &case.floor.given.description),
    }
}

/// What is in the model at the end.
fn members_of(case: &Case) -> Vec<Member> {
    case.fit.as_ref().map_or_else(Vec::new, |fit| fit.members.clone())
}

/// Members but for one.
fn without(members: &[Member], candidate: Option<&Candidate>) -> Vec<Member> {
    let is_own = |member: &&Member| candidate.is_some_and(|own| member.candidate.is_same(own));
    members.iter().filter(|member| !is_own(member)).cloned().collect()
}

/// An effect may change a channel.
fn acts_on(case: &Case, name: &str, class: usize) -> bool {
    let is_rolling = matches!(CHANNELS[class], "gyro" | "pose" | "yaw");
    let mut own = case.candidates.iter().filter(|candidate| candidate.entry.name == name);
    let acts = |stages: Stages| if is_rolling { stages.rolling } else { stages.drive };
    own.any(|candidate| acts(candidate.stages))
}

/// The manoeuvre that shows most of some effects, the shortest of several, and which ones.
fn most_shown<'a>(open: &[&'a str]) -> Option<(usize, Vec<&'a str>)> {
    let shown = |number: usize| -> Vec<&'a str> { open.iter().copied().filter(|name| of(name) == number).collect() };
    let all = (0..CATALOGUE.len()).map(|number| (number, shown(number)));
    all.filter(|(_, shown)| !shown.is_empty()).min_by(|a, b| {
        let by_count = b.1.len().cmp(&a.1.len());
        by_count.then(CATALOGUE[a.0].duration_s.total_cmp(&CATALOGUE[b.0].duration_s))
    })
}

/// Effects in words; of many the first ones.
fn listed(names: &[&str]) -> String {
    let mut words: Vec<String> = names.iter().take(LISTED).map(|name| plain(name)).collect();
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
        assert_eq!(CATALOGUE[number].name, "field_grid");
        assert_eq!(shown, ["pose_scale", "rolling_shutter", "lens_distortion"]);
        let (number, _) = most_shown(&open[..3]).expect("something is open");
        assert_eq!(CATALOGUE[number].name, "speed_steps", "20 s, not 60");
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
