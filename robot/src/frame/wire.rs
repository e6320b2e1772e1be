//! Fields, checks and hexadecimal that all frames share.

use super::{FrameError, Header, MAX_CHARACTERS, VERSION};
use crate::crc::crc16;
use crate::hex;
use crate::key::{Key, MAC_BYTES};

/// Bytes of the header of every frame but a group.
pub(super) const HEADER_BYTES: usize = 23;
/// CRC and MAC.
pub(super) const TRAILER_BYTES: usize = 2 + MAC_BYTES;
/// Bytes of the longest frame.
pub(super) const MAX_BYTES: usize = (MAX_CHARACTERS - 2) / 2;

/// Bytes of a frame in the making.
pub(super) struct Writer {
    bytes: [u8; MAX_BYTES],
    length: usize,
}

impl Writer {
    /// With version, type and the header's fields.
    pub(super) fn new(kind: u8, header: &Header) -> Self {
        let mut writer = Self::empty();
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

    pub(super) fn empty() -> Self {
        Self {
            bytes: [0; MAX_BYTES],
            length: 0,
        }
    }

    pub(super) fn bytes(&self) -> &[u8] {
        self.bytes.get(..self.length).unwrap_or_default()
    }

    pub(super) fn put(&mut self, bytes: &[u8]) {
        for (place, byte) in self.bytes.iter_mut().skip(self.length).zip(bytes) {
            *place = *byte;
        }
        self.length = (self.length + bytes.len()).min(MAX_BYTES);
    }

    /// Saturates; NaN becomes 0.
    pub(super) fn put_i16(&mut self, value: f64, unit: f64) {
        self.put(&(libm::round(value / unit) as i16).to_be_bytes());
    }

    /// Saturates; NaN becomes 0.
    pub(super) fn put_u16(&mut self, value: f64, unit: f64) {
        self.put(&(libm::round(value / unit) as u16).to_be_bytes());
    }

    /// Saturates; NaN becomes 0.
    pub(super) fn put_i32(&mut self, value: f64, unit: f64) {
        self.put(&(libm::round(value / unit) as i32).to_be_bytes());
    }

    /// Saturates; NaN becomes 0.
    pub(super) fn put_u8(&mut self, value: f64, unit: f64) {
        self.put(&[libm::round(value / unit) as u8]);
    }

    pub(super) fn put_crc(&mut self) {
        self.put(&crc16(self.bytes()).to_be_bytes());
    }

    /// Adds CRC and MAC and writes the characters; returns how many.
    pub(super) fn finish(mut self, key: &Key, out: &mut [u8]) -> usize {
        self.put_crc();
        self.put(&key.mac(self.bytes()));
        self.write(out)
    }

    /// Writes the characters and returns how many; 0 if `out` is too short.
    pub(super) fn write(&self, out: &mut [u8]) -> usize {
        let characters = 2 + 2 * self.length;
        let Some([start, digits @ .., end]) = out.get_mut(..characters) else {
            return 0;
        };
        *start = b':';
        hex::write_hex(self.bytes(), digits);
        *end = b'\n';
        characters
    }
}

/// Reads big-endian fields; past the end it reads zeros (lengths are checked before).
pub(super) struct Reader<'a> {
    pub(super) rest: &'a [u8],
}

impl Reader<'_> {
    pub(super) fn take<const N: usize>(&mut self) -> [u8; N] {
        match self.rest.split_first_chunk::<N>() {
            Some((field, rest)) => {
                self.rest = rest;
                *field
            }
            None => [0; N],
        }
    }

    pub(super) fn u8(&mut self) -> u8 {
        u8::from_be_bytes(self.take())
    }

    pub(super) fn u32(&mut self) -> u32 {
        u32::from_be_bytes(self.take())
    }

    pub(super) fn scaled_u8(&mut self, unit: f64) -> f64 {
        f64::from(self.u8()) * unit
    }

    pub(super) fn scaled_i16(&mut self, unit: f64) -> f64 {
        f64::from(i16::from_be_bytes(self.take())) * unit
    }

    pub(super) fn scaled_u16(&mut self, unit: f64) -> f64 {
        f64::from(u16::from_be_bytes(self.take())) * unit
    }

    pub(super) fn scaled_i32(&mut self, unit: f64) -> f64 {
        f64::from(i32::from_be_bytes(self.take())) * unit
    }
}

/// Length, enclosure and digits.
pub(super) fn unwrap_hex<'a>(characters: &[u8], out: &'a mut [u8; MAX_BYTES]) -> Result<&'a [u8], FrameError> {
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
    Ok(out.get(..digits.len() / 2).unwrap_or_default())
}

pub(super) fn check_crc(body: &[u8], crc: [u8; 2]) -> Result<(), FrameError> {
    let (computed, found) = (crc16(body), u16::from_be_bytes(crc));
    if computed == found {
        Ok(())
    } else {
        Err(FrameError::Crc { computed, found })
    }
}

/// Compares in a time that does not depend on where the difference is.
pub(super) fn check_mac(computed: [u8; MAC_BYTES], found: [u8; MAC_BYTES]) -> Result<(), FrameError> {
    let difference = computed
        .iter()
        .zip(found)
        .fold(0, |difference, (a, b)| difference | (a ^ b));
    if difference == 0 { Ok(()) } else { Err(FrameError::Mac) }
}
