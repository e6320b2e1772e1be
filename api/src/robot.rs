//! Robot description as it stands in `run.json` and in the laboratory's file.

use crate::health::{LinkQuality, RobotActivity, RobotHealth};
use serde::{Deserialize, Serialize};

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct RobotDescription {
    pub name: String,
    /// `omni4`, `diff2`, `diff4`, `fwd`, `rwd` or `awd`.
    pub chassis: String,
    pub mass_kg: f64,
    pub yaw_inertia_kg_m2: f64,
    pub com_height_m: f64,
    pub wheels: Vec<Wheel>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub motor: Option<Motor>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub steering: Option<Steering>,
    pub floor_friction: f64,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub noise: Option<Noise>,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct Wheel {
    pub x_m: f64,
    pub y_m: f64,
    pub rolling_direction_rad: f64,
    /// Optional for casters.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub radius_m: Option<f64>,
    /// Includes the reflected rotor inertia; optional for casters.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub spin_inertia_kg_m2: Option<f64>,
    /// `omni`, `standard` or `caster`.
    pub kind: String,
    pub driven: bool,
    pub steered: bool,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct Motor {
    pub gear_ratio: f64,
    pub torque_constant_n_m_per_a: f64,
    pub resistance_ohm: f64,
    /// `null` = no limit.
    pub current_limit_a: Option<f64>,
    pub supply_v: f64,
    /// At the wheel.
    pub viscous_n_m_s: f64,
    /// At the wheel.
    pub coulomb_n_m: f64,
    pub speed_loop_kp_v_s_per_rad: f64,
    pub speed_loop_ki_v_per_rad: f64,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub controller: Option<MotorController>,
}

/// Control of the motors; absent: speed PI at 480 Hz on the exact speed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct MotorController {
    /// `speed_pi` or `cascade` (outer speed, inner current PI).
    pub kind: String,
    /// A divisor or a multiple of 480 Hz, 10 to 9600.
    pub sample_rate_hz: u32,
    pub computation_delay_samples: u32,
    /// Counts of one turn of the wheel; absent: the speed is known exactly.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub encoder_ticks_per_rev: Option<u32>,
    /// Given exactly with an encoder.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub speed_window_samples: Option<u32>,
    /// The four gains are given exactly for a cascade.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub speed_kp_a_s_per_rad: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub speed_ki_a_per_rad: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub current_kp_v_per_a: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub current_ki_v_per_a_s: Option<f64>,
    /// Largest current a cascade asks for; absent: that of the motor.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub current_limit_a: Option<f64>,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct Steering {
    pub lag_s: f64,
    pub rate_limit_rad_per_s: Option<f64>,
    pub angle_limit_rad: Option<f64>,
}

/// One standard deviation each; a missing entry means the sensor is absent or its noise unknown.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct Noise {
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pose_xy_m: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pose_yaw_rad: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub wheel_rad_per_s: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub current_a: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gyro_rad_per_s: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub accel_m_per_s2: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bus_v: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub steering_rad: Option<f64>,
}

/// A robot of a laboratory.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct LabRobot {
    /// Address on the robot link, 1..=250; UDP port = base + number.
    pub number: u8,
    /// On-board controller: `mega2560`, `sam3x` or `tx2`.
    pub controller: String,
    /// Radius of the bounding circle around the body origin.
    pub bounding_radius_m: f64,
    pub description: RobotDescription,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct RobotView {
    pub name: String,
    pub arena: String,
    #[serde(flatten)]
    pub robot: LabRobot,
    /// `idle`, `leased` or `offline`.
    pub state: String,
    pub message: Option<String>,
    /// Last measured bus voltage.
    pub bus_v: Option<f64>,
    /// What it last said about itself.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub health: Option<RobotHealth>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub link: Option<LinkQuality>,
    /// Absent in a run, and where there are no docks.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub activity: Option<RobotActivity>,
}
