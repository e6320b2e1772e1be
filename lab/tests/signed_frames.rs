//! Frames of a robot gone mad: good CRC, good MAC, any payload, any type. What the laboratory takes from them are numbers within
//! their fields, and what it makes of them stays within its limits.

#[path = "../../robot/tests/kit/signing.rs"]
mod signing;

use control::answer::Answer;
use lab::clock_map::link_clock_ms;
use lab::delay::DelayMeter;
use lab::ear::{Ear, Heard, Refusal};
use lab::ladder::{Findings, Ladder};
use robot::frame::{FrameError, Header};
use robot::key::Key;
use signing::{GROUP, payload, signed};

const START_US: i64 = 3_600_000_000;
const PERIOD_US: i64 = 8_000;

struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0
    }

    fn below(&mut self, limit: u64) -> u64 {
        self.next() % limit
    }
}

#[test]
fn whatever_a_robot_signs_the_laboratory_takes_numbers_within_their_fields() {
    let key = Key::new(signing::KEY);
    let mut random = Random(0x5eed_0300);
    let (mut ear, mut ladder) = (Ear::default(), Ladder::default());
    let nominal = Answer {
        driving_s: 0.1,
        turning_s: 0.1,
    };
    let mut delay = DelayMeter::new(0.1, nominal);
    let (mut now_us, mut sequence, mut datagrams) = (START_US, 0_u32, 0_u64);
    let (mut motions, mut healths, mut counters, mut others, mut reserved) = (0, 0, 0, 0, 0);
    for round in 0..60_000_u32 {
        now_us += PERIOD_US;
        sequence += 1;
        delay.sent(sequence, now_us - 12_000, [0.3, 0.0, (f64::from(round) * 0.05).sin()]);
        let kind = [2, 2, 2, 4, 4, 5, 1, GROUP, 6, 7][random.below(10) as usize];
        let mut header = Header {
            robot: 3,
            epoch: 5,
            sequence,
            tick: random.next() as u32,
            clock_ms: link_clock_ms(now_us).wrapping_add(77_000),
            echo_ms: link_clock_ms(now_us) - 12,
        };
        // Its clock and its echo may be anything, too.
        match random.below(12) {
            0 => header.clock_ms = random.next() as u32,
            1 => {
                header.clock_ms = header
                    .clock_ms
                    .wrapping_add(random.below(20_000) as u32)
                    .wrapping_sub(10_000)
            }
            2 => header.echo_ms = random.next() as u32,
            3 => header.echo_ms = 0,
            4 => header.sequence = random.next() as u32,
            _ => {}
        }
        let mut bytes = payload(kind, || random.next());
        if kind == 2 || kind == 4 {
            // Mostly without reserved bits and values.
            bytes[0] &= if random.below(8) > 0 { 0x3F } else { 0xFF };
            if kind == 2 && random.below(2) == 0 {
                bytes[1..5].copy_from_slice(&(sequence - 1).to_be_bytes());
            } else if kind == 4 && random.below(8) > 0 {
                (bytes[1], bytes[2]) = (bytes[1] & 3, bytes[2] & 15);
            }
        }
        datagrams += 1;
        match ear.listen(&signed(kind, &header, &bytes), &key, now_us) {
            Ok(Heard::Motion(told)) => {
                motions += 1;
                let speeds = told
                    .wheel_rad_per_s
                    .iter()
                    .chain(&told.current_a)
                    .chain(&told.accel_m_per_s2);
                assert!(speeds.into_iter().all(|value| value.abs() < 327.681), "{told:?}");
                assert!(told.wheel_rad.iter().all(|angle| angle.abs() < 2_147_484.0), "{told:?}");
                assert!(
                    (0.0..65.5351).contains(&told.bus_v) && told.gyro_z_rad_per_s.abs() < 32.7681,
                    "{told:?}"
                );
                assert!(told.steering_rad.abs() < 3.27681 && told.status <= 0x3F, "{told:?}");
                assert!(told.sample_us <= now_us && told.sample_bound_us >= 0, "{told:?}");
                delay.heard(&told);
            }
            Ok(Heard::Health(health)) => {
                healths += 1;
                assert!(
                    health.x_m.abs() < 214_749.0 && health.y_m.abs() < 214_749.0,
                    "{health:?}"
                );
                assert!(
                    health.yaw_rad.abs() < 3.27681 && (0.0..65.5351).contains(&health.rest_v),
                    "{health:?}"
                );
                assert!((0.0..6.55351).contains(&health.position_sd_m), "{health:?}");
                let held = ladder.report(&Findings::of(&health), now_us);
                assert!(!held.gravest.code().is_empty());
            }
            Ok(Heard::Counters(_)) => counters += 1,
            Err(Refusal::NotTelemetry) => others += 1,
            Err(Refusal::Decode(FrameError::Reserved { .. })) => reserved += 1,
            Err(Refusal::Decode(FrameError::Type { .. })) => assert_eq!(kind, GROUP),
            Err(Refusal::Decode(error)) => panic!("type {kind}: {error}"),
            Err(Refusal::OutOfOrder | Refusal::OldEpoch { .. } | Refusal::Replayed) => {}
        }
        delay.seen(now_us - 20_000, [0.28, 0.0, 0.1]);
        let (latency_s, answer) = (delay.latency_s(), delay.answer());
        assert!(latency_s.is_finite() && latency_s >= 0.18, "{latency_s}");
        assert!(answer.driving_s.is_finite() && answer.turning_s.is_finite());
        let seen = ear.statistics();
        assert_eq!(seen.received + seen.late + seen.refused + seen.replayed, datagrams);
        assert!(seen.delay_p50_ms.is_finite() && seen.delay_p50_ms >= 0.0 && seen.jitter_ms.is_finite());
    }
    println!("{motions} motions, {healths} healths, {counters} counters; {others} of other types, {reserved} reserved");
    assert!(motions > 10_000 && healths > 5_000 && counters > 3_000 && others > 5_000 && reserved > 500);
}
