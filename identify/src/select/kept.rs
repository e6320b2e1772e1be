//! What is kept from round to round: sensitivities, and fits of a model that has not changed since.

use super::finalist::Finalist;
use super::round::{Fitted, Stop};
use super::survey::Patch;

/// A candidate whose fit came to nothing is fitted again when its score has risen by this factor.
const PROMISING: f64 = 1.5;

/// Sensitivities of all candidates' columns on the training runs, what came of fits, and the fits of the present model.
#[derive(Debug, Default)]
pub struct Kept {
    /// `[column][record]`.
    pub(super) columns: Vec<Vec<Vec<f64>>>,
    /// They are taken at the present model.
    pub(super) is_fresh: bool,
    /// Candidates whose fits came to nothing, with the scores that promised more.
    pub(super) vain: Vec<(usize, f64)>,
    /// The same of those that were fitted and refused since the last effect was accepted.
    refused: Vec<(usize, f64)>,
    /// So many of them were before the floor's model last took something in.
    refused_before: usize,
    /// Of the last round, while the model is the same.
    pub(super) fitted: Vec<Fitted>,
    /// Where patches explain most at the present model; unknown before anybody asked.
    patches: Option<Vec<Patch>>,
    /// Fits begun there, at the present model.
    pub(super) surveyed: Vec<Fitted>,
}

impl Kept {
    pub(super) fn columns(&self) -> &[Vec<Vec<f64>>] {
        &self.columns
    }

    /// The model has changed: good enough to see that nothing is left, not to choose with.
    pub fn outdate(&mut self) {
        self.is_fresh = false;
        self.refused.clear();
        self.refused_before = 0;
        self.fitted.clear();
        self.patches = None;
        self.surveyed.clear();
    }

    /// The floor's model has taken something in: what was fitted is fitted again.
    pub fn absorb(&mut self) {
        self.refused_before = self.refused.len();
        self.fitted.clear();
        self.patches = None;
        self.surveyed.clear();
    }

    /// Until an effect is accepted, what a round refused is fitted again only when much more of it is seen: the floor's model takes in
    /// what it can from round to round, which changes little for the others.
    pub fn refuse(&mut self, stop: &Stop) {
        let is_refused = |finalist: &&Finalist| finalist.because.is_some() && !finalist.is_background();
        let refused = stop.finalists.iter().filter(is_refused);
        self.refused
            .extend(refused.map(|finalist| (finalist.position, stop.scores[finalist.position].gain)));
    }

    /// Nothing is left to accept or to take into the floor's model: what was refused before that model was complete is fitted once more.
    /// Beside what is named only if that model has changed since: what the named effects refused they would refuse again. Whether there is anything.
    pub fn reconsider(&mut self, is_any_named: bool) -> bool {
        let heard = if is_any_named {
            self.refused_before
        } else {
            self.refused.len()
        };
        self.refused.drain(..heard);
        self.refused_before = 0;
        heard > 0
    }

    /// Where patches explain most at the present model, asked for once.
    pub(super) fn patches_or<E>(&mut self, ask: impl FnOnce() -> Result<Vec<Patch>, E>) -> Result<&[Patch], E> {
        if self.patches.is_none() {
            self.patches = Some(ask()?);
        }
        Ok(self.patches.as_deref().unwrap_or_default())
    }

    /// Fits that were begun where patches explain most; none where one has to be finished.
    pub(super) fn take_surveyed(&mut self) -> Vec<Fitted> {
        let all = core::mem::take(&mut self.surveyed);
        if all.iter().all(Fitted::is_finished) {
            all
        } else {
            Vec::new()
        }
    }

    /// Candidates that are not looked at any more.
    pub fn leave(&mut self, positions: &[usize]) {
        self.vain
            .extend(positions.iter().map(|position| (*position, f64::INFINITY)));
    }

    pub fn is_left(&self, position: usize) -> bool {
        self.vain
            .iter()
            .any(|known| known.0 == position && known.1.is_infinite())
    }

    /// A fit came to nothing in an earlier round, and the score promises hardly more now.
    pub(super) fn is_vain(&self, position: usize, score: f64) -> bool {
        let known = self
            .vain
            .iter()
            .chain(&self.refused)
            .filter(|known| known.0 == position);
        known.map(|known| known.1).fold(0.0, f64::max) * PROMISING > score
    }
}

/// What is remembered of a list, and the candidates of it that are to be fitted: those of which nothing is, or of which a start was given
/// up for what others explained then.
pub(super) fn remembered_of(remembered: &mut Vec<Fitted>, list: &[usize]) -> (Vec<Fitted>, Vec<usize>) {
    let is_known = |position: usize| {
        let mut own = remembered
            .iter()
            .filter(|fitted| fitted.position == position)
            .peekable();
        own.peek().is_some() && own.all(Fitted::is_finished)
    };
    let (known, unknown): (Vec<usize>, Vec<usize>) = list.iter().partition(|position| is_known(**position));
    let all = core::mem::take(remembered);
    let (own, others) = all.into_iter().partition(|fitted| known.contains(&fitted.position));
    *remembered = others;
    (own, unknown)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::Fit;
    use crate::linear::Square;

    #[test]
    fn what_was_refused_is_heard_once_more_and_what_came_to_nothing_is_not() {
        let mut kept = Kept {
            vain: vec![(5, 40.0)],
            refused: vec![(3, 40.0)],
            ..Kept::default()
        };
        assert!(kept.is_vain(3, 50.0) && kept.is_vain(5, 50.0) && !kept.is_vain(4, 50.0));
        assert!(!kept.is_vain(3, 61.0), "half as much again is seen of it");
        assert!(!kept.reconsider(true), "the floor's model is the same");
        assert!(kept.reconsider(false));
        assert!(!kept.is_vain(3, 50.0) && kept.is_vain(5, 50.0));
        assert!(!kept.reconsider(false), "nothing is left to hear");
        kept.refused.push((3, 40.0));
        kept.absorb();
        assert!(kept.reconsider(true), "the floor's model has changed since");
        assert!(!kept.is_vain(3, 50.0) && !kept.reconsider(true));
        kept.refused.push((3, 40.0));
        kept.absorb();
        kept.refused.push((6, 40.0));
        assert!(kept.reconsider(true) && !kept.is_vain(3, 50.0));
        assert!(
            kept.is_vain(6, 50.0),
            "what the names refused since they would refuse again"
        );
    }

    #[test]
    fn fits_are_remembered_until_something_is_taken_in_and_those_given_up_are_not() {
        let fitted = |position: usize, is_given_up: bool| {
            let fit = Fit {
                members: Vec::new(),
                gain: 10.0,
                residuals: Vec::new(),
                covariance: Square::zero(0),
                free: Vec::new(),
                jacobian: Vec::new(),
                simulations: 0,
                is_given_up,
            };
            Fitted::new(fit, position)
        };
        let all = || {
            vec![
                fitted(3, false),
                fitted(3, false),
                fitted(5, false),
                fitted(5, true),
                fitted(7, false),
                Fitted {
                    is_open: true,
                    ..fitted(8, false)
                },
            ]
        };
        let mut remembered = all();
        let (own, unknown) = remembered_of(&mut remembered, &[5, 3, 9, 8]);
        let positions = |of: &[Fitted]| of.iter().map(|fitted| fitted.position).collect::<Vec<_>>();
        assert_eq!((positions(&own), unknown), (vec![3, 3], vec![5, 9, 8]));
        assert_eq!(positions(&remembered), [5, 5, 7, 8]);
        for forget in [Kept::outdate, Kept::absorb] {
            let mut kept = Kept {
                fitted: all(),
                surveyed: all(),
                ..Kept::default()
            };
            forget(&mut kept);
            assert!(kept.fitted.is_empty() && kept.surveyed.is_empty());
        }
        let mut kept = Kept {
            surveyed: vec![fitted(3, false), fitted(3, false)],
            ..Kept::default()
        };
        assert_eq!(positions(&kept.take_surveyed()), [3, 3]);
        kept.surveyed = vec![fitted(3, false), fitted(3, true)];
        assert!(
            kept.take_surveyed().is_empty(),
            "one was given up: all are fitted again"
        );
    }

    #[test]
    fn patches_are_surveyed_once_at_each_model() {
        let mut kept = Kept::default();
        let asked = core::cell::Cell::new(0);
        let ask = || {
            asked.set(asked.get() + 1);
            Ok::<Vec<Patch>, ()>(Vec::new())
        };
        assert_eq!(
            kept.patches_or(|| Err::<Vec<Patch>, &str>("cancelled")),
            Err("cancelled")
        );
        let _patches = kept.patches_or(ask).map(<[Patch]>::len);
        let _patches = kept.patches_or(ask).map(<[Patch]>::len);
        assert_eq!(asked.get(), 1);
        kept.outdate();
        let _patches = kept.patches_or(ask).map(<[Patch]>::len);
        assert_eq!(asked.get(), 2, "the model has changed");
        kept.absorb();
        let _patches = kept.patches_or(ask).map(<[Patch]>::len);
        assert_eq!(asked.get(), 3, "the floor's model has changed");
    }
}
