//! How many frames a robot took, and why it refused the others.

use super::wire::{Reader, Writer};
use super::{FrameError, Header, TELEMETRY_MAX_CHARACTERS, TYPE_COUNTERS};
use crate::acceptance::Refusal;
use crate::key::Key;

pub(super) const BYTES: usize = 4 * FIELDS;
const FIELDS: usize = 12;

/// Frames since power-on; every counter wraps around.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Counters {
    /// Commands and targets that set the set-points.
    pub accepted: u32,
    /// Fixes in order; the estimator may still have left some out.
    pub fixes: u32,
    /// Wrong length, enclosure, digit or order of parts.
    pub malformed: u32,
    /// A version or type that the robot does not know.
    pub unknown: u32,
    pub crc: u32,
    pub mac: u32,
    /// Reserved bits or values.
    pub reserved: u32,
    /// For another robot or from one.
    pub not_for_this_robot: u32,
    pub old_epoch: u32,
    pub out_of_order: u32,
    pub clock_unknown: u32,
    pub stale: u32,
}

impl Counters {
    pub(crate) fn count_error(&mut self, error: &FrameError) {
        let counter = match error {
            FrameError::Length { .. }
            | FrameError::Start { .. }
            | FrameError::End { .. }
            | FrameError::Digit { .. }
            | FrameError::Parts { .. } => &mut self.malformed,
            FrameError::Version { .. } | FrameError::Type { .. } => &mut self.unknown,
            FrameError::Reserved { .. } => &mut self.reserved,
            FrameError::Crc { .. } => &mut self.crc,
            FrameError::Mac => &mut self.mac,
            FrameError::NoPart => &mut self.not_for_this_robot,
        };
        *counter = counter.wrapping_add(1);
    }

    pub(crate) fn count_refusal(&mut self, refusal: &Refusal) {
        let counter = match refusal {
            Refusal::NotForThisRobot => &mut self.not_for_this_robot,
            Refusal::OldEpoch { .. } => &mut self.old_epoch,
            Refusal::OutOfOrder { .. } => &mut self.out_of_order,
            Refusal::ClockUnknown => &mut self.clock_unknown,
            Refusal::Stale { .. } => &mut self.stale,
        };
        *counter = counter.wrapping_add(1);
    }

    /// All frames that were not used.
    pub fn refused(&self) -> u32 {
        self.fields()
            .iter()
            .skip(2)
            .fold(0, |sum, count| sum.wrapping_add(*count))
    }

    /// In the order of the frame.
    fn fields(&self) -> [u32; FIELDS] {
        [
            self.accepted,
            self.fixes,
            self.malformed,
            self.unknown,
            self.crc,
            self.mac,
            self.reserved,
            self.not_for_this_robot,
            self.old_epoch,
            self.out_of_order,
            self.clock_unknown,
            self.stale,
        ]
    }
}

/// Writes a frame of counters and returns its length in characters.
pub fn encode_counters(
    header: &Header,
    counters: &Counters,
    key: &Key,
    out: &mut [u8; TELEMETRY_MAX_CHARACTERS],
) -> usize {
    let mut writer = Writer::new(TYPE_COUNTERS, header);
    for field in counters.fields() {
        writer.put(&field.to_be_bytes());
    }
    writer.finish(key, out)
}

pub(super) fn read(reader: &mut Reader<'_>) -> Counters {
    Counters {
        accepted: reader.u32(),
        fixes: reader.u32(),
        malformed: reader.u32(),
        unknown: reader.u32(),
        crc: reader.u32(),
        mac: reader.u32(),
        reserved: reader.u32(),
        not_for_this_robot: reader.u32(),
        old_epoch: reader.u32(),
        out_of_order: reader.u32(),
        clock_unknown: reader.u32(),
        stale: reader.u32(),
    }
}
