//! Candidates: every effect of the library on every wheel it could act on, with the sizes it is tried at.

use twin::effect::Effect;
use twin::effect::library::{EffectEntry, Hook, LIBRARY, Needs, ParameterEntry, find};
use twin::robot::RobotDescription;

use super::LOST;
use crate::record::Stages;

/// One number of a candidate.
#[derive(Debug, Clone, Copy)]
pub struct Axis {
    pub name: &'static str,
    pub unit: &'static str,
    pub neutral: f64,
    pub low: f64,
    pub high: f64,
    /// A change that matters; positive. Infinite neutrals count from the first probe.
    pub practical: f64,
    pub carries_size: bool,
}

/// Values of all axes at which the candidate's sensitivity is taken.
#[derive(Debug, Clone)]
pub struct Column {
    pub values: Vec<f64>,
    /// The axis that is stepped, in a candidate whose columns add up.
    pub axis: usize,
}

/// How columns make up an effect.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// The effect is the sum of its columns, one an axis.
    Sum,
    /// Amplitude and phase: two columns a quarter turn apart.
    Phase,
    /// Each column is an effect of its own, one place or shape each.
    OneOf,
}

/// An effect that might be there.
#[derive(Debug, Clone)]
pub struct Candidate {
    pub entry: &'static EffectEntry,
    pub index: Option<usize>,
    pub axes: Vec<Axis>,
    pub columns: Vec<Column>,
    pub kind: Kind,
    pub stages: Stages,
}

/// What the runs did, for the sizes of probes.
#[derive(Debug, Clone, Copy, Default)]
pub struct Excitation {
    pub wheel_rad_per_s: f64,
    /// Largest commanded forward and left speed and yaw rate.
    pub twist: [f64; 3],
    /// Least and largest x and y.
    pub extent_m: [f64; 4],
}

impl Candidate {
    /// The same effect on the same wheel.
    pub fn is_same(&self, other: &Candidate) -> bool {
        self.entry.name == other.entry.name && self.index == other.index
    }

    /// Name with its wheel.
    pub fn label(&self) -> String {
        match self.index {
            Some(index) => format!("{} of wheel {index}", self.entry.name),
            None => self.entry.name.to_owned(),
        }
    }

    /// The effect at some values of its axes.
    pub fn effect(&self, values: &[f64]) -> Effect {
        let pairs: Vec<(&str, f64)> = self
            .axes
            .iter()
            .map(|axis| axis.name)
            .zip(values.iter().copied())
            .collect();
        let mut effect = Effect::new(self.entry.name, &pairs);
        effect.index = self.index;
        effect
    }

    /// Values half as far from no effect; what does not carry a size, and limits, stay.
    pub fn halved(&self, values: &[f64]) -> Vec<f64> {
        let pairs = self.axes.iter().zip(values);
        pairs
            .map(|(axis, value)| {
                if axis.carries_size && axis.neutral.is_finite() {
                    axis.neutral + 0.5 * (value - axis.neutral)
                } else {
                    *value
                }
            })
            .collect()
    }

    /// The largest size of the values in practical sizes; infinite for a speed that is limited, since it shows when it is reached.
    pub fn size(&self, values: &[f64]) -> f64 {
        let axes = self.axes.iter().zip(values).filter(|(axis, _)| axis.carries_size);
        axes.map(|(axis, value)| {
            if axis.neutral.is_infinite() {
                match (axis.unit, value.is_finite()) {
                    (_, false) => 0.0,
                    // Every step of a set-point reaches it, and one far above what grip allows is a wheel that is a little late.
                    ("m/s2", true) => axis.practical / value,
                    (_, true) => f64::INFINITY,
                }
            } else {
                (value - axis.neutral).abs() / axis.practical
            }
        })
        .fold(0.0, f64::max)
    }

    /// The library's large size in practical sizes; infinite where it names none.
    pub fn large_size(&self, robot: &RobotDescription) -> f64 {
        let axes = self
            .axes
            .iter()
            .filter(|axis| axis.carries_size && axis.neutral.is_finite());
        let large = axes.filter_map(|axis| {
            let entry = self.entry.parameters.iter().find(|entry| entry.name == axis.name)?;
            let change = (entry.size.values(robot).1 - axis.neutral).abs();
            (change.is_finite() && change > 0.0).then(|| change / axis.practical)
        });
        let large = large.fold(0.0, f64::max);
        if large > 0.0 { large } else { f64::INFINITY }
    }

    /// Numbers that a fit of these values chose: finite sizes, and the wheel where there is one.
    pub fn choices(&self, values: &[f64]) -> usize {
        let axes = self.axes.iter().zip(values);
        let sizes = axes.filter(|(axis, value)| axis.carries_size && value.is_finite());
        sizes.count() + usize::from(self.index.is_some())
    }

    /// True when a value with this sign of change is outside what the effect can be.
    pub fn is_one_sided(&self, axis: usize) -> bool {
        let axis = &self.axes[axis];
        axis.neutral.is_finite() && (axis.low >= axis.neutral || axis.high <= axis.neutral)
    }
}

/// Candidates for a robot in the order of the library, then of the wheels.
pub fn candidates(robot: &RobotDescription, excitation: &Excitation) -> Vec<Candidate> {
    let mut all = Vec::new();
    for entry in LIBRARY {
        if !applies(entry, robot) || entry.name == LOST {
            continue;
        }
        let wheels: Vec<Option<usize>> = if entry.indexed {
            let suits = |k: &usize| {
                let wheel = &robot.wheels[*k];
                wheel.kind != "caster" && (wheel.driven || !needs_drive(entry))
            };
            (0..robot.wheels.len()).filter(suits).map(Some).collect()
        } else {
            vec![None]
        };
        for index in wheels {
            all.extend(candidate(entry, index, robot, excitation));
        }
    }
    all
}

/// Set-points that do not arrive, which nothing is screened or fitted for.
pub fn lost_set_points(robot: &RobotDescription) -> Option<Candidate> {
    candidate(find(LOST)?, None, robot, &Excitation::default())
}

/// True when the robot has what the effect acts on.
pub fn applies(entry: &EffectEntry, robot: &RobotDescription) -> bool {
    let has = |kind: &str| robot.wheels.iter().any(|wheel| wheel.kind == kind);
    match entry.needs {
        Needs::Nothing => true,
        Needs::Motor => robot.motor.is_some(),
        Needs::Steering => robot.steering.is_some(),
        Needs::OmniWheel => has("omni"),
        Needs::StandardWheel => has("standard"),
        Needs::Caster => has("caster"),
    }
}

fn needs_drive(entry: &EffectEntry) -> bool {
    entry.needs == Needs::Motor || entry.name == "encoder_scale"
}

fn axis(parameter: &ParameterEntry, entry: &EffectEntry, robot: &RobotDescription) -> Option<Axis> {
    let (practical, _) = parameter.size.values(robot);
    let mut change = if parameter.neutral.is_finite() {
        (practical - parameter.neutral).abs()
    } else {
        practical
    };
    if change == 0.0 && parameter.carries_size {
        // A second direction of the first parameter.
        let first = entry
            .parameters
            .iter()
            .find(|other| other.unit == parameter.unit && other.carries_size)?;
        change = (first.size.values(robot).0 - first.neutral).abs();
        if parameter.unit == "rad" && change == 0.0 {
            change = 0.009;
        }
        if change == 0.0 {
            return None;
        }
    }
    if !parameter.carries_size {
        change = match parameter.unit {
            "m" => 0.15,
            "rad" => 0.3,
            _ => 0.3 * parameter.neutral.abs().max(0.1),
        };
    }
    Some(Axis {
        name: parameter.name,
        unit: parameter.unit,
        neutral: parameter.neutral,
        low: parameter.low,
        high: parameter.high,
        practical: change,
        carries_size: parameter.carries_size,
    })
}

fn candidate(
    entry: &'static EffectEntry,
    index: Option<usize>,
    robot: &RobotDescription,
    excitation: &Excitation,
) -> Option<Candidate> {
    let axes: Vec<Axis> = entry
        .parameters
        .iter()
        .filter_map(|parameter| axis(parameter, entry, robot))
        .collect();
    let neutral: Vec<f64> = axes.iter().map(|axis| axis.neutral).collect();
    let one_of = |values: Vec<Vec<f64>>| {
        let columns = values.into_iter().map(|values| Column { values, axis: 0 });
        (Kind::OneOf, columns.collect::<Vec<_>>())
    };
    let large = |parameter: usize| entry.parameters[parameter].size.values(robot).1;
    let between = |part: f64| {
        let (practical, large) = entry.parameters[0].size.values(robot);
        practical + part * (large - practical)
    };
    let fractions = |of: f64| vec![vec![0.88 * of], vec![0.7 * of], vec![0.5 * of]];
    let (kind, columns) = match entry.name {
        "floor_friction" => one_of(vec![vec![0.85], vec![0.65], vec![0.45]]),
        "lateral_slip" => one_of(
            [0.85, 0.65, 0.45]
                .map(|share| vec![share * robot.floor_friction])
                .to_vec(),
        ),
        "low_friction_patch" => one_of(patches(excitation)),
        "wheel_speed_saturation" => one_of(fractions(excitation.wheel_rad_per_s)),
        "body_speed_saturation" => {
            let goes_sideways = robot.wheels.iter().any(|wheel| wheel.kind == "omni");
            one_of(body_limits(excitation, goes_sideways))
        }
        "acceleration_limit" => one_of(vec![vec![6.0], vec![3.0], vec![1.5], vec![0.8]]),
        "command_dead_band" => one_of(vec![vec![between(0.0)], vec![between(0.35)], vec![between(0.8)]]),
        "stribeck_friction" => one_of(vec![vec![1.8, 1.0], vec![1.8, 3.0]]),
        "command_delay" => one_of(vec![vec![0.02], vec![0.07], vec![0.16]]),
        "motor_lag" => one_of(vec![vec![0.03], vec![0.1]]),
        "carpet_grain" => one_of(
            [0.0, 0.785, 1.571, 2.356]
                .map(|direction| vec![between(0.5), direction])
                .to_vec(),
        ),
        "cable_drag" => one_of(cables(excitation, between(0.4))),
        "wheel_eccentricity" => {
            let at = |phase: f64| Column {
                values: vec![0.01, phase],
                axis: 0,
            };
            (Kind::Phase, vec![at(0.0), at(core::f64::consts::FRAC_PI_2)])
        }
        "thermal_drift" => one_of(vec![vec![0.25, 10.0], vec![0.25, 60.0]]),
        "caster_swivel" => one_of(vec![vec![0.02, large(1) * 0.6]]),
        // A tread many times softer is no multiple of one a little softer.
        "longitudinal_slip" => one_of(vec![vec![between(0.08)], vec![between(0.35)], vec![between(0.85)]]),
        "battery_sag" | "gear_backlash" | "steering_backlash" => one_of(vec![vec![between(0.1)], vec![between(0.5)]]),
        _ => {
            let step = |axis: usize| {
                let mut values = neutral.clone();
                values[axis] += 1.5 * step_sign(&axes[axis], entry, robot) * axes[axis].practical;
                Column { values, axis }
            };
            let columns = (0..axes.len()).filter(|axis| axes[*axis].carries_size).map(step);
            (Kind::Sum, columns.collect())
        }
    };
    (!columns.is_empty()).then(|| Candidate {
        stages: stages(entry),
        entry,
        index,
        axes,
        columns,
        kind,
    })
}

/// To the side on which the library's sizes are: what is no straight line there is seen where the effect would be.
fn step_sign(axis: &Axis, entry: &EffectEntry, robot: &RobotDescription) -> f64 {
    let own = entry.parameters.iter().find(|parameter| parameter.name == axis.name);
    let practical = own.map_or(axis.neutral, |parameter| parameter.size.values(robot).0);
    if axis.high <= axis.neutral || practical < axis.neutral {
        -1.0
    } else {
        1.0
    }
}

/// Which chains can see an effect.
fn stages(entry: &EffectEntry) -> Stages {
    // What wheels do behind the servo is felt by the motors: they hold each other over the floor.
    const BOTH_SIDES: [&str; 7] = [
        "encoder_scale",
        "gear_backlash",
        "steering_lag",
        "clock_offset",
        "steering_offset",
        "steering_scale",
        "steering_backlash",
    ];
    const SEEN_FROM_OUTSIDE: [&str; 9] = [
        "localization_latency",
        "gyro_bias",
        "gyro_scale",
        "pose_scale",
        "lens_distortion",
        "marker_offset",
        "camera_seam",
        "tag_height",
        "rolling_shutter",
    ];
    if BOTH_SIDES.contains(&entry.name) {
        return Stages::BOTH;
    }
    if SEEN_FROM_OUTSIDE.contains(&entry.name) {
        return Stages {
            drive: false,
            rolling: true,
        };
    }
    match entry.hook {
        Hook::Command | Hook::Actuator | Hook::Sensor => Stages {
            drive: true,
            rolling: false,
        },
        Hook::Contact | Hook::Body => Stages::BOTH,
    }
}

fn patches(excitation: &Excitation) -> Vec<Vec<f64>> {
    let [x0, x1, y0, y1] = excitation.extent_m;
    let mut all = Vec::new();
    let count = |from: f64, to: f64| (((to - from) / 0.7) as usize).clamp(1, 4);
    let (nx, ny) = (count(x0, x1), count(y0, y1));
    for i in 0..nx {
        for j in 0..ny {
            let x = x0 + (x1 - x0) * (i as f64 + 0.5) / nx as f64;
            let y = y0 + (y1 - y0) * (j as f64 + 0.5) / ny as f64;
            all.push(vec![x, y, 0.4, 0.4]);
        }
    }
    all
}

/// - `goes_sideways`: of other robots the body origin does so in turns as well, but nobody limits that.
fn body_limits(excitation: &Excitation, goes_sideways: bool) -> Vec<Vec<f64>> {
    let mut all = Vec::new();
    let mut twist = excitation.twist;
    if !goes_sideways {
        twist[1] = 0.0;
    }
    for axis in 0..3 {
        for share in [0.85, 0.6, 0.3] {
            let limit = share * twist[axis];
            if limit > 0.02 {
                let mut values = vec![f64::INFINITY; 3];
                values[axis] = limit;
                all.push(values);
            }
        }
    }
    // Speed and yaw rate at once, as controllers of drives limit them.
    for share in [0.7, 0.4] {
        let limits = twist.map(|twist| share * twist);
        let values = limits.map(|limit| if limit > 0.02 { limit } else { f64::INFINITY });
        if limits[0] > 0.02 && limits[2] > 0.02 {
            all.push(values.to_vec());
        }
    }
    all
}

fn cables(excitation: &Excitation, stiffness: f64) -> Vec<Vec<f64>> {
    let [x0, x1, y0, y1] = excitation.extent_m;
    let (cx, cy) = (0.5 * (x0 + x1), 0.5 * (y0 + y1));
    [(cx, cy), (x0, y0), (x0, y1), (x1, y0), (x1, y1)]
        .map(|(x, y)| vec![stiffness, x, y, 0.0])
        .to_vec()
}
