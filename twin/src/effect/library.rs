//! The table of effects: names, parameters, laws, sizes.

use super::size::Size;

/// Where an effect acts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Hook {
    /// Between the set-point as sent and the speed loop.
    Command,
    /// Motor, gear, battery, friction of the drive, steering gear.
    Actuator,
    /// Wheel and floor.
    Contact,
    /// Force or inertia of the body as a whole.
    Body,
    /// What a sensor says.
    Sensor,
}

/// What a robot must have.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Needs {
    Nothing,
    Motor,
    Steering,
    OmniWheel,
    StandardWheel,
    Caster,
}

/// One parameter of an effect.
#[derive(Debug, Clone, Copy)]
pub struct ParameterEntry {
    pub name: &'static str,
    pub unit: &'static str,
    /// No effect.
    pub neutral: f64,
    /// Allowed range.
    pub low: f64,
    pub high: f64,
    /// At neutral the effect is gone; the others say how and where.
    pub carries_size: bool,
    pub size: Size,
}

/// One effect.
#[derive(Debug, Clone, Copy)]
pub struct EffectEntry {
    pub name: &'static str,
    pub hook: Hook,
    /// Of one wheel, named by `index`.
    pub indexed: bool,
    pub needs: Needs,
    pub parameters: &'static [ParameterEntry],
    pub law: &'static str,
    /// Manoeuvre that shows it.
    pub excitation: &'static str,
}

impl EffectEntry {
    /// A parameter by its name.
    pub fn parameter(&self, name: &str) -> Option<&'static ParameterEntry> {
        self.parameters.iter().find(|parameter| parameter.name == name)
    }
}

/// An effect by its name.
pub fn find(name: &str) -> Option<&'static EffectEntry> {
    LIBRARY.iter().find(|entry| entry.name == name)
}

const INFINITE: f64 = f64::INFINITY;
const DEG: f64 = core::f64::consts::PI / 180.0;

/// A parameter that carries the effect's size.
const fn p(name: &'static str, unit: &'static str, neutral: f64, range: (f64, f64), size: Size) -> ParameterEntry {
    ParameterEntry {
        name,
        unit,
        neutral,
        low: range.0,
        high: range.1,
        carries_size: true,
        size,
    }
}

/// A parameter of shape or place, with a usual value.
const fn shape(name: &'static str, unit: &'static str, usual: f64, range: (f64, f64)) -> ParameterEntry {
    ParameterEntry {
        name,
        unit,
        neutral: usual,
        low: range.0,
        high: range.1,
        carries_size: false,
        size: Size::Absolute(usual, usual),
    }
}

const fn effect(
    name: &'static str,
    at: (Hook, Needs, bool),
    parameters: &'static [ParameterEntry],
    law: &'static str,
    excitation: &'static str,
) -> EffectEntry {
    EffectEntry {
        name,
        hook: at.0,
        indexed: at.2,
        needs: at.1,
        parameters,
        law,
        excitation,
    }
}

use Hook::{Actuator, Body, Command, Contact, Sensor};
use Needs::{Caster, Motor, Nothing, OmniWheel, StandardWheel, Steering};
use Size::{Absolute, Droop, FullSpeed, Mass, PerKilogram, SagResistance, SideFriction, StallTorque, StallViscous};

/// Every effect, in the order of the documentation.
pub const LIBRARY: &[EffectEntry] = &[
    effect(
        "coulomb_friction",
        (Actuator, Motor, false),
        &[p("torque", "N m", 0.0, (0.0, 50.0), StallTorque(0.05, 0.25))],
        "added to t_c of every driven wheel: torque tanh(W / 0.3)",
        "slow ramps both ways, coast-down",
    ),
    effect(
        "viscous_friction",
        (Actuator, Motor, false),
        &[p("coefficient", "N m s", 0.0, (0.0, 10.0), StallViscous(0.05, 0.25))],
        "added to b_w of every driven wheel",
        "several steady speeds",
    ),
    effect(
        "stribeck_friction",
        (Actuator, Motor, false),
        &[
            p("ratio", "1", 1.0, (1.0, 5.0), Absolute(1.2, 2.5)),
            shape("speed", "rad/s", 2.0, (0.05, 20.0)),
        ],
        "t_c (1 + (ratio - 1) exp(-(W / speed)^2))",
        "very slow, start-stop",
    ),
    effect(
        "asymmetric_friction",
        (Actuator, Motor, false),
        &[p("difference", "1", 0.0, (-0.9, 0.9), Absolute(0.05, 0.5))],
        "t_c and b_w times (1 + difference) forward, (1 - difference) backward, by sign of wheel spin",
        "same speeds both ways",
    ),
    effect(
        "command_dead_band",
        (Command, Nothing, false),
        &[p("width", "rad/s", 0.0, (0.0, 50.0), FullSpeed(0.02, 0.15))],
        "0 for |c| < width, else c",
        "small commands",
    ),
    effect(
        "wheel_speed_saturation",
        (Command, Nothing, false),
        &[p("limit", "rad/s", INFINITE, (0.1, INFINITE), FullSpeed(0.6, 0.3))],
        "every wheel set-point clipped to +-limit",
        "large commands",
    ),
    effect(
        "body_speed_saturation",
        (Command, Nothing, false),
        &[
            p("forward", "m/s", INFINITE, (0.01, INFINITE), Absolute(0.6, 0.3)),
            p("left", "m/s", INFINITE, (0.01, INFINITE), Absolute(0.6, 0.3)),
            p("yaw_rate", "rad/s", INFINITE, (0.01, INFINITE), Absolute(1.5, 0.8)),
        ],
        "set-points to the nominal twist, each axis clipped, and back",
        "forward speed and yaw rate combined",
    ),
    effect(
        "acceleration_limit",
        (Command, Nothing, false),
        &[p("limit", "m/s2", INFINITE, (0.05, INFINITE), Absolute(4.0, 1.0))],
        "slew of each wheel set-point, at the rim",
        "steps of several sizes",
    ),
    effect(
        "battery_sag",
        (Actuator, Motor, false),
        &[p("resistance", "ohm", 0.0, (0.0, 5.0), SagResistance(0.02, 0.2))],
        "bus = V0 - resistance sum(V_i i_i) / bus, at least V0 / 2",
        "full-load bursts",
    ),
    effect(
        "battery_droop",
        (Actuator, Motor, false),
        &[p("rate", "V/s", 0.0, (0.0, 2.0), Droop(0.05, 0.2))],
        "V0 falls by rate, at least to V0 / 2",
        "long runs",
    ),
    effect(
        "motor_lag",
        (Command, Nothing, false),
        &[p("time_constant", "s", 0.0, (0.0, 2.0), Absolute(0.02, 0.15))],
        "first-order filter on the set-point before the speed loop",
        "steps and a sweep",
    ),
    effect(
        "command_delay",
        (Command, Nothing, false),
        &[p("delay", "s", 0.0, (0.0, 0.5), Absolute(0.01, 0.25))],
        "set-points act this much later than they were sent",
        "randomly spaced steps",
    ),
    effect(
        "localization_latency",
        (Sensor, Nothing, false),
        &[p("latency", "s", 0.0, (0.0, 0.2), Absolute(0.005, 0.06))],
        "pose(t - latency)",
        "fast yaw against the gyro",
    ),
    effect(
        "wheel_radius",
        (Contact, Nothing, false),
        &[p("relative", "1", 0.0, (-0.3, 0.3), Absolute(0.005, 0.08))],
        "R (1 + relative), all wheels",
        "straight, known distance",
    ),
    effect(
        "wheel_radius_one",
        (Contact, Nothing, true),
        &[p("relative", "1", 0.0, (-0.2, 0.2), Absolute(0.002, 0.03))],
        "R (1 + relative) of one wheel",
        "straight both ways",
    ),
    effect(
        "track_width",
        (Contact, Nothing, false),
        &[p("relative", "1", 0.0, (-0.5, 0.8), Absolute(0.02, 0.12))],
        "all y_i (omni: x_i and y_i) times (1 + relative), in contact and in the inverse kinematics",
        "in-place spins",
    ),
    effect(
        "longitudinal_slip",
        (Contact, Nothing, false),
        &[p(
            "slip_ratio_at_full_force",
            "1",
            0.0,
            (0.0, 0.5),
            Absolute(0.005, 0.12),
        )],
        "extra slip speed = ratio |R W| F_l / (mu N)",
        "hard acceleration",
    ),
    effect(
        "lateral_slip",
        (Contact, StandardWheel, false),
        &[p(
            "side_friction",
            "1",
            INFINITE,
            (0.02, INFINITE),
            SideFriction(0.85, 0.45),
        )],
        "own friction coefficient for the side direction; infinite: the floor's",
        "speed ramp at constant steering",
    ),
    effect(
        "floor_friction",
        (Contact, Nothing, false),
        &[p("scale", "1", 1.0, (0.02, 3.0), Absolute(0.9, 0.3))],
        "mu scale everywhere",
        "same manoeuvre, two floors",
    ),
    effect(
        "low_friction_patch",
        (Contact, Nothing, false),
        &[
            shape("x", "m", 0.0, (-500.0, 500.0)),
            shape("y", "m", 0.0, (-500.0, 500.0)),
            shape("radius", "m", 0.35, (0.02, 50.0)),
            p("scale", "1", 1.0, (0.02, 3.0), Absolute(0.8, 0.1)),
        ],
        "mu scale for a wheel whose contact point is inside",
        "passes over and beside",
    ),
    effect(
        "payload",
        (Body, Nothing, false),
        &[
            p("mass", "kg", 0.0, (0.0, 200.0), Mass(0.1, 0.6)),
            p("inertia", "kg m2", 0.0, (0.0, 50.0), Mass(0.001, 0.006)),
        ],
        "added to mass and yaw inertia, centred",
        "accelerations with current",
    ),
    effect(
        "center_of_mass_offset",
        (Body, Nothing, false),
        &[
            p("x", "m", 0.0, (-0.2, 0.2), Absolute(0.005, 0.05)),
            p("y", "m", 0.0, (-0.2, 0.2), Absolute(0.0, 0.0)),
        ],
        "centre of mass in body axes; yaw inertia is about it",
        "combined fast forward speed and yaw rate",
    ),
    effect(
        "floor_tilt",
        (Body, Nothing, false),
        &[
            p("x", "rad", 0.0, (-0.2, 0.2), Absolute(0.5 * DEG, 3.0 * DEG)),
            p("y", "rad", 0.0, (-0.2, 0.2), Absolute(0.0, 0.0)),
        ],
        "force m g (x, y) in world axes",
        "same manoeuvre, 4 headings",
    ),
    effect(
        "wheel_misalignment",
        (Contact, Nothing, true),
        &[p("toe", "rad", 0.0, (-0.3, 0.3), Absolute(0.5 * DEG, 3.0 * DEG))],
        "added to the rolling direction of one wheel",
        "straight both ways",
    ),
    effect(
        "steering_offset",
        (Actuator, Steering, false),
        &[p("offset", "rad", 0.0, (-0.3, 0.3), Absolute(0.5 * DEG, 4.0 * DEG))],
        "added between servo and wheels",
        "slow circles left and right",
    ),
    effect(
        "steering_scale",
        (Actuator, Steering, false),
        &[p("scale", "1", 1.0, (0.3, 2.0), Absolute(1.02, 1.3))],
        "servo angle times scale at the wheels",
        "slow circles left and right",
    ),
    effect(
        "steering_lag",
        (Actuator, Steering, false),
        &[p("time_constant", "s", 0.0, (0.0, 1.0), Absolute(0.02, 0.15))],
        "added to the servo's lag",
        "steering steps",
    ),
    effect(
        "steering_backlash",
        (Actuator, Steering, false),
        &[p("play", "rad", 0.0, (0.0, 0.3), Absolute(0.5 * DEG, 3.0 * DEG))],
        "the wheels follow the servo with play",
        "slow reversals",
    ),
    effect(
        "gyro_bias",
        (Sensor, Nothing, false),
        &[p("bias", "rad/s", 0.0, (-0.5, 0.5), Absolute(0.2 * DEG, 2.0 * DEG))],
        "gyro + bias",
        "rest",
    ),
    effect(
        "gyro_scale",
        (Sensor, Nothing, false),
        &[p("relative", "1", 0.0, (-0.3, 0.3), Absolute(0.005, 0.05))],
        "gyro (1 + relative)",
        "spins",
    ),
    effect(
        "pose_scale",
        (Sensor, Nothing, false),
        &[p("relative", "1", 0.0, (-0.2, 0.2), Absolute(0.002, 0.02))],
        "pose position (1 + relative) about the world origin",
        "whole field, independent length",
    ),
    effect(
        "lens_distortion",
        (Sensor, Nothing, false),
        &[
            p("k1", "1/m2", 0.0, (-0.05, 0.05), Absolute(5e-4, 5e-3)),
            shape("x", "m", 0.0, (-500.0, 500.0)),
            shape("y", "m", 0.0, (-500.0, 500.0)),
        ],
        "X (1 + k1 R^2) about the camera's foot point, after the lever arm",
        "whole field",
    ),
    effect(
        "marker_offset",
        (Sensor, Nothing, false),
        &[
            p("yaw", "rad", 0.0, (-0.5, 0.5), Absolute(0.5 * DEG, 4.0 * DEG)),
            p("x", "m", 0.0, (-0.2, 0.2), Absolute(0.002, 0.03)),
            p("y", "m", 0.0, (-0.2, 0.2), Absolute(0.0, 0.0)),
        ],
        "yaw added; position of the marker in body axes",
        "straight and spin",
    ),
    effect(
        "roller_drag",
        (Body, OmniWheel, false),
        &[p("per_wheel", "N s/m", 0.0, (0.0, 50.0), PerKilogram(0.08, 0.5))],
        "against the free rolling direction of each omni wheel",
        "strafe, diagonal",
    ),
    effect(
        "wheel_eccentricity",
        (Contact, Nothing, true),
        &[
            p("amplitude", "1", 0.0, (0.0, 0.2), Absolute(0.005, 0.03)),
            shape("phase", "rad", 0.0, (-7.0, 7.0)),
        ],
        "R (1 + amplitude sin(angle + phase))",
        "constant speed",
    ),
    effect(
        "carpet_grain",
        (Body, Nothing, false),
        &[
            p("force", "N", 0.0, (0.0, 100.0), PerKilogram(0.04, 0.2)),
            shape("direction", "rad", 0.0, (-4.0, 4.0)),
        ],
        "-force tanh(v_d / s0) along a world direction, v_d = velocity along it",
        "4 to 8 headings",
    ),
    effect(
        "cable_drag",
        (Body, Nothing, false),
        &[
            p("stiffness", "N/m", 0.0, (0.0, 100.0), Absolute(0.3, 2.0)),
            shape("x", "m", 0.0, (-500.0, 500.0)),
            shape("y", "m", 0.0, (-500.0, 500.0)),
            shape("slack", "m", 0.0, (0.0, 50.0)),
        ],
        "pull towards the anchor: stiffness max(0, distance - slack)",
        "corners, both ways",
    ),
    effect(
        "weak_motor",
        (Actuator, Motor, true),
        &[p("gain", "1", 1.0, (0.2, 2.0), Absolute(0.96, 0.75))],
        "k_t and k_e of one motor times gain",
        "current against its peers",
    ),
    effect(
        "encoder_scale",
        (Actuator, Nothing, true),
        &[p("relative", "1", 0.0, (-0.2, 0.2), Absolute(0.005, 0.05))],
        "angle and speed of one wheel (1 + relative), for the log and the speed loop",
        "against gyro and pose",
    ),
    effect(
        "thermal_drift",
        (Actuator, Motor, false),
        &[
            p("relative", "1", 0.0, (0.0, 1.5), Absolute(0.1, 0.4)),
            shape("time_constant", "s", 30.0, (0.5, 5000.0)),
        ],
        "R_a (1 + relative theta_i), d(theta_i)/dt = ((i_i / i_max)^2 - theta_i) / time_constant",
        "long run at load",
    ),
    effect(
        "rolling_resistance",
        (Contact, Nothing, false),
        &[p("coefficient", "1", 0.0, (0.0, 0.3), Absolute(0.005, 0.03))],
        "drag coefficient N on every wheel, against its rolling; casters along their motion",
        "coast-down with and without load",
    ),
    effect(
        "gear_backlash",
        (Actuator, Motor, false),
        &[p("play", "rad", 0.0, (0.0, 0.3), Absolute(0.5 * DEG, 3.0 * DEG))],
        "no torque while the rotor, with its inertia, crosses the play, at the wheel; the encoder sits at the rotor",
        "slow reversals",
    ),
    effect(
        "current_sensor",
        (Sensor, Motor, false),
        &[
            p("bias", "A", 0.0, (-5.0, 5.0), Absolute(0.05, 0.5)),
            p("relative", "1", 0.0, (-0.5, 0.5), Absolute(0.02, 0.1)),
        ],
        "current (1 + relative) + bias, all motors",
        "rest and load",
    ),
    effect(
        "clock_offset",
        (Sensor, Nothing, false),
        &[
            p("offset", "s", 0.0, (-0.2, 0.2), Absolute(0.005, 0.05)),
            p("drift", "1", 0.0, (-0.01, 0.01), Absolute(0.0, 0.0)),
        ],
        "on-board channels stamped t were taken at t - offset - drift t",
        "steps seen by gyro and tracker",
    ),
    effect(
        "command_hold",
        (Command, Nothing, false),
        &[
            p("loss_rate", "1", 0.0, (0.0, 0.95), Absolute(0.05, 0.3)),
            shape("burst", "s", 0.05, (0.0, 1.0)),
        ],
        "in a share loss_rate of the bursts the last set-point is held",
        "changing commands",
    ),
    effect(
        "caster_swivel",
        (Body, Caster, false),
        &[
            shape("trail", "m", 0.02, (0.002, 0.2)),
            p("torque", "N m", 0.0, (0.0, 5.0), Absolute(0.02, 0.1)),
        ],
        "friction about each caster's swivel axis, over its trail a side force",
        "reversals, turns on the spot",
    ),
    effect(
        "camera_seam",
        (Sensor, Nothing, false),
        &[
            p("x", "m", 0.0, (-0.2, 0.2), Absolute(0.003, 0.02)),
            p("y", "m", 0.0, (-0.2, 0.2), Absolute(0.0, 0.0)),
            p("yaw", "rad", 0.0, (-0.2, 0.2), Absolute(0.0, 0.0)),
        ],
        "poses at x > 0 (the second camera) moved and turned about its foot (1, 0)",
        "crossing the middle",
    ),
    effect(
        "tag_height",
        (Sensor, Nothing, false),
        &[p("z", "m", 0.0, (-0.3, 0.5), Absolute(0.02, 0.2))],
        "parallax: distance to the camera's foot (+-1, 0) times H / (H - z), H = 2.5 m",
        "whole field",
    ),
    effect(
        "rolling_shutter",
        (Sensor, Nothing, false),
        &[p("readout", "s", 0.0, (-0.05, 0.05), Absolute(0.004, 0.016))],
        "pose(t + readout y / 3 m): rows are read one after the other",
        "fast drive at the edges",
    ),
    effect(
        "imu_yaw",
        (Sensor, Nothing, false),
        &[p("yaw", "rad", 0.0, (-0.5, 0.5), Absolute(1.0 * DEG, 5.0 * DEG))],
        "accelerometer axes turned by yaw",
        "accelerations",
    ),
];
