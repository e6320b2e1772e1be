//! One network: linearise, train, drive, and again.

use std::ops::Range;

use identify::hypothesis::Hypothesis;
use identify::workers::{Cancelled, Workers, gathered};
use twin::residual::{OUTPUTS, Output, ResidualDocument, outputs};
use twin::robot::Robot;

use super::data::Windows;
use super::{Request, robot_of};
use crate::compare::{Difference, differences};
use crate::evaluate::{far_sigmas, sigmas};
use crate::inputs::{Eye, FADE, Frame, Sight, eyes};
use crate::linear::{AXES, Problem, Scales, Target, linearised};
use crate::network::{Network, Pass};
use crate::problem::LearnError;
use crate::report::{Attempt, Round};
use crate::rollout::Predictor;
use crate::train::{Learner, train};
use crate::window::Window;

/// A further round must lower the loss by this share.
const LEAST_STEP: f64 = 0.005;
/// Rounds without that after which it ends.
const MOST_FRUITLESS: usize = 2;
/// Shares of a step that are tried.
const STEPS: [f64; 5] = [1.0, 0.6, 0.35, 0.15, 0.0];
/// Smallest scales of the outputs, m/s^2 and rad/s^2, m/s and rad/s.
const LEAST_SCALE: [f64; AXES] = [0.02, 0.02, 0.05, 0.002, 0.002, 0.01];
/// Windows of a hundred whose constant acceleration is below the scale of the outputs.
const SCALE_QUANTILE: usize = 90;
/// Limit of an output over the largest that the training windows ask for.
const LIMIT_ROOM: f64 = 1.2;

/// Everything that all attempts share.
pub(super) struct Context<'a> {
    pub workers: &'a dyn Workers,
    pub request: &'a Request<'a>,
    pub physics: &'a Hypothesis,
    pub robot: &'a Robot,
    pub windows: &'a Windows,
}

impl Context<'_> {
    /// Trains one network; the best of its rounds by the validation runs, driven.
    pub(super) fn attempt(&self, sight: Sight, share: f64) -> Result<(Attempt, Option<Learner>), LearnError> {
        let windows = self.windows;
        let eyes = eyes(self.robot.description(), sight);
        let axes = axes(sight);
        let by_path = self.request.target == Target::Path;
        self.workers.progress("physics alone", share);
        let training = self.compared(self.robot, &windows.training.windows, by_path)?;
        let own = Scales::of(training.iter().map(Vec::as_slice));
        let validation = self.compared(self.robot, &windows.validation.windows, true)?;
        let path = Scales::of(validation.iter().map(Vec::as_slice));
        let physics = path.loss(&validation);
        let mut attempt = Attempt {
            sight,
            inputs: 0,
            rounds: Vec::new(),
            physics,
            validation: physics,
        };
        let mut robot = self.robot.clone();
        let mut learner: Option<Learner> = None;
        let mut best: Option<Learner> = None;
        let mut fruitless = 0;
        for number in 0..self.request.rounds {
            let share = share + 0.3 * number as f64 / self.request.rounds as f64;
            self.workers.progress("linearise", share);
            let seen = learner.as_ref().map_or(&eyes, |learner| &learner.frame.eyes).clone();
            let problems = self.problems(&robot, &windows.training.windows, (&seen, &axes), &own)?;
            let stopping = self.problems(&robot, &windows.stopping.windows, (&seen, &axes), &own)?;
            if problems.is_empty() || stopping.is_empty() {
                let message = "no window can be linearised".to_owned();
                return Err(LearnError::Simulation(message));
            }
            let (mut now, problems, stopping) = match learner.take() {
                Some(mut learner) => {
                    learner.frame.widen(rows(&problems, seen.len()));
                    (learner, problems, stopping)
                }
                None => self.first((&eyes, &axes), problems, stopping)?,
            };
            attempt.inputs = now.frame.eyes.len();
            self.workers.progress("train", share + 0.1);
            let before = now.network.clone();
            let course = train(&mut now, &problems, &stopping, &self.request.settings, &mut |_, _| {
                !self.workers.is_cancelled()
            });
            if self.workers.is_cancelled() {
                return Err(Cancelled.into());
            }
            if course.kept == 0 && number > 0 {
                // Nothing left in the linear problems that holds on other runs.
                break;
            }
            let step = self.search(&mut now, &before, &own, by_path)?;
            robot = robot_of(self.physics, Some(&document(&now, windows, self.robot)))?;
            let loss = self.loss(&robot, &windows.validation.windows, &path, true)?;
            attempt.rounds.push(Round {
                course,
                step,
                validation: loss,
            });
            let better = loss < attempt.validation * (1.0 - LEAST_STEP);
            if better {
                attempt.validation = loss;
                best = Some(now.clone());
            }
            fruitless = if better { 0 } else { fruitless + 1 };
            learner = Some(now);
            if fruitless >= MOST_FRUITLESS || step == 0.0 {
                break;
            }
        }
        Ok((attempt, best))
    }

    /// How far to go from the weights before: the share at which the twin, driven through the training windows, errs least.
    ///
    /// The contact is far from linear: what a small push hardly moves, a larger one makes slide.
    fn search(&self, now: &mut Learner, before: &Network, scales: &Scales, by_path: bool) -> Result<f64, LearnError> {
        let windows = self.windows;
        let after = now.network.clone();
        let mut best: Option<(f64, f64)> = None;
        for step in STEPS {
            now.network = before.towards(&after, step);
            let robot = robot_of(self.physics, Some(&document(now, windows, self.robot)))?;
            let loss = self.loss(&robot, &windows.training.windows, scales, by_path)?;
            if best.is_none_or(|(_, least)| loss < least) {
                best = Some((step, loss));
            }
        }
        let step = best.map_or(0.0, |(step, _)| step);
        now.network = before.towards(&after, step);
        Ok(step)
    }

    /// Of the twin driven through windows; infinite when it cannot be driven through one.
    fn loss(&self, robot: &Robot, windows: &[Window], scales: &Scales, poses: bool) -> Result<f64, Cancelled> {
        let driven = self.compared(robot, windows, poses)?;
        Ok(if driven.len() == windows.len() {
            scales.loss(&driven)
        } else {
            f64::INFINITY
        })
    }

    /// Frame, scales and a new network from the first linearisation.
    fn first(
        &self,
        (eyes, axes): (&[Eye], &Range<usize>),
        problems: Vec<Problem>,
        stopping: Vec<Problem>,
    ) -> Result<(Learner, Vec<Problem>, Vec<Problem>), LearnError> {
        let (frame, kept) = Frame::of(eyes, rows(&problems, eyes.len()));
        if frame.eyes.is_empty() {
            return Err(LearnError::Constant);
        }
        let narrowed = |problems: Vec<Problem>| -> Vec<Problem> {
            let one = |mut problem: Problem| {
                let rows = problem.inputs.chunks_exact(eyes.len());
                problem.inputs = rows
                    .flat_map(|row| kept.iter().map(|position| row[*position]))
                    .collect();
                problem
            };
            problems.into_iter().map(one).collect()
        };
        let constants: Vec<[f64; AXES]> = problems.iter().map(Problem::constant).collect();
        let limits: Vec<f64> = outputs(self.robot.description()).map(|(_, _, most)| most).collect();
        let scale = core::array::from_fn(|axis| {
            let mut sizes: Vec<f64> = constants.iter().map(|c| c[axis].abs()).collect();
            sizes.sort_by(f64::total_cmp);
            let size = sizes[(sizes.len() - 1) * SCALE_QUANTILE / 100];
            size.max(LEAST_SCALE[axis])
                .min(limits.get(axis).copied().unwrap_or(f64::INFINITY))
        });
        let settings = &self.request.settings;
        let mut sizes = vec![frame.eyes.len()];
        sizes.extend(&settings.hidden);
        sizes.push(axes.len());
        let learner = Learner {
            network: Network::new(&sizes, settings.seed),
            frame,
            first: axes.start,
            scale,
        };
        Ok((learner, narrowed(problems), narrowed(stopping)))
    }

    /// How surely a twin beats the physical model on the validation windows, in standard errors over windows: the loss, and
    /// the place 2 s ahead.
    pub(super) fn gain_sigmas(&self, better: &Robot) -> Result<[f64; 2], Cancelled> {
        let windows = &self.windows.validation.windows;
        let (alone, with) = (
            self.compared(self.robot, windows, true)?,
            self.compared(better, windows, true)?,
        );
        if alone.len() != with.len() || alone.len() < 2 {
            return Ok([0.0; 2]);
        }
        let scales = Scales::of(alone.iter().map(Vec::as_slice));
        let pairs = alone.iter().zip(&with);
        let ratio = |(alone, with): (&Vec<Difference>, &Vec<Difference>)| {
            let size = |window: &[Difference]| libm::log(scales.loss_of(window).max(f64::MIN_POSITIVE));
            size(alone) - size(with)
        };
        let loss = sigmas(pairs.map(ratio));
        let far = far_sigmas(self.workers, &self.windows.validation_far.windows, self.robot, better)?;
        Ok([loss, far])
    }

    fn compared(&self, robot: &Robot, windows: &[Window], poses: bool) -> Result<Vec<Vec<Difference>>, Cancelled> {
        let all = gathered(self.workers, windows.len(), &|number| {
            let window = &windows[number];
            differences(window, &robot.path(window)?, poses)
        })?;
        Ok(all.into_iter().flatten().collect())
    }

    fn problems(
        &self,
        robot: &Robot,
        windows: &[Window],
        seen: (&[Eye], &Range<usize>),
        scales: &Scales,
    ) -> Result<Vec<Problem>, Cancelled> {
        let target = self.request.target;
        let all = gathered(self.workers, windows.len(), &|number| {
            linearised(robot, &windows[number], seen, scales, target)
        })?;
        Ok(all.into_iter().flatten().collect())
    }
}

/// Outputs of a network: accelerations, or set-points from one that sees nothing of what the robot does.
fn axes(sight: Sight) -> Range<usize> {
    if sight == Sight::Told {
        OUTPUTS.len()..AXES
    } else {
        0..OUTPUTS.len()
    }
}

fn rows(problems: &[Problem], width: usize) -> impl Iterator<Item = &[f64]> + Clone {
    problems
        .iter()
        .flat_map(move |problem| problem.inputs.chunks_exact(width))
}

/// The learner as a residual document; limits a little above what the training runs ask for.
pub(super) fn document(learner: &Learner, windows: &Windows, robot: &Robot) -> ResidualDocument {
    let mut largest = LEAST_SCALE;
    let (mut inputs, mut normalised, mut pass) = (Vec::new(), Vec::new(), Pass::default());
    for window in windows.training.windows.iter() {
        let mut watch = crate::inputs::Watch::new(robot, &learner.frame.eyes);
        // Nothing but the inputs is wanted: the twin without the network is near enough.
        let _ = crate::rollout::driven(robot, window, &mut |tick| {
            watch.take(tick);
            inputs.clear();
            watch.inputs(&mut inputs);
            let outputs = learner.outputs(&inputs, &mut normalised, &mut pass);
            for (largest, output) in largest.iter_mut().zip(outputs) {
                *largest = largest.max(output.abs());
            }
            None
        });
    }
    let outputs = outputs(robot.description()).zip(learner.scale).zip(largest);
    let outputs = outputs.skip(learner.first).take(learner.network.outputs());
    let outputs = outputs.map(|(((name, _, most), scale), largest)| Output {
        name: name.to_owned(),
        scale,
        limit: (LIMIT_ROOM * largest).min(most),
    });
    ResidualDocument::new(
        learner.frame.inputs(),
        FADE,
        learner.network.layers(),
        outputs.collect(),
    )
}
