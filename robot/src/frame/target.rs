//! A target for a robot that closes its own loop: what it is to reach, within which bounds and for how long.

use super::wire::{Reader, Writer};
use super::{COMMAND_MAX_CHARACTERS, FrameError, Header, TYPE_TARGET};
use crate::key::Key;
use crate::kinematics::Twist;

pub(super) const BYTES: usize = 18;
/// Longest time a target may hold.
pub const MAX_EXPIRY_MS: u8 = 100;

const LENGTH_UNIT_M: f64 = 0.001;
const SPEED_UNIT_M_PER_S: f64 = 0.001;
const YAW_RATE_UNIT_RAD_PER_S: f64 = 0.001;
const ANGLE_UNIT_RAD: f64 = 0.0001;
const SPEED_CAP_UNIT_M_PER_S: f64 = 0.02;
const YAW_RATE_CAP_UNIT_RAD_PER_S: f64 = 0.05;

/// What the robot is to reach.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Aim {
    /// Body twist, resolution 0.001.
    Twist(Twist),
    /// Pose in the world, resolution 0.001 m and 0.0001 rad; a car-like robot goes to the position only.
    Pose { x_m: f64, y_m: f64, yaw_rad: f64 },
}

/// Rectangle in the world that the body origin may not leave, resolution 0.001, at most +-32.767.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Region {
    pub left_m: f64,
    pub right_m: f64,
    pub bottom_m: f64,
    pub top_m: f64,
}

/// A target-level command. Caps are rounded down, the region inwards: what arrives is never wider than what was meant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Target {
    pub enable: bool,
    pub stop: bool,
    pub clear: bool,
    pub aim: Aim,
    /// Largest speed of the body origin, resolution 0.02, at most 5.1.
    pub speed_cap_m_per_s: f64,
    /// Resolution 0.05, at most 12.75.
    pub yaw_rate_cap_rad_per_s: f64,
    pub region: Region,
    /// From the sender's clock at sending, at most [`MAX_EXPIRY_MS`]; more is sent as that.
    pub expiry_ms: u8,
}

/// Writes a target frame and returns its length in characters.
pub fn encode_target(header: &Header, target: &Target, key: &Key, out: &mut [u8; COMMAND_MAX_CHARACTERS]) -> usize {
    let mut writer = Writer::new(TYPE_TARGET, header);
    let is_pose = matches!(target.aim, Aim::Pose { .. });
    writer.put(&[u8::from(target.enable)
        | u8::from(target.stop) << 1
        | u8::from(target.clear) << 2
        | u8::from(is_pose) << 3]);
    writer.put(&[target.expiry_ms.min(MAX_EXPIRY_MS)]);
    match target.aim {
        Aim::Twist(twist) => {
            writer.put_i16(twist.forward_m_per_s, SPEED_UNIT_M_PER_S);
            writer.put_i16(twist.left_m_per_s, SPEED_UNIT_M_PER_S);
            writer.put_i16(twist.yaw_rate_rad_per_s, YAW_RATE_UNIT_RAD_PER_S);
        }
        Aim::Pose { x_m, y_m, yaw_rad } => {
            writer.put_i16(x_m, LENGTH_UNIT_M);
            writer.put_i16(y_m, LENGTH_UNIT_M);
            writer.put_i16(yaw_rad, ANGLE_UNIT_RAD);
        }
    }
    // A value that stands on the grid must not be rounded away by the last bit of the division.
    let down = |value: f64, unit: f64| libm::floor(value / unit + 1e-9) * unit;
    writer.put_u8(
        down(target.speed_cap_m_per_s, SPEED_CAP_UNIT_M_PER_S),
        SPEED_CAP_UNIT_M_PER_S,
    );
    writer.put_u8(
        down(target.yaw_rate_cap_rad_per_s, YAW_RATE_CAP_UNIT_RAD_PER_S),
        YAW_RATE_CAP_UNIT_RAD_PER_S,
    );
    let up = |value: f64| -down(-value, LENGTH_UNIT_M);
    writer.put_i16(up(target.region.left_m), LENGTH_UNIT_M);
    writer.put_i16(down(target.region.right_m, LENGTH_UNIT_M), LENGTH_UNIT_M);
    writer.put_i16(up(target.region.bottom_m), LENGTH_UNIT_M);
    writer.put_i16(down(target.region.top_m, LENGTH_UNIT_M), LENGTH_UNIT_M);
    writer.finish(key, out)
}

pub(super) fn read(reader: &mut Reader<'_>) -> Result<Target, FrameError> {
    let [flags, expiry_ms] = reader.take();
    if flags >> 4 != 0 {
        return Err(FrameError::Reserved { found: flags });
    }
    if expiry_ms > MAX_EXPIRY_MS {
        return Err(FrameError::Reserved { found: expiry_ms });
    }
    let aim = if flags & 8 == 0 {
        Aim::Twist(Twist {
            forward_m_per_s: reader.scaled_i16(SPEED_UNIT_M_PER_S),
            left_m_per_s: reader.scaled_i16(SPEED_UNIT_M_PER_S),
            yaw_rate_rad_per_s: reader.scaled_i16(YAW_RATE_UNIT_RAD_PER_S),
        })
    } else {
        Aim::Pose {
            x_m: reader.scaled_i16(LENGTH_UNIT_M),
            y_m: reader.scaled_i16(LENGTH_UNIT_M),
            yaw_rad: reader.scaled_i16(ANGLE_UNIT_RAD),
        }
    };
    Ok(Target {
        enable: flags & 1 != 0,
        stop: flags & 2 != 0,
        clear: flags & 4 != 0,
        aim,
        speed_cap_m_per_s: reader.scaled_u8(SPEED_CAP_UNIT_M_PER_S),
        yaw_rate_cap_rad_per_s: reader.scaled_u8(YAW_RATE_CAP_UNIT_RAD_PER_S),
        region: Region {
            left_m: reader.scaled_i16(LENGTH_UNIT_M),
            right_m: reader.scaled_i16(LENGTH_UNIT_M),
            bottom_m: reader.scaled_i16(LENGTH_UNIT_M),
            top_m: reader.scaled_i16(LENGTH_UNIT_M),
        },
        expiry_ms,
    })
}
