//! How much of the yaw rate that it is told a robot turns: wheels that are dragged over the floor in a turn give a part of it.
//!
//! ```text
//! e = (w + sum told seen) / (w + sum told^2)      forgotten over 6 s of turning, 0.4 <= e <= 1.25
//! told for a wanted yaw rate r:  r / e
//! ```
//! `told` is what was sent the robot's mean delay before `seen`, after acceleration limit and safety filter: what they keep from a
//! robot does not count as its failing, so nothing winds up. What the robot does less than 15 % or more than 200 % of teaches
//! nothing: it is held, its link is cut, or the picture is wrong. Nor do commands that are too slow to be measured.

use twin::twist::BodyTwist;

use crate::TICK_S;

/// What it learns from is forgotten over this time.
const FORGETTING_S: f64 = 6.0;
/// Weight of 1, rad2/s: as much as a tenth of a second at 1 rad/s.
const ASSUMED: f64 = 0.1;
/// Slower commands teach nothing.
const LEAST_RAD_PER_S: f64 = 0.1;
/// Shares of a command outside of these teach nothing.
const TEACHING: [f64; 2] = [0.15, 2.0];
/// Bounds of the share.
pub const SHARES: [f64; 2] = [0.4, 1.25];

/// Of one robot; see the module.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Effectiveness {
    told_seen: f64,
    told_told: f64,
}

impl Effectiveness {
    /// Takes what a robot was told and how it was seen to turn then, rad/s; called once a tick. What is not finite teaches nothing.
    pub fn learn(&mut self, told_rad_per_s: f64, seen_rad_per_s: f64) {
        let (both, square) = (told_rad_per_s * seen_rad_per_s, told_rad_per_s * told_rad_per_s);
        let [least, most] = TEACHING;
        // False also of what is not a number.
        let teaches = (LEAST_RAD_PER_S..f64::INFINITY).contains(&told_rad_per_s.abs())
            && (least * square..=most * square).contains(&both);
        if teaches {
            let keep = 1.0 - TICK_S / FORGETTING_S;
            self.told_seen = keep * self.told_seen + TICK_S * both;
            self.told_told = keep * self.told_told + TICK_S * square;
        }
    }

    /// Share of the yaw rate that it is told which the robot turns; 1 before anything was learnt.
    pub fn share(&self) -> f64 {
        let [least, most] = SHARES;
        ((self.told_seen + ASSUMED) / (self.told_told + ASSUMED)).clamp(least, most)
    }

    /// What the robot does when it is told a twist.
    pub fn done(&self, told: &BodyTwist) -> BodyTwist {
        turning(told, self.share())
    }

    /// What to tell it for a wanted twist.
    pub fn command(&self, wanted: &BodyTwist) -> BodyTwist {
        turning(wanted, 1.0 / self.share())
    }
}

fn turning(twist: &BodyTwist, share: f64) -> BodyTwist {
    BodyTwist {
        yaw_rate_rad_per_s: share * twist.yaw_rate_rad_per_s,
        ..*twist
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Told a swinging yaw rate, does so much of it.
    fn taught(share: f64, seconds: f64) -> Effectiveness {
        let mut learnt = Effectiveness::default();
        for tick in 0..(seconds / TICK_S) as u32 {
            let told = 1.5 * libm::sin(0.02 * f64::from(tick));
            learnt.learn(told, share * told);
        }
        learnt
    }

    #[test]
    fn the_share_is_found_within_what_the_assumed_weight_leaves() {
        for share in [0.45, 0.7, 1.0, 1.2] {
            let found = taught(share, 40.0).share();
            // A mean square of 1.125 rad2/s2 over 6 s against 0.1 of the assumed 1.
            let left = 0.1 / (6.0 * 1.125 + 0.1);
            let asked = share + left * (1.0 - share);
            assert!(
                (found - asked).abs() < 0.08 * (1.0 - share).abs() + 1e-9,
                "{share}: {found}, {asked}"
            );
        }
    }

    #[test]
    fn the_share_is_bounded_and_what_is_no_turning_teaches_nothing() {
        assert_eq!(taught(0.2, 60.0).share(), SHARES[0]);
        assert_eq!(taught(1.9, 60.0).share(), SHARES[1]);
        let known = taught(0.6, 5.0);
        let mut held = known;
        let bad = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e300];
        // Held fast, turned the other way, torn round, slow, and no numbers at all.
        let pairs = [(2.0, 0.0), (2.0, -1.0), (1.0, 2.1), (0.05, 0.05)];
        for (told, seen) in pairs
            .into_iter()
            .chain(bad.map(|bad| (bad, 1.0)))
            .chain(bad.map(|bad| (1.0, bad)))
        {
            held.learn(told, seen);
        }
        assert_eq!(held, known);
    }

    #[test]
    fn what_is_told_makes_the_robot_do_what_is_wanted() {
        let learnt = taught(0.5, 10.0);
        let wanted = BodyTwist {
            forward_m_per_s: 0.3,
            left_m_per_s: -0.1,
            yaw_rate_rad_per_s: 0.8,
        };
        let done = learnt.done(&learnt.command(&wanted));
        assert!((done.yaw_rate_rad_per_s - 0.8).abs() < 1e-12);
        assert_eq!([done.forward_m_per_s, done.left_m_per_s], [0.3, -0.1]);
        assert_eq!(Effectiveness::default().command(&wanted), wanted);
    }
}
