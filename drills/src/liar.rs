//! A control law whose every second word is garbage: S13.

use crate::hostile::Hostile;
use control::law::{Demand, Law, Observation};
use emulator::noise::Noise;
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
