//! What the Models page shows.

use crate::pages::gap::data::{channel, drift_of, error_text, millimetres};
use crate::pages::gap::phrase;
use crate::report::{Effect, Parameter};
use crate::state::{Models, Shown, State};
use crate::theme;
use crate::update;
use api::comparison::{ComparisonView, NearerModel};
use api::model::{ModelEffect, ModelView, RunGap};
use uuid::Uuid;

/// What the equations alone are called on the page.
pub const NOMINAL: &str = "Nominal twin";

/// A line of the lineage.
#[derive(Debug, Clone, PartialEq)]
pub struct VersionRow {
    pub shown: Shown,
    pub name: String,
    pub in_use: bool,
    /// When and by what it was made.
    pub made: String,
    pub contents: String,
    pub lit: bool,
    /// Position of the row that it was made from.
    pub parent: Option<usize>,
}

/// Newest first, the nominal twin last; `None` until the server answered.
pub fn rows(state: &State) -> Option<Vec<VersionRow>> {
    let models = &state.models;
    let versions = models.versions.as_ref()?;
    let lit = update::shown(models);
    let in_use = models.current.as_ref().map(|current| current.model);
    let nominal = versions.len();
    let here = models.current.as_ref().map(|current| &current.floor);
    let made = |one: &ModelView| {
        let floor = if here.is_some_and(|here| *here != one.floor) {
            format!(", for {}", one.floor)
        } else {
            String::new()
        };
        format!(
            "{}, {}{floor}",
            theme::relative(one.created_at, state.clock.utc),
            origin(one)
        )
    };
    let place = |name: &str| versions.iter().position(|one| one.version == name);
    let mut rows: Vec<VersionRow> = versions
        .iter()
        .map(|one| VersionRow {
            shown: Shown::Version(one.id),
            name: one.version.clone(),
            in_use: in_use == Some(Some(one.id)),
            made: made(one),
            contents: sentence_case(&contents(one)),
            lit: lit == Shown::Version(one.id),
            parent: one.parent.as_deref().map_or(Some(nominal), place),
        })
        .collect();
    rows.push(VersionRow {
        shown: Shown::Nominal,
        name: NOMINAL.to_owned(),
        in_use: in_use == Some(None),
        made: "from the laboratory's description".to_owned(),
        contents: "The robot as described, nothing learned".to_owned(),
        lit: lit == Shown::Nominal,
        parent: None,
    });
    Some(rows)
}

/// What made a version, in a few words.
pub fn origin(version: &ModelView) -> &'static str {
    let noted = |name: &str| {
        version
            .document
            .get("provenance")
            .is_some_and(|from| from.get(name).is_some())
    };
    if version.diagnosis.is_some() {
        "by a diagnosis"
    } else if noted("learned_online") {
        "learned during a run"
    } else if noted("learned") {
        "trained on stored runs"
    } else {
        "handed in"
    }
}

/// What a version says about its robot, without the robot's name.
pub fn contents(version: &ModelView) -> String {
    let mut parts: Vec<String> = version.effects.iter().map(effect).collect();
    if let Some(residual) = &version.residual {
        parts.push(format!(
            "is corrected by a small neural network ({} learned numbers) where no named effect explains it",
            residual.weights
        ));
    }
    match parts.as_slice() {
        [] => "is as described, with its numbers calibrated".to_owned(),
        [one] => one.clone(),
        [first @ .., last] => format!("{} and {last}", first.join(", ")),
    }
}

/// An effect as a predicate: "has wheels 4.0 % larger than described".
fn effect(effect: &ModelEffect) -> String {
    let parameters = effect.parameters.iter().map(|one| Parameter {
        name: one.name.clone(),
        value: one.value,
        unit: one.unit.clone(),
        ..Parameter::default()
    });
    phrase::effect(&Effect {
        name: effect.name.clone(),
        index: effect.index,
        parameters: parameters.collect(),
        ..Effect::default()
    })
}

fn sentence_case(text: &str) -> String {
    let mut letters = text.chars();
    letters
        .next()
        .map_or_else(String::new, |c| c.to_uppercase().collect::<String>() + letters.as_str())
}

/// The version that is shown; none: the nominal twin.
pub fn shown_version(models: &Models) -> Option<&ModelView> {
    match update::shown(models) {
        Shown::Version(id) => models.versions.iter().flatten().find(|one| one.id == id),
        Shown::Nominal => None,
    }
}

/// Title and what it says, of what is shown.
pub fn headline(state: &State) -> (String, String) {
    let robot = state.models.robot.as_deref().unwrap_or("The robot");
    match shown_version(&state.models) {
        Some(version) => (version.version.clone(), format!("{robot} {}.", contents(version))),
        None => (
            NOMINAL.to_owned(),
            format!(
                "The equations of motion with the numbers that the laboratory gives for {robot}; nothing was learned from runs."
            ),
        ),
    }
}

/// Which model is in use on the robot's floor, since when and through whom.
pub fn in_use_sentence(state: &State) -> Option<String> {
    let current = state.models.current.as_ref()?;
    let version = current.version.as_deref().unwrap_or("the nominal twin");
    let head = format!("{} on {} uses {version}", current.robot, current.floor);
    Some(match current.history.first() {
        None => format!("{head}: nobody has chosen a version yet."),
        Some(line) => {
            let why = if line.diagnosis.is_some() {
                ", as the result of a diagnosis"
            } else {
                ""
            };
            let when = theme::relative(line.since, state.clock.utc);
            format!("{head}: chosen by {} {when}{why}.", line.chosen_by)
        }
    })
}

/// An alarm in words when the robot has moved away from its model.
pub fn drift_sentence(state: &State) -> Option<String> {
    drift_of(state.models.gaps.as_ref()?)
}

/// Names and values of a version.
pub fn facts(state: &State, version: &ModelView) -> Vec<(String, String)> {
    let fact = |name: &str, value: String| (name.to_owned(), value);
    let mut rows = vec![
        fact("Made for", format!("{} on {}", version.robot, version.floor)),
        fact(
            "Made from",
            version.parent.clone().unwrap_or_else(|| "the nominal twin".to_owned()),
        ),
        fact(
            "Made",
            format!("{}, {}", theme::utc(version.created_at), origin(version)),
        ),
    ];
    rows.push(fact(
        "Gap when made",
        version.gap.map_or_else(
            || "not measured on runs that were kept back".to_owned(),
            |gap| {
                format!(
                    "{} \u{2192} {} from the measured position {} s ahead, on data that did not make it",
                    millimetres(gap.before_m),
                    millimetres(gap.after_m),
                    gap.horizon_s
                )
            },
        ),
    ));
    let data = version
        .document
        .pointer("/provenance/data")
        .and_then(serde_json::Value::as_array);
    if let Some(data) = data.filter(|data| !data.is_empty()) {
        let count = data.len();
        rows.push(fact(
            "Made of",
            format!("{count} run{}", if count == 1 { "" } else { "s" }),
        ));
    }
    let history = state.models.current.iter().flat_map(|current| &current.history);
    let mut uses = history.filter(|line| line.model == Some(version.id));
    rows.push(fact(
        "Used",
        uses.next().map_or_else(
            || "never yet".to_owned(),
            |line| {
                format!(
                    "last chosen {} by {}",
                    theme::relative(line.since, state.clock.utc),
                    line.chosen_by
                )
            },
        ),
    ));
    let id = version.document.get("id").and_then(serde_json::Value::as_str);
    rows.extend(id.map(|id| fact("Fingerprint", theme::short(id).to_owned())));
    rows
}

/// What a version is called in a list of choices.
pub fn name(models: &Models, shown: Shown) -> String {
    match shown {
        Shown::Nominal => NOMINAL.to_owned(),
        Shown::Version(id) => {
            let found = models.versions.iter().flatten().find(|one| one.id == id);
            found.map_or_else(String::new, |one| one.version.clone())
        }
    }
}

/// Everything that the shown version can be compared with.
pub fn others(models: &Models) -> Vec<Shown> {
    let shown = update::shown(models);
    let versions = models.versions.iter().flatten().map(|one| Shown::Version(one.id));
    versions
        .chain([Shown::Nominal])
        .filter(|other| *other != shown)
        .collect()
}

/// Runs that can be compared on, newest first: id and what it is called.
pub fn runs(state: &State) -> Vec<(Uuid, String)> {
    let runs = state.models.gaps.iter().flat_map(|gaps| &gaps.runs);
    let usable = runs.filter(|run| run.problem.is_none());
    usable.map(|run| (run.run, run_name(state, run))).collect()
}

fn run_name(state: &State, run: &RunGap) -> String {
    let label = if run.label.is_empty() { "(no label)" } else { &run.label };
    match run.ended_at {
        Some(at) => format!("{label}, {}", theme::relative(at, state.clock.utc)),
        None => label.to_owned(),
    }
}

/// A line of the table of a comparison.
#[derive(Debug, Clone, PartialEq)]
pub struct ErrorRow {
    /// Empty where it is that of the line before.
    pub channel: String,
    pub ahead: String,
    /// First and second.
    pub texts: [String; 2],
    /// Which is smaller by more than a tenth.
    pub smaller: Option<usize>,
}

pub fn errors(view: &ComparisonView) -> Vec<ErrorRow> {
    let mut before = "";
    view.rows
        .iter()
        .map(|row| {
            let name = if row.channel == before {
                ""
            } else {
                channel(&row.channel)
            };
            before = &row.channel;
            let smaller = match (row.first, row.second) {
                (first, second) if first < 0.9 * second => Some(0),
                (first, second) if second < 0.9 * first => Some(1),
                _ => None,
            };
            ErrorRow {
                channel: name.to_owned(),
                ahead: format!("{} s", row.horizon_s),
                texts: [row.first, row.second].map(|value| error_text(&row.unit, value)),
                smaller,
            }
        })
        .collect()
}

/// What both sides of a comparison are called; the server says "nominal" of the equations alone.
pub fn compared(view: &ComparisonView) -> [&str; 2] {
    [&view.first, &view.second].map(|side| match side.version.as_str() {
        api::diagnosis::NOMINAL => NOMINAL,
        version => version,
    })
}

/// The ratio of both gaps, with its interval; for the line below the sentence.
pub fn ratio_sentence(view: &ComparisonView) -> Option<String> {
    let ratio = view.ratio?;
    let [first, second] = compared(view);
    let chance = match view.nearer {
        NearerModel::Alike if ratio.low <= 1.0 && ratio.high >= 1.0 => {
            "; 1 lies between these, so chance may have made the difference"
        }
        _ => "",
    };
    Some(format!(
        "2 s ahead {second} is {:.2} times as far off as {first}; over other stretches like these, 95 % between {:.2} and {:.2} times{chance}.",
        ratio.value, ratio.low, ratio.high
    ))
}
