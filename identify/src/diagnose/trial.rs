//! Manoeuvres as the twin would drive and measure them.

use twin::command::WheelCommand;
use twin::pose::Pose;
use twin::replay::{CommandRow, HeldCommand, ReplayRow, replay};
use twin::robot::Robot;
use twin::world::RobotState;

use super::manoeuvre::{CATALOGUE, RATE_HZ, rows};
use crate::bundle::Bundle;
use crate::channel::Channel;
use crate::floor::{Floor, Metric, knob_changes, sensor_sigmas};
use crate::hypothesis::Hypothesis;
use crate::random::Random;
use crate::record::{Record, Stages};
use crate::screen::{all_residuals, columns};
use crate::telemetry::{Series, Telemetry};
use crate::workers::{Cancelled, Workers, gathered};

/// All manoeuvres as the twin would drive and measure them with a model.
pub(super) struct Trials {
    records: Vec<Record>,
    /// Under the model that drives.
    residuals: Vec<Vec<f64>>,
    /// Of each manoeuvre by itself.
    metrics: Vec<Metric>,
}

impl Trials {
    /// - `like`: a run of the robot; the channels that it has are measured.
    /// - `records`: runs; a trial begins in the middle of where they did, and no wheel is told to turn faster than theirs.
    /// - `model`: what drives.
    /// - `stages`: that the knobs of the floor's model act on.
    /// - Returns `None` when the model cannot drive.
    pub fn of(
        workers: &dyn Workers,
        floor: &Floor,
        (like, records): (&Bundle, &[Record]),
        model: &Hypothesis,
        stages: &[Stages],
    ) -> Result<Option<Trials>, Cancelled> {
        let Some(robot) = model.robot() else {
            return Ok(None);
        };
        let (from, fastest) = (middle(records), fastest(records));
        let driven = gathered(workers, CATALOGUE.len(), &|number| {
            let rows = as_told(rows(&robot, number, fastest), &like.telemetry);
            let states = replay(&robot, from, &rows).ok()?;
            let bundle = bundle(like, &robot, &rows, &states);
            Some(Record::of(CATALOGUE[number].name, &bundle))
        })?;
        let Some(records) = driven.into_iter().collect::<Option<Vec<Record>>>() else {
            return Ok(None);
        };
        let whole = |of: &Hypothesis| -> Result<Option<Vec<Vec<f64>>>, Cancelled> {
            Ok(all_residuals(workers, &records, of)?.into_iter().collect())
        };
        let (Some(residuals), Some(healthy)) = (whole(model)?, whole(&floor.model)?) else {
            return Ok(None);
        };
        let changes = knob_changes(&floor.model, &floor.knobs, &floor.values, stages);
        let sensitivities = columns(workers, &records, &healthy, &changes)?;
        let metric = |number: usize| {
            let alone: Vec<Vec<Vec<f64>>> = sensitivities.iter().map(|knob| vec![knob[number].clone()]).collect();
            floor.metric(&records[number..=number], &alone)
        };
        Ok(Some(Trials {
            metrics: (0..records.len()).map(metric).collect(),
            residuals,
            records,
        }))
    }

    /// How far apart another model is in each, in standard deviations: what noise and everyday differences do not make.
    pub fn sigmas(&self, workers: &dyn Workers, other: &Hypothesis) -> Result<Vec<Option<f64>>, Cancelled> {
        let others = all_residuals(workers, &self.records, other)?;
        let of = |(number, other): (usize, Option<Vec<f64>>)| -> Option<f64> {
            let other = other?;
            let apart: Vec<f64> = self.residuals[number].iter().zip(&other).map(|(a, b)| a - b).collect();
            let square = self.metrics[number].gram(&[vec![&apart]]).at(0, 0);
            square.is_finite().then(|| libm::sqrt(square.max(0.0)))
        };
        Ok(others.into_iter().enumerate().map(of).collect())
    }
}

/// Largest set-point of the runs, rad/s; no limit where they tell none.
fn fastest(records: &[Record]) -> f64 {
    let most = records
        .iter()
        .map(|record| record.largest_command_rad_per_s)
        .fold(0.0, f64::max);
    if most > 0.0 { most } else { f64::INFINITY }
}

/// Mean of where windows begin.
fn middle(records: &[Record]) -> Pose {
    let starts = || {
        records
            .iter()
            .flat_map(|record| &record.windows)
            .map(|window| window.start.pose)
    };
    let count = starts().count().max(1) as f64;
    Pose {
        x_m: starts().map(|pose| pose.x_m).sum::<f64>() / count,
        y_m: starts().map(|pose| pose.y_m).sum::<f64>() / count,
        yaw_rad: 0.0,
    }
}

/// Without the parts of a twist that the robot of a run is not told.
fn as_told(mut rows: Vec<CommandRow>, like: &Telemetry) -> Vec<CommandRow> {
    let has = |channel: Channel| like.channels.contains_key(&channel);
    let is_by_twist = has(Channel::CommandForward)
        && !like
            .channels
            .keys()
            .any(|channel| matches!(channel, Channel::CommandWheel(_)));
    for row in rows.iter_mut().filter(|_| is_by_twist) {
        if !has(Channel::CommandLeft) {
            row.left_m_per_s = Some(0.0);
        }
        if !has(Channel::CommandYawRate) {
            row.yaw_rate_rad_per_s = Some(0.0);
        }
    }
    rows
}

/// What is measured of it, in the channels of another run as often as there and with the sensors' noise. Models are compared in what they predict, so
/// that noise is in no difference but through the starts of windows.
fn bundle(like: &Bundle, robot: &Robot, rows: &[CommandRow], states: &[ReplayRow]) -> Bundle {
    let mut held = HeldCommand::default();
    let told: Vec<WheelCommand> = rows
        .iter()
        .map(|row| {
            held.apply(robot, row);
            held.command()
        })
        .collect();
    let sigmas = sensor_sigmas(robot.description());
    let mut telemetry = Telemetry {
        time_s: rows.iter().map(|row| row.time_s).collect(),
        ..Telemetry::default()
    };
    for (position, channel) in like.telemetry.channels.keys().enumerate() {
        // The three parts of a pose are measured together.
        let timed_like = match channel {
            Channel::PoseY | Channel::PoseYaw => Channel::PoseX,
            other => *other,
        };
        let every = if channel.is_command() {
            1
        } else {
            rows_apart(&like.telemetry, timed_like)
        };
        let mut random = Random::new(position as u64, 0x7472_6961_6c73);
        let mut series = Series::default();
        for k in (0..rows.len()).step_by(every) {
            let Some((value, class)) = measured(*channel, &rows[k], &told[k], &states[k].state) else {
                break;
            };
            series.rows.push(k as u32);
            series
                .values
                .push(value + class.map_or(0.0, |class| sigmas[class] * random.normal()));
        }
        if !series.rows.is_empty() {
            telemetry.channels.insert(*channel, series);
        }
    }
    Bundle {
        // Everything is sent and measured at the moment.
        run: crate::bundle::Run {
            command_delay_s: 0.0,
            pose_latency_s: 0.0,
            ..like.run.clone()
        },
        robot: like.robot.clone(),
        telemetry,
        remarks: Vec::new(),
    }
}

/// Rows of the trial from one sample of a channel to the next, as seldom as in another run.
fn rows_apart(telemetry: &Telemetry, channel: Channel) -> usize {
    let Some(series) = telemetry.series(channel) else {
        return 1;
    };
    let times = series
        .rows
        .windows(2)
        .map(|pair| telemetry.time_s[pair[1] as usize] - telemetry.time_s[pair[0] as usize]);
    let mut periods: Vec<f64> = times.collect();
    periods.sort_by(f64::total_cmp);
    let period_s = periods.get(periods.len() / 2).copied().unwrap_or(0.0);
    (libm::round(period_s * RATE_HZ) as usize).max(1)
}

/// What a channel shows, and the class of its noise if it has one; nothing of channels that are not compared.
fn measured(
    channel: Channel,
    row: &CommandRow,
    told: &WheelCommand,
    state: &RobotState,
) -> Option<(f64, Option<usize>)> {
    Some(match channel {
        Channel::CommandWheel(k) => (told.wheel_rad_per_s[k], None),
        Channel::CommandForward => (row.forward_m_per_s?, None),
        Channel::CommandLeft => (row.left_m_per_s?, None),
        Channel::CommandYawRate => (row.yaw_rate_rad_per_s?, None),
        Channel::CommandSteering => (told.steering_rad, None),
        Channel::WheelSpeed(k) => (state.wheel_rad_per_s[k], Some(0)),
        Channel::WheelAngle(k) => (state.wheel_rad[k], None),
        Channel::Steering => (state.steering_rad, Some(1)),
        Channel::Current(k) => (state.current_a[k], Some(2)),
        Channel::Voltage(k) => (state.voltage_v[k], None),
        Channel::Bus => (state.bus_v, Some(3)),
        Channel::Gyro => (state.gyro_z_rad_per_s, Some(4)),
        Channel::AccelX => (state.accel_x_m_per_s2, Some(5)),
        Channel::AccelY => (state.accel_y_m_per_s2, Some(5)),
        Channel::PoseX => (state.pose.x_m, Some(6)),
        Channel::PoseY => (state.pose.y_m, Some(6)),
        Channel::PoseYaw => (state.pose.yaw_rad, Some(7)),
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::workers::Serial;
    use twin::golden::reference_robot;
    use twin::robot::RobotDescription;

    /// A run of a robot in which every channel has a sample.
    fn bundle_of(robot: &RobotDescription) -> Bundle {
        let mut channels: Vec<Channel> = Vec::new();
        for (k, wheel) in robot.wheels.iter().enumerate() {
            if wheel.driven {
                channels.extend([Channel::CommandWheel(k), Channel::Current(k)]);
            }
            if wheel.kind != "caster" {
                channels.extend([Channel::WheelSpeed(k), Channel::WheelAngle(k)]);
            }
        }
        if robot.steering.is_some() {
            channels.extend([Channel::CommandSteering, Channel::Steering]);
        }
        channels.extend([Channel::Bus, Channel::Gyro, Channel::AccelX, Channel::AccelY]);
        channels.extend([Channel::PoseX, Channel::PoseY, Channel::PoseYaw]);
        let names: Vec<String> = channels.into_iter().map(|channel| channel.name()).collect();
        let csv = format!("time_s,{}\n0{}\n", names.join(","), ",0".repeat(names.len()));
        let robot = serde_json::to_value(robot).expect("a robot");
        let run = serde_json::json!({
            "format": crate::bundle::RUN_FORMAT,
            "robot": robot,
            "floor": "hall",
            "label": "",
            "started": "",
            "change_free_reference": false,
        });
        Bundle::parse(&run.to_string(), csv.as_bytes()).expect("a bundle")
    }

    /// The manoeuvre that shows an effect best, and standard deviations by which each tells it from none, beside everyday differences.
    fn shown(chassis: &str, name: &str, value: f64) -> (&'static str, Vec<f64>) {
        let description = reference_robot(chassis);
        let nominal = Hypothesis {
            description: description.clone(),
            effects: Vec::new(),
            residual: None,
        };
        let all = crate::hypothesis::candidates(&description, &crate::hypothesis::Excitation::default());
        let knobs = crate::hypothesis::knobs(&all, &description);
        let stages = vec![Stages::BOTH; knobs.len()];
        let floor = Floor::stated(nominal.clone(), knobs);
        let one = all.iter().find(|one| one.entry.name == name).expect("a candidate");
        let mut changed = nominal.clone();
        changed.effects.push(one.effect(&vec![value; one.axes.len()]));
        let trials = Trials::of(&Serial, &floor, (&bundle_of(&description), &[]), &nominal, &stages);
        let trials = trials.expect("not cancelled").expect("it can be driven");
        assert!(
            trials.records.iter().all(|record| record.windows.len() >= 5),
            "{chassis}"
        );
        let sigmas = |other: &Hypothesis| -> Vec<f64> {
            let all = trials.sigmas(&Serial, other).expect("not cancelled");
            all.into_iter()
                .map(|sigmas| sigmas.expect("it can be simulated"))
                .collect()
        };
        assert!(sigmas(&nominal).iter().all(|sigmas| *sigmas == 0.0));
        let sigmas = sigmas(&changed);
        let best = (0..CATALOGUE.len())
            .max_by(|a, b| sigmas[*a].total_cmp(&sigmas[*b]))
            .expect("a manoeuvre");
        (CATALOGUE[best].name, sigmas)
    }

    /// An effect that acts in some motion alone is shown by the manoeuvres that have it.
    #[test]
    fn what_a_manoeuvre_shows_follows_from_how_it_is_driven() {
        for (chassis, name, value, shown_by, not_by) in [
            ("diff2", "gyro_scale", 0.02, "spins", "speed_steps"),
            ("diff2", "command_delay", 0.02, "random_steps", ""),
            ("diff2", "wheel_speed_saturation", 12.0, "circles", "spins"),
            ("rwd", "steering_lag", 0.05, "random_steps", "slow_ramps"),
            ("omni4", "roller_drag", 1.0, "strafes", "spins"),
        ] {
            let (best, sigmas) = shown(chassis, name, value);
            assert_eq!(best, shown_by, "{chassis} {name}: {sigmas:?}");
            let not = CATALOGUE.iter().position(|manoeuvre| manoeuvre.name == not_by);
            assert!(not.is_none_or(|not| sigmas[not] < 0.1), "{chassis} {name}: {sigmas:?}");
        }
    }
}
