//! All robots on one floor between four walls: bumpers are spring-dampers, so nothing passes through anything.

use super::body::{Body, Drive, Ground, Push};
use super::contents::PlantContents;
use super::{SUBSTEPS, Step, TICK_HZ};
use crate::hidden::HiddenFloor;

/// Natural frequency of two bodies that touch; sets the stiffness by their masses.
const BUMPER_RAD_PER_S: f64 = 500.0;
const BUMPER_DAMPING_RATIO: f64 = 0.3;
const BUMPER_FRICTION: f64 = 0.2;
const BUMPER_FRICTION_HALF_M_PER_S: f64 = 0.05;
/// Pairs further apart than this at the start of a tick cannot touch within it (48 m/s).
const NEAR_M: f64 = 0.1;

/// The floor and its walls; the origin is at the centre.
#[derive(Debug, Clone)]
pub struct Arena {
    pub width_m: f64,
    pub height_m: f64,
    pub floor: HiddenFloor,
    pub contents: PlantContents,
}

/// A robot in the arena, and what moves it.
#[derive(Debug)]
pub struct Occupant<'a> {
    pub body: &'a mut Body,
    pub drive: Drive,
    /// Motor control that samples more often than the firmware steps.
    pub stage: Option<&'a mut dyn MotorStage>,
}

/// Motor control between two firmware steps.
pub trait MotorStage: std::fmt::Debug {
    /// Samples in a firmware step; the first is the firmware's own.
    fn samples_per_tick(&self) -> u32;

    /// Voltages until the next sample.
    fn sample(&mut self, body: &Body) -> [f64; robot::MAX_MOTORS];
}

impl Occupant<'_> {
    /// Lets the motor control sample when one falls on this step: sample `j` of `k` on step `ceil(j n / k)`.
    fn control(&mut self, step: u32, steps: u32) {
        let Some(stage) = &mut self.stage else { return };
        let samples = stage.samples_per_tick();
        if step > 0 && step * samples / steps > (step - 1) * samples / steps {
            self.drive.motor_v = Some(stage.sample(self.body));
        }
    }
}

/// One point where a bumper is pressed in.
pub(super) struct Touch {
    depth_m: f64,
    /// Unit vector out of the other body.
    normal: [f64; 2],
    /// Velocity against the other body at the point.
    velocity_m_per_s: [f64; 2],
    mass_kg: f64,
}

impl Touch {
    /// Against something that does not move.
    pub(super) fn fixed(body: &Body, depth_m: f64, normal: [f64; 2]) -> Self {
        Self {
            depth_m,
            normal,
            velocity_m_per_s: point_velocity(body, normal),
            mass_kg: body.mass_kg,
        }
    }

    pub(super) fn press(&self, body: &Body, push: &mut Push) {
        add(push, body, self.force_n(), self.normal);
    }

    fn force_n(&self) -> [f64; 2] {
        let ([nx, ny], [vx, vy]) = (self.normal, self.velocity_m_per_s);
        let opening_m_per_s = vx * nx + vy * ny;
        let sliding_m_per_s = vy * nx - vx * ny;
        let stiffness = self.mass_kg * BUMPER_RAD_PER_S * BUMPER_RAD_PER_S;
        let damping = 2.0 * BUMPER_DAMPING_RATIO * self.mass_kg * BUMPER_RAD_PER_S;
        let pressing_n = (stiffness * self.depth_m - damping * opening_m_per_s).max(0.0);
        let rubbing_n =
            -BUMPER_FRICTION * pressing_n * sliding_m_per_s / (sliding_m_per_s.abs() + BUMPER_FRICTION_HALF_M_PER_S);
        [pressing_n * nx - rubbing_n * ny, pressing_n * ny + rubbing_n * nx]
    }
}

impl Arena {
    /// Moves all occupants by one firmware tick.
    pub fn tick(&self, occupants: &mut [Occupant<'_>]) {
        self.tick_in(occupants, SUBSTEPS);
    }

    /// The same in a chosen number of steps, to see the step's influence.
    pub fn tick_in(&self, occupants: &mut [Occupant<'_>], substeps: u32) {
        let step = Step {
            dt_s: 1.0 / f64::from(TICK_HZ * substeps),
        };
        let near = near_pairs(occupants);
        let mut pushes = vec![Push::default(); occupants.len()];
        for index in 0..substeps {
            for occupant in occupants.iter_mut() {
                occupant.control(index, substeps);
            }
            for (push, occupant) in pushes.iter_mut().zip(occupants.iter()) {
                *push = self.wall_push(occupant.body);
            }
            for &(a, b) in &near {
                press_apart(occupants, &mut pushes, a, b);
            }
            for (occupant, push) in occupants.iter_mut().zip(&pushes) {
                let ground = Ground {
                    floor: &self.floor,
                    contents: &self.contents,
                };
                occupant.body.step(&occupant.drive, &ground, push, step);
            }
        }
    }

    fn wall_push(&self, body: &Body) -> Push {
        let pose = body.pose();
        let (right, top) = (self.width_m / 2.0 - body.radius_m, self.height_m / 2.0 - body.radius_m);
        let mut push = Push::default();
        let walls = [
            (pose.x_m - right, [-1.0, 0.0]),
            (-pose.x_m - right, [1.0, 0.0]),
            (pose.y_m - top, [0.0, -1.0]),
            (-pose.y_m - top, [0.0, 1.0]),
        ];
        for (depth_m, normal) in walls {
            if depth_m > 0.0 {
                Touch::fixed(body, depth_m, normal).press(body, &mut push);
            }
        }
        self.contents.press(body, &mut push);
        push
    }
}

fn near_pairs(occupants: &[Occupant<'_>]) -> Vec<(usize, usize)> {
    let circles: Vec<_> = occupants
        .iter()
        .map(|occupant| (occupant.body.pose(), occupant.body.radius_m))
        .collect();
    let mut near = Vec::new();
    for (a, (pose_a, radius_a)) in circles.iter().enumerate() {
        for (b, (pose_b, radius_b)) in circles.iter().enumerate().skip(a + 1) {
            if (pose_a.x_m - pose_b.x_m).hypot(pose_a.y_m - pose_b.y_m) < radius_a + radius_b + NEAR_M {
                near.push((a, b));
            }
        }
    }
    near
}

fn press_apart(occupants: &[Occupant<'_>], pushes: &mut [Push], a: usize, b: usize) {
    let (Some(body_a), Some(body_b)) = (occupants.get(a).map(|o| &*o.body), occupants.get(b).map(|o| &*o.body)) else {
        return;
    };
    let (pose_a, pose_b) = (body_a.pose(), body_b.pose());
    let (dx, dy) = (pose_a.x_m - pose_b.x_m, pose_a.y_m - pose_b.y_m);
    let distance_m = dx.hypot(dy);
    let depth_m = body_a.radius_m + body_b.radius_m - distance_m;
    if depth_m <= 0.0 {
        return;
    }
    let normal = if distance_m > 1e-9 {
        [dx / distance_m, dy / distance_m]
    } else {
        [1.0, 0.0]
    };
    let away = normal.map(|component| -component);
    let (va, vb) = (point_velocity(body_a, normal), point_velocity(body_b, away));
    let mass_kg = body_a.mass_kg * body_b.mass_kg / (body_a.mass_kg + body_b.mass_kg);
    let force_n = Touch {
        depth_m,
        normal,
        velocity_m_per_s: [va[0] - vb[0], va[1] - vb[1]],
        mass_kg,
    }
    .force_n();
    if let Some(push) = pushes.get_mut(a) {
        add(push, body_a, force_n, normal);
    }
    if let Some(push) = pushes.get_mut(b) {
        add(push, body_b, force_n.map(|component| -component), away);
    }
}

/// Where a bumper touches, from the body origin: opposite to the normal.
fn touch_arm_m(body: &Body, normal: [f64; 2]) -> [f64; 2] {
    normal.map(|component| -component * body.radius_m)
}

fn point_velocity(body: &Body, normal: [f64; 2]) -> [f64; 2] {
    let ([vx, vy], [ax, ay], r) = (
        body.velocity_m_per_s(),
        touch_arm_m(body, normal),
        body.yaw_rate_rad_per_s(),
    );
    [vx - r * ay, vy + r * ax]
}

fn add(push: &mut Push, body: &Body, force_n: [f64; 2], normal: [f64; 2]) {
    let ([ax, ay], [lx, ly]) = (touch_arm_m(body, normal), body.lever_m());
    let [fx, fy] = force_n;
    push.force_n[0] += fx;
    push.force_n[1] += fy;
    push.moment_n_m += (ax + lx) * fy - (ay + ly) * fx;
}
