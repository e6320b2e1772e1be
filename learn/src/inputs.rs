//! What a network sees: which quantities, their normalisation and validity.

use serde::{Deserialize, Serialize};
use twin::replay::Tick;
use twin::residual::{INPUTS, Input, Of, Quantity};
use twin::robot::{Robot, RobotDescription};

/// Sets of inputs that are tried.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Sight {
    /// Twist, wheels, commands and their short history.
    Motion,
    /// The same and the place on the floor with the heading.
    Place,
    /// What the robot was told over the last 0.4 s, as twists, and nothing of what it does: for robots without motors, whose
    /// network gives set-points. What comes out does not come in again, so it cannot run away.
    Told,
    /// [`Sight::Motion`] and [`Sight::Told`]: for the rival of the latter.
    Everything,
}

/// One input by its meaning.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Eye {
    pub name: &'static str,
    pub unit: &'static str,
    pub quantity: Quantity,
    pub wheel: Option<usize>,
    pub ticks_ago: usize,
}

/// Look back of the history, control ticks: 0.05 s.
const HISTORY_TICKS: usize = 6;
/// Names, and whether the history is seen as well.
const MOTION: [(&str, bool); 8] = [
    ("forward_m_per_s", true),
    ("left_m_per_s", true),
    ("yaw_rate_rad_per_s", true),
    ("yaw_rate_times_forward_m_per_s2", false),
    ("wheel_rad_per_s", false),
    ("steering_rad", false),
    ("command_wheel_rad_per_s", true),
    ("command_steering_rad", false),
];
const TOLD: [&str; 3] = [
    "command_forward_m_per_s",
    "command_left_m_per_s",
    "command_yaw_rate_rad_per_s",
];
/// Look backs of what it was told, control ticks.
const TOLD_TICKS: [usize; 6] = [0, 6, 12, 20, 32, 48];
const PLACE: [&str; 4] = ["x_m", "y_m", "heading_cos", "heading_sin"];
/// Smallest standard deviation over the training data at which an input is kept, by unit.
const LEAST_VARIATION: [(&str, f64); 5] = [
    ("m/s", 0.003),
    ("rad/s", 0.01),
    ("m/s^2", 0.005),
    ("rad", 0.002),
    ("m", 0.05),
];
const LEAST_OTHER: f64 = 0.02;
/// Room beyond what the training data held, as a share of its range.
const ROOM: f64 = 0.05;
/// Width of the fade, as a share of the range.
pub const FADE: f64 = 0.25;

/// Quantities of a robot, in the order in which a network takes them.
pub fn eyes(robot: &RobotDescription, sight: Sight) -> Vec<Eye> {
    let mut eyes = Vec::new();
    let mut add = |name: &str, ticks_ago: usize| {
        let Some(entry) = INPUTS.iter().find(|entry| entry.name == name) else {
            return;
        };
        let wheels: Vec<Option<usize>> = match entry.of {
            Of::Robot => vec![None],
            Of::SteeredRobot => robot.steering.iter().map(|_| None).collect(),
            of => (0..robot.wheels.len())
                .filter(|k| match of {
                    Of::RollingWheel => robot.wheels[*k].kind != "caster",
                    Of::DrivenWheel => robot.wheels[*k].driven,
                    _ => true,
                })
                .map(Some)
                .collect(),
        };
        eyes.extend(wheels.into_iter().map(|wheel| Eye {
            name: entry.name,
            unit: entry.unit,
            quantity: entry.quantity,
            wheel,
            ticks_ago,
        }));
    };
    if sight != Sight::Told {
        for (name, _) in MOTION {
            add(name, 0);
        }
        for (name, _) in MOTION.iter().filter(|(_, history)| *history) {
            add(name, HISTORY_TICKS);
        }
    }
    if matches!(sight, Sight::Told | Sight::Everything) {
        for name in TOLD {
            TOLD_TICKS.into_iter().for_each(|ticks_ago| add(name, ticks_ago));
        }
    }
    if sight == Sight::Told {
        add("command_steering_rad", 0);
    }
    if sight == Sight::Place {
        for name in PLACE {
            add(name, 0);
        }
    }
    eyes
}

/// Values of the eyes tick by tick, those of earlier ticks included.
#[derive(Debug, Clone)]
pub struct Watch<'a> {
    robot: &'a Robot,
    eyes: &'a [Eye],
    /// Control ticks from one [`Watch::take`] to the next.
    period: usize,
    /// All ticks so far, without look back.
    seen: Vec<f64>,
}

impl<'a> Watch<'a> {
    /// Before the first tick.
    pub fn new(robot: &'a Robot, eyes: &'a [Eye]) -> Watch<'a> {
        Watch::with_period(robot, eyes, 1)
    }

    /// The same when it is shown every `period`-th control tick only; look backs are cut to whole periods.
    pub fn with_period(robot: &'a Robot, eyes: &'a [Eye], period: usize) -> Watch<'a> {
        Watch {
            robot,
            eyes,
            period: period.max(1),
            seen: Vec::new(),
        }
    }

    /// Takes in a tick.
    pub fn take(&mut self, tick: &Tick) {
        let observation = self.robot.observation(&tick.state, &tick.command);
        let values = self
            .eyes
            .iter()
            .map(|eye| observation.value(eye.quantity, eye.wheel.unwrap_or(0)));
        self.seen.extend(values);
    }

    /// Appends the inputs as they stand at the last tick; before the first one its values held.
    pub fn inputs(&self, out: &mut Vec<f64>) {
        let width = self.eyes.len();
        let last = (self.seen.len() / width).saturating_sub(1);
        for (position, eye) in self.eyes.iter().enumerate() {
            out.push(self.seen[last.saturating_sub(eye.ticks_ago / self.period) * width + position]);
        }
    }
}

/// Means, deviations and ranges over training data, for the inputs that vary.
#[derive(Debug, Clone, PartialEq)]
pub struct Frame {
    pub eyes: Vec<Eye>,
    pub mean: Vec<f64>,
    pub scale: Vec<f64>,
    pub low: Vec<f64>,
    pub high: Vec<f64>,
}

impl Frame {
    /// From rows of inputs, one after the other.
    ///
    /// - Also returns which of `eyes` are kept, by position.
    pub fn of<'a>(eyes: &[Eye], rows: impl Iterator<Item = &'a [f64]> + Clone) -> (Frame, Vec<usize>) {
        let count = rows.clone().count().max(1) as f64;
        let mut frame = Frame {
            eyes: Vec::new(),
            mean: Vec::new(),
            scale: Vec::new(),
            low: Vec::new(),
            high: Vec::new(),
        };
        let mut kept = Vec::new();
        for (position, eye) in eyes.iter().enumerate() {
            let column = || rows.clone().map(|row| row[position]);
            let mean = column().sum::<f64>() / count;
            let scale = (column().map(|v| (v - mean) * (v - mean)).sum::<f64>() / count).sqrt();
            let least = LEAST_VARIATION.iter().find(|(unit, _)| *unit == eye.unit);
            if scale.is_nan() || scale <= least.map_or(LEAST_OTHER, |(_, least)| *least) {
                continue;
            }
            let low = column().fold(f64::INFINITY, f64::min);
            let high = column().fold(f64::NEG_INFINITY, f64::max);
            let room = ROOM * (high - low);
            kept.push(position);
            frame.eyes.push(*eye);
            frame.mean.push(mean);
            frame.scale.push(scale);
            frame.low.push(low - room);
            frame.high.push(high + room);
        }
        (frame, kept)
    }

    /// Widens the ranges to what further rows hold.
    pub fn widen<'a>(&mut self, rows: impl Iterator<Item = &'a [f64]>) {
        for row in rows {
            for (k, value) in row.iter().enumerate() {
                self.low[k] = self.low[k].min(*value);
                self.high[k] = self.high[k].max(*value);
            }
        }
    }

    /// (value - mean) / scale, clamped to the range.
    pub fn normalised(&self, inputs: &[f64], out: &mut Vec<f64>) {
        out.clear();
        for (k, value) in inputs.iter().enumerate() {
            let clamped = value.max(self.low[k]).min(self.high[k]);
            out.push((clamped - self.mean[k]) / self.scale[k]);
        }
    }

    /// As the inputs of a residual document.
    pub fn inputs(&self) -> Vec<Input> {
        let rows = self.eyes.iter().enumerate();
        rows.map(|(k, eye)| {
            let mut input = Input::new(eye.name, self.low[k], self.high[k])
                .normalised(self.mean[k], self.scale[k])
                .ago(eye.ticks_ago);
            input.wheel = eye.wheel;
            input
        })
        .collect()
    }
}
