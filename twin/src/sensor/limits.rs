//! Limits of sensor settings: one table, used for validation and for messages.

use super::encoder::MAX_WINDOW_SAMPLES;
use super::range::RangeSettings;
use super::settings::SensorSettings;
use super::tracked_pose::TrackedPoseSettings;
use crate::parameter::{ParameterError, Range, range};
use crate::robot::Robot;
use crate::{PHYSICS_PERIOD_S, PHYSICS_RATE_HZ};

const fn noise(key: &'static str, unit: &'static str) -> Range {
    range(key, unit, 0.0, 1e3, "give one standard deviation, 0 = none")
}

const EVERY_REMEDY: &str = "give the 480 Hz physics steps between two samples, 4 = 120 Hz";
const EVERY: Range = range("every_steps", "steps", 1.0, 10.0 * PHYSICS_RATE_HZ as f64, EVERY_REMEDY);
const TICKS_REMEDY: &str = "give the edges of one turn of the wheel: lines x 4 x gear ratio";
const TICKS: Range = range("ticks.encoder_ticks_per_rev", "ticks", 1.0, 1e7, TICKS_REMEDY);
const WINDOW_REMEDY: &str = "give the samples that one speed looks back on, 1 = from sample to sample";
const WINDOW: Range = range(
    "ticks.window_samples",
    "samples",
    1.0,
    MAX_WINDOW_SAMPLES as f64,
    WINDOW_REMEDY,
);
const FIELD: Range = range(
    "field_t",
    "T",
    1e-9,
    1.0,
    "give the field strength in tesla, 50e-6 on earth",
);
const NORTH_REMEDY: &str = "give the yaw of a robot that faces magnetic north, radians";
const NORTH: Range = range("magnetic_north_rad", "rad", -13.0, 13.0, NORTH_REMEDY);
const DIP_REMEDY: &str = "give the angle of the field below the horizontal; a vertical field shows no heading";
const DIP: Range = range("inclination_rad", "rad", -1.55, 1.55, DIP_REMEDY);
const MOUNT_REMEDY: &str = "give the sensor's place in the body frame, x forward, y left";
const MOUNT_X: Range = range("x_m", "m", -5.0, 5.0, MOUNT_REMEDY);
const MOUNT_Y: Range = range("y_m", "m", -5.0, 5.0, MOUNT_REMEDY);
const MOUNT_ANGLE: Range = range("angle_rad", "rad", -13.0, 13.0, "give radians, 0 = looks forward");
const NEAREST: Range = range(
    "min_m",
    "m",
    0.0,
    100.0,
    "give the shortest distance that can be measured",
);
const FARTHEST: Range = range("max_m", "m", 0.0, 1000.0, "give the farthest distance that can be seen");
const SHARE_REMEDY: &str = "give the part of the standard deviation per metre of distance, 0 = none";
const SHARE: Range = range("noise_share", "m/m", 0.0, 1.0, SHARE_REMEDY);
const LATENCY_REMEDY: &str = "give the time from mid-exposure to arrival";
const LATENCY: Range = range("latency_s", "s", 0.0, 1.0, LATENCY_REMEDY);
const JITTER_REMEDY: &str = "give the longest delay on top of the latency, 0 = none";
const JITTER: Range = range("latency_jitter_s", "s", 0.0, 1.0, JITTER_REMEDY);
const DROP: Range = range(
    "drop_probability",
    "",
    0.0,
    1.0,
    "give the share of frames without the robot",
);

/// Problems found so far, and the sensor that is looked at.
#[derive(Default)]
struct Checker {
    problems: Vec<ParameterError>,
    sensor: &'static str,
}

impl Checker {
    /// Goes on to a sensor and checks its rate.
    fn sensor(&mut self, name: &'static str, every_steps: u32) {
        self.sensor = name;
        self.value(f64::from(every_steps), &EVERY);
    }

    fn missing(&mut self, part: &str) {
        let limit = format!("only on robots with a {part} description");
        let remedy = format!("leave the sensor out, or describe the {part}");
        self.problem("", format!("the robot has no {part} description"), &limit, &remedy);
    }

    fn value(&mut self, value: f64, range: &Range) {
        self.value_of("", value, range);
    }

    fn value_of(&mut self, part: &str, value: f64, range: &Range) {
        if (range.low..=range.high).contains(&value) {
            return;
        }
        let what = if value.is_finite() {
            "is out of range"
        } else {
            "is not a finite number"
        };
        let limit = format!("{}..={} {}", range.low, range.high, range.unit);
        self.problem(
            &format!("{part}{}", range.key),
            format!("{value} {what}"),
            limit.trim_end(),
            range.remedy,
        );
    }

    fn problem(&mut self, key: &str, message: String, limit: &str, remedy: &str) {
        let path = ["sensors", self.sensor, key];
        let path: Vec<&str> = path.into_iter().filter(|part| !part.is_empty()).collect();
        self.problems.push(ParameterError {
            field: path.join("."),
            message,
            limit: limit.to_owned(),
            remedy: remedy.to_owned(),
        });
    }
}

/// All problems of a robot's sensors, in the order of the fields.
pub(super) fn check(settings: &SensorSettings, robot: &Robot) -> Vec<ParameterError> {
    let mut checker = Checker::default();
    check_drive(&mut checker, settings, robot);
    check_body(&mut checker, settings);
    if let Some(range) = &settings.range {
        check_range(&mut checker, range);
    }
    if let Some(tracker) = &settings.tracked_pose {
        check_tracker(&mut checker, tracker);
    }
    checker.problems
}

fn check_drive(checker: &mut Checker, settings: &SensorSettings, robot: &Robot) {
    let has_motor = robot.description().motor.is_some();
    let has_steering = robot.description().steering.is_some();
    if let Some(encoder) = &settings.encoder {
        checker.sensor("encoder", encoder.every_steps);
        if let Some(ticks) = &encoder.ticks {
            checker.value(f64::from(ticks.encoder_ticks_per_rev), &TICKS);
            checker.value(f64::from(ticks.window_samples), &WINDOW);
        }
        checker.value(encoder.noise_rad_per_s, &noise("noise_rad_per_s", "rad/s"));
    }
    if let Some(current) = &settings.current {
        checker.sensor("current", current.every_steps);
        checker.value(current.noise_a, &noise("noise_a", "A"));
        if !has_motor {
            checker.missing("motor");
        }
    }
    if let Some(bus) = &settings.bus_voltage {
        checker.sensor("bus_voltage", bus.every_steps);
        checker.value(bus.noise_v, &noise("noise_v", "V"));
        if !has_motor {
            checker.missing("motor");
        }
    }
    if let Some(steering) = &settings.steering {
        checker.sensor("steering", steering.every_steps);
        checker.value(steering.noise_rad, &noise("noise_rad", "rad"));
        if !has_steering {
            checker.missing("steering");
        }
    }
}

fn check_body(checker: &mut Checker, settings: &SensorSettings) {
    if let Some(gyro) = &settings.gyro {
        checker.sensor("gyro", gyro.every_steps);
        checker.value(gyro.noise_rad_per_s, &noise("noise_rad_per_s", "rad/s"));
    }
    if let Some(accelerometer) = &settings.accelerometer {
        checker.sensor("accelerometer", accelerometer.every_steps);
        checker.value(accelerometer.noise_m_per_s2, &noise("noise_m_per_s2", "m/s^2"));
    }
    if let Some(magnetometer) = &settings.magnetometer {
        checker.sensor("magnetometer", magnetometer.every_steps);
        checker.value(magnetometer.field_t, &FIELD);
        checker.value(magnetometer.magnetic_north_rad, &NORTH);
        checker.value(magnetometer.inclination_rad, &DIP);
        checker.value(magnetometer.noise_t, &noise("noise_t", "T"));
    }
}

fn check_range(checker: &mut Checker, range: &RangeSettings) {
    checker.sensor("range", range.every_steps);
    for (index, mount) in range.mounts.iter().enumerate() {
        let part = format!("mounts[{index}].");
        checker.value_of(&part, mount.x_m, &MOUNT_X);
        checker.value_of(&part, mount.y_m, &MOUNT_Y);
        checker.value_of(&part, mount.angle_rad, &MOUNT_ANGLE);
    }
    checker.value(range.min_m, &NEAREST);
    checker.value(range.max_m, &FARTHEST);
    if range.max_m <= range.min_m {
        let message = format!("{} is not beyond min_m = {}", range.max_m, range.min_m);
        checker.problem("max_m", message, "above min_m", FARTHEST.remedy);
    }
    checker.value(range.noise_m, &noise("noise_m", "m"));
    checker.value(range.noise_share, &SHARE);
}

fn check_tracker(checker: &mut Checker, tracker: &TrackedPoseSettings) {
    checker.sensor("tracked_pose", tracker.every_steps);
    if tracker.exposure_steps > tracker.every_steps {
        checker.problem(
            "exposure_steps",
            format!("the shutter is open for {} steps", tracker.exposure_steps),
            &format!("0..={} steps (every_steps)", tracker.every_steps),
            "shorten the exposure or lower the rate",
        );
    }
    checker.value(tracker.latency_s, &LATENCY);
    let half_exposure_s = 0.5 * f64::from(tracker.exposure_steps) * PHYSICS_PERIOD_S;
    if (0.0..half_exposure_s).contains(&tracker.latency_s) {
        checker.problem(
            "latency_s",
            format!("{} s from mid-exposure is before the exposure ends", tracker.latency_s),
            &format!("at least half the exposure, {half_exposure_s} s"),
            LATENCY_REMEDY,
        );
    }
    checker.value(tracker.latency_jitter_s, &JITTER);
    checker.value(tracker.noise_xy_m, &noise("noise_xy_m", "m"));
    checker.value(tracker.noise_yaw_rad, &noise("noise_yaw_rad", "rad"));
    checker.value(tracker.drop_probability, &DROP);
}
