//! What the laboratory hears of one robot: telemetry in order, on the laboratory's clock; without socket.

use crate::clock_map::{ClockMap, MappedTime};
use crate::link_statistics::{LinkMeter, LinkStatistics};
use crate::record::Telemetry;
use robot::frame::{self, Counters, FrameError, Header, Health, Payload, Status};
use robot::key::Key;

/// Telemetry that repeats or goes back by up to this many frames is a copy or was overtaken; more is a restart.
const REORDER_FRAMES: i32 = 1000;
/// Bit of the status byte: latched off.
pub const STATUS_LATCHED: u8 = 1 << 2;
/// Bit of the status byte: the robot knows the laboratory's clock and accepts commands.
pub const STATUS_CLOCK_KNOWN: u8 = 1 << 3;

/// Bit of the status byte: a stop is obeyed.
pub const STATUS_STOPPED: u8 = 1 << 4;

/// Why a datagram is not used.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum Refusal {
    #[error("{0}")]
    Decode(#[from] FrameError),
    #[error("not telemetry")]
    NotTelemetry,
    #[error("a copy, or overtaken by a newer frame")]
    OutOfOrder,
}

/// See the module.
#[derive(Debug, Clone, Default)]
pub struct Ear {
    clock: ClockMap,
    last_sequence: Option<u32>,
    meter: LinkMeter,
}

/// What a robot says.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Heard {
    Motion(Telemetry),
    /// Estimate and health.
    Health(Health),
    /// What the robot did with the frames it got.
    Counters(Counters),
}

impl Ear {
    /// Motion telemetry of this robot; everything else is refused.
    pub fn hear(&mut self, bytes: &[u8], key: &Key, arrival_us: i64) -> Result<Telemetry, Refusal> {
        match self.listen(bytes, key, arrival_us)? {
            Heard::Motion(telemetry) => Ok(telemetry),
            Heard::Health(_) | Heard::Counters(_) => Err(Refusal::NotTelemetry),
        }
    }

    /// Takes a datagram that came from this robot.
    pub fn listen(&mut self, bytes: &[u8], key: &Key, arrival_us: i64) -> Result<Heard, Refusal> {
        let frame::Frame { header, payload } = frame::decode(bytes, key).inspect_err(|_| self.meter.refused())?;
        let step = self
            .last_sequence
            .map_or(1, |last| header.sequence.wrapping_sub(last).cast_signed());
        if step <= 0 && step > -REORDER_FRAMES {
            self.meter.late();
            return Err(Refusal::OutOfOrder);
        }
        let mapped = self.clock.observe(header.clock_ms, header.echo_ms, arrival_us);
        let heard = match payload {
            Payload::Telemetry(telemetry) => Heard::Motion(motion(&header, &telemetry, arrival_us, mapped)),
            Payload::Health(health) => Heard::Health(health),
            Payload::Counters(counters) => Heard::Counters(counters),
            _ => {
                self.meter.refused();
                return Err(Refusal::NotTelemetry);
            }
        };
        self.last_sequence = Some(header.sequence);
        let delay_us = (mapped.bound_us < i64::MAX).then(|| arrival_us - mapped.at_us);
        self.meter.received(i64::from(step).max(1), delay_us);
        Ok(heard)
    }

    /// How well its frames come through.
    pub fn statistics(&self) -> LinkStatistics {
        self.meter.statistics()
    }
}

fn motion(header: &Header, telemetry: &frame::Telemetry, arrival_us: i64, mapped: MappedTime) -> Telemetry {
    Telemetry {
        robot: header.robot,
        arrival_us,
        sample_us: mapped.at_us,
        sample_bound_us: mapped.bound_us,
        robot_clock_ms: header.clock_ms,
        status: status_bits(telemetry.status),
        applied_sequence: telemetry.applied_sequence,
        wheel_rad_per_s: telemetry.wheel_rad_per_s,
        wheel_rad: telemetry.wheel_rad,
        current_a: telemetry.current_a,
        bus_v: telemetry.bus_v,
        gyro_z_rad_per_s: telemetry.gyro_z_rad_per_s,
        accel_m_per_s2: telemetry.accel_m_per_s2,
        steering_rad: telemetry.steering_rad,
    }
}

fn status_bits(status: Status) -> u8 {
    let bits = [
        status.running,
        status.ramping,
        status.latched,
        status.clock_known,
        status.stopped,
        status.saturated,
    ];
    bits.iter()
        .enumerate()
        .fold(0, |byte, (place, set)| byte | u8::from(*set) << place)
}
