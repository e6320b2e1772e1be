//! How runs are driven: a catalogue of manoeuvres for every chassis, put together anew for each run so that it stays on the
//! floor, and a task in a closed loop.

use crate::drive::SET_POINTS_HZ;
use crate::firmware::SetPoint;
use emulator::noise::Noise;
use emulator::plant::Pose;
use twin::robot::Robot;
use twin::twist::BodyTwist;

/// What a run is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Style {
    /// The whole catalogue.
    Rich,
    /// Ramps, circles and straights, nothing sudden.
    Smooth,
    /// Steps, spins, starts and stops.
    Brisk,
    /// Slowly straight on and back: hardly anything shows.
    Poor,
}

/// Half of the floor that is planned for.
const HALF_M: [f64; 2] = [1.3, 1.0];
/// Acceleration of set-points where no step is wanted.
const RAMP_M_PER_S2: f64 = 1.6;
const RAMP_RAD_PER_S2: f64 = 6.0;
const POOR_RAMP_M_PER_S2: f64 = 0.25;
/// Most curvature that cars are asked for.
const CURVATURE_PER_M: f64 = 1.7;
/// Share of the speed at which an unloaded robot ends that is asked for.
const FAST_SHARE: f64 = 0.75;
/// Pieces that are looked at for each place.
const CHOICES: usize = 16;

#[derive(Debug, Clone, Copy)]
enum Piece {
    Rest,
    /// Forward, left, yaw rate, held.
    Hold([f64; 3]),
    /// The same, from nothing to full and back.
    Swell([f64; 3]),
    /// On and off.
    StartStop([f64; 3]),
    /// The turn changes its sign.
    Slalom([f64; 3]),
}

impl Piece {
    /// Wanted velocity at a share of the piece.
    fn at(&self, share: f64, time_s: f64) -> [f64; 3] {
        match *self {
            Piece::Rest => [0.0; 3],
            Piece::Hold(twist) => twist,
            Piece::Swell(twist) => twist.map(|v| v * (std::f64::consts::PI * share).sin()),
            Piece::StartStop(twist) => twist.map(|v| {
                if ((time_s / 0.35) as u32).is_multiple_of(2) {
                    v
                } else {
                    0.0
                }
            }),
            Piece::Slalom([u, v, r]) => [u, v, r * (std::f64::consts::TAU * time_s / 0.8).sin()],
        }
    }
}

/// Speed of the rim at which the motors' voltage is used up.
fn no_load_m_per_s(robot: &Robot) -> f64 {
    let wheel = robot.description().wheels.iter().find(|wheel| wheel.driven);
    let radius_m = wheel.and_then(|wheel| wheel.radius_m).unwrap_or(f64::INFINITY);
    let motor = robot.description().motor.as_ref();
    motor.map_or(f64::INFINITY, |motor| {
        radius_m * motor.supply_v / (motor.gear_ratio * motor.torque_constant_n_m_per_a)
    })
}

/// Draws one manoeuvre.
fn piece(robot: &Robot, style: Style, noise: &mut Noise) -> Piece {
    let omni = robot.chassis() == "omni4";
    let car = robot.description().steering.is_some();
    let kind = noise.uniform();
    let mut sided = |least: f64, most: f64| {
        let size = least * (most / least).powf(noise.uniform());
        if noise.uniform() < 0.5 { -size } else { size }
    };
    if style == Style::Poor {
        return Piece::Swell([sided(0.1, 0.3), 0.0, 0.0]);
    }
    let fast = (FAST_SHARE * no_load_m_per_s(robot)).min(if style == Style::Smooth { 0.7 } else { 1.6 });
    let turn = |u: f64, r: f64| if car { u * (r / 2.4 * CURVATURE_PER_M) } else { r };
    let u = sided(0.15, fast);
    let r = turn(u, sided(0.3, 2.4));
    let left = if omni { sided(0.15, 0.9) } else { 0.0 };
    let slow = sided(0.03, 0.12);
    let spin = if car {
        [slow, 0.0, turn(slow, 2.4)]
    } else {
        [0.0, 0.0, sided(0.5, 3.0)]
    };
    let pick = |choices: &[Piece]| choices[((kind * choices.len() as f64) as usize).min(choices.len() - 1)];
    let smooth = [
        Piece::Hold([u, 0.0, 0.0]),
        Piece::Swell([u, 0.0, r]),
        Piece::Hold([u, 0.0, r]),
        Piece::Swell([u, left, 0.0]),
        Piece::Swell([slow, 0.0, 0.0]),
    ];
    let brisk = [
        Piece::Hold([u, 0.0, 0.0]),
        Piece::Hold(spin),
        Piece::Hold([u, left, r]),
        Piece::StartStop([u, 0.0, 0.0]),
        Piece::StartStop([0.5 * u, left, 0.5 * r]),
        Piece::Slalom([u, 0.0, r]),
    ];
    match style {
        Style::Smooth => pick(&smooth),
        Style::Brisk => pick(&brisk),
        _ => pick(&[
            smooth[0], smooth[1], smooth[2], smooth[3], smooth[4], brisk[1], brisk[2], brisk[3], brisk[4], brisk[5],
        ]),
    }
}

/// Set-points of a run from `start`, one for every 1/120 s.
pub fn plan(robot: &Robot, style: Style, start: Pose, seconds: u32, noise: &mut Noise) -> Vec<SetPoint> {
    let wanted = (seconds * SET_POINTS_HZ) as usize;
    let mut at = ([start.x_m, start.y_m, start.yaw_rad], [0.0; 3]);
    let mut twists: Vec<[f64; 3]> = Vec::new();
    while twists.len() < wanted {
        let rest = twists.len() < SET_POINTS_HZ as usize || noise.uniform() < 0.08;
        let duration_s = if rest { 0.8 } else { 0.9 + 1.1 * noise.uniform() };
        let sudden = style == Style::Brisk || (style == Style::Rich && noise.uniform() < 0.4);
        let mut best: Option<Followed> = None;
        for _ in 0..CHOICES {
            let choice = if rest { Piece::Rest } else { piece(robot, style, noise) };
            let ramps = match (style, sudden) {
                (Style::Poor, _) => [POOR_RAMP_M_PER_S2, POOR_RAMP_M_PER_S2, 1.0],
                (_, true) => [1e3; 3],
                _ => [RAMP_M_PER_S2, RAMP_M_PER_S2, RAMP_RAD_PER_S2],
            };
            let followed = follow(choice, duration_s, ramps, at);
            let good = rest || followed.2 == 0.0;
            if best.as_ref().is_none_or(|best| followed.2 < best.2) {
                best = Some(followed);
            }
            if good {
                break;
            }
        }
        let Some((path, end, _)) = best else { break };
        twists.extend(path);
        at = end;
    }
    twists.truncate(wanted);
    let mut steering_rad = 0.0;
    twists
        .iter()
        .map(|twist| set_point(robot, *twist, &mut steering_rad))
        .collect()
}

/// Pose and velocity.
type State = ([f64; 3], [f64; 3]);
/// Velocities, the end, and how far the path leaves the floor.
type Followed = (Vec<[f64; 3]>, State, f64);

/// Velocities of a piece, where it ends, and how far it leaves the floor.
fn follow(piece: Piece, duration_s: f64, ramps: [f64; 3], from: State) -> Followed {
    let dt_s = 1.0 / f64::from(SET_POINTS_HZ);
    let count = (duration_s / dt_s) as usize;
    let ([mut x, mut y, mut yaw], mut now) = from;
    let (mut path, mut outside) = (Vec::with_capacity(count), 0.0_f64);
    for step in 0..count {
        let goal = piece.at(step as f64 / count as f64, step as f64 * dt_s);
        for axis in 0..3 {
            let most = ramps[axis] * dt_s;
            now[axis] += (goal[axis] - now[axis]).clamp(-most, most);
        }
        let (sin, cos) = yaw.sin_cos();
        x += dt_s * (cos * now[0] - sin * now[1]);
        y += dt_s * (sin * now[0] + cos * now[1]);
        yaw += dt_s * now[2];
        outside = outside.max(x.abs() - HALF_M[0]).max(y.abs() - HALF_M[1]);
        path.push(now);
    }
    (path, ([x, y, yaw], now), outside)
}

/// Wheels and steering for a velocity, by the nominal geometry.
fn set_point(robot: &Robot, [u, v, r]: [f64; 3], steering_rad: &mut f64) -> SetPoint {
    let twist = BodyTwist {
        forward_m_per_s: u,
        left_m_per_s: v,
        yaw_rate_rad_per_s: r,
    };
    let command = robot.wheel_speeds_holding(twist, *steering_rad);
    *steering_rad = command.steering_rad;
    let mut out = SetPoint {
        steering_rad: command.steering_rad,
        ..SetPoint::default()
    };
    let driven = (0..robot.wheel_count()).filter(|wheel| robot.description().wheels[*wheel].driven);
    for (to, wheel) in out.wheel_rad_per_s.iter_mut().zip(driven) {
        *to = command.wheel_rad_per_s[wheel];
    }
    out
}

/// Set-points until a goal that cannot be reached is given up.
const GIVEN_UP: u32 = 5 * SET_POINTS_HZ;

/// A task: to one point of the floor after the other, in a closed loop over the pose.
pub struct Task<'a> {
    robot: &'a Robot,
    goal_m: [f64; 2],
    noise: Noise,
    steering_rad: f64,
    speed_m_per_s: f64,
    /// Set-points since the goal was set.
    age: u32,
    backward: bool,
}

impl<'a> Task<'a> {
    pub fn new(robot: &'a Robot, seed: u64) -> Self {
        Self {
            robot,
            goal_m: [0.0; 2],
            noise: Noise::new(seed, 7),
            steering_rad: 0.0,
            speed_m_per_s: 0.0,
            age: GIVEN_UP,
            backward: false,
        }
    }

    /// The set-point at a pose.
    pub fn command(&mut self, pose: Pose) -> SetPoint {
        let far = |goal: [f64; 2]| (goal[0] - pose.x_m).hypot(goal[1] - pose.y_m);
        let (sin, cos) = pose.yaw_rad.sin_cos();
        self.age += 1;
        while self.age > GIVEN_UP || far(self.goal_m) < 0.15 {
            self.goal_m = [2.0 * (self.noise.uniform() - 0.5), 1.4 * (self.noise.uniform() - 0.5)];
            self.age = 0;
            self.backward = cos * (self.goal_m[0] - pose.x_m) + sin * (self.goal_m[1] - pose.y_m) < 0.0;
        }
        let [dx, dy] = [self.goal_m[0] - pose.x_m, self.goal_m[1] - pose.y_m];
        let (ahead, left) = (cos * dx + sin * dy, cos * dy - sin * dx);
        let most = 0.6_f64.min(1.5 * far(self.goal_m) + 0.1);
        let twist = if self.robot.chassis() == "omni4" {
            let scale = most / far(self.goal_m);
            [scale * ahead, scale * left, (left.atan2(ahead)).clamp(-1.0, 1.0)]
        } else {
            let way = if self.backward { -1.0 } else { 1.0 };
            let bearing = (way * left).atan2(way * ahead);
            let car = self.robot.description().steering.is_some();
            let wanted = way * most * if car { 1.0 } else { bearing.cos().max(0.0) };
            self.speed_m_per_s += (wanted - self.speed_m_per_s).clamp(-0.02, 0.02);
            let turn = (2.0 * bearing).clamp(-1.8, 1.8);
            let limit = CURVATURE_PER_M * self.speed_m_per_s.abs();
            [
                self.speed_m_per_s,
                0.0,
                if car { turn.clamp(-limit, limit) } else { turn },
            ]
        };
        set_point(self.robot, twist, &mut self.steering_rad)
    }
}
