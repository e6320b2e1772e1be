//! A diagnosis' report, `robopheus.diagnosis/1`, as far as the Gap page shows it. What a newer report adds is passed over.

use serde::Deserialize;
use serde_json::Value;

#[derive(Debug, Clone, Default, PartialEq, Deserialize)]
#[serde(default)]
pub struct Report {
    pub robot: String,
    pub data: Vec<Data>,
    pub verdict: String,
    pub sentence: String,
    pub effects: Vec<Effect>,
    pub absorbed: Vec<Absorbed>,
    pub rejected: Vec<Because>,
    pub untestable: Vec<Because>,
    #[serde(rename = "where")]
    pub place: Where,
    pub gap: Vec<Gap>,
    pub explained_fraction: Option<f64>,
    /// `references` or `stated`.
    pub floor_source: String,
    pub remarks: Vec<String>,
    pub next_experiment: Option<Next>,
}

#[derive(Debug, Clone, Default, PartialEq, Deserialize)]
#[serde(default)]
pub struct Data {
    pub path: String,
    pub role: String,
}

#[derive(Debug, Clone, Default, PartialEq, Deserialize)]
#[serde(default)]
pub struct Effect {
    pub name: String,
    /// "confirmed" or "ambiguous".
    pub status: String,
    pub index: Option<usize>,
    pub alternatives: Vec<String>,
    pub parameters: Vec<Parameter>,
    pub evidence: Evidence,
    pub excluded: Vec<Because>,
    pub sentence: String,
}

#[derive(Debug, Clone, Default, PartialEq, Deserialize)]
#[serde(default)]
pub struct Parameter {
    pub name: String,
    /// `None` = infinite.
    pub value: Option<f64>,
    pub low: Option<f64>,
    pub high: Option<f64>,
    pub unit: String,
}

#[derive(Debug, Clone, Copy, Default, PartialEq, Deserialize)]
#[serde(default)]
pub struct Evidence {
    pub gain: f64,
    pub threshold: f64,
    pub stability: f64,
}

#[derive(Debug, Clone, Default, PartialEq, Deserialize)]
#[serde(default)]
pub struct Absorbed {
    pub name: String,
    pub parameters: Vec<Parameter>,
}

#[derive(Debug, Clone, Default, PartialEq, Deserialize)]
#[serde(default)]
pub struct Because {
    pub name: String,
    pub because: String,
    /// The manoeuvre that would tell, for untestable effects.
    pub run_this: Value,
}

#[derive(Debug, Clone, Default, PartialEq, Deserialize)]
#[serde(default)]
pub struct Where {
    pub sentence: String,
    /// Largest share first.
    pub channels: Vec<String>,
    pub shares: Vec<f64>,
    pub regions: Vec<Region>,
    pub floor_map: FloorMap,
}

#[derive(Debug, Clone, Default, PartialEq, Deserialize)]
#[serde(default)]
pub struct Region {
    pub variable: String,
    pub unit: String,
    pub channel: String,
    /// One more than bins.
    pub edges: Vec<f64>,
    /// 1 = floor.
    pub energy: Vec<f64>,
}

#[derive(Debug, Clone, Default, PartialEq, Deserialize)]
#[serde(default)]
pub struct FloorMap {
    pub cell_m: f64,
    pub x_m: Vec<f64>,
    pub y_m: Vec<f64>,
    /// 1 = floor.
    pub energy: Vec<f64>,
}

#[derive(Debug, Clone, Default, PartialEq, Deserialize)]
#[serde(default)]
pub struct Gap {
    pub channel: String,
    pub horizon_s: f64,
    pub unit: String,
    pub floor: f64,
    pub before: f64,
    pub after: f64,
}

#[derive(Debug, Clone, Default, PartialEq, Deserialize)]
#[serde(default)]
pub struct Next {
    pub why: String,
    pub experiment: Value,
}
