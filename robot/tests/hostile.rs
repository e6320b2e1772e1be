//! Damaged, random, forged and replayed bytes.

use proptest::prelude::*;
mod kit;

use robot::firmware::{Firmware, Received, Sensors};
use robot::frame::{Command, FrameError, Header, decode, encode_command};
use robot::key::Key;

const KEY: Key = Key::new(*b"sixteen byte key");
const OTHER_KEY: Key = Key::new(*b"another 16 bytes");

fn command_frame(header: &Header, command: &Command, key: &Key) -> Vec<u8> {
    let mut out = [0; 96];
    let length = encode_command(header, command, key, &mut out);
    out[..length].to_vec()
}

fn drive() -> Command {
    Command {
        enable: true,
        wheel_rad_per_s: [5.0; 4],
        ..Command::default()
    }
}

fn firmware() -> Firmware {
    Firmware::new(kit::settings(3, KEY))
}

/// Frame `sequence` of a laboratory whose clock is 5000 ms ahead, sent at robot time `sent_ms`.
fn from_lab(epoch: u32, sequence: u32, sent_ms: u32) -> Vec<u8> {
    let header = Header {
        robot: 3,
        epoch,
        sequence,
        tick: sequence,
        clock_ms: sent_ms + 5000,
        echo_ms: sent_ms - 2,
    };
    command_frame(&header, &drive(), &KEY)
}

#[test]
fn every_single_bit_flip_is_an_error() {
    let header = Header {
        robot: 3,
        epoch: 1,
        sequence: 2,
        tick: 3,
        clock_ms: 4,
        echo_ms: 5,
    };
    let frame = command_frame(&header, &drive(), &KEY);
    let (mut by_crc, mut flips) = (0, 0);
    for bit in 0..frame.len() * 8 {
        let mut damaged = frame.clone();
        damaged[bit / 8] ^= 1 << (bit % 8);
        let error = decode(&damaged, &KEY).expect_err("a flipped bit must show");
        by_crc += usize::from(matches!(error, FrameError::Crc { .. }));
        flips += 1;
    }
    assert!(by_crc > flips / 8, "{by_crc} of {flips} by crc");
}

#[test]
fn errors_name_what_is_wrong() {
    let header = Header {
        robot: 3,
        ..Header::default()
    };
    let frame = command_frame(&header, &drive(), &KEY);
    let with = |position: usize, byte: u8| {
        let mut changed = frame.clone();
        changed[position] = byte;
        decode(&changed, &KEY).unwrap_err()
    };
    assert_eq!(decode(b"", &KEY), Err(FrameError::Length { characters: 0 }));
    assert_eq!(decode(b":\n", &KEY), Err(FrameError::Length { characters: 2 }));
    assert_eq!(
        decode(&frame[..frame.len() - 1], &KEY).unwrap_err(),
        FrameError::End {
            found: frame[frame.len() - 2]
        }
    );
    assert_eq!(with(0, b';'), FrameError::Start { found: b';' });
    assert_eq!(
        with(5, b'g'),
        FrameError::Digit {
            position: 5,
            found: b'g'
        }
    );
    assert_eq!(
        with(5, b'a'),
        FrameError::Digit {
            position: 5,
            found: b'a'
        }
    );
    assert_eq!(with(2, b'2'), FrameError::Version { found: 2 });
    assert_eq!(with(4, b'9'), FrameError::Type { found: 9 });
    assert_eq!(
        with(4, b'2'),
        FrameError::Length {
            characters: frame.len()
        }
    );
    assert!(matches!(with(20, b'5'), FrameError::Crc { .. }));
    assert_eq!(
        decode(&command_frame(&header, &drive(), &OTHER_KEY), &KEY),
        Err(FrameError::Mac)
    );
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 20_000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn random_bytes_never_panic_and_never_decode(bytes in proptest::collection::vec(any::<u8>(), 0..200)) {
        prop_assert!(decode(&bytes, &KEY).is_err());
    }

    #[test]
    fn random_digits_never_decode(mut digits in proptest::collection::vec(prop::sample::select(b"0123456789ABCDEF".to_vec()), 80..=80)) {
        digits.insert(0, b':');
        digits.push(b'\n');
        digits[1..5].copy_from_slice(b"0101");
        prop_assert!(decode(&digits, &KEY).is_err());
    }

    #[test]
    fn any_command_reads_back(epoch: u32, sequence: u32, tick: u32, clock_ms in 1u32.., echo_ms: u32, speed: f64, steering in -3.0..3.0f64, enable: bool, stop: bool, clear: bool) {
        let header = Header { robot: 3, epoch, sequence, tick, clock_ms, echo_ms };
        let command = Command { enable, stop, clear, wheel_rad_per_s: [speed, 1.0, -2.0, f64::NAN], steering_rad: steering };
        let text = command_frame(&header, &command, &KEY);
        let read = decode(&text, &KEY).unwrap();
        prop_assert_eq!(read.header, header);
        let robot::frame::Payload::Command(read) = read.payload else { panic!("not a command") };
        prop_assert_eq!((read.enable, read.stop, read.clear), (enable, stop, clear));
        let clamped = if speed.is_nan() { 0.0 } else { speed.clamp(-327.68, 327.67) };
        prop_assert!((read.wheel_rad_per_s[0] - clamped).abs() <= 0.005 + 1e-9);
        prop_assert_eq!(read.wheel_rad_per_s[3], 0.0);
        prop_assert!((read.steering_rad - steering).abs() <= 0.000_05 + 1e-9);
        prop_assert_eq!(command_frame(&header, &read, &KEY), text);
    }
}

/// Replays, overtaken frames, forgeries, old epochs and slow frames: none may feed the watchdog.
#[test]
fn only_fresh_ordered_current_frames_are_accepted() {
    let mut firmware = firmware();
    let mut random = 0x2545_f491_4f6c_dd1d_u64;
    let mut next = || {
        random ^= random << 13;
        random ^= random >> 7;
        random ^= random << 17;
        random
    };
    let mut history: Vec<Vec<u8>> = Vec::new();
    let (mut now_ms, mut sequence) = (10_000, 0);
    let mut hostile_frames = 0;
    for round in 0..10_000u32 {
        now_ms += 8;
        sequence += 1;
        let good = from_lab(7, sequence, now_ms - 1);
        assert_eq!(firmware.on_datagram(&good, now_ms), Received::Accepted, "round {round}");
        history.push(good);
        for _ in 0..10 {
            let forged = match next() % 5 {
                0 => history[next() as usize % history.len()].clone(),
                1 => from_lab(next() as u32 % 7, sequence + 1, now_ms),
                2 => command_frame(
                    &Header {
                        robot: 3,
                        epoch: 8,
                        sequence: 1,
                        tick: 1,
                        clock_ms: now_ms + 5000,
                        echo_ms: now_ms - 1,
                    },
                    &drive(),
                    &OTHER_KEY,
                ),
                3 => from_lab(7, next() as u32 % (sequence + 1), now_ms),
                _ => {
                    let mut damaged = history[next() as usize % history.len()].clone();
                    let position = next() as usize % damaged.len();
                    damaged[position] ^= 1 << (next() % 8);
                    damaged
                }
            };
            hostile_frames += 1;
            assert_ne!(firmware.on_datagram(&forged, now_ms), Received::Accepted);
        }
        if round % 10 == 0 {
            sequence += 1;
            let slow = from_lab(7, sequence, now_ms - 55);
            assert_ne!(firmware.on_datagram(&slow, now_ms), Received::Accepted);
        }
    }
    println!("{hostile_frames} hostile frames, 0 accepted");
}

#[test]
fn motors_follow_only_accepted_commands_and_stop_without_them() {
    let mut firmware = firmware();
    let sensors = Sensors {
        bus_v: 24.0,
        ..Sensors::default()
    };
    let mut now_ms = 1000;
    assert_eq!(firmware.step(now_ms, &sensors).motor_v, [0.0; 4]);
    assert_ne!(
        firmware.on_datagram(
            &command_frame(
                &Header {
                    robot: 3,
                    epoch: 1,
                    sequence: 1,
                    tick: 0,
                    clock_ms: 9000,
                    echo_ms: 0
                },
                &drive(),
                &KEY
            ),
            now_ms
        ),
        Received::Accepted
    );
    for sequence in 2..50 {
        now_ms += 8;
        assert_eq!(
            firmware.on_datagram(&from_lab(1, sequence, now_ms - 1), now_ms),
            Received::Accepted
        );
        firmware.step(now_ms, &sensors);
    }
    assert!(
        firmware
            .step(now_ms, &sensors)
            .motor_v
            .iter()
            .all(|voltage| *voltage > 1.0)
    );
    for _ in 0..600 {
        now_ms += 1;
        firmware.step(now_ms, &sensors);
    }
    firmware.reset_drives();
    assert_eq!(firmware.step(now_ms, &sensors).motor_v, [0.0; 4]);
    let mut out = [0; 160];
    let length = firmware.telemetry(now_ms, &mut out);
    let robot::frame::Payload::Telemetry(telemetry) = decode(&out[..length], &KEY).unwrap().payload else {
        panic!("not telemetry")
    };
    assert!(telemetry.status.latched && !telemetry.status.running && !telemetry.status.stopped);
    assert_eq!(telemetry.applied_sequence, 49);
}

#[test]
fn a_stop_is_obeyed_even_when_it_is_late() {
    let mut firmware = firmware();
    for sequence in 1..20 {
        assert_eq!(
            firmware.on_datagram(&from_lab(1, sequence, 1000 + 8 * sequence), 1001 + 8 * sequence),
            Received::Accepted
        );
    }
    let header = Header {
        robot: 3,
        epoch: 1,
        sequence: 20,
        tick: 20,
        clock_ms: 6160,
        echo_ms: 1150,
    };
    let stop = command_frame(
        &header,
        &Command {
            stop: true,
            ..Command::default()
        },
        &KEY,
    );
    assert_ne!(firmware.on_datagram(&stop, 1300), Received::Accepted);
    assert!(firmware.watchdog().is_stopped());
    let _ = firmware.on_datagram(&from_lab(1, 21, 1301), 1302);
    assert!(firmware.watchdog().is_stopped());
}
