//! Frames that another implementation must make and read, byte for byte: `tests/fixtures/link-frames.txt`.

use robot::frame::{Command, Frame, Header, Payload, Status, Telemetry, decode, encode_command, encode_telemetry};
use robot::key::Key;
use std::path::PathBuf;

fn fixture() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../tests/fixtures/link-frames.txt")
}

fn key() -> Key {
    Key::from_hex("000102030405060708090a0b0c0d0e0f").unwrap()
}

fn frames() -> Vec<(&'static str, Frame)> {
    let header = Header {
        robot: 1,
        epoch: 7,
        sequence: 42,
        tick: 41,
        clock_ms: 1_000_000,
        echo_ms: 990_000,
    };
    let drive = Command {
        enable: true,
        wheel_rad_per_s: [12.34, -12.34, 0.01, -0.01],
        steering_rad: 0.1234,
        ..Command::default()
    };
    let limits = Header {
        robot: 250,
        epoch: u32::MAX,
        sequence: u32::MAX,
        tick: u32::MAX,
        clock_ms: u32::MAX,
        echo_ms: u32::MAX,
    };
    let measured = Telemetry {
        status: Status {
            running: true,
            clock_known: true,
            ..Status::default()
        },
        applied_sequence: 42,
        wheel_rad_per_s: [12.3, -12.31, 0.0, 0.05],
        wheel_rad: [1234.567, -1234.567, 0.001, 0.0],
        current_a: [1.25, -1.25, 0.03, 9.0],
        bus_v: 23.987,
        gyro_z_rad_per_s: -0.512,
        accel_m_per_s2: [0.25, -1.5],
        steering_rad: -0.25,
    };
    vec![
        (
            "command drive",
            Frame {
                header,
                payload: Payload::Command(drive),
            },
        ),
        (
            "command stop",
            Frame {
                header: Header { sequence: 43, ..header },
                payload: Payload::Command(Command {
                    stop: true,
                    ..Command::default()
                }),
            },
        ),
        (
            "command clear",
            Frame {
                header: Header { sequence: 44, ..header },
                payload: Payload::Command(Command {
                    clear: true,
                    ..Command::default()
                }),
            },
        ),
        (
            "command largest",
            Frame {
                header: limits,
                payload: Payload::Command(Command {
                    enable: true,
                    wheel_rad_per_s: [327.67, -327.68, 327.67, -327.68],
                    steering_rad: 3.2767,
                    ..Command::default()
                }),
            },
        ),
        (
            "telemetry driving",
            Frame {
                header: Header { sequence: 99, ..header },
                payload: Payload::Telemetry(measured),
            },
        ),
        (
            "telemetry latched",
            Frame {
                header: Header {
                    robot: 6,
                    epoch: 0,
                    sequence: 1,
                    tick: 0,
                    clock_ms: 1,
                    echo_ms: 0,
                },
                payload: Payload::Telemetry(Telemetry {
                    status: Status {
                        latched: true,
                        ..Status::default()
                    },
                    bus_v: 24.0,
                    ..Telemetry::default()
                }),
            },
        ),
    ]
}

fn encode(frame: &Frame) -> String {
    let (mut command, mut telemetry) = ([0; 96], [0; 160]);
    let characters = match &frame.payload {
        Payload::Command(payload) => {
            let length = encode_command(&frame.header, payload, &key(), &mut command);
            &command[..length]
        }
        Payload::Telemetry(payload) => {
            let length = encode_telemetry(&frame.header, payload, &key(), &mut telemetry);
            &telemetry[..length]
        }
    };
    String::from_utf8(characters.to_vec()).unwrap()
}

#[test]
fn frames_are_the_golden_ones() {
    let text = std::fs::read_to_string(fixture()).unwrap();
    let golden: Vec<_> = text
        .lines()
        .filter(|line| !line.starts_with('#'))
        .filter_map(|line| line.split_once(" :"))
        .collect();
    let frames = frames();
    let made: Vec<_> = frames.iter().map(|(name, frame)| (*name, encode(frame))).collect();
    let wanted: Vec<_> = golden
        .iter()
        .map(|(name, digits)| (*name, format!(":{digits}\n")))
        .collect();
    assert_eq!(made, wanted);
}

#[test]
fn golden_frames_read_back() {
    for (name, frame) in frames() {
        let text = encode(&frame);
        let read = decode(text.as_bytes(), &key()).unwrap();
        assert_eq!(read.header, frame.header, "{name}");
        assert_eq!(encode(&read), text, "{name}");
        match (read.payload, frame.payload) {
            (Payload::Command(read), Payload::Command(made)) => {
                assert_eq!(
                    (read.enable, read.stop, read.clear),
                    (made.enable, made.stop, made.clear)
                );
                assert!((read.steering_rad - made.steering_rad).abs() < 1e-9);
                assert!(
                    read.wheel_rad_per_s
                        .iter()
                        .zip(made.wheel_rad_per_s)
                        .all(|(a, b)| (a - b).abs() < 1e-9)
                );
            }
            (Payload::Telemetry(read), Payload::Telemetry(made)) => {
                assert_eq!(
                    (read.status, read.applied_sequence),
                    (made.status, made.applied_sequence)
                );
                assert!(
                    (read.bus_v - made.bus_v).abs() < 1e-9
                        && (read.gyro_z_rad_per_s - made.gyro_z_rad_per_s).abs() < 1e-9
                );
                assert!(
                    read.wheel_rad
                        .iter()
                        .zip(made.wheel_rad)
                        .all(|(a, b)| (a - b).abs() < 1e-9)
                );
                assert!(
                    read.current_a
                        .iter()
                        .zip(made.current_a)
                        .all(|(a, b)| (a - b).abs() < 1e-9)
                );
            }
            other => panic!("{name} changed its type: {other:?}"),
        }
    }
}

#[test]
fn frames_keep_to_their_lengths() {
    for (name, frame) in frames() {
        let (length, limit) = (encode(&frame).len(), if name.starts_with("command") { 96 } else { 160 });
        assert!(length <= limit, "{name}: {length} characters");
    }
}
