//! Set-points that never arrived: the robot goes on with the last one. Which were lost is of a run, not of a model, so it is read from the
//! wheel speeds of the run itself, and the run is compared as if only the others had been sent.

mod response;
mod rewrite;
mod spans;

pub use response::StepResponse;
pub use rewrite::without;
use spans::is_among;
pub use spans::{COST, Lost, Seen, Sent, lost, seen};

use crate::bundle::Bundle;
use crate::floor::NoiseModel;
use crate::hypothesis::Hypothesis;
use crate::record::{Chain, Quantity, Record, Stages, residuals};

/// Times that losses are looked for in what the ones found before leave.
const PASSES: usize = 4;
/// Time for which a span shows, s.
const SHOWS_S: f64 = 0.6;
/// Part of its cost that a new span must gain when it is simulated.
const HELPS: f64 = 0.7;

/// A run with the set-points that arrived.
#[derive(Debug, Clone)]
pub struct Arrived {
    pub bundle: Bundle,
    pub record: Record,
    pub spans: Vec<Lost>,
    /// How much of the time a loss would have been seen, and how much of it was lost.
    pub seen: Seen,
    /// Energy of the wheel speeds over the noise as sent and as arrived.
    pub wheels: [f64; 2],
}

/// Finds what was lost in a run; `None` when it cannot be simulated.
pub fn arrived(name: &str, bundle: &Bundle, model: &Hypothesis, noise: &NoiseModel) -> Option<Arrived> {
    let robot = model.robot()?;
    let drive = Stages {
        drive: true,
        rolling: false,
    };
    let mut record = Record::of(name, bundle);
    let response = StepResponse::of(&record, &robot)?;
    let weights = noise.weights(&record);
    let sent = Sent::of(bundle);
    let simulate = |record: &Record| residuals(record, model, drive, Some(&vec![0.0; record.len()]));
    let mut residual = simulate(&record)?;
    let energy = |record: &Record, residual: &[f64]| -> f64 {
        let wheels = record.places().into_iter().zip(&weights).zip(residual);
        let wheels = wheels.filter(|((place, _), _)| matches!(place.quantity, Some(Quantity::Wheel(_))));
        wheels.map(|((_, weight), value)| weight * value * value).sum()
    };
    let as_sent = energy(&record, &residual);
    let mut found = bundle.clone();
    let mut spans: Vec<Lost> = Vec::new();
    for _ in 0..PASSES {
        let more = lost(&record, &residual, &weights, &sent, &spans, &response);
        if more == spans {
            break;
        }
        let trial = without(bundle, &more);
        let trial_record = Record::of(name, &trial);
        let trial_residual = simulate(&trial_record)?;
        if trial_residual.len() != residual.len() {
            break;
        }
        // Wheels that slip are not linear: what does not help where it is was none.
        let helps = helping(&record, &residual, &trial_residual, &weights, &more, &spans);
        let (trial, trial_record, trial_residual) = if helps == more {
            (trial, trial_record, trial_residual)
        } else {
            let trial = without(bundle, &helps);
            let trial_record = Record::of(name, &trial);
            let trial_residual = simulate(&trial_record)?;
            (trial, trial_record, trial_residual)
        };
        if trial_residual.len() != residual.len() {
            break;
        }
        spans = helps;
        (found, record, residual) = (trial, trial_record, trial_residual);
    }
    let seen = seen(&record, &weights, &sent, &spans, &response);
    Some(Arrived {
        wheels: [as_sent, energy(&record, &residual)],
        bundle: found,
        record,
        spans,
        seen,
    })
}

/// Of spans those that were known, and new ones in windows whose wheels are so much nearer with them as they cost.
fn helping(
    record: &Record,
    before: &[f64],
    after: &[f64],
    weights: &[f64],
    spans: &[Lost],
    known: &[Lost],
) -> Vec<Lost> {
    let mut kept = vec![true; spans.len()];
    let mut gain_before = 0.0;
    let mut from = 0;
    for window in &record.windows {
        let cells = window.drive.cells.iter().enumerate();
        let wheels = cells.filter(|(_, cell)| matches!(cell.quantity, Quantity::Wheel(_)));
        let gain: f64 = wheels
            .map(|(k, _)| weights[from + k] * (before[from + k] * before[from + k] - after[from + k] * after[from + k]))
            .sum();
        let position = |time_s: f64| spans.partition_point(|span| span.from_s < time_s);
        let is_new = |k: &usize| !is_among(known, &spans[*k]);
        let here: Vec<usize> = (position(window.from_s)..position(window.to_s))
            .filter(is_new)
            .collect();
        if gain < HELPS * COST * here.len() as f64 {
            here.into_iter().for_each(|k| kept[k] = false);
        }
        // What is worse may have come just before it, if that has not gained more there.
        if gain < -COST && gain + gain_before < 0.0 {
            let shortly_before = position(window.from_s - SHOWS_S)..position(window.from_s);
            shortly_before.filter(is_new).for_each(|k| kept[k] = false);
        }
        gain_before = gain;
        from += window.drive.len() + window.rolling.as_ref().map_or(0, Chain::len);
    }
    let pairs = spans.iter().zip(kept);
    pairs.filter(|(_, kept)| *kept).map(|(span, _)| *span).collect()
}
