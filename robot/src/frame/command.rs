//! Wheel set-points for one robot.

use super::wire::{Reader, Writer};
use super::{COMMAND_MAX_CHARACTERS, FrameError, Header, STEERING_UNIT_RAD, TYPE_COMMAND, WHEEL_SPEED_UNIT_RAD_PER_S};
use crate::MAX_MOTORS;
use crate::key::Key;

pub(super) const BYTES: usize = 11;

/// What the laboratory wants of one robot.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Command {
    /// Off: the set-points are taken as zero.
    pub enable: bool,
    /// Ramp to zero and latch.
    pub stop: bool,
    /// Clear a latch. `stop` wins over it.
    pub clear: bool,
    /// Set-points of the driven wheels in the order of the description, resolution 0.01, at most +-327.67; NaN is sent as 0.
    pub wheel_rad_per_s: [f64; MAX_MOTORS],
    /// Bicycle angle, resolution 0.0001.
    pub steering_rad: f64,
}

/// Writes a command frame and returns its length in characters.
pub fn encode_command(header: &Header, command: &Command, key: &Key, out: &mut [u8; COMMAND_MAX_CHARACTERS]) -> usize {
    let mut writer = Writer::new(TYPE_COMMAND, header);
    put(&mut writer, command);
    writer.finish(key, out)
}

pub(super) fn put(writer: &mut Writer, command: &Command) {
    writer.put(&[u8::from(command.enable) | u8::from(command.stop) << 1 | u8::from(command.clear) << 2]);
    for speed in command.wheel_rad_per_s {
        writer.put_i16(speed, WHEEL_SPEED_UNIT_RAD_PER_S);
    }
    writer.put_i16(command.steering_rad, STEERING_UNIT_RAD);
}

pub(super) fn read(reader: &mut Reader<'_>) -> Result<Command, FrameError> {
    let flags = reader.u8();
    if flags & !0b111 != 0 {
        return Err(FrameError::Reserved { found: flags });
    }
    Ok(Command {
        enable: flags & 1 != 0,
        stop: flags & 2 != 0,
        clear: flags & 4 != 0,
        wheel_rad_per_s: core::array::from_fn(|_| reader.scaled_i16(WHEEL_SPEED_UNIT_RAD_PER_S)),
        steering_rad: reader.scaled_i16(STEERING_UNIT_RAD),
    })
}
