//! `report.json`, format `robopheus.diagnosis/1`.

use serde::{Deserialize, Serialize};
use serde_json::Value;

/// `format` of a report.
pub const FORMAT: &str = "robopheus.diagnosis/1";

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// Effects named, nothing worth naming remains.
    Confirmed,
    /// Effects named, but excess remains or too few runs prove them.
    Partial,
    /// Several effects explain the data alike.
    Ambiguous,
    /// The disagreement is real and no effect of the library passes.
    Unexplained,
    NoDiscrepancy,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Report {
    pub format: String,
    pub robot: String,
    pub data: Vec<Data>,
    pub verdict: Verdict,
    /// The verdict in a sentence.
    pub sentence: String,
    pub effects: Vec<NamedEffect>,
    pub absorbed: Vec<Absorbed>,
    pub rejected: Vec<Rejected>,
    pub untestable: Vec<Untestable>,
    #[serde(rename = "where")]
    pub place: Where,
    pub gap: Vec<Gap>,
    /// Mean explained fraction of the gaps that matter; absent without locked runs.
    pub explained_fraction: Option<f64>,
    /// `references` or `stated`: what the floor comes from.
    pub floor_source: String,
    pub remarks: Vec<String>,
    pub next_experiment: Option<NextExperiment>,
    pub model: ModelReference,
    pub seed: u64,
    pub library_version: String,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Data {
    pub path: String,
    pub sha256: String,
    pub role: String,
    pub blocks: usize,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct NamedEffect {
    pub name: String,
    pub status: String,
    pub index: Option<usize>,
    pub alternatives: Vec<String>,
    pub parameters: Vec<ParameterValue>,
    pub evidence: Evidence,
    pub excluded: Vec<Rejected>,
    pub sentence: String,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ParameterValue {
    pub name: String,
    /// `null` = infinite: this limit is not there.
    pub value: Option<f64>,
    pub low: Option<f64>,
    pub high: Option<f64>,
    pub unit: String,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Evidence {
    /// Decrease of the whitened energy on training and validation runs.
    pub gain: f64,
    /// What chance gives.
    pub threshold: f64,
    /// Share of half-splits in which it is the best.
    pub stability: f64,
    pub gain_validation: f64,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Absorbed {
    pub name: String,
    pub parameters: Vec<ParameterValue>,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Rejected {
    pub name: String,
    pub because: String,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Untestable {
    pub name: String,
    pub because: String,
    pub run_this: Value,
}

#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Where {
    pub sentence: String,
    /// Largest share of the gap first.
    pub channels: Vec<String>,
    pub shares: Vec<f64>,
    pub segments: Vec<Segment>,
    pub regions: Vec<Region>,
    pub floor_map: FloorMap,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Segment {
    pub run: String,
    /// From the start of the run.
    pub from_s: f64,
    pub to_s: f64,
}

/// Excess of the gap over a variable, in bins.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Region {
    pub variable: String,
    pub unit: String,
    pub channel: String,
    /// Ends of the bins, one more than bins.
    pub edges: Vec<f64>,
    /// Whitened energy per cell in every bin; 1 = floor.
    pub energy: Vec<f64>,
    /// Mean residual in every bin, in the channel's unit.
    pub mean: Vec<f64>,
}

#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct FloorMap {
    pub cell_m: f64,
    pub x_m: Vec<f64>,
    pub y_m: Vec<f64>,
    /// Whitened energy per residual at the cell of the same position in `x_m` and `y_m`; 1 = floor.
    pub energy: Vec<f64>,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Gap {
    pub channel: String,
    pub horizon_s: f64,
    pub unit: String,
    pub floor: f64,
    pub before: f64,
    pub after: f64,
    /// Of `after`, 95 %.
    pub low: f64,
    pub high: f64,
    pub explained_fraction: Option<f64>,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct NextExperiment {
    pub why: String,
    pub experiment: Value,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ModelReference {
    pub id: String,
    pub parent: Option<String>,
}

impl Report {
    /// The file's text.
    pub fn text(&self) -> String {
        let mut text = serde_json::to_string_pretty(self).unwrap_or_default();
        text.push('\n');
        text
    }
}

/// A number with as many digits as a report needs: the same text on every machine.
pub fn rounded(value: f64) -> f64 {
    if value == 0.0 || !value.is_finite() {
        return 0.0;
    }
    let magnitude = libm::floor(libm::log10(value.abs()));
    let scale = libm::pow(10.0, 5.0 - magnitude);
    libm::round(value * scale) / scale
}
