//! Which candidates a round fits.

use crate::hypothesis::Candidate;
use crate::screen::Score;

/// Most candidates of a list.
const SHORT_LIST: usize = 10;
/// Beyond the first few, candidates with a smaller share of the best score are not fitted.
const FITTED_ANYWAY: usize = 5;
const WORTH_FITTING: f64 = 0.08;

/// The best of the order, at most two wheels of the same effect.
pub(super) fn short_list(candidates: &[Candidate], order: &[usize], scores: &[Score]) -> Vec<usize> {
    let mut list: Vec<usize> = Vec::new();
    let best = order.first().map_or(0.0, |first| scores[*first].gain);
    for candidate in order {
        let name = candidates[*candidate].entry.name;
        let same = list
            .iter()
            .filter(|other| candidates[**other].entry.name == name)
            .count();
        let weak = list.len() >= FITTED_ANYWAY && scores[*candidate].gain < WORTH_FITTING * best;
        if same < 2 && list.len() < SHORT_LIST && !weak {
            list.push(*candidate);
        }
    }
    list
}

/// The best of what is left of the order: where much is to be explained a small change says little of a large one, and the truth may
/// be further down.
pub(super) fn further_list(
    candidates: &[Candidate],
    order: &mut Vec<usize>,
    fitted: &[usize],
    scores: &[Score],
    threshold: f64,
) -> Vec<usize> {
    order.retain(|position| !fitted.contains(position) && scores[*position].gain > threshold);
    short_list(candidates, order, scores)
}
