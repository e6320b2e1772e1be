//! What a robot did since it last heard the laboratory.

use emulator::unit::Unit;
use robot::watchdog::WatchdogState;

/// What a robot did since it last took a command, at the firmware's rate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StopWatch {
    /// Arrival of the last frame in order.
    pub heard_us: i64,
    /// First step at which the watchdog was seen to ramp, and to be latched, since then.
    pub ramping_us: Option<i64>,
    pub latched_us: Option<i64>,
    /// Way since then, and the fastest it was.
    pub travelled_m: f64,
    pub fastest_m_per_s: f64,
    at_m: [f64; 2],
}

impl StopWatch {
    pub(super) const fn new(now_us: i64) -> Self {
        Self {
            heard_us: now_us,
            ramping_us: None,
            latched_us: None,
            travelled_m: 0.0,
            fastest_m_per_s: 0.0,
            at_m: [0.0; 2],
        }
    }

    /// From zero again: a frame came.
    pub(super) const fn heard(&self, now_us: i64) -> Self {
        Self {
            at_m: self.at_m,
            ..Self::new(now_us)
        }
    }

    /// A step of the firmware later.
    pub(super) fn step(&mut self, unit: &Unit, now_us: i64) {
        let Some(body) = unit.on_floor() else { return };
        match unit.firmware().watchdog().state() {
            WatchdogState::Running => {}
            WatchdogState::Ramping => _ = self.ramping_us.get_or_insert(now_us),
            WatchdogState::Latched => _ = self.latched_us.get_or_insert(now_us),
        }
        let pose = body.pose();
        let [x_m, y_m] = self.at_m;
        let [vx, vy] = body.velocity_m_per_s();
        self.travelled_m += (pose.x_m - x_m).hypot(pose.y_m - y_m);
        self.fastest_m_per_s = self.fastest_m_per_s.max(vx.hypot(vy));
        self.at_m = [pose.x_m, pose.y_m];
    }
}
