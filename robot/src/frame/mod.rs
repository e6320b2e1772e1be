//! Link frames: `:` + upper-case hexadecimal + `\n`, the same bytes on UDP and on a serial line.
//!
//! Fields are big-endian: header, payload, CRC-16 over all before it, 4-byte keyed MAC over all before it. A group of commands
//! has one header and CRC and a MAC for every part ([`group`]).

pub mod command;
pub mod counters;
pub mod fix;
pub mod group;
pub mod health;
pub mod target;
pub mod telemetry;
mod wire;

use crate::key::{Key, MAC_BYTES};
use core::fmt;
use wire::{HEADER_BYTES, MAX_BYTES, Reader, TRAILER_BYTES, check_crc, check_mac, unwrap_hex};

pub use command::{Command, encode_command};
pub use counters::{Counters, encode_counters};
pub use fix::{Fix, encode_fix};
pub use group::{GroupHeader, Part, decode_for, encode_group};
pub use health::{Health, encode_health};
pub use target::{Aim, Region, Target, encode_target};
pub use telemetry::{Status, Telemetry, encode_telemetry};

/// Version of the byte layout that this code speaks.
pub const VERSION: u8 = 1;
/// Characters of the longest command to one robot, the enclosing `:` and `\n` included.
pub const COMMAND_MAX_CHARACTERS: usize = 96;
/// Characters of the longest telemetry frame.
pub const TELEMETRY_MAX_CHARACTERS: usize = 160;
/// Robots in one group frame.
pub const GROUP_MAX_ROBOTS: usize = 16;
/// Characters of the longest frame, a full group.
pub const MAX_CHARACTERS: usize = 44 + 40 * GROUP_MAX_ROBOTS;

const TYPE_COMMAND: u8 = 1;
const TYPE_TELEMETRY: u8 = 2;
const TYPE_GROUP: u8 = 3;
const TYPE_HEALTH: u8 = 4;
const TYPE_COUNTERS: u8 = 5;
const TYPE_TARGET: u8 = 6;
const TYPE_FIX: u8 = 7;

const WHEEL_SPEED_UNIT_RAD_PER_S: f64 = 0.01;
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
    Health(Health),
    Counters(Counters),
    Target(Target),
    Fix(Fix),
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
    /// A type that this code does not know, or that does not go this way.
    Type { found: u8 },
    /// Reserved bits are set, or a value that has no meaning.
    Reserved { found: u8 },
    /// Damaged on the way.
    Crc { computed: u16, found: u16 },
    /// Intact, but not made with this robot's key.
    Mac,
    /// A group whose parts do not stand in ascending order of robots.
    Parts { position: usize },
    /// A group without a part for this robot.
    NoPart,
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
            Self::Parts { position } => write!(f, "part {position} of the group is not in ascending order of robots"),
            Self::NoPart => write!(f, "the group has no part for this robot"),
        }
    }
}

impl core::error::Error for FrameError {}

/// Reads one frame to or from a single robot, checking everything from the outside in: length, enclosure, digits, version,
/// type, CRC, MAC. Groups are read by [`decode_for`].
///
/// Never panics. A frame with any single bit changed is an error.
pub fn decode(characters: &[u8], key: &Key) -> Result<Frame, FrameError> {
    let mut bytes = [0; MAX_BYTES];
    decode_bytes(unwrap_hex(characters, &mut bytes)?, characters.len(), key)
}

fn decode_bytes(bytes: &[u8], characters: usize, key: &Key) -> Result<Frame, FrameError> {
    let wrong_length = FrameError::Length { characters };
    let (signed, mac) = bytes.split_last_chunk::<MAC_BYTES>().ok_or(wrong_length)?;
    let (body, crc) = signed.split_last_chunk::<2>().ok_or(wrong_length)?;
    let mut reader = Reader { rest: body };
    let version = reader.u8();
    if version != VERSION {
        return Err(FrameError::Version { found: version });
    }
    let kind = reader.u8();
    let payload_bytes = match kind {
        TYPE_COMMAND => command::BYTES,
        TYPE_TELEMETRY => telemetry::BYTES,
        TYPE_HEALTH => health::BYTES,
        TYPE_COUNTERS => counters::BYTES,
        TYPE_TARGET => target::BYTES,
        TYPE_FIX => fix::BYTES,
        found => return Err(FrameError::Type { found }),
    };
    if body.len() != HEADER_BYTES + payload_bytes {
        return Err(wrong_length);
    }
    check_crc(body, *crc)?;
    check_mac(key.mac(signed), *mac)?;
    let header = Header {
        robot: reader.u8(),
        epoch: reader.u32(),
        sequence: reader.u32(),
        tick: reader.u32(),
        clock_ms: reader.u32(),
        echo_ms: reader.u32(),
    };
    let payload = match kind {
        TYPE_COMMAND => Payload::Command(command::read(&mut reader)?),
        TYPE_TELEMETRY => Payload::Telemetry(telemetry::read(&mut reader)?),
        TYPE_HEALTH => Payload::Health(health::read(&mut reader)?),
        TYPE_COUNTERS => Payload::Counters(counters::read(&mut reader)),
        TYPE_TARGET => Payload::Target(target::read(&mut reader)?),
        _ => Payload::Fix(fix::read(&mut reader)),
    };
    Ok(Frame { header, payload })
}

/// Bytes of a frame of one robot with a payload of this size, in characters.
const fn characters_of(payload_bytes: usize) -> usize {
    2 + 2 * (HEADER_BYTES + payload_bytes + TRAILER_BYTES)
}

const _: () = assert!(
    characters_of(command::BYTES) <= COMMAND_MAX_CHARACTERS
        && characters_of(target::BYTES) <= COMMAND_MAX_CHARACTERS
        && characters_of(fix::BYTES) <= COMMAND_MAX_CHARACTERS
        && characters_of(telemetry::BYTES) <= TELEMETRY_MAX_CHARACTERS
        && characters_of(health::BYTES) <= TELEMETRY_MAX_CHARACTERS
        && characters_of(counters::BYTES) <= TELEMETRY_MAX_CHARACTERS
);
