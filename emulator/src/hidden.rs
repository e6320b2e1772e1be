//! Hidden configuration: what the emulated robots and floors really are. Only this process reads it.

pub mod change;
mod wear;

pub use change::Change;
pub use wear::Wear;

use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::Path;

/// The file, `robopheus.plant/1`.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Hidden {
    /// Always `robopheus.plant/1`.
    pub format: String,
    pub floors: BTreeMap<String, HiddenFloor>,
    pub robots: BTreeMap<String, HiddenRobot>,
    pub run_variation: RunVariation,
}

/// Why a hidden configuration cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum HiddenError {
    #[error("cannot read {path}")]
    Read { path: String, source: std::io::Error },
    #[error("not a hidden configuration")]
    Parse(#[from] serde_json::Error),
    #[error("format {found:?} is not \"robopheus.plant/1\"")]
    Format { found: String },
}

impl Hidden {
    /// The built-in configuration of the reference laboratory.
    pub fn reference() -> Result<Self, HiddenError> {
        Self::parse(include_str!("../plants/reference.json"))
    }

    pub fn read(path: &Path) -> Result<Self, HiddenError> {
        let text = std::fs::read_to_string(path).map_err(|source| HiddenError::Read {
            path: path.display().to_string(),
            source,
        })?;
        Self::parse(&text)
    }

    /// Every hidden effect at its neutral value: what is left is the difference of the equations.
    pub fn neutral() -> Self {
        let run_variation = RunVariation {
            friction: 0.0,
            mass: 0.0,
            torque_constant: 0.0,
            battery_charge: 0.0,
        };
        Self {
            format: "robopheus.plant/1".to_owned(),
            floors: BTreeMap::new(),
            robots: BTreeMap::new(),
            run_variation,
        }
    }

    /// A floor that is not listed is neutral.
    pub fn floor(&self, name: &str) -> HiddenFloor {
        self.floors.get(name).cloned().unwrap_or_default()
    }

    /// A robot that is not listed is neutral.
    pub fn robot(&self, name: &str) -> HiddenRobot {
        self.robots.get(name).cloned().unwrap_or_default()
    }

    fn parse(text: &str) -> Result<Self, HiddenError> {
        let hidden: Self = serde_json::from_str(text)?;
        if hidden.format == "robopheus.plant/1" {
            Ok(hidden)
        } else {
            Err(HiddenError::Format { found: hidden.format })
        }
    }
}

/// One standard deviation each, relative; drawn anew whenever a robot is put on the floor.
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RunVariation {
    pub friction: f64,
    pub mass: f64,
    pub torque_constant: f64,
    pub battery_charge: f64,
}

#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct HiddenFloor {
    pub friction_scale: f64,
    pub patches: Vec<FrictionPatch>,
    /// Rise per metre along x and y.
    pub slope: [f64; 2],
    /// Rolling resistance force over load.
    pub rolling_resistance: f64,
}

/// A round spot with another friction.
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FrictionPatch {
    pub x_m: f64,
    pub y_m: f64,
    pub radius_m: f64,
    pub friction_scale: f64,
}

impl Default for HiddenFloor {
    fn default() -> Self {
        Self {
            friction_scale: 1.0,
            patches: Vec::new(),
            slope: [0.0; 2],
            rolling_resistance: 0.0,
        }
    }
}

/// Wheel lists go by position in the description's `wheels`; a list that ends early goes on with the neutral value.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct HiddenRobot {
    pub mass_scale: f64,
    pub yaw_inertia_scale: f64,
    /// Centre of mass from the body origin.
    pub com_x_m: f64,
    pub com_y_m: f64,
    pub wheel_radius_scale: Vec<f64>,
    pub wheel_direction_error_rad: Vec<f64>,
    pub spring_stiffness_scale: Vec<f64>,
    pub torque_constant_scale: Vec<f64>,
    pub coulomb_scale: f64,
    /// Half the play between motor and wheel, at the wheel.
    pub half_backlash_rad: f64,
    /// Amplitude at the rotor.
    pub cogging_n_m: f64,
    /// Drag of omni rollers and casters over load.
    pub roller_drag: f64,
    pub battery_resistance_ohm: f64,
    pub battery_capacity_ah: f64,
    pub battery_charge: f64,
    pub gyro_bias_rad_per_s: f64,
    pub steering_play_rad: f64,
    pub wear: Wear,
    /// Absent: the robot carries none.
    pub magnetometer: Option<HiddenMagnetometer>,
}

/// A magnetometer and the field of the room.
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HiddenMagnetometer {
    /// World direction of the field's horizontal part, known at commissioning.
    pub north_rad: f64,
    /// Its size, known at commissioning.
    pub field_t: f64,
    /// One standard deviation of each axis.
    pub noise_t: f64,
    /// Iron of the robot itself, forward and left, which nobody knows.
    pub offset_t: [f64; 2],
}

impl Default for HiddenRobot {
    fn default() -> Self {
        Self {
            mass_scale: 1.0,
            yaw_inertia_scale: 1.0,
            com_x_m: 0.0,
            com_y_m: 0.0,
            wheel_radius_scale: Vec::new(),
            wheel_direction_error_rad: Vec::new(),
            spring_stiffness_scale: Vec::new(),
            torque_constant_scale: Vec::new(),
            coulomb_scale: 1.0,
            half_backlash_rad: 0.0,
            cogging_n_m: 0.0,
            roller_drag: 0.0,
            battery_resistance_ohm: 0.0,
            battery_capacity_ah: 10.0,
            battery_charge: 0.8,
            gyro_bias_rad_per_s: 0.0,
            steering_play_rad: 0.0,
            wear: Wear::default(),
            magnetometer: None,
        }
    }
}
