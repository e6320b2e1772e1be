//! When nothing could be named: what is suspected goes into the model as an effect that is not confirmed.

use super::{Case, TINY, Taken, hear};
use crate::diagnose::prepared::Prepared;
use crate::fit::{Member, with_members};
use crate::select::{Question, Suspect};
use crate::workers::{Cancelled, Workers};

/// What is suspected and may be none by the interval of its size is not listed after all: two doubts are too many.
pub(super) fn drop_suspect(case: &mut Case) {
    if case.taken.iter().any(|taken| taken.is_suspected && taken.may_be_none) {
        case.taken.retain(|taken| !taken.is_suspected);
        case.fit = None;
    }
}

/// Takes what the last round suspects, if it named nothing; the sides are under it then.
pub(super) fn take_suspect(
    workers: &dyn Workers,
    case: &mut Case,
    members: &mut Vec<Member>,
    train: &mut Prepared,
    validation: &mut Prepared,
) -> Result<(), Cancelled> {
    let is_open = case.taken.iter().all(|taken| taken.tiny) && case.arrived.is_empty();
    let Some(stop) = case.last.as_ref().filter(|_| is_open) else {
        return Ok(());
    };
    if case.floor.references.is_empty() || validation.records.is_empty() {
        return Ok(());
    }
    let all = train.beside(validation, &case.floor);
    let both = all.thinned(&case.floor).unwrap_or(all);
    let model = with_members(&case.floor.model, members);
    let question = Question {
        floor: &case.floor,
        model: &model,
        both: both.side(),
        training_runs: train.records.len(),
        least_size: TINY,
    };
    let Some(Suspect { finalist, alternatives }) = question.suspect(workers, stop)? else {
        return Ok(());
    };
    let is_listed =
        |position: usize| position == finalist.position || alternatives.iter().any(|other| other.position == position);
    let excluded = stop.finalists.iter().filter(|other| !is_listed(other.position));
    let taken = Taken {
        excluded: excluded.cloned().collect(),
        threshold: stop.threshold,
        tiny: false,
        evenness: None,
        may_be_none: false,
        is_suspected: true,
        finalist,
        alternatives,
    };
    members.push(taken.finalist.member.clone());
    case.taken.push(taken);
    let model = with_members(&case.floor.model, members);
    train.renew(workers, &case.floor, &model)?;
    validation.renew(workers, &case.floor, &model)?;
    hear(&mut case.floor, train, validation);
    Ok(())
}
