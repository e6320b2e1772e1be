//! The twin driven over one span: from a remembered state, laid where the robot was seen, through the commands that were sent.

use super::draft::Ranges;
use super::law::{AXES, Law, Past};
use std::collections::VecDeque;
use twin::SUBSTEPS;
use twin::command::WheelCommand;
use twin::free::FreeRobot;
use twin::pose::{Pose, wrapped_rad};
use twin::robot::Robot;

/// Pushes by which the end is differentiated: m/s^2, m/s^2, rad/s^2.
const NUDGES: [f64; AXES] = [0.5, 0.5, 2.5];
/// Commands that are remembered: over two seconds at 120 Hz.
const COMMANDS_KEPT: usize = 256;

/// What was sent, by physics step, oldest first.
#[derive(Debug, Clone, Default)]
pub struct Commands(VecDeque<(i64, WheelCommand)>);

/// From where to where.
#[derive(Debug, Clone)]
pub struct Span {
    /// Some steps before the beginning, without the law's push.
    pub before: FreeRobot,
    /// Step of `before`.
    pub before_step: i64,
    pub begin: (i64, Pose),
    pub end_step: i64,
}

/// Where a drive ended.
#[derive(Debug, Clone, PartialEq)]
pub struct Driven {
    pub end: Pose,
    /// Means of the features over the span, faded.
    pub features: Vec<f64>,
}

/// The robot without the law, and the law.
#[derive(Debug, Clone, Copy)]
pub struct Body<'a> {
    pub robot: &'a Robot,
    pub law: &'a Law,
}

impl Commands {
    /// Takes what was sent at a step; an earlier step than the newest counts as the newest.
    pub fn push(&mut self, step: i64, command: WheelCommand) {
        let step = self.0.back().map_or(step, |(newest, _)| step.max(*newest));
        self.0.push_back((step, command));
        if self.0.len() > COMMANDS_KEPT {
            self.0.pop_front();
        }
    }

    /// In force at a step: the newest that is not later.
    pub fn at(&self, step: i64) -> WheelCommand {
        let after = self.0.partition_point(|(sent, _)| *sent <= step);
        let found = after.checked_sub(1).and_then(|place| self.0.get(place));
        found.map_or_else(WheelCommand::default, |(_, command)| *command)
    }
}

impl Body<'_> {
    /// One physics step with the law's push, evaluated at the beginning of each control tick.
    pub fn step(&self, free: &mut FreeRobot, command: &WheelCommand, weights: &[f64], past: &mut Past) {
        self.step_seeing(free, command, weights, [0.0; AXES], past, &mut |_| {});
    }

    fn step_seeing(
        &self,
        free: &mut FreeRobot,
        command: &WheelCommand,
        weights: &[f64],
        extra: [f64; AXES],
        past: &mut Past,
        hear: &mut dyn FnMut(&super::law::Seen),
    ) {
        if free.steps().is_multiple_of(u64::from(SUBSTEPS)) {
            let observation = self.robot.observation(&free.state(), command);
            let seen = self.law.see(&observation, past);
            let mut push = self.law.accelerations(weights, &seen);
            push.iter_mut().zip(extra).for_each(|(push, extra)| *push += extra);
            free.push(self.robot, push);
            hear(&seen);
        }
        free.step(command);
    }

    /// Drives over a span with these weights and a constant push beside them.
    ///
    /// - `ranges`: takes in what the inputs were, when given.
    pub fn drive(
        &self,
        span: &Span,
        commands: &Commands,
        weights: &[f64],
        extra: [f64; AXES],
        mut ranges: Option<&mut Ranges>,
    ) -> Driven {
        let mut free = span.before.clone();
        let mut past = Past::default();
        let mut features = vec![0.0; self.law.features()];
        let mut ticks: f64 = 0.0;
        for step in span.before_step..span.end_step {
            let begun = step >= span.begin.0;
            if step == span.begin.0 {
                free.lay(span.begin.1);
            }
            let push = if begun { extra } else { [0.0; AXES] };
            self.step_seeing(&mut free, &commands.at(step), weights, push, &mut past, &mut |seen| {
                if !begun {
                    return;
                }
                ticks += 1.0;
                for (sum, feature) in features.iter_mut().zip(&seen.features) {
                    *sum += seen.fade * feature;
                }
                if let Some(ranges) = ranges.as_deref_mut() {
                    ranges.take(seen);
                }
            });
        }
        features.iter_mut().for_each(|sum| *sum /= ticks.max(1.0));
        Driven {
            end: free.pose(),
            features,
        }
    }

    /// Change of the end, (x, y, yaw) by rows, per acceleration, by columns; finite differences around `driven`.
    pub fn sensitivity(&self, span: &Span, commands: &Commands, weights: &[f64], driven: &Driven) -> [[f64; AXES]; 3] {
        let mut rows = [[0.0; AXES]; 3];
        for axis in 0..AXES {
            let mut extra = [0.0; AXES];
            extra[axis] = NUDGES[axis];
            let nudged = self.drive(span, commands, weights, extra, None);
            let change = difference(&driven.end, &nudged.end);
            for (row, change) in rows.iter_mut().zip(change) {
                row[axis] = change / NUDGES[axis];
            }
        }
        rows
    }
}

/// From one pose to another: m, m, rad, in the world.
pub fn difference(from: &Pose, to: &Pose) -> [f64; 3] {
    [
        to.x_m - from.x_m,
        to.y_m - from.y_m,
        wrapped_rad(to.yaw_rad - from.yaw_rad),
    ]
}
