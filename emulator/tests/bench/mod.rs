//! A laboratory in virtual time: commands at 120 Hz, telemetry back, plant and firmware at 480 Hz.
#![allow(dead_code, reason = "every test file uses its own part")]

use api::lab::LabDescription;
use api::robot::{LabRobot, RobotDescription, Steering, Wheel};
use emulator::Laboratory;
use emulator::hidden::Hidden;
use emulator::keys::Keys;
use emulator::laboratory::Placement;
use robot::frame::{Command, Header, Payload, Telemetry, decode, encode_command};
use robot::key::Key;

pub const KEY_HEX: &str = "000102030405060708090a0b0c0d0e0f";

pub fn reference() -> LabDescription {
    serde_json::from_str(include_str!("../../../examples/lab/reference.json")).unwrap()
}

pub fn keys() -> Keys {
    let entries: Vec<_> = (1..=250).map(|number| format!("\"{number}\":\"{KEY_HEX}\"")).collect();
    Keys::parse(&format!("{{{}}}", entries.join(","))).unwrap()
}

/// The reference laboratory with one robot of every chassis.
pub fn every_chassis() -> LabDescription {
    let mut description = reference();
    let (omni, diff) = (description.robots[0].clone(), description.robots[4].clone());
    let four = |name: &str, number: u8, driven: [bool; 4], steered: [bool; 4]| {
        let template = &omni.description.wheels[0];
        let corner = |i: usize| Wheel {
            x_m: if i < 2 { 0.13 } else { -0.13 },
            y_m: if i.is_multiple_of(2) { 0.12 } else { -0.12 },
            rolling_direction_rad: 0.0,
            kind: "standard".to_owned(),
            driven: driven[i],
            steered: steered[i],
            ..template.clone()
        };
        let steering = steered[0].then_some(Steering {
            lag_s: 0.08,
            rate_limit_rad_per_s: Some(6.0),
            angle_limit_rad: Some(0.5),
        });
        let wheels = (0..4).map(corner).collect();
        let body = RobotDescription {
            name: format!("{name}-01"),
            chassis: name.to_owned(),
            wheels,
            steering,
            ..omni.description.clone()
        };
        LabRobot {
            number,
            description: body,
            ..omni.clone()
        }
    };
    let (front, rear, all, none) = (
        [true, true, false, false],
        [false, false, true, true],
        [true; 4],
        [false; 4],
    );
    description.robots = vec![
        omni.clone(),
        diff,
        four("diff4", 11, all, none),
        four("fwd", 12, front, front),
        four("rwd", 13, rear, front),
        four("awd", 14, all, front),
    ];
    description
}

pub struct Bench {
    pub laboratory: Laboratory,
    pub telemetry: Vec<Option<Telemetry>>,
    echo_ms: Vec<u32>,
    epoch: u32,
    sequence: u32,
    now_us: i64,
    ticks: u64,
}

impl Bench {
    pub fn new(description: &LabDescription, hidden: Hidden, seed: u64) -> Self {
        let laboratory = Laboratory::new(description, hidden, &keys(), seed).unwrap();
        let robots = description.robots.len();
        Self {
            laboratory,
            telemetry: vec![None; robots],
            echo_ms: vec![0; robots],
            epoch: 1,
            sequence: 0,
            now_us: 50_000_000,
            ticks: 0,
        }
    }

    pub fn place(&mut self, placements: &[(u8, f64, f64, f64)]) {
        let placements: Vec<_> = placements
            .iter()
            .map(|&(number, x_m, y_m, yaw_rad)| Placement {
                number,
                x_m,
                y_m,
                yaw_rad,
            })
            .collect();
        self.laboratory.place(&placements).unwrap();
    }

    /// One control period: a command to every robot (where given), four plant ticks, telemetry.
    pub fn period(&mut self, command: impl Fn(usize) -> Option<Command>) {
        self.sequence += 1;
        let key = Key::from_hex(KEY_HEX).unwrap();
        let clock_ms = |us: i64| (us / 1000) as u32;
        for index in 0..self.echo_ms.len() {
            let unit = self.laboratory.unit_mut(index).unwrap();
            if let Some(command) = command(index) {
                let header = Header {
                    robot: unit.robot().number,
                    epoch: self.epoch,
                    sequence: self.sequence,
                    tick: self.sequence,
                    clock_ms: clock_ms(self.now_us),
                    echo_ms: self.echo_ms[index],
                };
                let mut out = [0; 96];
                let length = encode_command(&header, &command, &key, &mut out);
                unit.receive(&out[..length], self.now_us + 1000);
            }
        }
        for _ in 0..4 {
            self.ticks += 1;
            self.now_us = 50_000_000 + (self.ticks * 1_000_000 / 480) as i64;
            self.laboratory.tick(self.now_us);
        }
        for index in 0..self.echo_ms.len() {
            let mut out = [0; 160];
            let length = self
                .laboratory
                .unit_mut(index)
                .unwrap()
                .telemetry(self.now_us, &mut out);
            self.telemetry[index] = None;
            if length > 0 {
                let frame = decode(&out[..length], &key).unwrap();
                self.echo_ms[index] = frame.header.clock_ms;
                let Payload::Telemetry(telemetry) = frame.payload else {
                    panic!("not telemetry")
                };
                self.telemetry[index] = Some(telemetry);
            }
        }
    }

    /// Sequence for a frame of one's own after the period's command, the echo for robot 0, and the time.
    pub fn between(&mut self) -> (u32, u32, i64) {
        self.sequence += 1;
        (self.sequence, self.echo_ms[0], self.now_us)
    }

    pub fn drive_for(&mut self, seconds: f64, command: impl Fn(usize) -> Option<Command>) {
        for _ in 0..(seconds * 120.0) as u32 {
            self.period(&command);
        }
    }

    pub fn pose(&self, index: usize) -> emulator::plant::Pose {
        self.laboratory.units()[index].on_floor().expect("on the floor").pose()
    }

    pub fn speed_m_per_s(&self, index: usize) -> f64 {
        let [vx, vy] = self.laboratory.units()[index]
            .on_floor()
            .expect("on the floor")
            .velocity_m_per_s();
        vx.hypot(vy)
    }
}

pub fn wheels(wheel_rad_per_s: [f64; 4]) -> Option<Command> {
    Some(Command {
        enable: true,
        wheel_rad_per_s,
        ..Command::default()
    })
}

/// Set-points that drive the robot forward at a speed.
pub fn forward(description: &RobotDescription, speed_m_per_s: f64) -> [f64; 4] {
    let mut set_points = [0.0; 4];
    for (set_point, wheel) in set_points
        .iter_mut()
        .zip(description.wheels.iter().filter(|wheel| wheel.driven))
    {
        *set_point = speed_m_per_s * wheel.rolling_direction_rad.cos() / wheel.radius_m.unwrap();
    }
    set_points
}
