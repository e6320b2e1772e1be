//! The circle of the discrepancy workflow on a running system: change the emulated robots behind the service's back, drive
//! experiments, diagnose, accept, drive again.

use crate::{System, repository, wait_for};
use anyhow::{Context, ensure};
use api::diagnosis::DiagnosisState;
use api::run::RunState;
use serde_json::{Value, json};
use std::time::Duration;
use uuid::Uuid;

/// Longest wait for a run in virtual time, in the queue included.
const RUN_LIMIT: Duration = Duration::from_secs(120);
/// Longest wait for a diagnosis.
const DIAGNOSIS_LIMIT: Duration = Duration::from_secs(1200);
const GAPS_LIMIT: Duration = Duration::from_secs(120);
/// Documents of each robot in `examples/gap`.
pub const DOCUMENTS: usize = 6;

impl System {
    /// A call with a JSON body.
    pub async fn send(&self, method: reqwest::Method, path: &str, body: &Value) -> anyhow::Result<Value> {
        let request = self.http.request(method, format!("{}{path}", self.base)).json(body);
        let response = request.send().await?;
        let status = response.status();
        let text = response.text().await?;
        ensure!(status.is_success(), "{path}: {status}: {text}");
        Ok(serde_json::from_str(&text)?)
    }

    /// Drives the robot's documents of `examples/gap` one after the other.
    ///
    /// - `documents`: numbers from 1 to [`DOCUMENTS`]; any may come twice.
    pub async fn drive(&self, robot: &str, documents: &[usize], label: &str) -> anyhow::Result<Vec<Uuid>> {
        let mut runs = Vec::new();
        for (number, document) in documents.iter().enumerate() {
            let path = repository().join(format!("examples/gap/{robot}-{document}.json"));
            let text = std::fs::read_to_string(&path).with_context(|| format!("read {}", path.display()))?;
            let experiment: Value = serde_json::from_str(&text)?;
            let label = format!("{label}, {}", number + 1);
            let body = json!({ "experiment": experiment, "claim": null, "label": label });
            let made = self.send(reqwest::Method::POST, "/api/v1/experiments", &body).await?;
            runs.push(serde_json::from_value(made["run_id"].clone())?);
        }
        for id in &runs {
            let run = self.wait_until_ended(*id, RUN_LIMIT).await?;
            ensure!(
                run.state == RunState::Done,
                "{label}: {} {:?}",
                run.state.as_str(),
                run.fault
            );
        }
        Ok(runs)
    }

    /// RMS of the position gaps 2 s ahead, m, of these runs against the robot's current model, once all are computed.
    pub async fn position_gap_m(&self, robot: &str, runs: &[Uuid]) -> anyhow::Result<f64> {
        let path = format!("/api/v1/robots/{robot}/gaps");
        wait_for("the gaps of the runs", GAPS_LIMIT, || async {
            let gaps = self.get(&path).await?;
            let of_run = |id: &Uuid| {
                let all = gaps["runs"].as_array()?;
                let run = all.iter().find(|run| run["run"] == id.to_string())?;
                let horizons = run["horizons"].as_array()?;
                let at = horizons.iter().find(|gap| gap["horizon_s"] == gaps["horizon_s"])?;
                at["position_m"].as_f64()
            };
            let found: Option<Vec<f64>> = runs.iter().map(of_run).collect();
            Ok(
                found
                    .map(|gaps_m| (gaps_m.iter().map(|gap_m| gap_m * gap_m).sum::<f64>() / gaps_m.len() as f64).sqrt()),
            )
        })
        .await
    }

    /// Asks for a diagnosis against the nominal twin and waits for its report.
    pub async fn diagnose(&self, robot: &str, references: &[Uuid], changed: &[Uuid]) -> anyhow::Result<(Uuid, Value)> {
        let body = json!({ "robot": robot, "reference_runs": references, "changed_runs": changed, "model": "nominal" });
        let made = self.send(reqwest::Method::POST, "/api/v1/diagnoses", &body).await?;
        let id: Uuid = serde_json::from_value(made["id"].clone())?;
        let path = format!("/api/v1/diagnoses/{id}");
        wait_for("the diagnosis", DIAGNOSIS_LIMIT, || async {
            let view = self.get(&path).await?;
            let state: DiagnosisState = serde_json::from_value(view["state"].clone())?;
            ensure!(
                !state.is_terminal() || state == DiagnosisState::Done,
                "{}",
                view["problem"]
            );
            Ok(state.is_terminal().then_some(()))
        })
        .await?;
        Ok((id, self.get(&format!("{path}/report.json")).await?))
    }

    /// The robot's twin uses what came out of a diagnosis.
    pub async fn accept(&self, diagnosis: Uuid) -> anyhow::Result<()> {
        let path = format!("/api/v1/diagnoses/{diagnosis}/accept");
        self.send(reqwest::Method::POST, &path, &json!({})).await?;
        Ok(())
    }

    /// The robot's twin uses the nominal equations.
    pub async fn use_nominal(&self, robot: &str) -> anyhow::Result<()> {
        let path = format!("/api/v1/robots/{robot}/model");
        self.send(reqwest::Method::PUT, &path, &json!({ "model": "nominal" }))
            .await?;
        Ok(())
    }
}
