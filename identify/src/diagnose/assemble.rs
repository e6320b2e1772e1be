//! Report and model version from a finished search.

use serde_json::{Value, json};
use twin::effect::Effect;
use twin::effect::library::LIBRARY;
use twin::model_document::ModelDocument;

use super::arrived::{Answer, take_back};
use super::beside::{doubt_beside_a_rest, reserve_calibrated, reserve_losses, reserve_untold};
use super::gap_table::gap_table;
use super::interval::sizes;
use super::louder::louder;
use super::nearest::{nearest, suspect};
use super::suspected::{is_weak_alone, names_by_weight, without_weak};
use super::taken::Taken;
use super::verdict::{FEWEST_RUNS, is_hardly_explained, left_louder_on, validated, verdict};
use super::verified::{Names, Verified, disagree_alone, leaves, verified};
use super::{Case, DiagnoseError, Diagnosis, LIBRARY_VERSION};
use crate::fit::{NORMAL_95, with_members};
use crate::hypothesis::{Hypothesis, Knob, LOST, applies};
use crate::record::CHANNELS;
use crate::report::schema::{
    Absorbed, Data, Evidence, FORMAT, ModelReference, NamedEffect, ParameterValue, Rejected, Report, Untestable,
    Verdict, Where, rounded,
};
use crate::report::{effect_sentence, told_by_no_run, verdict_sentence};
use crate::screen::Score;
use crate::select::{Finalist, Role};
use crate::workers::Workers;

/// Signal over noise below which an effect is untestable.
const TESTABLE: f64 = 5.0;
/// Calibration is listed from this many standard deviations.
const LISTED: f64 = 3.0;

pub(super) fn assemble(workers: &dyn Workers, case: &mut Case) -> Result<Diagnosis, DiagnoseError> {
    let members: Vec<_> = case.fit.as_ref().map_or_else(Vec::new, |fit| fit.members.clone());
    let mut after = with_members(&case.floor.model, &members);
    let is_beside_a_large_rest = is_hardly_explained(&case.energies);
    for taken in &mut case.taken {
        taken.is_beside_a_large_rest = is_beside_a_large_rest;
    }
    reserve_losses(&mut case.taken, left_louder_on(&case.levels, "wheel"));
    if case.floor.has_untold_tyres() {
        reserve_untold(&mut case.taken);
    }
    if case.alike.is_some() {
        reserve_calibrated(&mut case.taken);
    }
    let mut verdict = verdict(case);
    if verdict == Verdict::Unexplained && is_weak_alone(case) {
        verdict = without_weak(case);
    }
    let mut louder_words = words_of_louder(case, verdict);
    if verdict == Verdict::Unexplained || verdict == Verdict::NoDiscrepancy {
        after = without_names(case, verdict);
    }
    let (mut gap, mut explained) = gap_table(case, &after);
    let mut is_proven = validated(case) && case.locked.len() >= FEWEST_RUNS;
    let names = case.taken.iter().filter(|taken| !taken.is_absorbed).count();
    if names > 0 {
        let any = |is: fn(&Taken) -> bool| case.taken.iter().any(|taken| !taken.is_absorbed && is(taken));
        let names = Names {
            count: names,
            is_any_doubted: any(|taken| !taken.doubts().is_empty()),
            is_any_proven: any(Taken::is_proven),
        };
        match verified(&gap, explained, names) {
            Verified::Holds => {
                if let Some(words) = leaves(&gap, explained) {
                    let unproven_names = doubt_beside_a_rest(&mut case.taken);
                    case.remarks.push(words);
                    case.remarks.extend(unproven_names);
                    verdict = unproven(verdict);
                }
            }
            Verified::InPart(words) => {
                case.remarks.push(format!("not proven: {words}"));
                verdict = unproven(verdict);
                is_proven = false;
            }
            Verified::Not(words) => {
                let (weak, others) = names_by_weight(case);
                let told = weak.iter().map(|name| {
                    format!("{name}: training and validation runs together show it, and it is not believed: {words}")
                });
                case.remarks.extend(told);
                if others.is_empty() {
                    verdict = without_weak(case);
                    louder_words = words_of_louder(case, verdict);
                } else {
                    case.withdrawn
                        .extend(others.into_iter().map(|name| (name, words.clone())));
                    verdict = Verdict::Unexplained;
                }
                after = without_names(case, verdict);
                (gap, explained) = gap_table(case, &after);
            }
        }
    }
    case.remarks.extend(louder_words);
    if is_beside_a_large_rest && case.taken.iter().any(|taken| !taken.is_absorbed) {
        let words = "nearly all of what the runs are off by is left with what is named; not confirmed before something explains that";
        case.remarks.push(words.to_owned());
    }
    for taken in case.taken.iter().filter(|taken| !taken.is_absorbed) {
        case.remarks.extend(taken.remarks(taken.before(&case.floor)));
    }
    let corrections = case.taken.iter().filter_map(Taken::correction);
    case.remarks.extend(corrections);
    let model = model_version(case, &after);
    let effects = named(case, is_proven);
    if effects.is_empty() && matches!(verdict, Verdict::Confirmed | Verdict::Partial | Verdict::Ambiguous) {
        verdict = Verdict::NoDiscrepancy;
    }
    let is_quiet = verdict == Verdict::NoDiscrepancy && !case.floor.references.is_empty();
    let unused_alone = disagree_alone(&gap, !case.input.locked.is_empty()).filter(|_| is_quiet);
    if unused_alone.is_some() {
        verdict = Verdict::Unexplained;
    }
    if matches!(verdict, Verdict::Unexplained | Verdict::Partial) && unused_alone.is_none() {
        let nearest = nearest(case, effects.is_empty());
        case.remarks.extend(nearest);
    }
    let absorbed = absorbed(case, &effects);
    let told = told_of_withdrawn(case, &absorbed);
    case.remarks.extend(told);
    let (rejected, untestable) = rest(case, &effects, &absorbed);
    let place = located(case);
    let has_references = !case.floor.references.is_empty();
    let suspect = suspect(case).map(|finalist| finalist.member.candidate.entry.name);
    let sentence = unused_alone
        .unwrap_or_else(|| verdict_sentence(verdict, &effects, explained, &place.sentence, suspect, has_references));
    let proposed = super::next::next_experiment(workers, case, verdict, &effects, &untestable)?;
    let sentence = told_by_no_run(sentence, proposed.is_told_by_none);
    let report = Report {
        format: FORMAT.to_owned(),
        robot: case.floor.given.description.name.clone(),
        data: data(case),
        verdict,
        sentence,
        next_experiment: proposed.next,
        effects,
        absorbed,
        rejected,
        untestable,
        place,
        gap,
        explained_fraction: explained,
        floor_source: if case.floor.noise.is_prior {
            "stated"
        } else {
            "references"
        }
        .to_owned(),
        remarks: case.remarks.clone(),
        model: ModelReference {
            id: model.id.clone(),
            parent: model.parent.clone(),
        },
        seed: case.input.seed,
        library_version: LIBRARY_VERSION.to_owned(),
    };
    Ok(Diagnosis { report, model })
}

/// The channel that errs more than in the references, where something is left open.
fn words_of_louder(case: &Case, verdict: Verdict) -> Option<String> {
    let is_open = matches!(verdict, Verdict::Unexplained | Verdict::Partial);
    let louder = louder(&case.levels.after).filter(|_| is_open);
    louder.map(|louder| louder.words())
}

/// Drops all names; the model is the floor's, and the gap is where it was before they were fitted.
fn without_names(case: &mut Case, verdict: Verdict) -> Hypothesis {
    if case.fit.take().is_some() {
        case.located.clone_from(&case.located_unnamed);
    }
    case.taken
        .retain(|taken| taken.is_absorbed && taken.corrects_beside.is_none() && verdict == Verdict::NoDiscrepancy);
    let is_lost = |taken: &Taken| taken.finalist.member.candidate.entry.name == LOST;
    if !case.taken.iter().any(is_lost) {
        take_back(case);
    }
    case.floor.model.clone()
}

/// At most partly explained.
fn unproven(verdict: Verdict) -> Verdict {
    match verdict {
        Verdict::Confirmed => Verdict::Partial,
        other => other,
    }
}

fn data(case: &Case) -> Vec<Data> {
    let mut all = Vec::new();
    let mut add = |run: &super::Run, role: Role, blocks: usize| {
        all.push(Data {
            path: run.path.clone(),
            sha256: run.sha256.clone(),
            role: role.name().to_owned(),
            blocks,
        });
    };
    for run in &case.input.references {
        let record = case.floor.references.iter().find(|record| record.name == run.path);
        add(run, Role::Reference, record.map_or(0, |record| record.windows.len()));
    }
    for ((run, role), record) in case.input.runs.iter().zip(&case.roles).zip(&case.records) {
        add(run, *role, record.windows.len());
    }
    for run in &case.input.locked {
        let record = case.locked.iter().find(|record| record.name == run.path);
        add(run, Role::Locked, record.map_or(0, |record| record.windows.len()));
    }
    all
}

fn model_version(case: &Case, after: &Hypothesis) -> ModelDocument {
    let parent = case.input.model.as_ref().map(|model| model.id.clone());
    let data: Vec<Value> = data(case)
        .iter()
        .map(|data| json!({"path": data.path, "sha256": data.sha256}))
        .collect();
    let split: serde_json::Map<String, Value> = self::data(case)
        .iter()
        .map(|data| (data.path.clone(), Value::from(data.role.clone())))
        .collect();
    let provenance = json!({"data": data, "split": split, "library_version": LIBRARY_VERSION});
    let floor = &case.input.runs[0].bundle.run.floor;
    // Set-points are lost before anything else acts on them.
    let mut effects: Vec<Effect> = after
        .effects
        .iter()
        .filter(|effect| effect.name == LOST)
        .cloned()
        .collect();
    if effects.is_empty() {
        effects.extend(case.lost_given.clone());
    }
    effects.extend(after.effects.iter().filter(|effect| effect.name != LOST).cloned());
    for effect in &mut effects {
        for value in effect.parameters.values_mut() {
            *value = value.map(rounded);
        }
    }
    let document = ModelDocument::new(parent, after.description.clone(), floor, effects, provenance);
    match &after.residual {
        Some(residual) => document.with_residual(residual.clone()),
        None => document,
    }
}

fn named(case: &Case, is_proven: bool) -> Vec<NamedEffect> {
    let mut effects: Vec<NamedEffect> = Vec::new();
    for (position, taken) in case.taken.iter().enumerate() {
        if taken.is_absorbed {
            continue;
        }
        let finalist = &taken.finalist;
        let earlier: Vec<String> = effects
            .iter()
            .flat_map(|effect| effect.alternatives.iter().chain(core::iter::once(&effect.name)))
            .cloned()
            .collect();
        let name = finalist.member.candidate.entry.name;
        let alternatives: Vec<String> = taken
            .other_names()
            .into_iter()
            .filter(|other| !earlier.contains(other) && !is_taken(case, other))
            .collect();
        let mut excluded: Vec<Rejected> = taken
            .excluded
            .iter()
            .map(|other| Rejected {
                name: other.member.candidate.entry.name.to_owned(),
                because: other.because.clone().unwrap_or_else(|| {
                    let less = finalist.gain() - other.gain();
                    let (gain, values) = (other.gain(), values_of(other));
                    if less >= 0.0 {
                        format!("gains {gain:.0} at {values}, {less:.0} less")
                    } else {
                        format!("gained {gain:.0} at {values} while other names were missing")
                    }
                }),
            })
            .filter(|rejected| rejected.name != name && !alternatives.contains(&rejected.name))
            .collect();
        excluded.sort_by(|a, b| a.name.cmp(&b.name));
        excluded.dedup_by(|a, b| a.name == b.name);
        let mut effect = NamedEffect {
            name: name.to_owned(),
            status: if alternatives.is_empty() && taken.is_sure(&case.floor) && is_proven {
                "confirmed"
            } else {
                "ambiguous"
            }
            .to_owned(),
            index: finalist.member.candidate.index,
            parameters: sizes(case, position, finalist),
            evidence: Evidence {
                gain: rounded(finalist.gain()),
                threshold: rounded(taken.threshold),
                stability: rounded(finalist.stability),
                // Of what was fitted to both sides nothing was kept back.
                gain_validation: if taken.suspected.is_some() && (!finalist.is_unshown || finalist.is_shown_elsewhere())
                {
                    0.0
                } else {
                    rounded(finalist.gain_validation)
                },
            },
            alternatives,
            excluded,
            sentence: String::new(),
        };
        effect.sentence = effect_sentence(&effect);
        effects.push(effect);
    }
    effects
}

/// Fitted values in words.
pub(super) fn values_of(finalist: &Finalist) -> String {
    let axes = finalist.member.candidate.axes.iter().zip(&finalist.member.values);
    let parts: Vec<String> = axes
        .filter(|(_, value)| value.is_finite())
        .map(|(axis, value)| format!("{} {}", axis.name, rounded((value * 1e4).round() / 1e4)))
        .collect();
    parts.join(", ")
}

fn is_taken(case: &Case, name: &str) -> bool {
    case.taken
        .iter()
        .any(|taken| !taken.is_absorbed && taken.finalist.member.candidate.entry.name == name)
}

/// Calibration that is sure, and effects that are too small to matter.
fn absorbed(case: &Case, effects: &[NamedEffect]) -> Vec<Absorbed> {
    let mentioned = |name: &str| {
        effects
            .iter()
            .any(|effect| effect.name == name || effect.alternatives.iter().any(|other| other == name))
    };
    let mut all: Vec<Absorbed> = Vec::new();
    let mut add = |name: &str, value: ParameterValue| match all.iter_mut().find(|absorbed| absorbed.name == name) {
        Some(absorbed) => absorbed.parameters.push(value),
        None => all.push(Absorbed {
            name: name.to_owned(),
            parameters: vec![value],
        }),
    };
    for ((knob, value), sigma) in case.floor.knobs.iter().zip(&case.floor.values).zip(&case.floor.sigmas) {
        let Knob::Parameter {
            name,
            index,
            parameter,
            neutral,
            practical,
            ..
        } = knob
        else {
            continue;
        };
        let entry = LIBRARY.iter().find(|entry| entry.name == *name);
        if value.abs() < LISTED * sigma || mentioned(name) {
            continue;
        }
        let number = |value: f64| Some(rounded(neutral + practical * value));
        let parameter_name = match index {
            Some(index) => format!("{parameter} of wheel {index}"),
            None => (*parameter).to_owned(),
        };
        add(
            name,
            ParameterValue {
                name: parameter_name,
                value: number(*value),
                low: number(value - NORMAL_95 * sigma),
                high: number(value + NORMAL_95 * sigma),
                unit: entry
                    .and_then(|entry| entry.parameter(parameter))
                    .map_or("1", |parameter| parameter.unit)
                    .to_owned(),
            },
        );
    }
    for (position, taken) in case.taken.iter().enumerate().filter(|(_, taken)| taken.is_absorbed) {
        let name = taken.finalist.member.candidate.entry.name;
        if mentioned(name) {
            continue;
        }
        for value in sizes(case, position, &taken.finalist) {
            add(name, value);
        }
    }
    for effect in &case.floor.absorbed {
        let Some(entry) = LIBRARY.iter().find(|entry| entry.name == effect.name) else {
            continue;
        };
        if mentioned(entry.name) {
            continue;
        }
        for parameter in entry.parameters {
            let value = Some(effect.value(parameter.name))
                .filter(|value| value.is_finite())
                .map(rounded);
            add(
                entry.name,
                ParameterValue {
                    name: parameter.name.to_owned(),
                    value,
                    low: value,
                    high: value,
                    unit: parameter.unit.to_owned(),
                },
            );
        }
    }
    all.sort_by(|a, b| a.name.cmp(&b.name));
    all
}

/// What was absorbed of a name does not tell why more of it was not believed.
fn told_of_withdrawn(case: &Case, absorbed: &[Absorbed]) -> Vec<String> {
    let what = if case.floor.references.is_empty() {
        "what the description was corrected by"
    } else {
        "what the references have of it"
    };
    let mut told: Vec<String> = Vec::new();
    for (name, words) in &case.withdrawn {
        let remark = format!("{name}, beyond {what}, was found and not believed: {words}");
        if absorbed.iter().any(|absorbed| absorbed.name == *name) && !told.contains(&remark) {
            told.push(remark);
        }
    }
    told
}

/// Every other name of the library: rejected, or untestable with these runs.
fn rest(case: &Case, effects: &[NamedEffect], absorbed: &[Absorbed]) -> (Vec<Rejected>, Vec<Untestable>) {
    let (mut rejected, mut untestable) = (Vec::new(), Vec::new());
    for entry in LIBRARY {
        let mentioned = effects
            .iter()
            .any(|effect| effect.name == entry.name || effect.alternatives.iter().any(|other| other == entry.name));
        if mentioned || absorbed.iter().any(|absorbed| absorbed.name == entry.name) {
            continue;
        }
        let robot = &case.floor.given.description;
        let mut untested = |because: String| {
            let manoeuvre = applies(entry, robot).then(|| super::next::manoeuvre(entry, robot));
            untestable.push(Untestable {
                name: entry.name.to_owned(),
                because,
                run_this: manoeuvre.unwrap_or_else(|| serde_json::json!({})),
            });
        };
        if !applies(entry, robot) {
            untested("the robot has no part that it acts on".to_owned());
            continue;
        }
        // What was found is neither untestable nor answered by what was asked before.
        if case.withdrawn.iter().any(|(name, _)| *name == entry.name) {
            rejected.push(Rejected {
                name: entry.name.to_owned(),
                because: because(case, entry.name, 0.0),
            });
            continue;
        }
        let own: Vec<&Score> = case
            .candidates
            .iter()
            .zip(&case.first_scores)
            .filter(|(candidate, _)| candidate.entry.name == entry.name)
            .map(|(_, score)| score)
            .collect();
        let sensitivity = own.iter().map(|score| score.sensitivity).fold(0.0, f64::max);
        if entry.name == LOST {
            match &case.lost {
                Answer::Untestable(words) => untested(words.clone()),
                Answer::Rejected(because) => rejected.push(Rejected {
                    name: entry.name.to_owned(),
                    because: because.clone(),
                }),
                Answer::NotAsked => {
                    untested(
                        "it is looked for last, on runs that leave some to check it on, and it did not come to that"
                            .to_owned(),
                    );
                }
                Answer::Agree => rejected.push(Rejected {
                    name: entry.name.to_owned(),
                    because: "the wheels answer to the set-points as sent".to_owned(),
                }),
            }
        } else if own.is_empty() {
            untested("these runs command nothing that it could act on".to_owned());
        } else if sensitivity < TESTABLE {
            untested(format!(
                "at its practical size it moves the channels of these runs by {sensitivity:.1} standard deviations; 5 are needed{}",
                missing(case)
            ));
        } else {
            let gain = own.iter().map(|score| score.gain).fold(0.0, f64::max);
            rejected.push(Rejected {
                name: entry.name.to_owned(),
                because: because(case, entry.name, gain),
            });
        }
    }
    rejected.sort_by(|a, b| a.name.cmp(&b.name));
    untestable.sort_by(|a, b| a.name.cmp(&b.name));
    (rejected, untestable)
}

fn because(case: &Case, name: &str, gain: f64) -> String {
    if let Some((_, words)) = case.withdrawn.iter().find(|(other, _)| *other == name) {
        return format!("was found and not believed: {words}");
    }
    // The last round knows most.
    let rounds = case.taken.iter().rev().flat_map(|taken| &taken.excluded);
    let judged = case
        .last
        .iter()
        .flat_map(|stop| &stop.finalists)
        .chain(rounds)
        .find(|finalist| finalist.member.candidate.entry.name == name);
    if let Some(finalist) = judged {
        return finalist
            .because
            .clone()
            .unwrap_or_else(|| format!("gains {:.0}, less than what was named", finalist.gain()));
    }
    if gain < case.first_threshold {
        return format!("gain {gain:.0} is below the threshold {:.0}", case.first_threshold);
    }
    "others explain the same part of the gap better".to_owned()
}

/// Channels that the runs do not have.
fn missing(case: &Case) -> String {
    let mut has = [false; CHANNELS.len()];
    for record in &case.records {
        for quantity in record.quantities() {
            has[quantity.class()] = true;
        }
    }
    let steering = case.floor.given.description.steering.is_some();
    let absent: Vec<&str> = CHANNELS
        .iter()
        .zip(has)
        .filter(|(name, has)| !has && (**name != "steering" || steering))
        .map(|(name, _)| *name)
        .collect();
    if absent.is_empty() {
        String::new()
    } else {
        format!(" (no {} channel)", absent.join(", "))
    }
}

fn located(case: &Case) -> Where {
    let located = &case.located;
    let mut regions = located.regions.clone();
    for region in &mut regions {
        for list in [&mut region.edges, &mut region.energy, &mut region.mean] {
            list.iter_mut().for_each(|value| *value = rounded(*value));
        }
    }
    let mut map = located.floor_map.clone();
    for list in [&mut map.x_m, &mut map.y_m, &mut map.energy] {
        list.iter_mut().for_each(|value| *value = rounded(*value));
    }
    let mut segments = located.segments.clone();
    for segment in &mut segments {
        segment.from_s = rounded(segment.from_s);
        segment.to_s = rounded(segment.to_s);
    }
    Where {
        sentence: located.sentence.clone(),
        channels: located
            .channels
            .iter()
            .map(|(class, _)| CHANNELS[*class].to_owned())
            .collect(),
        shares: located.channels.iter().map(|(_, share)| rounded(*share)).collect(),
        segments,
        regions,
        floor_map: map,
    }
}
