//! When nothing could be named: what is suspected goes into the model as an effect that is not confirmed. And what is doubted twice, for reasons of their own, goes out of it.

use super::gap_table::ValidationGap;
use super::nearest::unchecked;
use super::opening::otherwise_calibrated;
use super::prepared::Prepared;
use super::taken::Taken;
use super::verdict::verdict;
use super::{Case, DiagnoseError, TINY, hear};
use crate::fit::{Member, with_members};
use crate::floor::{Floor, Metric};
use crate::record::Stages;
use crate::report::schema::Verdict;
use crate::select::{Finalist, Question, Suspect};
use crate::workers::{Cancelled, Workers};

/// A name with so many doubts is not listed.
const TOO_MANY: usize = 2;
/// Unless it explains so much of the gap of the validation runs that without it nobody would know what they are off by.
const MOST_OF_GAP: f64 = 0.5;

/// Takes what the last round suspects, if it named nothing; the sides are under it then. Where there is only what one calibration of references and runs does
/// without, the first such name and that calibration.
pub(super) fn take_suspect(
    workers: &dyn Workers,
    case: &mut Case,
    stages: &[Stages],
    reference_metric: Option<&Metric>,
    members: &mut Vec<Member>,
    [train, validation]: [&mut Prepared; 2],
) -> Result<Option<(&'static str, Floor)>, DiagnoseError> {
    let is_open = case.taken.iter().all(|taken| taken.is_absorbed) && case.arrived.is_empty();
    let Some(stop) = case.last.as_ref().filter(|_| is_open) else {
        return Ok(None);
    };
    let Some(reference_metric) = reference_metric.filter(|_| !validation.records.is_empty()) else {
        return Ok(None);
    };
    let all = train.beside(validation, &case.floor);
    let few = all.thinned(&case.floor);
    let model = with_members(&case.floor.model, members);
    let question = Question {
        floor: &case.floor,
        reference_metric,
        model: &model,
        candidates: &case.candidates,
        members: members.as_slice(),
        train: train.side(),
        validation: validation.side(),
        fitted: few.as_ref().unwrap_or(&all).side(),
        least_size: TINY,
        seed: case.input.seed,
    };
    let mut denied: Vec<&'static str> = case.withdrawn.iter().map(|pair| pair.0).collect();
    let mut alike = None;
    let suspect = loop {
        let found = match question.suspect(workers, stop, &denied)? {
            Some(suspect) => Some(suspect),
            // What is known of some runs, and explains more of them, is not hidden behind it.
            None => question.overlooked(workers, stop, &denied)?.filter(|found| {
                let finalist = &found.finalist;
                let is_more = |other: &Finalist| other.gain_train <= finalist.gain_train;
                unchecked(case).is_none_or(|other| !finalist.is_shown_elsewhere() && is_more(other))
            }),
        };
        let Some(suspect) = found else { break None };
        let about = (&suspect.finalist, stop.threshold);
        let Some(floor) = otherwise_calibrated(workers, case, stages, &all.records, members, about)? else {
            break Some(suspect);
        };
        let name = suspect.finalist.member.candidate.entry.name;
        alike = alike.or(Some((name, floor)));
        denied.push(name);
    };
    let known = case.withdrawn.len();
    let excluded_by_alike = denied.split_off(known);
    let Some(Suspect {
        finalist,
        alternatives,
        because,
        is_shown_together,
    }) = suspect
    else {
        if case.has_begun_again || alike.is_none() {
            case.deny(&excluded_by_alike);
            return Ok(None);
        }
        return Ok(alike);
    };
    let is_listed =
        |position: usize| position == finalist.position || alternatives.iter().any(|other| other.position == position);
    let excluded = stop.finalists.iter().filter(|other| !is_listed(other.position));
    let taken = Taken {
        excluded: excluded.cloned().collect(),
        threshold: stop.threshold,
        is_absorbed: false,
        corrects_beside: None,
        evenness: None,
        but_best: None,
        may_be_none: false,
        may_be_none_on_average: false,
        may_be_rest_of: None,
        is_beside_a_large_rest: false,
        reserved: Vec::new(),
        rivals: Vec::new(),
        trend: None,
        suspected: Some(because),
        is_shown_together,
        finalist,
        alternatives,
    };
    case.deny(&excluded_by_alike);
    members.push(taken.finalist.member.clone());
    case.taken.push(taken);
    renew(workers, case, members, [train, validation])?;
    Ok(None)
}

/// Takes out of the model what is doubted twice (of doubts that follow from each other one counts), what one window alone speaks for, and what is suspected and has no size after all. Whether there was any.
pub(super) fn drop_doubtful(
    workers: &dyn Workers,
    case: &mut Case,
    members: &mut Vec<Member>,
    sides: [&mut Prepared; 2],
) -> Result<bool, Cancelled> {
    if case.floor.references.is_empty() || !case.arrived.is_empty() {
        return Ok(false);
    }
    let (is_fitted, inflation) = (case.fit.is_some(), case.floor.inflation());
    let is_seen = seen_in_the_gap(case, members);
    let is_beside_sure = case.taken.iter().any(Taken::vouches);
    let is_alone = case.taken.iter().filter(|taken| !taken.is_absorbed).count() == 1;
    let why = |(taken, is_seen): (&Taken, &bool)| {
        if taken.suspected.is_some() && (taken.is_absorbed || !is_fitted) {
            return Some("hardly any of it is left on all open runs together".to_owned());
        }
        // On healthy robots a wheel that slides for a moment as no law has it passes a threshold by itself: all other windows have to say what chance does not.
        let is_once = taken.but_best.is_some_and(|gain| gain < taken.threshold / inflation);
        // A correction of a law is in the model as a name is.
        let is_in_model = !taken.is_absorbed || taken.corrects_beside.is_some();
        if is_once && is_in_model {
            return Some(
                "without the stretch of two seconds that speaks most for it, it explains no more than chance may"
                    .to_owned(),
            );
        }
        let is_doubted = is_in_model && taken.independent_doubts(is_beside_sure, is_alone) >= TOO_MANY;
        (is_doubted && !is_seen).then(|| format!("is doubted more than once: {}", taken.doubts().join("; ")))
    };
    let doubtful: Vec<Option<String>> = case.taken.iter().zip(&is_seen).map(why).collect();
    if doubtful.iter().all(Option::is_none) || doubtful.len() != members.len() {
        return Ok(false);
    }
    let all = core::mem::take(&mut case.taken)
        .into_iter()
        .zip(core::mem::take(members));
    for ((taken, member), doubtful) in all.zip(doubtful) {
        match doubtful {
            // What was looked for with less evidence than is asked and is none is no disagreement.
            Some(_) if taken.is_shown_together => {}
            Some(words) => case.withdrawn.push((taken.finalist.member.candidate.entry.name, words)),
            None => {
                case.taken.push(taken);
                members.push(member);
            }
        }
    }
    case.fit = None;
    renew(workers, case, members, sides)?;
    Ok(true)
}

/// Which names explain most of the gap of the validation runs, beside what the others do, at sizes that the training runs gave: known of those alone that are
/// doubted too often.
///
/// What is suspected was fitted to the validation runs, and so were losses.
fn seen_in_the_gap(case: &Case, members: &[Member]) -> Vec<bool> {
    let mut gap = ValidationGap::default();
    let mut is_seen = |(position, taken): (usize, &Taken)| {
        let is_asked = !taken.is_absorbed && taken.is_held_out() && taken.doubts().len() >= TOO_MANY;
        if !is_asked || members.len() != case.taken.len() {
            return false;
        }
        let mut others = members.to_vec();
        others.remove(position);
        let models = [&others[..], members].map(|members| with_members(&case.floor.model, members));
        let explained = gap.explained(case, &models);
        matches!(explained[..], [Some(without), Some(with)] if with - without.max(0.0) >= MOST_OF_GAP)
    };
    case.taken.iter().enumerate().map(&mut is_seen).collect()
}

/// Names that less speaks for than is asked, and the others.
pub(super) fn names_by_weight(case: &Case) -> (Vec<&'static str>, Vec<&'static str>) {
    let names = case.taken.iter().filter(|taken| !taken.is_absorbed);
    let (weak, others): (Vec<&Taken>, Vec<&Taken>) = names.partition(|taken| taken.is_shown_together);
    let of = |all: Vec<&Taken>| {
        all.iter()
            .map(|taken| taken.finalist.member.candidate.entry.name)
            .collect()
    };
    (of(weak), of(others))
}

/// Nothing is named but such.
pub(super) fn is_weak_alone(case: &Case) -> bool {
    let (weak, others) = names_by_weight(case);
    !weak.is_empty() && others.is_empty()
}

/// Takes out names that less speaks for than is asked: that they are none is no disagreement. The verdict without them.
pub(super) fn without_weak(case: &mut Case) -> Verdict {
    case.taken
        .retain(|taken| taken.is_absorbed && taken.corrects_beside.is_none());
    case.levels.after = case.levels.before.clone();
    case.energies = case.energies.unnamed();
    verdict(case)
}

/// The sides under another list of members.
fn renew(
    workers: &dyn Workers,
    case: &mut Case,
    members: &[Member],
    [train, validation]: [&mut Prepared; 2],
) -> Result<(), Cancelled> {
    let model = with_members(&case.floor.model, members);
    train.renew(workers, &case.floor, &model)?;
    validation.renew(workers, &case.floor, &model)?;
    hear(&mut case.floor, train, validation);
    Ok(())
}
