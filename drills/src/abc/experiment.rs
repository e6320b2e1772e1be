//! A, A+, B and C of one chassis on one floor.

use super::course::{Course, Setting};
use super::drive::{Correction, Figures, ideal, on_plant, on_twin};
use super::floor;
use super::learned::{Case, Gap, learned};
use super::settings::{grid, is_steered};
use anyhow::{Context, Result, anyhow};
use control::interaction::Settings;
use identify::workers::Workers;
use serde::Serialize;
use twin::model_document::ModelDocument;
use twin::robot::Robot;

/// Runs of which A+'s gains, and C's model and gains, are the best.
const TUNING_RUNS: u64 = 2;
/// Learned model in the loop against A, and against A+.
pub const LESS_THAN_A: f64 = 4.0;
pub const LESS_THAN_A_PLUS: f64 = 1.5;

/// One course, driven under every correction.
#[derive(Debug, Clone, Serialize)]
pub struct Round {
    pub course: String,
    pub round: u64,
    pub a: Figures,
    pub a_plus: Figures,
    /// A+ and the share of the yaw rate learnt during the run: what a laboratory does without a model.
    pub usual: Figures,
    pub c: Figures,
    /// The learned model, nothing learnt during the run.
    pub c_without_bias: Figures,
    /// The nominal model, its bias learnt during the run.
    pub c_nominal: Figures,
}

impl Round {
    pub fn against_a(&self) -> f64 {
        self.a.rms_m / self.c.rms_m
    }

    pub fn against_a_plus(&self) -> f64 {
        self.a_plus.rms_m / self.c.rms_m
    }

    /// Experiment C's rule.
    pub fn holds(&self) -> bool {
        self.c.inside() && self.against_a() >= LESS_THAN_A && self.against_a_plus() >= LESS_THAN_A_PLUS
    }
}

/// Everything of one chassis on one floor.
#[derive(Debug, Clone, Serialize)]
pub struct Outcome {
    pub chassis: String,
    pub floor: u64,
    pub seed: u64,
    pub setting: Setting,
    /// A+'s.
    pub tuned: Setting,
    /// C's: A's or A+'s.
    pub corrected: Setting,
    /// C's model carries the residual, not the named effects alone.
    pub with_residual: bool,
    pub ideal: Figures,
    pub twin: Figures,
    pub sentence: String,
    pub effects: Vec<String>,
    pub residual: String,
    pub gaps: Vec<Gap>,
    pub rounds: Vec<Round>,
    pub seconds: f64,
    #[serde(skip)]
    pub model: ModelDocument,
}

/// - `setting`: A's, of the grid on the nominal twin.
/// - `rounds`: on the paper's path; one more on a path that nothing was trained on.
pub fn run(
    chassis: &str,
    number: u64,
    rounds: u64,
    seed: u64,
    setting: &Setting,
    workers: &dyn Workers,
) -> Result<Outcome> {
    let scenario = Course::L.scene(chassis, setting)?.scenario()?;
    let robot = scenario.robots.first().context("a robot")?;
    let description = robot.description.clone();
    let hidden = floor::floor(&description.name, is_steered(chassis), number, seed);
    let case = Case {
        chassis,
        description: &description,
        setting,
        hidden: &hidden,
        seed: seed + 1000 * (number + 1),
    };
    let found = learned(&case, workers)?;
    let nominal = Robot::new(description.clone()).map_err(|error| anyhow!("{}", error.message))?;
    let tuned = tuned_on_plant(&case)?;
    let with = |model: &Robot, learns_bias: bool| {
        let settings = Settings {
            learns_bias,
            ..Settings::default()
        };
        Correction::Model(Box::new(model.clone()), settings)
    };
    let mut candidates = Vec::new();
    for (document, with_residual) in [(&found.model, true), (&found.named, false)] {
        let model = document.robot().map_err(|error| anyhow!("{error}"))?;
        for of in [setting, &tuned] {
            candidates.push((
                squares(&case, of, 650, &with(&model, true))?,
                model.clone(),
                *of,
                with_residual,
            ));
        }
    }
    let best = candidates.into_iter().min_by(|a, b| a.0.total_cmp(&b.0));
    let (_, model, corrected, with_residual) = best.context("a candidate")?;
    let mut courses: Vec<(Course, u64)> = (1..=rounds).map(|round| (Course::L, round)).collect();
    courses.push((Course::Hook, 1));
    let mut done = Vec::new();
    for (course, round) in courses {
        let (_, reference) = ideal(chassis, course, setting)?;
        let drive = |setting: &Setting, correction: Correction| -> Result<Figures> {
            let driven = on_plant(chassis, course, setting, &hidden, case.seed + 700 + round, &correction)?;
            let mut figures = driven.figures;
            figures.time_rms_m = Some(reference.time_rms_m(&driven.poses, 1));
            Ok(figures)
        };
        done.push(Round {
            course: course.name().to_owned(),
            round,
            a: drive(setting, Correction::Plain)?,
            a_plus: drive(&tuned, Correction::LookAhead)?,
            usual: drive(&tuned, Correction::Usual)?,
            c: drive(&corrected, with(&model, true))?,
            c_without_bias: drive(&corrected, with(&model, false))?,
            c_nominal: drive(&corrected, with(&nominal, true))?,
        });
    }
    Ok(Outcome {
        chassis: chassis.to_owned(),
        floor: number,
        seed,
        setting: *setting,
        tuned,
        corrected,
        with_residual,
        ideal: ideal(chassis, Course::L, setting)?.0,
        twin: on_twin(chassis, Course::L, setting)?,
        sentence: found.sentence,
        effects: found.effects,
        residual: found.residual,
        gaps: found.gaps,
        rounds: done,
        seconds: 0.0,
        model: found.model,
    })
}

/// Sum of the mean squared errors of the tuning runs, m2.
fn squares(case: &Case<'_>, setting: &Setting, seed: u64, correction: &Correction) -> Result<f64> {
    let mut sum = 0.0;
    for run in 0..TUNING_RUNS {
        let driven = on_plant(
            case.chassis,
            Course::L,
            setting,
            case.hidden,
            case.seed + seed + run,
            correction,
        )?;
        sum += driven.figures.rms_m.powi(2) + if driven.figures.finished { 0.0 } else { 1.0 };
    }
    Ok(sum)
}

/// A+: the gains of the grid with the least RMS error on the plant, at A's speed and start.
pub fn tuned_on_plant(case: &Case<'_>) -> Result<Setting> {
    let settings = grid(true, case.setting.speed_m_per_s);
    let mut best = (*case.setting, f64::INFINITY);
    for setting in settings {
        let setting = Setting {
            start_yaw_rad: case.setting.start_yaw_rad,
            ..setting
        };
        let found = squares(case, &setting, 600, &Correction::LookAhead)?;
        if found < best.1 {
            best = (setting, found);
        }
    }
    Ok(best.0)
}
