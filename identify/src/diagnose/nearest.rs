//! What came nearest to a name, and why it is none.

use super::assemble::values_of;
use super::{Case, TINY};
use crate::select::{Finalist, Stop};

/// What some runs show and the others do not, unless it was denied since or is what the references have some of.
pub(super) fn unchecked<'a>(case: &'a Case) -> Option<&'a Finalist> {
    let found = case.last.as_ref()?.unchecked(TINY)?;
    let name = found.member.candidate.entry.name;
    let is_denied = case.alike == Some(name) || case.withdrawn.iter().any(|(other, _)| *other == name);
    (!is_denied && !case.floor.has_absorbed(name)).then_some(found)
}

/// What the report suspects: taken into the model without proof, or, when nothing is named, what could not be checked.
pub(super) fn suspect<'a>(case: &'a Case) -> Option<&'a Finalist> {
    let mut named = case.taken.iter().filter(|taken| !taken.is_absorbed).peekable();
    if named.peek().is_none() {
        return unchecked(case);
    }
    named
        .find(|taken| taken.suspected.is_some())
        .map(|taken| &taken.finalist)
}

/// For the report.
///
/// - `is_open`: nothing is named.
pub(super) fn nearest(case: &Case, is_open: bool) -> Option<String> {
    if case
        .taken
        .iter()
        .any(|taken| !taken.is_absorbed && taken.suspected.is_some())
    {
        return None;
    }
    let unchecked = unchecked(case).filter(|_| is_open);
    unchecked
        .and_then(refused)
        .or_else(|| nearest_refused(case.last.as_ref()?))
}

/// Of what the last round refused, what explains most of the training runs, and why it is not named.
fn nearest_refused(stop: &Stop) -> Option<String> {
    let refused = stop.finalists.iter().filter_map(|finalist| {
        let because = finalist.because.as_ref()?;
        (finalist.gain_train > stop.threshold).then_some((finalist, because))
    });
    let (finalist, _) = refused.max_by(|a, b| a.0.gain_train.total_cmp(&b.0.gain_train))?;
    self::refused(finalist)
}

fn refused(finalist: &Finalist) -> Option<String> {
    let (candidate, because) = (&finalist.member.candidate, finalist.because.as_ref()?);
    let of = candidate
        .index
        .map(|index| format!(" of wheel {index}"))
        .unwrap_or_default();
    Some(format!(
        "{}{of} ({}) explains most of what is left of the training runs, but is not named: {because}",
        candidate.entry.name,
        values_of(finalist)
    ))
}
