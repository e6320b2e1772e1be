//! Virtual-physical interaction: a model of each robot corrects what the law asks for, so that the robot moves as an ideal
//! one would.
//!
//! ```text
//!            +-- virtual robot: ideal, horizon ahead <--- leash -----------+
//!            v                                                             |
//! Law -> ideal twist -> way ahead r_1 .. r_N -> Plan -> command -> limits, SafetyFilter -> SafeCommand
//!                                                 ^                                          |
//! RobotObservation -> pose now + dead time <- model robot <---- commands on their way -------+
//! ```
//! The law drives a [`VirtualRobot`] that does at once what it is told and is `N = horizon / T` ticks ahead of the command of now.
//! So what the law will ask for over the horizon is known, and the physical robot is to be on this way in time. A
//! [`ModelRobot`], of the robot's model version, is driven by what the safety filter let through and laid onto what was
//! measured: its state is that in which the command of this tick will take effect. A [`Plan`] chooses the command:
//!
//! ```text
//! min  sum_m |r_m^-1 x_m(c)|^2 + rho |d|^2,      c_j = lead(r)_j + d_j       x_m: poses that the model predicts
//!  d
//! ```
//! One Gauss-Newton step in every second tick of a robot, from the corrections before it; one column of the Jacobian is made anew
//! with it. Half of the robots are due in a tick, so the work of every tick is the same, and nothing is allocated.
//!
//! The correction stands before acceleration limit and safety filter, which stay as they are. It is bounded around what the law
//! asks for. On any doubt - model, pose or delay that cannot be believed, a filter that intervenes - the law sees
//! the robot itself again, and its own wish is passed on ([`crate::team`]).

mod hold;
mod model_robot;
mod plan;
#[cfg(test)]
mod tests;
mod virtual_robot;

use twin::pose::Pose;
use twin::robot::Robot;
use twin::twist::BodyTwist;

use crate::TICK_S;
use crate::answer::{Answer, turn_point_x_m};
use crate::law::{Drive, RobotObservation};
use crate::safety::{Intervention, SafeCommand};
use hold::Hold;
use model_robot::ModelRobot;
use plan::Plan;
use virtual_robot::VirtualRobot;

/// Shortest and longest horizon, s.
pub const HORIZONS_S: [f64; 2] = [0.1, 0.5];
/// Ticks of the longest.
const MOST_AHEAD: usize = 60;
/// A robot's corrections are made anew in one of so many ticks.
pub const TURNS: u64 = 2;
/// The virtual robot is pulled to the physical one over this time.
const LEASH_S: f64 = 2.0;
/// It is laid onto the physical one where they are further apart.
const LEASH_M: f64 = 0.15;
const LEASH_RAD: f64 = 0.6;

/// What an experiment says of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// How far ahead of the physical robot the virtual one is, s; within [`HORIZONS_S`].
    pub horizon_s: f64,
    /// What the model does not say of the robot's velocity is learnt during the run.
    pub learns_bias: bool,
}

impl Default for Settings {
    fn default() -> Settings {
        Settings {
            horizon_s: 0.3,
            learns_bias: true,
        }
    }
}

/// Correction for one robot. See the module.
#[derive(Debug)]
pub struct Interaction {
    model: ModelRobot,
    ideal: VirtualRobot,
    plan: Plan,
    hold: Hold,
    active: bool,
}

impl Interaction {
    /// - `model`: the robot as its model version has it; `drive`: of its description.
    pub fn new(model: &Robot, drive: Drive, settings: Settings) -> Interaction {
        let [least_s, most_s] = HORIZONS_S;
        let horizon_s = if settings.horizon_s.is_finite() {
            settings.horizon_s.clamp(least_s, most_s)
        } else {
            least_s
        };
        let ahead = ((horizon_s / TICK_S + 0.5) as usize).clamp(1, MOST_AHEAD);
        let point_x_m = match drive {
            Drive::Steered { axle_x_m, .. } => axle_x_m,
            Drive::TurnInPlace { .. } => turn_point_x_m(model),
            Drive::Holonomic => 0.0,
        };
        Interaction {
            model: ModelRobot::new(model, settings.learns_bias),
            ideal: VirtualRobot::new(point_x_m, ahead),
            plan: Plan::new(model, drive, point_x_m, ahead),
            hold: Hold::default(),
            active: false,
        }
    }

    /// Point of the body that does not slide sideways when the robot turns, ahead of the body origin, m.
    pub(crate) fn point_x_m(&self) -> f64 {
        self.ideal.point_x_m()
    }

    /// What the law is to see of the robot: the virtual robot, or nothing when the law's own wish is to be passed on.
    ///
    /// - `answer`: mean delay of link and robot as measured.
    pub fn observe(&mut self, seen: &RobotObservation, answer: Option<Answer>) -> Option<RobotObservation> {
        let believed = answer.is_some_and(|answer| self.model.see(seen, &answer));
        if !self.hold.allows(believed) {
            self.active = false;
            return None;
        }
        let here = self.model.pose();
        let told = self.model.told();
        if !self.active || self.ideal.is_apart(&here, LEASH_M, LEASH_RAD) {
            self.ideal.lay_along(&here, &told);
            self.plan.reset();
            self.active = true;
        }
        self.ideal.pull(&here, TICK_S / LEASH_S);
        let newest = self.ideal.newest();
        Some(RobotObservation {
            pose: newest.pose,
            pose_age_s: -self.ideal.ahead_s(),
            twist: self.ideal.slid(&newest.twist),
            online: seen.online,
        })
    }

    /// The command for what the law wants of the virtual robot; nothing when the law's own wish is to be passed on.
    ///
    /// - `turn`: corrections are made anew; otherwise those of the tick before hold. Robots take turns.
    pub fn command(&mut self, wanted: &BodyTwist, turn: bool) -> Option<BodyTwist> {
        if !self.active {
            return None;
        }
        self.ideal.step(wanted);
        let command = self.plan.command(&self.model, &self.ideal, turn);
        if command.is_none() {
            self.doubt();
        }
        command
    }

    /// What the safety filter made of it is on its way.
    pub fn sent(&mut self, command: &SafeCommand, intervention: Option<&Intervention>) {
        self.model.follow(command);
        self.hold.note(intervention);
    }

    /// The law's own wish is passed on for a while.
    pub fn doubt(&mut self) {
        self.hold.doubt();
        self.active = false;
    }

    /// The law drives the virtual robot.
    pub fn is_active(&self) -> bool {
        self.active
    }

    /// Where the physical robot should be when the command of this tick takes effect, and where it is expected then.
    pub fn expected(&self) -> Option<[Pose; 2]> {
        self.active.then(|| [self.ideal.now().pose, self.model.pose()])
    }

    /// Lets the model's state be this.
    #[cfg(test)]
    fn spoil(&mut self, value: f64) {
        self.model.spoil(value);
    }
}
