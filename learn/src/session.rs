//! The whole: runs and a physical model in; report, model version and network out.

mod attempt;
mod data;

use identify::diagnose::{LIBRARY_VERSION, Run, calibrated};
use identify::gap::RobotClock;
use identify::hypothesis::Hypothesis;
use identify::workers::Workers;
use serde_json::{Value, json};
use twin::model_document::ModelDocument;
use twin::residual::ResidualDocument;
use twin::robot::Robot;

use crate::black_box::BlackBox;
use crate::evaluate::{Rivals, TRACKER_M, far_position_m, figures};
use crate::inputs::{Sight, eyes};
use crate::linear::Target;
use crate::problem::LearnError;
use crate::report::{FORMAT, Gate, Report};
use crate::rollout::Predictor;
use crate::train::{Learner, Settings};
use crate::window::Cut;

pub use data::Survey;

/// Runs that are read one at a time, each as often as it is needed.
pub trait Shelf {
    fn count(&self) -> usize;

    /// - Errors: what cannot be read, by its path.
    fn read(&self, position: usize) -> Result<Run, LearnError>;
}

impl Shelf for Vec<Run> {
    fn count(&self) -> usize {
        self.len()
    }

    fn read(&self, position: usize) -> Result<Run, LearnError> {
        Ok(self[position].clone())
    }
}

/// What is asked.
pub struct Request<'a> {
    /// Runs with nothing changed; they calibrate the physical model.
    pub references: &'a [Run],
    pub runs: &'a dyn Shelf,
    /// Runs that stay locked; without them some of `runs` do.
    pub locked: Option<&'a dyn Shelf>,
    /// The physical model; the description of the first run when absent.
    pub model: Option<ModelDocument>,
    pub target: Target,
    /// Sets of inputs to try, simplest first.
    pub sights: Vec<Sight>,
    /// Most linearisations of each.
    pub rounds: usize,
    pub settings: Settings,
}

impl<'a> Request<'a> {
    /// With the usual settings.
    pub fn new(runs: &'a dyn Shelf) -> Request<'a> {
        Request {
            references: &[],
            runs,
            locked: None,
            model: None,
            target: Target::Path,
            sights: vec![Sight::Motion, Sight::Place],
            rounds: 5,
            settings: Settings::default(),
        }
    }
}

/// What came out.
#[derive(Debug, Clone)]
pub struct Outcome {
    pub report: Report,
    /// The version with the residual, or the physical model when it is discarded.
    pub model: ModelDocument,
    /// The network as it was trained; `None` when it is discarded.
    pub learner: Option<Learner>,
}

/// Windows of the training and of the early stopping: one second ahead.
pub const TRAINING: Cut = Cut {
    horizon_s: 1.0,
    period_s: 1.0,
};
/// The same for [`Target::Twist`].
pub const TWIST_TRAINING: Cut = Cut {
    horizon_s: 0.1,
    period_s: 0.3,
};
/// Windows of the comparison.
pub const COMPARED: Cut = Cut {
    horizon_s: 2.0,
    period_s: 2.0,
};
/// Most windows of each role that are kept in memory.
pub const MOST_WINDOWS: usize = 800;
/// Fewest windows of the training runs, and of the others.
const LEAST_TRAINING: usize = 8;
const LEAST_OTHER: usize = 3;
/// The network must beat physics alone on the validation runs by this share of the loss.
const LEAST_GAIN: f64 = 0.03;
/// By this many standard errors of the mean over windows: the loss (95 %, one-sided), and the place 2 s ahead (84 %).
const LEAST_SIGMAS: [f64; 2] = [1.645, 1.0];
/// Place errors 2 s ahead that differ by less than the tracker's own, 2 mm, count when they do by this share of physics' and by this many
/// standard errors.
const LEAST_NEARER: f64 = 0.1;
const SURELY_NEARER_SIGMAS: f64 = 3.0;
/// More inputs must be better by this share.
const LEAST_FOR_MORE: f64 = 0.03;

/// Learns.
///
/// - The same request gives the same bits, whatever the number of threads.
/// - Errors: data or a model that nothing can be learned from, by name; cancelled. A network that does not help is no
///   error: the report says so and the model carries none.
pub fn learn(workers: &dyn Workers, request: &Request<'_>) -> Result<Outcome, LearnError> {
    workers.progress("read", 0.0);
    let survey = Survey::of(request)?;
    workers.progress("calibrate", 0.05);
    let physics = physics(workers, request, &survey)?;
    let robot = robot_of(&physics, None)?;
    let clock = RobotClock::of(&physics.effects);
    workers.progress("cut", 0.1);
    let windows = survey.windows(request, clock)?;
    let context = attempt::Context {
        workers,
        request,
        physics: &physics,
        robot: &robot,
        windows: &windows,
    };
    let mut sights = request.sights.clone();
    if robot.description().motor.is_none() && request.target == Target::Path {
        sights.push(Sight::Told);
    }
    let mut attempts = Vec::new();
    let mut best: Option<(usize, Learner, f64)> = None;
    for (number, sight) in sights.iter().enumerate() {
        let share = 0.1 + 0.6 * number as f64 / sights.len() as f64;
        let (attempt, learner) = context.attempt(*sight, share)?;
        let least = best
            .as_ref()
            .map_or(f64::INFINITY, |(_, _, loss)| *loss * (1.0 - LEAST_FOR_MORE));
        if let Some(learner) = learner
            && attempt.validation < least
        {
            best = Some((number, learner, attempt.validation));
        }
        attempts.push(attempt);
    }
    let far = |predictor: &dyn Predictor| far_position_m(workers, &windows.validation_far.windows, predictor);
    let mut gate = Gate {
        physics: far(&robot)?,
        residual: None,
        gain_sigmas: None,
    };
    let mut carried: Option<(usize, Learner, ResidualDocument, Robot)> = None;
    let mut verdict = "no network could be trained; the physical model stands as it is".to_owned();
    if let Some((number, learner, loss)) = best {
        let document = attempt::document(&learner, &windows, &robot);
        let with = robot_of(&physics, Some(&document))?;
        let far_m = far(&with)?;
        gate.residual = Some(far_m);
        let sigmas = context.gain_sigmas(&with)?;
        gate.gain_sigmas = Some(sigmas);
        let physics_loss = attempts[number].physics;
        let sure = sigmas.iter().zip(LEAST_SIGMAS).all(|(found, least)| *found >= least);
        if loss <= (1.0 - LEAST_GAIN) * physics_loss && is_nearer(gate.physics, far_m, sigmas[1]) && sure {
            verdict = format!(
                "on the validation runs the learned residual lowers the place error 2 s ahead from {:.4} m to {far_m:.4} m",
                gate.physics
            );
            carried = Some((number, learner, document, with));
        } else {
            verdict = format!(
                "discarded: on the validation runs the network does not beat physics alone (loss {loss:.3} against {physics_loss:.3}, {:.1} standard errors, place error 2 s ahead {far_m:.4} m against {:.4} m, {:.1} standard errors)",
                sigmas[0], gate.physics, sigmas[1]
            );
        }
    }
    workers.progress("black box", 0.75);
    let chosen = carried.as_ref().map_or(0, |(number, ..)| *number);
    let sight = sights.get(chosen).copied().unwrap_or(Sight::Motion);
    // The rival sees what the network saw, and what the robot does in any case; of two the better one on the validation runs.
    let rivals = match sight {
        Sight::Told => vec![Sight::Motion, Sight::Everything],
        other => vec![other],
    };
    let mut black_box: Option<(BlackBox, f64)> = None;
    for sight in rivals {
        let rival = BlackBox::trained(
            &robot,
            &eyes(robot.description(), sight),
            &windows.black_box.windows,
            &windows.validation.windows,
            &request.settings,
            &mut |_, _| !workers.is_cancelled(),
        );
        if let Some(rival) = rival
            && black_box.as_ref().is_none_or(|best| rival.1 < best.1)
        {
            black_box = Some(rival);
        }
    }
    workers.progress("compare", 0.95);
    let rivals = Rivals {
        physics: &robot,
        black_box: black_box.as_ref().map(|(rival, _)| rival as &dyn Predictor),
        residual: carried.as_ref().map(|(.., with)| with as &dyn Predictor),
    };
    let (locked, locked_runs) = figures(workers, &windows.locked.windows, rivals, &survey.paths())?;
    let model = version(
        request,
        &survey,
        &physics,
        carried.as_ref().map(|(_, _, document, _)| document),
    );
    let report = Report {
        format: FORMAT,
        robot: physics.description.name.clone(),
        floor: survey.floor.clone(),
        library_version: LIBRARY_VERSION,
        model: model.id.clone(),
        parent: model.parent.clone(),
        useful: carried.is_some(),
        verdict,
        data: survey.data(request),
        counts: windows.counts(&survey),
        target: request.target,
        settings: request.settings.clone(),
        chosen: carried.as_ref().map(|(number, ..)| *number),
        attempts,
        validation_position_m: gate,
        locked,
        locked_runs,
        onnx: None,
        remarks: windows.remarks(),
    };
    Ok(Outcome {
        report,
        model,
        learner: carried.map(|(_, learner, ..)| learner),
    })
}

/// The place 2 s ahead is nearer by what a tracker tells apart in one pose, or by less that many windows agree on.
fn is_nearer(physics_m: f64, with_m: f64, sigmas: f64) -> bool {
    with_m + TRACKER_M <= physics_m || (with_m <= (1.0 - LEAST_NEARER) * physics_m && sigmas >= SURELY_NEARER_SIGMAS)
}

/// The model to learn on: as given, calibrated on the references.
fn physics(workers: &dyn Workers, request: &Request<'_>, survey: &Survey) -> Result<Hypothesis, LearnError> {
    if request.model.as_ref().is_some_and(|model| model.residual.is_some()) {
        return Err(LearnError::HasResidual);
    }
    if !request.references.is_empty() {
        return calibrated(workers, request.references, request.model.as_ref())
            .map_err(|error| LearnError::Model(error.to_string()));
    }
    Ok(match &request.model {
        Some(model) => Hypothesis {
            description: model.robot.clone(),
            effects: model.effects.clone(),
            residual: None,
        },
        None => Hypothesis::nominal(&survey.description),
    })
}

/// The twin of a hypothesis with a residual.
fn robot_of(physics: &Hypothesis, residual: Option<&ResidualDocument>) -> Result<Robot, LearnError> {
    Robot::with_model(physics.description.clone(), &physics.effects, residual)
        .map_err(|problem| LearnError::Model(format!("{}: {}", problem.field, problem.message)))
}

fn version(
    request: &Request<'_>,
    survey: &Survey,
    physics: &Hypothesis,
    residual: Option<&ResidualDocument>,
) -> ModelDocument {
    let data = survey.data(request);
    let files: Vec<Value> = data
        .iter()
        .map(|data| json!({"path": data.path, "sha256": data.sha256}))
        .collect();
    let split: serde_json::Map<String, Value> = data
        .iter()
        .map(|data| (data.path.clone(), Value::from(data.role)))
        .collect();
    let provenance = json!({
        "data": files,
        "split": split,
        "library_version": LIBRARY_VERSION,
        "learned": {"target": request.target, "seed": request.settings.seed},
    });
    let document = ModelDocument::new(
        request.model.as_ref().map(|model| model.id.clone()),
        physics.description.clone(),
        &survey.floor,
        physics.effects.clone(),
        provenance,
    );
    match residual {
        Some(residual) => document.with_residual(residual.clone()),
        None => document,
    }
}

#[cfg(test)]
mod tests {
    use super::is_nearer;

    #[test]
    fn what_a_tracker_cannot_tell_in_one_pose_counts_when_many_windows_agree() {
        assert!(is_nearer(0.0054, 0.0036, 6.6), "a third nearer, surely");
        assert!(!is_nearer(0.0054, 0.0036, 2.9), "a third nearer, perhaps");
        assert!(!is_nearer(0.0054, 0.0050, 6.6), "hardly nearer");
        assert!(
            is_nearer(0.0090, 0.0028, 1.1),
            "nearer by more than the tracker's error"
        );
    }
}
