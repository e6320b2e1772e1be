//! References that were driven less hard than the runs: what they cannot show is learned from the runs.
//!
//! Smooth references show neither how tyres creep and slide in harsh moments nor how far the laws of a twin are off there, and what a run leaves then looks like an
//! effect, most of all like another friction of the floor. So tyres and friction are calibrated on the runs, what the references do show being
//! believed, and where the robot is driven hard the noise is what the runs themselves leave.

use super::Floor;
use super::alike::HELD_TO;
use super::noise::{ClassNoise, NoiseModel};
use crate::hypothesis::Knob;
use crate::record::{Quantity, Record, Stages};
use crate::workers::{Cancelled, Workers};

/// Share of the runs' cells beyond the reach of the references (where a fortieth of their own are) from which runs are driven otherwise.
const OTHERWISE: f64 = 0.08;
/// What the floor's friction can be off by from what is described, practical sizes; more is for a name to explain.
pub(super) const BELIEVABLE: f64 = 2.0;
/// Without references an effect has to be larger, practical sizes.
const UNDESCRIBED: f64 = 2.0;

/// By how much less likely references may be with tyres and a floor that runs show: about what a name has to explain.
const REFUTED: f64 = 40.0;

/// What is done where references were driven less hard than the runs.
const HARDER: &str = "the runs are driven harder than the references: tyres, the floor's friction and how far laws are off in harsh moments are taken from the runs; references driven as hard would show weaker effects";
/// The same where the references know other tyres.
pub const HARDER_AND_CHANGED: &str = "the runs are driven harder than the references: how far laws are off in harsh moments is taken from the runs; tyres and the floor's friction are not, since the references speak against those that the runs show, so something may have changed; references driven as hard would show weaker effects";

/// What is known of a knob before a calibration, in practical sizes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Prior {
    pub mean: f64,
    pub precision: f64,
}

/// Share of the records' cells of some quantities where more happens than the references reach; `None` when one side has none.
fn share_beyond(noise: &ClassNoise, records: &[Record], is_meant: impl Fn(Quantity) -> bool) -> Option<f64> {
    let (mut cells, mut beyond) = (0_usize, 0_usize);
    for record in records {
        let places = record.places();
        let pairs = places.iter().zip(record.activities());
        for (_, activity) in pairs.filter(|(place, _)| place.quantity.is_some_and(&is_meant)) {
            cells += 1;
            beyond += usize::from(activity > noise.reach);
        }
    }
    (cells > 0 && noise.reach > 0.0).then(|| beyond as f64 / cells as f64)
}

/// What harsh moments show of a robot and its floor.
pub(super) fn is_shown_in_harsh_moments(knob: &Knob) -> bool {
    match knob {
        Knob::Tread(_) => true,
        Knob::Parameter { name, .. } => *name == "floor_friction",
        _ => false,
    }
}

impl Floor {
    /// True when records are driven harder than the references were: by their wheels, or their gyro where no wheel is measured.
    pub fn is_driven_otherwise(&self, records: &[Record]) -> bool {
        let of = |class: usize, is_meant: fn(Quantity) -> bool| {
            share_beyond(&self.noise_of_references.classes[class], records, is_meant)
        };
        let wheels = of(0, |quantity| matches!(quantity, Quantity::Wheel(_)));
        let share = wheels.or_else(|| of(4, |quantity| quantity == Quantity::Gyro));
        !self.references.is_empty() && share.is_some_and(|share| share > OTHERWISE)
    }

    /// Tyres and the floor's friction as runs show them, and the references calibrated anew with these; when the references speak against them their own stay. From then
    /// on the runs' noise is heard as well ([`Floor::hear`]). What was done, in words.
    pub fn shown_by_runs(
        &mut self,
        workers: &dyn Workers,
        stages: &[Stages],
        runs: Vec<Record>,
    ) -> Result<&'static str, Cancelled> {
        self.is_otherwise = true;
        let known = self.values.iter().enumerate().map(|(k, mean)| Prior {
            mean: *mean,
            precision: 1.0 / self.uncertainty.at(k, k),
        });
        let known = known.collect();
        let own = Floor::calibrated_from(
            workers,
            self.given.clone(),
            self.knobs.clone(),
            stages,
            runs,
            Some(known),
        )?;
        let pairs = self.knobs.iter().zip(self.values.iter().zip(&own.values)).enumerate();
        let shown = pairs.filter(|(_, (knob, _))| is_shown_in_harsh_moments(knob));
        let held: Vec<(usize, f64)> = shown
            .map(|(k, (knob, (here, there)))| {
                let is_believable = knob.is_untold() || there.abs() <= BELIEVABLE;
                (k, if is_believable { *there } else { *here })
            })
            .collect();
        let mut own = self.clone();
        own.hold(workers, stages, &held)?;
        own.is_of_runs = held.iter().all(|(k, value)| (own.values[*k] - value).abs() < HELD_TO);
        if self.refutes(&own) {
            return Ok(HARDER_AND_CHANGED);
        }
        own.told = Some(self.own_surprise());
        *self = own;
        Ok(HARDER)
    }

    /// The references speak against tyres and a floor that runs show, by more than chance and other laws do: what differs between references and runs may be a change then,
    /// and for a name to explain.
    pub(super) fn refutes(&self, other: &Floor) -> bool {
        other.own_surprise() - self.told.unwrap_or_else(|| self.own_surprise()) > REFUTED
    }

    /// Of the references where the knobs stand.
    fn own_surprise(&self) -> f64 {
        self.surprise(&self.residuals, &self.values)
    }

    /// Why an effect of this size may have been there before: below the practical size where references could not show it; without references below twice
    /// that, for a description is off by up to one in many things at once, and what they come to together looks like another one.
    ///
    /// - `size`: in practical sizes.
    /// - `is_shown`: the references would show it at this size. What they would not show has a description's bar, as without references.
    pub fn may_have_had(&self, size: f64, is_shown: bool) -> Option<&'static str> {
        let is_undescribed = self.references.is_empty() && size < UNDESCRIBED;
        let is_unshown = self.is_otherwise && (size < 1.0 || !is_shown && size < UNDESCRIBED);
        if is_undescribed {
            return Some(
                "errors of the robot's description may add up to a size like this; runs of the unchanged robot as references would tell",
            );
        }
        is_unshown.then_some("the references were driven less hard and may not have shown a size like this")
    }

    /// The noise is that of the runs as well, and another one with every name.
    pub fn hears_runs(&self) -> bool {
        self.is_otherwise
    }

    /// References were driven less hard, and speak against the tyres and the floor that the runs show.
    pub fn has_untold_tyres(&self) -> bool {
        self.is_otherwise && !self.is_of_runs && !self.references.is_empty()
    }

    /// Takes into the noise what runs leave under the present model, where references were driven otherwise.
    pub fn hear(&mut self, records: &[Record], residuals: &[Vec<f64>]) {
        if self.is_otherwise {
            self.noise = self.noise_of_references.clone().raised(records, residuals);
        }
    }
}

impl NoiseModel {
    /// At least as loud in lively cells as residuals of other runs are; quiet cells as they were.
    fn raised(mut self, records: &[Record], residuals: &[Vec<f64>]) -> NoiseModel {
        for (class, noise) in self.classes.iter_mut().enumerate() {
            let mut cells: Vec<(f64, f64)> = Vec::new();
            for (record, residual) in records.iter().zip(residuals) {
                let places = record.places();
                for ((place, activity), value) in places.iter().zip(record.activities()).zip(residual) {
                    if place.quantity.is_some_and(|quantity| quantity.class() == class) {
                        cells.push((activity, value * value));
                    }
                }
            }
            *noise = noise.raised(&mut cells);
        }
        for modes in &mut self.modes {
            modes.raise(records, residuals);
        }
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hypothesis::Hypothesis;
    use crate::record::made::{cell, record, window};

    /// `cells` of a quantity, so many of them with an activity of 9, the others of 1.
    fn driven(quantity: Quantity, cells: usize, lively: usize) -> Record {
        let of = |k: usize| cell(quantity, 0.05 * k as f64, if k < lively { 9.0 } else { 1.0 });
        record(vec![window((0..cells).map(of).collect(), Vec::new(), Vec::new())])
    }

    fn floor() -> Floor {
        let given = Hypothesis::nominal(&twin::golden::reference_robot("diff2"));
        let mut floor = Floor::stated(given, Vec::new());
        floor.references = vec![driven(Quantity::Wheel(0), 1, 0)];
        for class in &mut floor.noise_of_references.classes {
            class.reach = 2.0;
        }
        floor
    }

    #[test]
    fn runs_are_driven_otherwise_when_many_cells_are_beyond_the_reach_of_references() {
        let mut floor = floor();
        let of = |quantity, lively| [driven(quantity, 1000, lively)];
        assert!(!floor.is_driven_otherwise(&of(Quantity::Wheel(0), 70)));
        assert!(floor.is_driven_otherwise(&of(Quantity::Wheel(0), 90)));
        assert!(!floor.is_driven_otherwise(&[]));
        // The gyro speaks where no wheel is measured, and only there.
        assert!(floor.is_driven_otherwise(&of(Quantity::Gyro, 90)));
        let both = [driven(Quantity::Wheel(0), 1000, 0), driven(Quantity::Gyro, 1000, 1000)];
        assert!(!floor.is_driven_otherwise(&both));
        // A reach that no cell of references told says nothing.
        floor.noise_of_references.classes[4].reach = 0.0;
        assert!(!floor.is_driven_otherwise(&of(Quantity::Gyro, 90)));
        floor.references.clear();
        assert!(!floor.is_driven_otherwise(&of(Quantity::Wheel(0), 90)));
    }

    #[test]
    fn lively_cells_are_as_loud_as_runs_have_them_and_quiet_ones_as_references() {
        let mut floor = floor();
        let run = driven(Quantity::Wheel(0), 2000, 1000);
        let before = floor.noise.classes[0];
        let loud = 10.0 * before.at(9.0).sqrt();
        let mut random = crate::random::Random::new(3, 1);
        let mut residual = |lively: f64| -> Vec<f64> {
            let quiet = before.at(1.0).sqrt();
            let of = |k| random.normal() * if k < 1000 { lively } else { quiet };
            (0..2000).map(of).collect()
        };
        let (quietly, loudly) = (residual(0.1 * before.at(9.0).sqrt()), residual(loud));
        floor.noise_of_references = floor.noise.clone();
        floor.hear(core::slice::from_ref(&run), core::slice::from_ref(&loudly));
        assert_eq!(floor.noise, floor.noise_of_references, "references drove alike");
        floor.is_otherwise = true;
        floor.hear(core::slice::from_ref(&run), core::slice::from_ref(&loudly));
        let raised = floor.noise.classes[0];
        assert_eq!(raised.level, before.level);
        assert!((raised.at(9.0).sqrt() / loud - 1.0).abs() < 0.1, "{raised:?}");
        // Heard anew, with what explains it in the model: as before.
        floor.hear(core::slice::from_ref(&run), core::slice::from_ref(&quietly));
        assert_eq!(floor.noise, floor.noise_of_references);
    }

    /// References that are a little less likely say nothing; much less likely they speak against what they are calibrated with. Never the other way.
    #[test]
    fn references_that_become_much_less_likely_refute_a_calibration() {
        let own = {
            let mut own = floor();
            own.references = vec![driven(Quantity::Wheel(0), 1000, 0)];
            own.residuals = vec![vec![0.0; 1000]];
            own
        };
        let sigma = own.yardstick.classes[0].at(1.0).sqrt();
        let with = |off: usize| {
            let mut other = own.clone();
            other.residuals[0][..off].fill(3.0 * sigma);
            other
        };
        let (slightly, surely) = (with(3), with(100));
        assert!(!own.refutes(&own) && !own.refutes(&slightly));
        assert!(own.refutes(&surely) && !surely.refutes(&own));
    }

    #[test]
    fn what_is_smaller_than_practical_may_have_been_there_before() {
        let mut floor = floor();
        assert!(floor.may_have_had(0.8, true).is_none() && !floor.has_untold_tyres());
        floor.is_otherwise = true;
        assert!(floor.may_have_had(0.8, true).is_some() && floor.may_have_had(1.1, true).is_none());
        assert!(floor.may_have_had(1.1, false).is_some() && floor.may_have_had(2.0, false).is_none());
        assert!(floor.has_untold_tyres());
        floor.is_of_runs = true;
        assert!(!floor.has_untold_tyres(), "the runs have told them");
    }

    #[test]
    fn without_references_a_small_size_may_be_what_the_description_is_off_by() {
        let mut floor = floor();
        floor.references.clear();
        assert!(
            floor
                .may_have_had(1.9, true)
                .is_some_and(|why| why.contains("description"))
        );
        assert_eq!(floor.may_have_had(2.0, true), None);
        assert_eq!(floor.may_have_had(f64::INFINITY, true), None, "a limit");
    }
}
