//! What a robot measured.

use super::wire::{Reader, Writer};
use super::{
    FrameError, Header, STEERING_UNIT_RAD, TELEMETRY_MAX_CHARACTERS, TYPE_TELEMETRY, WHEEL_SPEED_UNIT_RAD_PER_S,
};
use crate::MAX_MOTORS;
use crate::key::Key;

pub(super) const BYTES: usize = 47;

const WHEEL_ANGLE_UNIT_RAD: f64 = 0.001;
const CURRENT_UNIT_A: f64 = 0.01;
const BUS_UNIT_V: f64 = 0.001;
const GYRO_UNIT_RAD_PER_S: f64 = 0.001;
const ACCEL_UNIT_M_PER_S2: f64 = 0.01;

/// What a robot says about itself, bit by bit as in the `status` byte.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Status {
    /// Bit 0: the last accepted command enabled motion and nothing stops it.
    pub running: bool,
    /// Bit 1: ramping to zero, no fresh set-point.
    pub ramping: bool,
    /// Bit 2: latched off; needs `clear` or a new epoch.
    pub latched: bool,
    /// Bit 3: clock offset to the laboratory known well enough to judge the age of commands.
    pub clock_known: bool,
    /// Bit 4: latched by a `stop` flag (and not by silence).
    pub stopped: bool,
    /// Bit 5: at least one motor driver is at its current or voltage limit.
    pub saturated: bool,
}

/// What a robot measured.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Telemetry {
    pub status: Status,
    /// Sequence of the last accepted command.
    pub applied_sequence: u32,
    /// Driven wheels in the order of the description.
    pub wheel_rad_per_s: [f64; MAX_MOTORS],
    /// Absolute wheel angles since power-on, not wrapped, resolution 0.001.
    pub wheel_rad: [f64; MAX_MOTORS],
    pub current_a: [f64; MAX_MOTORS],
    pub bus_v: f64,
    pub gyro_z_rad_per_s: f64,
    /// Forward and left.
    pub accel_m_per_s2: [f64; 2],
    pub steering_rad: f64,
}

/// Writes a telemetry frame and returns its length in characters.
pub fn encode_telemetry(
    header: &Header,
    telemetry: &Telemetry,
    key: &Key,
    out: &mut [u8; TELEMETRY_MAX_CHARACTERS],
) -> usize {
    let mut writer = Writer::new(TYPE_TELEMETRY, header);
    writer.put(&[telemetry.status.to_byte()]);
    writer.put(&telemetry.applied_sequence.to_be_bytes());
    for speed in telemetry.wheel_rad_per_s {
        writer.put_i16(speed, WHEEL_SPEED_UNIT_RAD_PER_S);
    }
    for angle in telemetry.wheel_rad {
        writer.put(&(libm::round(angle / WHEEL_ANGLE_UNIT_RAD) as i32).to_be_bytes());
    }
    for current in telemetry.current_a {
        writer.put_i16(current, CURRENT_UNIT_A);
    }
    writer.put(&(libm::round(telemetry.bus_v / BUS_UNIT_V) as u16).to_be_bytes());
    writer.put_i16(telemetry.gyro_z_rad_per_s, GYRO_UNIT_RAD_PER_S);
    for acceleration in telemetry.accel_m_per_s2 {
        writer.put_i16(acceleration, ACCEL_UNIT_M_PER_S2);
    }
    writer.put_i16(telemetry.steering_rad, STEERING_UNIT_RAD);
    writer.finish(key, out)
}

pub(super) fn read(reader: &mut Reader<'_>) -> Result<Telemetry, FrameError> {
    let status = reader.u8();
    Ok(Telemetry {
        status: Status::from_byte(status).ok_or(FrameError::Reserved { found: status })?,
        applied_sequence: reader.u32(),
        wheel_rad_per_s: core::array::from_fn(|_| reader.scaled_i16(WHEEL_SPEED_UNIT_RAD_PER_S)),
        wheel_rad: core::array::from_fn(|_| reader.scaled_i32(WHEEL_ANGLE_UNIT_RAD)),
        current_a: core::array::from_fn(|_| reader.scaled_i16(CURRENT_UNIT_A)),
        bus_v: reader.scaled_u16(BUS_UNIT_V),
        gyro_z_rad_per_s: reader.scaled_i16(GYRO_UNIT_RAD_PER_S),
        accel_m_per_s2: core::array::from_fn(|_| reader.scaled_i16(ACCEL_UNIT_M_PER_S2)),
        steering_rad: reader.scaled_i16(STEERING_UNIT_RAD),
    })
}

impl Status {
    pub(super) fn to_byte(self) -> u8 {
        let bits = [
            self.running,
            self.ramping,
            self.latched,
            self.clock_known,
            self.stopped,
            self.saturated,
        ];
        bits.iter()
            .enumerate()
            .fold(0, |byte, (position, &set)| byte | u8::from(set) << position)
    }

    pub(super) fn from_byte(byte: u8) -> Option<Self> {
        let bit = |position: u8| byte >> position & 1 == 1;
        (byte >> 6 == 0).then(|| Self {
            running: bit(0),
            ramping: bit(1),
            latched: bit(2),
            clock_known: bit(3),
            stopped: bit(4),
            saturated: bit(5),
        })
    }
}
