//! Experiment B: a model from runs on a floor, and what it predicts of runs that it has not seen.

use super::course::{Course, Setting};
use super::drive::{Correction, on_plant};
use super::floor;
use super::measured;
use super::replay::{again, apart_m};
use anyhow::{Context, Result, anyhow};
use emulator::hidden::Hidden;
use identify::diagnose::{Input, Run, diagnose};
use identify::gap::{ANCHOR_PERIOD_S, RobotClock, end_to_end_with};
use identify::workers::Workers;
use learn::inputs::Sight;
use learn::linear::Target;
use learn::session::{Request, learn};
use serde::Serialize;
use std::sync::atomic::{AtomicUsize, Ordering};
use twin::model_document::ModelDocument;
use twin::robot::{Robot, RobotDescription};

/// Speeds that are trained on; A's own is not among them unless the grid chose one of these.
const TRAINED_M_PER_S: [f64; 3] = [0.35, 0.5, 0.7];
/// Courses that are trained on.
const TRAINED: [Course; 3] = [Course::Zigzag, Course::L, Course::Weave];
/// Unseen.
const UNSEEN_M_PER_S: f64 = 0.6;
const SEEN_M_PER_S: f64 = 0.5;
/// Horizon of the figure.
const AHEAD_S: f64 = 2.0;
/// Runs in the workshop.
const REFERENCES: u64 = 3;

/// Work items on threads.
pub struct Threads(pub usize);

impl Workers for Threads {
    fn run(&self, count: usize, work: &(dyn Fn(usize) + Sync)) {
        let next = AtomicUsize::new(0);
        std::thread::scope(|scope| {
            for _ in 0..self.0.clamp(1, count.max(1)) {
                scope.spawn(|| {
                    loop {
                        let item = next.fetch_add(1, Ordering::Relaxed);
                        if item >= count {
                            break;
                        }
                        work(item);
                    }
                });
            }
        });
    }
}

/// Position 2 s ahead, RMS, m.
#[derive(Debug, Clone, Serialize)]
pub struct Gap {
    pub course: String,
    pub speed_m_per_s: f64,
    pub before_m: f64,
    /// With the named effects alone.
    pub named_m: f64,
    pub after_m: f64,
    pub repeatability_m: f64,
}

impl Gap {
    /// Experiment B's rule.
    pub fn holds(&self) -> bool {
        self.before_m >= 5.0 * self.after_m || self.after_m <= 1.3 * self.repeatability_m
    }
}

/// What was learned on a floor.
#[derive(Debug, Clone)]
pub struct Learned {
    pub sentence: String,
    pub effects: Vec<String>,
    pub residual: String,
    /// Named effects alone, and with the residual.
    pub named: ModelDocument,
    pub model: ModelDocument,
    pub gaps: Vec<Gap>,
}

/// A robot and the floor under it.
#[derive(Debug, Clone, Copy)]
pub struct Case<'a> {
    pub chassis: &'a str,
    pub description: &'a RobotDescription,
    pub setting: &'a Setting,
    pub hidden: &'a Hidden,
    /// Of the runs.
    pub seed: u64,
}

impl Case<'_> {
    fn at(&self, speed_m_per_s: f64) -> Setting {
        Setting {
            speed_m_per_s,
            ..*self.setting
        }
    }

    fn measured(&self, course: Course, speed_m_per_s: f64, hidden: &Hidden, seed: u64, reference: bool) -> Result<Run> {
        let driven = on_plant(
            self.chassis,
            course,
            &self.at(speed_m_per_s),
            hidden,
            seed,
            &Correction::LookAhead,
        )?;
        let label = format!("{} {speed_m_per_s} {seed}", course.name());
        measured::run(self.description, &driven, &label, reference)
    }
}

/// Diagnosis, then the residual, from runs on the floor; figures from runs that neither saw.
pub fn learned(case: &Case<'_>, workers: &dyn Workers) -> Result<Learned> {
    let workshop = floor::reference(&case.description.name, case.seed);
    let mut references = Vec::new();
    for k in 0..REFERENCES {
        let speed_m_per_s = TRAINED_M_PER_S.get(k as usize % 3).copied().unwrap_or(SEEN_M_PER_S);
        let course = if k == 1 { Course::L } else { Course::Zigzag };
        references.push(case.measured(course, speed_m_per_s, &workshop, case.seed + 100 + k, true)?);
    }
    let mut runs = Vec::new();
    for (k, speed_m_per_s) in TRAINED_M_PER_S.into_iter().enumerate() {
        for (n, course) in TRAINED.into_iter().enumerate() {
            let seed = case.seed + 200 + 10 * k as u64 + n as u64;
            runs.push(case.measured(course, speed_m_per_s, case.hidden, seed, false)?);
        }
    }
    let input = Input {
        references: references.clone(),
        runs: runs.clone(),
        locked: Vec::new(),
        model: None,
        seed: 1,
    };
    let found = diagnose(workers, &input).map_err(|error| anyhow!("{error}"))?;
    let named = found.model.robot().map_err(|error| anyhow!("{error}"))?;
    // None of the runs is locked away: the figures come from further ones.
    let locked = vec![case.measured(Course::Zigzag, SEEN_M_PER_S, case.hidden, case.seed + 250, false)?];
    let (model, residual) = residual(&found.model, &runs, &locked, workers);
    let with = model.robot().map_err(|error| anyhow!("{error}"))?;
    let unseen = [
        (Course::Bends, SEEN_M_PER_S),
        (Course::Hook, SEEN_M_PER_S),
        (Course::L, UNSEEN_M_PER_S),
    ];
    let mut gaps = Vec::new();
    for (k, (course, speed_m_per_s)) in unseen.into_iter().enumerate() {
        gaps.push(gap(
            case,
            course,
            speed_m_per_s,
            case.seed + 300 + 10 * k as u64,
            [&named, &with],
        )?);
    }
    let effects = found.model.effects.iter();
    Ok(Learned {
        sentence: found.report.sentence.clone(),
        effects: effects
            .map(|effect| format!("{}{:?} {:?}", effect.name, effect.index, effect.parameters))
            .collect(),
        residual,
        named: found.model,
        model,
        gaps,
    })
}

/// The physical model with the residual that is best on the validation runs, whichever of its two targets taught it.
fn residual(
    physics: &ModelDocument,
    runs: &Vec<Run>,
    locked: &Vec<Run>,
    workers: &dyn Workers,
) -> (ModelDocument, String) {
    let mut best: Option<(ModelDocument, String, f64)> = None;
    let mut said: Vec<String> = Vec::new();
    for target in [Target::Path, Target::Twist] {
        let mut request = Request::new(runs);
        request.model = Some(physics.clone());
        request.locked = Some(locked);
        request.sights = vec![Sight::Motion];
        request.target = target;
        request.rounds = 4;
        match learn(workers, &request) {
            Ok(outcome) if outcome.report.useful => {
                let far_m = outcome.report.validation_position_m.residual.unwrap_or(f64::INFINITY);
                if best.as_ref().is_none_or(|(_, _, least_m)| far_m < *least_m) {
                    best = Some((outcome.model, format!("{target:?}: {}", outcome.report.verdict), far_m));
                }
            }
            Ok(outcome) => said.push(format!("{target:?}: {}", outcome.report.verdict)),
            Err(error) => said.push(format!("{target:?}: not learned: {error}")),
        }
    }
    best.map_or_else(
        || (physics.clone(), said.join("; ")),
        |(model, verdict, _)| (model, verdict),
    )
}

fn gap(case: &Case<'_>, course: Course, speed_m_per_s: f64, seed: u64, [named, with]: [&Robot; 2]) -> Result<Gap> {
    let setting = case.at(speed_m_per_s);
    let driven = on_plant(
        case.chassis,
        course,
        &setting,
        case.hidden,
        seed,
        &Correction::LookAhead,
    )?;
    let run = measured::run(case.description, &driven, "unseen", false)?;
    let ahead_m = |robot: &Robot| -> Result<f64> {
        let clock = RobotClock::of(robot.effects());
        let gap = end_to_end_with(&run.bundle, robot, clock, ANCHOR_PERIOD_S).map_err(|error| anyhow!("{error}"))?;
        let at = gap.horizons.iter().find(|at| (at.horizon_s - AHEAD_S).abs() < 1e-9);
        Ok(at.context("a horizon of 2 s")?.position_m)
    };
    let nominal = Robot::new(case.description.clone()).map_err(|error| anyhow!("{}", error.message))?;
    let others: Vec<Vec<[f64; 3]>> = (1..=3)
        .map(|k| again(case.chassis, course, &setting, case.hidden, seed + 5000 + k, &driven))
        .collect::<Result<_>>()?;
    let squares: f64 = others.iter().map(|other| apart_m(&driven.poses, other).powi(2)).sum();
    Ok(Gap {
        course: course.name().to_owned(),
        speed_m_per_s,
        before_m: ahead_m(&nominal)?,
        named_m: ahead_m(named)?,
        after_m: ahead_m(with)?,
        repeatability_m: (squares / others.len() as f64).sqrt(),
    })
}
