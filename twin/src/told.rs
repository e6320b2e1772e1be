//! What the speed loops were told at a start, and shortly before.

use crate::command::WheelCommand;

/// Set-points of the wheels.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Told {
    pub(crate) now: WheelCommand,
    /// [`Told::ANSWERED_STEPS`] before, when a loop that has answered was told.
    pub(crate) before: WheelCommand,
}

impl Told {
    /// Physics steps after which a loop has answered a set-point (29 ms).
    pub(crate) const ANSWERED_STEPS: u64 = 14;

    /// By how much a wheel that turns at a speed is behind, rad/s: the smaller one of now and before, since a loop that has just been told
    /// something else has not answered yet; 0 when they differ in sign.
    pub(crate) fn error_rad_per_s(&self, wheel: usize, speed_rad_per_s: f64) -> f64 {
        let [now, before] = [&self.now, &self.before].map(|told| told.wheel_rad_per_s[wheel] - speed_rad_per_s);
        if now * before <= 0.0 {
            0.0
        } else if now.abs() < before.abs() {
            now
        } else {
            before
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_smaller_error_counts() {
        let command = |rad_per_s: f64| {
            let mut command = WheelCommand::default();
            command.wheel_rad_per_s[0] = rad_per_s;
            command
        };
        let told = |now: f64, before: f64| Told {
            now: command(now),
            before: command(before),
        };
        let ramp = told(10.0, 9.3);
        assert!((ramp.error_rad_per_s(0, 8.0) - 1.3).abs() < 1e-12);
        assert_eq!(ramp.error_rad_per_s(0, 9.6), 0.0, "between the two");
        assert_eq!(told(6.0, 2.0).error_rad_per_s(0, 2.0), 0.0, "told to jump just now");
        assert_eq!(told(-6.0, -6.0).error_rad_per_s(0, -5.5), -0.5);
    }
}
