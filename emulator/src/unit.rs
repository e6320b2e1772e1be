//! One emulated robot: firmware, body, sensors, its own clock and its faults.

use crate::commissioning;
use crate::faults::{FaultKind, Faults, LostWay};
use crate::hidden::{Hidden, HiddenRobot};
use crate::noise::Noise;
use crate::plant::arena::{MotorStage, Occupant};
use crate::plant::body::{Body, BodyError, Drive};
use crate::plant::{Pose, Step};
use crate::sensors::SensorSet;
use api::robot::LabRobot;
use robot::firmware::{Firmware, Received, Settings};
use robot::frame::TELEMETRY_MAX_CHARACTERS;
use robot::key::Key;

/// Largest drift of a robot's clock.
const DRIFT_PPM: f64 = 50.0;
/// Robots were switched on up to this long before the emulator started.
const UPTIME_US: f64 = 3.6e9;

/// What a frame asks of the link.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Reception {
    /// From the current commander: telemetry goes there from now on.
    Commander,
    /// Authentic, but not from the commander: one answer.
    Probe,
    /// Lost, damaged or forged: no answer.
    Nothing,
}

/// One robot of the laboratory, on the floor or on its shelf.
#[derive(Debug)]
pub struct Unit {
    robot: LabRobot,
    hidden: HiddenRobot,
    settings: Settings,
    firmware: Firmware,
    body: Body,
    on_floor: bool,
    sensors: SensorSet,
    drive: Drive,
    faults: Faults,
    clock: SkewedClock,
    random: Noise,
    dock: Option<Pose>,
}

/// How far a robot may stand from its dock, and how much askew, so that the charger touches it.
const DOCK_REACH_M: f64 = 0.06;
const DOCK_REACH_RAD: f64 = 0.15;

impl Unit {
    /// A robot on its shelf, switched on.
    pub fn new(robot: &LabRobot, key: Key, hidden: &Hidden, seed: u64) -> Result<Self, BodyError> {
        let hidden_robot = hidden.robot(&robot.description.name);
        let stream = u64::from(robot.number) << 32;
        let mut random = Noise::new(seed, stream);
        let body = Body::new(
            &robot.description,
            robot.bounding_radius_m,
            &hidden_robot,
            &hidden.run_variation,
            &mut random,
        )?;
        let settings = commissioning::settings(robot, key, &hidden_robot)?;
        Ok(Self {
            sensors: SensorSet::new(
                robot.description.noise.as_ref(),
                settings.motor.encoder.map(|encoder| encoder.ticks_per_rev),
                &hidden_robot,
                Noise::new(seed, stream + 1),
            ),
            clock: SkewedClock {
                offset_us: (random.uniform() * UPTIME_US) as i64,
                drift_ppm: DRIFT_PPM * (2.0 * random.uniform() - 1.0),
            },
            robot: robot.clone(),
            hidden: hidden_robot,
            settings,
            firmware: Firmware::new(settings),
            body,
            on_floor: false,
            drive: Drive {
                motor_v: None,
                steering_rad: 0.0,
                stuck_wheel: None,
            },
            faults: Faults::default(),
            random,
            dock: None,
        })
    }

    pub fn robot(&self) -> &LabRobot {
        &self.robot
    }

    pub fn firmware(&self) -> &Firmware {
        &self.firmware
    }

    pub fn faults(&self) -> &Faults {
        &self.faults
    }

    /// Number that tracker and cameras see on this robot.
    pub fn seen_as(&self) -> u8 {
        self.faults.seen_as.unwrap_or(self.robot.number)
    }

    /// The body while it stands on the floor.
    pub fn on_floor(&self) -> Option<&Body> {
        self.on_floor.then_some(&self.body)
    }

    /// The same, with what drives it, for the arena to move.
    pub(crate) fn seat(&mut self) -> Option<Seat<'_>> {
        let samples_per_tick = self.firmware.motor_samples_per_step();
        self.on_floor.then_some(Seat {
            body: &mut self.body,
            drive: self.drive,
            stage: Stage {
                firmware: &mut self.firmware,
                sensors: &mut self.sensors,
                samples_per_tick,
            },
        })
    }

    /// Puts the robot down at rest, with this run's variation of its parameters. The firmware keeps its largest epoch.
    pub fn place(&mut self, pose: Pose, hidden: &Hidden) -> Result<(), BodyError> {
        let mut body = Body::new(
            &self.robot.description,
            self.robot.bounding_radius_m,
            &self.hidden,
            &hidden.run_variation,
            &mut self.random,
        )?;
        body.place(pose);
        // Only a charger charges; a robot that comes from the floor keeps what it has.
        body.battery.charge = body.battery.charge.min(self.body.battery.charge);
        self.sensors.carry_angles_over(&self.body);
        self.body = body;
        self.on_floor = true;
        self.firmware.put_down();
        Ok(())
    }

    /// There is a charger for this robot on the floor.
    pub fn set_dock(&mut self, pose: Pose) {
        self.dock = Some(pose);
    }

    /// On the rack, or at its dock.
    pub fn is_on_charger(&self) -> bool {
        if !self.on_floor {
            return true;
        }
        self.dock.is_some_and(|dock| {
            let pose = self.body.pose();
            let askew_rad = (pose.yaw_rad - dock.yaw_rad).rem_euclid(std::f64::consts::TAU);
            (pose.x_m - dock.x_m).hypot(pose.y_m - dock.y_m) <= DOCK_REACH_M
                && askew_rad.min(std::f64::consts::TAU - askew_rad) <= DOCK_REACH_RAD
        })
    }

    /// Takes another hidden configuration; on the floor the robot is put down anew where it stands.
    pub(crate) fn change(&mut self, hidden: &Hidden) -> Result<(), BodyError> {
        self.hidden = hidden.robot(&self.robot.description.name);
        self.sensors.change(&self.hidden);
        self.settings.smoothing_s = self.hidden.wear.motor_lag_s;
        self.firmware.set_smoothing(self.settings.smoothing_s);
        if self.on_floor {
            self.place(self.body.pose(), hidden)?;
        }
        Ok(())
    }

    /// Takes the robot off the floor.
    pub fn lift(&mut self) {
        if std::mem::replace(&mut self.on_floor, false) {
            self.firmware.put_down();
        }
    }

    pub fn set_fault(&mut self, kind: FaultKind) {
        match kind {
            FaultKind::Dead => self.faults.dead = true,
            FaultKind::StuckWheel { wheel } => self.faults.stuck_wheel = Some(wheel),
            FaultKind::DropFrames { fraction, way } => {
                (self.faults.dropped_fraction, self.faults.dropped_way) = (fraction, way);
            }
            FaultKind::BurstFrames { .. }
            | FaultKind::DelayFrames { .. }
            | FaultKind::CopyFrames { .. }
            | FaultKind::ReorderFrames { .. } => self.faults.impair(kind),
            FaultKind::SwapIdentity { with } => self.faults.seen_as = Some(with),
            FaultKind::DrainBattery { charge_per_s } => self.faults.drain_per_s = charge_per_s,
            FaultKind::TrackerLost => self.faults.tracker_lost = true,
            FaultKind::TrackerFrozen => self.faults.tracker_frozen = true,
            FaultKind::LowBattery { charge } => self.body.battery.charge = charge,
            FaultKind::None => {
                if self.faults.dead {
                    self.firmware = Firmware::new(self.settings);
                }
                self.faults = Faults::default();
            }
        }
    }

    /// Tracker and cameras tell the robot apart again.
    pub(crate) fn end_swap(&mut self) {
        self.faults.seen_as = None;
    }

    /// One firmware step; the voltages hold until the next. A robot on a charger charges, switched on or not.
    pub fn step_firmware(&mut self, now_us: i64) {
        if self.is_on_charger() {
            let step = Step {
                dt_s: 1.0 / robot::firmware::RATE_HZ,
            };
            self.body.battery.charge(self.hidden.battery_charge, step);
        }
        self.drive = Drive {
            motor_v: None,
            steering_rad: self.drive.steering_rad,
            stuck_wheel: self.faults.stuck_wheel,
        };
        if self.faults.dead {
            return;
        }
        let drained = self.faults.drain_per_s / robot::firmware::RATE_HZ;
        self.body.battery.charge = (self.body.battery.charge - drained).max(0.0);
        let sensors = self.sensors.sample(&self.body, self.on_floor);
        let outputs = self.firmware.step(self.clock.read_ms(now_us), &sensors);
        if self.on_floor {
            self.drive.motor_v = Some(outputs.motor_v);
            self.drive.steering_rad = outputs.steering_rad;
        } else {
            self.firmware.reset_drives();
        }
    }

    /// Takes a datagram off the link.
    pub fn receive(&mut self, bytes: &[u8], now_us: i64) -> Reception {
        if self.faults.dead || self.loses_frame(LostWay::Down) {
            return Reception::Nothing;
        }
        match self.firmware.on_datagram(bytes, self.clock.read_ms(now_us)) {
            received if received.is_in_order() => Reception::Commander,
            Received::Refused(
                robot::acceptance::Refusal::OldEpoch { .. } | robot::acceptance::Refusal::OutOfOrder { .. },
            ) => Reception::Probe,
            _ => Reception::Nothing,
        }
    }

    /// Writes telemetry for the commander; 0 characters when it is lost or the robot is dead.
    pub fn telemetry(&mut self, now_us: i64, out: &mut [u8; TELEMETRY_MAX_CHARACTERS]) -> usize {
        if self.faults.dead || self.loses_frame(LostWay::Up) {
            0
        } else {
            self.firmware.telemetry(self.clock.read_ms(now_us), out)
        }
    }

    /// Writes estimate and health for the commander; 0 characters as for telemetry.
    pub fn health_report(&mut self, now_us: i64, out: &mut [u8; TELEMETRY_MAX_CHARACTERS]) -> usize {
        if self.faults.dead || self.loses_frame(LostWay::Up) {
            0
        } else {
            self.firmware.health_report(self.clock.read_ms(now_us), out)
        }
    }

    /// Writes the counters of frames for the commander; 0 characters as for telemetry.
    pub fn counters_report(&mut self, now_us: i64, out: &mut [u8; TELEMETRY_MAX_CHARACTERS]) -> usize {
        if self.faults.dead || self.loses_frame(LostWay::Up) {
            0
        } else {
            self.firmware.counters_report(self.clock.read_ms(now_us), out)
        }
    }

    /// Writes the answer to a [`Reception::Probe`].
    pub fn probe_reply(&mut self, now_us: i64, out: &mut [u8; TELEMETRY_MAX_CHARACTERS]) -> usize {
        if self.faults.dead || self.loses_frame(LostWay::Up) {
            0
        } else {
            self.firmware.probe_reply(self.clock.read_ms(now_us), out)
        }
    }

    fn loses_frame(&mut self, way: LostWay) -> bool {
        let there = [LostWay::Both, way].contains(&self.faults.dropped_way);
        there && self.faults.dropped_fraction > 0.0 && self.random.uniform() < self.faults.dropped_fraction
    }
}

/// A robot on the floor with the parts of it that act within a tick.
#[derive(Debug)]
pub(crate) struct Seat<'a> {
    body: &'a mut Body,
    drive: Drive,
    stage: Stage<'a>,
}

impl Seat<'_> {
    pub(crate) fn occupant(&mut self) -> Occupant<'_> {
        let samples = self.drive.motor_v.is_some() && self.stage.samples_per_tick > 1;
        Occupant {
            body: self.body,
            drive: self.drive,
            stage: if samples { Some(&mut self.stage) } else { None },
        }
    }
}

/// The firmware's motor control between two of its steps.
#[derive(Debug)]
struct Stage<'a> {
    firmware: &'a mut Firmware,
    sensors: &'a mut SensorSet,
    samples_per_tick: u32,
}

impl MotorStage for Stage<'_> {
    fn samples_per_tick(&self) -> u32 {
        self.samples_per_tick
    }

    fn sample(&mut self, body: &Body) -> [f64; robot::MAX_MOTORS] {
        self.firmware.motor_step(&self.sensors.motor_sample(body))
    }
}

/// A robot's millisecond clock: set at its own power-on, and a little fast or slow.
#[derive(Debug, Clone, Copy)]
struct SkewedClock {
    offset_us: i64,
    drift_ppm: f64,
}

impl SkewedClock {
    fn read_ms(&self, host_us: i64) -> u32 {
        let drifted_us = host_us + (host_us as f64 * self.drift_ppm * 1e-6) as i64 + self.offset_us;
        // Wraps around like the 32-bit counter of a microcontroller.
        (drifted_us / 1000) as u32
    }
}
