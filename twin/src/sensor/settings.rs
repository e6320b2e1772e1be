//! Which sensors a robot carries, how often they sample and how noisy they are.

use serde::{Deserialize, Serialize};

use super::electrical::{BusVoltageSettings, CurrentSettings};
use super::encoder::EncoderSettings;
use super::inertial::{AccelerometerSettings, GyroSettings};
use super::limits;
use super::magnetometer::MagnetometerSettings;
use super::range::RangeSettings;
use super::steering::SteeringSettings;
use super::tracked_pose::TrackedPoseSettings;
use crate::parameter::ParameterError;
use crate::robot::Robot;

/// Sensors of one robot; an absent entry is an absent sensor.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SensorSettings {
    #[serde(skip_serializing_if = "Option::is_none")]
    pub encoder: Option<EncoderSettings>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub current: Option<CurrentSettings>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bus_voltage: Option<BusVoltageSettings>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub steering: Option<SteeringSettings>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gyro: Option<GyroSettings>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub accelerometer: Option<AccelerometerSettings>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub magnetometer: Option<MagnetometerSettings>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub range: Option<RangeSettings>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tracked_pose: Option<TrackedPoseSettings>,
}

impl SensorSettings {
    /// Every sensor that the robot can carry, with the noise of its description.
    ///
    /// - A noise entry that is missing means a sensor without noise, not a sensor that is missing.
    /// - Current and bus voltage need a motor, the steering angle a steering gear.
    /// - All sample at 120 Hz, range sensors at 20 Hz from a ring at the bounding radius. Angles are continuous,
    ///   exposures instants, frames neither late nor lost: those numbers are not in a description.
    pub fn of(robot: &Robot) -> SensorSettings {
        let description = robot.description();
        let noise = description.noise.clone().unwrap_or_default();
        let deviation = |entry: Option<f64>| entry.unwrap_or(0.0);
        let motor = description.motor.as_ref();
        SensorSettings {
            encoder: Some(EncoderSettings {
                noise_rad_per_s: deviation(noise.wheel_rad_per_s),
                ..EncoderSettings::ideal()
            }),
            current: motor.map(|_| CurrentSettings {
                noise_a: deviation(noise.current_a),
                ..CurrentSettings::ideal()
            }),
            bus_voltage: motor.map(|_| BusVoltageSettings {
                noise_v: deviation(noise.bus_v),
                ..BusVoltageSettings::ideal()
            }),
            steering: description.steering.as_ref().map(|_| SteeringSettings {
                noise_rad: deviation(noise.steering_rad),
                ..SteeringSettings::ideal()
            }),
            gyro: Some(GyroSettings {
                noise_rad_per_s: deviation(noise.gyro_rad_per_s),
                ..GyroSettings::ideal()
            }),
            accelerometer: Some(AccelerometerSettings {
                noise_m_per_s2: deviation(noise.accel_m_per_s2),
                ..AccelerometerSettings::ideal()
            }),
            magnetometer: Some(MagnetometerSettings::ideal()),
            range: Some(RangeSettings::ideal(robot.bounding_radius_m())),
            tracked_pose: Some(TrackedPoseSettings {
                noise_xy_m: deviation(noise.pose_xy_m),
                noise_yaw_rad: deviation(noise.pose_yaw_rad),
                ..TrackedPoseSettings::ideal()
            }),
        }
    }

    /// Everything that is wrong with these settings on this robot, in the order of their fields; empty when they can be used.
    pub fn check(&self, robot: &Robot) -> Vec<ParameterError> {
        limits::check(self, robot)
    }
}
