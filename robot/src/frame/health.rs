//! What a robot thinks of itself: where it is, and how it is.

use super::telemetry::Status;
use super::wire::{Reader, Writer};
use super::{FrameError, Header, TELEMETRY_MAX_CHARACTERS, TYPE_HEALTH};
use crate::battery::Level;
use crate::key::Key;

pub(super) const BYTES: usize = 27;

const POSITION_UNIT_M: f64 = 0.0001;
const ANGLE_UNIT_RAD: f64 = 0.0001;
const SPEED_UNIT_M_PER_S: f64 = 0.001;
const YAW_RATE_UNIT_RAD_PER_S: f64 = 0.001;
const BIAS_UNIT_RAD_PER_S: f64 = 0.00001;
const VOLTAGE_UNIT_V: f64 = 0.001;

/// Estimate and health of a robot.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Health {
    pub status: Status,
    pub battery: Level,
    /// The pose is in the world frame: a fix has tied it down since the robot was put down.
    pub anchored: bool,
    /// Anchored, and the standard deviations are within [`crate::estimator::BOUNDED_POSITION_M`] and
    /// [`crate::estimator::BOUNDED_YAW_RAD`].
    pub bounded: bool,
    /// A motor is driven hard and does not turn.
    pub stalled: bool,
    /// A sensor gives values that cannot be.
    pub sensor_fault: bool,
    pub x_m: f64,
    pub y_m: f64,
    /// Wrapped to +-pi.
    pub yaw_rad: f64,
    pub forward_m_per_s: f64,
    pub left_m_per_s: f64,
    pub yaw_rate_rad_per_s: f64,
    /// One standard deviation of the worse direction, at most 6.5535.
    pub position_sd_m: f64,
    pub yaw_sd_rad: f64,
    pub gyro_bias_rad_per_s: f64,
    /// Battery voltage without its load.
    pub rest_v: f64,
}

/// Writes a health frame and returns its length in characters.
pub fn encode_health(header: &Header, health: &Health, key: &Key, out: &mut [u8; TELEMETRY_MAX_CHARACTERS]) -> usize {
    let mut writer = Writer::new(TYPE_HEALTH, header);
    let flags = [health.anchored, health.bounded, health.stalled, health.sensor_fault];
    let flags = flags
        .iter()
        .enumerate()
        .fold(0, |byte, (position, &set)| byte | u8::from(set) << position);
    writer.put(&[health.status.to_byte(), health.battery.to_byte(), flags]);
    writer.put_i32(health.x_m, POSITION_UNIT_M);
    writer.put_i32(health.y_m, POSITION_UNIT_M);
    writer.put_i16(health.yaw_rad, ANGLE_UNIT_RAD);
    writer.put_i16(health.forward_m_per_s, SPEED_UNIT_M_PER_S);
    writer.put_i16(health.left_m_per_s, SPEED_UNIT_M_PER_S);
    writer.put_i16(health.yaw_rate_rad_per_s, YAW_RATE_UNIT_RAD_PER_S);
    writer.put_u16(health.position_sd_m, POSITION_UNIT_M);
    writer.put_u16(health.yaw_sd_rad, ANGLE_UNIT_RAD);
    writer.put_i16(health.gyro_bias_rad_per_s, BIAS_UNIT_RAD_PER_S);
    writer.put_u16(health.rest_v, VOLTAGE_UNIT_V);
    writer.finish(key, out)
}

pub(super) fn read(reader: &mut Reader<'_>) -> Result<Health, FrameError> {
    let [status, level, flags] = reader.take();
    if flags >> 4 != 0 {
        return Err(FrameError::Reserved { found: flags });
    }
    let flag = |position: u8| flags >> position & 1 == 1;
    Ok(Health {
        status: Status::from_byte(status).ok_or(FrameError::Reserved { found: status })?,
        battery: Level::from_byte(level).ok_or(FrameError::Reserved { found: level })?,
        anchored: flag(0),
        bounded: flag(1),
        stalled: flag(2),
        sensor_fault: flag(3),
        x_m: reader.scaled_i32(POSITION_UNIT_M),
        y_m: reader.scaled_i32(POSITION_UNIT_M),
        yaw_rad: reader.scaled_i16(ANGLE_UNIT_RAD),
        forward_m_per_s: reader.scaled_i16(SPEED_UNIT_M_PER_S),
        left_m_per_s: reader.scaled_i16(SPEED_UNIT_M_PER_S),
        yaw_rate_rad_per_s: reader.scaled_i16(YAW_RATE_UNIT_RAD_PER_S),
        position_sd_m: reader.scaled_u16(POSITION_UNIT_M),
        yaw_sd_rad: reader.scaled_u16(ANGLE_UNIT_RAD),
        gyro_bias_rad_per_s: reader.scaled_i16(BIAS_UNIT_RAD_PER_S),
        rest_v: reader.scaled_u16(VOLTAGE_UNIT_V),
    })
}
