//! Every kind of frame that must not move a robot, thrown at one that drives: RELIABILITY S4.

mod kit;

use kit::Random;
use robot::firmware::{Firmware, Received, Sensors};
use robot::frame::{Aim, Command, Fix, GroupHeader, Part, Region, Target};
use robot::key::Key;
use robot::kinematics::Twist;
use std::collections::BTreeMap;

const NUMBER: u8 = 3;
const KEY: Key = Key::new(*b"sixteen byte key");
const OTHER_KEY: Key = Key::new(*b"another 16 bytes");
const EPOCH: u32 = 7;

/// What the laboratory wants, and something that nobody wants.
const WANTED: f64 = 5.0;
const FOREIGN: f64 = -30.0;

fn drive(wheel_rad_per_s: f64) -> Command {
    Command {
        enable: true,
        wheel_rad_per_s: [wheel_rad_per_s; 4],
        ..Command::default()
    }
}

fn run_away() -> Target {
    Target {
        enable: true,
        stop: false,
        clear: true,
        aim: Aim::Twist(Twist {
            forward_m_per_s: -5.0,
            ..Twist::default()
        }),
        speed_cap_m_per_s: 5.0,
        yaw_rate_cap_rad_per_s: 5.0,
        region: Region {
            left_m: -30.0,
            right_m: 30.0,
            bottom_m: -30.0,
            top_m: 30.0,
        },
        expiry_ms: 100,
    }
}

fn group(sequence: u32, sent_ms: u32, parts: &[(u8, Key, f64)]) -> Vec<u8> {
    let header = GroupHeader {
        epoch: EPOCH,
        sequence,
        tick: sequence,
        clock_ms: sent_ms + kit::LAB_AHEAD_MS,
    };
    let parts: Vec<_> = parts
        .iter()
        .map(|&(robot, key, speed)| Part {
            robot,
            echo_ms: sent_ms - 2,
            command: drive(speed),
            key,
        })
        .collect();
    kit::group(&header, &parts)
}

/// A laboratory that drives, and somebody who listens and throws everything at the robot.
struct Scene {
    firmware: Firmware,
    random: Random,
    now_ms: u32,
    sequence: u32,
    /// Frames that were on the air.
    heard: Vec<Vec<u8>>,
    thrown: BTreeMap<&'static str, u32>,
}

impl Scene {
    fn new(seed: u64) -> Self {
        Self {
            firmware: Firmware::new(kit::settings(NUMBER, KEY)),
            random: Random(seed),
            now_ms: 10_000,
            sequence: 0,
            heard: Vec::new(),
            thrown: BTreeMap::new(),
        }
    }

    /// The laboratory's own frame, by itself or in a group.
    fn lab_sends(&mut self) {
        self.now_ms += 8;
        self.sequence += 1;
        let sent_ms = self.now_ms - 1;
        let frame = if self.random.below(2) == 0 {
            kit::command(
                &kit::header(NUMBER, EPOCH, self.sequence, sent_ms),
                &drive(WANTED),
                &KEY,
            )
        } else {
            group(
                self.sequence,
                sent_ms,
                &[(2, OTHER_KEY, FOREIGN), (NUMBER, KEY, WANTED), (9, OTHER_KEY, FOREIGN)],
            )
        };
        assert_eq!(self.firmware.on_datagram(&frame, self.now_ms), Received::Accepted);
        if self.heard.len() < 500 {
            self.heard.push(frame);
        } else {
            let place = self.random.below(500);
            self.heard[place] = frame;
        }
    }

    fn any_heard(&mut self) -> Vec<u8> {
        let at = self.random.below(self.heard.len());
        self.heard[at].clone()
    }

    /// One frame that the laboratory did not send now.
    fn hostile(&mut self) -> (&'static str, Vec<u8>) {
        let (now_ms, next) = (self.now_ms, self.sequence + 1);
        let fresh = kit::header(NUMBER, EPOCH, next, now_ms - 1);
        match self.random.below(15) {
            0 => ("replayed", self.any_heard()),
            1 => {
                let mut frame = self.any_heard();
                let at = self.random.below(frame.len());
                frame[at] ^= 1 << self.random.below(8);
                ("corrupt", frame)
            }
            2 => {
                let mut frame = self.any_heard();
                frame.truncate(self.random.below(frame.len()));
                ("truncated", frame)
            }
            3 => {
                let mut frame = self.any_heard();
                let more = 2 * (1 + self.random.below(4));
                let end = frame.len() - 1;
                frame.splice(end..end, std::iter::repeat_n(b'0', more));
                ("too long", frame)
            }
            4 => {
                let older = self.random.below(self.sequence as usize + 1) as u32;
                let header = kit::header(NUMBER, EPOCH, older, now_ms - 1);
                ("reordered", kit::command(&header, &drive(FOREIGN), &KEY))
            }
            5 => {
                let header = kit::header(NUMBER, self.random.below(EPOCH as usize) as u32, next, now_ms - 1);
                ("old epoch", kit::command(&header, &drive(FOREIGN), &KEY))
            }
            6 => {
                let header = kit::header(NUMBER, EPOCH + 1, 1, now_ms - 1);
                ("forged", kit::command(&header, &drive(FOREIGN), &OTHER_KEY))
            }
            7 => ("forged target", kit::target(&fresh, &run_away(), &OTHER_KEY)),
            8 => {
                let header = kit::header(9, EPOCH, next, now_ms - 1);
                ("for another robot", kit::command(&header, &drive(FOREIGN), &KEY))
            }
            9 => (
                "forged in a group",
                group(
                    next,
                    now_ms - 1,
                    &[(2, OTHER_KEY, FOREIGN), (NUMBER, OTHER_KEY, FOREIGN)],
                ),
            ),
            10 => (
                "group of others",
                group(next, now_ms - 1, &[(2, OTHER_KEY, FOREIGN), (9, OTHER_KEY, FOREIGN)]),
            ),
            11 => self.spliced_group(next),
            12 => {
                let bytes = (0..self.random.below(200)).map(|_| self.random.next() as u8).collect();
                ("noise", bytes)
            }
            13 => {
                let older = self.random.below(self.sequence as usize + 1) as u32;
                let header = kit::header(NUMBER, EPOCH, older, now_ms - 1);
                ("old target", kit::target(&header, &run_away(), &KEY))
            }
            _ => {
                let mut frame = self.any_heard();
                let kind = b"0123456789ABCDEF"[self.random.below(16)];
                if frame[4] == kind {
                    frame[4] = b'F';
                } else {
                    frame[4] = kind;
                }
                ("other type", frame)
            }
        }
    }

    /// Robot 9 has its own key and what it heard: it puts the old part of robot 3 under a new header, with a right CRC.
    fn spliced_group(&mut self, sequence: u32) -> (&'static str, Vec<u8>) {
        let old = loop {
            let frame = self.any_heard();
            if &frame[3..5] == b"03" {
                break frame;
            }
        };
        let mut new = group(
            sequence,
            self.now_ms - 1,
            &[
                (2, OTHER_KEY, FOREIGN),
                (NUMBER, OTHER_KEY, FOREIGN),
                (9, OTHER_KEY, FOREIGN),
            ],
        );
        let part = 1 + 2 * (19 + 20)..1 + 2 * (19 + 40);
        new[part.clone()].copy_from_slice(&old[part]);
        let crc_at = new.len() - 5;
        let bytes: Vec<u8> = new[1..crc_at]
            .chunks_exact(2)
            .map(|pair| u8::from_str_radix(std::str::from_utf8(pair).unwrap(), 16).unwrap())
            .collect();
        let crc = bytes.iter().fold(0xFFFF_u16, |crc, byte| {
            (0..8).fold(crc ^ u16::from(*byte) << 8, |crc, _| {
                if crc & 0x8000 == 0 { crc << 1 } else { crc << 1 ^ 0x1021 }
            })
        });
        new[crc_at..crc_at + 4].copy_from_slice(format!("{crc:04X}").as_bytes());
        ("spliced group", new)
    }

    fn round(&mut self, hostile_frames: u32) {
        self.lab_sends();
        for _ in 0..hostile_frames {
            let (kind, frame) = self.hostile();
            let received = self.firmware.on_datagram(&frame, self.now_ms);
            assert!(
                !matches!(received, Received::Accepted | Received::Fix(_)),
                "{kind}: {received:?}"
            );
            *self.thrown.entry(kind).or_default() += 1;
        }
        let sensors = Sensors {
            wheel_rad_per_s: [WANTED; 4],
            bus_v: 24.0,
            ..Sensors::default()
        };
        for step in 0..4 {
            self.firmware.step(self.now_ms + 2 * step, &sensors);
            let speed = self.firmware.set_point().wheel_rad_per_s[0];
            assert!(
                (0.0..=WANTED).contains(&speed),
                "{speed} rad/s at sequence {}",
                self.sequence
            );
        }
    }
}

fn attack(rounds: u32, hostile_frames: u32) {
    let mut scene = Scene::new(0x2545_f491_4f6c_dd1d);
    for _ in 0..20 {
        scene.round(0);
    }
    for _ in 0..rounds {
        scene.round(hostile_frames);
    }
    let counters = *scene.firmware.counters();
    let thrown: u32 = scene.thrown.values().sum();
    println!(
        "{thrown} hostile frames, 0 actuations: {:?}; {counters:?}",
        scene.thrown
    );
    assert_eq!(thrown, rounds * hostile_frames);
    assert!(scene.thrown.len() == 15 && scene.thrown.values().all(|count| *count > thrown / 40));
    // Every frame is counted exactly once, and every reason occurs that these frames can have.
    assert_eq!(counters.accepted, rounds + 20);
    assert_eq!(counters.refused(), thrown);
    for count in [
        counters.malformed,
        counters.unknown,
        counters.crc,
        counters.mac,
        counters.not_for_this_robot,
        counters.old_epoch,
        counters.out_of_order,
    ] {
        assert!(count > 0, "{counters:?}");
    }
    assert_eq!(scene.firmware.set_point().wheel_rad_per_s, [WANTED; 4]);
}

#[test]
fn no_hostile_frame_moves_a_robot() {
    attack(5_000, 10);
}

#[test]
#[ignore = "a million frames: cargo nextest run -p robot --run-ignored only"]
fn no_hostile_frame_of_a_million_moves_a_robot() {
    attack(50_000, 20);
}

#[test]
fn frames_that_were_too_long_on_the_way_are_refused_and_counted() {
    let mut firmware = Firmware::new(kit::settings(NUMBER, KEY));
    for sequence in 1..=20 {
        let sent_ms = 1000 + 8 * sequence;
        let frame = kit::command(&kit::header(NUMBER, 1, sequence, sent_ms), &drive(WANTED), &KEY);
        assert_eq!(firmware.on_datagram(&frame, sent_ms + 1), Received::Accepted);
    }
    let mut refused = 0;
    for late_ms in 0..100 {
        let sequence = 21 + late_ms;
        let sent_ms = 1200 + 10 * late_ms;
        let header = robot::frame::Header {
            echo_ms: 0,
            ..kit::header(NUMBER, 1, sequence, sent_ms)
        };
        let received = firmware.on_datagram(&kit::command(&header, &drive(WANTED), &KEY), sent_ms + late_ms);
        // The bound of the clock offset is 2.5 ms and grows with 200 ppm: what is certainly young is accepted, what may be old is not.
        if late_ms <= 44 {
            assert_eq!(received, Received::Accepted, "{late_ms} ms");
        }
        if late_ms > 50 {
            assert!(matches!(received, Received::Refused(_)), "{late_ms} ms: {received:?}");
        }
        refused += u32::from(received != Received::Accepted);
    }
    assert_eq!(firmware.counters().stale, refused);
}

#[test]
fn a_fix_never_moves_a_robot_or_keeps_it_awake() {
    let mut firmware = Firmware::new(kit::settings(NUMBER, KEY));
    let sensors = Sensors {
        wheel_rad_per_s: [WANTED; 4],
        bus_v: 24.0,
        ..Sensors::default()
    };
    let mut sequence = 0;
    let mut send = |firmware: &mut Firmware, now_ms: u32, moving: bool| {
        sequence += 1;
        let header = kit::header(NUMBER, 1, sequence, now_ms - 1);
        let frame = if moving {
            kit::command(&header, &drive(WANTED), &KEY)
        } else {
            let fix = Fix {
                x_m: 1.0,
                exposure_ms: header.clock_ms - 10,
                position_sd_m: 0.001,
                yaw_sd_rad: 0.003,
                ..Fix::default()
            };
            kit::fix(&header, &fix, &KEY)
        };
        firmware.on_datagram(&frame, now_ms)
    };
    let mut now_ms = 1000;
    for _ in 0..100 {
        now_ms += 2;
        send(&mut firmware, now_ms, true);
        firmware.step(now_ms, &sensors);
    }
    assert_eq!(firmware.set_point().wheel_rad_per_s, [WANTED; 4]);
    let last_ms = now_ms;
    while now_ms < last_ms + 600 {
        now_ms += 2;
        assert!(matches!(send(&mut firmware, now_ms, false), Received::Fix(_)));
        firmware.step(now_ms, &sensors);
    }
    assert_eq!(firmware.set_point().wheel_rad_per_s, [0.0; 4]);
    assert_eq!(firmware.watchdog().state(), robot::watchdog::WatchdogState::Latched);
    assert!((firmware.estimator().estimate().x_m - 1.0).abs() < 0.01);
}
