//! One robot, learned while it drives.

use super::OnlineError;
use super::closing::{Account, Closing};
use super::draft::{self, Ranges};
use super::law::Law;
use super::recursion::Recursion;
use super::span::{Body, Commands, Driven, Span, difference};
use super::track::{Drivers, Due, Track};
use super::watchdog::Watchdog;
use twin::command::WheelCommand;
use twin::model_document::ModelDocument;
use twin::pose::Pose;
use twin::residual::ResidualDocument;
use twin::robot::Robot;

/// Uncertainty of a new weight, in units of its output; of a weight that the parent has, as a share of the layer's RMS.
const NEW_DEVIATION: f64 = 0.5;
const OLD_DEVIATION: f64 = 0.5;
const OLD_DEVIATION_LEAST: f64 = 0.02;
/// Share of what is known that each prediction makes older: a memory of 50 s.
const FORGETTING: f64 = 0.002;
/// Predictions overlap; one counts as this share of an independent one.
const INDEPENDENT: f64 = 0.2;
/// Scatter of the end of a prediction at first and at least, m and rad.
const SCATTER_FIRST: [f64; 3] = [0.05, 0.05, 0.1];
const SCATTER_LEAST: [f64; 3] = [0.002, 0.002, 0.004];
/// Scatters: beyond the first an error counts less, beyond the second it is refused.
const DOUBTFUL: f64 = 3.0;
const OUTLIER: f64 = 6.0;
/// A robot that moved and was to move less than this did not move, m and rad.
const RESTING: (f64, f64) = (0.005, 0.01);
/// A prediction that is no number is this much worse than the parent's, m.
const LOST_M: f64 = 1.0;
/// What was learnt is thrown away so often; then the run goes on with the parent alone.
const DISCARDS_MOST: u32 = 3;
/// A prediction whose end was seen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Prediction {
    /// Physics step of its end.
    pub step: i64,
    /// Distance between what was seen and what was predicted, by the parent and by what was learnt when it began, m.
    pub parent_m: f64,
    pub learnt_m: f64,
}

/// What happened so far.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Counts {
    pub predictions: u64,
    /// Outliers, and what was no number.
    pub refused: u64,
    /// Times that what was learnt was thrown away.
    pub discarded: u32,
}

/// See the module.
#[derive(Debug, Clone)]
pub struct OnlineLearner {
    parent: ModelDocument,
    residual: ResidualDocument,
    /// The parent has no residual.
    fresh: bool,
    /// The parent without its residual.
    robot: Robot,
    law: Law,
    parent_weights: Vec<f64>,
    deviation: Vec<f64>,
    recursion: Recursion,
    commands: Commands,
    track: Option<Track>,
    scatter: [[f64; 3]; 2],
    watchdog: Watchdog,
    account: Account,
    ranges: Ranges,
    counts: Counts,
}

impl OnlineLearner {
    /// Begins at a parent: a version, or the nominal robot as a document without effects.
    ///
    /// - Errors: a parent that is no model; [`OnlineError::NotLinear`].
    pub fn new(parent: ModelDocument) -> Result<OnlineLearner, OnlineError> {
        let bad = |error: &dyn std::fmt::Display| OnlineError::Model(error.to_string());
        parent.robot().map_err(|error| bad(&error))?;
        let robot = Robot::with_model(parent.robot.clone(), &parent.effects, None).map_err(|error| bad(&error))?;
        let fresh = parent.residual.is_none();
        let residual = parent.residual.clone().unwrap_or_else(|| draft::empty(&parent.robot));
        let (law, parent_weights) = Law::new(&residual)?;
        let squares: f64 = parent_weights.iter().map(|weight| weight * weight).sum();
        let typical = (squares / parent_weights.len().max(1) as f64).sqrt();
        let deviation = match fresh {
            true => NEW_DEVIATION,
            false => (OLD_DEVIATION * typical).max(OLD_DEVIATION_LEAST),
        };
        let deviation = vec![deviation; parent_weights.len()];
        Ok(OnlineLearner {
            recursion: Recursion::new(&parent_weights, &deviation),
            parent,
            residual,
            fresh,
            robot,
            law,
            parent_weights,
            deviation,
            commands: Commands::default(),
            track: None,
            scatter: [SCATTER_FIRST; 2],
            watchdog: Watchdog::default(),
            account: Account::default(),
            ranges: Ranges::default(),
            counts: Counts::default(),
        })
    }

    /// Takes what was sent at a physics step.
    pub fn command(&mut self, step: i64, command: WheelCommand) {
        if command.non_finite_field().is_some() {
            self.counts.refused += 1;
            return;
        }
        self.commands.push(step, command);
        if self.track.is_none() {
            self.track = Some(Track::new(self.body(), step, Pose::default()));
        }
    }

    /// Takes a believed pose at a physics step; at most one prediction ends with it. Poses that are older than the newest are
    /// passed over. Cost: at most 1 s of the twin, and five spans of 0.6 s when a prediction ends.
    pub fn pose(&mut self, step: i64, pose: Pose) -> Option<Prediction> {
        if !pose.is_finite() {
            self.counts.refused += 1;
            return None;
        }
        let mut track = self.track.take()?;
        let drivers = Drivers {
            body: self.body(),
            commands: &self.commands,
            parent_weights: &self.parent_weights,
            weights: self.recursion.weights(),
        };
        let due = track.see(drivers, step, pose);
        self.track = Some(track);
        self.judge(&due?, &pose)
    }

    /// What happened so far.
    pub fn counts(&self) -> Counts {
        self.counts
    }

    /// Figures of the run so far.
    pub fn close(&self) -> Closing {
        self.account.close()
    }

    /// The version it began with.
    pub fn parent(&self) -> &ModelDocument {
        &self.parent
    }

    /// What is known now as a version: the parent with another residual.
    ///
    /// - Returns `None` when nothing varied, or the result is no model.
    pub fn version(&self, provenance: serde_json::Value) -> Option<ModelDocument> {
        let weights = self.recursion.weights();
        let residual = draft::settled(&self.residual, &self.law, weights, &self.ranges, self.fresh)?;
        let parent = &self.parent;
        // A robot without a version has no document that could be named.
        let id = (!self.parent.id.is_empty()).then(|| parent.id.clone());
        let version = ModelDocument::new(
            id,
            parent.robot.clone(),
            &parent.floor,
            parent.effects.clone(),
            provenance,
        )
        .with_residual(residual);
        version.robot().is_ok().then_some(version)
    }

    fn body(&self) -> Body<'_> {
        Body {
            robot: &self.robot,
            law: &self.law,
        }
    }

    fn judge(&mut self, due: &Due, seen: &Pose) -> Option<Prediction> {
        let ([alone, span], weights) = (&due.spans, due.weights.as_slice());
        let mut ranges = self.ranges.clone();
        let drive = |span, weights: &[f64], ranges| self.body().drive(span, &self.commands, weights, [0.0; 3], ranges);
        let parent = drive(alone, &self.parent_weights, None);
        let learnt = drive(span, weights, Some(&mut ranges));
        let moved = [*seen, parent.end].map(|end| difference(&span.begin.1, &end));
        if moved
            .iter()
            .all(|[x, y, yaw]| (x * x + y * y).sqrt() < RESTING.0 && yaw.abs() < RESTING.1)
        {
            return None;
        }
        let errors = [&parent, &learnt].map(|driven| difference(&driven.end, seen));
        let refused = [0, 1].map(|which| !self.scattered(which, errors[which]));
        // The measurement is at fault only when both are far off; a learnt model that went astray is the watchdog's.
        if refused[0] && refused[1] || !errors[0].iter().all(|error| error.is_finite()) {
            self.counts.refused += 1;
            return None;
        }
        let [parent_m, learnt_m] = errors.map(|[x, y, _]| (x * x + y * y).sqrt());
        let astray = self.watchdog.take(parent_m, learnt_m);
        let learnt_m = if learnt_m.is_finite() {
            learnt_m
        } else {
            parent_m + LOST_M
        };
        self.counts.predictions += 1;
        self.account.take(parent_m, learnt_m);
        self.ranges = ranges;
        if astray {
            self.discard();
        } else if self.counts.discarded < DISCARDS_MOST && !refused[1] {
            let rows = rows(self.body(), span, &self.commands, weights, &learnt);
            self.update(&rows, errors[1], weights);
        }
        Some(Prediction {
            step: span.end_step,
            parent_m,
            learnt_m,
        })
    }

    /// Follows the scatter of the errors of a predictor; false for an outlier.
    fn scattered(&mut self, which: usize, error: [f64; 3]) -> bool {
        let scatter = &mut self.scatter[which];
        let fits = error
            .iter()
            .zip(scatter.iter())
            .all(|(error, scatter)| error.abs() <= OUTLIER * scatter);
        for ((scatter, error), least) in scatter.iter_mut().zip(error).zip(SCATTER_LEAST) {
            let bounded = error.abs().min(DOUBTFUL * *scatter);
            *scatter = (*scatter * *scatter + 0.05 * (bounded * bounded - *scatter * *scatter))
                .sqrt()
                .max(least);
        }
        fits
    }

    fn update(&mut self, rows: &[Vec<f64>; 3], error: [f64; 3], weights: &[f64]) {
        for ((row, error), scatter) in rows.iter().zip(error).zip(self.scatter[1]) {
            let doubt = (error.abs() / (DOUBTFUL * scatter)).max(1.0);
            let variance = scatter * scatter * doubt / INDEPENDENT;
            let then: f64 = row.iter().zip(weights).map(|(h, weight)| h * weight).sum();
            if !self.recursion.take(row, error + then, variance) {
                self.counts.refused += 1;
            }
        }
        self.recursion.forget(FORGETTING);
    }

    fn discard(&mut self) {
        self.counts.discarded += 1;
        self.recursion = Recursion::new(&self.parent_weights, &self.deviation);
        self.watchdog = Watchdog::default();
        self.scatter[1] = SCATTER_FIRST;
        if let Some(track) = &mut self.track {
            track.forget(&self.parent_weights);
        }
    }
}

/// Change of the end per weight: rows x, y, yaw.
fn rows(body: Body<'_>, span: &Span, commands: &Commands, weights: &[f64], learnt: &Driven) -> [Vec<f64>; 3] {
    let sensitivity = body.sensitivity(span, commands, weights, learnt);
    sensitivity.map(|row| {
        let outputs = body.law.rows();
        let of = |(axis, scale): (usize, f64)| learnt.features.iter().map(move |feature| row[axis] * scale * feature);
        outputs.flat_map(of).collect()
    })
}
