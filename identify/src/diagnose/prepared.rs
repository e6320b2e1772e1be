//! Residuals, sensitivities and product of the runs of a role.

use crate::fit::Bounds;
use crate::floor::{Floor, Metric, knob_changes};
use crate::hypothesis::Hypothesis;
use crate::record::{Record, Stages, Window};
use crate::screen::{all_residuals, columns};
use crate::select::Side;
use crate::workers::{Cancelled, Workers};

/// With more training data than this, candidates are screened and first fitted on every second or later window of them.
const LONG_S: f64 = 120.0;
/// About so much is left of long data then.
const ENOUGH_S: f64 = 80.0;

/// Residuals, knob sensitivities and the product of some records.
#[derive(Clone)]
pub(super) struct Prepared {
    pub records: Vec<Record>,
    pub residuals: Vec<Vec<f64>>,
    pub sensitivities: Vec<Vec<Vec<f64>>>,
    pub metric: Metric,
    pub bounds: Bounds,
    /// The product in which loud windows count like all others, where references tell which are loud.
    whole: Option<Metric>,
    /// What the sensitivities are of.
    base: Hypothesis,
}

impl Prepared {
    /// Residuals under another model, and the floor's present weights.
    pub fn renew(&mut self, workers: &dyn Workers, floor: &Floor, model: &Hypothesis) -> Result<(), Cancelled> {
        let simulated = all_residuals(workers, &self.records, model)?;
        for (residual, new) in self.residuals.iter_mut().zip(simulated) {
            *residual = new.unwrap_or_else(|| residual.clone());
        }
        self.weigh(floor);
        Ok(())
    }

    /// The same under another model.
    pub fn under(&self, workers: &dyn Workers, floor: &Floor, model: &Hypothesis) -> Result<Prepared, Cancelled> {
        let mut own = self.clone();
        own.renew(workers, floor, model)?;
        Ok(own)
    }

    /// The floor's present weights.
    pub fn weigh(&mut self, floor: &Floor) {
        self.metric = floor.metric(&self.records, &self.sensitivities);
        self.bounds = Bounds::of(floor, &self.records);
        self.whole = whole(floor, &self.records, &self.sensitivities);
    }

    /// Windows that are loud under another model count less.
    pub fn doubt(&mut self, workers: &dyn Workers, floor: &Floor, model: &Hypothesis) -> Result<(), Cancelled> {
        if floor.references.is_empty() {
            return Ok(());
        }
        let simulated = all_residuals(workers, &self.records, model)?;
        let pairs = simulated.into_iter().zip(&self.residuals);
        let residuals: Vec<Vec<f64>> = pairs.map(|(new, old)| new.unwrap_or_else(|| old.clone())).collect();
        floor.doubt(&mut self.records, &residuals);
        self.weigh(floor);
        Ok(())
    }

    /// Prepared with the floor's present model. What it takes in afterwards changes the sensitivities: with the old ones a healthy robot kept a name (blind
    /// bench, seed 404, set 144).
    pub fn is_of(&self, floor: &Floor) -> bool {
        self.base == floor.model && self.sensitivities.len() == floor.knobs.len()
    }

    /// With the runs of another role, under the floor's model, all windows at their weight.
    pub fn joined(&self, workers: &dyn Workers, other: &Prepared, floor: &Floor) -> Result<Prepared, Cancelled> {
        let mut both = self.beside(other, floor);
        both.records = both.records.iter().map(Record::trusted).collect();
        both.renew(workers, floor, &floor.model)?;
        Ok(both)
    }

    /// With the runs of another role under the same model, windows at their present weight.
    pub fn beside(&self, other: &Prepared, floor: &Floor) -> Prepared {
        let chained = |a: &[Vec<f64>], b: &[Vec<f64>]| a.iter().chain(b).cloned().collect::<Vec<_>>();
        let records: Vec<Record> = self.records.iter().chain(&other.records).cloned().collect();
        let pairs = self.sensitivities.iter().zip(&other.sensitivities);
        let sensitivities: Vec<Vec<Vec<f64>>> = pairs.map(|(own, others)| chained(own, others)).collect();
        Prepared {
            metric: floor.metric(&records, &sensitivities),
            bounds: Bounds::of(floor, &records),
            whole: whole(floor, &records, &sensitivities),
            residuals: chained(&self.residuals, &other.residuals),
            base: self.base.clone(),
            records,
            sensitivities,
        }
    }

    /// The same with all windows at their weight.
    fn trusting(&self, floor: &Floor) -> Prepared {
        let records: Vec<Record> = self.records.iter().map(Record::trusted).collect();
        Prepared {
            base: self.base.clone(),
            whole: None,
            metric: floor.metric(&records, &self.sensitivities),
            bounds: Bounds::of(floor, &records),
            records,
            residuals: self.residuals.clone(),
            sensitivities: self.sensitivities.clone(),
        }
    }

    pub fn side(&self) -> Side<'_> {
        Side {
            records: &self.records,
            metric: &self.metric,
            bounds: &self.bounds,
            whole: self.whole.as_ref(),
            residuals: &self.residuals,
        }
    }

    /// Windows spread over all runs, about as many as are enough; `None` when there are no more than that.
    pub fn thinned(&self, floor: &Floor) -> Option<Prepared> {
        let kept = spread(&self.records)?;
        let records: Vec<Record> = self
            .records
            .iter()
            .zip(&kept)
            .map(|(r, kept)| r.with_windows(kept))
            .collect();
        let rows = |vectors: &[Vec<f64>]| -> Vec<Vec<f64>> {
            let runs = vectors.iter().zip(&self.records).zip(&kept);
            runs.map(|((vector, record), kept)| rows_of(record, kept, vector))
                .collect()
        };
        let residuals = rows(&self.residuals);
        let sensitivities: Vec<Vec<Vec<f64>>> = self.sensitivities.iter().map(|knob| rows(knob)).collect();
        let metric = floor.metric(&records, &sensitivities);
        Some(Prepared {
            bounds: Bounds::of(floor, &records),
            whole: whole(floor, &records, &sensitivities),
            base: self.base.clone(),
            records,
            residuals,
            sensitivities,
            metric,
        })
    }
}

fn whole(floor: &Floor, records: &[Record], sensitivities: &[Vec<Vec<f64>>]) -> Option<Metric> {
    let trusted = || records.iter().map(Record::trusted).collect::<Vec<Record>>();
    (!floor.references.is_empty()).then(|| floor.metric(&trusted(), sensitivities))
}

/// References and runs with all windows at their weight: set-points are lost in few of them.
pub(super) struct Whole {
    /// Product of the references, where there are some.
    pub references: Option<Metric>,
    pub train: Prepared,
    pub validation: Prepared,
}

impl Whole {
    pub fn of(floor: &Floor, train: &Prepared, validation: &Prepared) -> Whole {
        let references: Vec<Record> = floor.references.iter().map(Record::trusted).collect();
        Whole {
            references: (!references.is_empty()).then(|| floor.metric(&references, &floor.sensitivities)),
            train: train.trusting(floor),
            validation: validation.trusting(floor),
        }
    }
}

/// Which windows of long runs are enough, spread over all; `None` when there are no more than that.
fn spread(records: &[Record]) -> Option<Vec<Vec<bool>>> {
    let windows = records.iter().flat_map(|record| &record.windows);
    let all_s: f64 = windows.map(compared_s).sum();
    if all_s <= LONG_S {
        return None;
    }
    let every = (all_s / ENOUGH_S).ceil() as usize;
    let of = |(run, record): (usize, &Record)| (0..record.windows.len()).map(|k| (k + run) % every == 0).collect();
    Some(records.iter().enumerate().map(of).collect())
}

/// The same runs with no more windows than are enough to calibrate on.
pub(super) fn enough(records: Vec<Record>) -> Vec<Record> {
    match spread(&records) {
        Some(kept) => records
            .iter()
            .zip(&kept)
            .map(|(record, kept)| record.with_windows(kept))
            .collect(),
        None => records,
    }
}

pub(super) fn compared_s(window: &Window) -> f64 {
    window.to_s - window.from_s
}

/// The residuals of some windows.
fn rows_of(record: &Record, kept: &[bool], vector: &[f64]) -> Vec<f64> {
    let mut rows = Vec::with_capacity(vector.len());
    for (cells, kept) in record.cells_of_windows().into_iter().zip(kept) {
        if *kept {
            rows.extend_from_slice(&vector[cells]);
        }
    }
    rows
}

/// Simulates records under the floor's model and with each of its knobs.
pub(super) fn prepare(
    workers: &dyn Workers,
    floor: &Floor,
    records: Vec<Record>,
    stages: &[Stages],
) -> Result<Prepared, Cancelled> {
    let simulated = all_residuals(workers, &records, &floor.model)?;
    let (records, residuals): (Vec<Record>, Vec<Vec<f64>>) = records
        .into_iter()
        .zip(simulated)
        .filter_map(|(record, residual)| Some((record, residual?)))
        .unzip();
    let changes = knob_changes(&floor.model, &floor.knobs, &floor.values, stages);
    let sensitivities = columns(workers, &records, &residuals, &changes)?;
    let metric = floor.metric(&records, &sensitivities);
    Ok(Prepared {
        bounds: Bounds::of(floor, &records),
        whole: whole(floor, &records, &sensitivities),
        base: floor.model.clone(),
        records,
        residuals,
        sensitivities,
        metric,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::Quantity;
    use crate::record::made::{self, cell, pose};

    /// `cells` of the gyro while rolling and `poses` there, `wheels` of a wheel while driven.
    fn window(wheels: usize, cells: usize, poses: usize) -> Window {
        let wheel = vec![cell(Quantity::Wheel(0), 0.0, 0.0); wheels];
        made::window(
            wheel,
            vec![cell(Quantity::Gyro, 0.0, 0.0); cells],
            vec![pose(0.0); poses],
        )
    }

    #[test]
    fn rows_of_windows_are_those_that_the_windows_give() {
        let record = made::record(vec![window(3, 2, 1), window(4, 0, 0), window(1, 1, 2)]);
        let all: Vec<f64> = (0..record.len()).map(|k| k as f64).collect();
        assert_eq!(all.len(), 8 + 4 + 8);
        for (kept, expected) in [
            ([true, false, true], (0..8).chain(12..20).collect::<Vec<_>>()),
            ([false, true, false], (8..12).collect()),
            ([true; 3], (0..20).collect()),
            ([false; 3], Vec::new()),
        ] {
            let rows = rows_of(&record, &kept, &all);
            assert_eq!(rows, expected.iter().map(|k| f64::from(*k)).collect::<Vec<_>>());
            assert_eq!(rows.len(), record.with_windows(&kept).len());
        }
    }
}
