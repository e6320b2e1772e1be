//! Runs that a diagnosis can use.

use std::collections::BTreeMap;

use super::{DiagnoseError, Input, Run};
use crate::record::Record;

/// Runs are of one robot, and no two are the same.
pub(super) fn check(input: &Input) -> Result<(), DiagnoseError> {
    let first = input.runs.first().ok_or(DiagnoseError::NoRuns)?;
    let expected = &first.bundle.run.robot;
    let mut seen: BTreeMap<&str, &Run> = BTreeMap::new();
    for run in input.references.iter().chain(&input.runs).chain(&input.locked) {
        let is_known = !run.sha256.is_empty();
        if let Some(other) = is_known.then(|| seen.insert(&run.sha256, run)).flatten() {
            return Err(DiagnoseError::Twice {
                path: run.path.clone(),
                other: other.path.clone(),
            });
        }
        let found = &run.bundle.run.robot;
        if found.wheels.len() != expected.wheels.len() {
            return Err(DiagnoseError::OtherRobot {
                path: run.path.clone(),
                other: first.path.clone(),
                found: found.wheels.len(),
                expected: expected.wheels.len(),
            });
        }
        if found.chassis != expected.chassis {
            return Err(DiagnoseError::OtherChassis {
                path: run.path.clone(),
                other: first.path.clone(),
                found: found.chassis.clone(),
                expected: expected.chassis.clone(),
            });
        }
    }
    Ok(())
}

/// Runs cut into windows, and what is worth telling of them.
pub(super) fn usable(runs: &[Run]) -> Result<(Vec<Record>, Vec<String>), DiagnoseError> {
    let mut records = Vec::new();
    let mut remarks = Vec::new();
    for run in runs {
        let record = Record::of(&run.path, &run.bundle);
        if record.is_empty() {
            return Err(DiagnoseError::Unusable { path: run.path.clone() });
        }
        if record.outliers > 0 {
            remarks.push(format!(
                "{}: {} poses left out as tracker errors",
                run.path, record.outliers
            ));
        }
        if record.skipped > 0 {
            remarks.push(format!(
                "{}: {} windows without enough measurements",
                run.path, record.skipped
            ));
        }
        if !run.bundle.telemetry.channels.keys().any(|channel| channel.is_command()) {
            remarks.push(format!(
                "{}: no set-points: commands, motors and battery are untestable with it",
                run.path
            ));
        } else if !run.bundle.commands_wheels() {
            remarks.push(format!(
                "{}: no set-points of the driven wheels: their commands, motors and battery are untestable with it",
                run.path
            ));
        }
        for remark in &run.bundle.remarks {
            remarks.push(format!("{}: {} {}", run.path, remark.column, remark.message));
        }
        records.push(record);
    }
    Ok((records, remarks))
}
