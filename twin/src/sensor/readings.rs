//! What the sensors of one robot said at one physics step.

use serde::{Deserialize, Serialize};

use super::encoder::EncoderReading;
use super::inertial::SpecificForce;
use super::magnetometer::MagneticField;
use super::range::RANGE_SENSORS;
use super::tracked_pose::TrackedPose;
use crate::MAX_WHEELS;

/// Readings of one step; `None` where the sensor is absent or has no sample at this step.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Readings {
    pub encoder: Option<EncoderReading>,
    /// By position in `wheels`, 0 where no motor drives the wheel; positive drives along the rolling direction.
    pub current_a: Option<[f64; MAX_WHEELS]>,
    pub bus_v: Option<f64>,
    /// Bicycle angle, positive turns left.
    pub steering_rad: Option<f64>,
    /// Counter-clockwise positive.
    pub gyro_z_rad_per_s: Option<f64>,
    pub specific_force: Option<SpecificForce>,
    pub magnetic_field: Option<MagneticField>,
    /// By position in `mounts`; the inner `None` is nothing within range.
    pub range_m: Option<[Option<f64>; RANGE_SENSORS]>,
    /// Frames whose arrival time has come, oldest first.
    pub tracked_poses: Vec<TrackedPose>,
}
