//! Robots that want to move and hold each other.
//!
//! A robot is held while a row against another robot acts on it and it makes next to no progress where it wants to go; a wall
//! holds it only if another robot stands in the way as well, for example when it wants past that one on the side of the wall.
//! After [`Limits::deadlock_after_s`](super::Limits::deadlock_after_s) the robots that hold each other are sent round
//! the middle of their group like a disc that widens, `v_i = omega x (x_i - c) + epsilon (x_i - c)`: such a motion
//! shrinks no distance in the group, and the wish goes through the same rows as every other, so that no distance can fall below what it could
//! anyway. Every second pair of attempts goes the other way round, and the first goes away from a wall; after [`MAX_ATTEMPTS`] it is given up and reported.

use super::Limits;
use super::margin::Place;
use crate::TICK_S;
use crate::vector::{Vector, direction, dot, length, right_of, scale, sub};

/// A slower wish is not a wish.
const WANTED_M_PER_S: f64 = 0.05;
/// Less than this share of the wanted speed is no progress.
const PROGRESS: f64 = 0.1;
/// Ticks of patience that a tick of progress gives back.
const RELIEF: u32 = 4;
/// Speed of the outermost robot of a group, and how fast it is reached.
const SPEED_M_PER_S: f64 = 0.3;
const ACCELERATION_M_PER_S2: f64 = 1.0;
/// Outward speed for each unit of speed round the middle: room to turn for robots that cannot move sideways.
const WIDENING: f64 = 0.4;
/// Length of the first attempt; every further one is longer by half of it, up to four times.
const ATTEMPT_S: f64 = 2.0;
/// An attempt is over early when nothing stands in the way this close and this far off the wanted direction.
const FREE_M: f64 = 0.35;
const FREE_COSINE: f64 = 0.4;
const LEAST_S: f64 = 0.6;
/// Attempts after which it is given up.
pub const MAX_ATTEMPTS: u32 = 10;
/// Progress for this long forgets earlier attempts.
const FORGET_S: f64 = 3.0;

/// What acts on a robot.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Hold {
    #[default]
    Nothing,
    /// A wall, a fence or an obstacle, and no robot.
    Wall,
    Robot,
}

/// A robot that has been held for longer than the limit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Deadlock {
    /// Position in the experiment.
    pub robot: usize,
    /// Attempts to resolve it so far.
    pub attempts: u32,
    /// No further attempt will be made.
    pub given_up: bool,
}

#[derive(Debug, Clone, Copy, Default, PartialEq)]
struct Watch {
    held_ticks: u32,
    moving_ticks: u32,
    attempts: u32,
    /// Ticks left of the present attempt, and since its start.
    left: u32,
    since: u32,
    centre: Vector,
    /// Distance of the outermost robot of the group from the centre.
    outermost_m: f64,
    sense: f64,
    /// Where a wall pushed it last.
    push: Option<Vector>,
}

/// Watches all robots of a run.
#[derive(Debug, Clone)]
pub struct Watcher {
    watches: Vec<Watch>,
    groups: super::groups::Groups,
    patience_ticks: u32,
}

fn ticks(time_s: f64) -> u32 {
    (time_s / TICK_S) as u32
}

impl Watcher {
    pub fn new(robots: usize, limits: &Limits) -> Watcher {
        Watcher {
            watches: vec![Watch::default(); robots],
            groups: super::groups::Groups::new(robots),
            patience_ticks: ticks(limits.deadlock_after_s.clamp(0.1, 1e6)),
        }
    }

    pub fn reset(&mut self) {
        self.watches.fill(Watch::default());
    }

    /// Robots that are or were just held for too long.
    pub fn deadlocks(&self) -> impl Iterator<Item = Deadlock> + '_ {
        self.watches
            .iter()
            .enumerate()
            .filter(|(_, watch)| watch.attempts > 0)
            .map(|(robot, watch)| Deadlock {
                robot,
                attempts: watch.attempts,
                given_up: watch.attempts > MAX_ATTEMPTS,
            })
    }

    /// Velocity in the world that a robot should have instead of its own wish; `None` outside an attempt.
    pub fn detour(&self, robot: usize, place: &Place) -> Option<Vector> {
        let watch = &self.watches[robot];
        let at = place.position.filter(|_| watch.left > 0)?;
        let speed = SPEED_M_PER_S.min(ACCELERATION_M_PER_S2 * f64::from(watch.since) * TICK_S);
        let arm = sub(at, watch.centre);
        let way = crate::vector::add(scale(right_of(arm), -watch.sense), scale(arm, WIDENING));
        Some(scale(way, speed / watch.outermost_m.max(length(arm)).max(1e-3)))
    }

    /// Looks at what came of a tick.
    pub fn look(
        &mut self,
        places: &[Place],
        intents: &[Vector],
        velocities: &[Vector],
        holds: &[Hold],
        pairs: impl Iterator<Item = [u32; 2]>,
    ) {
        for i in 0..self.watches.len() {
            self.judge(i, places, intents[i], velocities[i], holds[i]);
        }
        if self.watches.iter().all(|watch| watch.held_ticks < self.patience_ticks) {
            return;
        }
        self.groups.reset();
        for [a, b] in pairs {
            self.groups.join(a as usize, b as usize);
        }
        for first in 0..self.watches.len() {
            let root = self.groups.of(first);
            let stuck = |i: usize| self.watches[i].held_ticks >= self.patience_ticks && self.watches[i].left == 0;
            let any = (first..self.watches.len()).any(|i| self.groups.of(i) == root && stuck(i));
            if root == first && any {
                self.begin(root, places);
            }
        }
    }

    fn judge(&mut self, i: usize, places: &[Place], intent: Vector, velocity: Vector, hold: Hold) {
        let held = match hold {
            Hold::Nothing => false,
            Hold::Wall => !is_free(i, places, intent),
            Hold::Robot => true,
        };
        let speed = length(intent);
        let progress = dot(intent, velocity) / speed.max(1e-9);
        let watch = &mut self.watches[i];
        if watch.left > 0 {
            watch.left -= 1;
            watch.since += 1;
            if watch.since > ticks(LEAST_S) && is_free(i, places, intent) {
                watch.left = 0;
            }
            if watch.left == 0 {
                watch.held_ticks = 0;
            }
            return;
        }
        if speed > WANTED_M_PER_S && progress < PROGRESS * speed && held {
            watch.held_ticks = (watch.held_ticks + 1).min(2 * self.patience_ticks);
            watch.moving_ticks = 0;
            watch.push = (hold == Hold::Wall).then(|| sub(velocity, intent));
        } else {
            watch.held_ticks = watch.held_ticks.saturating_sub(RELIEF);
            watch.moving_ticks += 1;
            if watch.moving_ticks > ticks(FORGET_S) {
                watch.attempts = 0;
            }
        }
    }

    /// Sends the held robots of a group round its middle.
    fn begin(&mut self, root: usize, places: &[Place]) {
        let n = self.watches.len();
        let members = |groups: &super::groups::Groups, i: usize| groups.of(i) == root && places[i].position.is_some();
        let (mut sum, mut count, mut attempts) = ([0.0, 0.0], 0.0, 0);
        for i in (0..n).filter(|i| members(&self.groups, *i)) {
            let at = places[i].position.unwrap_or_default();
            sum = crate::vector::add(sum, at);
            count += 1.0;
            attempts = attempts.max(self.watches[i].attempts);
        }
        let alone = count < 1.5;
        let centre = match nearest(root, places).filter(|_| alone) {
            // Nobody holds it but the wall: round the robot it cannot get past.
            Some(other) => other,
            None => scale(sum, 1.0 / f64::max(count, 1.0)),
        };
        let away = (0..n).filter(|i| members(&self.groups, *i)).find_map(|i| {
            let push = self.watches[i].push?;
            let arm = sub(places[i].position?, centre);
            Some(if dot(right_of(arm), push) > 0.0 { -1.0 } else { 1.0 })
        });
        let waits = |watch: &Watch| watch.held_ticks >= self.patience_ticks / 2;
        let outermost_m = (0..n)
            .filter(|i| members(&self.groups, *i) && waits(&self.watches[*i]))
            .map(|i| length(sub(places[i].position.unwrap_or_default(), centre)))
            .fold(0.0, f64::max);
        let length_s = ATTEMPT_S * (1.0 + 0.5 * f64::from(attempts)).min(4.0);
        for i in 0..n {
            if !members(&self.groups, i) || self.watches[i].held_ticks < self.patience_ticks / 2 {
                continue;
            }
            let watch = &mut self.watches[i];
            watch.attempts = (attempts + 1).min(MAX_ATTEMPTS + 1);
            watch.held_ticks = 0;
            if watch.attempts <= MAX_ATTEMPTS {
                watch.left = ticks(length_s);
                watch.since = 0;
                watch.centre = centre;
                watch.outermost_m = outermost_m;
                watch.sense = away.unwrap_or(1.0) * if attempts % 4 < 2 { 1.0 } else { -1.0 };
            }
        }
    }
}

/// Where the nearest other robot is.
fn nearest(i: usize, places: &[Place]) -> Option<Vector> {
    let at = places[i].position?;
    let others = places.iter().enumerate().filter(|(j, _)| *j != i);
    let seen = others.filter_map(|(_, place)| place.position);
    seen.min_by(|a, b| length(sub(*a, at)).total_cmp(&length(sub(*b, at))))
}

/// Nothing close by stands where the robot wants to go. A robot that only turns now does not say where that is.
fn is_free(i: usize, places: &[Place], intent: Vector) -> bool {
    let (Some(at), Some(wanted)) = (places[i].position, direction(intent)) else {
        return false;
    };
    places.iter().enumerate().all(|(j, other)| {
        let Some(there) = other.position.filter(|_| j != i) else {
            return true;
        };
        let line = sub(there, at);
        let gap_m = length(line) - places[i].radius_m - other.radius_m;
        gap_m > FREE_M || direction(line).is_none_or(|toward| dot(toward, wanted) < FREE_COSINE)
    })
}
