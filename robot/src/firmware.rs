//! One robot's program: datagrams and sensor values in, motor voltages and telemetry out.

mod report;

use crate::MAX_MOTORS;
use crate::acceptance::{Acceptance, Refusal};
use crate::battery::{BatteryMonitor, BatterySettings};
use crate::estimator::{Estimator, EstimatorSettings, FixOutcome, Measurement, PoseFix};
use crate::frame::{self, Command, Counters, Fix, FrameError, Header, Payload, Target};
use crate::fusion::{DynamicLimits, Fusion};
use crate::health::{Action, Findings, HealthMonitor, MotorSample};
use crate::key::Key;
use crate::kinematics::WheelTable;
use crate::motor_control::{ControlSample, Controller, ControllerSettings};
use crate::watchdog::{SetPoint, Watchdog, WatchdogSettings};

/// Steps per second of [`Firmware::step`].
pub const RATE_HZ: f64 = 480.0;
const RATE: u32 = 480;
/// Oldest exposure of a fix.
const MAX_FIX_AGE_MS: f64 = 300.0;
/// Wheels that turn less count as standing.
const STANDING_RAD: f64 = 0.01;
/// For this long.
const STANDING_S: f64 = 0.3;

/// What is set at commissioning.
#[derive(Debug, Clone, Copy)]
pub struct Settings {
    /// Address on the link.
    pub number: u8,
    pub key: Key,
    /// Nominal geometry; its driven wheels are the motors, in this order.
    pub wheels: WheelTable,
    pub motor: ControllerSettings,
    /// Time constant with which the motors' controllers smooth their set-points, s; 0: not at all.
    pub smoothing_s: f64,
    pub watchdog: WatchdogSettings,
    pub limits: DynamicLimits,
    pub estimator: EstimatorSettings,
    pub battery: BatterySettings,
}

/// Sensor values of one sample; wheels are the driven ones in the order of the description.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Sensors {
    pub wheel_rad_per_s: [f64; MAX_MOTORS],
    pub wheel_rad: [f64; MAX_MOTORS],
    /// Hardware counters, read by a motor control with an encoder only.
    pub encoder_count: [i32; MAX_MOTORS],
    pub current_a: [f64; MAX_MOTORS],
    pub bus_v: f64,
    pub gyro_z_rad_per_s: f64,
    /// Forward and left.
    pub accel_m_per_s2: [f64; 2],
    pub steering_rad: f64,
    /// Horizontal field, forward and left; `None` without a magnetometer.
    pub magnetic_field_t: Option<[f64; 2]>,
}

/// What the motors' control reads between two steps.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct MotorSensors {
    pub wheel_rad_per_s: [f64; MAX_MOTORS],
    pub encoder_count: [i32; MAX_MOTORS],
    pub current_a: [f64; MAX_MOTORS],
    pub bus_v: f64,
}

/// What the power stage and the steering gear get until the next step.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Outputs {
    pub motor_v: [f64; MAX_MOTORS],
    pub steering_rad: f64,
}

/// What became of a datagram.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Received {
    /// Feeds the watchdog and sets the set-points.
    Accepted,
    /// A fix in order: it may move the estimate, never the robot.
    Fix(FixOutcome),
    /// Authentic, but it may not move the robot (a `stop` flag in order is obeyed even then).
    Refused(Refusal),
    /// Not a frame, or not made with this robot's key.
    Invalid(FrameError),
}

impl Received {
    /// From the current commander: telemetry goes to where it came from.
    pub fn is_in_order(&self) -> bool {
        match self {
            Self::Accepted | Self::Fix(_) => true,
            Self::Refused(refusal) => refusal.is_in_order(),
            Self::Invalid(_) => false,
        }
    }
}

/// Frame codec, rules of acceptance, watchdog, estimator, fusion and motor control of one robot. No IO, no clock of its own.
#[derive(Debug, Clone)]
pub struct Firmware {
    settings: Settings,
    acceptance: Acceptance,
    watchdog: Watchdog,
    controllers: Option<[Controller; MAX_MOTORS]>,
    /// Steps until the next sample of a motor control that is slower than the firmware.
    motor_wait: u32,
    motor_v: [f64; MAX_MOTORS],
    set_point: SetPoint,
    /// Set-points as the motors' controllers have smoothed them.
    smoothed_rad_per_s: [f64; MAX_MOTORS],
    estimator: Estimator,
    fusion: Fusion,
    /// The last accepted command was a target.
    on_target: bool,
    battery: BatteryMonitor,
    health: HealthMonitor,
    findings: Findings,
    counters: Counters,
    standing_at_rad: [f64; MAX_MOTORS],
    standing_s: f64,
    sensors: Sensors,
    heard_ms: u32,
    applied_sequence: u32,
    applied_tick: u32,
    sent_frames: u32,
    saturated: bool,
}

impl Firmware {
    pub fn new(settings: Settings) -> Self {
        let step_s = 1.0 / RATE_HZ;
        Self {
            settings,
            acceptance: Acceptance::default(),
            watchdog: Watchdog::new(settings.watchdog).with_wheels(settings.wheels),
            controllers: None,
            motor_wait: 0,
            motor_v: [0.0; MAX_MOTORS],
            set_point: SetPoint::default(),
            smoothed_rad_per_s: [0.0; MAX_MOTORS],
            estimator: Estimator::new(settings.estimator),
            fusion: Fusion::new(settings.limits, step_s),
            on_target: false,
            battery: BatteryMonitor::new(settings.battery, step_s),
            health: HealthMonitor::new(step_s),
            findings: Findings::default(),
            counters: Counters::default(),
            standing_at_rad: [0.0; MAX_MOTORS],
            standing_s: 0.0,
            sensors: Sensors::default(),
            heard_ms: 0,
            applied_sequence: 0,
            applied_tick: 0,
            sent_frames: 0,
            saturated: false,
        }
    }

    /// Largest epoch of any authentic command.
    pub fn epoch(&self) -> u32 {
        self.acceptance.epoch()
    }

    /// Sequence of the command that the set-points come from; 0 before the first.
    pub fn applied_sequence(&self) -> u32 {
        self.applied_sequence
    }

    pub fn watchdog(&self) -> &Watchdog {
        &self.watchdog
    }

    pub fn estimator(&self) -> &Estimator {
        &self.estimator
    }

    pub fn battery(&self) -> &BatteryMonitor {
        &self.battery
    }

    pub fn findings(&self) -> &Findings {
        &self.findings
    }

    pub fn counters(&self) -> &Counters {
        &self.counters
    }

    /// Set-points of the last step.
    pub fn set_point(&self) -> &SetPoint {
        &self.set_point
    }

    /// Samples of the motors' control in a step: [`Firmware::step`] takes the first, [`Firmware::motor_step`] the others.
    pub fn motor_samples_per_step(&self) -> u32 {
        (self.settings.motor.sample_rate_hz / RATE).max(1)
    }

    /// Takes one datagram that arrived at `now_ms` of the robot's own wrapping clock.
    pub fn on_datagram(&mut self, bytes: &[u8], now_ms: u32) -> Received {
        let received = self.received(bytes, now_ms);
        match &received {
            Received::Accepted => self.counters.accepted = self.counters.accepted.wrapping_add(1),
            Received::Fix(_) => self.counters.fixes = self.counters.fixes.wrapping_add(1),
            Received::Refused(refusal) => self.counters.count_refusal(refusal),
            Received::Invalid(error) => self.counters.count_error(error),
        }
        received
    }

    fn received(&mut self, bytes: &[u8], now_ms: u32) -> Received {
        let frame = match frame::decode_for(bytes, self.settings.number, &self.settings.key) {
            Err(error) => return Received::Invalid(error),
            Ok(frame) if frame.header.robot == self.settings.number => frame,
            Ok(_) => return Received::Refused(Refusal::NotForThisRobot),
        };
        let header = &frame.header;
        match &frame.payload {
            Payload::Command(command) => self.on_command(header, command, None, now_ms),
            Payload::Target(target) => {
                let as_command = Command {
                    enable: target.enable,
                    stop: target.stop,
                    clear: target.clear,
                    ..Command::default()
                };
                self.on_command(header, &as_command, Some(target), now_ms)
            }
            Payload::Fix(fix) => self.on_fix(header, fix, now_ms),
            _ => Received::Refused(Refusal::NotForThisRobot),
        }
    }

    fn on_command(&mut self, header: &Header, command: &Command, target: Option<&Target>, now_ms: u32) -> Received {
        if let Err(refusal) = self.acceptance.check_order(header, now_ms) {
            return Received::Refused(refusal);
        }
        self.heard_ms = header.clock_ms;
        if command.stop {
            self.watchdog.stop(header.epoch);
        }
        let age_ms = match self.acceptance.check_age(header, now_ms) {
            Err(refusal) => return Received::Refused(refusal),
            Ok(age_ms) => age_ms,
        };
        match target {
            Some(target) => {
                if !self.on_target {
                    let twist = self
                        .settings
                        .wheels
                        .twist(&self.set_point.wheel_rad_per_s, self.set_point.steering_rad);
                    self.fusion.take_over(&twist, self.set_point.steering_rad);
                }
                // Until the fusion's next step the robot goes on as it does.
                let held = Command {
                    wheel_rad_per_s: self.set_point.wheel_rad_per_s,
                    steering_rad: self.set_point.steering_rad,
                    ..*command
                };
                self.watchdog.accept(&held, header.epoch, now_ms);
                self.fusion.accept(target, age_ms);
            }
            None => {
                self.fusion.reset();
                self.watchdog.accept(command, header.epoch, now_ms);
            }
        }
        self.on_target = target.is_some();
        self.applied_sequence = header.sequence;
        self.applied_tick = header.tick;
        Received::Accepted
    }

    /// A fix obeys the order of frames but moves nothing, so its own way may take as long as it likes; its exposure counts.
    fn on_fix(&mut self, header: &Header, fix: &Fix, now_ms: u32) -> Received {
        if let Err(refusal) = self.acceptance.check_order(header, now_ms) {
            return Received::Refused(refusal);
        }
        self.heard_ms = header.clock_ms;
        let Some(age) = self.acceptance.clock().age(now_ms, fix.exposure_ms) else {
            return Received::Refused(Refusal::ClockUnknown);
        };
        if age.largest_ms() > MAX_FIX_AGE_MS {
            return Received::Refused(Refusal::Stale {
                age_ms: age.largest_ms(),
            });
        }
        Received::Fix(self.estimator.fix(&PoseFix {
            x_m: fix.x_m,
            y_m: fix.y_m,
            yaw_rad: fix.yaw_rad,
            position_sd_m: fix.position_sd_m,
            yaw_sd_rad: fix.yaw_sd_rad,
            age_ms: age.estimate_ms,
        }))
    }

    /// One control step; call it at [`RATE_HZ`].
    pub fn step(&mut self, now_ms: u32, sensors: &Sensors) -> Outputs {
        self.sensors = *sensors;
        self.estimate(sensors);
        self.look_after(sensors);
        if self.findings.action() == Action::Stop {
            self.watchdog.stop(self.acceptance.epoch());
        }
        if self.on_target {
            let set_point = self.fusion.step(&self.estimator.estimate(), &self.settings.wheels);
            self.watchdog.hold(&set_point);
        }
        self.set_point = self.watchdog.step(now_ms);
        if self.motor_wait == 0 {
            self.motor_wait = RATE / self.settings.motor.sample_rate_hz.clamp(1, RATE);
            self.motor_step(&MotorSensors {
                wheel_rad_per_s: sensors.wheel_rad_per_s,
                encoder_count: sensors.encoder_count,
                current_a: sensors.current_a,
                bus_v: sensors.bus_v,
            });
        }
        self.motor_wait -= 1;
        Outputs {
            motor_v: self.motor_v,
            steering_rad: self.set_point.steering_rad,
        }
    }

    /// Sets anew how the motors' controllers smooth their set-points ([`Settings::smoothing_s`]).
    pub fn set_smoothing(&mut self, smoothing_s: f64) {
        self.settings.smoothing_s = smoothing_s;
    }

    /// One sample of the motors' control between two steps; returns the voltages until the next.
    pub fn motor_step(&mut self, sensors: &MotorSensors) -> [f64; MAX_MOTORS] {
        let settings = self.settings.motor;
        let counts = sensors.encoder_count;
        let controllers = self
            .controllers
            .get_or_insert_with(|| core::array::from_fn(|i| Controller::new(settings, counts[i])));
        self.motor_v = [0.0; MAX_MOTORS];
        let sample_s = 1.0 / f64::from(settings.sample_rate_hz);
        let kept = self.settings.smoothing_s / (sample_s + self.settings.smoothing_s);
        for (smooth, told) in self.smoothed_rad_per_s.iter_mut().zip(&self.set_point.wheel_rad_per_s) {
            *smooth = told + kept * (*smooth - told);
        }
        for (i, controller) in controllers.iter_mut().enumerate().take(self.settings.wheels.motors()) {
            self.motor_v[i] = controller.step(&ControlSample {
                command_rad_per_s: self.smoothed_rad_per_s[i],
                wheel_rad_per_s: sensors.wheel_rad_per_s[i],
                encoder_count: sensors.encoder_count[i],
                current_a: sensors.current_a[i],
                bus_v: sensors.bus_v,
            });
        }
        self.saturated = self.motor_v.iter().any(|voltage| voltage.abs() >= sensors.bus_v);
        self.motor_v
    }

    fn estimate(&mut self, sensors: &Sensors) {
        let wheels = &self.settings.wheels;
        let moved = sensors
            .wheel_rad
            .iter()
            .zip(&self.standing_at_rad)
            .any(|(now, then)| (now - then).abs() > STANDING_RAD);
        let told = self.set_point.wheel_rad_per_s.iter().any(|speed| *speed != 0.0);
        if moved || told {
            self.standing_at_rad = sensors.wheel_rad;
            self.standing_s = 0.0;
        } else {
            self.standing_s += 1.0 / RATE_HZ;
        }
        self.estimator.step(&Measurement {
            gyro_z_rad_per_s: sensors.gyro_z_rad_per_s,
            accel_m_per_s2: sensors.accel_m_per_s2,
            wheel_twist: wheels.twist(&sensors.wheel_rad_per_s, sensors.steering_rad),
            sees_sideways: wheels.sees_sideways(),
            standing: self.standing_s >= STANDING_S,
            magnetic_field_t: sensors.magnetic_field_t,
        });
    }

    fn look_after(&mut self, sensors: &Sensors) {
        let motors = core::array::from_fn(|i| MotorSample {
            voltage_v: self.motor_v[i],
            wheel_rad_per_s: sensors.wheel_rad_per_s[i],
        });
        let power_w = self
            .motor_v
            .iter()
            .zip(&sensors.current_a)
            .map(|(voltage_v, current_a)| voltage_v * current_a)
            .sum();
        let level = self.battery.step(sensors.bus_v, power_w);
        self.findings = self
            .health
            .step(level, sensors.bus_v, sensors.gyro_z_rad_per_s, &motors);
    }

    /// Forgets the integrals of the motors' control: their power was off.
    pub fn reset_drives(&mut self) {
        self.controllers = None;
        self.smoothed_rad_per_s = [0.0; MAX_MOTORS];
        self.motor_v = [0.0; MAX_MOTORS];
        self.motor_wait = 0;
    }

    /// The robot was lifted and stands somewhere else: drives, pose and findings start over; epoch and counters stay.
    pub fn put_down(&mut self) {
        self.reset_drives();
        self.estimator.lift();
        self.health.reset();
        self.fusion.reset();
        self.standing_s = 0.0;
    }
}
