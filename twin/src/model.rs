//! Constants of one robot's equations, laid out for the kernel.

use crate::MAX_WHEELS;
use crate::load::LoadModel;
use crate::motor::MotorModel;
use crate::parameter::ParameterError;
use crate::robot::RobotDescription;
use crate::steering::SteeringModel;

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
    pub(crate) floor_friction: f64,
    pub(crate) load: LoadModel,
    /// At steering angle zero.
    pub(crate) geometry: Geometry,
    pub(crate) x_m: [f64; MAX_WHEELS],
    pub(crate) y_m: [f64; MAX_WHEELS],
    pub(crate) radius_m: [f64; MAX_WHEELS],
    pub(crate) spin_inertia_kg_m2: [f64; MAX_WHEELS],
    /// 1 where the wheel resists sideways motion (standard), 0 for omni.
    pub(crate) lateral: [f64; MAX_WHEELS],
    /// 1 where a motor acts.
    pub(crate) powered: [f64; MAX_WHEELS],
    /// 1 where the wheel speed is a state, 0 where it follows its command (driven without a motor model).
    pub(crate) free: [f64; MAX_WHEELS],
    pub(crate) driven: [bool; MAX_WHEELS],
    pub(crate) steered: [bool; MAX_WHEELS],
    pub(crate) viscous_n_m_s: [f64; MAX_WHEELS],
    pub(crate) coulomb_n_m: [f64; MAX_WHEELS],
    pub(crate) motor: Option<MotorModel>,
    pub(crate) steering: Option<SteeringModel>,
}

impl Model {
    pub(crate) fn new(robot: &RobotDescription) -> Result<Model, ParameterError> {
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
            lateral: zero,
            powered: zero,
            free: [1.0; MAX_WHEELS],
            driven: [false; MAX_WHEELS],
            steered: [false; MAX_WHEELS],
            viscous_n_m_s: zero,
            coulomb_n_m: zero,
            motor: robot.motor.as_ref().map(MotorModel::new),
            steering: None,
        };
        for (lane, wheel) in order.into_iter().enumerate() {
            model.set_wheel(lane, wheel, robot);
        }
        model.set_steering(robot);
        Ok(model)
    }

    fn set_wheel(&mut self, lane: usize, index: usize, robot: &RobotDescription) {
        let wheel = &robot.wheels[index];
        self.wheel_of_lane[lane] = index;
        self.x_m[lane] = wheel.x_m;
        self.y_m[lane] = wheel.y_m;
        if wheel.kind == "caster" {
            return;
        }
        let (sin, cos) = libm::sincos(wheel.rolling_direction_rad);
        self.geometry.set(lane, wheel.x_m, wheel.y_m, cos, sin);
        self.radius_m[lane] = wheel.radius_m.unwrap_or(1.0);
        self.spin_inertia_kg_m2[lane] = wheel.spin_inertia_kg_m2.unwrap_or(1.0);
        self.lateral[lane] = if wheel.kind == "standard" { 1.0 } else { 0.0 };
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

    /// Geometry at a bicycle angle.
    pub(crate) fn geometry_at(&self, steering_rad: f64) -> Geometry {
        let mut geometry = self.geometry.clone();
        let Some(steering) = &self.steering else {
            return geometry;
        };
        let tan = libm::tan(steering_rad);
        for lane in (0..self.lanes).filter(|lane| self.steered[*lane]) {
            let (x, y) = (self.x_m[lane], self.y_m[lane]);
            let (turn_cos, turn_sin) = steering.wheel_cos_sin(tan, x, y);
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
        let k = motor.torque_per_current;
        let stall = k * motor.supply_v * motor.per_ohm;
        ((stall - self.coulomb_n_m[lane]) / (k * k * motor.per_ohm + self.viscous_n_m_s[lane])).max(0.0)
    }

    /// Largest acceleration the floor can give the body origin, m/s^2.
    pub(crate) fn max_acceleration_m_per_s2(&self) -> f64 {
        self.floor_friction * crate::GRAVITY_M_PER_S2
    }
}
