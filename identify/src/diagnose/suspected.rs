//! When nothing could be named: what is suspected goes into the model as an effect that is not confirmed. And what is doubted twice goes out of it.

use super::opening::{ALIKE, otherwise_calibrated};
use super::prepared::Prepared;
use super::{Case, DiagnoseError, TINY, Taken, hear};
use crate::fit::{Member, with_members};
use crate::floor::Metric;
use crate::record::Stages;
use crate::select::{Question, Suspect};
use crate::workers::{Cancelled, Workers};

/// A name with so many doubts is not listed.
const TOO_MANY: usize = 2;

/// Takes what the last round suspects, if it named nothing; the sides are under it then.
pub(super) fn take_suspect(
    workers: &dyn Workers,
    case: &mut Case,
    stages: &[Stages],
    reference_metric: Option<&Metric>,
    members: &mut Vec<Member>,
    [train, validation]: [&mut Prepared; 2],
) -> Result<(), DiagnoseError> {
    let is_open = case.taken.iter().all(|taken| taken.tiny) && case.arrived.is_empty();
    let Some(stop) = case.last.as_ref().filter(|_| is_open) else {
        return Ok(());
    };
    let Some(reference_metric) = reference_metric.filter(|_| !validation.records.is_empty()) else {
        return Ok(());
    };
    let all = train.beside(validation, &case.floor);
    let few = all.thinned(&case.floor);
    let model = with_members(&case.floor.model, members);
    let question = Question {
        floor: &case.floor,
        reference_metric,
        model: &model,
        train: train.side(),
        validation: validation.side(),
        fitted: few.as_ref().unwrap_or(&all).side(),
        least_size: TINY,
    };
    let Some(suspect) = question.suspect(workers, stop)? else {
        return Ok(());
    };
    let Suspect {
        finalist,
        alternatives,
        because,
    } = suspect;
    let about = (&finalist, stop.threshold);
    if otherwise_calibrated(workers, case, stages, &all.records, about)?.is_some() {
        let name = finalist.member.candidate.entry.name;
        case.withdrawn.push((name, ALIKE.to_owned()));
        return Ok(());
    }
    let is_listed =
        |position: usize| position == finalist.position || alternatives.iter().any(|other| other.position == position);
    let excluded = stop.finalists.iter().filter(|other| !is_listed(other.position));
    let taken = Taken {
        excluded: excluded.cloned().collect(),
        threshold: stop.threshold,
        tiny: false,
        evenness: None,
        but_best: None,
        may_be_none: false,
        suspected: Some(because),
        finalist,
        alternatives,
    };
    members.push(taken.finalist.member.clone());
    case.taken.push(taken);
    Ok(renew(workers, case, members, [train, validation])?)
}

/// Takes out of the model what is doubted twice, and what is suspected and has no size after all. Whether there was any.
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
    let why = |taken: &Taken| {
        if taken.suspected.is_some() && (taken.tiny || !is_fitted) {
            return Some("hardly any of it is left on all open runs together".to_owned());
        }
        // On healthy robots a wheel that slides for a moment as no law has it passes a threshold by itself: all other windows have to say what chance does not.
        let is_once = taken.but_best.is_some_and(|gain| gain < taken.threshold / inflation);
        if is_once && !taken.tiny {
            return Some("one stretch of two seconds alone speaks for it".to_owned());
        }
        let doubts = taken.doubts();
        (!taken.tiny && doubts.len() >= TOO_MANY).then(|| format!("is doubted more than once: {}", doubts.join("; ")))
    };
    let doubtful: Vec<Option<String>> = case.taken.iter().map(why).collect();
    if doubtful.iter().all(Option::is_none) || doubtful.len() != members.len() {
        return Ok(false);
    }
    let all = core::mem::take(&mut case.taken)
        .into_iter()
        .zip(core::mem::take(members));
    for ((taken, member), doubtful) in all.zip(doubtful) {
        match doubtful {
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
