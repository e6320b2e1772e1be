//! Effects that change from step to step, and the state they carry.

mod gear;
mod settle;
mod start;

use wide::f64x4;

use super::Effect;
use super::command::CommandStage;
use crate::command::WheelCommand;
use crate::lanes::{LANES, four};
use crate::model::{Model, Push};
use crate::motor_control::Drives;
use crate::residual::{Observation, Residual};
use crate::state::BodyState;
use crate::world::floor::Floor;
use crate::{GRAVITY_M_PER_S2, MAX_WHEELS, PHYSICS_PERIOD_S, SLIP_SCALE_M_PER_S, SUBSTEPS, kinematics, math};
use std::sync::Arc;

/// Wheel speed that rounds the sign of spin in [`Law::Asymmetric`], rad/s; that of the dry friction.
const SPIN_SIGN_RAD_PER_S: f64 = crate::COULOMB_SCALE_RAD_PER_S;
/// Rate that rounds the sign of a caster's swivelling, rad/s.
const SWIVEL_SIGN_RAD_PER_S: f64 = 0.5;
/// Share of the nominal supply that sag and droop leave at least.
const LEAST_SUPPLY: f64 = 0.5;

/// What an effect list asks of every physics step.
#[derive(Debug, Clone, Default)]
pub(crate) struct Dynamics {
    commands: Vec<CommandStage>,
    laws: Vec<(Law, usize)>,
    /// Its words stand behind those of the laws.
    residual: Option<(Arc<Residual>, usize)>,
    words: usize,
}

#[derive(Debug, Clone)]
enum Law {
    Stribeck {
        ratio: f64,
        speed_rad_per_s: f64,
    },
    Asymmetric {
        difference: f64,
    },
    Sag {
        resistance_ohm: f64,
    },
    Droop {
        rate_v_per_s: f64,
    },
    Patch {
        x_m: f64,
        y_m: f64,
        radius_m: f64,
        scale: f64,
    },
    Regions(Floor),
    Tilt {
        x_rad: f64,
        y_rad: f64,
    },
    SteeringPlay {
        half_rad: f64,
    },
    RollerDrag {
        per_wheel_n_s_per_m: f64,
    },
    Eccentricity {
        lane: usize,
        amplitude: f64,
        phase_rad: f64,
    },
    Grain {
        force_n: f64,
        along: [f64; 2],
    },
    Cable {
        stiffness_n_per_m: f64,
        x_m: f64,
        y_m: f64,
        slack_m: f64,
    },
    Thermal {
        relative: f64,
        share: f64,
    },
    RollingResistance {
        coefficient: f64,
    },
    GearPlay {
        half_rad: f64,
    },
    CasterSwivel {
        trail_m: f64,
        torque_n_m: f64,
    },
}

impl Dynamics {
    /// `None` when no effect of the list changes from step to step, the steering has no filter and there is no residual.
    pub(crate) fn new(
        model: &Model,
        effects: &[Effect],
        steering_filter_s: f64,
        residual: Option<Arc<Residual>>,
    ) -> Option<Dynamics> {
        let mut dynamics = Dynamics::default();
        for effect in effects {
            if let Some(stage) = CommandStage::new(effect, dynamics.words) {
                dynamics.words += stage.words();
                dynamics.commands.push(stage);
            } else if let Some(law) = Law::new(model, effect) {
                let at = dynamics.words;
                dynamics.words += law.words();
                dynamics.laws.push((law, at));
            }
        }
        if let Some(stage) = CommandStage::steering_filter(steering_filter_s, dynamics.words) {
            dynamics.words += stage.words();
            dynamics.commands.push(stage);
        }
        if let Some(residual) = residual {
            let at = dynamics.words;
            dynamics.words += residual.words();
            dynamics.residual = Some((residual, at));
        }
        let anything = !dynamics.commands.is_empty() || !dynamics.laws.is_empty() || dynamics.residual.is_some();
        anything.then_some(dynamics)
    }

    /// Whether wheel radii change from step to step.
    pub(crate) fn changes_radii(&self) -> bool {
        let mut laws = self.laws.iter();
        laws.any(|(law, _)| matches!(law, Law::Eccentricity { .. }))
    }

    /// The same on a floor with regions or tilt.
    pub(crate) fn on_floor(mut self, floor: &Floor) -> Dynamics {
        if !floor.is_even() {
            self.laws.push((Law::Regions(floor.clone()), self.words));
        }
        if floor.is_tilted() {
            let tilt = Law::Tilt {
                x_rad: floor.tilt_x_rad,
                y_rad: floor.tilt_y_rad,
            };
            self.laws.push((tilt, self.words));
        }
        self
    }
}

impl Law {
    fn new(model: &Model, effect: &Effect) -> Option<Law> {
        let value = |name: &str| effect.value(name);
        Some(match effect.name.as_str() {
            "stribeck_friction" => Law::Stribeck {
                ratio: value("ratio"),
                speed_rad_per_s: value("speed"),
            },
            "asymmetric_friction" => Law::Asymmetric {
                difference: value("difference"),
            },
            "battery_sag" => Law::Sag {
                resistance_ohm: value("resistance"),
            },
            "battery_droop" => Law::Droop {
                rate_v_per_s: value("rate"),
            },
            "low_friction_patch" => Law::Patch {
                x_m: value("x"),
                y_m: value("y"),
                radius_m: value("radius"),
                scale: value("scale"),
            },
            "floor_tilt" => Law::Tilt {
                x_rad: value("x"),
                y_rad: value("y"),
            },
            "steering_backlash" => Law::SteeringPlay {
                half_rad: 0.5 * value("play"),
            },
            "roller_drag" => Law::RollerDrag {
                per_wheel_n_s_per_m: value("per_wheel"),
            },
            "wheel_eccentricity" => Law::Eccentricity {
                lane: effect.index.and_then(|index| model.lane_of_wheel(index))?,
                amplitude: value("amplitude"),
                phase_rad: value("phase"),
            },
            "carpet_grain" => {
                let (sin, cos) = libm::sincos(value("direction"));
                Law::Grain {
                    force_n: value("force"),
                    along: [cos, sin],
                }
            }
            "cable_drag" => Law::Cable {
                stiffness_n_per_m: value("stiffness"),
                x_m: value("x"),
                y_m: value("y"),
                slack_m: value("slack"),
            },
            "thermal_drift" => Law::Thermal {
                relative: value("relative"),
                share: 1.0 - libm::exp(-PHYSICS_PERIOD_S / value("time_constant")),
            },
            "rolling_resistance" => Law::RollingResistance {
                coefficient: value("coefficient"),
            },
            "gear_backlash" => Law::GearPlay {
                half_rad: 0.5 * value("play"),
            },
            "caster_swivel" => Law::CasterSwivel {
                trail_m: value("trail"),
                torque_n_m: value("torque"),
            },
            _ => return None,
        })
    }

    /// Numbers that the law remembers.
    fn words(&self) -> usize {
        match self {
            Law::SteeringPlay { .. } => 1,
            Law::Thermal { .. } | Law::CasterSwivel { .. } => MAX_WHEELS,
            Law::GearPlay { .. } => gear::WORDS,
            _ => 0,
        }
    }
}

/// One robot's effects and motor controllers in motion.
#[derive(Debug, Clone)]
pub(crate) struct Runtime {
    dynamics: Dynamics,
    /// The geometry the robot works with.
    nominal: Arc<Model>,
    /// Constants without the effects of the moment.
    base: Arc<Model>,
    /// Constants of this step.
    pub(crate) live: Box<Model>,
    /// Collision of this step; none outside of one.
    pub(crate) push: Push,
    /// Motor control that the description spells out.
    pub(crate) drives: Option<Drives>,
    /// Twist of rolling besides the set-points, from outside.
    pub(crate) shift: [f64; 3],
    memory: Vec<f64>,
    /// The set-point of this physics step in front of all stages.
    sent: WheelCommand,
    step: u64,
}

impl Runtime {
    pub(crate) fn new(dynamics: Dynamics, drives: Option<Drives>, nominal: &Arc<Model>, base: &Arc<Model>) -> Runtime {
        Runtime {
            nominal: Arc::clone(nominal),
            live: Box::new(Model::clone(base)),
            base: Arc::clone(base),
            push: Push::default(),
            shift: [0.0; 3],
            memory: vec![0.0; dynamics.words],
            dynamics,
            drives,
            sent: WheelCommand::default(),
            step: 0,
        }
    }

    /// Numbers beyond the body's own that the next step or a view depends on.
    pub(crate) fn words(&self) -> impl Iterator<Item = f64> + '_ {
        let supply_v = self.live.motor.as_ref().map_or(0.0, |motor| motor.supply_v);
        [self.step as f64, supply_v]
            .into_iter()
            .chain(self.memory.iter().copied())
            .chain(self.drives.iter().flat_map(Drives::words))
    }

    pub(crate) fn word_count(&self) -> usize {
        2 + self.memory.len() + self.drives.as_ref().map_or(0, Drives::word_count)
    }

    /// Inverse of [`Runtime::words`]; `words` must be as many.
    ///
    /// - `state`: restored before.
    pub(crate) fn restore(&mut self, words: &[f64], state: &BodyState) {
        self.step = words[0] as u64;
        let (memory, rest) = words[2..].split_at(self.memory.len());
        self.memory.copy_from_slice(memory);
        if let Some(drives) = &mut self.drives {
            drives.restore(rest);
        }
        *self.live = Model::clone(&self.base);
        // What a view shows between steps: supply and gears.
        if let Some(motor) = &mut self.live.motor {
            motor.set_supply(words[1]);
        }
        for (law, at) in &self.dynamics.laws {
            if matches!(law, Law::GearPlay { .. }) {
                gear::show(
                    &mut self.memory[*at..at + law.words()],
                    &self.base,
                    &mut self.live,
                    state,
                );
            }
        }
    }

    /// Turns the set-point of this physics step into what leaves the last stage.
    pub(crate) fn command(&mut self, command: &mut WheelCommand) {
        self.sent = *command;
        for stage in &self.dynamics.commands {
            stage.apply(command, &self.nominal, &mut self.memory, self.step);
        }
    }

    /// Adds to the set-point what the residual and the outside add; after [`Runtime::prepare`].
    pub(crate) fn shift(&self, command: &mut WheelCommand) {
        let mut shift = self.shift;
        if let Some((residual, at)) = &self.dynamics.residual {
            let own = residual.shift(&self.memory[*at..at + residual.words()]);
            shift.iter_mut().zip(own).for_each(|(sum, own)| *sum += own);
        }
        if shift != [0.0; 3] {
            *command = kinematics::shifted(&self.nominal, *command, shift);
        }
    }

    /// Sets the constants of the coming physics step from the state at its start.
    #[inline(never)]
    pub(crate) fn prepare(&mut self, state: &BodyState) {
        self.evaluate_residual(state);
        let (live, base) = (&mut self.live, &self.base);
        live.coulomb_n_m = base.coulomb_n_m;
        live.viscous_n_m_s = base.viscous_n_m_s;
        live.radius_m = base.radius_m;
        live.friction = base.friction;
        live.per_ohm = base.per_ohm;
        live.powered = base.powered;
        live.wheel_steering = base.wheel_steering;
        live.body_force = self.push.force;
        live.gravity_m_per_s2 = self.push.m_per_s2;
        self.set_supply(state);
        let laws = core::mem::take(&mut self.dynamics.laws);
        for (law, at) in &laws {
            self.apply(law, *at, state);
        }
        self.dynamics.laws = laws;
        if let Some((_, at)) = &self.dynamics.residual {
            let live = &mut self.live;
            live.body_force[0] += live.mass_kg * self.memory[*at];
            live.body_force[1] += live.mass_kg * self.memory[at + 1];
            live.body_force[2] += live.yaw_inertia_kg_m2 * self.memory[at + 2];
        }
        self.live.refreeze();
        self.step += 1;
    }

    /// What goes on besides the body's own equations, at the end of a physics step.
    #[inline(never)]
    pub(crate) fn finish(&mut self, state: &mut BodyState, command: &WheelCommand) {
        for (law, at) in &self.dynamics.laws {
            if let Law::GearPlay { half_rad } = law {
                let memory = &mut self.memory[*at..at + law.words()];
                gear::finish(memory, *half_rad, &self.base, &mut self.live, state, command);
            }
        }
    }

    /// At the start of a control tick: accelerations from what a view shows then and the set-points of the tick.
    fn evaluate_residual(&mut self, state: &BodyState) {
        let Some((residual, at)) = &self.dynamics.residual else {
            return;
        };
        if self.step.is_multiple_of(u64::from(SUBSTEPS)) {
            let seen = Observation::of(&self.nominal, &self.base, &state.view(&self.live), &self.sent);
            let memory = &mut self.memory[*at..at + residual.words()];
            residual.tick(&seen, memory, self.step == 0);
        }
    }

    /// Battery voltage at the currents of the step before.
    fn set_supply(&mut self, state: &BodyState) {
        let Some(motor) = &self.base.motor else { return };
        let nominal_v = motor.supply_v;
        let least_v = LEAST_SUPPLY * nominal_v;
        let (mut open_v, mut resistance_ohm) = (nominal_v, 0.0);
        for (law, _) in &self.dynamics.laws {
            match law {
                Law::Droop { rate_v_per_s } => open_v -= rate_v_per_s * self.step as f64 * PHYSICS_PERIOD_S,
                Law::Sag { resistance_ohm: more } => resistance_ohm += more,
                _ => {}
            }
        }
        open_v = open_v.max(least_v);
        let mut supply_v = open_v;
        if resistance_ohm > 0.0 {
            let mut power_w = 0.0;
            for lane in 0..self.base.lanes {
                power_w += state.voltage[lane] * state.current[lane];
            }
            // bus = V0 - R P / bus
            let root = open_v * open_v - 4.0 * resistance_ohm * power_w;
            supply_v = (0.5 * (open_v + root.max(0.0).sqrt())).max(least_v);
        }
        if let Some(motor) = &mut self.live.motor {
            motor.set_supply(supply_v);
        }
    }

    fn apply(&mut self, law: &Law, at: usize, state: &BodyState) {
        let live = &mut self.live;
        let memory = &mut self.memory[at..at + law.words()];
        match law {
            Law::Sag { .. } | Law::Droop { .. } => {}
            Law::Stribeck { ratio, speed_rad_per_s } => {
                let q = four(&state.wheel) * f64x4::splat(1.0 / speed_rad_per_s);
                // e^-x = 1 / (1 + (e^x - 1))
                let bell =
                    f64x4::splat(1.0) / (f64x4::splat(1.0) + math::exp_m1_of_double(f64x4::splat(0.5) * (q * q)));
                let factor = f64x4::splat(1.0) + f64x4::splat(ratio - 1.0) * bell;
                scale(&mut live.coulomb_n_m, factor);
            }
            Law::Asymmetric { difference } => {
                let sign = math::tanh_of(four(&state.wheel) * f64x4::splat(1.0 / SPIN_SIGN_RAD_PER_S));
                let factor = f64x4::splat(1.0) + f64x4::splat(*difference) * sign;
                scale(&mut live.coulomb_n_m, factor);
                scale(&mut live.viscous_n_m_s, factor);
            }
            Law::Patch {
                x_m,
                y_m,
                radius_m,
                scale,
            } => {
                for lane in 0..live.lanes {
                    let [wheel_x, wheel_y] = world_point(state, live.x_m[lane], live.y_m[lane]);
                    let (dx, dy) = (wheel_x - x_m, wheel_y - y_m);
                    if dx * dx + dy * dy < radius_m * radius_m {
                        live.friction[lane] *= scale;
                    }
                }
            }
            Law::Regions(floor) => {
                for lane in 0..live.lanes {
                    let [wheel_x, wheel_y] = world_point(state, live.x_m[lane], live.y_m[lane]);
                    live.friction[lane] *= floor.friction_scale(wheel_x, wheel_y);
                }
            }
            Law::Tilt { x_rad, y_rad } => {
                let [x, y] = body_vector(state, GRAVITY_M_PER_S2 * x_rad, GRAVITY_M_PER_S2 * y_rad);
                live.gravity_m_per_s2[0] += x;
                live.gravity_m_per_s2[1] += y;
                live.body_force[0] += live.mass_kg * x;
                live.body_force[1] += live.mass_kg * y;
            }
            Law::SteeringPlay { half_rad } => {
                // The wheels' angle before offset and scale: dragged along at the ends of the play.
                memory[0] = memory[0]
                    .max(state.steering_rad - half_rad)
                    .min(state.steering_rad + half_rad);
                live.wheel_steering.shift_rad += memory[0] - state.steering_rad;
            }
            Law::RollerDrag { per_wheel_n_s_per_m } => {
                for lane in (0..live.lanes).filter(|lane| live.omni[*lane]) {
                    let (cos, sin) = (live.geometry.cos[lane], live.geometry.sin[lane]);
                    let arm = live.geometry.arm_across_m[lane];
                    let across = cos * state.v - sin * state.u + arm * state.r;
                    let force = -per_wheel_n_s_per_m * across;
                    live.body_force[0] += -sin * force;
                    live.body_force[1] += cos * force;
                    live.body_force[2] += arm * force;
                }
            }
            Law::Eccentricity {
                lane,
                amplitude,
                phase_rad,
            } => {
                let angle = state.angle[*lane] * live.encoder[*lane];
                live.radius_m[*lane] *= 1.0 + amplitude * libm::sin(angle + phase_rad);
            }
            Law::Grain { force_n, along } => {
                let [x, y] = world_vector(state, state.u, state.v);
                let speed = x * along[0] + y * along[1];
                let force = -force_n * libm::tanh(speed / SLIP_SCALE_M_PER_S);
                let [x, y] = body_vector(state, force * along[0], force * along[1]);
                live.body_force[0] += x;
                live.body_force[1] += y;
            }
            Law::Cable {
                stiffness_n_per_m,
                x_m,
                y_m,
                slack_m,
            } => {
                // Fastened at the body origin.
                let [origin_x, origin_y] = world_point(state, -live.com_m[0], -live.com_m[1]);
                let (dx, dy) = (x_m - origin_x, y_m - origin_y);
                let distance = (dx * dx + dy * dy).sqrt();
                let pull = stiffness_n_per_m * (distance - slack_m).max(0.0);
                if distance > 0.0 && pull > 0.0 {
                    let [x, y] = body_vector(state, pull * dx / distance, pull * dy / distance);
                    live.body_force[0] += x;
                    live.body_force[1] += y;
                    live.body_force[2] += live.com_m[1] * x - live.com_m[0] * y;
                }
            }
            Law::Thermal { relative, share } => {
                let stall = |lane: usize| {
                    live.motor.as_ref().map_or(1.0, |motor| {
                        motor.current_limit_a.min(motor.supply_v * self.base.per_ohm[lane])
                    })
                };
                for (lane, heat) in memory.iter_mut().enumerate().take(live.lanes) {
                    let load = state.current[lane] / stall(lane);
                    *heat += share * (load * load - *heat);
                }
                for (lane, heat) in memory.iter().enumerate() {
                    live.per_ohm[lane] /= 1.0 + relative * heat;
                }
            }
            Law::RollingResistance { coefficient } => {
                let loads = live.load.loads_n(state.accel_x, state.accel_y);
                let (casters, lanes) = (live.lanes..live.load.count(), live.lanes);
                for (lane, load) in loads.iter().enumerate().take(lanes) {
                    live.coulomb_n_m[lane] += coefficient * load * live.radius_m[lane];
                }
                for (caster, load) in loads.iter().enumerate().take(casters.end).skip(casters.start) {
                    let (x, y) = (live.x_m[caster], live.y_m[caster]);
                    let (vx, vy) = (state.u - state.r * y, state.v + state.r * x);
                    let speed = (vx * vx + vy * vy).sqrt();
                    let drag = coefficient * load * libm::tanh(speed / SLIP_SCALE_M_PER_S);
                    if speed > 0.0 {
                        add_force(live, x, y, [-drag * vx / speed, -drag * vy / speed]);
                    }
                }
            }
            Law::GearPlay { half_rad } => gear::prepare(memory, *half_rad, &self.base, live),
            Law::CasterSwivel { trail_m, torque_n_m } => {
                let casters = live.lanes..live.load.count();
                for (caster, heading) in memory.iter_mut().enumerate().take(casters.end).skip(casters.start) {
                    let (x, y) = (live.x_m[caster], live.y_m[caster]);
                    let (vx, vy) = (state.u - state.r * y, state.v + state.r * x);
                    // Heading of the wheel from its pivot's motion: trail d(phi)/dt = v across the wheel.
                    let (sin, cos) = libm::sincos(*heading);
                    let across = vy * cos - vx * sin;
                    let rate = across / trail_m - state.r;
                    *heading +=
                        PHYSICS_PERIOD_S * rate / (1.0 + PHYSICS_PERIOD_S * (vx * cos + vy * sin).abs() / trail_m);
                    // The axis is turned by the floor's side force over the trail, and passes its friction to the body.
                    let friction = torque_n_m * libm::tanh(rate / SWIVEL_SIGN_RAD_PER_S);
                    let side = -friction / trail_m;
                    add_force(live, x, y, [-sin * side, cos * side]);
                    live.body_force[2] += friction;
                }
            }
        }
    }
}

/// Multiplies what belongs to the wheels; where there is none it is 0.
fn scale(by_lane: &mut [f64; MAX_WHEELS], factor: f64x4) {
    let scaled = four(by_lane) * factor;
    by_lane[..LANES].copy_from_slice(&scaled.to_array());
}

fn add_force(live: &mut Model, x_m: f64, y_m: f64, force: [f64; 2]) {
    live.body_force[0] += force[0];
    live.body_force[1] += force[1];
    live.body_force[2] += x_m * force[1] - y_m * force[0];
}

fn world_vector(state: &BodyState, x: f64, y: f64) -> [f64; 2] {
    [
        state.cos_yaw * x - state.sin_yaw * y,
        state.sin_yaw * x + state.cos_yaw * y,
    ]
}

fn body_vector(state: &BodyState, x: f64, y: f64) -> [f64; 2] {
    [
        state.cos_yaw * x + state.sin_yaw * y,
        state.cos_yaw * y - state.sin_yaw * x,
    ]
}

/// A point given from the centre of mass in body axes.
fn world_point(state: &BodyState, x_m: f64, y_m: f64) -> [f64; 2] {
    let [x, y] = world_vector(state, x_m, y_m);
    [state.x_m + x, state.y_m + y]
}
