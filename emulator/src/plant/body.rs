//! One robot: a rigid body on wheels. Its state lives at the centre of mass in the world frame.

use super::battery::Battery;
use super::contents::PlantContents;
use super::load::{Loads, Spring};
use super::motor::{Gear, Motor};
use super::steering::{Steering, SteeringState};
use super::swivel::Swivel;
use super::wheel::{Wheel, WheelInput, WheelKind, WheelState};
use super::{GRAVITY_M_PER_S2, Pose, Step};
use crate::hidden::{HiddenFloor, HiddenRobot, RunVariation};
use crate::noise::Noise;
use api::robot::RobotDescription;

/// Share of a driven wheel's inertia that turns with the rotor, in front of the play. Gear ratios make it large, and the
/// reference gains at 480 Hz are stable for a rotor that hangs free in its play only above 0.85.
const ROTOR_SHARE: f64 = 0.92;
const INDUCTANCE_H: f64 = 0.2e-3;
const GEAR_STIFFNESS_N_M_PER_RAD: f64 = 200.0;
const GEAR_DAMPING_N_M_S: f64 = 0.08;
const COGGING_PER_ROTOR_TURN: f64 = 12.0;
const CURRENT_LIMIT_WHERE_NONE_IS_GIVEN_A: f64 = 1e3;

/// Constants and state of one robot on the floor.
#[derive(Debug, Clone)]
pub struct Body {
    pub mass_kg: f64,
    pub yaw_inertia_kg_m2: f64,
    /// Radius of the bumper around the body origin.
    pub radius_m: f64,
    friction: f64,
    com_m: [f64; 2],
    wheels: Vec<Wheel>,
    steering: Option<Steering>,
    pub battery: Battery,
    loads: Loads,
    state: BodyState,
}

#[derive(Debug, Clone, Default)]
struct BodyState {
    /// Centre of mass in the world.
    position_m: [f64; 2],
    yaw_rad: f64,
    velocity_m_per_s: [f64; 2],
    yaw_rate_rad_per_s: f64,
    wheels: Vec<WheelState>,
    steering: SteeringState,
    /// From wheels and bumpers, body frame.
    specific_force_m_per_s2: [f64; 2],
}

/// What the firmware does to a robot, held for a tick.
#[derive(Debug, Clone, Copy)]
pub struct Drive {
    /// Per driven wheel; `None` = power stage off.
    pub motor_v: Option<[f64; robot::MAX_MOTORS]>,
    pub steering_rad: f64,
    /// Position among the driven wheels of a wheel that is held fast.
    pub stuck_wheel: Option<usize>,
}

/// Force and moment from outside at the centre of mass, world frame.
#[derive(Debug, Clone, Copy, Default)]
pub struct Push {
    pub force_n: [f64; 2],
    pub moment_n_m: f64,
}

/// The floor under a robot: what is hidden in it and what everybody knows of it.
#[derive(Debug, Clone, Copy)]
pub struct Ground<'a> {
    pub floor: &'a HiddenFloor,
    pub contents: &'a PlantContents,
}

impl Ground<'_> {
    /// Times the nominal friction at a wheel's contact point.
    pub fn friction_scale(&self, point: [f64; 2]) -> f64 {
        let [x, y] = point;
        let patch = self
            .floor
            .patches
            .iter()
            .find(|patch| square(x - patch.x_m) + square(y - patch.y_m) < square(patch.radius_m));
        let hidden = self.floor.friction_scale * patch.map_or(1.0, |patch| patch.friction_scale);
        hidden * self.contents.friction_scale(point)
    }
}

/// Why a robot cannot be emulated.
#[derive(Debug, thiserror::Error)]
pub enum BodyError {
    #[error("robot {0}: a driven robot needs a motor")]
    MotorMissing(String),
    #[error(transparent)]
    Commissioning(#[from] crate::commissioning::CommissioningError),
    #[error("robot {robot}: {found} driven wheels, the link carries at most {most}")]
    TooManyMotors { robot: String, found: usize, most: usize },
    #[error("robot {robot}: {found} wheels, at most {most}")]
    TooManyWheels { robot: String, found: usize, most: usize },
    #[error("robot {robot}: wheel {wheel} needs radius_m and spin_inertia_kg_m2")]
    WheelIncomplete { robot: String, wheel: usize },
    #[error("robot {robot}: wheel kind {kind:?} is none of omni, standard, caster")]
    WheelKind { robot: String, kind: String },
}

impl Body {
    /// A robot at rest at the world's origin. `noise` draws the variation of this run.
    pub fn new(
        description: &RobotDescription,
        radius_m: f64,
        hidden: &HiddenRobot,
        variation: &RunVariation,
        noise: &mut Noise,
    ) -> Result<Self, BodyError> {
        check(description)?;
        let mass_kg = description.mass_kg * hidden.mass_scale * noise.factor(variation.mass);
        let friction = description.floor_friction * noise.factor(variation.friction);
        let com_m = [hidden.com_x_m, hidden.com_y_m];
        let wear = &hidden.wear;
        let mut wheels = Vec::with_capacity(description.wheels.len());
        let mut driven = 0;
        for (position, wheel) in description.wheels.iter().enumerate() {
            let motor = if wheel.driven { description.motor.as_ref() } else { None };
            let drive = motor.map(|motor| {
                let constant_scale =
                    listed(&hidden.torque_constant_scale, driven, 1.0) * noise.factor(variation.torque_constant);
                driven += 1;
                drive(
                    motor,
                    wheel.spin_inertia_kg_m2.unwrap_or(1e-3),
                    hidden,
                    constant_scale,
                    noise.uniform(),
                )
            });
            let wheel_share = if drive.is_some() { 1.0 - ROTOR_SHARE } else { 1.0 };
            let straight_rad = wheel.rolling_direction_rad + listed(&hidden.wheel_direction_error_rad, position, 0.0);
            wheels.push(Wheel {
                kind: kind_of(&wheel.kind).ok_or_else(|| BodyError::WheelKind {
                    robot: description.name.clone(),
                    kind: wheel.kind.clone(),
                })?,
                x_m: wheel.x_m * if wheel.kind == "omni" { wear.track_scale } else { 1.0 } - com_m[0],
                y_m: wheel.y_m * wear.track_scale - com_m[1],
                straight: [straight_rad.cos(), straight_rad.sin()],
                steered: wheel.steered,
                radius_m: wheel.radius_m.unwrap_or(0.0) * listed(&hidden.wheel_radius_scale, position, 1.0),
                inertia_kg_m2: wheel.spin_inertia_kg_m2.unwrap_or(0.0) * wheel_share,
                viscous_n_m_s: description.motor.as_ref().map_or(0.0, |motor| motor.viscous_n_m_s),
                roller_drag: hidden.roller_drag,
                roller_viscous_n_s_per_m: wear.roller_viscous_n_s_per_m,
                side_friction_scale: wear.side_friction_scale,
                slip_ratio_at_full_force: wear.slip_ratio_at_full_force,
                creep_scale: wear.creep_scale,
                run_out: wear.run_out.get(position).copied().unwrap_or_default(),
                swivel: Swivel {
                    friction_n_m: wear.swivel_n_m,
                    trail_m: wear.swivel_trail_m,
                },
                drive,
            });
        }
        let springs: Vec<_> = wheels
            .iter()
            .enumerate()
            .map(|(i, wheel)| Spring {
                x_m: wheel.x_m,
                y_m: wheel.y_m,
                stiffness: listed(&hidden.spring_stiffness_scale, i, 1.0),
            })
            .collect();
        let states = wheels
            .iter()
            .map(|wheel| WheelState {
                direction: wheel.straight,
                ..WheelState::default()
            })
            .collect();
        let charge = hidden.battery_charge * noise.factor(variation.battery_charge);
        let supply_v = description.motor.as_ref().map_or(24.0, |motor| motor.supply_v);
        Ok(Self {
            mass_kg,
            yaw_inertia_kg_m2: description.yaw_inertia_kg_m2 * hidden.yaw_inertia_scale,
            radius_m,
            friction,
            com_m,
            steering: steering(description, hidden),
            battery: Battery::new(
                supply_v,
                hidden.battery_resistance_ohm,
                hidden.battery_capacity_ah,
                charge,
            ),
            loads: Loads::new(&springs, mass_kg, description.com_height_m),
            wheels,
            state: BodyState {
                wheels: states,
                ..BodyState::default()
            },
        })
    }

    /// Sets the robot down: everything at rest.
    pub fn place(&mut self, pose: Pose) {
        let (sin, cos) = pose.yaw_rad.sin_cos();
        let [x, y] = self.com_m;
        self.state.position_m = [pose.x_m + cos * x - sin * y, pose.y_m + sin * x + cos * y];
        self.state.yaw_rad = pose.yaw_rad;
        self.state.velocity_m_per_s = [0.0; 2];
        self.state.yaw_rate_rad_per_s = 0.0;
    }

    /// Gives the body a velocity (world frame), for tests and pushes by hand.
    pub fn push(&mut self, velocity_m_per_s: [f64; 2], yaw_rate_rad_per_s: f64) {
        self.state.velocity_m_per_s = velocity_m_per_s;
        self.state.yaw_rate_rad_per_s = yaw_rate_rad_per_s;
    }

    /// Where the body origin is; the yaw is not wrapped.
    pub fn pose(&self) -> Pose {
        let (sin, cos) = self.state.yaw_rad.sin_cos();
        let ([px, py], [x, y]) = (self.state.position_m, self.com_m);
        Pose {
            x_m: px - cos * x + sin * y,
            y_m: py - sin * x - cos * y,
            yaw_rad: self.state.yaw_rad,
        }
    }

    /// Velocity of the body origin in the world.
    pub fn velocity_m_per_s(&self) -> [f64; 2] {
        let [dx, dy] = self.lever_m();
        let r = self.state.yaw_rate_rad_per_s;
        [
            self.state.velocity_m_per_s[0] - r * dy,
            self.state.velocity_m_per_s[1] + r * dx,
        ]
    }

    /// From the centre of mass to the body origin, world frame.
    pub fn lever_m(&self) -> [f64; 2] {
        let (pose, [px, py]) = (self.pose(), self.state.position_m);
        [pose.x_m - px, pose.y_m - py]
    }

    pub fn yaw_rate_rad_per_s(&self) -> f64 {
        self.state.yaw_rate_rad_per_s
    }

    /// What an ideal accelerometer shows, forward and left.
    pub fn specific_force_m_per_s2(&self) -> [f64; 2] {
        self.state.specific_force_m_per_s2
    }

    pub fn steering_rad(&self) -> f64 {
        self.state.steering.angle_rad
    }

    /// In front of the play.
    pub fn servo_rad(&self) -> f64 {
        self.state.steering.servo_rad
    }

    /// States of the driven wheels in the order of the description.
    pub fn driven_wheels(&self) -> impl Iterator<Item = &WheelState> {
        self.wheels
            .iter()
            .zip(&self.state.wheels)
            .filter(|(wheel, _)| wheel.drive.is_some())
            .map(|(_, state)| state)
    }

    /// Kinetic and elastic energy.
    pub fn energy_j(&self) -> f64 {
        let [vx, vy] = self.state.velocity_m_per_s;
        let r = self.state.yaw_rate_rad_per_s;
        let wheels: f64 = self
            .wheels
            .iter()
            .zip(&self.state.wheels)
            .map(|(wheel, state)| wheel.energy_j(state))
            .sum();
        0.5 * self.mass_kg * (vx * vx + vy * vy) + 0.5 * self.yaw_inertia_kg_m2 * r * r + wheels
    }

    /// Moves the robot by a step.
    pub fn step(&mut self, drive: &Drive, ground: &Ground<'_>, push: &Push, step: Step) {
        let floor = ground.floor;
        let (sin, cos) = self.state.yaw_rad.sin_cos();
        let [vx, vy] = self.state.velocity_m_per_s;
        let (forward, left, r) = (cos * vx + sin * vy, cos * vy - sin * vx, self.state.yaw_rate_rad_per_s);
        let loads = self.loads.step(self.state.specific_force_m_per_s2, step);
        self.steer(drive.steering_rad, step);
        let (bus_v, [com_x, com_y]) = (self.battery.bus_v(), self.state.position_m);
        let (mut force_n, mut moment_n_m, mut power_w, mut motor_index) = ([0.0; 2], 0.0, 0.0, 0);
        for ((wheel, state), load_n) in self.wheels.iter().zip(&mut self.state.wheels).zip(loads) {
            let contact = [
                com_x + cos * wheel.x_m - sin * wheel.y_m,
                com_y + sin * wheel.x_m + cos * wheel.y_m,
            ];
            let mut input = WheelInput {
                hub_m_per_s: [forward - r * wheel.y_m, left + r * wheel.x_m],
                yaw_rate_rad_per_s: r,
                load_n,
                friction: self.friction * ground.friction_scale(contact),
                rolling_resistance: floor.rolling_resistance,
                voltage_v: None,
                stuck: false,
            };
            if wheel.drive.is_some() {
                input.voltage_v = drive
                    .motor_v
                    .and_then(|voltages| voltages.get(motor_index).map(|voltage| voltage.clamp(-bus_v, bus_v)));
                input.stuck = drive.stuck_wheel == Some(motor_index);
                motor_index += 1;
            }
            let [fx, fy] = wheel.step(state, &input, step);
            power_w += input.voltage_v.unwrap_or(0.0) * state.motor.current_a;
            force_n[0] += fx;
            force_n[1] += fy;
            moment_n_m += wheel.x_m * fy - wheel.y_m * fx + state.swivel_n_m;
        }
        self.battery.step(power_w, step);
        let [px, py] = push.force_n;
        let body_force = [force_n[0] + cos * px + sin * py, force_n[1] + cos * py - sin * px];
        self.state.specific_force_m_per_s2 = body_force.map(|force| force / self.mass_kg);
        let [fx, fy] = body_force;
        let world_acceleration = [
            (cos * fx - sin * fy) / self.mass_kg - GRAVITY_M_PER_S2 * (floor.slope[0] + ground.contents.slope[0]),
            (sin * fx + cos * fy) / self.mass_kg - GRAVITY_M_PER_S2 * (floor.slope[1] + ground.contents.slope[1]),
        ];
        for ((position, velocity), acceleration) in self
            .state
            .position_m
            .iter_mut()
            .zip(&mut self.state.velocity_m_per_s)
            .zip(world_acceleration)
        {
            *velocity += step.dt_s * acceleration;
            *position += step.dt_s * *velocity;
        }
        self.state.yaw_rate_rad_per_s += step.dt_s * (moment_n_m + push.moment_n_m) / self.yaw_inertia_kg_m2;
        self.state.yaw_rad += step.dt_s * self.state.yaw_rate_rad_per_s;
    }

    fn steer(&mut self, command_rad: f64, step: Step) {
        let Some(steering) = &self.steering else { return };
        steering.step(&mut self.state.steering, command_rad, step);
        let tangent = steering.tangent(&self.state.steering);
        for (wheel, state) in self
            .wheels
            .iter()
            .zip(&mut self.state.wheels)
            .filter(|(wheel, _)| wheel.steered)
        {
            let [cos, sin] = steering.wheel_direction(tangent, wheel.y_m + self.com_m[1]);
            let [straight_cos, straight_sin] = wheel.straight;
            state.direction = [
                straight_cos * cos - straight_sin * sin,
                straight_cos * sin + straight_sin * cos,
            ];
        }
    }
}

fn square(value: f64) -> f64 {
    value * value
}

fn listed(values: &[f64], position: usize, neutral: f64) -> f64 {
    values.get(position).copied().unwrap_or(neutral)
}

fn kind_of(name: &str) -> Option<WheelKind> {
    match name {
        "omni" => Some(WheelKind::Omni),
        "standard" => Some(WheelKind::Standard),
        "caster" => Some(WheelKind::Caster),
        _ => None,
    }
}

fn check(description: &RobotDescription) -> Result<(), BodyError> {
    let robot = || description.name.clone();
    let driven = description.wheels.iter().filter(|wheel| wheel.driven).count();
    if driven > 0 && description.motor.is_none() {
        return Err(BodyError::MotorMissing(robot()));
    }
    if driven > robot::MAX_MOTORS {
        return Err(BodyError::TooManyMotors {
            robot: robot(),
            found: driven,
            most: robot::MAX_MOTORS,
        });
    }
    if description.wheels.len() > super::MAX_WHEELS {
        return Err(BodyError::TooManyWheels {
            robot: robot(),
            found: description.wheels.len(),
            most: super::MAX_WHEELS,
        });
    }
    let incomplete = |wheel: &api::robot::Wheel| {
        wheel.kind != "caster" && (wheel.radius_m.is_none() || wheel.spin_inertia_kg_m2.is_none())
    };
    match description.wheels.iter().position(incomplete) {
        Some(wheel) => Err(BodyError::WheelIncomplete { robot: robot(), wheel }),
        None => Ok(()),
    }
}

fn drive(
    motor: &api::robot::Motor,
    spin_inertia_kg_m2: f64,
    hidden: &HiddenRobot,
    constant_scale: f64,
    cogging_turn: f64,
) -> (Motor, Gear) {
    let wear = &hidden.wear;
    let current_limit_a = motor.current_limit_a.unwrap_or(CURRENT_LIMIT_WHERE_NONE_IS_GIVEN_A);
    let motor = Motor {
        constant_n_m_per_a: motor.gear_ratio * motor.torque_constant_n_m_per_a * constant_scale,
        resistance_ohm: motor.resistance_ohm,
        inductance_h: INDUCTANCE_H,
        current_limit_a,
        rotor_inertia_kg_m2: spin_inertia_kg_m2 * ROTOR_SHARE,
        viscous_n_m_s: motor.viscous_n_m_s + wear.viscous_n_m_s,
        coulomb_n_m: motor.coulomb_n_m * hidden.coulomb_scale + wear.coulomb_n_m,
        breakaway_ratio: wear.breakaway_ratio,
        breakaway_rad_per_s: wear.breakaway_rad_per_s,
        friction_asymmetry: wear.friction_asymmetry,
        heating: wear.heating,
        heating_s: wear.heating_s,
        full_current_a: current_limit_a.min(motor.supply_v / motor.resistance_ohm),
        cogging_n_m: hidden.cogging_n_m * motor.gear_ratio,
        cogging_per_rad: COGGING_PER_ROTOR_TURN * motor.gear_ratio,
        cogging_phase_rad: cogging_turn * std::f64::consts::TAU,
    };
    (
        motor,
        Gear {
            half_backlash_rad: hidden.half_backlash_rad,
            stiffness_n_m_per_rad: GEAR_STIFFNESS_N_M_PER_RAD,
            damping_n_m_s: GEAR_DAMPING_N_M_S,
        },
    )
}

fn steering(description: &RobotDescription, hidden: &HiddenRobot) -> Option<Steering> {
    let steering = description.steering.as_ref()?;
    let axle = |steered: bool| {
        let positions: Vec<f64> = description
            .wheels
            .iter()
            .filter(|wheel| wheel.steered == steered && wheel.kind != "caster")
            .map(|wheel| wheel.x_m)
            .collect();
        (!positions.is_empty()).then(|| positions.iter().sum::<f64>() / positions.len() as f64)
    };
    let (steered_x_m, fixed_axle_x_m) = (axle(true)?, axle(false)?);
    Some(Steering {
        lag_s: steering.lag_s + hidden.wear.steering_lag_s,
        rate_limit_rad_per_s: steering.rate_limit_rad_per_s.unwrap_or(f64::MAX),
        angle_limit_rad: steering.angle_limit_rad.unwrap_or(1.2),
        play_rad: hidden.steering_play_rad,
        offset_rad: hidden.wear.steering_offset_rad,
        scale: hidden.wear.steering_scale,
        wheelbase_m: steered_x_m - fixed_axle_x_m,
    })
}
