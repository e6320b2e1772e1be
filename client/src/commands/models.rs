//! `robopheus models`: model versions in the service.

use crate::output::Output;
use crate::settings::Settings;
use anyhow::Context;
use api::comparison::{ComparisonRequest, ComparisonView};
use api::diagnosis::NOMINAL;
use api::model::ModelView;
use clap::Subcommand;
use client::Client;
use std::path::PathBuf;
use uuid::Uuid;

#[derive(clap::Args)]
pub struct Arguments {
    #[command(subcommand)]
    verb: Verb,
}

#[derive(Subcommand)]
enum Verb {
    /// List versions, newest first
    List(List),
    /// Download a version: model.json, and model.onnx where it carries a learned residual
    Fetch(Fetch),
    /// Which of two versions predicts a stored run better
    Compare(Compare),
    /// Make a version, or `nominal`, the robot's current model
    Use(Use),
}

#[derive(clap::Args)]
struct List {
    /// Only of this robot
    #[arg(long)]
    robot: Option<String>,
    /// Only of this floor
    #[arg(long)]
    floor: Option<String>,
}

#[derive(clap::Args)]
struct Fetch {
    /// Version or id, as `robopheus models list` prints it
    model: String,
    /// New folder for the files
    #[arg(long, short)]
    out: PathBuf,
}

#[derive(clap::Args)]
struct Compare {
    /// Run identifier, as `robopheus runs` prints it
    run: Uuid,
    /// Robot whose records are predicted
    #[arg(long)]
    robot: String,
    /// Two versions or ids, or `nominal`
    #[arg(num_args = 2, required = true, value_names = ["FIRST", "SECOND"])]
    models: Vec<String>,
}

#[derive(clap::Args)]
struct Use {
    /// Name of the robot
    robot: String,
    /// Version or id of a model of this robot, or `nominal`
    model: String,
}

pub async fn run(arguments: Arguments, settings: &Settings, output: &Output) -> anyhow::Result<()> {
    let client = settings.client()?;
    match arguments.verb {
        Verb::List(list) => {
            let models = client.model_list(list.robot.as_deref(), list.floor.as_deref()).await?;
            output.result(&models, || table(&models))
        }
        Verb::Fetch(fetch) => fetched(&fetch, &client, output).await,
        Verb::Compare(compare) => {
            let [first, second] = <[String; 2]>::try_from(compare.models)
                .map_err(|given| anyhow::anyhow!("{} models are named; name two", given.len()))?;
            let request = ComparisonRequest {
                robot: compare.robot,
                run: compare.run,
                first,
                second,
            };
            let found = client.model_compare(&request).await?;
            output.result(&found, || words(&found))
        }
        Verb::Use(chosen) => {
            let now = client.robot_model_set(&chosen.robot, &chosen.model).await?;
            output.result(&now, || {
                let version = now.version.as_deref().unwrap_or("the nominal twin");
                format!("{} uses {version} on {}", now.robot, now.floor)
            })
        }
    }
}

/// Writes the document, and the network where there is one, into a new folder.
async fn fetched(fetch: &Fetch, client: &Client, output: &Output) -> anyhow::Result<()> {
    let out = &fetch.out;
    anyhow::ensure!(!out.exists(), "{} exists; name a new folder", out.display());
    let models = client.model_list(None, None).await?;
    let is_meant = |model: &&ModelView| model.version == fetch.model || model.id.to_string() == fetch.model;
    let model = models
        .iter()
        .find(is_meant)
        .with_context(|| format!("there is no model {:?}; see `robopheus models list`", fetch.model))?;
    let network = if carries_network(model) {
        Some(client.model_onnx(model.id).await?)
    } else {
        None
    };
    std::fs::create_dir_all(out)?;
    std::fs::write(out.join("model.json"), serde_json::to_vec_pretty(&model.document)?)?;
    if let Some(network) = &network {
        std::fs::write(out.join("model.onnx"), network)?;
    }
    let files = if network.is_some() {
        "model.json, model.onnx"
    } else {
        "model.json"
    };
    output.result(model, || format!("{} in {}: {files}", model.version, out.display()))
}

fn carries_network(model: &ModelView) -> bool {
    model
        .document
        .get("residual")
        .is_some_and(|residual| !residual.is_null())
}

fn table(models: &[ModelView]) -> String {
    if models.is_empty() {
        return "no model versions yet; a diagnosis or a run with the learning server makes one".to_owned();
    }
    let mut text = format!(
        "{:14}  {:14}  {:14}  {:20}  {:7}  {}",
        "VERSION", "FROM", "FLOOR", "MADE", "IN USE", "EFFECTS"
    );
    for model in models {
        let effects = model.document.get("effects").and_then(serde_json::Value::as_array);
        let names = effects
            .into_iter()
            .flatten()
            .filter_map(|effect| effect["name"].as_str());
        let mut contents: Vec<&str> = names.collect();
        if carries_network(model) {
            contents.push("learned residual");
        }
        text.push_str(&format!(
            "\n{:14}  {:14}  {:14}  {:20}  {:7}  {}",
            model.version,
            model.parent.as_deref().unwrap_or(NOMINAL),
            model.floor,
            model.created_at.format("%Y-%m-%d %H:%M UTC"),
            if model.is_current { "yes" } else { "" },
            contents.join(", ")
        ));
    }
    text
}

fn words(found: &ComparisonView) -> String {
    let mut text = format!(
        "{}\n\n{:9} {:>7}  {:>14}  {:>14}  {:>8}",
        found.sentence, "CHANNEL", "AHEAD", found.first.version, found.second.version, "SAMPLES"
    );
    for row in &found.rows {
        text.push_str(&format!(
            "\n{:9} {:>5.1} s  {:>8.4} {:5}  {:>8.4} {:5}  {:>8}",
            row.channel, row.horizon_s, row.first, row.unit, row.second, row.unit, row.samples
        ));
    }
    text
}
