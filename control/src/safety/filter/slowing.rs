//! Robots without a solution: they come to rest along their last commands, together where they have to do with each other.

use twin::twist::BodyTwist;

use super::SafetyFilter;
use crate::TICK_S;
use crate::safety::intervention::Cause;
use crate::safety::rows::NOBODY;
use crate::safety::{Limits, SafeCommand};

impl SafetyFilter {
    /// From now on an obstacle that comes to rest along a deceleration.
    pub(super) fn halt(&mut self, i: usize, cause: Cause) {
        self.places[i].movable = false;
        self.stops[i].get_or_insert(cause);
        self.slowing[i] = true;
    }

    /// How much of their commands the robots that slow down keep, and what the rows of the others count on.
    pub(super) fn slow_together(&mut self) {
        for row in &self.listing.rows[..self.listing.shared] {
            let [a, b] = row.robots.map(|robot| robot as usize);
            if row.robots[1] != NOBODY && self.slowing[a] && self.slowing[b] {
                self.together.join(a, b);
            }
        }
        for i in 0..self.chassis.len() {
            if self.slowing[i] {
                let group = self.together.of(i);
                self.kept[i] = self.kept_among(i, |k| self.slowing[k] && self.together.of(k) == group);
                self.expect_slower(i);
            }
        }
    }

    fn expect_slower(&mut self, i: usize) {
        let twist = self.slower(i).twist;
        self.numbers[i] = self.chassis[i].numbers(&twist);
        let curvature = if twist.forward_m_per_s == 0.0 {
            0.0
        } else {
            twist.yaw_rate_rad_per_s / twist.forward_m_per_s
        };
        let body = self.chassis[i].velocity(self.numbers[i], curvature);
        self.places[i].commanded = self.places[i].world_from_body(body);
    }

    /// Share of its last command that a robot keeps which slows down among others.
    ///
    /// It is the same for all as far as it can be, so that they come to rest together and the speed at which two of them
    /// approach shrinks with theirs: one that brakes harder than the one behind it would be run into. The fastest rim
    /// among them decelerates by the stopping deceleration, and every rim at least by the braking that the rows count on.
    pub(super) fn kept_among(&self, i: usize, belongs: impl Fn(usize) -> bool) -> f64 {
        let rim_m_per_s = |k: usize| {
            let last = self.filtered[k].command.twist;
            last.speed_m_per_s() + self.radii_m[k] * last.yaw_rate_rad_per_s.abs()
        };
        let kept = |deceleration_m_per_s2: f64, rim_m_per_s: f64| {
            let change = deceleration_m_per_s2 * TICK_S;
            if rim_m_per_s > change {
                1.0 - change / rim_m_per_s
            } else {
                0.0
            }
        };
        let others = (0..self.chassis.len()).filter(|k| belongs(*k));
        let fastest = others.map(rim_m_per_s).fold(0.0, f64::max);
        let Limits {
            stopping_m_per_s2,
            braking_m_per_s2,
            ..
        } = self.limits;
        kept(stopping_m_per_s2.max(braking_m_per_s2), fastest).min(kept(braking_m_per_s2, rim_m_per_s(i)))
    }

    /// The last command, as much of it as is kept.
    pub(super) fn slower(&self, i: usize) -> SafeCommand {
        let last = self.filtered[i].command.twist;
        let factor = self.kept[i];
        let twist = BodyTwist {
            forward_m_per_s: last.forward_m_per_s * factor,
            left_m_per_s: last.left_m_per_s * factor,
            yaw_rate_rad_per_s: last.yaw_rate_rad_per_s * factor,
        };
        // A fraction of wheel speeds within the limits is within the limits.
        let wheels = self.chassis[i]
            .robot()
            .wheel_speeds_holding(twist, self.steering_rad[i]);
        SafeCommand { twist, wheels }
    }
}
