//! Link frames: `:` + upper-case hexadecimal + `\n`, the same bytes on UDP and on a serial line.
//!
//! Fields are big-endian: header, payload, CRC-16 over all before it, 4-byte keyed MAC over all before it.

use crate::MAX_MOTORS;
use crate::crc::crc16;
use crate::hex;
use crate::key::{Key, MAC_BYTES};
use core::fmt;

/// Version of the byte layout that this code speaks.
pub const VERSION: u8 = 1;
/// Characters of the longest command, the enclosing `:` and `\n` included.
pub const COMMAND_MAX_CHARACTERS: usize = 96;
/// Characters of the longest telemetry frame.
pub const TELEMETRY_MAX_CHARACTERS: usize = 160;

const TYPE_COMMAND: u8 = 1;
const TYPE_TELEMETRY: u8 = 2;
const HEADER_BYTES: usize = 23;
const COMMAND_BYTES: usize = HEADER_BYTES + 11;
const TELEMETRY_BYTES: usize = HEADER_BYTES + 47;
const TRAILER_BYTES: usize = 2 + MAC_BYTES;
const MAX_BYTES: usize = TELEMETRY_BYTES + TRAILER_BYTES;

const WHEEL_SPEED_UNIT_RAD_PER_S: f64 = 0.01;
const WHEEL_ANGLE_UNIT_RAD: f64 = 0.001;
const CURRENT_UNIT_A: f64 = 0.01;
const BUS_UNIT_V: f64 = 0.001;
const GYRO_UNIT_RAD_PER_S: f64 = 0.001;
const ACCEL_UNIT_M_PER_S2: f64 = 0.01;
const STEERING_UNIT_RAD: f64 = 0.0001;

/// What every frame begins with.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Header {
    /// Number of the robot that the frame is for or from.
    pub robot: u8,
    /// Command: epoch of the run. Telemetry: the largest epoch the robot has seen.
    pub epoch: u32,
    /// Counts frames of this sender; strictly increasing within an epoch.
    pub sequence: u32,
    /// Command: control tick of the run. Telemetry: tick of the last accepted command.
    pub tick: u32,
    /// Sender's millisecond clock when it sent; wraps around. 0 is sent as 1.
    pub clock_ms: u32,
    /// `clock_ms` of the last frame that the sender received from its peer; 0 = none yet.
    pub echo_ms: u32,
}

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

/// A decoded frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Frame {
    pub header: Header,
    pub payload: Payload,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Payload {
    Command(Command),
    Telemetry(Telemetry),
}

/// What is wrong with received bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FrameError {
    /// Fewer or more characters than this type of frame has.
    Length { characters: usize },
    /// Does not begin with `:`.
    Start { found: u8 },
    /// Does not end with `\n`.
    End { found: u8 },
    /// Not an upper-case hexadecimal digit.
    Digit { position: usize, found: u8 },
    /// A layout that this code does not speak.
    Version { found: u8 },
    /// Neither command nor telemetry.
    Type { found: u8 },
    /// Reserved bits are set.
    Reserved { found: u8 },
    /// Damaged on the way.
    Crc { computed: u16, found: u16 },
    /// Intact, but not made with this robot's key.
    Mac,
}

impl fmt::Display for FrameError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Length { characters } => write!(f, "a frame of {characters} characters does not exist"),
            Self::Start { found } => write!(f, "begins with byte {found:#04x} instead of ':'"),
            Self::End { found } => write!(f, "ends with byte {found:#04x} instead of a line feed"),
            Self::Digit { position, found } => {
                write!(f, "byte {found:#04x} at {position} is no upper-case hexadecimal digit")
            }
            Self::Version { found } => write!(f, "layout version {found} is not {VERSION}"),
            Self::Type { found } => write!(f, "unknown frame type {found}"),
            Self::Reserved { found } => write!(f, "reserved bits set in {found:#04x}"),
            Self::Crc { computed, found } => write!(f, "crc {found:#06x} instead of {computed:#06x}"),
            Self::Mac => write!(f, "authentication code does not fit the key"),
        }
    }
}

impl core::error::Error for FrameError {}

/// Writes a command frame and returns its length in characters.
pub fn encode_command(header: &Header, command: &Command, key: &Key, out: &mut [u8; COMMAND_MAX_CHARACTERS]) -> usize {
    let mut writer = Writer::new(TYPE_COMMAND, header);
    writer.put(&[u8::from(command.enable) | u8::from(command.stop) << 1 | u8::from(command.clear) << 2]);
    for speed in command.wheel_rad_per_s {
        writer.put_i16(speed, WHEEL_SPEED_UNIT_RAD_PER_S);
    }
    writer.put_i16(command.steering_rad, STEERING_UNIT_RAD);
    writer.finish(key, out)
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

/// Reads one frame, checking everything from the outside in: length, enclosure, digits, version, type, CRC, MAC.
///
/// Never panics. A frame with any single bit changed is an error.
pub fn decode(characters: &[u8], key: &Key) -> Result<Frame, FrameError> {
    let mut bytes = [0; MAX_BYTES];
    let bytes = unwrap_hex(characters, &mut bytes)?;
    let wrong_length = FrameError::Length {
        characters: characters.len(),
    };
    let (signed, mac) = bytes.split_last_chunk::<MAC_BYTES>().ok_or(wrong_length)?;
    let (body, crc) = signed.split_last_chunk::<2>().ok_or(wrong_length)?;
    let mut reader = Reader { rest: body };
    let version = reader.u8();
    if version != VERSION {
        return Err(FrameError::Version { found: version });
    }
    let kind = reader.u8();
    let expected_bytes = match kind {
        TYPE_COMMAND => COMMAND_BYTES,
        TYPE_TELEMETRY => TELEMETRY_BYTES,
        found => return Err(FrameError::Type { found }),
    };
    if body.len() != expected_bytes {
        return Err(wrong_length);
    }
    let (computed, found) = (crc16(body), u16::from_be_bytes(*crc));
    if computed != found {
        return Err(FrameError::Crc { computed, found });
    }
    if key
        .mac(signed)
        .iter()
        .zip(mac)
        .fold(0, |difference, (a, b)| difference | (a ^ b))
        != 0
    {
        return Err(FrameError::Mac);
    }
    let header = Header {
        robot: reader.u8(),
        epoch: reader.u32(),
        sequence: reader.u32(),
        tick: reader.u32(),
        clock_ms: reader.u32(),
        echo_ms: reader.u32(),
    };
    let payload = if kind == TYPE_COMMAND {
        Payload::Command(read_command(&mut reader)?)
    } else {
        Payload::Telemetry(read_telemetry(&mut reader)?)
    };
    Ok(Frame { header, payload })
}

fn read_command(reader: &mut Reader<'_>) -> Result<Command, FrameError> {
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

fn read_telemetry(reader: &mut Reader<'_>) -> Result<Telemetry, FrameError> {
    let status = reader.u8();
    Ok(Telemetry {
        status: Status::from_byte(status).ok_or(FrameError::Reserved { found: status })?,
        applied_sequence: reader.u32(),
        wheel_rad_per_s: core::array::from_fn(|_| reader.scaled_i16(WHEEL_SPEED_UNIT_RAD_PER_S)),
        wheel_rad: core::array::from_fn(|_| f64::from(reader.u32().cast_signed()) * WHEEL_ANGLE_UNIT_RAD),
        current_a: core::array::from_fn(|_| reader.scaled_i16(CURRENT_UNIT_A)),
        bus_v: f64::from(reader.u16()) * BUS_UNIT_V,
        gyro_z_rad_per_s: reader.scaled_i16(GYRO_UNIT_RAD_PER_S),
        accel_m_per_s2: core::array::from_fn(|_| reader.scaled_i16(ACCEL_UNIT_M_PER_S2)),
        steering_rad: reader.scaled_i16(STEERING_UNIT_RAD),
    })
}

impl Status {
    fn to_byte(self) -> u8 {
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

    fn from_byte(byte: u8) -> Option<Self> {
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

fn unwrap_hex<'a>(characters: &[u8], out: &'a mut [u8; MAX_BYTES]) -> Result<&'a [u8], FrameError> {
    let wrong_length = FrameError::Length {
        characters: characters.len(),
    };
    let [start, digits @ .., end] = characters else {
        return Err(wrong_length);
    };
    if *start != b':' {
        return Err(FrameError::Start { found: *start });
    }
    if *end != b'\n' {
        return Err(FrameError::End { found: *end });
    }
    let shortest = HEADER_BYTES + TRAILER_BYTES;
    if digits.len() % 2 != 0 || !(shortest..=MAX_BYTES).contains(&(digits.len() / 2)) {
        return Err(wrong_length);
    }
    for (index, (byte, pair)) in out.iter_mut().zip(digits.chunks_exact(2)).enumerate() {
        let value = |offset: usize| {
            hex::digit(pair[offset]).ok_or(FrameError::Digit {
                position: 1 + 2 * index + offset,
                found: pair[offset],
            })
        };
        *byte = value(0)? << 4 | value(1)?;
    }
    Ok(&out[..digits.len() / 2])
}

struct Writer {
    bytes: [u8; MAX_BYTES],
    length: usize,
}

impl Writer {
    fn new(kind: u8, header: &Header) -> Self {
        let mut writer = Self {
            bytes: [0; MAX_BYTES],
            length: 0,
        };
        writer.put(&[VERSION, kind, header.robot]);
        for field in [
            header.epoch,
            header.sequence,
            header.tick,
            header.clock_ms.max(1),
            header.echo_ms,
        ] {
            writer.put(&field.to_be_bytes());
        }
        writer
    }

    fn put(&mut self, bytes: &[u8]) {
        for (place, byte) in self.bytes.iter_mut().skip(self.length).zip(bytes) {
            *place = *byte;
        }
        self.length += bytes.len();
    }

    /// Saturates; NaN becomes 0.
    fn put_i16(&mut self, value: f64, unit: f64) {
        self.put(&(libm::round(value / unit) as i16).to_be_bytes());
    }

    fn finish(mut self, key: &Key, out: &mut [u8]) -> usize {
        self.put(&crc16(&self.bytes[..self.length]).to_be_bytes());
        self.put(&key.mac(&self.bytes[..self.length]));
        out[0] = b':';
        let end = 1 + hex::write_hex(&self.bytes[..self.length], &mut out[1..]);
        out[end] = b'\n';
        end + 1
    }
}

/// Reads big-endian fields; past the end it reads zeros (lengths are checked before).
struct Reader<'a> {
    rest: &'a [u8],
}

impl Reader<'_> {
    fn take<const N: usize>(&mut self) -> [u8; N] {
        match self.rest.split_first_chunk::<N>() {
            Some((field, rest)) => {
                self.rest = rest;
                *field
            }
            None => [0; N],
        }
    }

    fn u8(&mut self) -> u8 {
        u8::from_be_bytes(self.take())
    }

    fn u16(&mut self) -> u16 {
        u16::from_be_bytes(self.take())
    }

    fn u32(&mut self) -> u32 {
        u32::from_be_bytes(self.take())
    }

    fn scaled_i16(&mut self, unit: f64) -> f64 {
        f64::from(i16::from_be_bytes(self.take())) * unit
    }
}
