//! How a held set-point goes to zero, and comes back.
//!
//! ```text
//! W = (W_held - W_turning) g + W_turning h,    0 <= g, h <= 1
//! falling  g' = -max(f, min(s / |v|, 2 a / max |W_held - W_turning|)),    h' = -min(|g'|, max(f, a / max |W_turning|))
//! rising   g' = h' = f' = a / max (|W_held - W_turning| + |W_turning|),    f = a / max |W_held|
//! ```
//! `v` is the body's velocity under the held set-point, `W_turning` what of the wheels' speeds turns the body. One share for
//! all wheels would let the fastest of them brake at `a` and a body that turns while it drives at far less: its way grows by
//! half. So the body has a deceleration `s` of its own. Turning goes in the same proportion, which keeps the robot on its arc,
//! unless that asks more than `a` of a wheel; then it turns on for longer on a shorter way. Robots that steer keep their
//! arc by the steering angle.

use crate::MAX_MOTORS;
use crate::kinematics::{Twist, WheelTable};
use crate::watchdog::{SetPoint, WatchdogSettings};

/// Speeds below this (rad/s, m/s) count as this: what stands is at zero at once.
const STILL: f64 = 1e-6;

/// A held set-point and how much of it is passed on.
#[derive(Debug, Clone, Copy)]
pub struct Ramp {
    wheels: Option<WheelTable>,
    held: SetPoint,
    /// What of the held wheel speeds turns the body.
    turning_rad_per_s: [f64; MAX_MOTORS],
    /// Of the body under the held set-point; infinite where the geometry is not known.
    body_m_per_s: f64,
    driving: f64,
    turning: f64,
}

impl Ramp {
    /// At zero.
    ///
    /// - `wheels`: without them all wheels ramp in proportion, the fastest at [`WatchdogSettings::ramp_rad_per_s2`].
    pub fn new(wheels: Option<WheelTable>) -> Self {
        Self {
            wheels,
            held: SetPoint::default(),
            turning_rad_per_s: [0.0; MAX_MOTORS],
            body_m_per_s: f64::INFINITY,
            driving: 0.0,
            turning: 0.0,
        }
    }

    /// Takes another set-point; as much of it is passed on as of the one before.
    pub fn hold(&mut self, set_point: &SetPoint) {
        self.held = *set_point;
        let Some(wheels) = &self.wheels else { return };
        let twist = wheels.twist(&set_point.wheel_rad_per_s, set_point.steering_rad);
        self.body_m_per_s = twist.speed_m_per_s();
        if !wheels.is_steered() {
            let turning = Twist {
                yaw_rate_rad_per_s: twist.yaw_rate_rad_per_s,
                ..Twist::default()
            };
            self.turning_rad_per_s = wheels.set_point(&turning, 0.0).wheel_rad_per_s;
        }
    }

    /// Towards the held set-point for a time.
    pub fn rise(&mut self, settings: &WatchdogSettings, ms: u32) {
        let parts = self.driving_rad_per_s();
        let sums = core::array::from_fn(|k| parts[k].abs() + self.turning_rad_per_s[k].abs());
        let share = settings.ramp_rad_per_s2 / fastest(&sums) / 1000.0 * f64::from(ms);
        self.driving = (self.driving + share).min(1.0);
        self.turning = (self.turning + share).min(1.0);
    }

    /// Towards zero for a time.
    pub fn fall(&mut self, settings: &WatchdogSettings, ms: u32) {
        let ramp = settings.ramp_rad_per_s2;
        let together_per_s = ramp / fastest(&self.held.wheel_rad_per_s);
        let body_per_s = settings.body_m_per_s2 / self.body_m_per_s.max(STILL);
        // Wheels that work against each other move no body, yet must not be stopped in no time.
        let driving_per_s = body_per_s
            .min(2.0 * ramp / fastest(&self.driving_rad_per_s()))
            .max(together_per_s);
        let turning_per_s = (ramp / fastest(&self.turning_rad_per_s))
            .max(together_per_s)
            .min(driving_per_s);
        let ms = f64::from(ms);
        self.driving = (self.driving - driving_per_s / 1000.0 * ms).max(0.0);
        self.turning = (self.turning - turning_per_s / 1000.0 * ms).max(0.0);
    }

    /// What is passed on. The steering angle is held.
    pub fn set_point(&self) -> SetPoint {
        let parts = self.driving_rad_per_s();
        let wheel_rad_per_s = if self.driving == self.turning {
            self.held.wheel_rad_per_s.map(|speed| speed * self.driving)
        } else {
            core::array::from_fn(|k| parts[k] * self.driving + self.turning_rad_per_s[k] * self.turning)
        };
        SetPoint {
            wheel_rad_per_s,
            ..self.held
        }
    }

    fn driving_rad_per_s(&self) -> [f64; MAX_MOTORS] {
        core::array::from_fn(|k| self.held.wheel_rad_per_s[k] - self.turning_rad_per_s[k])
    }
}

fn fastest(rad_per_s: &[f64; MAX_MOTORS]) -> f64 {
    rad_per_s
        .iter()
        .fold(STILL, |fastest: f64, speed| fastest.max(speed.abs()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kinematics::{Wheel, WheelKind};

    const RADIUS_M: f64 = 0.05;
    const HALF_TRACK_M: f64 = 0.15;

    fn settings() -> WatchdogSettings {
        WatchdogSettings::default()
    }

    fn wheel(x_m: f64, y_m: f64) -> Wheel {
        Wheel {
            kind: WheelKind::Standard,
            x_m,
            y_m,
            rolling_direction_rad: 0.0,
            radius_m: RADIUS_M,
            driven: true,
            steered: false,
        }
    }

    /// Two wheels, held at a speed and a yaw rate.
    fn held(m_per_s: f64, rad_per_s: f64) -> (Ramp, WheelTable) {
        let table = WheelTable::new(&[wheel(0.0, HALF_TRACK_M), wheel(0.0, -HALF_TRACK_M)], 0.0).expect("two wheels");
        let twist = Twist {
            forward_m_per_s: m_per_s,
            left_m_per_s: 0.0,
            yaw_rate_rad_per_s: rad_per_s,
        };
        let mut ramp = Ramp::new(Some(table));
        ramp.hold(&table.set_point(&twist, 0.0));
        ramp.rise(&settings(), 10_000);
        (ramp, table)
    }

    /// Speed, yaw rate and the largest change of a wheel's speed of each millisecond until rest.
    fn falling(m_per_s: f64, rad_per_s: f64) -> Vec<[f64; 3]> {
        let (mut ramp, table) = held(m_per_s, rad_per_s);
        let mut before = ramp.set_point().wheel_rad_per_s;
        (0..2000)
            .map(|_| {
                ramp.fall(&settings(), 1);
                let now = ramp.set_point().wheel_rad_per_s;
                let change = (0..MAX_MOTORS).fold(0.0, |most: f64, k| most.max((now[k] - before[k]).abs()));
                before = now;
                let twist = table.twist(&now, 0.0);
                [twist.forward_m_per_s, twist.yaw_rate_rad_per_s, 1e3 * change]
            })
            .collect()
    }

    extern crate std;
    use std::vec::Vec;

    #[test]
    fn the_body_stops_on_the_same_way_whether_it_turns_or_not() {
        for (m_per_s, rad_per_s) in [(0.8, 0.0), (0.8, 1.0), (0.5, -3.0), (-0.3, 3.0), (0.1, 3.0)] {
            let way_m: f64 = falling(m_per_s, rad_per_s).iter().map(|[v, ..]| v.abs() * 1e-3).sum();
            let promised_m = m_per_s * m_per_s / (2.0 * 2.4);
            assert!(
                (way_m - promised_m).abs() < 1e-3 * m_per_s.abs(),
                "{m_per_s} {rad_per_s}: {way_m}"
            );
        }
    }

    #[test]
    fn the_arc_is_kept_or_becomes_tighter_and_no_wheel_brakes_at_more_than_both_parts() {
        // 2.4 m/s2 of the body at a wheel of 50 mm, and 40 rad/s2.
        let most = 2.4 / RADIUS_M + 40.0;
        for (m_per_s, rad_per_s) in [(0.8, 1.0), (0.5, -3.0), (-0.3, 3.0), (0.1, 3.0)] {
            for [v, r, change] in falling(m_per_s, rad_per_s) {
                assert!(change <= most + 1e-6, "{change}");
                assert!(r * rad_per_s >= -1e-9 && v * m_per_s >= -1e-9);
                // Curvature r / v never below the held one.
                assert!((r * m_per_s).abs() >= (rad_per_s * v).abs() - 1e-9, "{v} {r}");
            }
        }
        // Slow turning, so in proportion all the way: 0.15 rad/s is 0.0225 m/s of the rim.
        for [v, r, _] in falling(0.6, 0.15) {
            assert!((r - 0.25 * v).abs() < 1e-9, "{v} {r}");
        }
    }

    #[test]
    fn turning_on_the_spot_ends_at_the_wheels_own_rate() {
        let turned: f64 = falling(0.0, 3.0).iter().map(|[_, r, _]| r * 1e-3).sum();
        // 3 rad/s is 9 rad/s of a wheel: over after 0.225 s.
        assert!((turned - 0.5 * 3.0 * 0.225).abs() < 2e-3, "{turned}");
    }

    #[test]
    fn without_geometry_and_for_wheels_that_work_against_each_other_nothing_jumps() {
        let against = SetPoint {
            wheel_rad_per_s: [10.0, -10.0, 10.0, -10.0],
            steering_rad: 0.0,
        };
        let four = [(0.1, 0.1), (0.1, -0.1), (-0.1, -0.1), (-0.1, 0.1)].map(|(x, y)| wheel(x, y));
        for (table, most) in [(None, 0.04), (WheelTable::new(&four, 0.0).ok(), 0.08)] {
            let mut ramp = Ramp::new(table);
            ramp.hold(&against);
            ramp.rise(&settings(), 10_000);
            assert_eq!(ramp.set_point(), against);
            ramp.fall(&settings(), 1);
            let first = ramp.set_point().wheel_rad_per_s[0];
            assert!((first - (10.0 - most)).abs() < 1e-9, "{first}");
        }
    }

    #[test]
    fn what_comes_back_rises_at_the_wheels_own_rate() {
        let (mut ramp, _) = held(0.4, 2.0);
        let whole = ramp.set_point();
        ramp.fall(&settings(), 120);
        for _ in 0..2000 {
            let before = ramp.set_point().wheel_rad_per_s;
            ramp.rise(&settings(), 1);
            let now = ramp.set_point().wheel_rad_per_s;
            assert!(
                now.iter()
                    .zip(before)
                    .all(|(now, before)| (now - before).abs() <= 0.04 + 1e-9)
            );
        }
        assert_eq!(ramp.set_point(), whole);
    }
}
