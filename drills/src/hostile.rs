//! Control laws that want collisions.

use control::law::{Demand, Law, Observation, RobotObservation};
use twin::twist::BodyTwist;

/// Numbers of one robot's wish, each 0 to 1.
pub const WISH_GENES: usize = 7;

/// Every robot drives at something, sometimes past it or away from it, while it turns.
#[derive(Debug, Clone, PartialEq)]
pub struct Hostile {
    genes: Vec<[f64; WISH_GENES]>,
    half_m: [f64; 2],
    /// Walls only, no robots.
    walls_only: bool,
    /// Further places to drive at.
    places_m: Aims,
}

impl Hostile {
    /// - `genes`: of each robot: what it drives at, how fast, period, phase, turning rate, whether it turns towards its aim
    ///   (below 0.5), and how far it passes by.
    pub fn new(genes: Vec<[f64; WISH_GENES]>, arena_m: [f64; 2]) -> Self {
        Self {
            genes,
            half_m: arena_m.map(|side| side / 2.0),
            walls_only: false,
            places_m: Aims::new(),
        }
    }

    /// The same, but it drives at walls and corners only.
    #[must_use]
    pub fn at_walls(mut self) -> Self {
        self.walls_only = true;
        self
    }

    /// The same, but these places are aims as well, besides each other and walls.
    #[must_use]
    pub fn also_at(mut self, places_m: Vec<[f64; 2]>) -> Self {
        self.places_m = places_m;
        self
    }

    fn wish(&self, i: usize, tick: u64, robots: &[RobotObservation], aims: &mut Aims) -> Option<Demand> {
        let genes = self.genes.get(i)?;
        let own = robots.get(i)?.pose;
        let [what, speed, period, phase, turn, towards, pass] = *genes;
        let cycles = tick as f64 / (12.0 + 240.0 * period) + phase;
        let [half_x, half_y] = self.half_m;
        aims.clear();
        if !self.walls_only {
            let others = robots.iter().enumerate().filter(|(j, _)| *j != i);
            aims.extend(others.map(|(_, other)| [other.pose.x_m, other.pose.y_m]));
            aims.extend(&self.places_m);
        }
        aims.extend([
            [half_x, own.y_m],
            [-half_x, own.y_m],
            [own.x_m, half_y],
            [own.x_m, -half_y],
            [half_x, half_y],
            [-half_x, -half_y],
        ]);
        let shift = if pass > 0.5 { cycles as usize } else { 0 };
        let at = ((what * aims.len() as f64) as usize + shift) % aims.len();
        let aim = *aims.get(at)?;
        let (dx, dy) = (aim[0] - own.x_m, aim[1] - own.y_m);
        let size = dx.hypot(dy).max(1e-6);
        let side = if cycles.fract() < 0.7 { 0.0 } else { 4.0 * (pass - 0.5) };
        let fast = 0.2 + 1.3 * speed;
        let (x, y) = (fast * (dx - side * dy) / size, fast * (dy + side * dx) / size);
        let (sin, cos) = own.yaw_rad.sin_cos();
        let (forward, left) = (cos * x + sin * y, cos * y - sin * x);
        let rate = if towards < 0.5 {
            4.0 * left.atan2(forward)
        } else {
            8.0 * (turn - 0.5)
        };
        Some(Demand {
            twist: BodyTwist {
                forward_m_per_s: forward,
                left_m_per_s: left,
                yaw_rate_rad_per_s: rate,
            },
            target: aim,
            ..Demand::default()
        })
    }
}

type Aims = Vec<[f64; 2]>;

impl Law for Hostile {
    fn name(&self) -> &'static str {
        "hostile"
    }

    fn step(&mut self, observation: &Observation<'_>, demands: &mut [Demand]) {
        let mut aims = Aims::new();
        for (i, demand) in demands.iter_mut().enumerate() {
            if let Some(wish) = self.wish(i, observation.tick, observation.robots, &mut aims) {
                *demand = wish;
            }
        }
    }
}
