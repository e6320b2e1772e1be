//! `go_to_pose`: every robot drives to its own place and stops there with the yaw that is asked for.
//!
//! - Holonomic: v = min(k e, speed), r = k_y (yaw error).
//! - Turning in place, with e the distance, a the angle to the goal and t the angle of the line to the goal against the
//!   goal's yaw: u = g e cos a,  r = k a + g (cos a sin a / a)(a + h t)    [Aicardi et al. 1995]; backwards
//!   when the goal lies behind, and on the spot at the end.
//! - Car-like: the Reeds-Shepp path that stays in the arena, see `reeds_shepp.rs` and `manoeuvre.rs`.
//! - Robots that stand, and obstacles, are gone round by a place between, see `detour.rs`.

use twin::twist::BodyTwist;
use twin::world::Contents;

use super::detour::{Disc, Rest, Room, Search};
use super::driver::{Driver, Request};
use super::manoeuvre::{Car, Manoeuvre, distance};
use super::motion::YAW_RATE_LIMIT_RAD_PER_S;
use super::parameters::{SPEED, YAW_GAIN};
use super::piece::Place;
use super::targets::{Owner, TargetRule, YawUse};
use super::{Demand, Drive, GO_TO_POSE, Law, LawSpec, Observation, ParameterSpec, Parameters, RobotObservation};
use crate::safety::Geofence;
use crate::scenario::Scenario;
use crate::vector::{Vector, clip, length, scale, sub, wrap};

pub(super) const SPEC: LawSpec = LawSpec {
    name: GO_TO_POSE,
    title: "Go to pose: every robot stops at its own place with its own yaw, round robots and obstacles that stand in its way, car-like ones by reversing where needed",
    source: "Aicardi et al. 1995 for robots that turn in place; Reeds and Shepp 1990 (eqs. 8.1 to 8.11) and Samson 1992 for car-like ones",
    targets: TargetRule {
        owner: Owner::Robot,
        least: 1,
        most_each: 1,
        yaw: YawUse::Needed,
        apart: true,
        meaning: "The pose of each robot at the end, with its yaw; a robot without one stands still.",
    },
    parameters: &[
        SPEED,
        ParameterSpec::quantity(
            "goal_gain_per_s",
            "1/s",
            [0.1, 1.5, 5.0],
            "Speed for each metre between robot and goal.",
        ),
        YAW_GAIN,
        ParameterSpec::quantity(
            "reach_radius_m",
            "m",
            [0.002, 0.008, 0.1],
            "The place counts as reached when the robot is this close.",
        ),
        ParameterSpec::quantity(
            "yaw_tolerance_rad",
            "rad",
            [0.005, 0.025, 0.5],
            "The yaw counts as reached when it is this close.",
        ),
    ],
};

/// `h`, where nobody stands near.
const YAW_BEND: f64 = 1.0;
/// A place between counts as passed this close: metres, and radians for robots that steer.
const PASSED_M: f64 = 0.05;
const PASSED_RAD: f64 = 0.2;
/// The way is held against robots that stand so often.
const LOOK_TICKS: u64 = 12;
/// After a search in vain the next one waits so long.
const VAIN_TICKS: u32 = 240;

#[derive(Debug)]
pub struct GoToPose {
    half_arena_m: Vector,
    contents: Contents,
    fence: Option<Geofence>,
    robots: Vec<Progress>,
    /// Whether each robot stands; those that stand, without the one that is looked at.
    rests: Vec<Rest>,
    standing: Vec<bool>,
    discs: Vec<Disc>,
}

#[derive(Debug, Clone, Copy, Default)]
struct Progress {
    driver: Driver,
    manoeuvre: Manoeuvre,
    /// Backwards all the way; chosen at the first tick of a way.
    backwards: Option<bool>,
    on_the_spot: bool,
    arrived: bool,
    /// Place to pass on the way to the goal.
    between: Option<Place>,
    search: Option<Search>,
    vain_ticks: u32,
}

/// One robot in one tick.
struct Sight<'a> {
    robot: &'a RobotObservation,
    here: Place,
    goal: Place,
    room: Room<'a>,
    parameters: &'a Parameters,
}

impl GoToPose {
    pub fn new(scenario: &Scenario) -> GoToPose {
        let robots = scenario.experiment.robots.len();
        GoToPose {
            half_arena_m: [0.5 * scenario.arena.width_m, 0.5 * scenario.arena.height_m],
            contents: scenario.arena.contents.clone(),
            // One that is wrong is refused by the scenario's checks.
            fence: Geofence::of(&scenario.arena.contents).ok().flatten(),
            robots: vec![Progress::default(); robots],
            rests: vec![Rest::default(); robots],
            standing: vec![false; robots],
            discs: Vec::with_capacity(robots),
        }
    }

    /// Who stands: who has nowhere to go, has arrived, or has not moved for a while.
    fn look(&mut self, observation: &Observation<'_>) {
        for (i, robot) in observation.robots.iter().enumerate() {
            let (Some(rest), Some(standing), Some(progress)) =
                (self.rests.get_mut(i), self.standing.get_mut(i), self.robots.get(i))
            else {
                continue;
            };
            let still = robot.pose.is_finite() && rest.look([robot.pose.x_m, robot.pose.y_m]);
            let goes = observation.targets.get(i).is_some_and(|goals| !goals.is_empty());
            *standing = robot.pose.is_finite() && (still || progress.arrived || !goes);
        }
    }

    fn others_that_stand(&mut self, i: usize, observation: &Observation<'_>) {
        self.discs.clear();
        let others = observation
            .robots
            .iter()
            .zip(observation.bodies)
            .zip(&self.standing)
            .enumerate();
        let stand = others.filter(|(j, (_, stands))| *j != i && **stands);
        self.discs.extend(stand.map(|(_, ((robot, body), _))| Disc {
            centre_m: [robot.pose.x_m, robot.pose.y_m],
            radius_m: body.bounding_radius_m,
        }));
    }
}

impl Law for GoToPose {
    fn name(&self) -> &'static str {
        GO_TO_POSE
    }

    fn step(&mut self, observation: &Observation<'_>, demands: &mut [Demand]) {
        self.look(observation);
        for (i, demand) in demands.iter_mut().enumerate() {
            let (Some(robot), Some(body)) = (observation.robots.get(i), observation.bodies.get(i)) else {
                continue;
            };
            if !robot.pose.is_finite() {
                continue;
            }
            let here = Place {
                place_m: [robot.pose.x_m, robot.pose.y_m],
                yaw_rad: robot.pose.yaw_rad,
            };
            let Some(target) = observation.targets.get(i).and_then(|goals| goals.first()) else {
                demand.target = here.place_m;
                demand.finished = true;
                continue;
            };
            let goal = Place {
                place_m: target.place_m,
                yaw_rad: target.yaw_rad.unwrap_or(here.yaw_rad),
            };
            self.others_that_stand(i, observation);
            let radius_m = body.bounding_radius_m;
            let (half_m, to_m) = (self.half_arena_m, goal.place_m);
            let around = (&self.contents, self.fence.as_ref());
            let sight = Sight {
                robot,
                here,
                goal,
                room: Room::new(half_m, radius_m, &self.discs, around, here.place_m, to_m),
                parameters: observation.parameters,
            };
            if let Some(progress) = self.robots.get_mut(i) {
                let is_time = (observation.tick + i as u64).is_multiple_of(LOOK_TICKS);
                progress.step(&sight, body.drive, is_time, demand);
            }
        }
    }
}

impl Progress {
    fn step(&mut self, sight: &Sight<'_>, drive: Drive, is_time: bool, demand: &mut Demand) {
        let Sight {
            robot,
            here,
            goal,
            room,
            parameters,
        } = sight;
        let car = match drive {
            Drive::Steered {
                turning_radius_m,
                axle_x_m,
            } => Some(Car {
                turning_radius_m,
                axle_x_m,
                speed_m_per_s: parameters.get("speed_m_per_s"),
            }),
            _ => None,
        };
        demand.target = goal.place_m;
        demand.finished = self.arrives(here, goal, parameters);
        if self.find_way(sight, car.as_ref(), is_time) {
            // It looks for a way, at rest.
            return;
        }
        let next = self.between.unwrap_or(*goal);
        demand.twist = match (drive, &car) {
            (Drive::Holonomic, _) => {
                let yaw_rad = goal.yaw_rad;
                self.straight(robot, here, &Place { yaw_rad, ..next }, parameters)
            }
            (_, Some(car)) => {
                let (twist, ahead) = self.manoeuvre(car, here, &next, room);
                demand.target = ahead;
                twist
            }
            (_, None) => {
                let bend = if room.is_narrow(here.place_m, next.place_m) {
                    0.0
                } else {
                    YAW_BEND
                };
                self.bent(here, &next, bend, parameters)
            }
        };
    }

    /// Chooses the place between; `true` while it is looked for.
    fn find_way(&mut self, sight: &Sight<'_>, car: Option<&Car>, is_time: bool) -> bool {
        let Sight { here, goal, room, .. } = sight;
        self.vain_ticks = self.vain_ticks.saturating_sub(1);
        if let Some(between) = self.between {
            let [way_m, turn_rad] = distance(here, &between);
            if way_m <= PASSED_M && (car.is_none() || turn_rad <= PASSED_RAD) {
                self.go_by(None);
            }
        }
        if self.search.is_none()
            && is_time
            && !self.arrived
            && self.vain_ticks == 0
            && self.is_blocked(here, goal, room, car)
        {
            self.search = Some(Search::default());
        }
        let Some(search) = &mut self.search else {
            return false;
        };
        match search.go_on(room, car, here, goal) {
            None => true,
            Some(found) => {
                self.search = None;
                self.vain_ticks = if found.is_none() { VAIN_TICKS } else { 0 };
                self.go_by(found);
                false
            }
        }
    }

    fn is_blocked(&self, here: &Place, goal: &Place, room: &Room<'_>, car: Option<&Car>) -> bool {
        match (car, self.between) {
            (Some(car), _) => self.manoeuvre.is_blocked(car, room),
            (None, Some(between)) => {
                !room.is_straight(here.place_m, between.place_m) || !room.is_straight(between.place_m, goal.place_m)
            }
            (None, None) => !room.is_straight(here.place_m, goal.place_m),
        }
    }

    /// A new way begins here.
    fn go_by(&mut self, between: Option<Place>) {
        self.between = between;
        self.backwards = None;
        self.on_the_spot = false;
        self.manoeuvre.forget();
    }

    /// Within the tolerances; having arrived, within twice these.
    fn arrives(&mut self, here: &Place, goal: &Place, parameters: &Parameters) -> bool {
        let [way_m, turn_rad] = distance(here, goal);
        let slack = if self.arrived { 2.0 } else { 1.0 };
        self.arrived = way_m <= slack * parameters.get("reach_radius_m")
            && turn_rad <= slack * parameters.get("yaw_tolerance_rad");
        self.arrived
    }

    fn straight(&mut self, robot: &RobotObservation, here: &Place, goal: &Place, parameters: &Parameters) -> BodyTwist {
        let way = sub(goal.place_m, here.place_m);
        let request = Request {
            velocity: clip(
                scale(way, parameters.get("goal_gain_per_s")),
                parameters.get("speed_m_per_s"),
            ),
            way,
            yaw_rad: Some(goal.yaw_rad),
            stops: true,
        };
        let gain_per_s = parameters.get("yaw_gain_per_s");
        self.driver.twist(Drive::Holonomic, robot, &request, gain_per_s)
    }

    /// Aicardi's law in the direction of driving, then a turn on the spot.
    ///
    /// - `bend`: how much the yaw at the goal bends the way there.
    fn bent(&mut self, here: &Place, goal: &Place, bend: f64, parameters: &Parameters) -> BodyTwist {
        let way = sub(goal.place_m, here.place_m);
        let way_m = length(way);
        let reach_m = parameters.get("reach_radius_m");
        let gain_per_s = parameters.get("yaw_gain_per_s");
        let bound = |rate: f64| rate.clamp(-YAW_RATE_LIMIT_RAD_PER_S, YAW_RATE_LIMIT_RAD_PER_S);
        self.on_the_spot = way_m <= if self.on_the_spot { reach_m } else { 0.4 * reach_m };
        if self.on_the_spot {
            return BodyTwist {
                yaw_rate_rad_per_s: bound(gain_per_s * wrap(goal.yaw_rad - here.yaw_rad)),
                ..BodyTwist::default()
            };
        }
        let line_rad = libm::atan2(way[1], way[0]);
        let bearing_rad = wrap(line_rad - here.yaw_rad);
        let backwards = *self
            .backwards
            .get_or_insert(bearing_rad.abs() > core::f64::consts::FRAC_PI_2);
        let (sign, turn_rad) = if backwards {
            (-1.0, core::f64::consts::PI)
        } else {
            (1.0, 0.0)
        };
        let a_rad = wrap(bearing_rad - turn_rad);
        let t_rad = wrap(line_rad - goal.yaw_rad - turn_rad);
        let speed = parameters.get("speed_m_per_s");
        let wanted = parameters.get("goal_gain_per_s") * way_m;
        let g_per_s = if wanted > speed {
            speed / way_m
        } else {
            parameters.get("goal_gain_per_s")
        };
        let sinc = if a_rad.abs() < 1e-6 {
            1.0
        } else {
            libm::sin(a_rad) / a_rad
        };
        let rate = gain_per_s * a_rad + g_per_s * libm::cos(a_rad) * sinc * (a_rad + bend * t_rad);
        let share = (bound(rate) / rate).abs();
        BodyTwist {
            forward_m_per_s: sign * g_per_s * way_m * libm::cos(a_rad) * if share.is_finite() { share } else { 1.0 },
            left_m_per_s: 0.0,
            yaw_rate_rad_per_s: bound(rate),
        }
    }

    fn manoeuvre(&mut self, car: &Car, here: &Place, goal: &Place, room: &Room<'_>) -> (BodyTwist, Vector) {
        // The last millimetres are driven as well: at the edge of the tolerance nothing is left for errors.
        if self.arrived && !self.manoeuvre.is_ending() {
            self.manoeuvre.forget();
            return (BodyTwist::default(), goal.place_m);
        }
        self.manoeuvre.step(car, here, goal, &|at| room.holds(at))
    }
}
