//! The twin driven along a run, and the predictions that are under way.

use super::law::Past;
use super::span::{Body, Commands, Span};
use super::{HORIZON_STEPS, RUN_IN_STEPS, STRIDE_STEPS};
use std::collections::VecDeque;
use twin::free::FreeRobot;
use twin::pose::Pose;

/// A pose this much later than the one that was waited for begins or ends no prediction, physics steps.
const LATE_STEPS: i64 = 24;
/// Longest silence that the twin is driven through, physics steps: 1 s.
const SILENCE_STEPS: i64 = 480;

/// The parent and what is learnt driven along, laid where the robot is seen.
#[derive(Debug, Clone)]
pub struct Track {
    parent: (FreeRobot, Past),
    learnt: (FreeRobot, Past),
    origin: i64,
    open: VecDeque<Open>,
}

/// A prediction that has not ended.
#[derive(Debug, Clone)]
struct Open {
    /// Parent, learnt.
    before: [FreeRobot; 2],
    before_step: i64,
    /// Where the robot was when it began, and what was known.
    begin: Option<(i64, Pose, Vec<f64>)>,
}

/// A prediction whose end is seen.
#[derive(Debug, Clone)]
pub struct Due {
    /// The same span from the states that parent and learnt had.
    pub spans: [Span; 2],
    /// What was known when it began.
    pub weights: Vec<f64>,
}

/// What drives along.
#[derive(Debug, Clone, Copy)]
pub struct Drivers<'a> {
    pub body: Body<'a>,
    pub commands: &'a Commands,
    pub parent_weights: &'a [f64],
    pub weights: &'a [f64],
}

impl Track {
    /// At rest at a step.
    pub fn new(body: Body<'_>, step: i64, pose: Pose) -> Track {
        let resting = (FreeRobot::at_rest(body.robot, pose), Past::default());
        Track {
            parent: resting.clone(),
            learnt: resting,
            origin: step,
            open: VecDeque::new(),
        }
    }

    /// Takes a pose: drives to its step, begins predictions there, and ends the oldest when it is due.
    pub fn see(&mut self, drivers: Drivers<'_>, step: i64, pose: Pose) -> Option<Due> {
        if step < self.step() {
            return None;
        }
        if step - self.step() > SILENCE_STEPS {
            *self = Track::new(drivers.body, step, pose);
            return None;
        }
        self.advance(drivers, step);
        self.parent.0.lay(pose);
        self.learnt.0.lay(pose);
        for open in self.open.iter_mut().filter(|open| open.begin.is_none()) {
            if step >= open.before_step + RUN_IN_STEPS {
                open.begin = Some((step, pose, drivers.weights.to_vec()));
            }
        }
        self.open.retain(|open| {
            let begin = open.begin.as_ref();
            begin.is_none_or(|(at, _, _)| *at <= open.before_step + RUN_IN_STEPS + LATE_STEPS)
        });
        self.end(step)
    }

    /// What was learnt is thrown away: it goes on as the parent.
    pub fn forget(&mut self, parent_weights: &[f64]) {
        self.learnt = self.parent.clone();
        for open in &mut self.open {
            open.before[1] = open.before[0].clone();
            if let Some((_, _, weights)) = &mut open.begin {
                *weights = parent_weights.to_vec();
            }
        }
    }

    fn step(&self) -> i64 {
        self.origin + self.parent.0.steps() as i64
    }

    /// Drives to a step, and remembers where predictions will begin.
    fn advance(&mut self, drivers: Drivers<'_>, to: i64) {
        for step in self.step()..to {
            if (step - self.origin) % STRIDE_STEPS == 0 {
                self.open.push_back(Open {
                    before: [self.parent.0.clone(), self.learnt.0.clone()],
                    before_step: step,
                    begin: None,
                });
            }
            let command = drivers.commands.at(step);
            let both = [
                (&mut self.parent, drivers.parent_weights),
                (&mut self.learnt, drivers.weights),
            ];
            for ((free, past), weights) in both {
                drivers.body.step(free, &command, weights, past);
            }
        }
    }

    fn end(&mut self, step: i64) -> Option<Due> {
        let (at, _, _) = self.open.front()?.begin.as_ref()?;
        let over = step - at - HORIZON_STEPS;
        if over < 0 {
            return None;
        }
        let open = self.open.pop_front()?;
        let (at, begin, weights) = open.begin?;
        let spans = open.before.map(|before| Span {
            before,
            before_step: open.before_step,
            begin: (at, begin),
            end_step: step,
        });
        (over <= LATE_STEPS).then_some(Due { spans, weights })
    }
}
