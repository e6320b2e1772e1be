//! How far a true effect could show through noise, everyday differences from run to run, and what references leave open, as the diagnosis takes them to be.

use anyhow::{Context, Result};
use identify::diagnose::calibrated_floor;
use identify::floor::{Floor, knob_changes};
use identify::linear::Square;
use identify::record::{Record, Stages, residuals};
use identify::screen::columns;
use identify::workers::Serial;
use std::ops::Range;

use crate::set::{Driven, Known};

/// Prior standard deviation of a knob that is taken to be known, in practical sizes, squared.
const KNOWN: f64 = 1e-9;

/// A set's runs under the twin as calibrated on its references, without and with the true effect.
pub struct Reach {
    pub floor: Floor,
    pub records: Vec<Record>,
    /// Residuals `[run][position]`.
    pub without: Vec<Vec<f64>>,
    pub with: Vec<Vec<f64>>,
    /// Changes of the floor's knobs `[knob][run][position]`.
    pub sensitivities: Vec<Vec<Vec<f64>>>,
}

/// Twice the logarithm of a likelihood ratio.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gain {
    /// Of the change as the library describes the truth best, were the twin right in all else: the squared distance of a matched filter.
    pub expected: f64,
    /// What these runs give.
    pub got: f64,
}

impl Reach {
    /// - Errors: references that cannot be calibrated on, runs that cannot be simulated.
    pub fn of(driven: &Driven, known: &Known) -> Result<Reach> {
        let floor = calibrated_floor(&Serial, &driven.references, None)?;
        let changed = floor.model.with(known.best.effect());
        let stages = vec![Stages::BOTH; floor.knobs.len()];
        let records: Vec<Record> = driven
            .runs
            .iter()
            .map(|run| Record::of(&run.path, &run.bundle))
            .collect();
        let simulated = |model| -> Result<Vec<Vec<f64>>> {
            let all = records
                .iter()
                .map(|record| residuals(record, model, Stages::BOTH, None));
            let all: Option<_> = all.collect();
            all.context("a run cannot be simulated")
        };
        let (without, with) = (simulated(&floor.model)?, simulated(&changed)?);
        let changes = knob_changes(&floor.model, &floor.knobs, &floor.values, &stages);
        let sensitivities = columns(&Serial, &records, &without, &changes)?;
        Ok(Reach {
            floor,
            records,
            without,
            with,
            sensitivities,
        })
    }

    /// Of some runs together.
    ///
    /// - `floor`: what is unknown; [`Reach::floor`] or one of [`Reach::known`].
    pub fn gain(&self, floor: &Floor, runs: Range<usize>) -> Gain {
        let of = |all: &[Vec<f64>]| all[runs.clone()].to_vec();
        let knobs: Vec<Vec<Vec<f64>>> = self.sensitivities.iter().map(|knob| of(knob)).collect();
        let metric = floor.metric(&self.records[runs.clone()], &knobs);
        let (without, with) = (&self.without[runs.clone()], &self.with[runs.clone()]);
        let change: Vec<Vec<f64>> = without
            .iter()
            .zip(with)
            .map(|(without, with)| without.iter().zip(with).map(|(a, b)| a - b).collect())
            .collect();
        let gram = metric.gram(&[views(without), views(with), views(&change)]);
        Gain {
            expected: gram.at(2, 2),
            got: gram.at(0, 0) - gram.at(1, 1),
        }
    }

    /// The floor of somebody who knows every knob of the robot on the day of the references, and with `is_every_day` on every day.
    pub fn known(&self, is_every_day: bool) -> Floor {
        let mut floor = self.floor.clone();
        let count = floor.knobs.len();
        floor.uncertainty = Square::zero(count);
        for k in 0..count {
            floor.uncertainty.set(k, k, KNOWN);
            if is_every_day {
                floor.variation[k] = KNOWN;
            }
        }
        floor
    }
}

fn views(vectors: &[Vec<f64>]) -> Vec<&[f64]> {
    vectors.iter().map(Vec::as_slice).collect()
}
