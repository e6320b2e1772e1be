//! One run on the emulated plant, on the twin, or of the ideal robot.

use super::course::{Course, Setting, pieces};
use crate::{LightSettings, Rig, RigSettings};
use anyhow::{Result, anyhow, ensure};
use control::ideal::Ideal;
use control::interaction::Settings;
use control::path_error::PathError;
use control::rehearsal::Rehearsal;
use control::scenario::Scenario;
use control::team::Team;
use emulator::hidden::Hidden;
use lab::record::Record;
use twin::robot::Robot;

const TICK_HZ: f64 = 120.0;
/// Half width of the paper's band.
pub const BAND_M: f64 = 0.075;

/// Who corrects the commands.
#[derive(Debug, Clone)]
pub enum Correction {
    /// Nobody: the law sees poses as they were measured.
    Plain,
    /// Delay compensation alone.
    LookAhead,
    /// Delay compensation and the share of the yaw rate that a robot turns, learnt during the run: what a laboratory does.
    Usual,
    /// Interaction with this model.
    Model(Box<Robot>, Settings),
}

/// Figures of a run.
#[derive(Debug, Clone, Default, serde::Serialize)]
pub struct Figures {
    pub rms_m: f64,
    pub largest_m: f64,
    /// Against the ideal robot under the same law, at the same time.
    pub time_rms_m: Option<f64>,
    pub seconds: f64,
    /// Came to the end of its path.
    pub finished: bool,
    /// Share of the ticks in which the model corrected.
    pub corrected: f64,
}

impl Figures {
    pub fn inside(&self) -> bool {
        self.finished && self.largest_m <= BAND_M
    }
}

/// A run and what was seen of it.
#[derive(Debug)]
pub struct Driven {
    pub figures: Figures,
    /// True poses, a tick apart.
    pub poses: Vec<[f64; 3]>,
    pub records: Vec<Record>,
    pub begin_us: i64,
}

/// A course on the emulated plant.
///
/// - `seed`: of the plant's variation, and of all errors and delays.
pub fn on_plant(
    chassis: &str,
    course: Course,
    setting: &Setting,
    hidden: &Hidden,
    seed: u64,
    correction: &Correction,
) -> Result<Driven> {
    let scene = course.scene(chassis, setting)?;
    let scenario = scene.scenario()?;
    let settings = RigSettings {
        looks_ahead: !matches!(correction, Correction::Plain),
        learns: matches!(correction, Correction::Usual | Correction::Model(..)),
        ..plant_settings(hidden, seed)
    };
    let mut team = Team::new(&scenario).map_err(|problems| anyhow!("{problems:?}"))?;
    if let Correction::Model(model, settings) = correction {
        team = team.with_interaction(std::slice::from_ref(&**model), *settings);
    }
    let mut rig = Rig::with_team(&scene, &settings, &scenario, team)?;
    let begin_us = rig.now_us();
    let mut tally = Tally::new(&scenario);
    let mut poses = Vec::new();
    let mut corrected = 0.0;
    loop {
        let pose = *rig.poses().first().ok_or_else(|| anyhow!("no robot"))?;
        poses.push(pose);
        tally.add([pose[0], pose[1]]);
        let more = rig.tick();
        let interactions = rig.pilot().team().interactions();
        corrected += f64::from(u8::from(interactions.iter().any(|one| one.is_active())));
        if !more || rig.slot() as f64 > 95.0 * TICK_HZ {
            break;
        }
    }
    let finished = rig.ended() == Some(lab::safety::Ending::Finished);
    let mut figures = tally.figures(finished);
    figures.corrected = corrected / poses.len() as f64;
    Ok(Driven {
        figures,
        poses,
        records: std::mem::take(&mut rig.records),
        begin_us,
    })
}

/// A quiet laboratory around this plant. Errors are told in the frame of its localisation, as the paper's are: a constant offset
/// of that frame, which nobody in the laboratory could see, is left out.
pub fn plant_settings(hidden: &Hidden, seed: u64) -> RigSettings {
    RigSettings {
        seed,
        hidden: hidden.clone(),
        light: LightSettings {
            bias_m: 0.0,
            ..LightSettings::default()
        },
        phase: (seed % 4) as i64,
        ..RigSettings::default()
    }
}

/// A course on the twin.
pub fn on_twin(chassis: &str, course: Course, setting: &Setting) -> Result<Figures> {
    let scene = course.scene(chassis, setting)?;
    let scenario = scene.scenario()?;
    let mut rehearsal = Rehearsal::new(&scenario).map_err(|problems| anyhow!("{problems:?}"))?;
    let mut tally = Tally::new(&scenario);
    while rehearsal.step() {
        let pose = rehearsal.state(0).pose;
        tally.add([pose.x_m, pose.y_m]);
    }
    ensure!(!rehearsal.is_broken(), "the twin left finite numbers");
    let finished = rehearsal.outputs().iter().all(|out| out.finished);
    Ok(tally.figures(finished))
}

/// The ideal robot on a course.
pub fn ideal(chassis: &str, course: Course, setting: &Setting) -> Result<(Figures, Ideal)> {
    let scenario = course.scene(chassis, setting)?.scenario()?;
    let ideal = control::ideal::drive(&scenario, 90.0).map_err(|problems| anyhow!("{problems:?}"))?;
    let ideal = ideal.ok_or_else(|| anyhow!("no law"))?;
    let mut tally = Tally::new(&scenario);
    ideal.poses.iter().for_each(|pose| tally.add([pose[0], pose[1]]));
    Ok((tally.figures(ideal.finished), ideal))
}

/// Sums of a run.
struct Tally {
    error: PathError,
    squares_m2: f64,
    largest_m: f64,
    ticks: f64,
}

impl Tally {
    fn new(scenario: &Scenario) -> Self {
        Self {
            error: PathError::new(&pieces(scenario)),
            squares_m2: 0.0,
            largest_m: 0.0,
            ticks: 0.0,
        }
    }

    fn add(&mut self, here_m: [f64; 2]) {
        let error_m = self.error.at(here_m);
        self.squares_m2 += error_m * error_m;
        self.largest_m = self.largest_m.max(error_m);
        self.ticks += 1.0;
    }

    fn figures(&self, finished: bool) -> Figures {
        Figures {
            rms_m: (self.squares_m2 / self.ticks.max(1.0)).sqrt(),
            largest_m: self.largest_m,
            time_rms_m: None,
            seconds: self.ticks / TICK_HZ,
            finished: finished && self.error.is_last(),
            corrected: 0.0,
        }
    }
}
