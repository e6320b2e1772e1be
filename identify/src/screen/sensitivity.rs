//! Secant sensitivities by simulation.

use crate::hypothesis::Hypothesis;
use crate::record::{Record, Stages, residuals, residuals_with};
use crate::workers::{Cancelled, Workers, gathered};

/// A changed hypothesis whose difference from the base is a column.
#[derive(Debug, Clone)]
pub struct Change {
    pub hypothesis: Hypothesis,
    /// Effects at its end that the base does not have; 0: they differ otherwise.
    pub added: usize,
    pub stages: Stages,
    /// The difference is divided by this.
    pub step: f64,
}

/// Residuals of all records under one hypothesis; `None` for a record that cannot be simulated.
pub fn all_residuals(
    workers: &dyn Workers,
    records: &[Record],
    hypothesis: &Hypothesis,
) -> Result<Vec<Option<Vec<f64>>>, Cancelled> {
    gathered(workers, records.len(), &|r| {
        residuals(&records[r], hypothesis, Stages::BOTH, None)
    })
}

/// Columns `[change][record]`: change of the prediction per step; zeros where the change cannot be simulated.
pub fn columns(
    workers: &dyn Workers,
    records: &[Record],
    base: &[Vec<f64>],
    changes: &[Change],
) -> Result<Vec<Vec<Vec<f64>>>, Cancelled> {
    let runs = records.len();
    let flat = gathered(workers, changes.len() * runs, &|item| {
        let (change, run) = (&changes[item / runs], item % runs);
        let base = &base[run];
        match residuals_with(&records[run], &change.hypothesis, change.added, change.stages, base) {
            Some(changed) => base.iter().zip(&changed).map(|(b, c)| (b - c) / change.step).collect(),
            None => vec![0.0; base.len()],
        }
    })?;
    let mut flat = flat.into_iter();
    Ok((0..changes.len()).map(|_| flat.by_ref().take(runs).collect()).collect())
}
