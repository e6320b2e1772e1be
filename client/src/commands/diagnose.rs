//! `robopheus diagnose`

use crate::output::{Output, Unsuccessful};
use anyhow::{Context, ensure};
use identify::diagnose::{Input, Run, diagnose};
use identify::workers::{Queue, Workers};
use std::path::{Path, PathBuf};
use twin::model_document::ModelDocument;

#[derive(clap::Args)]
pub struct Arguments {
    /// Runs with nothing changed: a folder, zip or run archive each; they calibrate the model and the noise floor
    #[arg(long, num_args = 1..)]
    reference: Vec<PathBuf>,
    /// Runs whose disagreement with the twin is to be explained
    #[arg(long, num_args = 1.., required = true)]
    runs: Vec<PathBuf>,
    /// Runs that are opened once, for the before and after figures; without them some of --runs are held back
    #[arg(long, num_args = 1..)]
    locked: Vec<PathBuf>,
    /// Model version (robopheus.model/1) to start from; the nominal twin when absent
    #[arg(long)]
    model: Option<PathBuf>,
    /// Robot whose bundle is taken from run archives
    #[arg(long)]
    robot: Option<String>,
    /// Folder for report.json, report.html and model.json; must not exist
    #[arg(long)]
    out: PathBuf,
    /// Threads; the report does not depend on it
    #[arg(long, default_value_t = 2, value_parser = clap::value_parser!(u16).range(1..=64))]
    threads: u16,
}

#[derive(serde::Serialize)]
struct Summary {
    out: PathBuf,
    verdict: identify::report::Verdict,
    sentence: String,
    effects: Vec<String>,
    explained_fraction: Option<f64>,
}

/// Work items on threads of this process.
struct Threads {
    count: usize,
    bar: indicatif::ProgressBar,
}

impl Workers for Threads {
    fn run(&self, count: usize, work: &(dyn Fn(usize) + Sync)) {
        let queue = Queue::new(count, work);
        std::thread::scope(|scope| {
            for _ in 0..self.count.min(count) {
                scope.spawn(|| queue.help());
            }
        });
    }

    fn progress(&self, stage: &str, share: f64) {
        self.bar.set_position((1000.0 * share) as u64);
        self.bar.set_message(stage.to_owned());
    }
}

/// Reads all bundles, diagnoses, writes the three files.
pub fn run(arguments: &Arguments, output: &Output) -> anyhow::Result<()> {
    ensure!(
        !arguments.out.exists(),
        "{} exists; name a new folder",
        arguments.out.display()
    );
    let input = Input {
        references: read(&arguments.reference, arguments.robot.as_deref())?,
        runs: read(&arguments.runs, arguments.robot.as_deref())?,
        locked: read(&arguments.locked, arguments.robot.as_deref())?,
        model: arguments.model.as_deref().map(model).transpose()?,
        seed: 1,
    };
    let workers = Threads {
        count: usize::from(arguments.threads),
        bar: output.bar(1000, "{bar:30} {msg}"),
    };
    let found = diagnose(&workers, &input);
    workers.bar.finish_and_clear();
    let found = found.map_err(|error| anyhow::Error::new(Unsuccessful(error.to_string())))?;
    write(&arguments.out, &found).with_context(|| format!("cannot write {}", arguments.out.display()))?;
    let report = &found.report;
    let summary = Summary {
        out: arguments.out.clone(),
        verdict: report.verdict,
        sentence: report.sentence.clone(),
        effects: report.effects.iter().map(|effect| effect.sentence.clone()).collect(),
        explained_fraction: report.explained_fraction,
    };
    output.result(&summary, || {
        let mut lines = vec![summary.sentence.clone(), report.place.sentence.clone()];
        lines.extend(summary.effects.iter().map(|effect| format!("  {effect}")));
        lines.extend(report.next_experiment.iter().map(|next| format!("Next: {}", next.why)));
        lines.push(format!("{}", arguments.out.join("report.html").display()));
        lines.join("\n")
    })
}

fn read(paths: &[PathBuf], robot: Option<&str>) -> anyhow::Result<Vec<Run>> {
    paths
        .iter()
        .map(|path| {
            let file = bundles::read(path, robot)?;
            Ok(Run {
                path: file.path,
                sha256: file.sha256,
                bundle: file.bundle,
            })
        })
        .collect()
}

fn model(path: &Path) -> anyhow::Result<ModelDocument> {
    let text = std::fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))?;
    ModelDocument::parse(&text).with_context(|| format!("{}", path.display()))
}

/// Writes into a folder beside `out` and renames it, so that half a report never shows.
fn write(out: &Path, found: &identify::diagnose::Diagnosis) -> anyhow::Result<()> {
    let partial = out.with_extension("part");
    if partial.exists() {
        std::fs::remove_dir_all(&partial)?;
    }
    std::fs::create_dir_all(&partial)?;
    std::fs::write(partial.join("report.json"), found.report.text())?;
    std::fs::write(partial.join("report.html"), identify::report::page(&found.report))?;
    let mut model = serde_json::to_string_pretty(&found.model)?;
    model.push('\n');
    std::fs::write(partial.join("model.json"), model)?;
    std::fs::rename(&partial, out)?;
    Ok(())
}
