//! One robot's program: datagrams and sensor values in, motor voltages and telemetry out.

use crate::MAX_MOTORS;
use crate::acceptance::{Acceptance, Refusal};
use crate::frame::{self, FrameError, Header, Payload, Status, TELEMETRY_MAX_CHARACTERS, Telemetry};
use crate::key::Key;
use crate::speed_loop::{SpeedLoop, SpeedLoopSettings, WheelSpeed};
use crate::watchdog::{Watchdog, WatchdogSettings, WatchdogState};

/// Steps per second of [`Firmware::step`].
pub const RATE_HZ: f64 = 480.0;

/// What is set at commissioning.
#[derive(Debug, Clone, Copy)]
pub struct Settings {
    /// Address on the link.
    pub number: u8,
    pub key: Key,
    /// Driven wheels, at most [`MAX_MOTORS`].
    pub motors: usize,
    pub speed_loop: SpeedLoopSettings,
    pub watchdog: WatchdogSettings,
}

/// Sensor values of one sample; wheels are the driven ones in the order of the description.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Sensors {
    pub wheel_rad_per_s: [f64; MAX_MOTORS],
    pub wheel_rad: [f64; MAX_MOTORS],
    pub current_a: [f64; MAX_MOTORS],
    pub bus_v: f64,
    pub gyro_z_rad_per_s: f64,
    /// Forward and left.
    pub accel_m_per_s2: [f64; 2],
    pub steering_rad: f64,
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
    /// Authentic, but it may not move the robot (a `stop` flag in order is obeyed even then).
    Refused(Refusal),
    /// Not a frame, or not made with this robot's key.
    Invalid(FrameError),
}

impl Received {
    /// From the current commander: telemetry goes to where it came from.
    pub fn is_in_order(&self) -> bool {
        match self {
            Self::Accepted => true,
            Self::Refused(refusal) => refusal.is_in_order(),
            Self::Invalid(_) => false,
        }
    }
}

/// Frame codec, rules of acceptance, watchdog and speed loops of one robot. No IO, no clock of its own.
#[derive(Debug, Clone)]
pub struct Firmware {
    settings: Settings,
    acceptance: Acceptance,
    watchdog: Watchdog,
    speed_loops: [SpeedLoop; MAX_MOTORS],
    sensors: Sensors,
    heard_ms: u32,
    applied_sequence: u32,
    applied_tick: u32,
    sent_frames: u32,
    saturated: bool,
}

impl Firmware {
    pub fn new(settings: Settings) -> Self {
        Self {
            settings,
            acceptance: Acceptance::default(),
            watchdog: Watchdog::new(settings.watchdog),
            speed_loops: [SpeedLoop::new(settings.speed_loop); MAX_MOTORS],
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

    pub fn watchdog(&self) -> &Watchdog {
        &self.watchdog
    }

    /// Takes one datagram that arrived at `now_ms` of the robot's own wrapping clock.
    pub fn on_datagram(&mut self, bytes: &[u8], now_ms: u32) -> Received {
        let (header, command) = match frame::decode(bytes, &self.settings.key) {
            Err(error) => return Received::Invalid(error),
            Ok(frame::Frame {
                header,
                payload: Payload::Command(command),
            }) if header.robot == self.settings.number => (header, command),
            Ok(_) => return Received::Refused(Refusal::NotForThisRobot),
        };
        if let Err(refusal) = self.acceptance.check_order(&header, now_ms) {
            return Received::Refused(refusal);
        }
        self.heard_ms = header.clock_ms;
        if command.stop {
            self.watchdog.stop(header.epoch);
        }
        if let Err(refusal) = self.acceptance.check_age(&header, now_ms) {
            return Received::Refused(refusal);
        }
        self.watchdog.accept(&command, header.epoch, now_ms);
        self.applied_sequence = header.sequence;
        self.applied_tick = header.tick;
        Received::Accepted
    }

    /// One control step; call it at [`RATE_HZ`].
    pub fn step(&mut self, now_ms: u32, sensors: &Sensors) -> Outputs {
        self.sensors = *sensors;
        let set_point = self.watchdog.step(now_ms);
        let mut motor_v = [0.0; MAX_MOTORS];
        let wheels = set_point.wheel_rad_per_s.iter().zip(&sensors.wheel_rad_per_s);
        for ((voltage, speed_loop), (&command_rad_per_s, &measured_rad_per_s)) in motor_v
            .iter_mut()
            .zip(&mut self.speed_loops)
            .zip(wheels)
            .take(self.settings.motors)
        {
            *voltage = speed_loop.step(
                WheelSpeed {
                    command_rad_per_s,
                    measured_rad_per_s,
                },
                sensors.bus_v,
            );
        }
        self.saturated = motor_v.iter().any(|voltage| voltage.abs() >= sensors.bus_v);
        Outputs {
            motor_v,
            steering_rad: set_point.steering_rad,
        }
    }

    /// Forgets the integrals of the speed loops: the robot was lifted and its motors were without power.
    pub fn reset_drives(&mut self) {
        self.speed_loops.iter_mut().for_each(SpeedLoop::reset);
    }

    /// Writes telemetry of the last step for the current commander and returns its length.
    pub fn telemetry(&mut self, now_ms: u32, out: &mut [u8; TELEMETRY_MAX_CHARACTERS]) -> usize {
        self.write_telemetry(now_ms, self.heard_ms, out)
    }

    /// Answer to an authentic frame of somebody who is not the commander: the same without an echo, whose clock it would not be.
    pub fn probe_reply(&mut self, now_ms: u32, out: &mut [u8; TELEMETRY_MAX_CHARACTERS]) -> usize {
        self.write_telemetry(now_ms, 0, out)
    }

    fn write_telemetry(&mut self, now_ms: u32, echo_ms: u32, out: &mut [u8; TELEMETRY_MAX_CHARACTERS]) -> usize {
        self.sent_frames = self.sent_frames.wrapping_add(1);
        let header = Header {
            robot: self.settings.number,
            epoch: self.acceptance.epoch(),
            sequence: self.sent_frames,
            tick: self.applied_tick,
            clock_ms: now_ms,
            echo_ms,
        };
        let state = self.watchdog.state();
        let sensors = &self.sensors;
        let telemetry = Telemetry {
            status: Status {
                running: state == WatchdogState::Running && self.watchdog.is_enabled(),
                ramping: state == WatchdogState::Ramping,
                latched: state == WatchdogState::Latched,
                clock_known: self.acceptance.clock().age(now_ms, self.heard_ms).is_some(),
                stopped: self.watchdog.is_stopped(),
                saturated: self.saturated,
            },
            applied_sequence: self.applied_sequence,
            wheel_rad_per_s: sensors.wheel_rad_per_s,
            wheel_rad: sensors.wheel_rad,
            current_a: sensors.current_a,
            bus_v: sensors.bus_v,
            gyro_z_rad_per_s: sensors.gyro_z_rad_per_s,
            accel_m_per_s2: sensors.accel_m_per_s2,
            steering_rad: sensors.steering_rad,
        };
        frame::encode_telemetry(&header, &telemetry, &self.settings.key, out)
    }
}
