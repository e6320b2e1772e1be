//! The inequalities of one tick: `gradient . x >= bound`, each of length 1.

use super::chassis::Numbers;
use super::intervention::{Cause, WallSide};

/// No second robot.
pub const NOBODY: u32 = u32::MAX;
/// A gradient shorter than this cannot be acted on.
const SHORTEST: f64 = 1e-9;

/// Where a row comes from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Source {
    Robot,
    Wall(WallSide),
    Fence(u32),
    Obstacle { pushable: bool, index: u32 },
    Moving(u32),
    Speed,
    YawRate,
    Wheel(u32),
}

impl Source {
    /// What stands in the record of the robot, `other` being the second one of the row.
    pub fn cause(self, other: u32) -> Cause {
        match self {
            Source::Robot => Cause::Robot { other },
            Source::Wall(side) => Cause::Wall { side },
            Source::Fence(side) => Cause::Geofence { side },
            Source::Obstacle { pushable: false, index } => Cause::FixedObstacle { index },
            Source::Obstacle { pushable: true, index } => Cause::PushableObstacle { index },
            Source::Moving(id) => Cause::MovingObstacle { id },
            Source::Speed | Source::YawRate => Cause::Speed,
            Source::Wheel(_) => Cause::WheelSpeed,
        }
    }
}

/// One inequality on the numbers of one or two robots.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Row {
    /// Rises along the list of a tick and names the same thing on every tick: what was active last time is found by it.
    pub key: u64,
    pub robots: [u32; 2],
    pub gradient: [Numbers; 2],
    pub bound: f64,
    pub source: Source,
    /// From the other thing to the first robot; zero for own limits.
    pub normal: [f64; 2],
    /// What is free beyond the margin as it is seen now, m; negative inside it, infinite for own limits.
    pub free_m: f64,
    /// Length of the gradient before it was divided by it.
    pub scale: f64,
    pub multiplier: f64,
    pub active: bool,
}

impl Row {
    /// A limit of one robot's own; its key is set when it is listed.
    pub fn own(robot: u32, source: Source, gradient: Numbers, bound: f64) -> Row {
        Row {
            key: 0,
            robots: [robot, NOBODY],
            gradient: [gradient, [0.0; 3]],
            bound,
            source,
            normal: [0.0; 2],
            free_m: f64::INFINITY,
            scale: 1.0,
            multiplier: 0.0,
            active: false,
        }
    }

    /// Divided by the length of its gradient; `None` when nobody can act on it and it demands nothing.
    pub fn normalised(mut self) -> Option<Row> {
        let square = self.gradient.iter().flatten().fold(0.0, |sum, g| sum + g * g);
        let size = square.sqrt();
        if size < SHORTEST {
            // Kept when it demands something that nobody can do: the robot has to stop.
            self.gradient = [[0.0; 3]; 2];
            return (self.bound > 0.0).then_some(self);
        }
        for g in self.gradient.iter_mut().flatten() {
            *g /= size;
        }
        self.bound /= size;
        self.scale = size;
        Some(self)
    }

    /// `gradient . x`.
    #[inline]
    pub fn value(&self, x: &[Numbers]) -> f64 {
        let own = inner(&self.gradient[0], &x[self.robots[0] as usize]);
        if self.robots[1] == NOBODY {
            own
        } else {
            own + inner(&self.gradient[1], &x[self.robots[1] as usize])
        }
    }

    /// Inner product of two gradients.
    #[inline]
    pub fn inner(&self, other: &Row) -> f64 {
        let mut sum = 0.0;
        for (a, g) in self.robots.iter().zip(&self.gradient) {
            for (b, h) in other.robots.iter().zip(&other.gradient) {
                if a == b && *a != NOBODY {
                    sum += inner(g, h);
                }
            }
        }
        sum
    }
}

#[inline]
pub fn inner(a: &Numbers, b: &Numbers) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}
