//! What the laboratory hears of one robot: telemetry in order, on the laboratory's clock; without socket.

use crate::clock_map::{ClockMap, MappedTime, link_clock_ms};
use crate::link_statistics::{LinkMeter, LinkStatistics};
use crate::record::Telemetry;
use robot::frame::{self, Counters, FrameError, Header, Health, Payload, Status};
use robot::key::Key;

/// A frame that repeats or goes back by less than this is a copy or was overtaken; one that goes back further comes from a robot
/// that was switched off and on, or from an adversary.
const REORDER_FRAMES: i32 = 1000;
/// A frame that echoes what was sent within this time was made just now.
const FRESH_MS: i32 = 500;
/// Both clocks count whole milliseconds.
const COUNT_MS: i32 = 2;
/// After so long without a frame, a fresh one is believed whatever its epoch and sequence: a robot switched off and on is heard
/// again no later than this.
pub const RESTART_US: i64 = 1_000_000;
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
    #[error("epoch {found} is older than {newest}")]
    OldEpoch { newest: u32, found: u32 },
    #[error("authentic, but nothing shows that it was made just now")]
    Replayed,
}

/// See the module.
#[derive(Debug, Clone, Default)]
pub struct Ear {
    clock: ClockMap,
    newest: Option<Newest>,
    meter: LinkMeter,
}

/// The last frame that was used.
#[derive(Debug, Clone, Copy)]
struct Newest {
    epoch: u32,
    sequence: u32,
    /// Of the newest frame that was used and had one; 0 before the first.
    echo_ms: u32,
    arrival_us: i64,
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

    /// Takes a datagram that came from this robot. Used or not, it counts once.
    ///
    /// Whoever recorded frames can send them again, and their MAC is good. What shows that a frame is new is its echo: the
    /// laboratory's own clock, under the robot's MAC. The rules, in this order:
    ///
    /// 1. An echo from the future, or a first frame with an old echo: refused.
    /// 2. After [`RESTART_US`] without a frame: a fresh one is used, whatever its epoch and sequence.
    /// 3. An epoch below the newest: refused. A new one begins the sequence anew.
    /// 4. Forward: used, unless its echo is older than one before, or it leaps far without an echo.
    /// 5. Backward by less than 1000 frames: a copy, or overtaken. Further: a restart if it is fresh, else refused.
    pub fn listen(&mut self, bytes: &[u8], key: &Key, arrival_us: i64) -> Result<Heard, Refusal> {
        let frame::Frame { header, payload } = frame::decode(bytes, key).inspect_err(|_| self.meter.refused())?;
        if !matches!(
            payload,
            Payload::Telemetry(_) | Payload::Health(_) | Payload::Counters(_)
        ) {
            // The laboratory's own frames, thrown back at it: neither their sequence nor their clock is the robot's.
            self.meter.refused();
            return Err(Refusal::NotTelemetry);
        }
        let step = self.step(&header, arrival_us).inspect_err(|refusal| match refusal {
            Refusal::OutOfOrder => self.meter.late(),
            _ => self.meter.replayed(),
        })?;
        let mapped = self.clock.observe(header.clock_ms, header.echo_ms, arrival_us);
        let heard = match payload {
            Payload::Telemetry(telemetry) => Heard::Motion(motion(&header, &telemetry, arrival_us, mapped)),
            Payload::Health(health) => Heard::Health(health),
            Payload::Counters(counters) => Heard::Counters(counters),
            _ => return Err(Refusal::NotTelemetry),
        };
        let echo_before_ms = self.newest.map_or(0, |newest| newest.echo_ms);
        self.newest = Some(Newest {
            epoch: header.epoch,
            sequence: header.sequence,
            echo_ms: if header.echo_ms == 0 {
                echo_before_ms
            } else {
                header.echo_ms
            },
            arrival_us,
        });
        let delay_us = (mapped.bound_us < i64::MAX).then(|| arrival_us - mapped.at_us);
        self.meter.received(step, delay_us);
        Ok(heard)
    }

    /// Sequence numbers since the frame before, 1 after a restart; the rules of [`Self::listen`].
    fn step(&self, header: &Header, arrival_us: i64) -> Result<i64, Refusal> {
        let has_echo = header.echo_ms != 0;
        let echo_age_ms = link_clock_ms(arrival_us).wrapping_sub(header.echo_ms).cast_signed();
        let is_fresh = has_echo && (-COUNT_MS..=FRESH_MS).contains(&echo_age_ms);
        if has_echo && echo_age_ms < -COUNT_MS {
            return Err(Refusal::Replayed);
        }
        let Some(newest) = self.newest else {
            return if is_fresh || !has_echo {
                Ok(1)
            } else {
                Err(Refusal::Replayed)
            };
        };
        let step = header.sequence.wrapping_sub(newest.sequence).cast_signed();
        let is_quiet = arrival_us - newest.arrival_us >= RESTART_US;
        if is_fresh && is_quiet {
            return Ok(i64::from(step).max(1));
        }
        if header.epoch < newest.epoch {
            return Err(Refusal::OldEpoch {
                newest: newest.epoch,
                found: header.epoch,
            });
        }
        let is_new_epoch = header.epoch > newest.epoch;
        let had_echo = newest.echo_ms != 0;
        let goes_back = has_echo && had_echo && header.echo_ms.wrapping_sub(newest.echo_ms).cast_signed() < 0;
        let leaps_blindly = !has_echo && had_echo && step >= REORDER_FRAMES;
        match step {
            _ if goes_back && !is_fresh && (step > 0 || is_new_epoch) => Err(Refusal::Replayed),
            _ if is_new_epoch => Ok(if (1..REORDER_FRAMES).contains(&step) {
                i64::from(step)
            } else {
                1
            }),
            1.. if leaps_blindly => Err(Refusal::Replayed),
            1.. => Ok(i64::from(step)),
            back if back > -REORDER_FRAMES => Err(Refusal::OutOfOrder),
            _ if is_fresh => Ok(1),
            _ => Err(Refusal::Replayed),
        }
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
