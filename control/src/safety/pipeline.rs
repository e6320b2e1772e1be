//! Commands on their way: what has been sent but does not show in the poses yet.

use crate::TICK_S;
use crate::vector::{Vector, add, scale};

/// Ticks that are remembered.
pub const DEPTH: usize = 64;

#[derive(Debug, Clone, Copy, PartialEq)]
struct Sent {
    velocity: Vector,
    yaw_rate_rad_per_s: f64,
}

/// The last [`DEPTH`] commands of one robot, in the world frame.
#[derive(Debug, Clone)]
pub struct Pipeline {
    sent: [Sent; DEPTH],
    newest: usize,
}

impl Pipeline {
    pub fn new() -> Pipeline {
        let nothing = Sent {
            velocity: [0.0, 0.0],
            yaw_rate_rad_per_s: 0.0,
        };
        Pipeline {
            sent: [nothing; DEPTH],
            newest: 0,
        }
    }

    pub fn push(&mut self, velocity: Vector, yaw_rate_rad_per_s: f64) {
        self.newest = (self.newest + 1) % DEPTH;
        self.sent[self.newest] = Sent {
            velocity,
            yaw_rate_rad_per_s,
        };
    }

    /// Displacement and turn that the commands of the last `window_s` ask for, as far back as is remembered.
    pub fn pending(&self, window_s: f64) -> (Vector, f64) {
        let mut moved = [0.0, 0.0];
        let mut turned = 0.0;
        let mut left = (window_s / TICK_S).clamp(0.0, DEPTH as f64);
        for back in 0..DEPTH {
            if left <= 0.0 {
                break;
            }
            let sent = &self.sent[(self.newest + DEPTH - back) % DEPTH];
            let time_s = left.min(1.0) * TICK_S;
            moved = add(moved, scale(sent.velocity, time_s));
            turned += sent.yaw_rate_rad_per_s * time_s;
            left -= 1.0;
        }
        (moved, turned)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sums_what_was_sent_in_the_window() {
        let mut pipeline = Pipeline::new();
        for k in 0..80 {
            pipeline.push([f64::from(k), 0.0], 1.0);
        }
        let (moved, turned) = pipeline.pending(2.5 * TICK_S);
        assert!((moved[0] - (79.0 + 78.0 + 0.5 * 77.0) * TICK_S).abs() < 1e-12);
        assert!((turned - 2.5 * TICK_S).abs() < 1e-12);
        let (_, all) = pipeline.pending(1e9);
        assert!((all - DEPTH as f64 * TICK_S).abs() < 1e-12);
        assert_eq!(pipeline.pending(0.0), ([0.0, 0.0], 0.0));
    }
}
