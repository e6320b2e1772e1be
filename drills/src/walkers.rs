//! Somebody pushes robots of no run over the floor, between the robots of the run, and stops in front of them.

use crate::rig::STRANGER_RADIUS_M;
use emulator::noise::Noise;

const TICK_HZ: f64 = 120.0;
/// Numbers of their tags.
pub const FIRST_NUMBER: u16 = 200;
/// Fastest walk, m/s, and its change: the laboratory counts on 1 m/s2.
pub const FASTEST_M_PER_S: f64 = 0.5;
pub const CHANGE_M_PER_S2: f64 = 0.8;
/// In front of a robot it brakes by this much, so that its speed towards the robot is never above `sqrt(2 b gap)`.
pub const BRAKE_M_PER_S2: f64 = 0.5;
/// Gap left in front of a robot that stands.
pub const LEFT_M: f64 = 0.1;
/// Gap to robots and to each other at the start.
const START_GAP_M: f64 = 0.2;
const REACH_M: [f64; 2] = [2.0 - STRANGER_RADIUS_M, 1.5 - STRANGER_RADIUS_M];
/// Each walks to and fro between so many places.
const PLACES: usize = 3;
/// Nearer than this it has arrived.
const THERE_M: f64 = 0.05;

#[derive(Debug, Clone, PartialEq)]
struct Walker {
    at_m: [f64; 2],
    velocity_m_per_s: [f64; 2],
    places_m: [[f64; 2]; PLACES],
    next: usize,
    speed_m_per_s: f64,
}

/// See the module.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Walkers {
    walkers: Vec<Walker>,
}

impl Walkers {
    /// At most `count`, as many as there is room for.
    pub fn new(random: &mut Noise, starts: &[[f64; 3]], count: usize) -> Self {
        let mut walkers: Vec<Walker> = Vec::with_capacity(count);
        for _ in 0..200 * count {
            if walkers.len() == count {
                break;
            }
            let mut place = || REACH_M.map(|reach_m| reach_m * (2.0 * random.uniform() - 1.0));
            let (at_m, places_m) = (place(), std::array::from_fn(|_| place()));
            let apart_m = 2.0 * STRANGER_RADIUS_M + START_GAP_M;
            let far = |[x, y]: [f64; 2]| (at_m[0] - x).hypot(at_m[1] - y) >= apart_m;
            let clear = starts.iter().all(|start| far([start[0], start[1]]));
            if clear && walkers.iter().all(|walker| far(walker.at_m)) {
                walkers.push(Walker {
                    at_m,
                    velocity_m_per_s: [0.0; 2],
                    places_m,
                    next: 0,
                    speed_m_per_s: FASTEST_M_PER_S * (0.2 + 0.8 * random.uniform()),
                });
            }
        }
        Self { walkers }
    }

    /// Where they walk between, for a law that wants to meet them.
    pub fn places_m(&self) -> Vec<[f64; 2]> {
        self.walkers.iter().flat_map(|walker| walker.places_m).collect()
    }

    /// A control tick later: tag numbers and poses.
    ///
    /// - `robots`: true poses of the robots of the run.
    pub fn step(&mut self, robots: &[[f64; 3]], radius_m: f64) -> Vec<(u16, [f64; 3])> {
        for walker in &mut self.walkers {
            walker.step(robots, radius_m);
        }
        let numbered = self.walkers.iter().zip(FIRST_NUMBER..);
        numbered
            .map(|(walker, number)| (number, [walker.at_m[0], walker.at_m[1], 0.0]))
            .collect()
    }
}

impl Walker {
    /// Speed towards a robot, the most that it may be, and the direction.
    fn approach(&self, wanted: [f64; 2], robot: &[f64; 3], radius_m: f64) -> (f64, f64, [f64; 2]) {
        let to = [robot[0] - self.at_m[0], robot[1] - self.at_m[1]];
        let distance_m = to[0].hypot(to[1]).max(1e-6);
        let to = to.map(|part| part / distance_m);
        let gap_m = distance_m - radius_m - STRANGER_RADIUS_M - LEFT_M;
        let most = (2.0 * BRAKE_M_PER_S2 * gap_m.max(0.0)).sqrt();
        (wanted[0] * to[0] + wanted[1] * to[1], most, to)
    }

    fn step(&mut self, robots: &[[f64; 3]], radius_m: f64) {
        let goal = self.places_m.get(self.next).copied().unwrap_or(self.at_m);
        let way = [goal[0] - self.at_m[0], goal[1] - self.at_m[1]];
        let left_m = way[0].hypot(way[1]);
        if left_m < THERE_M {
            self.next = (self.next + 1) % PLACES;
        }
        let speed = self.speed_m_per_s.min((2.0 * BRAKE_M_PER_S2 * left_m).sqrt());
        let mut wanted = way.map(|part| speed * part / left_m.max(1e-6));
        for robot in robots {
            let (towards, most, to) = self.approach(wanted, robot, radius_m);
            if towards > most {
                wanted = [0, 1].map(|axis: usize| wanted[axis] - (towards - most) * to[axis]);
            }
        }
        // Nor into a wall: what would slide along it into a robot is looked at below.
        for axis in 0..2 {
            let is_out = self.at_m[axis].abs() >= REACH_M[axis] && wanted[axis] * self.at_m[axis] > 0.0;
            wanted[axis] = if is_out { 0.0 } else { wanted[axis] };
        }
        // Away from one may be towards another: between two, and between a robot and a wall, it stays.
        let is_too_fast = |robot: &[f64; 3]| {
            let (towards, most, _) = self.approach(wanted, robot, radius_m);
            towards > most + 1e-9
        };
        if robots.iter().any(is_too_fast) {
            wanted = [0.0; 2];
        }
        let change = [0, 1].map(|axis: usize| wanted[axis] - self.velocity_m_per_s[axis]);
        let size = change[0].hypot(change[1]);
        let share = (CHANGE_M_PER_S2 / TICK_HZ / size.max(1e-9)).min(1.0);
        for axis in 0..2 {
            self.velocity_m_per_s[axis] += share * change[axis];
            let at_m = self.at_m[axis] + self.velocity_m_per_s[axis] / TICK_HZ;
            self.at_m[axis] = at_m.clamp(-REACH_M[axis], REACH_M[axis]);
            if at_m.abs() > REACH_M[axis] {
                self.velocity_m_per_s[axis] = 0.0;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What is asked of the robots hangs on this: a walker never runs into a robot that stands.
    #[test]
    fn a_walker_stops_in_front_of_robots_that_stand() {
        let mut random = Noise::new(5, 9);
        let mut way_m = 0.0;
        for _ in 0..200 {
            // The middle two leave a gap that a walker does not fit through, the last one such a gap to the walls.
            let robots = [[-0.8, 0.0, 0.0], [0.6, 0.5, 0.0], [0.9, -0.4, 0.0], [1.4, 1.0, 0.0]];
            let mut walkers = Walkers::new(&mut random, &robots, 2);
            let mut gap_m = f64::INFINITY;
            let mut before = walkers.step(&robots, 0.25);
            for _ in 0..1200 {
                let now = walkers.step(&robots, 0.25);
                for (_, [x, y, _]) in &now {
                    for [rx, ry, _] in robots {
                        gap_m = gap_m.min((x - rx).hypot(y - ry) - 0.5);
                    }
                }
                let step = |a: &[f64; 3], b: &[f64; 3]| (a[0] - b[0]).hypot(a[1] - b[1]);
                way_m += before.iter().zip(&now).map(|(a, b)| step(&a.1, &b.1)).sum::<f64>();
                before = now;
            }
            assert!(gap_m > 0.5 * LEFT_M, "{gap_m}");
        }
        // And they do walk: the slowest would walk 1 m in a run.
        assert!(way_m > 100.0, "{way_m}");
    }
}
