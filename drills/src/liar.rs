//! A control law whose every second word is garbage, and models that say what is not so: S13.

use crate::hostile::Hostile;
use anyhow::{Result, anyhow};
use control::law::{Demand, Law, Observation};
use emulator::noise::Noise;
use twin::effect::Effect;
use twin::residual::{Activation, Input, Layer, OUTPUTS, Output, ResidualDocument};
use twin::robot::Robot;
use twin::twist::BodyTwist;

/// What a broken program writes.
const GARBAGE: [f64; 12] = [
    f64::NAN,
    f64::INFINITY,
    f64::NEG_INFINITY,
    1e30,
    -1e30,
    f64::MAX,
    f64::MIN,
    f64::MIN_POSITIVE,
    5e-324,
    -0.0,
    1e6,
    -3.0,
];

/// See the module.
#[derive(Debug)]
pub struct Liar {
    hostile: Hostile,
    random: Noise,
}

impl Liar {
    /// - `hostile`: says the other half.
    pub fn new(hostile: Hostile, seed: u64) -> Self {
        Self {
            hostile,
            random: Noise::new(seed, 0x11A2),
        }
    }

    fn garble(&mut self, value: f64) -> f64 {
        match (12.0 * self.random.uniform()) as usize {
            // Any bits at all.
            0 => f64::from_bits((self.random.uniform() * u64::MAX as f64) as u64),
            1..=6 => {
                let place = (GARBAGE.len() as f64 * self.random.uniform()) as usize;
                GARBAGE.get(place).copied().unwrap_or(f64::NAN)
            }
            _ => value,
        }
    }
}

/// A model of a robot that says what is not so: it drives the other way, is pushed about, hardly grips, or rolls on other wheels.
pub fn lying_model(robot: &Robot, seed: u64) -> Result<Robot> {
    let mut description = robot.description().clone();
    let mut effects = Vec::new();
    let mut residual = None;
    match seed % 5 {
        0 => {
            for wheel in &mut description.wheels {
                wheel.rolling_direction_rad += std::f64::consts::PI;
            }
        }
        1 => residual = Some(pushing()),
        2 => effects.push(Effect::new("floor_friction", &[("scale", 0.1)])),
        3 => {
            for wheel in &mut description.wheels {
                wheel.radius_m = wheel.radius_m.map(|radius_m| 2.5 * radius_m);
            }
        }
        _ => effects.push(Effect::new("command_delay", &[("delay", 0.2)])),
    }
    Robot::with_model(description, &effects, residual.as_ref())
        .map_err(|problem| anyhow!("{}: {}", problem.field, problem.message))
}

/// As much acceleration as a residual may have, whatever the robot does.
fn pushing() -> ResidualDocument {
    let outputs = OUTPUTS.map(|(name, _, limit)| Output {
        name: name.to_owned(),
        scale: 2.0 * limit,
        limit,
    });
    let layer = Layer {
        weights: vec![0.0; OUTPUTS.len()],
        bias: vec![1.0; OUTPUTS.len()],
        activation: Activation::Linear,
    };
    let input = Input::new("forward_m_per_s", -10.0, 10.0);
    ResidualDocument::new(vec![input], 0.25, vec![layer], outputs.to_vec())
}

impl Law for Liar {
    fn name(&self) -> &'static str {
        "liar"
    }

    fn step(&mut self, observation: &Observation<'_>, demands: &mut [Demand]) {
        self.hostile.step(observation, demands);
        // Now and then it says nothing at all.
        if self.random.uniform() < 0.02 {
            demands.fill(Demand::default());
        }
        for demand in demands {
            if self.random.uniform() < 0.5 {
                continue;
            }
            let BodyTwist {
                forward_m_per_s,
                left_m_per_s,
                yaw_rate_rad_per_s,
            } = demand.twist;
            demand.twist = BodyTwist {
                forward_m_per_s: self.garble(forward_m_per_s),
                left_m_per_s: self.garble(left_m_per_s),
                yaw_rate_rad_per_s: self.garble(yaw_rate_rad_per_s),
            };
            demand.target = demand.target.map(|part| self.garble(part));
        }
    }
}
