//! Commands for several robots in one broadcast frame. Every part has its own MAC, so no robot can make a part for another.

use super::command::{self, Command};
use super::wire::{MAX_BYTES, Reader, Writer, check_crc, check_mac, unwrap_hex};
use super::{Frame, FrameError, GROUP_MAX_ROBOTS, Header, MAX_CHARACTERS, Payload, TYPE_GROUP, VERSION, decode_bytes};
use crate::key::{Key, MAC_BYTES};

/// Version, type, count, epoch, sequence, tick, clock.
const HEADER_BYTES: usize = 19;
/// Number, echo and command.
const SIGNED_PART_BYTES: usize = 1 + 4 + command::BYTES;
const PART_BYTES: usize = SIGNED_PART_BYTES + MAC_BYTES;

/// What all parts of a group share. The sequence must be larger than the last one of every robot in it.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct GroupHeader {
    pub epoch: u32,
    pub sequence: u32,
    pub tick: u32,
    pub clock_ms: u32,
}

/// One robot's command in a group.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Part {
    pub robot: u8,
    /// `clock_ms` of the last frame from this robot; 0 = none yet.
    pub echo_ms: u32,
    pub command: Command,
    pub key: Key,
}

/// Writes a group and returns its length in characters, `44 + 40 n`.
///
/// - `parts`: 1 to [`GROUP_MAX_ROBOTS`] in strictly ascending order of robots; anything else writes nothing and returns 0.
pub fn encode_group(header: &GroupHeader, parts: &[Part], out: &mut [u8; MAX_CHARACTERS]) -> usize {
    let ascending = parts
        .iter()
        .zip(parts.iter().skip(1))
        .all(|(part, next)| part.robot < next.robot);
    let count = match u8::try_from(parts.len()) {
        Ok(count @ 1..) if parts.len() <= GROUP_MAX_ROBOTS && ascending => count,
        _ => return 0,
    };
    let mut writer = Writer::empty();
    writer.put(&[VERSION, TYPE_GROUP, count]);
    for field in [header.epoch, header.sequence, header.tick, header.clock_ms.max(1)] {
        writer.put(&field.to_be_bytes());
    }
    let mut signed = [0; HEADER_BYTES + SIGNED_PART_BYTES];
    let (shared, own) = signed.split_at_mut(HEADER_BYTES);
    shared.copy_from_slice(writer.bytes());
    for part in parts {
        let begin = writer.bytes().len();
        writer.put(&[part.robot]);
        writer.put(&part.echo_ms.to_be_bytes());
        command::put(&mut writer, &part.command);
        for (place, byte) in own.iter_mut().zip(writer.bytes().iter().skip(begin)) {
            *place = *byte;
        }
        let mac = mac_of(&part.key, shared, own);
        writer.put(&mac);
    }
    writer.put_crc();
    writer.write(out)
}

fn mac_of(key: &Key, shared: &[u8], own: &[u8]) -> [u8; MAC_BYTES] {
    let mut signed = [0; HEADER_BYTES + SIGNED_PART_BYTES];
    for (place, byte) in signed.iter_mut().zip(shared.iter().chain(own)) {
        *place = *byte;
    }
    key.mac(&signed)
}

/// Reads a frame as a robot does: a frame of its own, or its part of a group as if it were one.
///
/// Never panics. Everything of a group is under the CRC; only the own part is under the own MAC.
pub fn decode_for(characters: &[u8], robot: u8, key: &Key) -> Result<Frame, FrameError> {
    let mut buffer = [0; MAX_BYTES];
    let bytes = unwrap_hex(characters, &mut buffer)?;
    match bytes {
        [VERSION, TYPE_GROUP, ..] => decode_group(bytes, characters.len(), robot, key),
        _ => decode_bytes(bytes, characters.len(), key),
    }
}

fn decode_group(bytes: &[u8], characters: usize, robot: u8, key: &Key) -> Result<Frame, FrameError> {
    let wrong_length = FrameError::Length { characters };
    let (body, crc) = bytes.split_last_chunk::<2>().ok_or(wrong_length)?;
    let (shared, parts) = body.split_at_checked(HEADER_BYTES).ok_or(wrong_length)?;
    let mut reader = Reader { rest: shared };
    let [_, _, count] = reader.take();
    let count = usize::from(count);
    if !(1..=GROUP_MAX_ROBOTS).contains(&count) || parts.len() != count * PART_BYTES {
        return Err(wrong_length);
    }
    check_crc(body, *crc)?;
    let numbers = || parts.chunks_exact(PART_BYTES).filter_map(<[u8]>::first);
    if let Some(position) = numbers().zip(numbers().skip(1)).position(|(part, next)| part >= next) {
        return Err(FrameError::Parts { position: position + 1 });
    }
    let part = parts
        .chunks_exact(PART_BYTES)
        .find(|part| part.first() == Some(&robot))
        .ok_or(FrameError::NoPart)?;
    let (own, mac) = part.split_last_chunk::<MAC_BYTES>().ok_or(wrong_length)?;
    check_mac(mac_of(key, shared, own), *mac)?;
    let mut part = Reader { rest: own };
    let header = Header {
        robot: part.u8(),
        epoch: reader.u32(),
        sequence: reader.u32(),
        tick: reader.u32(),
        clock_ms: reader.u32(),
        echo_ms: part.u32(),
    };
    let payload = Payload::Command(command::read(&mut part)?);
    Ok(Frame { header, payload })
}
