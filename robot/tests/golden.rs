//! Frames that another implementation must make and read, byte for byte: `tests/fixtures/link-frames.txt`.
#![allow(
    clippy::approx_constant,
    reason = "golden values have the digits of their resolution"
)]

use robot::battery::Level;
use robot::frame::{
    Aim, Command, Counters, Fix, Frame, GroupHeader, Header, Health, MAX_CHARACTERS, Part, Payload, Region, Status,
    Target, Telemetry, decode, decode_for, encode_command, encode_counters, encode_fix, encode_group, encode_health,
    encode_target, encode_telemetry,
};
use robot::key::Key;
use robot::kinematics::Twist;
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

/// Keys of the robots in groups: the golden one with the robot's number as its first byte, but for robot 1.
fn key_of(robot: u8) -> Key {
    let mut bytes: [u8; 16] = std::array::from_fn(|i| i as u8);
    if robot > 1 {
        bytes[0] = robot;
    }
    Key::new(bytes)
}

fn slow() -> Command {
    Command {
        enable: true,
        wheel_rad_per_s: [1.0, 2.0, 3.0, 4.0],
        ..Command::default()
    }
}

fn groups() -> Vec<(&'static str, GroupHeader, Vec<Part>)> {
    let header = |sequence: u32| GroupHeader {
        epoch: 7,
        sequence,
        tick: 41,
        clock_ms: 1_000_000,
    };
    let part = |robot: u8, echo_ms: u32, command: Command| Part {
        robot,
        echo_ms,
        command,
        key: key_of(robot),
    };
    let Payload::Command(drive) = frames()[0].1.payload else {
        panic!("not a command")
    };
    let stop = Command {
        stop: true,
        ..Command::default()
    };
    let full = (1..=16).map(|robot| part(robot, u32::from(robot), slow())).collect();
    vec![
        ("group one", header(45), vec![part(1, 990_000, drive)]),
        (
            "group three",
            header(46),
            vec![part(1, 990_000, drive), part(2, 0, stop), part(9, 77, slow())],
        ),
        ("group full", header(47), full),
    ]
}

fn later() -> Vec<(&'static str, Frame)> {
    let header = frames()[0].1.header;
    let at = |sequence: u32, payload: Payload| Frame {
        header: Header { sequence, ..header },
        payload,
    };
    let health = Health {
        status: Status {
            running: true,
            clock_known: true,
            ..Status::default()
        },
        battery: Level::Low,
        anchored: true,
        bounded: true,
        x_m: 1.2345,
        y_m: -0.9876,
        yaw_rad: 3.1415,
        forward_m_per_s: 0.5,
        left_m_per_s: -0.125,
        yaw_rate_rad_per_s: -0.75,
        position_sd_m: 0.0021,
        yaw_sd_rad: 0.0034,
        gyro_bias_rad_per_s: -0.00405,
        rest_v: 23.456,
        ..Health::default()
    };
    let lost = Health {
        status: Status {
            latched: true,
            stopped: true,
            ..Status::default()
        },
        battery: Level::Empty,
        anchored: false,
        bounded: false,
        stalled: true,
        sensor_fault: true,
        position_sd_m: 10.0,
        yaw_sd_rad: 1.8,
        ..health
    };
    let counters = Counters {
        accepted: 1000,
        fixes: 2000,
        malformed: 3000,
        unknown: 4000,
        crc: 5000,
        mac: 6000,
        reserved: 7000,
        not_for_this_robot: 8000,
        old_epoch: 9000,
        out_of_order: 10_000,
        clock_unknown: 11_000,
        stale: u32::MAX,
    };
    let twist = Target {
        enable: true,
        stop: false,
        clear: false,
        aim: Aim::Twist(Twist {
            forward_m_per_s: 0.5,
            left_m_per_s: -0.25,
            yaw_rate_rad_per_s: 0.75,
        }),
        speed_cap_m_per_s: 0.6,
        yaw_rate_cap_rad_per_s: 1.5,
        region: Region {
            left_m: -1.75,
            right_m: 1.75,
            bottom_m: -1.25,
            top_m: 1.25,
        },
        expiry_ms: 80,
    };
    let pose = Target {
        clear: true,
        aim: Aim::Pose {
            x_m: 1.5,
            y_m: -1.0,
            yaw_rad: -1.5708,
        },
        expiry_ms: 255,
        ..twist
    };
    let fix = Fix {
        x_m: 1.2345,
        y_m: -0.9876,
        yaw_rad: -3.1415,
        exposure_ms: 999_990,
        position_sd_m: 0.0015,
        yaw_sd_rad: 0.003,
    };
    vec![
        ("health driving", at(100, Payload::Health(health))),
        ("health lost", at(101, Payload::Health(lost))),
        ("counters", at(102, Payload::Counters(counters))),
        ("target twist", at(48, Payload::Target(twist))),
        ("target pose", at(49, Payload::Target(pose))),
        ("fix", at(50, Payload::Fix(fix))),
    ]
}

fn encode(frame: &Frame) -> String {
    let (mut down, mut up) = ([0; 96], [0; 160]);
    let (header, key) = (&frame.header, key());
    let characters = match &frame.payload {
        Payload::Command(payload) => {
            let length = encode_command(header, payload, &key, &mut down);
            &down[..length]
        }
        Payload::Target(payload) => {
            let length = encode_target(header, payload, &key, &mut down);
            &down[..length]
        }
        Payload::Fix(payload) => {
            let length = encode_fix(header, payload, &key, &mut down);
            &down[..length]
        }
        Payload::Telemetry(payload) => {
            let length = encode_telemetry(header, payload, &key, &mut up);
            &up[..length]
        }
        Payload::Health(payload) => {
            let length = encode_health(header, payload, &key, &mut up);
            &up[..length]
        }
        Payload::Counters(payload) => {
            let length = encode_counters(header, payload, &key, &mut up);
            &up[..length]
        }
    };
    String::from_utf8(characters.to_vec()).unwrap()
}

fn encode_parts(header: &GroupHeader, parts: &[Part]) -> String {
    let mut out = [0; MAX_CHARACTERS];
    let length = encode_group(header, parts, &mut out);
    String::from_utf8(out[..length].to_vec()).unwrap()
}

#[test]
fn frames_are_the_golden_ones() {
    let text = std::fs::read_to_string(fixture()).unwrap();
    let golden: Vec<_> = text
        .lines()
        .filter(|line| !line.starts_with('#'))
        .filter_map(|line| line.split_once(" :"))
        .collect();
    let (frames, groups, later) = (frames(), groups(), later());
    let single = |(name, frame): &(&'static str, Frame)| (*name, encode(frame));
    let group = |(name, header, parts): &(&'static str, GroupHeader, Vec<Part>)| (*name, encode_parts(header, parts));
    let made: Vec<_> = frames
        .iter()
        .map(single)
        .chain(groups.iter().map(group))
        .chain(later.iter().map(single))
        .collect();
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
fn later_frames_read_back_to_the_bit() {
    for (name, frame) in later() {
        let text = encode(&frame);
        let read = decode(text.as_bytes(), &key()).unwrap();
        assert_eq!(read.header, frame.header, "{name}");
        assert_eq!(encode(&read), text, "{name}");
        match (read.payload, frame.payload) {
            (Payload::Counters(read), Payload::Counters(made)) => assert_eq!(read, made),
            (Payload::Health(read), Payload::Health(made)) => {
                assert_eq!((read.status, read.battery), (made.status, made.battery));
                assert!((read.x_m - made.x_m).abs() < 1e-9 && (read.y_m - made.y_m).abs() < 1e-9);
                assert!((read.gyro_bias_rad_per_s - made.gyro_bias_rad_per_s).abs() < 1e-9);
                assert!(
                    (read.position_sd_m - made.position_sd_m.min(6.5535)).abs() < 1e-9,
                    "{name}"
                );
            }
            (Payload::Target(read), Payload::Target(made)) => {
                assert_eq!(read.expiry_ms, made.expiry_ms.min(100));
                assert!((read.region.right_m - 1.75).abs() < 1e-9 && (read.region.bottom_m + 1.25).abs() < 1e-9);
                assert_eq!((read.enable, read.clear), (made.enable, made.clear));
            }
            (Payload::Fix(read), Payload::Fix(made)) => {
                assert_eq!(read.exposure_ms, made.exposure_ms);
                assert!((read.yaw_rad - made.yaw_rad).abs() < 1e-9);
            }
            other => panic!("{name} changed its type: {other:?}"),
        }
    }
}

#[test]
fn every_robot_reads_its_own_part_and_no_other() {
    for (name, header, parts) in groups() {
        let text = encode_parts(&header, &parts);
        assert!(
            decode(text.as_bytes(), &key()).is_err(),
            "{name}: a laboratory reads no groups"
        );
        for part in &parts {
            let read = decode_for(text.as_bytes(), part.robot, &part.key).unwrap();
            let shared = (
                read.header.epoch,
                read.header.sequence,
                read.header.tick,
                read.header.clock_ms,
            );
            assert_eq!(shared, (header.epoch, header.sequence, header.tick, header.clock_ms));
            assert_eq!((read.header.robot, read.header.echo_ms), (part.robot, part.echo_ms));
            let Payload::Command(command) = read.payload else {
                panic!("not a command")
            };
            assert_eq!((command.enable, command.stop), (part.command.enable, part.command.stop));
            for other in parts.iter().filter(|other| other.robot != part.robot) {
                assert!(decode_for(text.as_bytes(), part.robot, &other.key).is_err(), "{name}");
            }
        }
    }
}

#[test]
fn caps_and_regions_arrive_no_wider_than_they_were_meant() {
    let Payload::Target(base) = later()[3].1.payload else {
        panic!("not a target")
    };
    let mut x = 0.137_f64;
    for _ in 0..5000 {
        x = (x * 3.9).fract().abs() + 1e-3;
        let target = Target {
            speed_cap_m_per_s: 1.3 * x,
            yaw_rate_cap_rad_per_s: 4.1 * x,
            region: Region {
                left_m: -2.0 * x,
                right_m: 1.7 * x,
                bottom_m: -1.1 * x,
                top_m: 0.9 * x,
            },
            ..base
        };
        let mut out = [0; 96];
        let length = encode_target(&Header::default(), &target, &key(), &mut out);
        let Payload::Target(read) = decode(&out[..length], &key()).unwrap().payload else {
            panic!("not a target")
        };
        let slack = 1e-9;
        assert!(read.speed_cap_m_per_s <= target.speed_cap_m_per_s + slack);
        assert!(read.speed_cap_m_per_s > target.speed_cap_m_per_s - 0.02 - slack);
        assert!(read.yaw_rate_cap_rad_per_s <= target.yaw_rate_cap_rad_per_s + slack);
        assert!(
            read.region.left_m >= target.region.left_m - slack && read.region.right_m <= target.region.right_m + slack
        );
        assert!(
            read.region.bottom_m >= target.region.bottom_m - slack && read.region.top_m <= target.region.top_m + slack
        );
    }
}

#[test]
fn frames_keep_to_their_lengths() {
    for (name, frame) in frames().into_iter().chain(later()) {
        let to_robot = ["command", "target", "fix"].iter().any(|kind| name.starts_with(kind));
        let (length, limit) = (encode(&frame).len(), if to_robot { 96 } else { 160 });
        assert!(length <= limit, "{name}: {length} characters");
    }
    for (name, header, parts) in groups() {
        let length = encode_parts(&header, &parts).len();
        assert!(length <= 96 * parts.len(), "{name}: {length} characters");
        assert_eq!(length, robot::medium::group_characters(parts.len()));
    }
}
