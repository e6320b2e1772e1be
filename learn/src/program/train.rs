//! `robopheus-learn train`

use std::path::{Path, PathBuf};

use anyhow::{Context, ensure};
use identify::diagnose::Run;
use identify::workers::{Queue, Workers};
use learn::inputs::Sight;
use learn::linear::Target;
use learn::onnx::export;
use learn::problem::LearnError;
use learn::runtime::{Runtime, check};
use learn::session::{Outcome, Request, Shelf, learn};

#[derive(clap::Args)]
pub struct Arguments {
    /// Runs with nothing changed: a folder, zip or run archive each; they calibrate the physical model
    #[arg(long, num_args = 1..)]
    reference: Vec<PathBuf>,
    /// Runs to learn from; training, validation and, without --locked, locked runs are dealt by run
    #[arg(long, num_args = 1.., required = true)]
    runs: Vec<PathBuf>,
    /// Runs that are opened once, for the comparison
    #[arg(long, num_args = 1..)]
    locked: Vec<PathBuf>,
    /// Physical model (robopheus.model/1) to add to; the robot description of the runs when absent
    #[arg(long)]
    model: Option<PathBuf>,
    /// Robot whose bundle is taken from run archives
    #[arg(long)]
    robot: Option<String>,
    /// Folder for model.json, model.onnx and report.json; must not exist
    #[arg(long)]
    out: PathBuf,
    /// What the network is taught by: errors of the path over a second, or of the twist after 0.35 s
    #[arg(long, value_enum, default_value_t = TargetName::Path)]
    target: TargetName,
    /// Leave the place on the floor out of the inputs
    #[arg(long)]
    motion_only: bool,
    /// Of the first weights and of the order of the windows
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Threads; the result does not depend on it
    #[arg(long, default_value_t = 2, value_parser = clap::value_parser!(u16).range(1..=64))]
    threads: u16,
    /// Report as JSON on standard output
    #[arg(long)]
    json: bool,
}

#[derive(Clone, Copy, clap::ValueEnum)]
enum TargetName {
    Path,
    Twist,
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

/// Bundles on disk, read when they are needed.
struct Folders<'a> {
    paths: &'a [PathBuf],
    robot: Option<&'a str>,
}

impl Shelf for Folders<'_> {
    fn count(&self) -> usize {
        self.paths.len()
    }

    fn read(&self, position: usize) -> Result<Run, LearnError> {
        let path = &self.paths[position];
        let file = bundles::read(path, self.robot).map_err(|error| LearnError::Unreadable {
            path: path.display().to_string(),
            message: format!("{error:#}"),
        })?;
        Ok(Run {
            path: file.path,
            sha256: file.sha256,
            bundle: file.bundle,
        })
    }
}

/// False when the network was discarded or ONNX Runtime does not agree with it.
pub fn run(arguments: &Arguments) -> anyhow::Result<bool> {
    ensure!(
        !arguments.out.exists(),
        "{} exists; name a new folder",
        arguments.out.display()
    );
    let robot = arguments.robot.as_deref();
    let shelf = |paths| Folders { paths, robot };
    let references: Vec<Run> = (0..arguments.reference.len())
        .map(|position| shelf(&arguments.reference).read(position))
        .collect::<Result<_, _>>()?;
    let (runs, locked) = (shelf(&arguments.runs), shelf(&arguments.locked));
    let mut request = Request::new(&runs);
    request.references = &references;
    request.locked = (!arguments.locked.is_empty()).then_some(&locked as &dyn Shelf);
    request.model = arguments.model.as_deref().map(super::model).transpose()?;
    request.settings.seed = arguments.seed;
    request.target = match arguments.target {
        TargetName::Path => Target::Path,
        TargetName::Twist => Target::Twist,
    };
    if arguments.motion_only {
        request.sights = vec![Sight::Motion];
    }
    let bar = indicatif::ProgressBar::new(1000);
    if let Ok(style) = indicatif::ProgressStyle::with_template("{bar:30} {msg}") {
        bar.set_style(style);
    }
    let workers = Threads {
        count: usize::from(arguments.threads),
        bar,
    };
    let found = learn(&workers, &request);
    workers.bar.finish_and_clear();
    let mut outcome = found?;
    let onnx = outcome.report.useful.then(|| export(&outcome.model)).transpose()?;
    if let Some(bytes) = &onnx {
        match Runtime::load().and_then(|runtime| check(&runtime, &outcome.model, bytes)) {
            Ok(found) => outcome.report.onnx = Some(found),
            Err(error) => outcome
                .report
                .remarks
                .push(format!("model.onnx is not checked: {error}")),
        }
    }
    write(&arguments.out, &outcome, onnx.as_deref())
        .with_context(|| format!("cannot write {}", arguments.out.display()))?;
    if arguments.json {
        print!("{}", outcome.report.text());
    } else {
        print!("{}", outcome.report.table());
        println!("{}", arguments.out.display());
    }
    let agrees = outcome.report.onnx.as_ref().is_none_or(|found| found.agrees);
    Ok(outcome.report.useful && agrees)
}

/// Writes into a folder beside `out` and renames it, so that half a result never shows.
fn write(out: &Path, outcome: &Outcome, onnx: Option<&[u8]>) -> anyhow::Result<()> {
    let partial = out.with_extension("part");
    if partial.exists() {
        std::fs::remove_dir_all(&partial)?;
    }
    std::fs::create_dir_all(&partial)?;
    let [model, file, report] = super::files(&partial);
    let mut text = serde_json::to_string_pretty(&outcome.model)?;
    text.push('\n');
    std::fs::write(model, text)?;
    std::fs::write(report, outcome.report.text())?;
    if let Some(bytes) = onnx {
        std::fs::write(file, bytes)?;
    }
    std::fs::rename(&partial, out)?;
    Ok(())
}
