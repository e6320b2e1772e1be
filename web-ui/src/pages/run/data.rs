//! What the Run page shows.

use crate::arena_view::{Ink, Scene, SceneRobot, Shape, Trail};
use crate::course::{Course, courses};
use crate::error_measure::{BAND_M, gap_m, pose_at, robot};
use crate::net;
use crate::pages::{notes, words};
use crate::state::{Recording, State};
use crate::theme::{self, Tone};
use api::live::LiveFrame;
use api::note::TickNotes;
use api::run::RunView;
use api::verdict::{Replay, ReplayRobot};
use std::borrow::Cow;
use std::collections::{BTreeMap, VecDeque};

pub type Facts = Vec<(String, String)>;

/// What was measured: the uploaded track, or else the live pictures that this page received.
pub fn physical(state: &State) -> Option<(Cow<'_, Replay>, bool)> {
    if let Some(replay) = state.run.physical.replay() {
        return Some((Cow::Borrowed(replay), true));
    }
    let same = state.live.run.is_some() && state.live.run == state.run.selected;
    same.then(|| replay_of_live(&state.live.frames))
        .flatten()
        .map(|replay| (Cow::Owned(replay), false))
}

/// Live pictures on the even time grid of a replay (30 Hz); the newest picture at or before each moment.
fn replay_of_live(frames: &VecDeque<LiveFrame>) -> Option<Replay> {
    const PERIOD_S: f64 = 1.0 / 30.0;
    let moving: Vec<&LiveFrame> = frames.iter().filter(|f| f.tick >= 0).collect();
    let (first, last) = (moving.first()?, moving.last()?);
    let mut robots: BTreeMap<&str, ReplayRobot> = first
        .robots
        .iter()
        .map(|r| {
            (
                r.name.as_str(),
                ReplayRobot {
                    name: r.name.clone(),
                    poses: Vec::new(),
                    targets: Vec::new(),
                },
            )
        })
        .collect();
    let count = (last.time_s.min(3600.0) / PERIOD_S).floor() as usize + 1;
    let mut at = 0;
    for step in 0..count {
        let time_s = step as f64 * PERIOD_S;
        while at + 1 < moving.len() && moving[at + 1].time_s <= time_s + 1e-9 {
            at += 1;
        }
        for live in &moving[at].robots {
            if let Some(robot) = robots.get_mut(live.name.as_str()) {
                robot.poses.push([live.x_m, live.y_m, live.yaw_rad]);
                robot.targets.push([live.target_x_m, live.target_y_m]);
            }
        }
    }
    let robots = first
        .robots
        .iter()
        .filter_map(|r| robots.remove(r.name.as_str()))
        .collect();
    Some(Replay {
        format: "robopheus.replay/1".to_owned(),
        period_s: PERIOD_S,
        robots,
        notes: Vec::new(),
    })
}

/// Measured (solid) and twin (dashed) on one floor, both at the moment of the playback.
pub fn scene(state: &State, view: &RunView) -> Scene {
    let experiment = &view.experiment;
    let mut scene = Scene::of_arena(state.lab.arena_or_reference(&experiment.arena));
    let courses = courses(experiment, &state.lab).into_iter();
    scene.paths = courses.flatten().map(|course| course.line).collect();
    scene.add_targets(experiment);
    let measured = physical(state);
    let time_s = state.run.playback.time_s;
    scene.drawings = notes::drawings_at(controller_notes(state).0, time_s);
    for (index, named) in experiment.robots.iter().enumerate() {
        let shape = Shape::of(state.lab.robot(&named.name).map(|r| &r.description));
        let sources = [
            (state.run.twin.replay(), true),
            (measured.as_ref().map(|(replay, _)| replay.as_ref()), false),
        ];
        for (replay, twin) in sources {
            let Some((recorded, period_s)) = replay.and_then(|r| Some((robot(r, &named.name)?, r.period_s))) else {
                continue;
            };
            let ink = if twin { Ink::Twin } else { Ink::Robot(index) };
            scene.trails.push(Trail {
                points: recorded.poses.iter().map(|p| [p[0], p[1]]).collect(),
                ink,
                dashed: twin,
                faint: false,
            });
            if let Some(pose) = pose_at(recorded, period_s, time_s) {
                scene.robots.push(SceneRobot {
                    name: named.name.clone(),
                    pose,
                    shape: shape.clone(),
                    ink,
                    ghost: twin,
                    show_name: !twin,
                    mark: None,
                });
            }
        }
    }
    scene
}

/// What the run's own controller said and drew: on the robots, or else in the service's rehearsal.
pub fn controller_notes(state: &State) -> (&[TickNotes], &'static str) {
    let of = |recording: &'_ Recording| recording.replay().map(|replay| !replay.notes.is_empty()) == Some(true);
    let run = &state.run;
    let chosen = if of(&run.physical) { &run.physical } else { &run.twin };
    let source = if of(&run.physical) { "in the run" } else { "in the twin" };
    (chosen.replay().map_or(&[], |replay| &replay.notes), source)
}

/// A line of the error plot.
#[derive(Debug, Clone, PartialEq)]
pub struct Series {
    pub name: String,
    pub ink: Ink,
    pub dashed: bool,
    /// `[time_s, millimetres]`.
    pub points: Vec<[f64; 2]>,
}

/// Distance of measured and twin to the path, and to each other, over time.
pub fn series(state: &State, view: &RunView) -> Vec<Series> {
    let mut series = Vec::new();
    let measured = physical(state);
    let single = view.experiment.robots.len() == 1;
    let courses = courses(&view.experiment, &state.lab);
    for ((index, named), course) in view.experiment.robots.iter().enumerate().zip(&courses) {
        let title = |what: &str| {
            if single {
                what.to_owned()
            } else {
                format!("{}: {}", named.name, what.to_lowercase())
            }
        };
        let twin = state
            .run
            .twin
            .replay()
            .and_then(|r| Some((robot(r, &named.name)?, r.period_s)));
        let real = measured
            .as_ref()
            .and_then(|(r, _)| Some((robot(r, &named.name)?, r.period_s)));
        if let Some(course) = course {
            for (recorded, ink, dashed, what) in [
                (twin, Ink::Twin, true, "Twin to path"),
                (real, Ink::Robot(index), false, "Measured to path"),
            ] {
                if let Some((recorded, period_s)) = recorded {
                    series.push(Series {
                        name: title(what),
                        ink,
                        dashed,
                        points: to_path(course, recorded, period_s),
                    });
                }
            }
        }
        if let (Some(real), Some(twin)) = (real, twin) {
            let points = gap_m(real, twin).into_iter().map(|[t, m]| [t, m * 1000.0]).collect();
            let ink = if single { Ink::Neutral } else { Ink::Robot(index) };
            series.push(Series {
                name: title("Twin to measured"),
                ink,
                dashed: false,
                points,
            });
        }
    }
    series
}

fn to_path(course: &Course, recorded: &ReplayRobot, period_s: f64) -> Vec<[f64; 2]> {
    let (errors_m, _) = course.errors_m(recorded.poses.iter().map(|p| [p[0], p[1]]));
    errors_m
        .into_iter()
        .enumerate()
        .map(|(frame, error_m)| [frame as f64 * period_s, error_m * 1000.0])
        .collect()
}

/// The band belongs to a path; without one only the gap is shown.
pub fn has_path(state: &State, view: &RunView) -> bool {
    courses(&view.experiment, &state.lab).iter().any(Option::is_some)
}

pub const fn band_mm() -> f64 {
    BAND_M * 1000.0
}

/// The largest and the RMS value of a series, for the list beside the plot.
pub fn largest_and_rms_mm(points: &[[f64; 2]]) -> Option<(f64, f64)> {
    let largest = points.iter().map(|p| p[1]).reduce(f64::max)?;
    let mean_square = points.iter().map(|p| p[1] * p[1]).sum::<f64>() / points.len() as f64;
    Some((largest, mean_square.sqrt()))
}

pub fn facts(state: &State, view: &RunView) -> Facts {
    let now = state.clock.utc;
    let mut facts = vec![
        (
            "Submitted".to_owned(),
            format!("{} by {}", theme::relative(view.created_at, now), view.submitted_by),
        ),
        (
            "Robots".to_owned(),
            view.experiment
                .robots
                .iter()
                .map(|r| r.name.as_str())
                .collect::<Vec<_>>()
                .join(", "),
        ),
    ];
    if let (Some(from), to) = (view.started_at, view.ended_at) {
        let length_s = (to.unwrap_or(now) - from).num_milliseconds() as f64 / 1000.0;
        let suffix = if to.is_some() { "" } else { " so far" };
        facts.push((
            "On the floor".to_owned(),
            format!("{}{suffix}", theme::seconds(length_s.max(0.0))),
        ));
    }
    if !view.state.is_terminal() {
        if let Some(reason) = &view.waiting_reason {
            facts.push(("Waiting".to_owned(), words::full_stop(reason)));
        }
        if let Some(position) = view.queue_position {
            facts.push(("Place in queue".to_owned(), position.to_string()));
        }
    }
    if let Some(recorded) = view.ticks_recorded {
        let seconds = theme::seconds(recorded as f64 / f64::from(api::CONTROL_HZ));
        let missed = view
            .ticks_missed
            .map_or_else(String::new, |missed| format!(", {missed} missed"));
        facts.push((
            "Control ticks".to_owned(),
            format!("{recorded} recorded ({seconds}){missed}"),
        ));
    }
    if view.epoch > 0 {
        facts.push(("Attempt".to_owned(), format!("epoch {}", view.epoch)));
    }
    facts
}

/// The verdict's moments, for jumping there.
pub fn findings(view: &RunView) -> Vec<(f64, Tone, String)> {
    view.verdict
        .iter()
        .flat_map(|v| &v.findings)
        .map(|f| (f.at_s, words::finding_tone(f), words::finding(f)))
        .collect()
}

/// Whether both twins agree, and who they are.
pub fn digest(view: &RunView) -> (String, Tone, Facts) {
    let digest = &view.digest;
    let (sentence, tone) = match digest.equal {
        Some(true) => ("Equal: your twin and the server's agree bit for bit.", Tone::Good),
        Some(false) => ("Different: your twin and the server's do not agree.", Tone::Error),
        None if digest.claimed.is_none() && digest.server.is_some() => {
            ("The submitter sent no digest to compare with.", Tone::Neutral)
        }
        None => ("Not compared yet.", Tone::Neutral),
    };
    let line = |digest: &Option<String>, version: &Option<String>| match (digest, version) {
        (Some(digest), Some(version)) => format!("{}\u{2026} by {version}", theme::short(digest)),
        (Some(digest), None) => format!("{}\u{2026}", theme::short(digest)),
        (None, _) => "not known".to_owned(),
    };
    let facts = vec![
        (
            "Submitter".to_owned(),
            line(&digest.claimed, &digest.claimed_twin_version),
        ),
        ("Server".to_owned(), line(&digest.server, &digest.server_twin_version)),
    ];
    (sentence.to_owned(), tone, facts)
}

#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Download {
    /// As in the archive.
    pub name: String,
    pub size: String,
    pub url: String,
    pub file_name: String,
}

/// Everything in one zip; there is one as soon as the run is over and something was kept.
pub fn archive(view: &RunView) -> Option<Download> {
    (view.state.is_terminal() && !view.files.is_empty()).then(|| Download {
        name: "archive.zip".to_owned(),
        size: theme::bytes(view.files.iter().map(|f| f.bytes).sum()),
        url: net::archive_url(view.id),
        file_name: format!("robopheus-{}.zip", view.id),
    })
}

pub fn files(view: &RunView) -> Vec<Download> {
    view.files
        .iter()
        .filter(|f| f.name != "archive.zip")
        .map(|f| Download {
            name: f.name.clone(),
            size: theme::bytes(f.bytes),
            url: net::file_url(view.id, &f.name),
            file_name: f.name.rsplit('/').next().unwrap_or(&f.name).to_owned(),
        })
        .collect()
}

/// What is missing in the picture and why; nothing when all is there.
pub fn picture_notes(state: &State) -> Vec<String> {
    let mut notes = Vec::new();
    let twin = match &state.run.twin {
        Recording::Here(_) => None,
        Recording::Loading => Some("Loading the twin's replay \u{2026}".to_owned()),
        Recording::Missing(why) => Some(why.clone()),
        Recording::Unknown => Some("The twin's replay is not there yet.".to_owned()),
    };
    let measured = match (&state.run.physical, physical(state)) {
        (Recording::Here(_), _) => None,
        (_, Some(_)) => {
            Some("Measured motion as received live; the recorded track follows after the upload.".to_owned())
        }
        (Recording::Loading, None) => Some("Loading the measured track \u{2026}".to_owned()),
        (Recording::Missing(why), None) => Some(why.clone()),
        (Recording::Unknown, None) => Some("Nothing was measured yet.".to_owned()),
    };
    notes.extend(twin);
    notes.extend(measured);
    notes
}
