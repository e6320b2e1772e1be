//! `robopheus import`

use crate::import::{self, Cuts, map};
use crate::output::Output;
use anyhow::{Context, ensure};
use identify::bundle::{RUN_FORMAT, Run, Stamp};
use std::path::{Path, PathBuf};
use twin::robot::RobotDescription;

/// Shortest run worth a diagnosis, s.
const SHORTEST_S: f64 = 2.0;

#[derive(clap::Args)]
pub struct Arguments {
    /// Their table: CSV (comma, semicolon or tab) or Parquet (.parquet)
    table: PathBuf,
    /// Robot description (JSON), as in run.json
    #[arg(long)]
    robot: PathBuf,
    /// Chassis, where the description shall not decide
    #[arg(long)]
    chassis: Option<String>,
    /// Column map (robopheus.columns/1)
    #[arg(long)]
    map: Option<PathBuf>,
    /// One column: theirs=ours, theirs=ours:unit or theirs=ours:unit*gain
    #[arg(long)]
    column: Vec<String>,
    /// Folder for the bundle, or for run-001, run-002, ... where the table is cut; must not exist
    #[arg(long)]
    out: PathBuf,
    /// Cut the table where the time stamps pause for longer than this, s
    #[arg(long)]
    cut_gap: Option<f64>,
    /// Cut the table where this column of theirs changes
    #[arg(long)]
    cut_by: Option<String>,
    /// Leave out runs shorter than this, s
    #[arg(long, default_value_t = SHORTEST_S)]
    shortest: f64,
    /// Leave out rows whose time does not grow, instead of refusing the table
    #[arg(long)]
    drop_bad_time: bool,
    /// Nothing was changed in these runs: they may calibrate a diagnosis
    #[arg(long)]
    reference: bool,
    /// What the floor is called
    #[arg(long, default_value = "unknown")]
    floor: String,
    /// What the runs are called; the table's name when absent
    #[arg(long)]
    label: Option<String>,
    /// When they were recorded
    #[arg(long, default_value = "")]
    started: String,
    /// What the time stamps are
    #[arg(long, default_value = "unknown", value_parser = ["sample", "arrival", "unknown"])]
    stamp: String,
    /// Known delay from sending a command to its effect, s
    #[arg(long, default_value_t = 0.0)]
    command_delay: f64,
    /// Known delay of the poses' time stamps, s
    #[arg(long, default_value_t = 0.0)]
    pose_latency: f64,
}

/// Checks robot and column map, then reads the table once.
pub fn run(arguments: &Arguments, output: &Output) -> anyhow::Result<()> {
    let mut entries = Vec::new();
    if let Some(path) = &arguments.map {
        entries = map::parse(&read_text(path)?).with_context(|| path.display().to_string())?;
    }
    for text in &arguments.column {
        entries.push(map::Entry::parse(text)?);
    }
    for (name, seconds) in [
        ("--cut-gap", arguments.cut_gap),
        ("--shortest", Some(arguments.shortest)),
    ] {
        if let Some(seconds) = seconds {
            ensure!(
                (0.0..=1e6).contains(&seconds),
                "{name} {seconds} s; 0 to 1000000 s are possible"
            );
        }
    }
    let cuts = Cuts {
        gap_s: arguments.cut_gap,
        by: arguments.cut_by.clone(),
        shortest_s: arguments.shortest,
        drop_bad_time: arguments.drop_bad_time,
    };
    let done = import::import(
        &arguments.table,
        &entries,
        &described(arguments)?,
        &cuts,
        &arguments.out,
    )?;
    output.result(&done, || {
        let mut lines: Vec<String> = done
            .bundles
            .iter()
            .map(|bundle| {
                format!(
                    "{}: {} rows, {:.2} s",
                    bundle.folder.display(),
                    bundle.rows,
                    bundle.duration_s
                )
            })
            .collect();
        lines.push(format!("columns: {}", done.columns.join(", ")));
        if !done.ignored.is_empty() {
            lines.push(format!("not mapped: {}", done.ignored.join(", ")));
        }
        lines.extend(done.remarks.iter().map(|remark| format!("note: {remark}")));
        lines.join("\n")
    })
}

/// `run.json` of every bundle.
fn described(arguments: &Arguments) -> anyhow::Result<Run> {
    let path = &arguments.robot;
    let mut robot: RobotDescription = serde_json::from_str(&read_text(path)?)
        .with_context(|| format!("{}: is no robot description", path.display()))?;
    if let Some(chassis) = &arguments.chassis {
        robot.chassis.clone_from(chassis);
    }
    let name = || {
        arguments
            .table
            .file_stem()
            .unwrap_or_default()
            .to_string_lossy()
            .into_owned()
    };
    Ok(Run {
        format: RUN_FORMAT.to_owned(),
        robot,
        floor: arguments.floor.clone(),
        label: arguments.label.clone().unwrap_or_else(name),
        started: arguments.started.clone(),
        change_free_reference: arguments.reference,
        stamp: match arguments.stamp.as_str() {
            "sample" => Stamp::Sample,
            "arrival" => Stamp::Arrival,
            _ => Stamp::Unknown,
        },
        command_delay_s: arguments.command_delay,
        pose_latency_s: arguments.pose_latency,
    })
}

fn read_text(path: &Path) -> anyhow::Result<String> {
    std::fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))
}
