//! Who can touch anything in the next tick.

use super::furniture::Furniture;
use crate::state::BodyState;
use crate::world::Arena;
use crate::world::obstacle::ObstacleBody;

/// What the sweep looks at.
pub(crate) struct Swept<'a> {
    pub(crate) arena: &'a Arena,
    pub(crate) states: &'a [BodyState],
    pub(crate) radii_m: &'a [f64],
    pub(crate) furniture: &'a Furniture,
    pub(crate) obstacles: &'a [ObstacleBody],
    /// Distance that any body may cover in the tick.
    pub(crate) reach_m: f64,
}

/// Finds who can touch anything in the next tick; buffers are kept between ticks.
#[derive(Debug, Clone, Default)]
pub(crate) struct Sweep {
    /// Robots by x, then by index: a function of the state alone.
    order: Vec<u32>,
    /// By robot.
    pub(crate) near: Vec<bool>,
    /// Robots with `near`, in robot order.
    pub(crate) involved: Vec<u32>,
    /// Pushable obstacles by x, then by index.
    obstacle_order: Vec<u32>,
    /// Pairs of pushable obstacles that can touch.
    pairs: Vec<(u32, u32)>,
    /// By pushable obstacle: it stands in one of those pairs.
    paired: Vec<bool>,
    /// By pushable obstacle: a robot or a moving obstacle can reach it, directly or through others.
    pub(crate) pushed: Vec<bool>,
    /// Pushable obstacles with `pushed`, in order.
    pub(crate) pushed_list: Vec<u32>,
    /// Fixed obstacles that any of those can touch, in order.
    pub(crate) fixed: Vec<u32>,
}

impl Sweep {
    pub(crate) fn new(robots: usize, obstacles: usize) -> Sweep {
        Sweep {
            order: (0..robots as u32).collect(),
            near: vec![false; robots],
            involved: Vec::with_capacity(robots),
            obstacle_order: (0..obstacles as u32).collect(),
            paired: vec![false; obstacles],
            pushed: vec![false; obstacles],
            ..Sweep::default()
        }
    }

    pub(crate) fn find(&mut self, at: &Swept<'_>) {
        self.find_walls(at);
        sort_by_x(&mut self.order, |robot| at.states[robot as usize].x_m);
        self.find_robots(at);
        self.fixed.clear();
        if !at.furniture.is_empty() {
            self.find_fixed(at);
            self.find_pushed(at);
            self.fixed.sort_unstable();
            self.fixed.dedup();
        }
        self.involved.clear();
        self.involved
            .extend((0..at.states.len() as u32).filter(|robot| self.near[*robot as usize]));
        self.pushed_list.clear();
        self.pushed_list
            .extend((0..at.obstacles.len() as u32).filter(|obstacle| self.pushed[*obstacle as usize]));
    }

    fn find_walls(&mut self, at: &Swept<'_>) {
        for (i, state) in at.states.iter().enumerate() {
            self.near[i] = wall_m(at.arena, state.x_m, state.y_m, at.radii_m[i]) < at.reach_m;
        }
    }

    fn find_robots(&mut self, at: &Swept<'_>) {
        let largest_m = largest(at.radii_m);
        for (sorted, a) in self.order.iter().enumerate() {
            let (a, state) = (*a as usize, &at.states[*a as usize]);
            for b in &self.order[sorted + 1..] {
                let (b, other) = (*b as usize, &at.states[*b as usize]);
                let (dx, dy) = (other.x_m - state.x_m, other.y_m - state.y_m);
                if dx > at.radii_m[a] + largest_m + 2.0 * at.reach_m {
                    break;
                }
                let limit = at.radii_m[a] + at.radii_m[b] + 2.0 * at.reach_m;
                if dx * dx + dy * dy < limit * limit {
                    self.near[a] = true;
                    self.near[b] = true;
                }
            }
        }
    }

    fn find_fixed(&mut self, at: &Swept<'_>) {
        for (robot, state) in at.states.iter().enumerate() {
            let before = self.fixed.len();
            let reach_m = at.radii_m[robot] + at.reach_m;
            at.furniture
                .fixed_within(state.x_m, state.y_m, reach_m, &mut self.fixed);
            self.near[robot] |= self.fixed.len() > before;
        }
    }

    /// Pushable obstacles that somebody can set in motion or stop.
    fn find_pushed(&mut self, at: &Swept<'_>) {
        self.pairs.clear();
        self.paired.fill(false);
        sort_by_x(&mut self.obstacle_order, |obstacle| at.obstacles[obstacle as usize].x_m);
        self.find_obstacle_pairs(at);
        let largest_m = largest(at.radii_m);
        for (index, body) in at.obstacles.iter().enumerate() {
            let radius_m = at.furniture.pushable[index].radius_m;
            let widest_m = radius_m + largest_m + 2.0 * at.reach_m;
            let x_of = |robot: &u32| at.states[*robot as usize].x_m;
            let first = self.order.partition_point(|robot| x_of(robot) < body.x_m - widest_m);
            let mut reached = false;
            for robot in self.order[first..]
                .iter()
                .take_while(|robot| x_of(robot) <= body.x_m + widest_m)
            {
                let robot = *robot as usize;
                let limit = radius_m + at.radii_m[robot] + 2.0 * at.reach_m;
                let (dx, dy) = (at.states[robot].x_m - body.x_m, at.states[robot].y_m - body.y_m);
                if dx * dx + dy * dy < limit * limit {
                    self.near[robot] = true;
                    reached = true;
                }
            }
            self.pushed[index] = reached || self.meets_something(at, index);
        }
        self.spread();
        for (index, body) in at.obstacles.iter().enumerate() {
            if self.pushed[index] {
                let reach_m = at.furniture.pushable[index].radius_m + at.reach_m;
                at.furniture.fixed_within(body.x_m, body.y_m, reach_m, &mut self.fixed);
            }
        }
    }

    /// A moving obstacle that can reach a wall, a fixed or a pushable one; robots are looked at elsewhere.
    fn meets_something(&self, at: &Swept<'_>, index: usize) -> bool {
        let (body, constants) = (&at.obstacles[index], &at.furniture.pushable[index]);
        if !constants.is_restless(body) {
            return false;
        }
        wall_m(at.arena, body.x_m, body.y_m, constants.radius_m) < at.reach_m
            || at
                .furniture
                .has_fixed_within(body.x_m, body.y_m, constants.radius_m + at.reach_m)
            || self.paired[index]
    }

    fn find_obstacle_pairs(&mut self, at: &Swept<'_>) {
        let radius_m = |obstacle: u32| at.furniture.pushable[obstacle as usize].radius_m;
        let largest_m = at.furniture.largest_pushable_m;
        for (sorted, a) in self.obstacle_order.iter().enumerate() {
            let one = &at.obstacles[*a as usize];
            for b in &self.obstacle_order[sorted + 1..] {
                let other = &at.obstacles[*b as usize];
                let (dx, dy) = (other.x_m - one.x_m, other.y_m - one.y_m);
                if dx > radius_m(*a) + largest_m + 2.0 * at.reach_m {
                    break;
                }
                let limit = radius_m(*a) + radius_m(*b) + 2.0 * at.reach_m;
                if dx * dx + dy * dy < limit * limit {
                    self.pairs.push((*a, *b));
                    self.paired[*a as usize] = true;
                    self.paired[*b as usize] = true;
                }
            }
        }
    }

    /// What is pushed can push its neighbours.
    fn spread(&mut self) {
        loop {
            let mut spread = false;
            for (a, b) in &self.pairs {
                let (a, b) = (*a as usize, *b as usize);
                if self.pushed[a] != self.pushed[b] {
                    self.pushed[a] = true;
                    self.pushed[b] = true;
                    spread = true;
                }
            }
            if !spread {
                return;
            }
        }
    }
}

fn largest(radii_m: &[f64]) -> f64 {
    radii_m.iter().fold(0.0_f64, |largest, radius| largest.max(*radius))
}

/// Distance of a circle to the nearest wall.
fn wall_m(arena: &Arena, x_m: f64, y_m: f64, radius_m: f64) -> f64 {
    let (half_width, half_height) = (0.5 * arena.width_m, 0.5 * arena.height_m);
    (half_width - x_m.abs()).min(half_height - y_m.abs()) - radius_m
}

/// Insertion sort by x, then by index: little moves between ticks.
fn sort_by_x(order: &mut [u32], x_m: impl Fn(u32) -> f64) {
    let before = |a: u32, b: u32| {
        let (xa, xb) = (x_m(a), x_m(b));
        xa < xb || (xa == xb && a < b)
    };
    for sorted in 1..order.len() {
        let mut at = sorted;
        while at > 0 && before(order[at], order[at - 1]) {
            order.swap(at, at - 1);
            at -= 1;
        }
    }
}
