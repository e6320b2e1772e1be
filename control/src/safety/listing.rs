//! Lists the rows of a tick: pairs of robots, walls, geofence, obstacles, own limits.

use super::Limits;
use super::chassis::{Chassis, Motion, Numbers, OWN_ROWS};
use super::intervention::WallSide;
use super::margin::{Place, approach_m_per_s, bound_against, forbidden, lost_m, reach_m};
use super::moving::{MovingDisc, bound_against_pushed};
use super::rows::{NOBODY, Row, Source};
use super::surroundings::{Body, Geofence};
use crate::TICK_S;
use crate::vector::{Vector, dot, heading, length, scale, sub};

/// Most obstacles within reach of one robot; with more around it, it stands still.
pub const MAX_OBSTACLES: usize = 64;
/// Centres closer than this have no direction between them.
pub const COINCIDENT_M: f64 = 1e-6;

/// What no robot of the run is.
#[derive(Debug, Clone)]
pub struct Scene {
    pub half_arena_m: Vector,
    pub fence: Option<Geofence>,
    pub bodies: Vec<Body>,
    /// At most so many.
    pub moving: Vec<MovingDisc>,
    pub most_moving: usize,
}

/// Everything about the robots that rows are made of.
#[derive(Debug, Clone, Copy)]
pub struct Robots<'a> {
    pub places: &'a [Place],
    pub chassis: &'a [Chassis],
    pub desired: &'a [Numbers],
    pub curvature: &'a [f64],
}

/// Rows of one tick in rising order of their keys; the first `shared` are not own limits.
#[derive(Debug, Clone)]
pub struct Listing {
    pub rows: Vec<Row>,
    pub shared: usize,
    /// First position and number of each robot's own limits.
    pub own: Vec<[u32; 2]>,
    /// Some robot is steered.
    steered: bool,
}

const COUNTED: u64 = 1 << 59;
const WALLS: u64 = 1 << 60;
const FENCE: u64 = 2 << 60;
const OBSTACLES: u64 = 3 << 60;
const MOVING: u64 = 7 << 59;
const OWN: u64 = 4 << 60;

/// Rows against one thing: `way` of steered robots, `side` inside the margin, `later` for the heading after the turns
/// that are on their way.
fn key(kind: u64, robot: usize, item: usize, [way, side, later]: [usize; 3]) -> u64 {
    kind | (robot as u64) << 28 | (item as u64) << 4 | (way as u64) << 2 | (side as u64) << 1 | later as u64
}

/// A robot may make room more slowly than it was told by so much before nobody counts on what it was told, m/s: beyond the margin, where
/// robots that hardly move at all may hold each other, and inside it.
const SLOWER_M_PER_S: f64 = 0.02;
const SLOWER_INSIDE_M_PER_S: f64 = 1e-3;

/// Most rows of a pair (both together, and each by itself) or of a robot against one thing: two sides, two headings, two ways of each
/// steered robot.
const PAIR_ROWS: [usize; 2] = [4 + 2 * SINGLE_ROWS[0], 16 + 2 * SINGLE_ROWS[1]];
const SINGLE_ROWS: [usize; 2] = [4, 8];

/// For how long a velocity may turn with the body before a command of the next tick bends it back.
pub fn swing_s(place: &Place, limits: &Limits) -> f64 {
    place.reaction_s + limits.hold_s + TICK_S
}

impl Listing {
    /// Room for everything that can matter at once.
    pub fn new(chassis: &[Chassis], scene: &Scene) -> Listing {
        let steered = chassis.iter().any(|one| matches!(one.motion, Motion::Steered { .. }));
        Listing {
            rows: Vec::with_capacity(capacity(chassis.len(), scene, steered)),
            shared: 0,
            own: vec![[0, 0]; chassis.len()],
            steered,
        }
    }

    /// Makes room for another fence.
    pub fn reserve(&mut self, scene: &Scene) {
        let wanted = capacity(self.own.len(), scene, self.steered);
        self.rows.reserve(wanted.saturating_sub(self.rows.len()));
    }

    pub fn fill(&mut self, robots: &Robots, scene: &Scene, limits: &Limits) {
        self.rows.clear();
        pairs(robots, limits, &mut self.rows);
        each(robots, |i, at| counted(i, at, robots, limits, &mut self.rows));
        each(robots, |i, at| walls(i, at, robots, scene, limits, &mut self.rows));
        if let Some(fence) = &scene.fence {
            each(robots, |i, at| sides(i, at, robots, fence, limits, &mut self.rows));
        }
        each(robots, |i, at| obstacles(i, at, robots, scene, limits, &mut self.rows));
        each(robots, |i, at| moving(i, at, robots, scene, limits, &mut self.rows));
        self.shared = self.rows.len();
        for (i, own) in self.own.iter_mut().enumerate() {
            let first = self.rows.len();
            if robots.places[i].movable {
                robots.chassis[i].own_rows(i as u32, robots.desired[i], robots.curvature[i], &mut |row: Row| {
                    let key = key(OWN, i, self.rows.len() - first, [0; 3]);
                    self.rows.extend(Row { key, ..row }.normalised());
                });
            }
            *own = [first as u32, (self.rows.len() - first) as u32];
        }
    }
}

fn capacity(robots: usize, scene: &Scene, steered: bool) -> usize {
    let fence = scene.fence.as_ref().map_or(0, Geofence::sides);
    let things = 4 + fence + scene.bodies.len().min(MAX_OBSTACLES) + scene.most_moving;
    let pairs = robots * robots.saturating_sub(1) / 2;
    PAIR_ROWS[usize::from(steered)] * pairs + robots * (SINGLE_ROWS[usize::from(steered)] * things + OWN_ROWS)
}

/// True when more obstacles are within reach than are looked at.
pub fn crowded(place: &Place, scene: &Scene, limits: &Limits) -> bool {
    let Some(at) = place.position.filter(|_| scene.bodies.len() > MAX_OBSTACLES) else {
        return false;
    };
    let reach = obstacle_reach_m(place, limits);
    let near = |body: &&Body| length(sub(at, body.centre())) < reach + extra_m(body, place, limits);
    scene.bodies.iter().filter(near).count() > MAX_OBSTACLES
}

fn obstacle_reach_m(place: &Place, limits: &Limits) -> f64 {
    place.radius_m + reach_m(limits.speed_m_per_s, limits) + limits.wall_margin_m + farthest_lost_m(place, limits)
}

/// How much farther an obstacle matters by its size and its motion.
fn extra_m(body: &Body, place: &Place, limits: &Limits) -> f64 {
    let fastest = body.fastest_m_per_s();
    // It uses up approach as well: as if it were that much nearer.
    body.bounding_radius_m
        + fastest * (place.reaction_s + limits.hold_s)
        + reach_m(limits.speed_m_per_s + fastest, limits)
        - reach_m(limits.speed_m_per_s, limits)
        + limits.tracking_m_per_s * place.reaction_s
}

/// More than one robot's share of what [`lost_m`] can be; velocities are clipped to twice the limit.
fn farthest_lost_m(place: &Place, limits: &Limits) -> f64 {
    (2.0 * limits.speed_m_per_s + limits.tracking_m_per_s) * place.reaction_s
        + 2.0 * limits.speed_m_per_s * limits.hold_s
        + limits.pose_error_m
}

fn each(robots: &Robots, mut list: impl FnMut(usize, Vector)) {
    for (i, place) in robots.places.iter().enumerate() {
        if let Some(at) = place.position.filter(|_| place.movable) {
            list(i, at);
        }
    }
}

fn pairs(robots: &Robots, limits: &Limits, rows: &mut Vec<Row>) {
    let reach = reach_m(2.0 * limits.speed_m_per_s, limits) + limits.robot_margin_m;
    for (j, b) in robots.places.iter().enumerate() {
        let Some(at_b) = b.position else { continue };
        let share_b = b.radius_m + farthest_lost_m(b, limits);
        for (i, a) in robots.places[..j].iter().enumerate() {
            let Some(at_a) = a.position.filter(|_| a.movable || b.movable) else {
                continue;
            };
            let line = sub(at_a, at_b);
            let far = reach + share_b + a.radius_m + farthest_lost_m(a, limits);
            let square = dot(line, line);
            if square < far * far {
                pair([i, j], line, square.sqrt(), robots, limits, rows);
            }
        }
    }
}

fn pair([i, j]: [usize; 2], line: Vector, distance_m: f64, robots: &Robots, limits: &Limits, rows: &mut Vec<Row>) {
    let (a, b) = (&robots.places[i], &robots.places[j]);
    if distance_m < COINCIDENT_M {
        return;
    }
    let n = scale(line, 1.0 / distance_m);
    let free_m = distance_m - a.radius_m - b.radius_m - limits.robot_margin_m - 2.0 * limits.pose_error_m;
    let gap_m = free_m - lost_m(a, b, n, limits);
    let approach = approach_m_per_s(gap_m, limits);
    let back = scale(n, -1.0);
    let bound = match (a.movable, b.movable) {
        (true, true) => -approach,
        (true, false) => bound_against(approach, coming(b, n)),
        (false, _) => bound_against(approach, coming(a, back)),
    };
    if bound < -2.0 * limits.speed_m_per_s {
        return;
    }
    let turns = (a.movable && a.turns) || (b.movable && b.turns);
    let (normals, count) = if bound > 0.0 { ([n, n], 1) } else { forbidden(gap_m, n) };
    let [ways_a, ways_b] = [i, j].map(|k| ways(k, robots));
    for way in 0..ways_a * ways_b {
        for (side, normal) in normals.into_iter().take(count).enumerate() {
            for later in 0..1 + usize::from(turns) {
                let part = |k: usize, n: Vector, way: usize| gradient(k, n, later == 1, way, robots, limits);
                let row = Row {
                    key: key(0, j, i, [way, side, later]),
                    robots: [i as u32, j as u32],
                    gradient: [
                        part(i, normal, way % ways_a),
                        part(j, scale(normal, -1.0), way / ways_a),
                    ],
                    normal,
                    free_m,
                    ..Row::own(i as u32, Source::Robot, [0.0; 3], bound)
                };
                rows.extend(row.normalised());
            }
        }
    }
}

/// Rows of a robot by itself against others that make room more slowly than they were told, or not at all.
///
/// The row of a pair lets one robot come as fast as the other is told to go. One that is stuck, blocked or late does not go; what
/// it is seen to do counts then. Nobody has to flee for it: standing still remains allowed.
fn counted(i: usize, at: Vector, robots: &Robots, limits: &Limits, rows: &mut Vec<Row>) {
    let a = &robots.places[i];
    let reach = reach_m(2.0 * limits.speed_m_per_s, limits) + limits.robot_margin_m;
    let reach = reach + a.radius_m + farthest_lost_m(a, limits);
    for (j, b) in robots.places.iter().enumerate() {
        let Some(at_b) = b.position.filter(|_| b.movable && j != i) else {
            continue;
        };
        let line = sub(at, at_b);
        // Most robots go as they are told: no root for them.
        if dot(line, sub(b.velocity, b.commanded)) <= 0.0 {
            continue;
        }
        let far = reach + b.radius_m + farthest_lost_m(b, limits);
        let square = dot(line, line);
        if !(COINCIDENT_M * COINCIDENT_M..far * far).contains(&square) {
            continue;
        }
        let distance_m = square.sqrt();
        let n = scale(line, 1.0 / distance_m);
        let seen = dot(n, b.velocity);
        let slower = seen - dot(n, b.commanded);
        if slower <= SLOWER_INSIDE_M_PER_S {
            continue;
        }
        let free_m = distance_m - a.radius_m - b.radius_m - limits.robot_margin_m - 2.0 * limits.pose_error_m;
        if free_m > 0.0 && slower <= SLOWER_M_PER_S {
            continue;
        }
        let gap_m = free_m - lost_m(a, b, n, limits);
        let bound = (seen - approach_m_per_s(gap_m, limits)).min(0.0);
        let first = rows.len();
        alone(
            i,
            [COUNTED, j as u64],
            Source::Robot,
            [free_m, gap_m, bound],
            n,
            robots,
            limits,
            rows,
        );
        for row in &mut rows[first..] {
            row.robots[1] = j as u32;
        }
    }
}

/// How fast something that is not steered moves along `n`.
fn coming(place: &Place, n: Vector) -> f64 {
    dot(n, place.velocity).max(dot(n, place.commanded))
}

/// A steered robot keeps its arc and points elsewhere before it can be told otherwise, forwards and backwards.
fn ways(i: usize, robots: &Robots) -> usize {
    let steered = robots.places[i].movable && matches!(robots.chassis[i].motion, Motion::Steered { .. });
    1 + usize::from(steered && robots.curvature[i] * robots.desired[i][0] != 0.0)
}

/// Gradient of the velocity along `n` of one robot; zero for one that is not steered by the filter.
///
/// With two ways the worse of the heading now, `g`, and at the end of the arc counts, ahead or astern: `min(g, g_ahead) u`
/// for `u > 0` and `max(g, g_astern) u` for `u < 0`. That is the lesser of two lines, one row for each.
fn gradient(i: usize, n: Vector, later: bool, way: usize, robots: &Robots, limits: &Limits) -> Numbers {
    let (place, chassis, curvature) = (&robots.places[i], &robots.chassis[i], robots.curvature[i]);
    if !place.movable {
        return [0.0; 3];
    }
    let [x, y] = place.body_from_world(n, later);
    let now = chassis.gradient([x, y], curvature);
    if ways(i, robots) == 1 {
        return now;
    }
    let [c, s] = heading(curvature * robots.desired[i][0].abs() * swing_s(place, limits));
    if way == 0 {
        let ahead = chassis.gradient([c * x + s * y, c * y - s * x], curvature);
        [now[0].min(ahead[0]), 0.0, 0.0]
    } else {
        let astern = chassis.gradient([c * x - s * y, c * y + s * x], curvature);
        [now[0].max(astern[0]), 0.0, 0.0]
    }
}

/// Adds the row of robot `i` against something at `distance_m` of its centre, unless it is out of reach.
#[allow(clippy::too_many_arguments, reason = "one row, each argument one of its parts")]
fn against(
    i: usize,
    [kind, item]: [u64; 2],
    source: Source,
    distance_m: f64,
    n: Vector,
    coming_m_per_s: f64,
    robots: &Robots,
    limits: &Limits,
    rows: &mut Vec<Row>,
) {
    let place = &robots.places[i];
    let free_m = distance_m - place.radius_m - limits.wall_margin_m - limits.pose_error_m;
    let other = Place {
        velocity: scale(n, coming_m_per_s),
        commanded: scale(n, coming_m_per_s),
        pending_m: scale(n, coming_m_per_s * place.reaction_s),
        reaction_s: if coming_m_per_s == 0.0 { 0.0 } else { place.reaction_s },
        ..Place::STILL
    };
    let gap_m = free_m - lost_m(place, &other, n, limits);
    let bound = bound_against(approach_m_per_s(gap_m, limits), coming_m_per_s);
    alone(i, [kind, item], source, [free_m, gap_m, bound], n, robots, limits, rows);
}

/// The rows of a robot that something else has no part in, unless they are out of reach.
///
/// - `[free_m, gap_m, bound]`: what is free as it is seen now, what is sure to be, and the right side of the row.
#[allow(clippy::too_many_arguments, reason = "one row, each argument one of its parts")]
fn alone(
    i: usize,
    [kind, item]: [u64; 2],
    source: Source,
    [free_m, gap_m, bound]: [f64; 3],
    n: Vector,
    robots: &Robots,
    limits: &Limits,
    rows: &mut Vec<Row>,
) {
    if bound < -limits.speed_m_per_s {
        return;
    }
    let place = &robots.places[i];
    let (normals, count) = if bound > 0.0 { ([n, n], 1) } else { forbidden(gap_m, n) };
    for way in 0..ways(i, robots) {
        for (side, normal) in normals.into_iter().take(count).enumerate() {
            for later in 0..1 + usize::from(place.turns) {
                let gradient = gradient(i, normal, later == 1, way, robots, limits);
                let row = Row {
                    key: key(kind, i, item as usize, [way, side, later]),
                    normal,
                    free_m,
                    ..Row::own(i as u32, source, gradient, bound)
                };
                rows.extend(row.normalised());
            }
        }
    }
}

fn walls(i: usize, at: Vector, robots: &Robots, scene: &Scene, limits: &Limits, rows: &mut Vec<Row>) {
    let half = scene.half_arena_m;
    let all = [
        (WallSide::Left, [1.0, 0.0], half[0] + at[0]),
        (WallSide::Right, [-1.0, 0.0], half[0] - at[0]),
        (WallSide::Bottom, [0.0, 1.0], half[1] + at[1]),
        (WallSide::Top, [0.0, -1.0], half[1] - at[1]),
    ];
    for (item, (side, n, distance_m)) in all.into_iter().enumerate() {
        against(
            i,
            [WALLS, item as u64],
            Source::Wall(side),
            distance_m,
            n,
            0.0,
            robots,
            limits,
            rows,
        );
    }
}

fn sides(i: usize, at: Vector, robots: &Robots, fence: &Geofence, limits: &Limits, rows: &mut Vec<Row>) {
    let inside = fence.holds(at);
    if !inside {
        // Outside, only the nearest side says where the way back is.
        let nearest = (0..fence.sides())
            .map(|side| (side, fence.clearance(side, at, false)))
            .max_by(|a, b| a.1.0.total_cmp(&b.1.0));
        if let Some((side, (distance_m, n))) = nearest {
            let source = Source::Fence(side as u32);
            against(
                i,
                [FENCE, side as u64],
                source,
                distance_m,
                n,
                0.0,
                robots,
                limits,
                rows,
            );
        }
        return;
    }
    for side in 0..fence.sides() {
        let (distance_m, n) = fence.clearance(side, at, true);
        let source = Source::Fence(side as u32);
        against(
            i,
            [FENCE, side as u64],
            source,
            distance_m,
            n,
            0.0,
            robots,
            limits,
            rows,
        );
    }
}

fn obstacles(i: usize, at: Vector, robots: &Robots, scene: &Scene, limits: &Limits, rows: &mut Vec<Row>) {
    let reach = obstacle_reach_m(&robots.places[i], limits);
    for (item, body) in scene.bodies.iter().enumerate() {
        let line = sub(at, body.centre());
        let far = reach + extra_m(body, &robots.places[i], limits);
        if dot(line, line) >= far * far {
            continue;
        }
        let (distance_m, n, coming_m_per_s) = body.clearance(at);
        let source = Source::Obstacle {
            pushable: body.pushable,
            index: body.index,
        };
        against(
            i,
            [OBSTACLES, item as u64],
            source,
            distance_m,
            n,
            coming_m_per_s,
            robots,
            limits,
            rows,
        );
    }
}

/// Rows against what others move; see [`super::moving`].
fn moving(i: usize, at: Vector, robots: &Robots, scene: &Scene, limits: &Limits, rows: &mut Vec<Row>) {
    let place = &robots.places[i];
    for (item, disc) in scene.moving.iter().enumerate() {
        let line = sub(at, disc.position_m);
        let distance_m = length(line);
        let n = if distance_m < COINCIDENT_M {
            [1.0, 0.0]
        } else {
            scale(line, 1.0 / distance_m)
        };
        let other = disc.place(place);
        let (swerve_m, pushed_m_per_s) = disc.pushed(place, limits);
        let kept_m = limits.robot_margin_m + 2.0 * limits.pose_error_m;
        let free_m = distance_m - place.radius_m - disc.radius_m - kept_m;
        let gap_m = free_m - lost_m(place, &other, n, limits) - swerve_m;
        let approach = approach_m_per_s(gap_m, limits);
        let bound = bound_against_pushed(approach, dot(n, disc.velocity_m_per_s), pushed_m_per_s);
        let source = Source::Moving(disc.id);
        alone(
            i,
            [MOVING, item as u64],
            source,
            [free_m, gap_m, bound],
            n,
            robots,
            limits,
            rows,
        );
    }
}

/// No second robot: walls, fence, obstacles and own limits.
pub fn is_single(row: &Row) -> bool {
    row.robots[1] == NOBODY
}
