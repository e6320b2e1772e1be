//! What is wrong with a robot, and what follows from it: the most severe finding wins.

use crate::MAX_MOTORS;
use crate::battery::Level;

/// What a robot's state asks for, in rising severity.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum Action {
    #[default]
    None,
    /// The run may end, another may not begin.
    NoNewRun,
    /// Drive to the dock.
    Dock,
    /// Ramp to zero and latch; the robot does that by itself.
    Stop,
}

/// Findings of a step.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Findings {
    pub battery: Level,
    /// A motor is driven hard and does not turn.
    pub stalled: bool,
    /// A sensor gives values that cannot be.
    pub sensor_fault: bool,
}

impl Findings {
    /// The most severe action that any finding asks for.
    pub fn action(&self) -> Action {
        let battery = match self.battery {
            Level::Good => Action::None,
            Level::Low => Action::NoNewRun,
            Level::Critical => Action::Dock,
            Level::Empty => Action::Stop,
        };
        let stalled = if self.stalled { Action::Stop } else { Action::None };
        let sensor = if self.sensor_fault { Action::Stop } else { Action::None };
        battery.max(stalled).max(sensor)
    }
}

/// Share of the bus voltage (or of the current limit) that counts as driven hard.
const HARD_SHARE: f64 = 0.5;
/// A wheel that is slower than this stands.
const STANDING_RAD_PER_S: f64 = 0.3;
/// How long a wheel may stand against a hard drive.
const STALL_S: f64 = 1.5;
/// A finding lasts this long at least, so that several reports tell it.
const HELD_S: f64 = 0.5;
/// How long sensors may give nonsense.
const SENSOR_S: f64 = 0.1;
/// A gyro does not show more.
const MAX_YAW_RATE_RAD_PER_S: f64 = 35.0;

/// One motor in a step.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct MotorSample {
    pub voltage_v: f64,
    pub wheel_rad_per_s: f64,
}

/// Sees stalled motors and sensor faults; its steps are `step_s` apart.
#[derive(Debug, Clone, Copy)]
pub struct HealthMonitor {
    step_s: f64,
    standing_s: [f64; MAX_MOTORS],
    nonsense_s: f64,
    /// Time left that each finding is held: stalled, sensor fault.
    held_s: [f64; 2],
}

impl HealthMonitor {
    pub fn new(step_s: f64) -> Self {
        Self {
            step_s,
            standing_s: [0.0; MAX_MOTORS],
            nonsense_s: 0.0,
            held_s: [0.0; 2],
        }
    }

    /// Forgets what it has seen: the robot was lifted.
    pub fn reset(&mut self) {
        *self = Self::new(self.step_s);
    }

    pub fn step(
        &mut self,
        battery: Level,
        bus_v: f64,
        gyro_z_rad_per_s: f64,
        motors: &[MotorSample; MAX_MOTORS],
    ) -> Findings {
        for (standing_s, motor) in self.standing_s.iter_mut().zip(motors) {
            let stands =
                motor.wheel_rad_per_s.abs() < STANDING_RAD_PER_S && motor.voltage_v.abs() > HARD_SHARE * bus_v.max(1.0);
            *standing_s = if stands { *standing_s + self.step_s } else { 0.0 };
        }
        let is_nonsense = !bus_v.is_finite()
            || gyro_z_rad_per_s.is_nan()
            || gyro_z_rad_per_s.abs() > MAX_YAW_RATE_RAD_PER_S
            || motors.iter().any(|motor| !motor.wheel_rad_per_s.is_finite());
        self.nonsense_s = if is_nonsense {
            self.nonsense_s + self.step_s
        } else {
            0.0
        };
        let found = [
            self.standing_s.iter().any(|standing_s| *standing_s >= STALL_S),
            self.nonsense_s >= SENSOR_S,
        ];
        for (held_s, found) in self.held_s.iter_mut().zip(found) {
            *held_s = if found { HELD_S } else { *held_s - self.step_s };
        }
        let [stalled, sensor_fault] = self.held_s.map(|held_s| held_s > 0.0);
        Findings {
            battery,
            stalled,
            sensor_fault,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LEVELS: [Level; 4] = [Level::Good, Level::Low, Level::Critical, Level::Empty];

    #[test]
    fn the_most_severe_of_any_pair_of_faults_wins() {
        let expected = |battery: Level| match battery {
            Level::Good => Action::None,
            Level::Low => Action::NoNewRun,
            Level::Critical => Action::Dock,
            Level::Empty => Action::Stop,
        };
        for battery in LEVELS {
            for (stalled, sensor_fault) in [(false, false), (true, false), (false, true), (true, true)] {
                let findings = Findings {
                    battery,
                    stalled,
                    sensor_fault,
                };
                let wanted = if stalled || sensor_fault {
                    Action::Stop
                } else {
                    expected(battery)
                };
                assert_eq!(findings.action(), wanted, "{findings:?}");
            }
        }
    }

    #[test]
    fn a_wheel_that_stands_under_full_voltage_is_stalled_after_its_time_and_not_before() {
        let mut monitor = HealthMonitor::new(0.01);
        let sample = |voltage_v: f64, wheel_rad_per_s: f64| {
            let mut motors = [MotorSample::default(); MAX_MOTORS];
            motors[2] = MotorSample {
                voltage_v,
                wheel_rad_per_s,
            };
            motors
        };
        let mut step = |voltage_v, speed| monitor.step(Level::Good, 24.0, 0.0, &sample(voltage_v, speed)).stalled;
        for _ in 0..148 {
            assert!(!step(20.0, 0.1));
        }
        assert!(!step(20.0, 2.0), "it turned");
        for _ in 0..149 {
            assert!(!step(20.0, 0.1));
        }
        step(20.0, 0.1);
        assert!(step(20.0, 0.1));
        let told = (0..100).take_while(|_| step(2.0, 0.0)).count();
        assert!((48..=50).contains(&told), "told for half a second: {told} steps");
    }

    #[test]
    fn nonsense_from_a_sensor_stops_only_when_it_lasts() {
        let mut monitor = HealthMonitor::new(0.01);
        let motors = [MotorSample::default(); MAX_MOTORS];
        for _ in 0..9 {
            assert_eq!(
                monitor.step(Level::Good, 24.0, f64::NAN, &motors).action(),
                Action::None
            );
        }
        monitor.step(Level::Good, 24.0, 0.0, &motors);
        let mut last = Action::None;
        for _ in 0..11 {
            last = monitor.step(Level::Good, 24.0, 99.0, &motors).action();
        }
        assert_eq!(last, Action::Stop);
    }
}
