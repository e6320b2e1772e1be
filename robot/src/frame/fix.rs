//! Where the laboratory saw a robot, for the robot's own estimate. It moves nothing and does not feed the watchdog.

use super::wire::{Reader, Writer};
use super::{COMMAND_MAX_CHARACTERS, Header, TYPE_FIX};
use crate::key::Key;

pub(super) const BYTES: usize = 16;

const POSITION_UNIT_M: f64 = 0.0001;
const ANGLE_UNIT_RAD: f64 = 0.0001;
const POSITION_SD_UNIT_M: f64 = 0.0005;
const YAW_SD_UNIT_RAD: f64 = 0.001;

/// A measured pose in the world.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Fix {
    pub x_m: f64,
    pub y_m: f64,
    /// Wrapped to +-pi.
    pub yaw_rad: f64,
    /// Middle of the exposure on the clock of the sender.
    pub exposure_ms: u32,
    /// One standard deviation each way, resolution 0.0005, at most 0.1275.
    pub position_sd_m: f64,
    /// Resolution 0.001, at most 0.255.
    pub yaw_sd_rad: f64,
}

/// Writes a fix and returns its length in characters.
pub fn encode_fix(header: &Header, fix: &Fix, key: &Key, out: &mut [u8; COMMAND_MAX_CHARACTERS]) -> usize {
    let mut writer = Writer::new(TYPE_FIX, header);
    writer.put_i32(fix.x_m, POSITION_UNIT_M);
    writer.put_i32(fix.y_m, POSITION_UNIT_M);
    writer.put_i16(fix.yaw_rad, ANGLE_UNIT_RAD);
    writer.put(&fix.exposure_ms.to_be_bytes());
    writer.put_u8(fix.position_sd_m, POSITION_SD_UNIT_M);
    writer.put_u8(fix.yaw_sd_rad, YAW_SD_UNIT_RAD);
    writer.finish(key, out)
}

pub(super) fn read(reader: &mut Reader<'_>) -> Fix {
    Fix {
        x_m: reader.scaled_i32(POSITION_UNIT_M),
        y_m: reader.scaled_i32(POSITION_UNIT_M),
        yaw_rad: reader.scaled_i16(ANGLE_UNIT_RAD),
        exposure_ms: reader.u32(),
        position_sd_m: reader.scaled_u8(POSITION_SD_UNIT_M),
        yaw_sd_rad: reader.scaled_u8(YAW_SD_UNIT_RAD),
    }
}
