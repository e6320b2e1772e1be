//! Whether one robot explains references and runs: what seems to have changed on the floor may be a calibration that the references alone left open.
//!
//! How hard tyres hold, how far they slide and how slippery the floor is are told by the same few moments, and references have few of them. Calibrated on these, a
//! healthy robot may be wrong in others, which runs then show, and less friction explains them. So the tyres and the friction are fitted to references and runs
//! together, once alike everywhere and once with the effect in the runs, what else is named in both: an effect that is no better is the calibration's.

use super::Floor;
use super::otherwise::{BELIEVABLE, is_shown_in_harsh_moments};
use crate::hypothesis::{Hypothesis, Knob, realised};
use crate::record::{Record, Stages};
use crate::screen::{Change, all_residuals, columns};
use crate::workers::{Cancelled, Workers};
use twin::effect::Effect;

/// Times that slopes are taken anew from each start.
const LINEARISATIONS: usize = 3;
/// Steps from one linearisation.
const STEPS: usize = 4;
/// First damping of a step, and its factor after one that was too long.
const DAMPING: f64 = 0.01;
const SHORTER: f64 = 10.0;
/// Laws are not linear: a fit may become likelier by this many times what its slopes promise.
const HOPE: f64 = 4.0;
/// What is held may move by, practical sizes.
pub(super) const HELD_TO: f64 = 1e-3;

/// What the runs are said to have that the references do not.
#[derive(Debug, Clone, Copy)]
pub struct Named<'a> {
    /// All that is named, with what is about to be named on the floor.
    pub with: &'a [Effect],
    /// All that is named so far.
    pub without: &'a [Effect],
    /// Of the friction, as the effect has it.
    pub scale: f64,
}

/// References and runs under one calibration of tyres and friction, the runs with effects.
#[derive(Clone)]
struct Together {
    /// Its references are all records, those of the runs behind `unchanged` others.
    floor: Floor,
    unchanged: usize,
    effects: Vec<Effect>,
}

impl Floor {
    /// Tyres and friction with which one robot explains references and runs alike as well as the effect does, and the references calibrated anew with them;
    /// `None` when the effect is better by `least`, the references speak against it, or the floor would have to be further from what is described than a description can be
    /// off by.
    ///
    /// - `least`: gain that the effect needs.
    pub fn alike(
        &self,
        workers: &dyn Workers,
        stages: &[Stages],
        runs: &[Record],
        named: Named,
        least: f64,
    ) -> Result<Option<Floor>, Cancelled> {
        let friction = self.knobs.iter().position(Knob::is_friction);
        let Some(friction) = friction.filter(|_| !self.references.is_empty()) else {
            return Ok(None);
        };
        let open: Vec<usize> = (0..self.knobs.len())
            .filter(|k| is_shown_in_harsh_moments(&self.knobs[*k]))
            .collect();
        let Some(k) = open.iter().position(|k| *k == friction) else {
            return Ok(None);
        };
        let Knob::Parameter { practical, .. } = self.knobs[friction] else {
            return Ok(None);
        };
        let there = ((1.0 + practical * self.values[friction]) * named.scale - 1.0) / practical;
        let mut alike = Together::of(self, &open, runs, named.without);
        let mut moved = alike.clone();
        let mut with = Together::of(self, &open, runs, named.with);
        with.begin(workers)?;
        if !with.surprise().is_finite() {
            return Ok(None);
        }
        // With the effect the runs can only become likelier still.
        let goal = with.surprise() + least;
        let is_hopeless = |now: f64, promised: f64| is_out_of_reach(now, promised, goal);
        alike.fit(workers, None, is_hopeless)?;
        moved.fit(workers, Some((k, there)), is_hopeless)?;
        let end = |together: &Together| (together.floor.values[k].abs() <= BELIEVABLE, together.surprise());
        if is_better(end(&moved), end(&alike)) {
            alike = moved;
        }
        let is_believable = alike.floor.values[k].abs() <= BELIEVABLE;
        let best = alike.surprise();
        with.fit(workers, None, |now, _| best - now > least)?;
        let apart = best - with.surprise();
        if !apart.is_finite() || apart > least || !is_believable {
            return Ok(None);
        }
        let mut own = self.clone();
        own.absorbed.clear();
        own.references = self.references.iter().map(Record::trusted).collect();
        // What the references have was in the model of their residuals, and is in neither calibration.
        if !self.absorbed.is_empty() {
            let model = realised(&self.given, &self.knobs, &self.values);
            let simulated = all_residuals(workers, &own.references, &model)?;
            let Some(residuals) = simulated.into_iter().collect() else {
                return Ok(None);
            };
            own.residuals = residuals;
        }
        let before = own.clone();
        (own.is_otherwise, own.is_of_runs) = (true, true);
        let held: Vec<(usize, f64)> = open.iter().copied().zip(alike.floor.values).collect();
        own.hold(workers, stages, &held)?;
        let is_held = held.iter().all(|(k, value)| (own.values[*k] - value).abs() < HELD_TO);
        Ok((is_held && !before.refutes(&own)).then_some(own))
    }
}

impl Together {
    fn of(floor: &Floor, open: &[usize], runs: &[Record], effects: &[Effect]) -> Together {
        let mut others = floor.values.clone();
        open.iter().for_each(|k| others[*k] = 0.0);
        let given = realised(&floor.given, &floor.knobs, &others);
        let of = |values: &[f64]| open.iter().map(|k| values[*k]).collect::<Vec<f64>>();
        let mut own = Floor::stated(given, open.iter().map(|k| floor.knobs[*k].clone()).collect());
        own.yardstick = floor.yardstick.clone();
        own.values = of(&floor.values);
        own.prior = open.iter().map(|k| floor.prior[*k]).collect();
        let records = floor.references.iter().chain(runs);
        own.references = records.map(Record::trusted).collect();
        Together {
            floor: own,
            unchanged: floor.references.len(),
            effects: effects.to_vec(),
        }
    }

    /// Of everything under the present calibration.
    fn surprise(&self) -> f64 {
        match self.floor.residuals.is_empty() {
            true => f64::INFINITY,
            false => self.floor.surprise(&self.floor.residuals, &self.floor.values),
        }
    }

    /// With the effects of the runs.
    fn changed(&self, model: &Hypothesis) -> Hypothesis {
        let effects = self.effects.iter().cloned();
        effects.fold(model.clone(), |model, effect| model.with(effect))
    }

    fn simulated(&self, workers: &dyn Workers, values: &[f64]) -> Result<Option<Vec<Vec<f64>>>, Cancelled> {
        let model = realised(&self.floor.given, &self.floor.knobs, values);
        let (references, runs) = self.floor.references.split_at(self.unchanged);
        let mut all = all_residuals(workers, references, &model)?;
        all.extend(all_residuals(workers, runs, &self.changed(&model))?);
        Ok(all.into_iter().collect())
    }

    /// Everything under the calibration where it stands; what cannot be simulated stays unknown.
    fn begin(&mut self, workers: &dyn Workers) -> Result<(), Cancelled> {
        if let Some(residuals) = self.simulated(workers, &self.floor.values)? {
            self.floor.residuals = residuals;
        }
        Ok(())
    }

    /// Turns the knobs as long as everything becomes likelier.
    ///
    /// - `first`: a knob and where it is until the others have been turned.
    /// - `is_decided`: of the surprise now and what slopes promise to take from it, whether more turning changes no answer.
    fn fit(
        &mut self,
        workers: &dyn Workers,
        first: Option<(usize, f64)>,
        is_decided: impl Fn(f64, f64) -> bool,
    ) -> Result<(), Cancelled> {
        if let Some((k, value)) = first {
            self.floor.values[k] = value;
        }
        self.begin(workers)?;
        if self.floor.residuals.is_empty() {
            return Ok(());
        }
        for time in 0..LINEARISATIONS {
            let held: Vec<(usize, f64)> = first.filter(|_| time == 0).into_iter().collect();
            // Far from where the knobs belong the first slopes promise little of what there is to come.
            if is_decided(self.surprise(), f64::INFINITY) {
                break;
            }
            self.linearise(workers)?;
            if time > 0 && is_decided(self.surprise(), self.promised()) {
                break;
            }
            let mut damping = DAMPING;
            for _ in 0..STEPS {
                let is_taken = self.take(workers, &held, damping)?;
                damping = match is_taken {
                    true => (damping / SHORTER).max(DAMPING),
                    false => damping * SHORTER,
                };
            }
        }
        Ok(())
    }

    /// What the slopes promise to take from the surprise.
    fn promised(&self) -> f64 {
        let floor = &self.floor;
        let step = floor.step(&floor.residuals, &floor.values, &[], 0.0);
        let values = floor.after(&step);
        let turned: Vec<f64> = values.iter().zip(&floor.values).map(|(to, from)| to - from).collect();
        let mut residuals = floor.residuals.clone();
        for (knob, amount) in floor.sensitivities.iter().zip(&turned) {
            for (residual, slope) in residuals.iter_mut().flatten().zip(knob.iter().flatten()) {
                *residual -= amount * slope;
            }
        }
        self.surprise() - floor.surprise(&residuals, &values)
    }

    fn linearise(&mut self, workers: &dyn Workers) -> Result<(), Cancelled> {
        let floor = &self.floor;
        let steps = floor.knobs.iter().zip(&floor.values);
        let steps: Vec<f64> = steps.map(|(knob, value)| knob.step(*value)).collect();
        let changes: Vec<Change> = (0..floor.knobs.len())
            .map(|k| {
                let mut values = floor.values.clone();
                values[k] += steps[k];
                Change {
                    hypothesis: realised(&floor.given, &floor.knobs, &values),
                    added: 0,
                    stages: Stages::BOTH,
                    step: steps[k],
                }
            })
            .collect();
        let (references, runs) = floor.references.split_at(self.unchanged);
        let (base, base_of_runs) = floor.residuals.split_at(self.unchanged);
        let mut all = columns(workers, references, base, &changes)?;
        let changes: Vec<Change> = changes
            .into_iter()
            .map(|change| Change {
                hypothesis: self.changed(&change.hypothesis),
                ..change
            })
            .collect();
        let of_runs = columns(workers, runs, base_of_runs, &changes)?;
        all.iter_mut().zip(of_runs).for_each(|(all, runs)| all.extend(runs));
        self.floor.sensitivities = all;
        Ok(())
    }

    /// Takes a step when it makes everything likelier; else false.
    fn take(&mut self, workers: &dyn Workers, held: &[(usize, f64)], damping: f64) -> Result<bool, Cancelled> {
        let floor = &self.floor;
        let step = floor.step(&floor.residuals, &floor.values, held, damping);
        let values = floor.after(&step);
        let Some(residuals) = self.simulated(workers, &values)? else {
            return Ok(false);
        };
        let is_likelier = self.floor.surprise(&residuals, &values) < self.surprise();
        if is_likelier {
            (self.floor.values, self.floor.residuals) = (values, residuals);
        }
        Ok(is_likelier)
    }
}

/// Of two ends of a calibration one that can be believed goes before one that cannot, and then the likelier one.
///
/// - Each: whether it can be believed, and its surprise.
fn is_better((is_believable, surprise): (bool, f64), (is_other_believable, other): (bool, f64)) -> bool {
    let is_known = |surprise: f64| surprise.is_finite();
    match (
        is_believable && is_known(surprise),
        is_other_believable && is_known(other),
    ) {
        (true, false) => true,
        (false, true) => false,
        _ => surprise < other,
    }
}

/// Whether slopes leave no hope that a surprise falls to a goal.
fn is_out_of_reach(now: f64, promised: f64, goal: f64) -> bool {
    now > goal && now - HOPE * promised.max(0.0) > goal
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_end_that_can_be_believed_goes_before_a_likelier_one() {
        assert!(is_better((true, 1611.0), (false, 1609.0)));
        assert!(!is_better((false, 1609.0), (true, 1611.0)));
        assert!(is_better((true, 1609.0), (true, 1611.0)) && !is_better((true, 1611.0), (true, 1609.0)));
        assert!(is_better((false, 1609.0), (false, 1611.0)));
        assert!(
            is_better((false, 1609.0), (true, f64::INFINITY)),
            "what cannot be simulated is no end"
        );
    }

    #[test]
    fn a_calibration_is_given_up_far_from_its_goal_and_never_beyond_it() {
        assert!(is_out_of_reach(1000.0, 100.0, 500.0));
        assert!(
            !is_out_of_reach(1000.0, 200.0, 500.0),
            "four times what is promised would do"
        );
        assert!(is_out_of_reach(1000.0, -5.0, 500.0));
        assert!(!is_out_of_reach(499.0, -5.0, 500.0), "it is there");
        assert!(!is_out_of_reach(1000.0, f64::INFINITY, 500.0));
    }
}
