//! A way round robots that stand and round obstacles: by one place between where a robot is and where it goes.
//!
//! The straight way, or the Reeds-Shepp path, comes first. Where it meets somebody who stands, places of a grid over the
//! arena are tried in a fixed order, each with eight yaws for a robot that steers, so many each tick; the shortest way
//! whose both parts are free is taken. Robots that move are left to the safety filter.

use super::manoeuvre::{Car, Manoeuvre};
use super::piece::Place;
use crate::safety::Geofence;
use crate::vector::{Vector, add, distance_to_segment, length, scale, sub};
use twin::world::Contents;

/// Gap between bounding circles that a way keeps, unless robot or goal are closer than that already.
const GAP_M: f64 = 0.08;
/// Narrower gaps the safety filter does not let anybody through.
const LEAST_GAP_M: f64 = 0.035;
/// Room left between the walls and the bounding circle.
const ROOM_M: f64 = 0.06;
/// A robot stands when it was within this for so long.
const STILL_M: f64 = 0.015;
const STILL_TICKS: u32 = 100;
/// Places of the grid along x and y.
const GRID: [u16; 2] = [9, 7];
/// Yaws at each place, for robots that steer.
const YAWS: u16 = 8;
/// Places tried in one tick; a path of a car takes some microseconds.
const TRIED_A_TICK: u16 = 8;
/// A robot that turns in place drives straight where a standing robot is this close to its way, or a wall to it or its goal.
const BEND_M: f64 = 0.45;
const WALL_M: f64 = 0.1;
/// Distance of points of a straight way that are held against obstacles.
const STEP_M: f64 = 0.04;

/// A robot that stands, as others must go round it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Disc {
    pub centre_m: Vector,
    pub radius_m: f64,
}

/// Whether a robot stands, from where it was.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Rest {
    anchor_m: Option<Vector>,
    ticks: u32,
}

impl Rest {
    /// `true` when the robot has stood for a while.
    pub fn look(&mut self, here_m: Vector) -> bool {
        match self.anchor_m {
            Some(anchor_m) if length(sub(here_m, anchor_m)) <= STILL_M => self.ticks = self.ticks.saturating_add(1),
            _ => {
                self.anchor_m = Some(here_m);
                self.ticks = 0;
            }
        }
        self.ticks >= STILL_TICKS
    }
}

/// What is in the way of one robot, on its way from one place to another.
#[derive(Debug, Clone, Copy)]
pub struct Room<'a> {
    half_arena_m: Vector,
    half_room_m: Vector,
    radius_m: f64,
    discs: &'a [Disc],
    contents: &'a Contents,
    fence: Option<&'a Geofence>,
    here_m: Vector,
    goal_m: Vector,
    /// Kept from obstacles and from the geofence; none when robot or goal are too close to one.
    obstacle_gap_m: Option<f64>,
}

impl<'a> Room<'a> {
    /// - `half_arena_m`: half of the arena along x and y; `radius_m`: bounding circle of the robot.
    pub fn new(
        half_arena_m: Vector,
        radius_m: f64,
        discs: &'a [Disc],
        (contents, fence): (&'a Contents, Option<&'a Geofence>),
        here_m: Vector,
        goal_m: Vector,
    ) -> Room<'a> {
        // A robot may be, and go, closer to a wall than it would pass along it.
        let half = |k: usize| {
            let most_m = (half_arena_m[k] - radius_m).max(0.0);
            (most_m - ROOM_M)
                .max(here_m[k].abs().min(most_m))
                .max(goal_m[k].abs().min(most_m))
        };
        let clear = |at: Vector, gap_m: f64| is_clear(contents, fence, at, radius_m + gap_m);
        let gaps_m = [ROOM_M, LEAST_GAP_M, 0.0];
        let obstacle_gap_m = gaps_m
            .into_iter()
            .find(|gap_m| clear(here_m, *gap_m) && clear(goal_m, *gap_m));
        Room {
            half_arena_m,
            half_room_m: [half(0), half(1)],
            radius_m,
            discs,
            contents,
            fence,
            here_m,
            goal_m,
            obstacle_gap_m,
        }
    }

    /// Distance that the robot's centre keeps from a disc's; none from one that stands on the goal: there is no way round that.
    fn reach_m(&self, disc: &Disc) -> Option<f64> {
        let touching_m = self.radius_m + disc.radius_m;
        let gap_m = |at: Vector| length(sub(at, disc.centre_m)) - touching_m;
        let at_goal_m = gap_m(self.goal_m);
        (at_goal_m >= LEAST_GAP_M).then(|| touching_m + GAP_M.min(at_goal_m - 1e-3).min(gap_m(self.here_m) - 1e-3))
    }

    /// Whether the robot's centre may be there.
    pub fn holds(&self, at: Vector) -> bool {
        let inside = (0..2).all(|k| at[k].abs() <= self.half_room_m[k] + 1e-9);
        inside
            && self.discs.iter().all(|disc| {
                self.reach_m(disc)
                    .is_none_or(|reach_m| length(sub(at, disc.centre_m)) >= reach_m)
            })
            && self.is_off_obstacles(at)
    }

    fn is_off_obstacles(&self, at: Vector) -> bool {
        self.obstacle_gap_m
            .is_none_or(|gap_m| is_clear(self.contents, self.fence, at, self.radius_m + gap_m - 1e-3))
    }

    /// Whether nobody stands on the straight way between two places.
    pub fn is_straight(&self, from_m: Vector, to_m: Vector) -> bool {
        let clear = self.discs.iter().all(|disc| {
            self.reach_m(disc)
                .is_none_or(|reach_m| distance_to_segment(disc.centre_m, from_m, to_m) >= reach_m)
        });
        if !clear
            || self.obstacle_gap_m.is_none()
            || (self.contents.fixed.is_empty() && self.contents.pushable.is_empty() && self.fence.is_none())
        {
            return clear;
        }
        let way = sub(to_m, from_m);
        let steps = (length(way) / STEP_M).clamp(1.0, 1000.0) as u32;
        (1..=steps).all(|k| self.is_off_obstacles(add(from_m, scale(way, f64::from(k) / f64::from(steps)))))
    }

    /// Whether somebody stands, or a wall is, so close to the straight way that a bend of it could meet them.
    pub fn is_narrow(&self, from_m: Vector, to_m: Vector) -> bool {
        let near =
            |disc: &Disc| distance_to_segment(disc.centre_m, from_m, to_m) < self.radius_m + disc.radius_m + BEND_M;
        let along_wall = |at: Vector| (0..2).any(|k| at[k].abs() > self.half_arena_m[k] - self.radius_m - WALL_M);
        along_wall(from_m) || along_wall(to_m) || self.discs.iter().any(near)
    }
}

/// Whether a disc there overlaps no obstacle and lies inside the geofence.
fn is_clear(contents: &Contents, fence: Option<&Geofence>, at: Vector, radius_m: f64) -> bool {
    contents.fixed_overlap_m(at[0], at[1], radius_m).is_none()
        && contents.pushable_overlap_m(at[0], at[1], radius_m).is_none()
        && fence.is_none_or(|fence| fence.depth_m(at) >= radius_m)
}

/// A search for a place between, a few candidates each tick.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Search {
    next: u16,
    best: Option<(f64, Place)>,
}

impl Search {
    /// Goes on for a tick; `Some` when it is over, with what was found.
    ///
    /// - `car`: of a robot that steers; others drive straight.
    pub fn go_on(&mut self, room: &Room<'_>, car: Option<&Car>, here: &Place, goal: &Place) -> Option<Option<Place>> {
        let places = GRID[0] * GRID[1];
        let (all, budget) = match car {
            Some(_) => (places * YAWS, TRIED_A_TICK),
            None => (places, places),
        };
        for index in self.next..all.min(self.next + budget) {
            let (place, turn) = (index % places, index / places);
            let at = |k: usize, at: u16| (2.0 * f64::from(at) / f64::from(GRID[k] - 1) - 1.0) * room.half_room_m[k];
            let place_m = [at(0, place % GRID[0]), at(1, place / GRID[0])];
            // Not a place for a stop: too close to where the robot is, or to where it goes.
            if length(sub(place_m, here.place_m)) < 0.1 || !room.holds(place_m) {
                continue;
            }
            let yaw_rad = f64::from(turn) / f64::from(YAWS) * core::f64::consts::TAU - core::f64::consts::PI;
            let between = Place { place_m, yaw_rad };
            let most_m = self.best.map_or(f64::INFINITY, |(cost_m, _)| cost_m);
            let found = match car {
                Some(car) => Manoeuvre::cost_m(car, here, &between, room).and_then(|first_m| {
                    let rest_m = (first_m < most_m).then(|| Manoeuvre::cost_m(car, &between, goal, room))??;
                    Some((first_m + rest_m, between))
                }),
                None => {
                    (room.is_straight(here.place_m, place_m) && room.is_straight(place_m, goal.place_m)).then(|| {
                        let (first, second) = (sub(place_m, here.place_m), sub(goal.place_m, place_m));
                        let yaw_rad = libm::atan2(first[1], first[0]);
                        (length(first) + length(second), Place { place_m, yaw_rad })
                    })
                }
            };
            if let Some((cost_m, between)) = found.filter(|(cost_m, _)| *cost_m < most_m - 1e-9) {
                self.best = Some((cost_m, between));
            }
        }
        self.next = all.min(self.next + budget);
        (self.next == all).then(|| self.best.map(|(_, place)| place))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HALF_M: Vector = [2.0, 1.5];
    const RADIUS_M: f64 = 0.15;

    fn place(x_m: f64, y_m: f64, yaw_rad: f64) -> Place {
        Place {
            place_m: [x_m, y_m],
            yaw_rad,
        }
    }

    fn search(discs: &[Disc], car: Option<&Car>, here: Place, goal: Place) -> Option<Place> {
        let contents = Contents::default();
        let room = Room::new(HALF_M, RADIUS_M, discs, (&contents, None), here.place_m, goal.place_m);
        let mut search = Search::default();
        (0..1000)
            .find_map(|_| search.go_on(&room, car, &here, &goal))
            .expect("an end")
    }

    fn disc(x_m: f64, y_m: f64) -> Disc {
        Disc {
            centre_m: [x_m, y_m],
            radius_m: RADIUS_M,
        }
    }

    #[test]
    fn a_robot_that_stands_in_the_way_is_gone_round() {
        let (here, goal) = (place(-1.5, 0.0, 0.0), place(1.5, 0.0, 0.0));
        let discs = [disc(0.0, 0.02)];
        let between = search(&discs, None, here, goal).expect("a way");
        let contents = Contents::default();
        let room = Room::new(HALF_M, RADIUS_M, &discs, (&contents, None), here.place_m, goal.place_m);
        assert!(!room.is_straight(here.place_m, goal.place_m));
        assert!(room.is_straight(here.place_m, between.place_m) && room.is_straight(between.place_m, goal.place_m));
        let car = Car {
            turning_radius_m: 0.3,
            axle_x_m: -0.1,
            speed_m_per_s: 0.4,
        };
        let between = search(&discs, Some(&car), here, goal).expect("a way for a car");
        assert!(Manoeuvre::cost_m(&car, &here, &between, &room).is_some());
        assert!(Manoeuvre::cost_m(&car, &between, &goal, &room).is_some());
    }

    #[test]
    fn a_wall_of_robots_has_no_way_round() {
        let discs: Vec<Disc> = (0..9).map(|k| disc(0.0, -1.4 + 0.35 * f64::from(k))).collect();
        assert_eq!(search(&discs, None, place(-1.5, 0.0, 0.0), place(1.5, 0.0, 0.0)), None);
    }

    #[test]
    fn who_stands_on_the_goal_is_not_gone_round() {
        let goal = place(1.5, 0.0, 0.0);
        let discs = [disc(1.4, 0.0)];
        let contents = Contents::default();
        let room = Room::new(HALF_M, RADIUS_M, &discs, (&contents, None), [-1.5, 0.0], goal.place_m);
        assert!(room.is_straight([-1.5, 0.0], goal.place_m));
    }

    #[test]
    fn a_robot_stands_when_it_has_not_moved_for_a_while() {
        let mut rest = Rest::default();
        assert!((0..STILL_TICKS).all(|k| !rest.look([1e-5 * f64::from(k), 0.0])));
        assert!(rest.look([0.0, 0.0]));
        assert!(!rest.look([0.02, 0.0]));
    }
}
