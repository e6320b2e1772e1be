//! Where an input of the network comes from and what becomes of it.

use super::document::{Input, ResidualDocument};
use super::input::{Observation, Quantity, find};

/// One input, ready for evaluation.
#[derive(Debug, Clone, Copy)]
pub struct Source {
    quantity: Quantity,
    wheel: usize,
    ticks_ago: usize,
    mean: f64,
    scale: f64,
    low: f64,
    high: f64,
    fade: f64,
}

impl Source {
    /// An input of a document; `None` when there is no quantity of its name.
    pub fn new(document: &ResidualDocument, input: &Input) -> Option<Source> {
        Some(Source {
            quantity: find(&input.name)?.quantity,
            wheel: input.wheel.unwrap_or(0),
            ticks_ago: input.ticks_ago,
            mean: input.mean,
            scale: input.scale,
            low: input.low,
            high: input.high,
            fade: document.fade * (input.high - input.low),
        })
    }

    /// Control ticks that it looks back.
    pub fn ticks_ago(&self) -> usize {
        self.ticks_ago
    }

    /// Its value at one tick, in its unit.
    pub fn value(&self, seen: &Observation) -> f64 {
        seen.value(self.quantity, self.wheel)
    }

    /// A value as the first layer takes it.
    pub fn normalised(&self, value: f64) -> f64 {
        (value.max(self.low).min(self.high) - self.mean) / self.scale
    }

    /// 1 inside the range, 0 beyond the zone around it, with a continuous slope between.
    pub fn fade(&self, value: f64) -> f64 {
        let beyond = (self.low - value).max(value - self.high).max(0.0);
        let e = (beyond / self.fade).min(1.0);
        1.0 - e * e * (3.0 - 2.0 * e)
    }
}
