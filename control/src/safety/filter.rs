//! The filter itself: observations and desired twists in, safe commands out.

mod admit;
mod finish;
mod slowing;
mod steer;

use twin::command::WheelCommand;
use twin::pose::Pose;
use twin::robot::Robot;
use twin::twist::BodyTwist;
use twin::world::Contents;

use super::chassis::{Chassis, Motion, Numbers};
use super::deadlock::{Deadlock, Hold, Watcher};
use super::groups::Groups;
use super::intervention::{Cause, Strongest};
use super::listing::{self, Listing, Robots, Scene};
use super::margin::Place;
use super::moving::{MAX_MOVING, MovingDisc};
use super::pipeline::Pipeline;
use super::rows::NOBODY;
use super::solver::{Group, Outcome, Solver};
use super::surroundings::{self, Geofence};
use super::{Filtered, Limits, SafeCommand};
use crate::TICK_S;
use crate::law::RobotObservation;
use crate::vector::{Vector, dot, length, right_of, scale};
use finish::record;

const RECORDED_RAD_PER_S: f64 = 1e-3;
/// Times that the problem is solved again around robots that had to stop; then all of the groups concerned stop.
const MAX_ROUNDS: u32 = 4;
/// Rows may be missed by this after the last transform; more stops the robots.
const MISSED_M_PER_S: f64 = 1e-6;
/// What a robot that skids may use up of a margin while it turns on the spot.
const WALK_RESERVE_M: f64 = 0.015;
/// A swing below this is rounding or no harm.
const SWUNG_M_PER_S: f64 = 2e-3;

/// A robot as the filter needs it.
#[derive(Debug, Clone)]
pub struct FilterBody {
    pub robot: Robot,
    pub bounding_radius_m: f64,
}

/// Turns desired twists into safe commands; see the module. Allocates only in `new` and the `with_` functions.
#[derive(Debug, Clone)]
pub struct SafetyFilter {
    limits: Limits,
    scene: Scene,
    chassis: Vec<Chassis>,
    radii_m: Vec<f64>,
    latencies_s: Vec<f64>,
    /// The measured delay is one that the filter can answer for.
    latency_known: Vec<bool>,
    /// Something moves of which nobody knows where.
    moving_unknown: bool,
    easy: Vec<[f64; 2]>,
    planar: Vec<bool>,
    // What the next tick depends on.
    places: Vec<Place>,
    pipelines: Vec<Pipeline>,
    steering_rad: Vec<f64>,
    curvature: Vec<f64>,
    watcher: Watcher,
    active_keys: Vec<u64>,
    missed_ticks: u32,
    filtered: Vec<Filtered>,
    // Workspace of one tick.
    desired: Vec<Numbers>,
    numbers: Vec<Numbers>,
    stops: Vec<Option<Cause>>,
    /// Stopping along a deceleration, not at once.
    slowing: Vec<bool>,
    /// Which of those slow down together.
    together: Groups,
    /// Share of its last command that each of them keeps in this tick.
    kept: Vec<f64>,
    swung: Vec<bool>,
    steered_out: Vec<bool>,
    listing: Listing,
    groups: Groups,
    group_rows: Vec<u32>,
    group_starts: Vec<u32>,
    members: Vec<u32>,
    solver: Solver,
    strongest: Vec<Strongest>,
    intents: Vec<Vector>,
    velocities: Vec<Vector>,
    holds: Vec<Hold>,
    steps: u32,
}

const STOP: SafeCommand = SafeCommand {
    twist: BodyTwist {
        forward_m_per_s: 0.0,
        left_m_per_s: 0.0,
        yaw_rate_rad_per_s: 0.0,
    },
    wheels: WheelCommand {
        wheel_rad_per_s: [0.0; twin::MAX_WHEELS],
        steering_rad: 0.0,
    },
};

impl SafetyFilter {
    /// A filter for robots in an empty rectangular arena centred at the origin, `arena_m = [width, height]`.
    pub fn new(limits: Limits, arena_m: [f64; 2], bodies: Vec<FilterBody>) -> SafetyFilter {
        let n = bodies.len();
        let scene = Scene {
            half_arena_m: scale(arena_m, 0.5),
            fence: None,
            bodies: Vec::new(),
            moving: Vec::new(),
            most_moving: 0,
        };
        let radii_m = bodies.iter().map(|body| body.bounding_radius_m).collect();
        let chassis: Vec<Chassis> = bodies
            .into_iter()
            .map(|body| Chassis::new(body.robot, &limits))
            .collect();
        let listing = Listing::new(&chassis, &scene);
        let rows = listing.rows.capacity();
        let stopped = Filtered {
            command: STOP,
            intervention: None,
        };
        SafetyFilter {
            limits,
            scene,
            easy: chassis.iter().map(Chassis::easy).collect(),
            planar: chassis.iter().map(|one| one.motion == Motion::Holonomic).collect(),
            chassis,
            radii_m,
            latencies_s: vec![limits.latency_s; n],
            latency_known: vec![true; n],
            moving_unknown: false,
            places: vec![Place::STILL; n],
            pipelines: vec![Pipeline::new(); n],
            steering_rad: vec![0.0; n],
            curvature: vec![0.0; n],
            watcher: Watcher::new(n, &limits),
            active_keys: Vec::with_capacity(rows),
            missed_ticks: 0,
            filtered: vec![stopped; n],
            desired: vec![[0.0; 3]; n],
            numbers: vec![[0.0; 3]; n],
            stops: vec![None; n],
            slowing: vec![false; n],
            together: Groups::new(n),
            kept: vec![0.0; n],
            swung: vec![false; n],
            steered_out: vec![false; n],
            groups: Groups::new(n),
            group_rows: Vec::with_capacity(rows),
            group_starts: vec![0; n + 1],
            members: Vec::with_capacity(n),
            solver: Solver::new(n),
            strongest: vec![Strongest::NONE; n],
            intents: vec![[0.0, 0.0]; n],
            velocities: vec![[0.0, 0.0]; n],
            holds: vec![Hold::Nothing; n],
            steps: 0,
            listing,
        }
    }

    /// The same filter with the obstacles of an arena. Pushable ones stand at their start until
    /// [`SafetyFilter::see_pushable`] says otherwise.
    pub fn with_contents(mut self, contents: &Contents) -> SafetyFilter {
        self.scene.bodies = surroundings::bodies(contents);
        self.make_room();
        self
    }

    /// The same filter with a region that no bounding circle may leave, besides the walls.
    pub fn with_geofence(mut self, fence: Geofence) -> SafetyFilter {
        self.scene.fence = Some(fence);
        self.make_room();
        self
    }

    /// The same filter with room for so many discs that others move, at most [`MAX_MOVING`]; see
    /// [`SafetyFilter::see_moving`].
    pub fn with_moving(mut self, most: usize) -> SafetyFilter {
        self.scene.most_moving = most.min(MAX_MOVING);
        self.scene.moving = Vec::with_capacity(self.scene.most_moving);
        self.make_room();
        self
    }

    fn make_room(&mut self) {
        self.listing.reserve(&self.scene);
        let rows = self.listing.rows.capacity();
        self.active_keys.reserve(rows);
        self.group_rows.reserve(rows);
    }

    pub fn limits(&self) -> &Limits {
        &self.limits
    }

    /// Longest delay that the filter can answer for, s: what it remembers of its commands less [`Limits::oldest_pose_s`].
    pub fn longest_latency_s(&self) -> f64 {
        super::pipeline::DEPTH as f64 * TICK_S - self.limits.oldest_pose_s
    }

    /// Measured delay of the link to a robot and of the robot itself, s; the default is [`Limits::latency_s`].
    ///
    /// A robot whose delay is longer than [`SafetyFilter::longest_latency_s`], negative or not finite stands still until
    /// the next measurement.
    pub fn set_latency_s(&mut self, robot: usize, latency_s: f64) {
        let longest_s = self.longest_latency_s();
        if let (Some(slot), Some(known)) = (self.latencies_s.get_mut(robot), self.latency_known.get_mut(robot)) {
            *known = (0.0..=longest_s).contains(&latency_s);
            *slot = if *known { latency_s } else { longest_s };
        }
    }

    /// Where a tracked pushable obstacle is and how it moves in the world frame, until the next time.
    pub fn see_pushable(&mut self, index: usize, pose: Pose, velocity_m_per_s: [f64; 2], yaw_rate_rad_per_s: f64) {
        let found = self.scene.bodies.iter_mut().filter(|body| body.pushable).nth(index);
        if let Some(body) = found {
            body.place(pose, velocity_m_per_s, yaw_rate_rad_per_s);
        }
    }

    /// Everything that others move, as it is seen now, in an order that stays; holds until the next time.
    ///
    /// While there is more than there is room for, or numbers that cannot be those of a disc (not finite, negative), robots
    /// stop with [`Cause::Infeasible`]: something moves, and nobody knows where.
    pub fn see_moving(&mut self, discs: &[MovingDisc]) {
        self.scene.moving.clear();
        let room = self.scene.most_moving;
        self.moving_unknown = discs.len() > room || !discs.iter().all(MovingDisc::is_possible);
        let known = discs.iter().filter(|disc| disc.is_possible());
        self.scene.moving.extend(known.take(room));
    }

    /// Robots that hold each other or did a moment ago.
    pub fn deadlocks(&self) -> impl Iterator<Item = Deadlock> + '_ {
        self.watcher.deadlocks()
    }

    /// Steps that the solver took on the last tick, over all groups.
    pub fn solver_steps(&self) -> u32 {
        self.steps
    }

    /// Forgets everything that was seen and sent: the state of a new filter.
    pub fn reset(&mut self) {
        self.places.fill(Place::STILL);
        for pipeline in &mut self.pipelines {
            *pipeline = Pipeline::new();
        }
        self.steering_rad.fill(0.0);
        self.curvature.fill(0.0);
        self.watcher.reset();
        self.active_keys.clear();
        self.missed_ticks = 0;
        self.scene.moving.clear();
        self.moving_unknown = false;
        self.filtered.fill(Filtered {
            command: STOP,
            intervention: None,
        });
    }

    /// Safe commands for this tick, one per robot, in order. Missing observations count as offline, missing twists as zero.
    pub fn apply(&mut self, observations: &[RobotObservation], desired: &[BodyTwist]) -> &[Filtered] {
        self.apply_towards(observations, desired, desired)
    }

    /// As [`SafetyFilter::apply`] where `desired` is on its way to `intended`, limited in its acceleration: what a
    /// robot wants in the end decides whether it is held.
    pub fn apply_towards(
        &mut self,
        observations: &[RobotObservation],
        desired: &[BodyTwist],
        intended: &[BodyTwist],
    ) -> &[Filtered] {
        self.missed_ticks = 0;
        let n = self.chassis.len();
        for i in 0..n {
            let wanted = desired.get(i).copied().unwrap_or_default();
            let intended = intended.get(i).copied().unwrap_or_default();
            self.admit(i, observations.get(i), &wanted, &intended);
        }
        self.stop_the_unknown();
        self.solve();
        self.steady_turns();
        self.check_rows();
        self.weigh();
        for i in 0..n {
            let wanted = desired.get(i).copied().unwrap_or_default();
            self.filtered[i] = self.finish(i, wanted);
        }
        self.watch();
        &self.filtered
    }

    /// Stop commands for all robots.
    pub fn stop(&mut self) -> &[Filtered] {
        self.stop_with(None);
        &self.filtered
    }

    /// Commands of a tick whose deadline has passed: those of the tick before, decelerated; from the second in a row on, stop.
    /// Robots that may not move at all by what is seen of them ([`SafetyFilter::apply`]) stop at once.
    pub fn missed_tick(&mut self, observations: &[RobotObservation]) -> &[Filtered] {
        self.missed_ticks = self.missed_ticks.saturating_add(1);
        if self.missed_ticks > 1 {
            self.stop_with(Some(Cause::Late));
            return &self.filtered;
        }
        for i in 0..self.chassis.len() {
            self.stops[i] = self.must_stop(i, observations.get(i), &BodyTwist::default());
        }
        for i in 0..self.chassis.len() {
            self.kept[i] = self.kept_among(i, |k| self.stops[k].is_none());
        }
        for i in 0..self.chassis.len() {
            let before = self.filtered[i].command.twist;
            let command = match self.stops[i] {
                Some(_) => stop_holding(self.steering_rad[i]),
                None => self.slower(i),
            };
            self.send(i, command);
            let cause = self.stops[i].unwrap_or(Cause::Late);
            let intervention = Some(record(cause, before, command.twist, Strongest::NONE));
            self.filtered[i] = Filtered { command, intervention };
        }
        &self.filtered
    }

    fn stop_with(&mut self, cause: Option<Cause>) {
        for i in 0..self.chassis.len() {
            let before = self.filtered[i].command.twist;
            let command = stop_holding(self.steering_rad[i]);
            self.send(i, command);
            let intervention = cause.map(|cause| record(cause, before, command.twist, Strongest::NONE));
            self.filtered[i] = Filtered { command, intervention };
        }
    }

    /// Lists and solves until no group fails; each failure stops robots.
    fn solve(&mut self) {
        self.steps = 0;
        self.together.reset();
        for round in 0..=MAX_ROUNDS {
            let robots = Robots {
                places: &self.places,
                chassis: &self.chassis,
                desired: &self.desired,
                curvature: &self.curvature,
            };
            self.listing.fill(&robots, &self.scene, &self.limits);
            self.recall();
            self.part();
            let mut failed = false;
            for first in 0..self.chassis.len() {
                if self.places[first].movable && self.groups.of(first) == first {
                    failed |= !self.solve_group(first, round == MAX_ROUNDS);
                }
            }
            if !failed || round == MAX_ROUNDS {
                break;
            }
        }
        self.active_keys.clear();
        self.active_keys
            .extend(self.listing.rows.iter().filter(|row| row.active).map(|row| row.key));
    }

    /// Marks the rows that were active on the tick before; both lists rise.
    fn recall(&mut self) {
        let mut at = 0;
        for row in &mut self.listing.rows {
            while at < self.active_keys.len() && self.active_keys[at] < row.key {
                at += 1;
            }
            row.active = self.active_keys.get(at) == Some(&row.key);
        }
    }

    /// Parts the shared rows by group: those of group `g` stand at `group_starts[g]..group_starts[g + 1]`.
    fn part(&mut self) {
        let n = self.chassis.len();
        let shared = &self.listing.rows[..self.listing.shared];
        self.groups.reset();
        for row in shared {
            let [a, b] = row.robots.map(|robot| robot as usize);
            if row.robots[1] != NOBODY && self.places[a].movable && self.places[b].movable {
                self.groups.join(a, b);
            }
        }
        self.group_starts.fill(0);
        for row in shared {
            self.group_starts[self.groups.of(mover(row, &self.places)) + 1] += 1;
        }
        for g in 0..n {
            self.group_starts[g + 1] += self.group_starts[g];
        }
        self.group_rows.clear();
        self.group_rows.resize(shared.len(), 0);
        for (at, row) in shared.iter().enumerate().rev() {
            // From the end, so that the starts count down to the ends of the groups before.
            let g = self.groups.of(mover(row, &self.places));
            self.group_starts[g + 1] -= 1;
            self.group_rows[self.group_starts[g + 1] as usize] = at as u32;
        }
        // group_starts[g + 1] is now the start of g.
    }

    fn group_range(&self, g: usize) -> std::ops::Range<usize> {
        let start = self.group_starts[g + 1] as usize;
        let end = self
            .group_starts
            .get(g + 2)
            .map_or(self.group_rows.len(), |end| *end as usize);
        start..end
    }

    /// False when the group has no solution; its robots are stopped, those that clash or, the last time, all.
    fn solve_group(&mut self, first: usize, last: bool) -> bool {
        self.members.clear();
        for i in first..self.chassis.len() {
            if self.places[i].movable && self.groups.of(i) == first {
                self.members.push(i as u32);
            }
        }
        let range = self.group_range(first);
        let group = Group {
            shared: &self.group_rows[range],
            robots: &self.members,
            own: &self.listing.own,
            easy: &self.easy,
            planar: &self.planar,
        };
        let outcome = self
            .solver
            .solve(&group, &mut self.listing.rows, &self.desired, &mut self.numbers);
        self.steps += self.solver.steps;
        let cause = match outcome {
            Outcome::Solved => return true,
            Outcome::Infeasible => Cause::Infeasible,
            Outcome::NotConverged => Cause::NotConverged,
        };
        if outcome == Outcome::Infeasible && !last {
            for k in 0..self.solver.clash().len() {
                let robots = self.listing.rows[self.solver.clash()[k] as usize].robots;
                for robot in robots {
                    if robot != NOBODY && self.places[robot as usize].movable {
                        self.halt(robot as usize, cause);
                    }
                }
            }
        } else {
            for k in 0..self.members.len() {
                self.halt(self.members[k] as usize, cause);
            }
        }
        self.slow_together();
        false
    }

    /// Limits yaw rates where turning would swing a velocity into something before the next commands arrive.
    ///
    /// A command is a twist in the body frame; after the time t it points r t further round, and so does what the
    /// robot still has of earlier commands: a robot that is told to stop and to turn coasts round a bend. What this
    /// adds to the approach may not exceed what is left of the row and half of what the gap allows. Turning away is
    /// never limited, and a smaller yaw rate keeps every other row: those of the wheels hold without turning as well.
    fn steady_turns(&mut self) {
        for at in 0..self.listing.shared {
            let row = &self.listing.rows[at];
            let share = if listing::is_single(row) { 1.0 } else { 0.5 };
            let left_over = (row.value(&self.numbers) - row.bound).max(0.0) * row.scale;
            let gap_allows = 0.5 * (-row.bound * row.scale).max(0.0);
            let (robots, normal) = (row.robots, row.normal);
            let walk_m_per_s = share * self.limits.approach_gain_per_s * (row.free_m + WALK_RESERVE_M).max(0.0);
            for (robot, sign) in robots.into_iter().zip([1.0, -1.0]) {
                let i = robot as usize;
                if robot != NOBODY
                    && self.places[i].movable
                    && !matches!(self.chassis[i].motion, Motion::Steered { .. })
                {
                    self.steady_turn(i, scale(normal, sign), share * left_over, share * gap_allows);
                    self.steady_walk(i, share * left_over + walk_m_per_s);
                }
            }
        }
    }

    fn steady_turn(&mut self, i: usize, normal: Vector, left_over: f64, gap_allows: f64) {
        let place = &self.places[i];
        let yaw_rate = self.chassis[i]
            .twist(self.numbers[i], self.curvature[i])
            .yaw_rate_rad_per_s;
        let angle = yaw_rate * listing::swing_s(place, &self.limits);
        let (chosen, measured) = (self.velocity(i), place.velocity);
        // What the measurement may be wrong by does not count.
        let surely = (1.0 - self.limits.tracking_m_per_s / length(measured).max(1e-9)).max(0.0);
        let coasting = scale(measured, surely);
        let rises = |velocity: Vector| 2.0 * gap_allows + dot(normal, velocity).max(0.0);
        let mut factor = 1.0_f64;
        for (velocity, left_over) in [
            (chosen, left_over),
            (coasting, rises(coasting)),
            (place.commanded, rises(place.commanded)),
        ] {
            let bend = dot(normal, scale(right_of(velocity), -1.0)) * angle;
            let allowed = left_over + gap_allows + SWUNG_M_PER_S;
            if bend < -allowed {
                factor = factor.min(allowed / -bend);
            }
        }
        if factor < 1.0 {
            self.swung[i] |= yaw_rate.abs() * (1.0 - factor) > RECORDED_RAD_PER_S;
            self.numbers[i] = self.chassis[i].turning(self.numbers[i], factor);
        }
    }

    /// Limits the yaw rate of a robot that skids: turning on the spot it walks in any direction.
    fn steady_walk(&mut self, i: usize, allowed_m_per_s: f64) {
        let chassis = &self.chassis[i];
        let yaw_rate = chassis.twist(self.numbers[i], self.curvature[i]).yaw_rate_rad_per_s;
        let walk_m_per_s = chassis.walk_m * yaw_rate.abs();
        if walk_m_per_s > allowed_m_per_s {
            let factor = allowed_m_per_s / walk_m_per_s;
            self.swung[i] |= yaw_rate.abs() * (1.0 - factor) > RECORDED_RAD_PER_S;
            self.numbers[i] = self.chassis[i].turning(self.numbers[i], factor);
        }
    }

    /// Velocity of the body origin in the world for the present numbers.
    fn velocity(&self, i: usize) -> Vector {
        self.places[i].world_from_body(self.chassis[i].velocity(self.numbers[i], self.curvature[i]))
    }

    /// Every row once more, on what will be sent; a robot whose row does not hold stops.
    fn check_rows(&mut self) {
        for at in 0..self.listing.rows.len() {
            let row = &self.listing.rows[at];
            if row.value(&self.numbers) < row.bound - MISSED_M_PER_S {
                for robot in row.robots {
                    if robot != NOBODY && self.places[robot as usize].movable {
                        self.halt(robot as usize, Cause::NotConverged);
                    }
                }
            }
        }
    }
}

/// The robot of a row that the filter steers.
fn mover(row: &super::rows::Row, places: &[Place]) -> usize {
    let [a, b] = row.robots;
    if places[a as usize].movable {
        a as usize
    } else {
        b as usize
    }
}

fn stop_holding(steering_rad: f64) -> SafeCommand {
    SafeCommand {
        wheels: WheelCommand {
            steering_rad,
            ..STOP.wheels
        },
        ..STOP
    }
}
