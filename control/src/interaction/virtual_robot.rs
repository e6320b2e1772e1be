//! The robot that the law drives: it does at once what it is told.

use twin::pose::Pose;
use twin::twist::BodyTwist;

use super::MOST_AHEAD;
use crate::TICK_S;
use crate::prediction::{Motion, after, between, is_possible, moved};
use crate::team::accelerated;
use crate::vector::{length, wrap};

/// A place on the way and the twist by which it was reached.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Point {
    pub(super) pose: Pose,
    pub(super) twist: BodyTwist,
}

/// Its way from now on: point 0 is where it should be when the command of this tick takes effect, point j is j ticks later.
#[derive(Debug, Clone)]
pub(super) struct VirtualRobot {
    /// The body slides sideways ahead of its fixed axle, or of the point about which it skids.
    point_x_m: f64,
    way: [Point; MOST_AHEAD + 1],
    ahead: usize,
}

impl VirtualRobot {
    /// - `point_x_m`: what does not slide sideways when the robot turns, ahead of the body origin.
    /// - `ahead`: ticks, at most [`MOST_AHEAD`].
    pub(super) fn new(point_x_m: f64, ahead: usize) -> VirtualRobot {
        VirtualRobot {
            point_x_m,
            way: [Point::default(); MOST_AHEAD + 1],
            ahead: ahead.clamp(1, MOST_AHEAD),
        }
    }

    pub(super) fn point_x_m(&self) -> f64 {
        self.point_x_m
    }

    pub(super) fn now(&self) -> &Point {
        &self.way[0]
    }

    /// Point so many ticks ahead, at most the newest.
    pub(super) fn at(&self, ticks: usize) -> &Point {
        &self.way[ticks.min(self.ahead)]
    }

    pub(super) fn newest(&self) -> Point {
        self.way[self.ahead]
    }

    pub(super) fn ahead(&self) -> usize {
        self.ahead
    }

    pub(super) fn ahead_s(&self) -> f64 {
        self.ahead as f64 * TICK_S
    }

    /// A robot at a pose that goes on as it does.
    pub(super) fn lay_along(&mut self, pose: &Pose, twist: &BodyTwist) {
        let twist = if is_possible(twist) {
            *twist
        } else {
            BodyTwist::default()
        };
        self.way[0] = Point { pose: *pose, twist };
        for j in 1..=self.ahead {
            self.way[j] = self.next(&self.way[j - 1], &twist);
        }
    }

    /// A tick on, told this: the oldest point goes, a new one comes.
    ///
    /// - What no robot can do counts as rest; otherwise the acceleration limits of commands hold.
    pub(super) fn step(&mut self, wanted: &BodyTwist) {
        let wanted = if is_possible(wanted) {
            *wanted
        } else {
            BodyTwist::default()
        };
        let newest = self.newest();
        let twist = accelerated(&newest.twist, &wanted);
        let next = self.next(&newest, &twist);
        self.way.copy_within(1..=self.ahead, 0);
        self.way[self.ahead] = next;
    }

    /// Moves the whole way by a share of what lies between its beginning and the physical robot.
    pub(super) fn pull(&mut self, physical: &Pose, share: f64) {
        let from = motion(&self.way[0].pose);
        let off = between(&from, &motion(physical));
        let part = Motion {
            at: [share * off.at[0], share * off.at[1]],
            yaw_rad: share * wrap(off.yaw_rad),
        };
        let begins = moved(&self.way[0].pose, &part);
        for point in &mut self.way[..=self.ahead] {
            point.pose = moved(&begins, &between(&from, &motion(&point.pose)));
        }
    }

    /// True also of what is not a number.
    pub(super) fn is_apart(&self, physical: &Pose, farthest_m: f64, farthest_rad: f64) -> bool {
        let off = between(&motion(&self.way[0].pose), &motion(physical));
        !(length(off.at) <= farthest_m && wrap(off.yaw_rad).abs() <= farthest_rad)
    }

    /// Twist of the body when it is told one.
    pub(super) fn slid(&self, told: &BodyTwist) -> BodyTwist {
        BodyTwist {
            left_m_per_s: told.left_m_per_s - self.point_x_m * told.yaw_rate_rad_per_s,
            ..*told
        }
    }

    fn next(&self, from: &Point, twist: &BodyTwist) -> Point {
        Point {
            pose: moved(&from.pose, &after(&Motion::default(), &self.slid(twist), TICK_S)),
            twist: *twist,
        }
    }
}

pub(super) fn motion(pose: &Pose) -> Motion {
    Motion {
        at: [pose.x_m, pose.y_m],
        yaw_rad: pose.yaw_rad,
    }
}
