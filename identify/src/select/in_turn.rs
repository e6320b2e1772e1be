//! Evidence when the validation runs hardly show an effect: the training runs are asked in turn, each with what the others say.
//!
//! A limit that only the hardest run reaches, or a carpet that two runs of six drive over, acts in whichever runs chance put to training. Nothing can be
//! said of it on the validation runs, and to drop it would be to deny what the training runs shout. What is left out of a training run is as new to
//! the sizes that the other runs give as a validation run is, but the effect was chosen on it: such a name is sure only with new runs.

use super::evidence::window_energies;
use super::round::{Fitted, Round};
use crate::record::residuals;

/// Share of what an effect changes of the training runs that it changes of the validation runs, at most, for them to say nothing.
pub(super) const HARDLY: f64 = 0.1;

/// Whether the validation runs hardly show an effect: what it changes of a run, here and there.
pub(super) fn is_hardly_shown(change_validation: f64, change_train: f64) -> bool {
    change_validation < HARDLY * change_train
}

/// Residuals of every training run under the sizes that the others give; as they are where the others do not show the effect. `None` when fewer than
/// two runs show it, or the fit has no slopes that tell what the others say.
///
/// - `least`: gain from which runs show it.
pub(super) fn in_turn(data: &Round, fitted: &Fitted, least: f64) -> Option<Vec<Vec<f64>>> {
    if !fitted.joint.is_empty() {
        return None;
    }
    let (side, fit) = (&data.train, &fitted.fit);
    let gain = |run: usize| -> f64 {
        let energy = |vector: &[f64]| -> f64 {
            window_energies(side.metric, run, &side.records[run], vector)
                .iter()
                .sum()
        };
        energy(&side.residuals[run]) - energy(&fit.residuals[run])
    };
    let gains: Vec<f64> = (0..side.records.len()).map(gain).collect();
    if gains.iter().filter(|gain| **gain >= least).count() < 2 {
        return None;
    }
    let all: f64 = gains.iter().sum();
    let (mut changed, mut told) = (Vec::with_capacity(gains.len()), 0);
    for (run, record) in side.records.iter().enumerate() {
        let base = &side.residuals[run];
        let others = (all - gains[run] >= least)
            .then(|| fit.without(side.metric, run))
            .flatten();
        changed.push(match others {
            Some(members) => {
                told += 1;
                let model = crate::fit::with_members(data.model, &members);
                residuals(record, &model, members[0].candidate.stages, Some(base))?
            }
            None => base.clone(),
        });
    }
    (told >= 2).then_some(changed)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn validation_runs_say_nothing_of_what_they_hardly_show() {
        assert!(is_hardly_shown(0.0, 4000.0), "a limit that they never reach");
        assert!(is_hardly_shown(300.0, 4000.0) && !is_hardly_shown(500.0, 4000.0));
    }
}
