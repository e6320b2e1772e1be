//! Constants of one robot's equations, laid out for the kernel.

use crate::MAX_WHEELS;
use crate::kernel::{Fixed, Lines};
use crate::load::LoadModel;
use crate::motor::MotorModel;
use crate::robot::RobotDescription;
use crate::state::BodyState;
use crate::steering::SteeringModel;
use crate::tread::Tread;
use crate::tyre::Tyre;

/// Directions and lever arms of the contact points; changes with the steering angle.
///
/// a_i = c u + s v + arm_along r ;  b_i = -s u + c v + arm_across r
#[derive(Debug, Clone)]
pub(crate) struct Geometry {
    pub(crate) cos: [f64; MAX_WHEELS],
    pub(crate) sin: [f64; MAX_WHEELS],
    /// x s - y c, m.
    pub(crate) arm_along_m: [f64; MAX_WHEELS],
    /// x c + y s, m.
    pub(crate) arm_across_m: [f64; MAX_WHEELS],
}

impl Geometry {
    #[inline(always)]
    pub(crate) fn set(&mut self, lane: usize, x_m: f64, y_m: f64, cos: f64, sin: f64) {
        self.cos[lane] = cos;
        self.sin[lane] = sin;
        self.arm_along_m[lane] = x_m * sin - y_m * cos;
        self.arm_across_m[lane] = x_m * cos + y_m * sin;
    }
}

/// One robot. Lanes are the wheels with a horizontal force in the order of `wheels`; casters stand after them.
#[derive(Debug, Clone)]
pub(crate) struct Model {
    pub(crate) lanes: usize,
    pub(crate) wheel_of_lane: [usize; MAX_WHEELS],
    pub(crate) mass_kg: f64,
    pub(crate) yaw_inertia_kg_m2: f64,
    /// Radius of gyration of the yaw inertia, m.
    pub(crate) lever_m: f64,
    /// The floor's coefficient everywhere, its nominal value, and the one under each wheel:
    pub(crate) floor_friction: f64,
    pub(crate) nominal_friction: f64,
    /// 0 for casters and where no wheel is.
    pub(crate) friction: [f64; MAX_WHEELS],
    pub(crate) load: LoadModel,
    /// Centre of mass from the body origin; positions below are from the centre of mass.
    pub(crate) com_m: [f64; 2],
    /// At steering angle zero.
    pub(crate) geometry: Geometry,
    pub(crate) x_m: [f64; MAX_WHEELS],
    pub(crate) y_m: [f64; MAX_WHEELS],
    pub(crate) radius_m: [f64; MAX_WHEELS],
    pub(crate) spin_inertia_kg_m2: [f64; MAX_WHEELS],
    pub(crate) omni: [bool; MAX_WHEELS],
    /// 1 where the wheel resists sideways motion (standard), 0 for omni.
    pub(crate) lateral: [f64; MAX_WHEELS],
    /// Whether any wheel resists sideways motion.
    pub(crate) has_side: bool,
    /// Whether wheel radii change from step to step.
    pub(crate) contact_varies: bool,
    /// 1 where a motor acts.
    pub(crate) powered: [f64; MAX_WHEELS],
    /// 1 where the wheel speed is a state, 0 where it follows its command (driven without a motor model, pushed by a told rotor).
    pub(crate) free: [f64; MAX_WHEELS],
    /// Whether its rotors turn as they are told ([`Model::follow`]).
    pub(crate) follows: bool,
    pub(crate) driven: [bool; MAX_WHEELS],
    pub(crate) steered: [bool; MAX_WHEELS],
    pub(crate) viscous_n_m_s: [f64; MAX_WHEELS],
    pub(crate) coulomb_n_m: [f64; MAX_WHEELS],
    pub(crate) motor: Option<MotorModel>,
    /// `n k_t = n k_e`, N m/A = V s/rad at the wheel.
    pub(crate) torque_per_current: [f64; MAX_WHEELS],
    pub(crate) per_ohm: [f64; MAX_WHEELS],
    /// What the encoder says over what the wheel does.
    pub(crate) encoder: [f64; MAX_WHEELS],
    /// Place of the motor in the play of its gear and its rate, at the wheel.
    pub(crate) gear_place_rad: [f64; MAX_WHEELS],
    pub(crate) gear_rate_rad_per_s: [f64; MAX_WHEELS],
    pub(crate) steering: Option<SteeringModel>,
    pub(crate) wheel_steering: WheelSteering,
    /// Forces that are not of the wheels, in body axes about the centre of mass: N, N, N m.
    pub(crate) body_force: [f64; 3],
    /// Part of them that an accelerometer does not feel.
    pub(crate) gravity_m_per_s2: [f64; 2],
    /// Absent: the nominal contact.
    pub(crate) tyre: Option<Tyre>,
    /// The same for the kernel; [`Model::freeze`] makes it.
    pub(crate) fixed: Fixed,
}

/// Force of a collision, spread over one physics step, in body axes.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Push {
    /// N, N, N m about the centre of mass.
    pub(crate) force: [f64; 3],
    /// What it gives the centre of mass; loads and accelerometer leave it out, as it acts at the height of the hull.
    pub(crate) m_per_s2: [f64; 2],
}

/// From the servo's angle to the bicycle angle of the wheels: scale (servo + shift) + offset.
#[derive(Debug, Clone, Copy)]
pub(crate) struct WheelSteering {
    pub(crate) scale: f64,
    pub(crate) shift_rad: f64,
    pub(crate) offset_rad: f64,
}

impl WheelSteering {
    const DIRECT: WheelSteering = WheelSteering {
        scale: 1.0,
        shift_rad: 0.0,
        offset_rad: 0.0,
    };

    #[inline(always)]
    pub(crate) fn wheels_rad(&self, servo_rad: f64) -> f64 {
        self.scale * (servo_rad + self.shift_rad) + self.offset_rad
    }
}

impl Model {
    pub(crate) fn new(robot: &RobotDescription) -> Model {
        let mut order: Vec<usize> = (0..robot.wheels.len().min(MAX_WHEELS)).collect();
        order.sort_by_key(|wheel| robot.wheels[*wheel].kind == "caster");
        let positions: Vec<(f64, f64)> = order
            .iter()
            .map(|wheel| (robot.wheels[*wheel].x_m, robot.wheels[*wheel].y_m))
            .collect();
        let zero = [0.0; MAX_WHEELS];
        let mut model = Model {
            lanes: order
                .iter()
                .filter(|wheel| robot.wheels[**wheel].kind != "caster")
                .count(),
            wheel_of_lane: [0; MAX_WHEELS],
            mass_kg: robot.mass_kg,
            yaw_inertia_kg_m2: robot.yaw_inertia_kg_m2,
            lever_m: (robot.yaw_inertia_kg_m2 / robot.mass_kg).sqrt(),
            floor_friction: robot.floor_friction,
            nominal_friction: robot.floor_friction,
            friction: zero,
            com_m: [0.0; 2],
            load: LoadModel::new(&positions, robot.mass_kg, robot.com_height_m),
            geometry: Geometry {
                cos: [1.0; MAX_WHEELS],
                sin: zero,
                arm_along_m: zero,
                arm_across_m: zero,
            },
            x_m: zero,
            y_m: zero,
            radius_m: [1.0; MAX_WHEELS],
            spin_inertia_kg_m2: [1.0; MAX_WHEELS],
            omni: [false; MAX_WHEELS],
            lateral: zero,
            has_side: false,
            contact_varies: false,
            powered: zero,
            free: [1.0; MAX_WHEELS],
            follows: false,
            driven: [false; MAX_WHEELS],
            steered: [false; MAX_WHEELS],
            viscous_n_m_s: zero,
            coulomb_n_m: zero,
            motor: robot.motor.as_ref().map(MotorModel::new),
            torque_per_current: [robot
                .motor
                .as_ref()
                .map_or(0.0, |motor| motor.gear_ratio * motor.torque_constant_n_m_per_a);
                MAX_WHEELS],
            per_ohm: [robot.motor.as_ref().map_or(0.0, |motor| 1.0 / motor.resistance_ohm); MAX_WHEELS],
            encoder: [1.0; MAX_WHEELS],
            gear_place_rad: zero,
            gear_rate_rad_per_s: zero,
            steering: None,
            wheel_steering: WheelSteering::DIRECT,
            body_force: [0.0; 3],
            gravity_m_per_s2: [0.0; 2],
            tyre: robot.tread.filter(|tread| *tread != Tread::NOMINAL).map(Tyre::of),
            fixed: Fixed::EMPTY,
        };
        for (lane, wheel) in order.into_iter().enumerate() {
            model.set_wheel(lane, wheel, robot);
        }
        model.set_steering(robot);
        model.freeze();
        model
    }

    /// Lays the constants out for the kernel; to be called after any change of them.
    #[inline(always)]
    pub(crate) fn freeze(&mut self) {
        self.fixed = Fixed::new(self);
    }

    /// Lane of a wheel by its position in `wheels`; none for casters.
    pub(crate) fn lane_of_wheel(&self, wheel: usize) -> Option<usize> {
        (0..self.lanes).find(|lane| self.wheel_of_lane[*lane] == wheel)
    }

    /// The tyre that effects change; nominal when there was none.
    pub(crate) fn tyre_mut(&mut self) -> &mut Tyre {
        self.tyre.get_or_insert(Tyre::NOMINAL)
    }

    /// Shifts the centre of mass against the body; all positions are kept from it.
    pub(crate) fn move_center_of_mass(&mut self, x_m: f64, y_m: f64) {
        self.com_m = [self.com_m[0] + x_m, self.com_m[1] + y_m];
        for wheel in 0..self.load.count() {
            self.x_m[wheel] -= x_m;
            self.y_m[wheel] -= y_m;
        }
        for lane in 0..self.lanes {
            let (cos, sin) = (self.geometry.cos[lane], self.geometry.sin[lane]);
            self.geometry.set(lane, self.x_m[lane], self.y_m[lane], cos, sin);
        }
        let positions: Vec<(f64, f64)> = (0..self.load.count())
            .map(|wheel| (self.x_m[wheel], self.y_m[wheel]))
            .collect();
        self.load = LoadModel::new(&positions, self.mass_kg, self.load.com_height_m());
    }

    /// What the encoder of a wheel says: it sits at the motor, in front of the play.
    #[inline(always)]
    pub(crate) fn encoder_speed(&self, state: &BodyState, lane: usize) -> f64 {
        self.encoder[lane] * (state.wheel[lane] + self.gear_rate_rad_per_s[lane])
    }

    /// Current of a motor, A, at a terminal voltage and wheel speed.
    #[inline(always)]
    pub(crate) fn current_a(&self, motor: &MotorModel, lane: usize, voltage_v: f64, wheel_rad_per_s: f64) -> f64 {
        let free = (voltage_v - self.torque_per_current[lane] * wheel_rad_per_s) * self.per_ohm[lane];
        free.min(motor.current_limit_a).max(-motor.current_limit_a)
    }

    /// Lets rotors turn as they are told. Friction and strength of the motors stay: currents tell where wheels begin, and what drags besides is
    /// the wheel's.
    pub(crate) fn follow(&mut self) {
        self.follows = true;
        self.motor = None;
        for lane in (0..self.lanes).filter(|lane| self.driven[*lane]) {
            (self.powered[lane], self.free[lane]) = (0.0, 0.0);
        }
        self.freeze();
    }

    fn set_wheel(&mut self, lane: usize, index: usize, robot: &RobotDescription) {
        let wheel = &robot.wheels[index];
        self.wheel_of_lane[lane] = index;
        if wheel.kind != "caster" {
            self.friction[lane] = robot.floor_friction;
        }
        self.x_m[lane] = wheel.x_m;
        self.y_m[lane] = wheel.y_m;
        if wheel.kind == "caster" {
            return;
        }
        let (sin, cos) = libm::sincos(wheel.rolling_direction_rad);
        self.geometry.set(lane, wheel.x_m, wheel.y_m, cos, sin);
        self.radius_m[lane] = wheel.radius_m.unwrap_or(1.0);
        self.spin_inertia_kg_m2[lane] = wheel.spin_inertia_kg_m2.unwrap_or(1.0);
        self.omni[lane] = wheel.kind == "omni";
        self.lateral[lane] = if wheel.kind == "standard" { 1.0 } else { 0.0 };
        self.has_side |= wheel.kind == "standard";
        self.driven[lane] = wheel.driven;
        self.steered[lane] = wheel.steered;
        if !wheel.driven {
            return;
        }
        match &robot.motor {
            None => self.free[lane] = 0.0,
            Some(motor) => {
                self.powered[lane] = 1.0;
                self.viscous_n_m_s[lane] = motor.viscous_n_m_s;
                self.coulomb_n_m[lane] = motor.coulomb_n_m;
            }
        }
    }

    fn set_steering(&mut self, robot: &RobotDescription) {
        let Some(steering) = &robot.steering else { return };
        let mean_x = |steered: bool| {
            let (mut sum, mut count) = (0.0, 0.0);
            for lane in (0..self.lanes).filter(|lane| self.steered[*lane] == steered) {
                sum += self.x_m[lane];
                count += 1.0;
            }
            if count > 0.0 { Some(sum / count) } else { None }
        };
        if let (Some(steered), Some(fixed)) = (mean_x(true), mean_x(false)) {
            self.steering = Some(SteeringModel::new(steering, steered - fixed, fixed));
        }
    }

    /// Directions of the wheels at a bicycle angle.
    #[inline(always)]
    pub(crate) fn lines_at(&self, steering_rad: f64) -> Lines {
        match &self.steering {
            Some(steering) => Lines::steered(self, steering, libm::tan(steering_rad)),
            None => self.fixed.straight(),
        }
    }

    /// Geometry at a bicycle angle.
    pub(crate) fn geometry_at(&self, steering_rad: f64) -> Geometry {
        let mut geometry = self.geometry.clone();
        let Some(steering) = &self.steering else {
            return geometry;
        };
        let tan = libm::tan(steering_rad);
        for lane in (0..self.lanes).filter(|lane| self.steered[*lane]) {
            let (x, y) = (self.x_m[lane], self.y_m[lane]);
            let (turn_cos, turn_sin) = steering.wheel_cos_sin(tan, x + self.com_m[0], y + self.com_m[1]);
            let (cos, sin) = (self.geometry.cos[lane], self.geometry.sin[lane]);
            geometry.set(
                lane,
                x,
                y,
                cos * turn_cos - sin * turn_sin,
                sin * turn_cos + cos * turn_sin,
            );
        }
        geometry
    }

    /// Speed where motor torque at full supply equals the drive's friction, rad/s.
    pub(crate) fn max_wheel_speed_rad_per_s(&self) -> f64 {
        let Some(motor) = &self.motor else { return f64::INFINITY };
        let Some(lane) = (0..self.lanes).find(|lane| self.powered[*lane] > 0.0) else {
            return 0.0;
        };
        let (k, per_ohm) = (self.torque_per_current[lane], self.per_ohm[lane]);
        let stall = k * motor.supply_v * per_ohm;
        ((stall - self.coulomb_n_m[lane]) / (k * k * per_ohm + self.viscous_n_m_s[lane])).max(0.0)
    }

    /// Largest acceleration the floor can give the body origin, m/s^2.
    pub(crate) fn max_acceleration_m_per_s2(&self) -> f64 {
        self.floor_friction * crate::GRAVITY_M_PER_S2
    }
}
