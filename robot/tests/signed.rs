//! Frames with a good CRC and a good MAC whose payloads nobody checked: a laboratory gone mad, or a key that leaked. The robot
//! must not panic, whatever it uses must be a number, and what it drives at must keep its own limits.

mod kit;
#[path = "kit/signing.rs"]
mod signing;

use kit::{Random, header};
use robot::firmware::{Firmware, Outputs, Received, Sensors};
use robot::frame::{Header, Payload, decode, decode_for};
use robot::fusion::DynamicLimits;
use robot::key::Key;
use signing::{FIX, GROUP, KEY, TARGET, payload, signed};

const NUMBER: u8 = 3;
const BUS_V: f64 = 24.0;

fn all_finite(values: impl IntoIterator<Item = f64>) -> bool {
    values.into_iter().all(f64::is_finite)
}

/// Up to the rounding of a multiplication.
fn within(value: f64, low: f64, high: f64) -> bool {
    (low..=high * (1.0 + 1e-12)).contains(&value)
}

/// Every value that a reader of this frame gets lies within its field of `docs/link.md`.
fn assert_values(payload: &Payload) {
    const I16: f64 = 32_768.0;
    let fits = match payload {
        Payload::Command(command) => {
            command
                .wheel_rad_per_s
                .iter()
                .all(|speed| within(speed.abs(), 0.0, 0.01 * I16))
                && within(command.steering_rad.abs(), 0.0, 1e-4 * I16)
        }
        Payload::Telemetry(told) => {
            told.wheel_rad_per_s
                .iter()
                .chain(&told.current_a)
                .all(|value| within(value.abs(), 0.0, 0.01 * I16))
                && told.wheel_rad.iter().all(|angle| within(angle.abs(), 0.0, 2_147_484.0))
                && within(told.bus_v, 0.0, 65.535)
                && within(told.gyro_z_rad_per_s.abs(), 0.0, 0.001 * I16)
                && told
                    .accel_m_per_s2
                    .iter()
                    .all(|value| within(value.abs(), 0.0, 0.01 * I16))
                && within(told.steering_rad.abs(), 0.0, 1e-4 * I16)
        }
        Payload::Health(health) => {
            within(health.x_m.abs(), 0.0, 214_748.4)
                && within(health.y_m.abs(), 0.0, 214_748.4)
                && within(health.yaw_rad.abs(), 0.0, 1e-4 * I16)
                && within(health.position_sd_m, 0.0, 6.5535)
                && within(health.yaw_sd_rad, 0.0, 6.5535)
                && within(health.rest_v, 0.0, 65.535)
        }
        Payload::Target(target) => {
            let region = target.region;
            within(target.speed_cap_m_per_s, 0.0, 5.1 + 1e-9)
                && within(target.yaw_rate_cap_rad_per_s, 0.0, 12.75 + 1e-9)
                && target.expiry_ms <= 100
                && [region.left_m, region.right_m, region.bottom_m, region.top_m]
                    .iter()
                    .all(|side| within(side.abs(), 0.0, 0.001 * I16))
        }
        Payload::Fix(fix) => {
            within(fix.x_m.abs(), 0.0, 214_748.4)
                && within(fix.y_m.abs(), 0.0, 214_748.4)
                && within(fix.yaw_rad.abs(), 0.0, 1e-4 * I16)
                && within(fix.position_sd_m, 0.0, 0.1276)
                && within(fix.yaw_sd_rad, 0.0, 0.2551)
        }
        Payload::Counters(_) => true,
    };
    assert!(fits, "{payload:?}");
}

/// A robot on a floor without friction limits: its wheels do what they are told.
struct Rig {
    firmware: Firmware,
    limits: DynamicLimits,
    now_ms: u32,
    sequence: u32,
    sensors: Sensors,
    steps: u32,
}

impl Rig {
    fn new(wheels: robot::kinematics::WheelTable) -> Self {
        let settings = robot::firmware::Settings {
            wheels,
            ..kit::settings(NUMBER, Key::new(KEY))
        };
        let mut rig = Self {
            limits: settings.limits,
            firmware: Firmware::new(settings),
            now_ms: 10_000,
            sequence: 0,
            sensors: Sensors {
                bus_v: BUS_V,
                ..Sensors::default()
            },
            steps: 0,
        };
        // The clock gets known, the latch is released.
        for _ in 0..10 {
            let clear = [0b101, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0];
            let header = rig.header();
            let _ = rig.firmware.on_datagram(&signed(1, &header, &clear), rig.now_ms);
            rig.step();
        }
        rig
    }

    fn header(&mut self) -> Header {
        self.sequence += 1;
        header(NUMBER, 5, self.sequence, self.now_ms.wrapping_sub(1))
    }

    /// 8 ms, four steps.
    fn step(&mut self) {
        for _ in 0..4 {
            self.steps += 1;
            self.now_ms += 2;
            let outputs = self.firmware.step(self.now_ms, &self.sensors);
            self.check(&outputs);
            let set = *self.firmware.set_point();
            self.sensors.wheel_rad_per_s = set.wheel_rad_per_s;
            for (angle, speed) in self.sensors.wheel_rad.iter_mut().zip(&set.wheel_rad_per_s) {
                *angle += speed / 480.0;
            }
            self.sensors.steering_rad = set.steering_rad;
        }
    }

    fn check(&self, outputs: &Outputs) {
        let set = self.firmware.set_point();
        assert!(
            outputs.motor_v.iter().all(|voltage| voltage.abs() <= BUS_V) && outputs.steering_rad.is_finite(),
            "{outputs:?}"
        );
        assert!(
            all_finite(set.wheel_rad_per_s) && set.steering_rad.is_finite(),
            "{set:?}"
        );
        let estimate = self.firmware.estimator().estimate();
        assert!(
            all_finite([
                estimate.x_m,
                estimate.y_m,
                estimate.yaw_rad,
                estimate.position_sd_m,
                estimate.yaw_sd_rad,
                estimate.gyro_bias_rad_per_s,
                estimate.twist.forward_m_per_s,
                estimate.twist.left_m_per_s,
                estimate.twist.yaw_rate_rad_per_s,
            ]) && estimate.position_sd_m >= 0.0
                && estimate.yaw_rad.abs() <= std::f64::consts::PI + 1e-9,
            "{estimate:?}"
        );
    }

    /// What it tells of itself reads back.
    fn check_reports(&mut self) {
        let mut out = [0; 160];
        for report in 0..3 {
            let length = match report {
                0 => self.firmware.telemetry(self.now_ms, &mut out),
                1 => self.firmware.health_report(self.now_ms, &mut out),
                _ => self.firmware.counters_report(self.now_ms, &mut out),
            };
            let frame = decode(&out[..length], &Key::new(KEY)).expect("its own frame");
            assert_values(&frame.payload);
        }
    }
}

fn tables() -> [robot::kinematics::WheelTable; 3] {
    [kit::omni(), kit::diff(), kit::car()]
}

#[test]
fn a_signed_payload_of_any_kind_gives_values_of_its_fields_or_an_error() {
    let mut random = Random(0x5eed_0001);
    let (mut read, mut refused) = (0, 0);
    for round in 0..60_000_u32 {
        let kind = 1 + (round % 7) as u8;
        let head = header(NUMBER, random.next() as u32, random.next() as u32, random.next() as u32);
        let frame = signed(kind, &head, &payload(kind, || random.next()));
        match decode_for(&frame, NUMBER, &Key::new(KEY)) {
            Ok(frame) => {
                assert_values(&frame.payload);
                read += 1;
            }
            Err(robot::frame::FrameError::Reserved { .. }) => refused += 1,
            Err(error) => panic!("type {kind}: {error}"),
        }
    }
    println!("{read} frames read, {refused} refused for reserved bits or values");
    assert!(read > 40_000 && refused > 1_000, "{read} {refused}");
}

/// Groups, targets and fixes of a mad laboratory, and its robots' own frames thrown back, all in order and in time.
#[test]
fn a_robot_outlives_any_signed_payload() {
    for (place, wheels) in tables().into_iter().enumerate() {
        let mut random = Random(0x5eed_0100 + place as u64);
        let mut rig = Rig::new(wheels);
        let (mut accepted, mut fixes) = (0, 0);
        for round in 0..20_000_u32 {
            let kind = [GROUP, TARGET, TARGET, FIX, FIX, 4, 5, 1][random.below(8)];
            let mut head = rig.header();
            let mut bytes = payload(kind, || random.next());
            if kind == FIX {
                // A moment that may be: else nearly none would be used.
                let exposure_ms = head.clock_ms.wrapping_sub(random.below(320) as u32);
                bytes[10..14].copy_from_slice(&exposure_ms.to_be_bytes());
            }
            if random.below(50) == 0 {
                // Anything in the header; on a copy, as the largest epoch there is would end the test.
                let mut copy = rig.firmware.clone();
                head.epoch = random.next() as u32;
                head.sequence = random.next() as u32;
                head.clock_ms = random.next() as u32;
                head.echo_ms = random.next() as u32;
                let _ = copy.on_datagram(&signed(kind, &head, &bytes), rig.now_ms);
                for step in 0..8 {
                    let outputs = copy.step(rig.now_ms + 2 * step, &rig.sensors);
                    rig.check(&outputs);
                    assert!(all_finite(copy.set_point().wheel_rad_per_s));
                }
                continue;
            }
            match rig.firmware.on_datagram(&signed(kind, &head, &bytes), rig.now_ms) {
                Received::Accepted => accepted += 1,
                Received::Fix(_) => fixes += 1,
                Received::Refused(_) | Received::Invalid(_) => {}
            }
            rig.step();
            if round % 500 == 0 {
                rig.check_reports();
            }
        }
        println!("{accepted} accepted, {fixes} fixes, {} steps", rig.steps);
        assert!(accepted > 3_000 && fixes > 1_000, "{accepted} {fixes}");
    }
}

/// A target that is enabled and mostly has room to drive; often every cap is open.
fn target(random: &mut Random) -> Vec<u8> {
    let mut bytes = payload(TARGET, || random.next());
    bytes[0] = bytes[0] & 0b1000 | 0b101;
    bytes[1] = 100;
    if random.below(4) > 0 {
        for (place, side_mm) in [-30_000_i16, 30_000, -30_000, 30_000].iter().enumerate() {
            bytes[10 + 2 * place..12 + 2 * place].copy_from_slice(&side_mm.to_be_bytes());
        }
    }
    if random.below(2) == 0 {
        bytes[8..10].fill(0xFF);
    }
    bytes
}

/// A fix somewhere within 3 m, just now.
fn fix(head: &Header, random: &mut Random) -> Vec<u8> {
    let mut bytes = payload(FIX, || random.next());
    for place in [0, 4] {
        let tenths_mm = (random.between(-3.0, 3.0) * 1e4) as i32;
        bytes[place..place + 4].copy_from_slice(&tenths_mm.to_be_bytes());
    }
    bytes[10..14].copy_from_slice(&head.clock_ms.wrapping_sub(20).to_be_bytes());
    bytes
}

/// Whatever a target asks for, wheels and body keep the robot's own limits.
#[test]
fn targets_move_nothing_beyond_the_robots_own_limits() {
    for (place, wheels) in tables().into_iter().enumerate() {
        let mut random = Random(0x5eed_0200 + place as u64);
        let mut rig = Rig::new(wheels);
        let (mut fastest, mut moved) = (0.0_f64, 0);
        let mut held = target(&mut random);
        for round in 0..20_000_u32 {
            let head = rig.header();
            // One target for 0.4 s, long enough to get fast; fixes in between.
            if round.is_multiple_of(50) {
                held = target(&mut random);
            }
            let frame = if random.below(3) > 0 {
                signed(TARGET, &head, &held)
            } else {
                signed(FIX, &head, &fix(&head, &mut random))
            };
            let _ = rig.firmware.on_datagram(&frame, rig.now_ms);
            rig.step();
            let set = rig.firmware.set_point();
            let speeds = set.wheel_rad_per_s.iter().map(|speed| speed.abs());
            let wheel = speeds.fold(0.0, f64::max);
            let twist = wheels.twist(&set.wheel_rad_per_s, set.steering_rad);
            // The cap of a car-like robot counts along its axis: its origin swings sideways ahead of the fixed axle besides.
            let across = if wheels.moves_sideways() {
                twist.left_m_per_s
            } else {
                0.0
            };
            let body = libm::hypot(twist.forward_m_per_s, across);
            // Read back from wheels and steering, which a car-like robot cannot have exactly as the twist asks.
            assert!(body <= rig.limits.speed_m_per_s * 1.002, "{body} m/s");
            let turn = twist.yaw_rate_rad_per_s.abs();
            assert!(turn <= rig.limits.yaw_rate_rad_per_s * 1.002, "{turn} rad/s");
            fastest = fastest.max(wheel);
            moved += u32::from(wheel > 0.5);
        }
        println!("fastest wheel {fastest:.2} rad/s, moving in {moved} of 20000 periods");
        assert!(moved > 5_000 && fastest > 8.0, "{moved} {fastest}");
    }
}
