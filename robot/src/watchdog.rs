//! Stops a robot that no longer gets fresh set-points, and keeps it stopped when told so.
//!
//! ```text
//! Latched --clear or new epoch--> Running --100 ms without a set-point--> Ramping --500 ms--> Latched
//!                                 Running <--------- set-point ---------- Ramping
//! ```
//! Only accepted set-points come here (see [`crate::acceptance`]); nothing else feeds the watchdog.

use crate::MAX_MOTORS;
use crate::frame::Command;
use crate::kinematics::WheelTable;
use crate::ramp::Ramp;

/// Time limits and deceleration.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WatchdogSettings {
    /// Silence after which the set-point ramps to zero.
    pub ramp_after_ms: u32,
    /// Silence after which the robot latches.
    pub latch_after_ms: u32,
    /// Deceleration of the fastest wheel while ramping on the spot, and its acceleration when motion resumes.
    pub ramp_rad_per_s2: f64,
    /// Deceleration of the body while ramping, where the wheels' geometry is known.
    pub body_m_per_s2: f64,
}

impl Default for WatchdogSettings {
    /// 40 rad/s2 is 2 m/s2 at the rim of a wheel of 50 mm. What is promised of a body is 2 m/s2: a fifth more is asked for, since
    /// a robot that drags its wheels over the floor in a turn follows them late.
    fn default() -> Self {
        Self {
            ramp_after_ms: 100,
            latch_after_ms: 500,
            ramp_rad_per_s2: 40.0,
            body_m_per_s2: 2.4,
        }
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum WatchdogState {
    Running,
    /// Ramping to zero or at zero, resumes by itself with the next set-point.
    Ramping,
    /// At zero or ramping there; needs `clear` or a new epoch.
    Latched,
}

/// What the wheels and the steering gear are to do now.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct SetPoint {
    pub wheel_rad_per_s: [f64; MAX_MOTORS],
    pub steering_rad: f64,
}

/// Pure state machine; times are a wrapping millisecond clock. A new watchdog is latched.
#[derive(Debug, Clone, Copy)]
pub struct Watchdog {
    settings: WatchdogSettings,
    state: WatchdogState,
    stopped: bool,
    enabled: bool,
    accepted_epoch: Option<u32>,
    accepted_ms: u32,
    stepped_ms: Option<u32>,
    ramp: Ramp,
}

impl Watchdog {
    /// Of a robot whose geometry is not known: while ramping all wheels keep their proportions.
    pub fn new(settings: WatchdogSettings) -> Self {
        Self {
            settings,
            state: WatchdogState::Latched,
            stopped: false,
            enabled: false,
            accepted_epoch: None,
            accepted_ms: 0,
            stepped_ms: None,
            ramp: Ramp::new(None),
        }
    }

    /// The same for a robot on these wheels; see [`crate::ramp`].
    #[must_use]
    pub fn with_wheels(mut self, wheels: WheelTable) -> Self {
        self.ramp = Ramp::new(Some(wheels));
        self
    }

    pub fn state(&self) -> WatchdogState {
        self.state
    }

    /// Latched by a `stop` flag.
    pub fn is_stopped(&self) -> bool {
        self.stopped
    }

    /// The last accepted command enabled motion.
    pub fn is_enabled(&self) -> bool {
        self.enabled
    }

    /// Feeds an accepted command: the first of an epoch or one with `clear` releases a latch, `stop` sets it.
    pub fn accept(&mut self, command: &Command, epoch: u32, now_ms: u32) {
        if command.clear || self.accepted_epoch != Some(epoch) {
            self.state = WatchdogState::Running;
            self.stopped = false;
        }
        if self.state == WatchdogState::Ramping {
            self.state = WatchdogState::Running;
        }
        self.accepted_epoch = Some(epoch);
        self.accepted_ms = now_ms;
        self.enabled = command.enable;
        if command.stop {
            self.stop(epoch);
        } else if command.enable && self.state == WatchdogState::Running {
            self.ramp.hold(&SetPoint {
                wheel_rad_per_s: command.wheel_rad_per_s,
                steering_rad: command.steering_rad,
            });
        }
    }

    /// Sets the set-point of a robot that closes its own loop, while its last target may move it.
    pub fn hold(&mut self, set_point: &SetPoint) {
        if self.state == WatchdogState::Running && self.enabled {
            self.ramp.hold(set_point);
        }
    }

    /// Ramps down and latches. Unlike motion, a stop needs no fresh command.
    pub fn stop(&mut self, epoch: u32) {
        self.state = WatchdogState::Latched;
        self.stopped = true;
        self.accepted_epoch = Some(epoch);
    }

    /// Set-point for now. The steering angle is held while the wheels ramp, so the robot stays on its arc.
    ///
    /// The ramp is exact in time: a step that comes late takes off what the time since the limit amounts to.
    pub fn step(&mut self, now_ms: u32) -> SetPoint {
        let since_step_ms = self.stepped_ms.map_or(0, |before_ms| elapsed_ms(before_ms, now_ms));
        self.stepped_ms = Some(now_ms);
        let silence_ms = elapsed_ms(self.accepted_ms, now_ms);
        let mut closing_ms = since_step_ms;
        if self.state != WatchdogState::Latched {
            if silence_ms > self.settings.ramp_after_ms {
                self.state = WatchdogState::Ramping;
                closing_ms = since_step_ms.min(silence_ms - self.settings.ramp_after_ms);
            }
            if silence_ms >= self.settings.latch_after_ms {
                self.state = WatchdogState::Latched;
            }
        }
        if self.state == WatchdogState::Running && self.enabled {
            self.ramp.rise(&self.settings, since_step_ms);
        } else {
            self.ramp.fall(&self.settings, closing_ms);
        }
        self.ramp.set_point()
    }
}

/// Time from one reading of a wrapping clock to a later one; 0 if the readings are in the other order.
fn elapsed_ms(from_ms: u32, to_ms: u32) -> u32 {
    u32::try_from(to_ms.wrapping_sub(from_ms).cast_signed()).unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;

    const SPEED: f64 = 10.0;

    fn drive(speed: f64) -> Command {
        Command {
            enable: true,
            wheel_rad_per_s: [speed, -speed, speed / 2.0, 0.0],
            ..Command::default()
        }
    }

    /// Steps from just after `from_ms` to `to_ms`, returns the last speed of wheel 0.
    fn run(watchdog: &mut Watchdog, from_ms: u32, to_ms: u32) -> f64 {
        let mut speed = f64::NAN;
        let mut now_ms = from_ms;
        while now_ms != to_ms {
            now_ms = now_ms.wrapping_add(1);
            speed = watchdog.step(now_ms).wheel_rad_per_s[0];
        }
        speed
    }

    fn running(start_ms: u32) -> Watchdog {
        let mut watchdog = Watchdog::new(WatchdogSettings::default());
        watchdog.step(start_ms.wrapping_sub(1000));
        watchdog.accept(&drive(SPEED), 1, start_ms.wrapping_sub(1000));
        for back_ms in (0..1000).rev() {
            watchdog.accept(&drive(SPEED), 1, start_ms.wrapping_sub(back_ms));
            watchdog.step(start_ms.wrapping_sub(back_ms));
        }
        assert_eq!(watchdog.step(start_ms).wheel_rad_per_s[0], SPEED);
        watchdog
    }

    #[test]
    fn starts_latched_and_still() {
        let mut watchdog = Watchdog::new(WatchdogSettings::default());
        assert_eq!(watchdog.state(), WatchdogState::Latched);
        assert_eq!(run(&mut watchdog, 0, 1000), 0.0);
    }

    #[test]
    fn ramps_from_100_ms_and_latches_at_500_ms_across_the_wrap_of_the_clock() {
        for start_ms in [10_000, u32::MAX - 50, u32::MAX - 300, 0] {
            let mut watchdog = running(start_ms);
            let at = |ms: u32| start_ms.wrapping_add(ms);
            assert_eq!(run(&mut watchdog, at(0), at(100)), SPEED);
            assert_eq!(watchdog.state(), WatchdogState::Running);
            let slower = run(&mut watchdog, at(100), at(101));
            assert!((slower - (SPEED - 0.040)).abs() < 1e-9, "{slower}");
            assert_eq!(watchdog.state(), WatchdogState::Ramping);
            assert!(run(&mut watchdog, at(101), at(349)) > 0.0);
            assert!(run(&mut watchdog, at(349), at(351)) < 1e-9);
            run(&mut watchdog, at(351), at(499));
            assert_eq!(watchdog.state(), WatchdogState::Ramping);
            run(&mut watchdog, at(499), at(500));
            assert_eq!(watchdog.state(), WatchdogState::Latched);
        }
    }

    #[test]
    fn the_ramp_does_not_depend_on_how_often_it_is_stepped() {
        let (mut often, mut seldom) = (running(1000), running(1000));
        assert!((run(&mut often, 1000, 1237) - seldom.step(1237).wheel_rad_per_s[0]).abs() < 1e-9);
    }

    #[test]
    fn a_set_point_resumes_a_ramp_but_not_a_latch() {
        let mut watchdog = running(1000);
        run(&mut watchdog, 1000, 1200);
        watchdog.accept(&drive(SPEED), 1, 1200);
        assert_eq!(run(&mut watchdog, 1200, 1300), SPEED);
        run(&mut watchdog, 1300, 2000);
        assert_eq!(watchdog.state(), WatchdogState::Latched);
        watchdog.accept(&drive(SPEED), 1, 2000);
        assert_eq!(run(&mut watchdog, 2000, 2090), 0.0);
        watchdog.accept(
            &Command {
                clear: true,
                ..drive(SPEED)
            },
            1,
            2090,
        );
        assert!(run(&mut watchdog, 2090, 2190) > 0.0);
    }

    #[test]
    fn a_new_epoch_releases_a_latch() {
        let mut watchdog = running(1000);
        run(&mut watchdog, 1000, 2000);
        watchdog.accept(&drive(SPEED), 2, 2000);
        assert!(run(&mut watchdog, 2000, 2100) > 0.0);
    }

    #[test]
    fn stop_ramps_latches_and_wins_over_clear() {
        let mut watchdog = running(1000);
        watchdog.accept(
            &Command {
                stop: true,
                clear: true,
                ..drive(SPEED)
            },
            1,
            1000,
        );
        assert_eq!(watchdog.state(), WatchdogState::Latched);
        let ramping = run(&mut watchdog, 1000, 1100);
        assert!((ramping - 6.0).abs() < 1e-9, "{ramping}");
        for now_ms in 1100..1600 {
            watchdog.accept(&drive(SPEED), 1, now_ms);
            watchdog.step(now_ms);
        }
        assert_eq!(run(&mut watchdog, 1600, 1601), 0.0);
        assert!(watchdog.is_stopped());
    }

    #[test]
    fn a_stop_ahead_of_the_first_set_point_of_an_epoch_holds() {
        let mut watchdog = running(1000);
        watchdog.stop(2);
        watchdog.accept(&drive(SPEED), 2, 1001);
        assert_eq!(watchdog.state(), WatchdogState::Latched);
    }

    #[test]
    fn disabled_ramps_down_and_stays_awake() {
        let mut watchdog = running(1000);
        for now_ms in 1000..3000 {
            watchdog.accept(
                &Command {
                    enable: false,
                    ..drive(SPEED)
                },
                1,
                now_ms,
            );
            watchdog.step(now_ms);
        }
        assert_eq!(watchdog.state(), WatchdogState::Running);
        assert_eq!(run(&mut watchdog, 3000, 3001), 0.0);
    }
}
