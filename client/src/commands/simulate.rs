//! `robopheus simulate`

use crate::output::Output;
use anyhow::{Context, ensure};
use identify::bundle::Bundle;
use identify::channel::Channel;
use std::path::{Path, PathBuf};
use twin::model_document::ModelDocument;
use twin::pose::{Pose, wrapped_rad};
use twin::replay::{CommandRow, ReplayRow};
use twin::robot::Robot;

#[derive(clap::Args)]
pub struct Arguments {
    /// Robot description; the model's, else the bundle's own when absent
    #[arg(long)]
    robot: Option<PathBuf>,
    /// Model version (robopheus.model/1) whose effects and residual act on the robot; the nominal twin when absent
    #[arg(long)]
    model: Option<PathBuf>,
    /// Run bundle whose commands are replayed: a folder with run.json and telemetry.csv
    #[arg(long)]
    commands: PathBuf,
    /// Folder for the simulated bundle; must not exist
    #[arg(long)]
    out: PathBuf,
}

#[derive(serde::Serialize)]
struct Summary {
    out: PathBuf,
    rows: usize,
    duration_s: f64,
}

/// At rest at the bundle's first pose, no noise, one row per input time stamp.
pub fn run(arguments: &Arguments, output: &Output) -> anyhow::Result<()> {
    let run_text = read_text(&arguments.commands.join("run.json"))?;
    let table = arguments.commands.join("telemetry.csv");
    let csv = std::fs::read(&table).with_context(|| format!("cannot read {}", table.display()))?;
    let bundle = Bundle::parse(&run_text, &csv).with_context(|| format!("{}", arguments.commands.display()))?;
    let robot = robot(arguments, &bundle)?;
    let commands = bundle.command_rows();
    let rows = twin::replay::replay(&robot, first_pose(&bundle)?, &commands)
        .with_context(|| format!("{}", arguments.commands.display()))?;
    ensure!(
        !arguments.out.exists(),
        "{} exists; name a new folder",
        arguments.out.display()
    );
    write_bundle(&arguments.out, &run_text, &robot, &commands, &rows)
        .with_context(|| format!("cannot write {}", arguments.out.display()))?;
    let duration_s = rows
        .last()
        .zip(rows.first())
        .map_or(0.0, |(last, first)| last.time_s - first.time_s);
    let summary = Summary {
        out: arguments.out.clone(),
        rows: rows.len(),
        duration_s,
    };
    output.result(&summary, || {
        format!("{}: {} rows, {duration_s:.2} s", arguments.out.display(), rows.len())
    })
}

/// Description from the most particular source, effects and residual from the model.
fn robot(arguments: &Arguments, bundle: &Bundle) -> anyhow::Result<Robot> {
    let model = match &arguments.model {
        None => None,
        Some(path) => Some(ModelDocument::parse(&read_text(path)?).with_context(|| format!("{}", path.display()))?),
    };
    let description = match (&arguments.robot, &model) {
        (Some(path), _) => serde_json::from_str(&read_text(path)?).with_context(|| format!("{}", path.display()))?,
        (None, Some(model)) => model.robot.clone(),
        (None, None) => bundle.robot.description().clone(),
    };
    let (effects, residual) = model.map_or((Vec::new(), None), |model| (model.effects, model.residual));
    Ok(Robot::with_model(description, &effects, residual.as_ref())?)
}

fn read_text(path: &Path) -> anyhow::Result<String> {
    std::fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))
}

fn first_pose(bundle: &Bundle) -> anyhow::Result<Pose> {
    let first = |channel| {
        bundle
            .telemetry
            .series(channel)
            .and_then(|series| series.values.first().copied())
    };
    let missing = "has no sample: the replay starts at the first measured pose";
    Ok(Pose {
        x_m: first(Channel::PoseX).with_context(|| format!("pose_x_m {missing}"))?,
        y_m: first(Channel::PoseY).with_context(|| format!("pose_y_m {missing}"))?,
        yaw_rad: first(Channel::PoseYaw).with_context(|| format!("pose_yaw_rad {missing}"))?,
    })
}

/// Writes run.json and telemetry.csv into a folder beside `out` and renames it, so that half a bundle never shows.
fn write_bundle(
    out: &Path,
    run_text: &str,
    robot: &Robot,
    commands: &[CommandRow],
    rows: &[ReplayRow],
) -> anyhow::Result<()> {
    let partial = out.with_extension("part");
    std::fs::create_dir_all(&partial)?;
    let mut run: serde_json::Value = serde_json::from_str(run_text)?;
    run["robot"] = serde_json::to_value(robot.description())?;
    run["label"] = format!("simulated: {}", run["label"].as_str().unwrap_or_default()).into();
    std::fs::write(partial.join("run.json"), serde_json::to_vec_pretty(&run)?)?;
    let mut table = csv::Writer::from_path(partial.join("telemetry.csv"))?;
    let columns = Columns::of(robot);
    table.write_record(columns.header())?;
    for (command, row) in commands.iter().zip(rows) {
        table.write_record(columns.record(command, row))?;
    }
    table.flush()?;
    std::fs::rename(&partial, out)?;
    Ok(())
}

/// Which wheels and actuators the robot has; order of the columns.
struct Columns {
    driven: Vec<usize>,
    spinning: Vec<usize>,
    steered: bool,
    motor: bool,
}

impl Columns {
    fn of(robot: &Robot) -> Self {
        let description = robot.description();
        let wheels = || description.wheels.iter().enumerate();
        Self {
            driven: wheels().filter(|(_, wheel)| wheel.driven).map(|(k, _)| k).collect(),
            spinning: wheels()
                .filter(|(_, wheel)| wheel.radius_m.is_some())
                .map(|(k, _)| k)
                .collect(),
            steered: description.steering.is_some(),
            motor: description.motor.is_some(),
        }
    }

    fn header(&self) -> Vec<String> {
        let mut names = vec!["time_s".to_owned()];
        names.extend(self.driven.iter().map(|k| format!("command_wheel_{k}_rad_per_s")));
        names.extend(["forward_m_per_s", "left_m_per_s", "yaw_rate_rad_per_s"].map(|axis| format!("command_{axis}")));
        if self.steered {
            names.extend(["command_steering_rad".to_owned(), "steering_rad".to_owned()]);
        }
        names.extend(
            self.spinning
                .iter()
                .flat_map(|k| [format!("wheel_{k}_rad_per_s"), format!("wheel_{k}_rad")]),
        );
        if self.motor {
            names.extend(self.driven.iter().map(|k| format!("current_{k}_a")));
            names.push("bus_v".to_owned());
        }
        let rest = [
            "gyro_z_rad_per_s",
            "accel_x_m_per_s2",
            "accel_y_m_per_s2",
            "pose_x_m",
            "pose_y_m",
            "pose_yaw_rad",
        ];
        names.extend(rest.map(str::to_owned));
        names
    }

    fn record(&self, command: &CommandRow, row: &ReplayRow) -> Vec<String> {
        let optional = |value: Option<f64>| value.map(|number| number.to_string()).unwrap_or_default();
        let state = &row.state;
        let mut cells = vec![row.time_s.to_string()];
        cells.extend(self.driven.iter().map(|k| optional(command.wheel_rad_per_s[*k])));
        cells.extend(
            [
                command.forward_m_per_s,
                command.left_m_per_s,
                command.yaw_rate_rad_per_s,
            ]
            .map(optional),
        );
        if self.steered {
            cells.extend([optional(command.steering_rad), state.steering_rad.to_string()]);
        }
        let wheels = self.spinning.iter();
        cells.extend(wheels.flat_map(|k| [state.wheel_rad_per_s[*k].to_string(), state.wheel_rad[*k].to_string()]));
        if self.motor {
            cells.extend(self.driven.iter().map(|k| state.current_a[*k].to_string()));
            cells.push(state.bus_v.to_string());
        }
        let pose = state.pose;
        let inertial = [state.gyro_z_rad_per_s, state.accel_x_m_per_s2, state.accel_y_m_per_s2];
        cells.extend(inertial.map(|number| number.to_string()));
        cells.extend([pose.x_m, pose.y_m, wrapped_rad(pose.yaw_rad)].map(|number| number.to_string()));
        cells
    }
}
