//! Robots and a laboratory's end of the link, for the tests.
#![allow(dead_code, reason = "every test file uses its own part")]

use robot::battery::BatterySettings;
use robot::estimator::EstimatorSettings;
use robot::firmware::Settings;
use robot::frame::{
    Command, Fix, GroupHeader, Header, MAX_CHARACTERS, Part, Target, encode_command, encode_fix, encode_group,
    encode_target,
};
use robot::fusion::DynamicLimits;
use robot::key::Key;
use robot::kinematics::{Wheel, WheelKind, WheelTable};
use robot::motor_control::{ControllerSettings, Law};
use robot::watchdog::WatchdogSettings;
use std::f64::consts::FRAC_PI_4;

pub const RADIUS_M: f64 = 0.05;

/// Laboratory clock minus robot clock.
pub const LAB_AHEAD_MS: u32 = 5000;

pub fn wheel(kind: WheelKind, x_m: f64, y_m: f64, rolling_direction_rad: f64) -> Wheel {
    Wheel {
        kind,
        x_m,
        y_m,
        rolling_direction_rad,
        radius_m: RADIUS_M,
        driven: true,
        steered: false,
    }
}

pub fn omni() -> WheelTable {
    let corners = [
        (0.12, 0.12, 3.0),
        (-0.12, 0.12, 5.0),
        (-0.12, -0.12, 7.0),
        (0.12, -0.12, 9.0),
    ];
    let wheels = corners.map(|(x, y, quarters)| wheel(WheelKind::Omni, x, y, quarters * FRAC_PI_4));
    WheelTable::new(&wheels, 0.0).unwrap()
}

pub fn diff() -> WheelTable {
    let wheels = [
        wheel(WheelKind::Standard, 0.0, 0.15, 0.0),
        wheel(WheelKind::Standard, 0.0, -0.15, 0.0),
        Wheel {
            driven: false,
            ..wheel(WheelKind::Caster, 0.15, 0.0, 0.0)
        },
    ];
    WheelTable::new(&wheels, 0.0).unwrap()
}

/// Front steered, rear driven.
pub fn car() -> WheelTable {
    let axle = |x_m: f64, steered: bool| {
        [0.12, -0.12].map(|y_m| Wheel {
            driven: !steered,
            steered,
            ..wheel(WheelKind::Standard, x_m, y_m, 0.0)
        })
    };
    let wheels = [axle(0.13, true), axle(-0.13, false)].concat();
    WheelTable::new(&wheels, 0.5).unwrap()
}

pub fn settings(number: u8, key: Key) -> Settings {
    Settings {
        number,
        key,
        wheels: omni(),
        motor: ControllerSettings {
            law: Law::SpeedPi {
                kp_v_s_per_rad: 0.8,
                ki_v_per_rad: 6.0,
            },
            sample_rate_hz: 480,
            computation_delay_samples: 0,
            encoder: None,
        },
        smoothing_s: 0.0,
        watchdog: WatchdogSettings::default(),
        limits: DynamicLimits::default(),
        estimator: EstimatorSettings::default(),
        battery: BatterySettings::for_supply(24.0),
    }
}

/// Header of a frame sent at robot time `sent_ms` by a laboratory that heard the robot 2 ms before.
pub fn header(robot: u8, epoch: u32, sequence: u32, sent_ms: u32) -> Header {
    Header {
        robot,
        epoch,
        sequence,
        tick: sequence,
        clock_ms: sent_ms.wrapping_add(LAB_AHEAD_MS),
        echo_ms: sent_ms.wrapping_sub(2),
    }
}

pub fn command(header: &Header, command: &Command, key: &Key) -> Vec<u8> {
    let mut out = [0; 96];
    let length = encode_command(header, command, key, &mut out);
    out[..length].to_vec()
}

pub fn target(header: &Header, target: &Target, key: &Key) -> Vec<u8> {
    let mut out = [0; 96];
    let length = encode_target(header, target, key, &mut out);
    out[..length].to_vec()
}

pub fn fix(header: &Header, fix: &Fix, key: &Key) -> Vec<u8> {
    let mut out = [0; 96];
    let length = encode_fix(header, fix, key, &mut out);
    out[..length].to_vec()
}

pub fn group(header: &GroupHeader, parts: &[Part]) -> Vec<u8> {
    let mut out = [0; MAX_CHARACTERS];
    let length = encode_group(header, parts, &mut out);
    out[..length].to_vec()
}

/// Xorshift: a seeded stream of numbers.
#[derive(Debug, Clone)]
pub struct Random(pub u64);

impl Random {
    pub fn next(&mut self) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0
    }

    pub fn below(&mut self, limit: usize) -> usize {
        (self.next() % limit as u64) as usize
    }

    /// 0 to 1.
    pub fn uniform(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1u64 << 53) as f64
    }

    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.uniform()
    }

    /// Mean 0, standard deviation 1 (sum of twelve).
    pub fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.uniform()).sum::<f64>() - 6.0
    }
}
