//! Every number of a robot description: symbol, place, unit, range, reference value, what a bench changes, source.

/// What stands for a number that a description leaves out.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum WhenAbsent {
    /// A description without it is refused.
    Required,
    /// None: 0.
    Nothing,
    /// Required but for casters.
    CasterOnly,
    /// No limit.
    Unlimited,
    /// No such sensor, or its noise unknown.
    NoSensor,
    /// The speed is known exactly.
    NoEncoder,
    /// Belongs to another field: required with it, refused without it.
    With(&'static str),
    /// The value of another field.
    Same(&'static str),
}

/// How far an identification on a bench typically moves a number away from what the description says.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Practical {
    /// Share of the value.
    Relative(f64),
    /// In the parameter's unit.
    Absolute(f64),
    /// Known: counted, printed on the part or chosen.
    Exact,
}

/// Where the reference value comes from. No paper and no data sheet gives any of these numbers for the reference robots.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Source {
    /// Chosen, as gains are.
    Design,
    /// Of the size that such robots have; not measured.
    Estimate,
}

/// One number of a robot description.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Parameter {
    /// As in `docs/notation.md`; empty where no equation has one.
    pub symbol: &'static str,
    /// JSON path in the description; `[]` stands for a position.
    pub path: &'static str,
    pub unit: &'static str,
    /// Smallest and largest value that is not refused.
    pub low: f64,
    pub high: f64,
    /// True for counts.
    pub whole: bool,
    pub when_absent: WhenAbsent,
    /// Value of the four-wheel-drive reference robot with the reference cascade; `None` where it leaves it out.
    pub reference: Option<f64>,
    pub practical: Practical,
    pub source: Source,
    pub meaning: &'static str,
    /// What to do about a bad one.
    pub remedy: &'static str,
}

impl Parameter {
    /// True for a number in range.
    pub fn allows(&self, value: f64) -> bool {
        (self.low..=self.high).contains(&value)
    }

    /// The range in words, with its unit.
    pub fn limit(&self) -> String {
        format!("{}..={} {}", self.low, self.high, self.unit)
            .trim_end()
            .to_owned()
    }

    /// What a bench identification typically moves `value` by, in the parameter's unit.
    pub fn practical_size(&self, value: f64) -> f64 {
        match self.practical {
            Practical::Relative(share) => share * value.abs(),
            Practical::Absolute(size) => size,
            Practical::Exact => 0.0,
        }
    }

    const fn whole(mut self) -> Parameter {
        self.whole = true;
        self
    }

    const fn absent(mut self, when: WhenAbsent) -> Parameter {
        self.when_absent = when;
        self
    }

    const fn reference(mut self, value: f64, source: Source) -> Parameter {
        self.reference = Some(value);
        self.source = source;
        self
    }

    const fn practical(mut self, size: Practical) -> Parameter {
        self.practical = size;
        self
    }

    const fn about(mut self, meaning: &'static str, remedy: &'static str) -> Parameter {
        self.meaning = meaning;
        self.remedy = remedy;
        self
    }
}

const fn number(symbol: &'static str, path: &'static str, unit: &'static str, low: f64, high: f64) -> Parameter {
    Parameter {
        symbol,
        path,
        unit,
        low,
        high,
        whole: false,
        when_absent: WhenAbsent::Required,
        reference: None,
        practical: Practical::Exact,
        source: Source::Design,
        meaning: "",
        remedy: "",
    }
}

const fn noise(path: &'static str, unit: &'static str, meaning: &'static str) -> Parameter {
    number("", path, unit, 0.0, 1e3)
        .absent(WhenAbsent::NoSensor)
        .practical(Practical::Relative(0.5))
        .about(meaning, "give one standard deviation, or leave it out")
}

use Practical::{Absolute, Exact, Relative};
use Source::{Design, Estimate};

pub(super) const MASS: Parameter = number("m", "mass_kg", "kg", 0.01, 2000.0)
    .reference(12.0, Estimate)
    .practical(Relative(0.05))
    .about(
        "mass with battery, without payload",
        "give the mass of the whole robot with battery",
    );
pub(super) const YAW_INERTIA: Parameter = number("J", "yaw_inertia_kg_m2", "kg m2", 1e-6, 2000.0)
    .reference(0.25, Estimate)
    .practical(Relative(0.2))
    .about(
        "moment of inertia about the vertical axis through the centre of mass; what mass and wheels allow is narrower",
        "give the moment of inertia about the vertical axis; a box has m (l^2 + w^2) / 12",
    );
pub(super) const COM_HEIGHT: Parameter = number("h", "com_height_m", "m", 0.0, 3.0)
    .reference(0.11, Estimate)
    .practical(Absolute(0.02))
    .about(
        "height of the centre of mass above the floor",
        "give the height of the centre of mass above the floor",
    );
pub(super) const WHEEL_X: Parameter = number("x_i", "wheels[].x_m", "m", -5.0, 5.0)
    .reference(0.12, Estimate)
    .practical(Absolute(0.003))
    .about(
        "contact point in the body frame, forward",
        "give the contact point in the body frame, x forward",
    );
pub(super) const WHEEL_Y: Parameter = number("y_i", "wheels[].y_m", "m", -5.0, 5.0)
    .reference(0.1, Estimate)
    .practical(Absolute(0.003))
    .about(
        "contact point in the body frame, left; at a bench the effective track",
        "give the contact point in the body frame, y left",
    );
pub(super) const ROLLING_DIRECTION: Parameter = number("beta_i", "wheels[].rolling_direction_rad", "rad", -13.0, 13.0)
    .reference(0.0, Design)
    .practical(Absolute(0.02))
    .about(
        "direction in which a positive wheel speed rolls the contact",
        "give radians, 0 = rolls forward",
    );
pub(super) const WHEEL_RADIUS: Parameter = number("R", "wheels[].radius_m", "m", 0.002, 1.0)
    .absent(WhenAbsent::CasterOnly)
    .reference(0.05, Estimate)
    .practical(Relative(0.02))
    .about("rolling radius", "give the rolling radius in metres");
pub(super) const SPIN_INERTIA: Parameter = number("J_w", "wheels[].spin_inertia_kg_m2", "kg m2", 1e-7, 10.0)
    .absent(WhenAbsent::CasterOnly)
    .reference(0.0008, Estimate)
    .practical(Relative(0.3))
    .about(
        "inertia of a wheel with the reflected rotor",
        "give the wheel's inertia with the reflected rotor",
    );
pub(super) const GEAR_RATIO: Parameter = number("n", "motor.gear_ratio", "", 0.01, 2000.0)
    .reference(19.2, Estimate)
    .practical(Exact)
    .about("motor turns per wheel turn", "give motor turns per wheel turn");
pub(super) const TORQUE_CONSTANT: Parameter = number("k_t", "motor.torque_constant_n_m_per_a", "N m/A", 1e-6, 100.0)
    .reference(0.031, Estimate)
    .practical(Relative(0.1))
    .about(
        "torque constant of the motor shaft, equal to k_e",
        "give k_t of the motor shaft",
    );
pub(super) const RESISTANCE: Parameter = number("R_a", "motor.resistance_ohm", "ohm", 1e-4, 1e4)
    .reference(0.6, Estimate)
    .practical(Relative(0.2))
    .about(
        "winding, driver and leads; grows with heat",
        "give the winding resistance",
    );
pub(super) const CURRENT_LIMIT: Parameter = number("i_max", "motor.current_limit_a", "A", 1e-3, 1e4)
    .absent(WhenAbsent::Unlimited)
    .reference(9.0, Estimate)
    .practical(Relative(0.1))
    .about("limit of the driver", "give the driver's limit, or null for none");
pub(super) const SUPPLY: Parameter = number("V_bus", "motor.supply_v", "V", 0.1, 1000.0)
    .reference(24.0, Estimate)
    .practical(Relative(0.1))
    .about("battery voltage without load", "give the nominal battery voltage");
pub(super) const VISCOUS: Parameter = number("b_w", "motor.viscous_n_m_s", "N m s", 0.0, 10.0)
    .reference(0.0004, Estimate)
    .practical(Relative(1.0))
    .about(
        "viscous friction of motor and gear at the wheel",
        "give viscous friction at the wheel",
    );
pub(super) const COULOMB: Parameter = number("t_c", "motor.coulomb_n_m", "N m", 0.0, 100.0)
    .reference(0.02, Estimate)
    .practical(Relative(1.0))
    .about(
        "dry friction of motor and gear at the wheel",
        "give dry friction at the wheel",
    );
pub(super) const SPEED_LOOP_KP: Parameter = number("k_p", "motor.speed_loop_kp_v_s_per_rad", "V s/rad", 0.0, 1e4)
    .reference(0.8, Design)
    .practical(Exact)
    .about(
        "speed PI without a controller object, or of kind speed_pi",
        "give the gain of the wheel speed loop",
    );
pub(super) const SPEED_LOOP_KI: Parameter = number("k_i", "motor.speed_loop_ki_v_per_rad", "V/rad", 0.0, 1e5)
    .reference(6.0, Design)
    .practical(Exact)
    .about("the same, integral", "give the integral gain of the wheel speed loop");
pub(super) const CONTROLLER_RATE: Parameter = number("1/T", "motor.controller.sample_rate_hz", "Hz", 10.0, 9600.0)
    .whole()
    .absent(WhenAbsent::With("motor.controller"))
    .reference(1920.0, Design)
    .practical(Exact)
    .about(
        "samples per second of the motor control: a divisor or a multiple of 480",
        "give the samples per second of the motor control, 480 times or divided by an integer",
    );
pub(super) const CONTROLLER_DELAY: Parameter =
    number("m", "motor.controller.computation_delay_samples", "samples", 0.0, 8.0)
        .whole()
        .absent(WhenAbsent::With("motor.controller"))
        .reference(1.0, Design)
        .practical(Absolute(1.0))
        .about(
            "samples from measurement to the voltage made of it",
            "give the samples from measurement to voltage, 0 = at once",
        );
pub(super) const CONTROLLER_TICKS: Parameter = number("n", "motor.controller.encoder_ticks_per_rev", "ticks", 1.0, 1e7)
    .whole()
    .absent(WhenAbsent::NoEncoder)
    .reference(4096.0, Estimate)
    .practical(Exact)
    .about(
        "counts of one turn of the wheel",
        "give the edges of one turn of the wheel: lines x 4 x gear ratio",
    );
pub(super) const CONTROLLER_WINDOW: Parameter =
    number("w", "motor.controller.speed_window_samples", "samples", 1.0, 64.0)
        .whole()
        .absent(WhenAbsent::With("motor.controller.encoder_ticks_per_rev"))
        .reference(8.0, Design)
        .practical(Exact)
        .about(
            "samples that the speed is the mean of",
            "give the samples that one speed looks back on, 1 = from sample to sample",
        );
pub(super) const CASCADE_SPEED_KP: Parameter =
    number("k_ps", "motor.controller.speed_kp_a_s_per_rad", "A s/rad", 0.0, 1e4)
        .absent(WhenAbsent::With("kind cascade"))
        .reference(0.5, Design)
        .practical(Exact)
        .about("outer loop", "give the gain from speed error to wanted current");
pub(super) const CASCADE_SPEED_KI: Parameter = number("k_is", "motor.controller.speed_ki_a_per_rad", "A/rad", 0.0, 1e5)
    .absent(WhenAbsent::With("kind cascade"))
    .reference(2.5, Design)
    .practical(Exact)
    .about(
        "outer loop, integral",
        "give the integral gain from speed error to wanted current",
    );
pub(super) const CASCADE_CURRENT_KP: Parameter = number("k_pc", "motor.controller.current_kp_v_per_a", "V/A", 0.0, 1e4)
    .absent(WhenAbsent::With("kind cascade"))
    .reference(0.12, Design)
    .practical(Exact)
    .about(
        "inner loop",
        "give the gain from current error to voltage; below the resistance",
    );
pub(super) const CASCADE_CURRENT_KI: Parameter =
    number("k_ic", "motor.controller.current_ki_v_per_a_s", "V/(A s)", 0.0, 1e7)
        .absent(WhenAbsent::With("kind cascade"))
        .reference(360.0, Design)
        .practical(Exact)
        .about(
            "inner loop, integral",
            "give the integral gain from current error to voltage",
        );
pub(super) const CASCADE_CURRENT_LIMIT: Parameter = number("i_max", "motor.controller.current_limit_a", "A", 1e-3, 1e4)
    .absent(WhenAbsent::Same("motor.current_limit_a"))
    .practical(Exact)
    .about(
        "largest current a cascade asks for",
        "give the largest current that the control may ask for, or leave it out",
    );
pub(super) const STEERING_LAG: Parameter = number("", "steering.lag_s", "s", 0.0, 10.0)
    .reference(0.08, Estimate)
    .practical(Relative(0.5))
    .about(
        "time constant of the steering gear",
        "give the time constant of the steering gear, 0 = none",
    );
pub(super) const STEERING_FILTER: Parameter = number("", "steering.filter_s", "s", 0.0, 10.0)
    .absent(WhenAbsent::Nothing)
    .practical(Absolute(0.02))
    .about(
        "time constant of a filter in front of the steering gear; equal to lag_s: a servo of second order",
        "give the time constant of the filter in front of the steering gear, or leave it out",
    );
pub(super) const STEERING_RATE: Parameter = number("", "steering.rate_limit_rad_per_s", "rad/s", 1e-3, 1e3)
    .absent(WhenAbsent::Unlimited)
    .reference(6.0, Estimate)
    .practical(Relative(0.2))
    .about(
        "largest steering rate",
        "give the largest steering rate, or null for none",
    );
pub(super) const STEERING_ANGLE: Parameter = number("", "steering.angle_limit_rad", "rad", 0.01, 1.5)
    .absent(WhenAbsent::Unlimited)
    .reference(0.5, Estimate)
    .practical(Absolute(0.03))
    .about(
        "largest bicycle angle",
        "give the largest bicycle angle in radians, or null for none",
    );
pub(super) const FLOOR_FRICTION: Parameter = number("mu", "floor_friction", "", 0.01, 3.0)
    .reference(0.8, Estimate)
    .practical(Relative(0.5))
    .about(
        "friction coefficient of tyre on floor",
        "give the friction coefficient of tyre on floor, usually 0.3 to 1",
    );
pub(super) const TREAD_SLIP_SCALE: Parameter = number("s_0", "tread.slip_scale_m_per_s", "m/s", 0.0007, 0.5)
    .absent(WhenAbsent::With("tread"))
    .practical(Relative(0.5))
    .about(
        "slip at which a wheel at rest nears the friction; 0.02 without a tread",
        "give the slip of a standing wheel that uses most of the friction, 0.02 when unknown",
    );
pub(super) const TREAD_CREEP: Parameter = number("c", "tread.creep", "", 0.0, 0.5)
    .absent(WhenAbsent::With("tread"))
    .practical(Absolute(0.02))
    .about(
        "what rolling adds to it, over the speed of the rim",
        "give the slip ratio over the share of the friction used, 0 for none",
    );
pub(super) const TREAD_TAIL: Parameter = number("t", "tread.tail", "", 0.0, 1.0)
    .absent(WhenAbsent::With("tread"))
    .practical(Absolute(0.25))
    .about(
        "share of the curve q / (1 + q) beside tanh q, which nears the friction sooner",
        "give 0 for tanh, 1 for q / (1 + q)",
    );
pub(super) const TREAD_SLIDING: Parameter = number("k", "tread.sliding", "", 0.5, 1.0)
    .absent(WhenAbsent::With("tread"))
    .practical(Absolute(0.05))
    .about(
        "friction of fast sliding over the floor's",
        "give sliding over static friction, 1 when unknown",
    );
pub(super) const ACCELEROMETER_LAG: Parameter = number("", "accelerometer_lag_s", "s", 0.0, 1.0)
    .absent(WhenAbsent::Nothing)
    .practical(Absolute(0.005))
    .about(
        "time constant of the accelerometer's low-pass filter, through which logs are compared",
        "give the time constant of the accelerometer's filter, or leave it out",
    );
pub(super) const NOISE_POSE_XY: Parameter =
    noise("noise.pose_xy_m", "m", "tracked position, each axis").reference(0.001, Estimate);
pub(super) const NOISE_POSE_YAW: Parameter =
    noise("noise.pose_yaw_rad", "rad", "tracked heading").reference(0.003, Estimate);
pub(super) const NOISE_WHEEL: Parameter =
    noise("noise.wheel_rad_per_s", "rad/s", "wheel speed").reference(0.05, Estimate);
pub(super) const NOISE_CURRENT: Parameter = noise("noise.current_a", "A", "motor current").reference(0.03, Estimate);
pub(super) const NOISE_GYRO: Parameter = noise("noise.gyro_rad_per_s", "rad/s", "yaw rate").reference(0.006, Estimate);
pub(super) const NOISE_ACCEL: Parameter =
    noise("noise.accel_m_per_s2", "m/s2", "acceleration, each axis").reference(0.05, Estimate);
pub(super) const NOISE_BUS: Parameter = noise("noise.bus_v", "V", "battery voltage").reference(0.03, Estimate);
pub(super) const NOISE_STEERING: Parameter =
    noise("noise.steering_rad", "rad", "steering angle").reference(0.002, Estimate);

/// All of them, in the order of the description.
pub const TABLE: &[&Parameter] = &[
    &MASS,
    &YAW_INERTIA,
    &COM_HEIGHT,
    &WHEEL_X,
    &WHEEL_Y,
    &ROLLING_DIRECTION,
    &WHEEL_RADIUS,
    &SPIN_INERTIA,
    &GEAR_RATIO,
    &TORQUE_CONSTANT,
    &RESISTANCE,
    &CURRENT_LIMIT,
    &SUPPLY,
    &VISCOUS,
    &COULOMB,
    &SPEED_LOOP_KP,
    &SPEED_LOOP_KI,
    &CONTROLLER_RATE,
    &CONTROLLER_DELAY,
    &CONTROLLER_TICKS,
    &CONTROLLER_WINDOW,
    &CASCADE_SPEED_KP,
    &CASCADE_SPEED_KI,
    &CASCADE_CURRENT_KP,
    &CASCADE_CURRENT_KI,
    &CASCADE_CURRENT_LIMIT,
    &STEERING_LAG,
    &STEERING_FILTER,
    &STEERING_RATE,
    &STEERING_ANGLE,
    &FLOOR_FRICTION,
    &TREAD_SLIP_SCALE,
    &TREAD_CREEP,
    &TREAD_TAIL,
    &TREAD_SLIDING,
    &ACCELEROMETER_LAG,
    &NOISE_POSE_XY,
    &NOISE_POSE_YAW,
    &NOISE_WHEEL,
    &NOISE_CURRENT,
    &NOISE_GYRO,
    &NOISE_ACCEL,
    &NOISE_BUS,
    &NOISE_STEERING,
];
