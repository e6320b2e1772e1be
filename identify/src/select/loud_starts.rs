//! Where fits begin if loud windows are believed.
//!
//! A window that is far louder than expected counts little when candidates are screened ([`crate::floor::Floor::doubt`]). Where a strong effect has made most
//! windows loud, what is left to screen on may lead to the other side of neutral, out of which no fit finds; the loud ones lead to where they are
//! explained, and then they count.

use super::round::{Round, products};
use crate::hypothesis::{Axis, Candidate};
use crate::screen::{Score, scores};

/// So many of the best by all windows are fitted although the others put them far down their list.
const TRUSTED: usize = 3;

/// Adds starts to the scores, and candidates to the list.
///
/// - `columns`: sensitivities of the candidates.
/// - `may_join`: candidates that may be fitted at all.
pub(super) fn add_loud_starts(
    data: &Round,
    columns: &[Vec<Vec<f64>>],
    scores_now: &mut [Score],
    list: &mut Vec<usize>,
    may_join: impl Fn(usize) -> bool,
) {
    let Some(whole) = data.coarse.whole else { return };
    let loud = scores(data.candidates, &products(data, whole, columns));
    let mut order: Vec<usize> = (0..loud.len()).filter(|position| may_join(*position)).collect();
    order.sort_by(|a, b| loud[*b].gain.total_cmp(&loud[*a].gain).then(a.cmp(b)));
    for position in order.into_iter().take(TRUSTED) {
        if !list.contains(&position) {
            list.push(position);
        }
    }
    for position in list.iter() {
        let (own, other) = (&mut scores_now[*position], &loud[*position]);
        if is_elsewhere(&data.candidates[*position], &own.start, &other.start) {
            own.more_starts.push(other.start.clone());
        }
    }
}

/// A size differs by more than a practical size and by more than half of the larger one.
fn is_elsewhere(candidate: &Candidate, start: &[f64], other: &[f64]) -> bool {
    let differs = |axis: &Axis, a: f64, b: f64| {
        let from_neutral = |value: f64| (value - axis.neutral).abs();
        let larger = from_neutral(a).max(from_neutral(b));
        axis.carries_size && axis.neutral.is_finite() && (a - b).abs() > axis.practical.max(0.5 * larger)
    };
    let mut pairs = candidate.axes.iter().zip(start.iter().zip(other));
    pairs.any(|(axis, (a, b))| differs(axis, *a, *b))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hypothesis::{Excitation, candidates};

    #[test]
    fn the_other_side_of_neutral_is_elsewhere_and_a_little_more_is_not() {
        let all = candidates(&twin::golden::reference_robot("rwd"), &Excitation::default());
        let centre = all
            .iter()
            .find(|candidate| candidate.entry.name == "center_of_mass_offset")
            .expect("every robot has it");
        let practical = centre.axes[0].practical;
        let start = [2.0 * practical, 0.0];
        assert!(is_elsewhere(centre, &start, &[-6.0 * practical, 0.0]));
        assert!(is_elsewhere(centre, &start, &[2.0 * practical, 1.5 * practical]));
        assert!(
            !is_elsewhere(centre, &start, &[2.9 * practical, 0.0]),
            "less than a practical size"
        );
        assert!(
            !is_elsewhere(centre, &[8.0 * practical, 0.0], &[11.0 * practical, 0.0]),
            "less than half of it"
        );
    }
}
