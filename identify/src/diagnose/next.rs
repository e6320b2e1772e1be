//! The run that would tell more.

use serde_json::{Value, json};
use twin::effect::library::{EffectEntry, find};
use twin::robot::RobotDescription;

use super::manoeuvre::{CATALOGUE, Manoeuvre, RANDOM_STEPS, TRIAL_S, Trials};
use super::nearest::suspect;
use super::{Case, knob_stages};
use crate::fit::{Member, with_members};
use crate::hypothesis::{LOST, applies};
use crate::record::{CHANNELS, Stages};
use crate::report::schema::{NamedEffect, NextExperiment, Untestable, Verdict};
use crate::select::Finalist;
use crate::workers::{Cancelled, Workers};

/// So many effects a sentence names.
const LISTED: usize = 3;
/// Standard deviations from which a run tells two models apart, and below which it says nothing of them.
const SURE_SIGMAS: f64 = 5.0;
const NOTHING_SIGMAS: f64 = 1.0;

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
        "repeat": 3,
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
        return telling(workers, case, effect);
    }
    if let (Verdict::Partial | Verdict::Unexplained, Some(suspect)) = (verdict, suspect(case)) {
        return Ok(of_runs(Some(showing(workers, case, suspect)?)));
    }
    Ok(of_runs(without_trial(case, verdict, untestable)))
}

/// The run that tells a name from those that these runs cannot tell from it.
fn telling(workers: &dyn Workers, case: &Case, effect: &NamedEffect) -> Result<Proposed, Cancelled> {
    let taken = case.taken.iter().find(|taken| taken.is(&effect.name, effect.index));
    let rivals: Vec<&Finalist> = taken.map_or_else(Vec::new, |taken| {
        let is_other = |rival: &&Finalist| {
            let name = rival.member.candidate.entry.name;
            effect.alternatives.iter().any(|other| other == name)
        };
        taken.alternatives.iter().filter(is_other).collect()
    });
    let members = members_of(case);
    let others = without(&members, taken.map(|taken| &taken.finalist));
    let with = |rival: &&Finalist| [&others[..], core::slice::from_ref(&rival.member)].concat();
    let models: Vec<Vec<Member>> = rivals.iter().map(with).collect();
    let name = plain(&effect.name);
    let apart = furthest(workers, case, &members, &models)?;
    let (number, why) = match &apart {
        Some(apart) if !apart.told.is_empty() => {
            let mut told: Vec<&str> = apart
                .told
                .iter()
                .map(|k| rivals[*k].member.candidate.entry.name)
                .collect();
            told.dedup();
            (
                apart.number,
                format!("tells {name} from {}: {}", listed(&told), apart.words()),
            )
        }
        Some(apart) if apart.sigmas >= NOTHING_SIGMAS => {
            let others = plain(&effect.alternatives.join(", "));
            let words = apart.words();
            (
                apart.number,
                format!("comes nearest to telling {name} from {others}: {words}, no other manoeuvre more"),
            )
        }
        // Nothing of it shows off its place, say: the manoeuvre of the one that the present runs show less.
        _ => {
            let other = &effect.alternatives[0];
            let is_alike = of(&effect.name) == of(other);
            let shown = if is_alike {
                other
            } else {
                weaker(case, &effect.name, other)
            };
            (
                of(shown),
                format!("tells {name} from {}", plain(&effect.alternatives.join(", "))),
            )
        }
    };
    Ok(Proposed {
        next: Some(pick(case, number, why)),
        is_told_by_none: apart.is_some_and(|apart| apart.told.is_empty() && apart.sigmas >= NOTHING_SIGMAS),
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
    let others = without(&members_of(case), Some(suspect));
    let with = [&others[..], core::slice::from_ref(&suspect.member)].concat();
    let apart = furthest(workers, case, &others, &[with])?;
    Ok(match apart.filter(|apart| !apart.told.is_empty()) {
        Some(apart) => pick(case, apart.number, format!("{why}; {}", apart.words())),
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
    Some(pick(case, number, format!("makes {} testable", listed(&shown))))
}

fn pick(case: &Case, number: usize, why: String) -> NextExperiment {
    NextExperiment {
        why,
        experiment: experiment(number, &case.floor.given.description),
    }
}

fn plain(name: &str) -> String {
    name.replace('_', " ")
}

/// What is in the model at the end.
fn members_of(case: &Case) -> Vec<Member> {
    case.fit.as_ref().map_or_else(Vec::new, |fit| fit.members.clone())
}

/// Members but for one.
fn without(members: &[Member], finalist: Option<&Finalist>) -> Vec<Member> {
    let is_own = |member: &Member| {
        finalist.is_some_and(|finalist| {
            let (own, other) = (&member.candidate, &finalist.member.candidate);
            own.entry.name == other.entry.name && own.index == other.index
        })
    };
    members.iter().filter(|member| !is_own(member)).cloned().collect()
}

/// How far apart a manoeuvre sets a model from others.
struct Apart {
    number: usize,
    /// Which others it tells from it.
    told: Vec<usize>,
    /// The nearest of these; where there is none the furthest of all.
    sigmas: f64,
}

impl Apart {
    fn words(&self) -> String {
        let digits = usize::from(self.sigmas < 10.0);
        format!(
            "{TRIAL_S:.0} s of it would set them {:.digits$} standard deviations apart",
            self.sigmas
        )
    }
}

/// The manoeuvre that sets a model furthest apart from others, all driven by the twin where the first open run was driven.
fn furthest(
    workers: &dyn Workers,
    case: &Case,
    own: &[Member],
    others: &[Vec<Member>],
) -> Result<Option<Apart>, Cancelled> {
    let is_lost = |members: &[Member]| members.iter().any(|member| member.candidate.entry.name == LOST);
    if others.is_empty() || is_lost(own) || others.iter().any(|members| is_lost(members)) {
        return Ok(None);
    }
    let base = with_members(&case.floor.model, own);
    let models: Vec<_> = others
        .iter()
        .map(|members| with_members(&case.floor.model, members))
        .collect();
    let Some(like) = case.input.runs.first() else {
        return Ok(None);
    };
    let knobs = case.floor.knobs.iter();
    let stages: Vec<Stages> = knobs.map(|knob| knob_stages(knob, &case.candidates)).collect();
    let driven = (&like.bundle, &case.records[..]);
    let Some(trials) = Trials::of(workers, &case.floor, driven, &base, &stages)? else {
        return Ok(None);
    };
    let mut sigmas = Vec::with_capacity(models.len());
    for model in &models {
        sigmas.push(trials.sigmas(workers, &case.floor, (&base, model))?);
    }
    let apart = |number: usize| -> Option<Apart> {
        let sigmas: Vec<f64> = sigmas.iter().map(|of_model| of_model[number]).collect::<Option<_>>()?;
        let told: Vec<usize> = (0..sigmas.len()).filter(|k| sigmas[*k] >= SURE_SIGMAS).collect();
        let least = told.iter().map(|k| sigmas[*k]).fold(f64::INFINITY, f64::min);
        let most = sigmas.iter().copied().fold(0.0, f64::max);
        Some(Apart {
            number,
            sigmas: if told.is_empty() { most } else { least },
            told,
        })
    };
    let known = (0..CATALOGUE.len()).filter_map(apart);
    Ok(known.max_by(|a, b| {
        let by_count = a.told.len().cmp(&b.told.len());
        // Of equal ones the first of the catalogue.
        by_count
            .then(a.sigmas.total_cmp(&b.sigmas))
            .then(b.number.cmp(&a.number))
    }))
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
        by_count.then(CATALOGUE[a.0].duration_s.total_cmp(&CATALOGUE[b.0].duration_s))
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
