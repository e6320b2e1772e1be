//! Plain data: everything the dashboard knows. Only `update/` changes it.

mod comparison;
mod program;
mod template;

pub use comparison::{Comparison, RunSide, TRACKS_MAX};
pub use program::{Mistake, ModuleFile, Program, Side};
pub use template::Template;

use crate::command::Request;
use crate::report::Report;
use api::arena::{Arena, ArenaView};
use api::comparison::ComparisonView;
use api::diagnosis::DiagnosisView;
use api::experiment::Experiment;
use api::lab::LabDescription;
use api::live::LiveFrame;
use api::model::{ModelView, RobotGaps, RobotModel};
use api::note::Note;
use api::problem::FieldProblem;
use api::robot::{LabRobot, RobotView};
use api::run::{RunState, RunView};
use api::verdict::{Replay, Verdict};
use chrono::{DateTime, Utc};
use std::collections::{BTreeMap, BTreeSet, VecDeque};
use uuid::Uuid;

/// Position in `experiment.robots`.
pub type RobotIndex = usize;
/// Position in `experiment.targets`.
pub type TargetIndex = usize;

#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Page {
    Compose,
    Queue,
    Live,
    Run,
    Robots,
    Gap,
    Models,
}

impl Page {
    /// In the order of the keys 1 to 7.
    pub const ALL: [Self; 7] = [
        Self::Compose,
        Self::Queue,
        Self::Live,
        Self::Run,
        Self::Robots,
        Self::Gap,
        Self::Models,
    ];

    pub const fn name(self) -> &'static str {
        match self {
            Self::Compose => "compose",
            Self::Queue => "queue",
            Self::Live => "live",
            Self::Run => "run",
            Self::Robots => "robots",
            Self::Gap => "gap",
            Self::Models => "models",
        }
    }

    pub const fn title(self) -> &'static str {
        match self {
            Self::Compose => "Compose",
            Self::Queue => "Queue",
            Self::Live => "Live",
            Self::Run => "Run",
            Self::Robots => "Robots",
            Self::Gap => "Gap",
            Self::Models => "Models",
        }
    }
}

/// Time as the update functions see it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Clock {
    /// Seconds since the page was opened; grows steadily.
    pub time_s: f64,
    pub utc: DateTime<Utc>,
}

#[derive(Debug, Clone)]
pub struct State {
    pub page: Page,
    pub dark: bool,
    pub clock: Clock,
    pub service: Service,
    pub lab: Lab,
    pub compose: Compose,
    pub queue: Queue,
    pub live: Live,
    pub run: Run,
    pub comparison: Comparison,
    pub gap: Gap,
    pub models: Models,
    pub toasts: VecDeque<Toast>,
    pub next_toast: u64,
    /// The last message that was shown as an error.
    pub last_error: Option<String>,
}

/// The link to the REST interface.
#[derive(Debug, Clone, Default)]
pub struct Service {
    /// `None` until the first answer or failure.
    pub reachable: Option<bool>,
    /// Calls under way, with the moment they were sent.
    pub pending_since_s: BTreeMap<Request, f64>,
    /// When each repeated call was sent last.
    pub asked_at_s: BTreeMap<Request, f64>,
}

/// Robots and arena that experiments can use.
#[derive(Debug, Clone)]
pub struct Lab {
    /// From the server; `None` until it answered.
    pub robots: Option<Vec<RobotView>>,
    pub arenas: Option<Vec<ArenaView>>,
    /// Models that robots use now; `None` until the server answered.
    pub models: Option<Vec<ModelView>>,
    /// The reference laboratory, used until the server has told its own.
    pub reference: LabDescription,
}

impl Lab {
    /// Description of a robot by name.
    pub fn robot(&self, name: &str) -> Option<&LabRobot> {
        match self.robots.as_deref() {
            Some(robots) if !robots.is_empty() => robots.iter().find(|r| r.name == name).map(|r| &r.robot),
            _ => self.reference.robots.iter().find(|r| r.description.name == name),
        }
    }

    /// Robots of an arena with their names, in the order of their numbers; the reference laboratory's until the server has told its own.
    pub fn robots_in(&self, arena: &str) -> Vec<(&str, &LabRobot)> {
        let mut found: Vec<(&str, &LabRobot)> = match self.robots.as_deref() {
            Some(robots) if !robots.is_empty() => {
                let here = robots.iter().filter(|robot| robot.arena == arena);
                here.map(|robot| (robot.name.as_str(), &robot.robot)).collect()
            }
            _ => {
                let robots = self.reference.robots.iter();
                robots.map(|robot| (robot.description.name.as_str(), robot)).collect()
            }
        };
        found.sort_by_key(|(_, robot)| robot.number);
        found
    }

    /// Pages of the laboratories' protective stops, each once.
    pub fn stop_pages(&self) -> impl Iterator<Item = &str> {
        let pages: BTreeSet<&str> = self
            .arenas
            .iter()
            .flatten()
            .filter_map(|arena| arena.stop_url.as_deref())
            .collect();
        pages.into_iter()
    }

    /// Page of a laboratory whose protective stop is pressed.
    pub fn stopped(&self) -> Option<&str> {
        let arenas = self.arenas.iter().flatten();
        arenas
            .filter(|arena| arena.stopped)
            .find_map(|arena| arena.stop_url.as_deref())
    }

    pub fn arena(&self, name: &str) -> Option<&Arena> {
        self.arenas
            .as_deref()
            .and_then(|arenas| arenas.iter().map(|a| &a.arena).find(|a| a.name == name))
            .or_else(|| (self.reference.arena.name == name).then_some(&self.reference.arena))
    }

    /// The arena to draw when an experiment names none that is known.
    pub fn arena_or_reference(&self, name: &str) -> &Arena {
        self.arena(name).unwrap_or(&self.reference.arena)
    }
}

#[derive(Debug, Clone)]
pub struct Compose {
    pub template: Template,
    /// Changed by hand since the template was chosen.
    pub edited: bool,
    pub experiment: Experiment,
    pub label: String,
    pub program: Program,
    pub twin: Twin,
    pub playback: Playback,
    pub submission: Submission,
    /// Base of the idempotency keys of this page.
    pub session: Uuid,
    /// Counts documents: a repeated attempt for the same document keeps its key.
    pub document_number: u32,
}

#[derive(Debug, Clone, Default)]
pub struct Twin {
    /// Number of the newest computation; answers of older ones are dropped.
    pub id: u32,
    pub status: TwinStatus,
    /// The last complete replay; stays visible (faint) while the next one is computed.
    pub result: Option<TwinResult>,
    /// When the document was changed last.
    pub changed_at_s: f64,
    /// From the last change to the start of the twin.
    pub pause_s: Option<f64>,
}

#[derive(Debug, Clone, Default, PartialEq)]
pub enum TwinStatus {
    #[default]
    Idle,
    /// Something changed; starts when the person pauses.
    Waiting {
        start_at_s: f64,
    },
    Running {
        fraction: f64,
    },
    Done,
    Problems(Vec<FieldProblem>),
    Failed(String),
}

#[derive(Debug, Clone, PartialEq)]
pub struct TwinResult {
    pub verdict: Verdict,
    pub replay: Replay,
    pub digest: String,
    pub twin_version: String,
}

#[derive(Debug, Clone, PartialEq)]
pub struct Playback {
    pub time_s: f64,
    pub playing: bool,
    /// Times faster than real time.
    pub speed: f64,
}

impl Default for Playback {
    fn default() -> Self {
        Self {
            time_s: 0.0,
            playing: false,
            speed: 1.0,
        }
    }
}

#[derive(Debug, Clone, Default, PartialEq)]
pub enum Submission {
    #[default]
    Ready,
    Sending,
    Accepted(Uuid),
    Refused(Refusal),
}

/// A problem body in words.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Refusal {
    pub sentence: String,
    pub problems: Vec<FieldProblem>,
}

#[derive(Debug, Clone, Default)]
pub struct Queue {
    /// Newest first; `None` until the server answered.
    pub runs: Option<Vec<RunView>>,
    /// A run whose cancelling waits for a yes.
    pub cancel_asked: Option<Uuid>,
}

impl Queue {
    /// The run on the floor now.
    pub fn active(&self) -> Option<&RunView> {
        self.runs
            .as_deref()?
            .iter()
            .find(|r| matches!(r.state, RunState::Preparing | RunState::Running))
    }

    pub fn find(&self, id: Uuid) -> Option<&RunView> {
        self.runs.as_deref()?.iter().find(|r| r.id == id)
    }
}

/// Newest live frames kept for trails and for runs without a recorded track.
pub const LIVE_FRAMES_MAX: usize = 12_000;
/// Newest lines of a controller's log kept while a run is watched.
pub const LIVE_LOG_MAX: usize = 1_000;

#[derive(Debug, Clone, Default)]
pub struct Live {
    /// What the run's own controller drew last, and when by the run's clock.
    pub drawings: (f64, Vec<Note>),
    /// Its newest log lines and their times, s.
    pub log: VecDeque<(f64, String)>,
    /// The run the connection belongs to; `None` when there is no connection.
    pub connected: Option<Uuid>,
    /// The first message or the opening has arrived.
    pub open: bool,
    pub reconnect_at_s: f64,
    /// The run that `frames` belong to.
    pub run: Option<Uuid>,
    pub frames: VecDeque<LiveFrame>,
    pub frames_dropped: u64,
    pub unreadable: u64,
    pub last_frame_at_s: f64,
}

#[derive(Debug, Clone, Default)]
pub struct Run {
    pub selected: Option<Uuid>,
    pub view: Option<RunView>,
    /// Why the run cannot be shown.
    pub missing: Option<String>,
    pub twin: Recording,
    pub physical: Recording,
    pub playback: Playback,
}

/// A recorded or replayed motion on its way from the server.
#[derive(Debug, Clone, Default, PartialEq)]
pub enum Recording {
    #[default]
    Unknown,
    Loading,
    Missing(String),
    Here(Replay),
}

impl Recording {
    pub const fn replay(&self) -> Option<&Replay> {
        match self {
            Self::Here(replay) => Some(replay),
            _ => None,
        }
    }
}

/// The Gap page: runs of a robot against its twin, and diagnoses of the difference.
#[derive(Debug, Clone, Default)]
pub struct Gap {
    pub robot: Option<String>,
    /// Finished runs of the robot; `None` until the server answered.
    pub gaps: Option<RobotGaps>,
    pub model: Option<RobotModel>,
    /// Diagnoses of all robots, newest first; `None` until the server answered.
    pub diagnoses: Option<Vec<DiagnosisView>>,
    /// Runs ticked as unchanged; those that the server keeps until the person ticks another way.
    pub references: BTreeSet<Uuid>,
    pub references_touched: bool,
    /// Runs ticked as changed.
    pub changed: BTreeSet<Uuid>,
    /// Changed runs that are kept back for the figures of the result; with none the service keeps some back by itself.
    pub locked: BTreeSet<Uuid>,
    /// The diagnosis that is shown; none: a new one is prepared.
    pub selected: Option<Uuid>,
    pub report: ReportState,
    pub asking: bool,
    pub refusal: Option<Refusal>,
    /// Base of the idempotency keys, with the number of requests made.
    pub requests: u32,
}

impl Gap {
    pub fn shown(&self) -> Option<&DiagnosisView> {
        let id = self.selected?;
        self.diagnoses.as_deref()?.iter().find(|one| one.id == id)
    }
}

/// The Models page: versions of a robot, and two of them on a run.
#[derive(Debug, Clone, Default)]
pub struct Models {
    pub robot: Option<String>,
    /// Of the robot, on all floors, newest first; `None` until the server answered.
    pub versions: Option<Vec<ModelView>>,
    pub current: Option<RobotModel>,
    /// Finished runs of the robot; `None` until the server answered.
    pub gaps: Option<RobotGaps>,
    /// The version that is shown; none: what is in use.
    pub selected: Option<Shown>,
    /// What it is compared with; none: the version that it was made from.
    pub other: Option<Shown>,
    /// The run of the comparison; none: the newest one.
    pub run: Option<Uuid>,
    pub comparison: ComparisonState,
}

/// A version, or the nominal twin.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Shown {
    Nominal,
    Version(Uuid),
}

#[derive(Debug, Clone, Default, PartialEq)]
pub enum ComparisonState {
    #[default]
    Ready,
    Asking,
    Refused(Refusal),
    Here(Box<ComparisonView>),
}

/// The report of the diagnosis that is shown, on its way from the server.
#[derive(Debug, Clone, Default, PartialEq)]
pub enum ReportState {
    #[default]
    Unknown,
    Missing(String),
    Here(Box<Report>),
}

#[derive(Debug, Clone, PartialEq)]
pub struct Toast {
    pub id: u64,
    pub error: bool,
    pub text: String,
    pub until_s: f64,
}

impl State {
    /// - `session`: random, one per page load.
    pub fn new(session: Uuid, clock: Clock, dark: bool) -> Self {
        let template = Template::RectangleOmni4;
        Self {
            page: Page::Compose,
            dark,
            clock,
            service: Service::default(),
            lab: Lab {
                robots: None,
                arenas: None,
                models: None,
                reference: serde_json::from_str(include_str!("../../examples/lab/reference.json"))
                    .expect("embedded laboratory is valid; a test reads it"),
            },
            compose: Compose {
                template,
                edited: false,
                experiment: template.experiment(),
                label: template.title().to_owned(),
                program: Program::default(),
                twin: Twin {
                    status: TwinStatus::Waiting {
                        start_at_s: clock.time_s,
                    },
                    ..Twin::default()
                },
                playback: Playback::default(),
                submission: Submission::Ready,
                session,
                document_number: 1,
            },
            queue: Queue::default(),
            live: Live::default(),
            run: Run::default(),
            comparison: Comparison::default(),
            gap: Gap::default(),
            models: Models::default(),
            toasts: VecDeque::new(),
            next_toast: 0,
            last_error: None,
        }
    }
}
