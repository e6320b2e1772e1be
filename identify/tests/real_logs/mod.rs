//! Logs that others measured on real robots, as run bundles. They are not part of the repository.
#![allow(dead_code)]

pub mod coast;
mod csv_table;
pub mod dart;
pub mod husky;
pub mod mrclam;
mod npz;
#[path = "../threads/mod.rs"]
mod threads;

use identify::bundle::Bundle;
use identify::diagnose::{Diagnosis, Input, Run, diagnose};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use threads::Threads;

/// The folder with the logs, or a line that says why a test does nothing.
pub fn folder(part: &str) -> Option<PathBuf> {
    let given = std::env::var_os("ROBOPHEUS_REAL_LOGS").map(PathBuf::from);
    let beside = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data");
    let folder = given.unwrap_or(beside).join(part);
    if folder.is_dir() {
        return Some(folder);
    }
    println!(
        "skipped: {} is absent; ROBOPHEUS_REAL_LOGS names the folder with real logs",
        folder.display()
    );
    None
}

/// True where somebody asked for the whole of it: `cargo xtask soak` does.
pub fn at_length() -> bool {
    std::env::var_os("ROBOPHEUS_REAL_LOGS").is_some()
}

/// A run's telemetry while it is made: one row a time stamp.
pub struct Rows {
    columns: Vec<String>,
    rows: Vec<(f64, Vec<Option<f64>>)>,
}

impl Rows {
    pub fn new(columns: &[&str]) -> Rows {
        Rows {
            columns: columns.iter().map(|name| (*name).to_owned()).collect(),
            rows: Vec::new(),
        }
    }

    pub fn push(&mut self, time_s: f64, values: Vec<Option<f64>>) {
        assert_eq!(values.len(), self.columns.len());
        self.rows.push((time_s, values));
    }

    /// Sorted, rows of the same microsecond merged, time from 0.
    pub fn bundle(mut self, name: &str, robot: &str) -> Run {
        self.rows.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut merged: Vec<(f64, Vec<Option<f64>>)> = Vec::new();
        for (time_s, values) in self.rows {
            match merged.last_mut() {
                Some((last_s, last)) if time_s - *last_s < 1e-6 => {
                    for (slot, value) in last.iter_mut().zip(values) {
                        *slot = value.or(*slot);
                    }
                }
                _ => merged.push((time_s, values)),
            }
        }
        let first_s = merged.first().map_or(0.0, |row| row.0);
        let mut csv = format!("time_s,{}\n", self.columns.join(","));
        for (time_s, values) in merged {
            let _ = write!(csv, "{:.6}", time_s - first_s);
            for value in values {
                match value {
                    Some(value) => write!(csv, ",{value}").unwrap_or_default(),
                    None => csv.push(','),
                }
            }
            csv.push('\n');
        }
        let run = format!(
            "{{\"format\":\"robopheus.run/1\",\"robot\":{robot},\"floor\":\"theirs\",\"label\":\"{name}\",\"started\":\"\",\"change_free_reference\":false}}"
        );
        match Bundle::parse(&run, csv.as_bytes()) {
            Ok(bundle) => Run {
                path: name.to_owned(),
                sha256: String::new(),
                bundle,
            },
            Err(error) => panic!("{name}: {error}"),
        }
    }
}

pub fn found(references: Vec<Run>, runs: Vec<Run>, locked: Vec<Run>) -> Diagnosis {
    let input = Input {
        references,
        runs,
        locked,
        model: None,
        seed: 1,
    };
    match diagnose(&Threads(2), &input) {
        Ok(found) => found,
        Err(error) => panic!("{error}"),
    }
}

/// The same from a model that shall explain the runs.
pub fn found_from(model: twin::model_document::ModelDocument, runs: Vec<Run>) -> Diagnosis {
    let input = Input {
        references: Vec::new(),
        runs,
        locked: Vec::new(),
        model: Some(model),
        seed: 1,
    };
    match diagnose(&Threads(2), &input) {
        Ok(found) => found,
        Err(error) => panic!("{error}"),
    }
}

/// Sideways RMS gap 2 s ahead, m.
pub fn lateral_gap_m(runs: &[Run], effects: &[twin::effect::Effect]) -> f64 {
    let Some(first) = runs.first() else { return f64::NAN };
    let robot = match twin::robot::Robot::with_effects(first.bundle.run.robot.clone(), effects) {
        Ok(robot) => robot,
        Err(problem) => panic!("{problem}"),
    };
    let samples = runs
        .iter()
        .filter_map(|run| {
            identify::gap::end_to_end_with(
                &run.bundle,
                &robot,
                identify::gap::RobotClock::default(),
                identify::gap::ANCHOR_PERIOD_S,
            )
            .ok()
        })
        .flat_map(|gap| gap.samples);
    let squares: Vec<f64> = samples
        .filter(|sample| sample.horizon_s == 2.0)
        .map(|sample| sample.left_m * sample.left_m)
        .collect();
    (squares.iter().sum::<f64>() / squares.len().max(1) as f64).sqrt()
}

/// Names in the order of acceptance, each with what the data cannot tell from it.
pub fn names(found: &Diagnosis) -> Vec<Vec<&str>> {
    let effects = found.report.effects.iter();
    effects
        .map(|effect| {
            let mut set = vec![effect.name.as_str()];
            set.extend(effect.alternatives.iter().map(String::as_str));
            set
        })
        .collect()
}

/// The report in a few lines.
pub fn told(found: &Diagnosis) -> String {
    let report = &found.report;
    let mut text = format!("{:?}: {}\n{}\n", report.verdict, report.sentence, report.place.sentence);
    for effect in &report.effects {
        let _ = write!(text, "  {} {:?}", effect.name, effect.index);
        for parameter in &effect.parameters {
            let _ = write!(
                text,
                " {}={:.4?} ({:.4?}..{:.4?})",
                parameter.name, parameter.value, parameter.low, parameter.high
            );
        }
        let _ = writeln!(
            text,
            " gain {:.0} validation {:.0} threshold {:.0} stability {:.2} or {:?}",
            effect.evidence.gain,
            effect.evidence.gain_validation,
            effect.evidence.threshold,
            effect.evidence.stability,
            effect.alternatives
        );
        for excluded in &effect.excluded {
            let _ = writeln!(text, "     not {}: {}", excluded.name, excluded.because);
        }
    }
    for absorbed in &report.absorbed {
        let values: Vec<String> = absorbed
            .parameters
            .iter()
            .map(|p| format!("{} {:.4?}", p.name, p.value))
            .collect();
        let _ = writeln!(text, "  absorbed {}: {}", absorbed.name, values.join(", "));
    }
    for rejected in &report.rejected {
        let _ = writeln!(text, "  rejected {}: {}", rejected.name, rejected.because);
    }
    for untestable in &report.untestable {
        let _ = writeln!(text, "  untestable {}: {}", untestable.name, untestable.because);
    }
    for gap in &report.gap {
        let _ = writeln!(
            text,
            "  gap {} {:.1} s: floor {:.4} before {:.4} after {:.4} {}",
            gap.channel, gap.horizon_s, gap.floor, gap.before, gap.after, gap.unit
        );
    }
    let _ = writeln!(
        text,
        "  explained {:?} remarks {:?}",
        report.explained_fraction, report.remarks
    );
    text
}
