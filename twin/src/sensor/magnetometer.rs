//! Magnetometer: the earth's field in the body frame.

use serde::{Deserialize, Serialize};

use super::noise::NoiseStream;
use crate::SUBSTEPS;
use crate::pose::wrapped_rad;
use crate::state::RobotState;

/// Three-axis magnetometer in a homogeneous field.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MagnetometerSettings {
    /// Physics steps from one sample to the next.
    pub every_steps: u32,
    /// Strength of the field in tesla, usually 25e-6 to 65e-6.
    pub field_t: f64,
    /// Yaw of a robot that faces magnetic north: world yaw of true north minus declination (positive east).
    pub magnetic_north_rad: f64,
    /// Angle of the field below the horizontal, positive down (northern hemisphere).
    pub inclination_rad: f64,
    /// One standard deviation of each axis.
    pub noise_t: f64,
}

/// Magnetic flux density in the body frame, tesla.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MagneticField {
    pub forward_t: f64,
    pub left_t: f64,
    pub up_t: f64,
}

impl MagnetometerSettings {
    pub(super) fn ideal() -> MagnetometerSettings {
        MagnetometerSettings {
            every_steps: SUBSTEPS,
            field_t: 5.0e-5,
            magnetic_north_rad: 0.0,
            inclination_rad: 1.1,
            noise_t: 0.0,
        }
    }

    /// B (cos I cos(N - yaw), cos I sin(N - yaw), -sin I): the field turns against the yaw.
    pub(super) fn sample(&self, state: &RobotState, noise: &mut NoiseStream) -> MagneticField {
        let (sin_north, cos_north) = libm::sincos(self.magnetic_north_rad - state.pose.yaw_rad);
        let (sin_dip, cos_dip) = libm::sincos(self.inclination_rad);
        MagneticField {
            forward_t: self.field_t * cos_dip * cos_north + noise.error(self.noise_t),
            left_t: self.field_t * cos_dip * sin_north + noise.error(self.noise_t),
            up_t: -self.field_t * sin_dip + noise.error(self.noise_t),
        }
    }

    /// Yaw that a reading stands for, rad, wrapped to [-pi, pi].
    pub fn yaw_rad(&self, field: &MagneticField) -> f64 {
        wrapped_rad(self.magnetic_north_rad - libm::atan2(field.left_t, field.forward_t))
    }
}
