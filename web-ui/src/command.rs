//! Everything a person can do, everything that can arrive, and everything the program can ask of the browser.
//!
//! Pages send [`Command`]s; `update/` turns commands and [`Event`]s into new state and [`Effect`]s;
//! the platform carries effects out and reports back with events.

use crate::correction::Correction;
use crate::state::{Page, RobotIndex, RunSide, Shown, Side, TargetIndex, Template};
use api::experiment::Mode;
use api::verdict::{Replay, Verdict};
use uuid::Uuid;

/// What a person did.
#[derive(Debug, Clone, PartialEq)]
pub enum Command {
    ShowPage(Page),
    ToggleTheme,
    DismissToast(u64),
    /// Switch to the page that an address such as `#/run/<id>` names.
    FollowAddress(String),

    ChooseTemplate(Template),
    SetLabel(String),
    SetMode(Mode),
    SetCorrection(Correction),
    /// How far the models look ahead.
    SetHorizon {
        horizon_s: f64,
    },
    /// The template of the paper's path on another robot.
    PutOnPath(String),
    SetDuration {
        duration_s: f64,
    },
    SetSeed(u64),
    SetParameter {
        key: &'static str,
        value: f64,
    },
    ResetParameters,
    /// By its name in `control.law`.
    ChooseLaw(&'static str),
    Program(ProgramCommand),
    /// A robot of the laboratory joins the experiment or leaves it.
    TakeRobot {
        name: String,
        joins: bool,
    },
    MoveStart {
        robot: RobotIndex,
        x_m: f64,
        y_m: f64,
    },
    TurnStart {
        robot: RobotIndex,
        yaw_rad: f64,
    },
    MoveTarget {
        target: TargetIndex,
        x_m: f64,
        y_m: f64,
    },
    CopyDocument,
    Submit,

    PlayPause,
    Seek {
        time_s: f64,
    },
    SetSpeed(f64),

    AskCancel(Uuid),
    ConfirmCancel(Uuid),
    KeepRun,
    OpenRun(Uuid),
    ShowRunSide(RunSide),
    Download {
        url: String,
        file_name: String,
    },
    Gap(GapCommand),
    Models(ModelsCommand),
    /// The protective stop of every laboratory that tells where its own is.
    StopRobots,
    /// The laboratory's own stop page, where the stop is cleared.
    OpenStopPage(String),
}

/// What a person did on the Models page.
#[derive(Debug, Clone, PartialEq)]
pub enum ModelsCommand {
    ChooseRobot(String),
    Show(Shown),
    /// Make what is shown the robot's current model.
    Use,
    CompareWith(Shown),
    OnRun(Uuid),
    Compare,
}

/// What a person did with an own controller.
#[derive(Debug, Clone, PartialEq)]
pub enum ProgramCommand {
    ShowSide(Side),
    SetScript(String),
    /// An example of the gallery, by its place; a text of one's own is replaced only after a yes.
    AskExample(usize),
    TakeExample(usize),
    KeepText,
    SetNumber {
        name: String,
        value: f64,
    },
    RemoveNumber(String),
    /// The name in the field beside the button that adds a number.
    NameNumber(String),
    PickModule,
    /// Back from a module to the script.
    WriteScript,
}

/// What a person did on the Gap page.
#[derive(Debug, Clone, PartialEq)]
pub enum GapCommand {
    ChooseRobot(String),
    /// Tick a run as unchanged, or not.
    ToggleReference(Uuid),
    /// Tick a run as changed, or not.
    ToggleChanged(Uuid),
    /// Tick a changed run as kept back for the figures of the result, or not.
    ToggleLocked(Uuid),
    KeepReferences,
    Start,
    /// Show a diagnosis; none: prepare a new one.
    Open(Option<Uuid>),
    Cancel(Uuid),
    Accept(Uuid),
    /// Submit the experiment that the report proposes.
    Next(Uuid),
    /// Give the robot another model: a version, or `nominal`.
    ChooseModel(String),
    /// The report as a page of its own.
    OpenPage(Uuid),
}

/// What arrived from the server, the worker or the live connection.
#[derive(Debug, Clone, PartialEq)]
pub enum Event {
    Answer {
        request: Request,
        answer: Answer,
    },
    TwinProgress {
        id: u32,
        fraction: f64,
    },
    TwinDone {
        id: u32,
        verdict: Box<Verdict>,
        replay: Box<Replay>,
        digest: String,
        twin_version: String,
    },
    TwinProblems {
        id: u32,
        problems: Vec<api::problem::FieldProblem>,
    },
    TwinFailed {
        id: u32,
        message: String,
    },
    /// A file that was picked as a WebAssembly module, or the browser's words for why it could not be read.
    ModulePicked {
        name: String,
        bytes: Result<Vec<u8>, String>,
    },
    LiveOpened {
        run: Uuid,
    },
    LiveFrame {
        run: Uuid,
        text: String,
    },
    LiveClosed {
        run: Uuid,
        reason: String,
    },
}

/// A REST call, named so that the answer finds its place.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub enum Request {
    Arenas,
    Robots,
    Runs,
    Run(Uuid),
    Cancel(Uuid),
    Replay(Uuid),
    Track(Uuid),
    Submit,
    Models,
    Gaps(String),
    RobotModel(String),
    Diagnoses,
    Report(Uuid),
    StartDiagnosis,
    /// A verb of a diagnosis: `cancel`, `accept` or `next-experiment`.
    Diagnosis(Uuid, &'static str),
    ChooseModel(String),
    KeepReferences(String),
    /// All versions of a robot.
    Versions(String),
    Compare,
    /// The protective stop of the laboratory whose stop page has this address.
    Stop(String),
}

/// How a REST call ended. `Err` holds the words of the browser when no answer came at all.
pub type Answer = Result<HttpAnswer, String>;

#[derive(Debug, Clone, PartialEq, Eq)]
pub struct HttpAnswer {
    pub status: u16,
    pub body: String,
}

/// What the platform is asked to do.
#[derive(Debug, Clone, PartialEq)]
pub enum Effect {
    Send {
        request: Request,
        body: Option<String>,
        idempotency_key: Option<Uuid>,
    },
    StartTwin {
        id: u32,
        scenario: String,
    },
    CancelTwin {
        id: u32,
    },
    /// A file dialogue; what is picked arrives as [`Event::ModulePicked`].
    PickModule,
    OpenLive {
        run: Uuid,
    },
    CloseLive,
    CopyText(String),
    Download {
        url: String,
        file_name: String,
    },
    SetAddress(String),
    /// Opens an address of this service, or a laboratory's stop page, beside the dashboard.
    OpenBeside(String),
    StoreTheme {
        dark: bool,
    },
}
