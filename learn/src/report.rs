//! What a learning gave: `report.json` and the table that people read.

use std::fmt::Write;

use serde::Serialize;

use crate::evaluate::{Figure, RunFigure};
use crate::inputs::Sight;
use crate::linear::Target;
use crate::train::{Course, Settings};

/// `format` of the report.
pub const FORMAT: &str = "robopheus.learning/1";

/// `report.json`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Report {
    pub format: &'static str,
    pub robot: String,
    pub floor: String,
    pub library_version: &'static str,
    /// Identifier of the model that came out.
    pub model: String,
    pub parent: Option<String>,
    /// A residual is carried.
    pub useful: bool,
    /// In words.
    pub verdict: String,
    pub data: Vec<Data>,
    pub counts: Vec<Counts>,
    pub target: Target,
    pub settings: Settings,
    /// Networks that were tried, in order.
    pub attempts: Vec<Attempt>,
    /// Position in `attempts` of the one that is carried.
    pub chosen: Option<usize>,
    pub validation_position_m: Gate,
    pub locked: Vec<Figure>,
    pub locked_runs: Vec<RunFigure>,
    /// ONNX Runtime against training side and twin; absent when it was not asked.
    pub onnx: Option<OnnxCheck>,
    pub remarks: Vec<String>,
}

/// A run and its use.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Data {
    pub path: String,
    pub sha256: String,
    pub role: &'static str,
}

/// Windows of a role.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Counts {
    pub role: &'static str,
    pub runs: usize,
    pub windows: usize,
    /// Windows that were there.
    pub seen: usize,
    /// Every which of them is used.
    pub stride: usize,
    /// Windows that the measurements did not carry.
    pub skipped: usize,
}

/// One network.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Attempt {
    pub sight: Sight,
    pub inputs: usize,
    pub rounds: Vec<Round>,
    /// Loss on the validation windows, driven: physics alone, and the network at best.
    pub physics: f64,
    pub validation: f64,
}

/// One linearisation and the training on it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Round {
    pub course: Course,
    /// Share of the training's step that was taken.
    pub step: f64,
    /// Loss on the validation windows, driven.
    pub validation: f64,
}

/// RMS place error 2 s ahead on the validation runs, m.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Gate {
    pub physics: f64,
    pub residual: Option<f64>,
    /// Gain of the network over physics alone in standard errors of its mean over windows: of ln loss, and of ln squared
    /// place error 2 s ahead.
    pub gain_sigmas: Option<[f64; 2]>,
}

/// Largest differences between ONNX Runtime and our own evaluations.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct OnnxCheck {
    pub runtime: String,
    pub rows: usize,
    pub max_difference_twin: f64,
    pub max_difference_training: f64,
    pub limit: f64,
    pub agrees: bool,
}

impl Report {
    /// As JSON text.
    pub fn text(&self) -> String {
        let mut text = serde_json::to_string_pretty(self).unwrap_or_default();
        text.push('\n');
        text
    }

    /// The comparison as people read it.
    pub fn table(&self) -> String {
        let mut text = format!("{}\n", self.verdict);
        let _ = writeln!(
            text,
            "{:<24} {:>12} {:>12} {:>12} {:>8}",
            "locked runs, RMS error", "physics", "black box", "with learned", "samples"
        );
        for figure in &self.locked {
            let name = format!("{} {} s, {}", figure.quantity, figure.horizon_s, figure.unit);
            let shown = |value: Option<f64>| value.map_or_else(|| "-".to_owned(), |value| format!("{value:.4}"));
            let _ = writeln!(
                text,
                "{:<24} {:>12} {:>12} {:>12} {:>8}",
                name,
                shown(Some(figure.physics)),
                shown(figure.black_box),
                shown(figure.residual),
                figure.samples
            );
        }
        for counts in &self.counts {
            let _ = writeln!(
                text,
                "{}: {} windows of {} runs ({} there, {} without enough measurements)",
                counts.role, counts.windows, counts.runs, counts.seen, counts.skipped
            );
        }
        for remark in &self.remarks {
            let _ = writeln!(text, "{remark}");
        }
        text
    }

    /// RMS of a quantity at a horizon: physics, black box, with the residual.
    pub fn figure(&self, quantity: &str, horizon_s: f64) -> Option<&Figure> {
        let mut figures = self.locked.iter();
        figures.find(|figure| figure.quantity == quantity && figure.horizon_s == horizon_s)
    }
}
