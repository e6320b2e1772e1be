//! Runs beside the one that is shown: which, their measured tracks, and what follows from them.

use super::run::{FILE_RETRY_S, TRACK_FILE, has_file};
use crate::command::Request;
use crate::correction::Correction;
use crate::course::{courses, scenario_of};
use crate::error_measure::robot;
use crate::parameters;
use crate::state::{Page, Recording, RunSide, State, TRACKS_MAX};
use crate::tracking::Tracking;
use api::experiment::{Experiment, Mode};
use api::run::{RunState, RunView};
use std::collections::BTreeSet;
use uuid::Uuid;

/// Longest drive of the ideal robot, s; none of a path takes longer.
const IDEAL_LONGEST_S: f64 = 180.0;

/// What two runs have in common that can be held against each other.
#[derive(Debug, PartialEq, Eq)]
struct Way {
    robot: String,
    chassis: String,
    law: String,
    speed_mm_per_s: i64,
    /// Start and targets.
    points_mm: Vec<[i64; 2]>,
    arena: String,
    floor: String,
    /// The twin alone is not held against a robot.
    is_virtual: bool,
}

impl Way {
    /// `None` for laws without a path, and with several robots.
    fn of(experiment: &Experiment) -> Option<Self> {
        let law = &experiment.control.law;
        let leads = [control::law::WAYPOINTS, control::law::PATH_FOLLOWING].contains(&law.as_str());
        let [robot] = experiment.robots.as_slice() else {
            return None;
        };
        if !leads || experiment.targets.is_empty() {
            return None;
        }
        let millimetres = |value_m: f64| (value_m * 1000.0).round() as i64;
        let speed = parameters::specs(law).iter().find(|spec| spec.key == "speed_m_per_s")?;
        let start = [robot.start.x_m, robot.start.y_m];
        let targets = experiment.targets.iter().map(|target| [target.x_m, target.y_m]);
        let points = std::iter::once(start).chain(targets);
        Some(Self {
            robot: robot.name.clone(),
            chassis: robot.chassis.clone(),
            law: law.clone(),
            speed_mm_per_s: millimetres(parameters::value(experiment, speed)),
            points_mm: points.map(|point| point.map(millimetres)).collect(),
            arena: experiment.arena.clone(),
            floor: experiment.floor.clone(),
            is_virtual: experiment.mode == Mode::Virtual,
        })
    }
}

/// Whether a run leads one robot along a path, so that there is something to hold against other runs.
pub fn leads_along_a_path(view: &RunView) -> bool {
    Way::of(&view.experiment).is_some()
}

/// The run that is shown, then finished runs of the same robot along the same path at the same speed, newest first; empty when
/// the run has no path. The newest one under feedback alone is always among them.
pub fn peers(state: &State) -> Vec<&RunView> {
    let Some(shown) = &state.run.view else {
        return Vec::new();
    };
    let Some(way) = Way::of(&shown.experiment) else {
        return Vec::new();
    };
    let runs = state.queue.runs.iter().flatten();
    let others: Vec<&RunView> = runs
        .filter(|run| run.id != shown.id && run.state == RunState::Done && has_file(run, TRACK_FILE))
        .filter(|run| Way::of(&run.experiment).as_ref() == Some(&way))
        .collect();
    let mut peers: Vec<&RunView> = std::iter::once(shown).chain(others.iter().copied()).collect();
    peers.truncate(TRACKS_MAX);
    let is_alone = |run: &&RunView| Correction::of(&run.experiment) == Correction::Nothing;
    if !peers.iter().any(is_alone)
        && let Some(alone) = others.into_iter().find(|run| is_alone(run))
    {
        peers.pop();
        peers.push(alone);
    }
    peers
}

/// Tracks of the other runs that are still missing.
pub fn wanted(state: &State) -> Vec<(Request, f64)> {
    if state.page != Page::Run {
        return Vec::new();
    }
    let missing = |run: &&RunView| !state.comparison.tracks.contains_key(&run.id);
    let others = peers(state).into_iter().skip(1).filter(missing);
    others.map(|run| (Request::Track(run.id), FILE_RETRY_S)).collect()
}

/// Keeps a track that arrived.
pub fn track_answered(state: &mut State, id: Uuid, recording: Recording) {
    state.comparison.found.remove(&id);
    state.comparison.tracks.insert(id, recording);
}

/// Forgets runs along other paths, and computes what follows from one more track.
pub fn advance(state: &mut State) {
    if state.page != Page::Run || state.lab.robots.is_none() {
        return;
    }
    let kept: BTreeSet<Uuid> = peers(state).into_iter().map(|run| run.id).collect();
    let comparison = &mut state.comparison;
    comparison.tracks.retain(|id, _| kept.contains(id));
    comparison.found.retain(|id, _| kept.contains(id));
    let due = |run: &&RunView| {
        let here = state.comparison.tracks.get(&run.id).and_then(Recording::replay);
        here.is_some() && !state.comparison.found.contains_key(&run.id)
    };
    let next = peers(state).into_iter().find(due);
    let Some((id, tracking)) = next.map(|run| (run.id, tracking(state, run))) else {
        return;
    };
    state.comparison.found.insert(id, tracking);
}

fn tracking(state: &State, run: &RunView) -> Option<Tracking> {
    let replay = state.comparison.tracks.get(&run.id)?.replay()?;
    let only = run.experiment.robots.first()?;
    let course = courses(&run.experiment, &state.lab).into_iter().next()??;
    let scenario = scenario_of(&run.experiment, &state.lab)?;
    let longest_s = run.experiment.duration_s.min(IDEAL_LONGEST_S);
    let ideal = control::ideal::drive(&scenario, longest_s).ok().flatten();
    Tracking::new(&course, ideal.as_ref(), robot(replay, &only.name)?, replay.period_s)
}

pub fn show_side(state: &mut State, side: RunSide) {
    state.comparison.side = side;
}
