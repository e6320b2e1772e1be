//! How long a robot takes to do what it is told, as the laboratory sees it: what the safety filter must allow for.
//!
//! ```text
//! link    = age of the command in force when telemetry was sampled, bound of the clock included; rises fast, falls slowly
//! answer  = 0.10 s, 0.23 s for robots that turn by skidding
//! moving  = sum e g / sum g g,  e = commanded - seen velocity, g = change of the commanded one, both smoothed alike:
//!           a robot that is T late is behind by T g
//! latency = the largest of 0.18 s, link + answer, moving; the last at most 0.40 s
//! ```
//! The age of the pose is not part of it: the filter adds that itself.
//!
//! What laws are told of (`answer`) is the mean, not a bound: sums e g and sum g g as above, of driving and of turning apart,
//! pulled to the link's delay and the answer that the robot's description has; no floor, at most 0.40 s.

use crate::record::Telemetry;
use control::answer::Answer;
use std::collections::VecDeque;

/// Never less than what the filter assumes before anything is measured.
const LEAST_S: f64 = 0.18;
/// The answer as seen counts up to this; a link that is slower than the filter can answer for stops its robot.
const LONGEST_MOVING_S: f64 = control::answer::LONGEST_ANSWER_S;
/// Share of a difference that a longer, and a shorter, link delay is followed by at each telemetry.
const RISE: f64 = 0.05;
const FALL: f64 = 0.002;
/// An older command in force is a gap of the link: nothing is learnt of the robot meanwhile.
const GAP_US: i64 = 80_000;
const WIDEST_BOUND_US: i64 = 50_000;
/// Commands that are remembered: half a second.
const REMEMBERED: usize = 64;
const SMOOTHING_S: f64 = 0.2;
const FORGETTING_S: f64 = 20.0;
/// Weight of the answer that is assumed, as the sum of g g that outweighs it: about one start of the robot.
const ASSUMED: [f64; 2] = [0.2, 2.0];
/// Steps longer than this are not integrated.
const LONGEST_STEP_S: f64 = 0.1;

/// Velocity along x, y and round, body frame.
type Twist = [f64; 3];

#[derive(Debug, Clone, Copy)]
struct Sent {
    sequence: u32,
    at_us: i64,
    smooth: Twist,
    change: Twist,
}

/// Delay of one robot; see the module.
#[derive(Debug, Clone)]
pub struct DelayMeter {
    answer_s: f64,
    nominal: Answer,
    link_s: f64,
    sent: VecDeque<Sent>,
    applied_age_us: i64,
    seen_us: Option<i64>,
    seen: Twist,
    /// Of driving and of turning: sum of e g, sum of g g.
    sums: [[f64; 2]; 2],
}

impl DelayMeter {
    /// - `answer_s`: what the chassis is assumed to take.
    /// - `nominal`: what the robot's description says that it takes.
    pub fn new(answer_s: f64, nominal: Answer) -> Self {
        Self {
            answer_s,
            nominal,
            link_s: 0.0,
            sent: VecDeque::with_capacity(REMEMBERED),
            applied_age_us: i64::MAX,
            seen_us: None,
            seen: [0.0; 3],
            sums: [[0.0; 2]; 2],
        }
    }

    /// A command has gone out.
    pub fn sent(&mut self, sequence: u32, at_us: i64, twist: Twist) {
        let before = self.sent.back().copied().unwrap_or(Sent {
            sequence,
            at_us,
            smooth: [0.0; 3],
            change: [0.0; 3],
        });
        let step_s = ((at_us - before.at_us) as f64 * 1e-6).clamp(0.0, LONGEST_STEP_S);
        let smooth = smoothed(before.smooth, twist, step_s);
        if self.sent.len() == REMEMBERED {
            self.sent.pop_front();
        }
        self.sent.push_back(Sent {
            sequence,
            at_us,
            smooth,
            change: std::array::from_fn(|k| (twist[k] - smooth[k]) / SMOOTHING_S),
        });
    }

    /// Telemetry has come.
    pub fn heard(&mut self, telemetry: &Telemetry) {
        let applied = self
            .sent
            .iter()
            .find(|sent| sent.sequence == telemetry.applied_sequence);
        let Some(applied) = applied else { return };
        if telemetry.sample_bound_us > WIDEST_BOUND_US {
            // The robot's clock is not known yet.
            return;
        }
        let age_us = telemetry.sample_us - applied.at_us + telemetry.sample_bound_us;
        self.applied_age_us = age_us;
        let more_s = age_us.max(0) as f64 * 1e-6 - self.link_s;
        self.link_s += more_s * if more_s > 0.0 { RISE } else { FALL };
    }

    /// The robot was seen to move.
    ///
    /// - `exposure_us`: when; `twist`: how, body frame.
    pub fn seen(&mut self, exposure_us: i64, twist: Twist) {
        if twist.iter().any(|part| !part.is_finite()) {
            return;
        }
        let step_s = self
            .seen_us
            .map_or(0.0, |before_us| (exposure_us - before_us) as f64 * 1e-6);
        if step_s < 0.0 {
            return;
        }
        self.seen_us = Some(exposure_us);
        if step_s > LONGEST_STEP_S || self.applied_age_us > GAP_US {
            // Too little is known of the time between: both start from here.
            self.seen = self.told(exposure_us).map_or(twist, |told| told.smooth);
            return;
        }
        self.seen = smoothed(self.seen, twist, step_s);
        let Some(told) = self.told(exposure_us) else { return };
        let behind = |k: usize| told.smooth[k] - self.seen[k];
        let keep = 1.0 - step_s / FORGETTING_S;
        for (sums, axes) in self.sums.iter_mut().zip([[0, 1].as_slice(), &[2]]) {
            let mut products = [0.0; 2];
            for &k in axes {
                products[0] += behind(k) * told.change[k];
                products[1] += told.change[k] * told.change[k];
            }
            for (sum, product) in sums.iter_mut().zip(products) {
                *sum = keep * *sum + step_s * product;
            }
        }
    }

    /// Delay to be told to the filter, s.
    pub fn latency_s(&self) -> f64 {
        let assumed_s = LEAST_S;
        let late = |([eg, gg], weight): ([f64; 2], f64)| (eg + assumed_s * weight) / (gg + weight);
        let moving_s = self.sums.into_iter().zip(ASSUMED).map(late).fold(0.0, f64::max);
        LEAST_S
            .max(self.link_s + self.answer_s)
            .max(moving_s.min(LONGEST_MOVING_S))
    }

    /// From sending to motion as it is in the mean, s: what laws look ahead by.
    pub fn answer(&self) -> Answer {
        let mean_s = |[eg, gg]: [f64; 2], weight: f64, nominal_s: f64| {
            let assumed_s = self.link_s + nominal_s;
            ((eg + assumed_s * weight) / (gg + weight)).clamp(0.0, LONGEST_MOVING_S)
        };
        let ([driving, turning], [driving_weight, turning_weight]) = (self.sums, ASSUMED);
        Answer {
            driving_s: mean_s(driving, driving_weight, self.nominal.driving_s),
            turning_s: mean_s(turning, turning_weight, self.nominal.turning_s),
        }
    }

    /// Of the link alone, s.
    pub fn link_s(&self) -> f64 {
        self.link_s
    }

    /// The newest command at a moment.
    fn told(&self, at_us: i64) -> Option<Sent> {
        self.sent.iter().rev().find(|sent| sent.at_us <= at_us).copied()
    }
}

fn smoothed(before: Twist, now: Twist, step_s: f64) -> Twist {
    let share = step_s / (SMOOTHING_S + step_s);
    std::array::from_fn(|k| before[k] + share * (now[k] - before[k]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use control::answer::{ROLLING_ANSWER_S, SKIDDING_ANSWER_S};

    const TICK_US: i64 = 8333;

    fn telemetry(sequence: u32, sample_us: i64) -> Telemetry {
        Telemetry {
            robot: 1,
            arrival_us: sample_us,
            sample_us,
            sample_bound_us: 0,
            robot_clock_ms: 0,
            status: 0,
            applied_sequence: sequence,
            wheel_rad_per_s: [0.0; crate::record::LINK_WHEELS],
            wheel_rad: [0.0; crate::record::LINK_WHEELS],
            current_a: [0.0; crate::record::LINK_WHEELS],
            bus_v: 12.0,
            gyro_z_rad_per_s: 0.0,
            accel_m_per_s2: [0.0; 2],
            steering_rad: 0.0,
        }
    }

    /// A robot that does exactly what it was told, so and so late; commands go up and down.
    fn measured(late_ticks: i64, link_ticks: i64, answer_s: f64) -> DelayMeter {
        let nominal = Answer {
            driving_s: answer_s,
            turning_s: answer_s,
        };
        let mut meter = DelayMeter::new(answer_s, nominal);
        let told = |tick: i64| {
            let speed = 0.4 * (tick as f64 / 60.0).sin();
            [speed, 0.0, 2.0 * speed]
        };
        for tick in 0..3000 {
            let now_us = tick * TICK_US;
            meter.sent(tick as u32, now_us, told(tick));
            if tick > 40 {
                meter.heard(&telemetry((tick - link_ticks) as u32, now_us));
                // A picture two ticks old.
                meter.seen(now_us - 2 * TICK_US, told(tick - 2 - late_ticks));
            }
        }
        meter
    }

    #[test]
    fn the_delay_of_a_late_robot_is_found() {
        for late_ticks in [24, 30, 42] {
            let truth_s = late_ticks as f64 / 120.0;
            let found_s = measured(late_ticks, 1, ROLLING_ANSWER_S).latency_s();
            assert!(
                (found_s - truth_s).abs() < 0.1 * truth_s,
                "{truth_s} s, found {found_s} s"
            );
        }
    }

    #[test]
    fn the_mean_that_laws_look_ahead_by_has_no_floor() {
        for late_ticks in [2, 8, 18, 30] {
            let truth_s = late_ticks as f64 / 120.0;
            let Answer { driving_s, turning_s } = measured(late_ticks, 1, ROLLING_ANSWER_S).answer();
            let assumed_s = ROLLING_ANSWER_S + 1.0 / 120.0;
            for found_s in [driving_s, turning_s] {
                // Pulled to what is assumed by the weight of that: one start against those of 20 s.
                let bound_s = 0.15 * (truth_s - assumed_s).abs() + 0.005;
                assert!((found_s - truth_s).abs() < bound_s, "{truth_s} s, found {found_s} s");
            }
        }
        assert!(measured(200, 1, ROLLING_ANSWER_S).answer().driving_s <= LONGEST_MOVING_S);
        // Before anything was measured: link and description.
        let nominal = Answer {
            driving_s: 0.07,
            turning_s: 0.2,
        };
        assert_eq!(DelayMeter::new(0.1, nominal).answer(), nominal);
    }

    #[test]
    fn never_below_the_floor_and_the_answer_as_seen_is_bounded() {
        assert!((measured(3, 1, ROLLING_ANSWER_S).latency_s() - LEAST_S).abs() < 1e-12);
        assert!(measured(200, 1, ROLLING_ANSWER_S).latency_s() <= LONGEST_MOVING_S);
        let meter = measured(3, 1, SKIDDING_ANSWER_S);
        assert!((meter.latency_s() - (SKIDDING_ANSWER_S + meter.link_s())).abs() < 1e-12);
    }

    #[test]
    fn the_link_is_measured_from_the_command_in_force() {
        let link_s = measured(10, 6, ROLLING_ANSWER_S).link_s();
        assert!((link_s - 6.0 / 120.0).abs() < 1e-3, "{link_s}");
    }
}
