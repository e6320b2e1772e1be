//! Candidates as they are seen beside names whose sizes are free: what stood in for one of them while others were missing explains
//! less there than the one that acts.

use super::evidence::{judge, stability};
use super::finalist::Finalist;
use super::kept::Kept;
use super::round::{Fitted, MAJORITY, Round, slices};
use crate::fit::{Fit, Member, moved_one_by_one, with_members};
use crate::linear::Square;
use crate::record::Stages;
use crate::screen::{Change, Score, columns, scores};
use crate::workers::{Cancelled, Workers};

/// What all candidates could explain beside the members of a round when these are fitted anew with them, to first order.
///
/// - `kept`: sensitivities on the windows that candidates are screened on.
pub fn scores_beside(workers: &dyn Workers, data: &Round, kept: &Kept) -> Result<Vec<Score>, Cancelled> {
    let moved = moved_one_by_one(data.members).into_iter().map(|members| Change {
        hypothesis: with_members(&data.floor.model, &members),
        added: 0,
        stages: Stages::BOTH,
        step: 1.0,
    });
    let changes: Vec<Change> = moved.collect();
    let slopes = columns(workers, data.coarse.records, data.coarse.residuals, &changes)?;
    let mut vectors = vec![slices(data.coarse.residuals)];
    vectors.extend(kept.columns().iter().chain(&slopes).map(|column| slices(column)));
    let mut gram = data.coarse.metric.gram(&vectors);
    gram.scale(1.0 / data.share());
    Ok(scores(data.candidates, &beside(&gram, slopes.len())))
}

/// Products of what of the first vectors the last few cannot imitate.
fn beside(gram: &Square, last: usize) -> Square {
    let first = gram.size - last;
    let mut rest = gram.part(&(0..first).collect::<Vec<usize>>());
    if last == 0 {
        return rest;
    }
    let mut normal = gram.part(&(first..gram.size).collect::<Vec<usize>>());
    for k in 0..last {
        let ridge = 1e-6 * normal.at(k, k) + 1e-9;
        normal.add(k, k, ridge);
    }
    let factor = normal.cholesky();
    let forward: Vec<Vec<f64>> = (0..first)
        .map(|row| factor.forward(&(first..gram.size).map(|k| gram.at(k, row)).collect::<Vec<f64>>()))
        .collect();
    for row in 0..first {
        for column in 0..first {
            let imitated: f64 = forward[row].iter().zip(&forward[column]).map(|(a, b)| a * b).sum();
            rest.add(row, column, -imitated);
        }
    }
    rest
}

/// A fit of all members and a candidate, judged as one of a round of these members, with the share of half-splits in which it explains more
/// than what stands there.
///
/// - `rivals`: fits of the round's members and a candidate at `place`, against the floor's model, with the candidates' positions: the one that
///   is judged, and what stands there.
pub fn in_place(data: &Round, rivals: [(&Fit, usize); 2], place: usize, threshold: f64) -> Finalist {
    let metric = data.train.metric;
    let energy = |residuals: &[Vec<f64>]| metric.gram(&[slices(residuals)]).at(0, 0);
    let fitted = rivals.map(|(fit, position)| {
        let mut joint: Vec<Member> = fit.members.clone();
        let own = joint.remove(place);
        joint.push(own);
        let mut fit = fit.clone().only(place);
        fit.gain = energy(data.train.residuals) - energy(&fit.residuals);
        Fitted {
            joint,
            ..Fitted::new(fit, position)
        }
    });
    let judged = fitted.each_ref().map(|fitted| judge(data, fitted, threshold));
    let mut pairs: Vec<(Finalist, &Fitted)> = judged.into_iter().zip(&fitted).collect();
    stability(data, &mut pairs);
    let mut rival = pairs.swap_remove(0).0;
    if rival.because.is_none() && rival.stability < MAJORITY {
        let share = 100.0 * rival.stability;
        rival.because = Some(format!(
            "explains more than what stands there in {share:.0} % of the half-splits only"
        ));
    }
    rival
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Products of vectors of three numbers.
    fn gram(vectors: &[[f64; 3]]) -> Square {
        let mut gram = Square::zero(vectors.len());
        for (row, a) in vectors.iter().enumerate() {
            for (column, b) in vectors.iter().enumerate() {
                gram.set(row, column, a.iter().zip(b).map(|(a, b)| a * b).sum());
            }
        }
        gram
    }

    #[test]
    fn what_free_members_imitate_counts_for_none() {
        let (residual, candidate) = ([3.0, 4.0, 0.0], [1.0, 1.0, 0.0]);
        let all = beside(&gram(&[residual, candidate]), 0);
        assert_eq!((all.at(0, 1), all.at(1, 1)), (7.0, 2.0));
        // A member that moves the first number leaves the second one.
        let left = beside(&gram(&[residual, candidate, [2.0, 0.0, 0.0]]), 1);
        for (row, column, expected) in [(0, 0, 16.0), (0, 1, 4.0), (1, 1, 1.0)] {
            assert!((left.at(row, column) - expected).abs() < 1e-4, "{row}, {column}");
        }
    }
}
