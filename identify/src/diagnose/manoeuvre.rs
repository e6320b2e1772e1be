//! Manoeuvres of the catalogue, and what two models would measure in them.

use twin::pose::Pose;
use twin::replay::{CommandRow, HeldCommand, ReplayRow, replay};
use twin::robot::{Robot, RobotDescription};
use twin::twist::BodyTwist;

use super::prepared::{Prepared, prepare};
use crate::bundle::Bundle;
use crate::channel::Channel;
use crate::floor::Floor;
use crate::hypothesis::Hypothesis;
use crate::random::Random;
use crate::record::{Record, Stages};
use crate::screen::all_residuals;
use crate::telemetry::{Series, Telemetry};
use crate::workers::{Cancelled, Workers, gathered};

/// What a robot is to do.
#[derive(Debug, Clone, Copy)]
pub(super) struct Manoeuvre {
    pub name: &'static str,
    pub duration_s: f64,
    pub what: &'static str,
}

/// By what shows an effect.
pub(super) const CATALOGUE: [Manoeuvre; 9] = [
    Manoeuvre {
        name: "slow_ramps",
        duration_s: 20.0,
        what: "slow ramps of the wheel speeds through zero, both ways, with stops",
    },
    Manoeuvre {
        name: "speed_steps",
        duration_s: 20.0,
        what: "steps between several steady speeds, forward and backward",
    },
    Manoeuvre {
        name: "random_steps",
        duration_s: 30.0,
        what: "randomly spaced steps of all sizes up to the limits",
    },
    Manoeuvre {
        name: "spins",
        duration_s: 20.0,
        what: "turns on the spot at several rates, left and right",
    },
    Manoeuvre {
        name: "straight_lines",
        duration_s: 30.0,
        what: "straight lines over the whole field, forward and backward",
    },
    Manoeuvre {
        name: "compass",
        duration_s: 40.0,
        what: "the same straight line at eight headings",
    },
    Manoeuvre {
        name: "circles",
        duration_s: 30.0,
        what: "circles left and right at rising speed",
    },
    Manoeuvre {
        name: "field_grid",
        duration_s: 60.0,
        what: "slow passes over the whole field in lanes of 0.3 m",
    },
    Manoeuvre {
        name: "strafes",
        duration_s: 20.0,
        what: "sideways and diagonal passes",
    },
];

/// Their places.
const SLOW_RAMPS: usize = 0;
const SPEED_STEPS: usize = 1;
pub(super) const RANDOM_STEPS: usize = 2;
const SPINS: usize = 3;
const STRAIGHT_LINES: usize = 4;
const COMPASS: usize = 5;
const CIRCLES: usize = 6;
const FIELD_GRID: usize = 7;

/// So much of each is driven by the twin, after a rest, s.
pub(super) const TRIAL_S: f64 = 12.0;
const REST_S: f64 = 1.0;
/// Rate of the set-points and of what is measured, Hz.
const RATE_HZ: f64 = 120.0;
/// Cars drive at least so fast while they turn, m/s, and turn on no smaller circle, m.
const TURNING_M_PER_S: f64 = 0.3;
const SMALLEST_RADIUS_M: f64 = 0.7;
/// Of the random steps: how long each lasts, s, and the largest speeds, m/s and rad/s.
const STEP_S: f64 = 0.8;
const STEP_M_PER_S: f64 = 0.6;
const STEP_RAD_PER_S: f64 = 1.5;

/// Forward, left and yaw rate of a part of a programme that lasts so long.
type Part = (f64, [f64; 3]);

/// A manoeuvre as a body's twist over time: one cycle of it.
fn cycle(number: usize) -> Vec<Part> {
    let turn = core::f64::consts::FRAC_PI_2;
    let steps =
        |speeds: &[f64], lasts_s: f64| -> Vec<Part> { speeds.iter().map(|v| (lasts_s, [*v, 0.0, 0.0])).collect() };
    match number {
        SLOW_RAMPS => {
            let ramp = [0.03, 0.06, 0.09, 0.12, 0.15, 0.12, 0.09, 0.06, 0.03, 0.0];
            let back = ramp.map(|v| -v);
            [steps(&ramp, 0.25), steps(&back, 0.25)].concat()
        }
        SPEED_STEPS => steps(&[0.2, 0.4, 0.6, 0.3, 0.0, -0.2, -0.4, -0.6, -0.3, 0.0], 1.0),
        RANDOM_STEPS => {
            let mut random = Random::new(1, 0x7472_6961_6c73);
            let mut within = |most: f64| most * (2.0 * random.uniform() - 1.0);
            let parts = 0..(TRIAL_S / STEP_S) as usize;
            parts
                .map(|_| {
                    (
                        STEP_S,
                        [within(STEP_M_PER_S), within(STEP_M_PER_S), within(STEP_RAD_PER_S)],
                    )
                })
                .collect()
        }
        SPINS => {
            let rates = [0.5, 1.0, 1.5, 0.0, -0.5, -1.0, -1.5, 0.0];
            rates.iter().map(|rate| (1.25, [0.0, 0.0, *rate])).collect()
        }
        STRAIGHT_LINES => vec![
            (3.0, [0.5, 0.0, 0.0]),
            (0.5, [0.0; 3]),
            (3.0, [-0.5, 0.0, 0.0]),
            (0.5, [0.0; 3]),
            (1.0, [0.0, 0.0, turn]),
        ],
        COMPASS => vec![(1.5, [0.4, 0.0, 0.0]), (1.5, [-0.4, 0.0, 0.0]), (0.5, [0.0, 0.0, turn])],
        CIRCLES => {
            let speeds = [0.2, 0.3, 0.4, 0.5, 0.6];
            let round = |side: f64| {
                speeds
                    .iter()
                    .map(move |v| (1.2, [*v, 0.0, side * v / SMALLEST_RADIUS_M]))
            };
            round(1.0).chain(round(-1.0)).collect()
        }
        FIELD_GRID => {
            let lane = |side: f64| {
                let turned = (1.0, [0.0, 0.0, side * turn]);
                [(4.0, [0.3, 0.0, 0.0]), turned, (1.0, [0.3, 0.0, 0.0]), turned]
            };
            [lane(1.0), lane(-1.0)].concat()
        }
        // Sideways and diagonal.
        _ => {
            let ways = [
                [0.0, 1.0],
                [0.0, -1.0],
                [0.7, 0.7],
                [-0.7, -0.7],
                [0.7, -0.7],
                [-0.7, 0.7],
            ];
            ways.map(|[forward, left]| (1.5, [0.5 * forward, 0.5 * left, 0.0]))
                .to_vec()
        }
    }
}

/// The twist at a time, as far as the robot can move so: none sideways without omni wheels, cars turn while they drive.
fn twist_at(cycle: &[Part], time_s: f64, robot: &RobotDescription) -> BodyTwist {
    let all_s: f64 = cycle.iter().map(|part| part.0).sum();
    let mut left_s = time_s - libm::floor(time_s / all_s) * all_s;
    let mut wanted = [0.0; 3];
    for (lasts_s, twist) in cycle {
        wanted = *twist;
        if left_s < *lasts_s {
            break;
        }
        left_s -= lasts_s;
    }
    let [mut forward_m_per_s, mut left_m_per_s, mut yaw_rate_rad_per_s] = wanted;
    if !robot.wheels.iter().any(|wheel| wheel.kind == "omni") {
        // What would go sideways goes forward and back.
        if forward_m_per_s == 0.0 {
            forward_m_per_s = left_m_per_s;
        }
        left_m_per_s = 0.0;
    }
    if robot.steering.is_some() && yaw_rate_rad_per_s != 0.0 {
        if forward_m_per_s.abs() < TURNING_M_PER_S {
            forward_m_per_s = TURNING_M_PER_S.copysign(forward_m_per_s);
        }
        let most = forward_m_per_s.abs() / SMALLEST_RADIUS_M;
        yaw_rate_rad_per_s = yaw_rate_rad_per_s.clamp(-most, most);
    }
    BodyTwist {
        forward_m_per_s,
        left_m_per_s,
        yaw_rate_rad_per_s,
    }
}

/// All manoeuvres as the twin would drive and measure them.
pub(super) struct Trials {
    runs: Prepared,
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
            let rows = rows(&robot, number, fastest);
            let states = replay(&robot, from, &rows).ok()?;
            let bundle = bundle(like, &robot, &rows, &states);
            Some(Record::of(CATALOGUE[number].name, &bundle))
        })?;
        let Some(driven) = driven.into_iter().collect::<Option<Vec<Record>>>() else {
            return Ok(None);
        };
        let runs = prepare(workers, floor, driven, stages)?;
        Ok((runs.records.len() == CATALOGUE.len()).then_some(Trials { runs }))
    }

    /// How far apart two models are in each, in standard deviations: what noise and everyday differences do not make.
    pub fn sigmas(
        &self,
        workers: &dyn Workers,
        floor: &Floor,
        (a, b): (&Hypothesis, &Hypothesis),
    ) -> Result<Vec<Option<f64>>, Cancelled> {
        let records = &self.runs.records;
        let (a, b) = (all_residuals(workers, records, a)?, all_residuals(workers, records, b)?);
        let of = |number: usize| -> Option<f64> {
            let (a, b) = (a[number].as_ref()?, b[number].as_ref()?);
            let apart: Vec<f64> = a.iter().zip(b).map(|(a, b)| a - b).collect();
            let knobs = self.runs.sensitivities.iter();
            let alone: Vec<Vec<Vec<f64>>> = knobs.map(|knob| vec![knob[number].clone()]).collect();
            let metric = floor.metric(&records[number..=number], &alone);
            let square = metric.gram(&[vec![&apart]]).at(0, 0);
            square.is_finite().then(|| libm::sqrt(square.max(0.0)))
        };
        Ok((0..records.len()).map(of).collect())
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

/// Twists of the manoeuvre, slower where wheels would be told to turn faster than `fastest_rad_per_s`.
fn rows(robot: &Robot, number: usize, fastest_rad_per_s: f64) -> Vec<CommandRow> {
    let cycle = cycle(number);
    let description = robot.description();
    let times = (0..((REST_S + TRIAL_S) * RATE_HZ) as usize).map(|k| k as f64 / RATE_HZ);
    let twists: Vec<(f64, BodyTwist)> = times
        .map(|time_s| {
            let since_s = time_s - REST_S;
            let twist = if since_s < 0.0 {
                BodyTwist::default()
            } else {
                twist_at(&cycle, since_s, description)
            };
            (time_s, twist)
        })
        .collect();
    let wheels = twists
        .iter()
        .flat_map(|(_, twist)| robot.wheel_speeds(*twist).wheel_rad_per_s);
    let most = wheels.map(f64::abs).fold(0.0, f64::max);
    let share = if most > fastest_rad_per_s {
        fastest_rad_per_s / most
    } else {
        1.0
    };
    let told = twists.iter().map(|(time_s, twist)| CommandRow {
        time_s: *time_s,
        forward_m_per_s: Some(share * twist.forward_m_per_s),
        left_m_per_s: Some(share * twist.left_m_per_s),
        yaw_rate_rad_per_s: Some(share * twist.yaw_rate_rad_per_s),
        ..CommandRow::default()
    });
    told.collect()
}

/// What is measured of it, without noise, in the channels of another run.
fn bundle(like: &Bundle, robot: &Robot, rows: &[CommandRow], states: &[ReplayRow]) -> Bundle {
    let mut telemetry = Telemetry {
        time_s: rows.iter().map(|row| row.time_s).collect(),
        ..Telemetry::default()
    };
    let mut held = HeldCommand::default();
    let mut channels: Vec<(Channel, Vec<f64>)> = like
        .telemetry
        .channels
        .keys()
        .map(|channel| (*channel, Vec::new()))
        .collect();
    for (row, after) in rows.iter().zip(states) {
        held.apply(robot, row);
        let (told, state) = (held.command(), &after.state);
        for (channel, values) in &mut channels {
            let value = match *channel {
                Channel::CommandWheel(k) => told.wheel_rad_per_s[k],
                Channel::CommandForward => row.forward_m_per_s.unwrap_or_default(),
                Channel::CommandLeft => row.left_m_per_s.unwrap_or_default(),
                Channel::CommandYawRate => row.yaw_rate_rad_per_s.unwrap_or_default(),
                Channel::CommandSteering => told.steering_rad,
                Channel::Steering => state.steering_rad,
                Channel::WheelSpeed(k) => state.wheel_rad_per_s[k],
                Channel::WheelAngle(k) => state.wheel_rad[k],
                Channel::Current(k) => state.current_a[k],
                Channel::Voltage(k) => state.voltage_v[k],
                Channel::Bus => state.bus_v,
                Channel::Gyro => state.gyro_z_rad_per_s,
                Channel::AccelX => state.accel_x_m_per_s2,
                Channel::AccelY => state.accel_y_m_per_s2,
                Channel::PoseX => state.pose.x_m,
                Channel::PoseY => state.pose.y_m,
                Channel::PoseYaw => state.pose.yaw_rad,
                // Of what is not compared nothing is told.
                _ => continue,
            };
            values.push(value);
        }
    }
    let all: Vec<u32> = (0..telemetry.time_s.len() as u32).collect();
    for (channel, values) in channels.into_iter().filter(|(_, values)| values.len() == all.len()) {
        telemetry.channels.insert(
            channel,
            Series {
                rows: all.clone(),
                values,
            },
        );
    }
    Bundle {
        run: like.run.clone(),
        robot: like.robot.clone(),
        telemetry,
        remarks: Vec::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::workers::Serial;
    use twin::golden::reference_robot;

    /// Every chassis can move as it is told, for all of the trial, and no wheel is told more than is allowed.
    #[test]
    fn every_manoeuvre_is_one_that_the_robot_can_drive() {
        for chassis in ["diff2", "diff4", "omni4", "fwd", "rwd", "awd"] {
            let robot = Robot::new(reference_robot(chassis)).expect("a robot");
            for number in 0..CATALOGUE.len() {
                let told = rows(&robot, number, 8.0);
                assert_eq!(told.len(), ((REST_S + TRIAL_S) * RATE_HZ) as usize);
                let mut held = HeldCommand::default();
                let mut most = 0.0_f64;
                for row in &told {
                    held.apply(&robot, row);
                    most = held
                        .command()
                        .wheel_rad_per_s
                        .iter()
                        .fold(most, |most, w| most.max(w.abs()));
                    let (forward, left) = (row.forward_m_per_s.unwrap_or(0.0), row.left_m_per_s.unwrap_or(0.0));
                    let yaw_rate = row.yaw_rate_rad_per_s.unwrap_or(0.0);
                    assert!(chassis == "omni4" || left == 0.0, "{chassis} {number}");
                    let is_car = robot.description().steering.is_some();
                    assert!(
                        !is_car || yaw_rate.abs() <= forward.abs() / SMALLEST_RADIUS_M + 1e-12,
                        "{chassis} {number}"
                    );
                }
                assert!(most > 0.5 && most <= 8.0 + 1e-9, "{chassis} {number}: {most}");
                let out = replay(&robot, Pose::default(), &told).expect("it can be driven");
                let far = |row: &ReplayRow| row.state.pose.x_m.abs().max(row.state.pose.y_m.abs());
                assert!(out.iter().all(|row| far(row) < 6.0), "{chassis} {number}");
            }
        }
    }

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
            trials.runs.records.iter().all(|record| record.windows.len() >= 5),
            "{chassis}"
        );
        let sigmas = |other: &Hypothesis| -> Vec<f64> {
            let all = trials
                .sigmas(&Serial, &floor, (&nominal, other))
                .expect("not cancelled");
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
