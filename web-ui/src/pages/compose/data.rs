//! What the Compose page shows.

use crate::arena_view::{Ink, Scene, SceneRobot, Shape, Trail};
use crate::course::courses;
use crate::error_measure::{pose_at, robot};
use crate::pages::{notes, words};
use crate::state::{State, Submission, TwinResult, TwinStatus};
use crate::theme::{self, Tone};
use api::problem::FieldProblem;
use api::verdict::Finding;

/// The floor: paths, what the twin drove, targets, start poses, and the robots at the moment of the playback.
pub fn scene(state: &State) -> Scene {
    let compose = &state.compose;
    let experiment = &compose.experiment;
    let mut scene = Scene::of_arena(state.lab.arena_or_reference(&experiment.arena));
    let courses = courses(experiment, &state.lab).into_iter();
    scene.paths = courses.flatten().map(|course| course.line).collect();
    let current = matches!(compose.twin.status, TwinStatus::Done);
    let result = compose.twin.result.as_ref();
    for (index, named) in experiment.robots.iter().enumerate() {
        let start = [named.start.x_m, named.start.y_m, named.start.yaw_rad];
        let shape = Shape::of(state.lab.robot(&named.name).map(|r| &r.description));
        let driven = result.and_then(|r| robot(&r.replay, &named.name));
        if let Some(driven) = driven {
            let points = driven.poses.iter().map(|p| [p[0], p[1]]).collect();
            scene.trails.push(Trail {
                points,
                ink: Ink::Robot(index),
                dashed: false,
                faint: !current,
            });
        }
        let period_s = result.map_or(0.0, |r| r.replay.period_s);
        let moving = driven.filter(|_| current && compose.playback.time_s > 0.0);
        let now = moving.and_then(|d| pose_at(d, period_s, compose.playback.time_s));
        if now.is_some() {
            scene.robots.push(SceneRobot {
                name: named.name.clone(),
                pose: start,
                shape: shape.clone(),
                ink: Ink::Robot(index),
                ghost: true,
                show_name: false,
                mark: None,
            });
        }
        let pose = now.unwrap_or(start);
        scene.robots.push(SceneRobot {
            name: named.name.clone(),
            pose,
            shape,
            ink: Ink::Robot(index),
            ghost: false,
            show_name: true,
            mark: None,
        });
    }
    scene.add_targets(experiment);
    if let Some(result) = result.filter(|_| current) {
        scene.drawings = notes::drawings_at(&result.replay.notes, compose.playback.time_s);
    }
    scene
}

/// What stands in the strip below the arena.
#[derive(Debug, Clone, PartialEq)]
pub struct Strip {
    pub tone: Tone,
    pub word: &'static str,
    pub sentence: String,
    pub details: String,
    /// 0 to 1 while the twin drives.
    pub progress: Option<f64>,
    pub findings: Vec<FindingLine>,
    pub problems: Vec<ProblemLine>,
}

#[derive(Debug, Clone, PartialEq)]
pub struct FindingLine {
    pub at_s: f64,
    pub tone: Tone,
    pub text: String,
}

#[derive(Debug, Clone, PartialEq)]
pub struct ProblemLine {
    pub field: String,
    pub text: String,
}

impl Strip {
    fn new(tone: Tone, word: &'static str, sentence: impl Into<String>) -> Self {
        Self {
            tone,
            word,
            sentence: sentence.into(),
            details: String::new(),
            progress: None,
            findings: Vec::new(),
            problems: Vec::new(),
        }
    }
}

pub fn strip(state: &State) -> Strip {
    let twin = &state.compose.twin;
    let strip = match (&twin.status, &twin.result) {
        (TwinStatus::Idle | TwinStatus::Waiting { .. }, _) => Strip {
            progress: Some(0.0),
            ..Strip::new(Tone::Active, "Twin", "Waiting for your next change \u{2026}")
        },
        (TwinStatus::Running { fraction }, _) => {
            let percent = (fraction * 100.0).round();
            Strip {
                progress: Some(*fraction),
                ..Strip::new(
                    Tone::Active,
                    "Twin",
                    format!("The twin drives the experiment \u{2026} {percent:.0} %"),
                )
            }
        }
        (TwinStatus::Problems(problems), _) => {
            let count = problems.len();
            let sentence = if count == 1 {
                "One field needs attention.".to_owned()
            } else {
                format!("{count} fields need attention.")
            };
            Strip {
                problems: problem_lines(problems),
                ..Strip::new(Tone::Error, "Not valid", sentence)
            }
        }
        (TwinStatus::Failed(message), _) => Strip {
            details: "Change something to try again, or reload the page.".to_owned(),
            ..Strip::new(Tone::Error, "Twin stopped", words::full_stop(message))
        },
        (TwinStatus::Done, Some(result)) => verdict(result),
        (TwinStatus::Done, None) => Strip::new(Tone::Neutral, "Twin", "No result."),
    };
    with_refusal(strip, &state.compose.submission)
}

fn verdict(result: &TwinResult) -> Strip {
    let verdict = &result.verdict;
    let warned = verdict.findings.iter().any(|f| f.severity != "error");
    let (tone, word) = match (verdict.accepted, warned) {
        (true, false) => (Tone::Good, "Accepted"),
        (true, true) => (Tone::Warning, "Accepted, with a warning"),
        (false, _) => (Tone::Error, "Rejected"),
    };
    Strip {
        details: words::verdict_figures(verdict),
        findings: verdict.findings.iter().map(finding_line).collect(),
        ..Strip::new(tone, word, words::full_stop(without_verdict(&verdict.sentence)))
    }
}

/// The sentence beside a box that says accepted or rejected already.
fn without_verdict(sentence: &str) -> &str {
    ["Accepted: ", "Rejected: "]
        .into_iter()
        .find_map(|word| sentence.strip_prefix(word))
        .unwrap_or(sentence)
}

fn finding_line(finding: &Finding) -> FindingLine {
    FindingLine {
        at_s: finding.at_s,
        tone: words::finding_tone(finding),
        text: words::finding(finding),
    }
}

fn problem_lines(problems: &[FieldProblem]) -> Vec<ProblemLine> {
    problems
        .iter()
        .map(|p| {
            let remedy = if p.remedy.is_empty() {
                String::new()
            } else {
                format!(" Remedy: {}", words::ended(&p.remedy))
            };
            let limit = if p.limit.is_empty() {
                String::new()
            } else {
                format!(" Allowed: {}", words::ended(&p.limit))
            };
            ProblemLine {
                field: words::field(&p.field),
                text: format!("{}{limit}{remedy}", words::full_stop(&p.message)),
            }
        })
        .collect()
}

/// A refused submission outranks the verdict until something changes.
fn with_refusal(strip: Strip, submission: &Submission) -> Strip {
    match submission {
        Submission::Refused(refusal) => Strip {
            tone: Tone::Error,
            word: "Not submitted",
            sentence: refusal.sentence.clone(),
            problems: problem_lines(&refusal.problems),
            ..strip
        },
        _ => strip,
    }
}

/// Which model version every robot's twin drives with; none before the server has told which are in use.
pub fn models(state: &State) -> Option<String> {
    let experiment = &state.compose.experiment;
    if let Some(named) = &experiment.model {
        return Some(format!("Twins drive with the model that the document names: {named}."));
    }
    state.lab.models.as_ref()?;
    let models = crate::scenario::models_of(experiment, &state.lab);
    let learned: Vec<String> = experiment
        .robots
        .iter()
        .filter_map(|robot| Some((robot, models.get(robot.name.as_str())?)))
        .map(|(robot, model)| {
            format!(
                "twin of {}: version {}, made on {}",
                robot.name, model.version, model.floor
            )
        })
        .collect();
    let nominal = experiment.robots.len() - learned.len();
    let text = match (learned.is_empty(), nominal) {
        (true, 1) => format!(
            "twin of {}: nominal, no version is in use on {}",
            experiment.robots[0].name, experiment.floor
        ),
        (true, _) => format!("all twins nominal: no version is in use on {}", experiment.floor),
        (false, 0) => learned.join("; "),
        (false, 1) => format!("{}; the other robot's twin is nominal", learned.join("; ")),
        (false, many) => format!("{}; the other {many} twins are nominal", learned.join("; ")),
    };
    Some(crate::pages::words::full_stop(&text))
}

/// The twin's identity, for comparing with the server's.
pub fn twin_identity(state: &State) -> Option<String> {
    let result = state
        .compose
        .twin
        .result
        .as_ref()
        .filter(|_| state.compose.twin.status == TwinStatus::Done)?;
    Some(format!(
        "Trace digest {} by {}. The server computes it again and compares it bit for bit.",
        theme::short(&result.digest),
        result.twin_version
    ))
}
