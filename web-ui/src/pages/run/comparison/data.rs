//! What is shown of runs along one path: the sentence, the table, lines and trails.

use crate::arena_view::{Ink, Scene, Trail};
use crate::correction::{self, Correction};
use crate::course::courses;
use crate::error_measure::BAND_M;
use crate::paper_path::PIXEL_M;
use crate::state::{Recording, State};
use crate::theme::{self, Tone};
use crate::tracking::Figures;
use crate::update;
use api::experiment::Mode;
use api::run::RunView;
use uuid::Uuid;

/// A ratio that is nearer to 1 says nothing.
const ALIKE: f64 = 1.05;
/// Further away than this share of the band, and the band is drawn beside the lines.
const NEAR_BAND: f64 = 0.5;

/// A line of the table.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    pub run: Uuid,
    pub is_shown: bool,
    pub ink: Ink,
    pub dashed: bool,
    pub what: String,
    pub when: String,
    pub cells: Cells,
    /// What else is different, or why there are no figures.
    pub note: Option<String>,
}

/// Figures of a line, in words.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Cells {
    pub rms: String,
    pub largest: String,
    pub band: (String, Tone),
    pub time_rms: String,
    pub against: String,
}

/// The sentence above everything, its tone, and what to do next.
#[derive(Debug, Clone, PartialEq)]
pub struct Headline {
    pub sentence: String,
    pub tone: Tone,
    pub further: Option<String>,
}

fn figures(state: &State, run: Uuid) -> Option<Figures> {
    let tracking = state.comparison.found.get(&run)?.as_ref()?;
    Some(tracking.figures)
}

/// The newest run under feedback alone, with the gains of the run that is shown where there is one; what others are held against.
pub fn reference(state: &State) -> Option<(&RunView, Figures)> {
    let peers = update::peers(state);
    let gains = peers.first().map(|shown| &shown.experiment.control.parameters);
    let alone: Vec<(&RunView, Figures)> = peers
        .iter()
        .filter(|run| Correction::of(&run.experiment) == Correction::Nothing)
        .filter_map(|run| Some((*run, figures(state, run.id)?)))
        .filter(|(_, figures)| figures.finished)
        .collect();
    let same = alone
        .iter()
        .find(|(run, _)| Some(&run.experiment.control.parameters) == gains);
    same.or(alone.first()).copied()
}

/// One sentence about the run that is shown; `None` until its track was measured, and without a path.
pub fn headline(state: &State) -> Option<Headline> {
    let view = state.run.view.as_ref()?;
    if !update::leads_along_a_path(view) {
        return None;
    }
    let figures = figures(state, view.id)?;
    let correction = Correction::of(&view.experiment);
    let how = match correction {
        Correction::Model => correction::of_run(view),
        _ => format!("with {}", correction::of_run(view)),
    };
    let who = if view.experiment.mode == Mode::Virtual {
        "the twin"
    } else {
        "the robot"
    };
    let stays = format!(
        "{how} {who} stays {} RMS from its path",
        theme::fine_millimetres(figures.rms_m)
    );
    let stays = crate::pages::words::full_stop(&stays).trim_end_matches('.').to_owned();
    let band = band_words(&figures).0;
    let reference = reference(state).filter(|(run, _)| run.id != view.id);
    let compared = reference.map(|(_, alone)| against_words(figures.rms_m, alone.rms_m));
    let sentence = match (&compared, figures.finished) {
        (_, false) => format!("{stays} as far as it came: it did not come to the end."),
        (Some(against), true) => format!("{stays}, {against} with feedback alone."),
        (None, true) => format!(
            "{stays}: at most {}, {band}.",
            theme::fine_millimetres(figures.largest_m)
        ),
    };
    let further = match (correction, compared.is_some()) {
        (Correction::Nothing, _) if update::peers(state).len() < 2 => Some(
            "Drive the same path corrected by a model to see what it gives: Compose, Correction, Model.".to_owned(),
        ),
        (Correction::Nothing, _) | (_, true) => None,
        (_, false) => Some(
            "To see what the correction gives, drive the same path with feedback alone: Compose, Correction, None."
                .to_owned(),
        ),
    };
    let tone = if figures.inside() { Tone::Good } else { Tone::Warning };
    Some(Headline {
        sentence,
        tone,
        further,
    })
}

/// `5.0 times nearer than`, for a sentence.
fn against_words(own_m: f64, alone_m: f64) -> String {
    if own_m <= 0.0 || alone_m <= 0.0 {
        return "not to be compared".to_owned();
    }
    let times = alone_m / own_m;
    if times > ALIKE {
        format!("{times:.1} times nearer than")
    } else if times < 1.0 / ALIKE {
        format!("{:.1} times further away than", 1.0 / times)
    } else {
        "as near as".to_owned()
    }
}

fn band_words(figures: &Figures) -> (String, Tone) {
    if !figures.finished {
        return ("did not come to the end".to_owned(), Tone::Warning);
    }
    if figures.outside == 0.0 {
        return ("inside the band all the time".to_owned(), Tone::Good);
    }
    let percent = (100.0 * figures.outside).max(0.1);
    (format!("outside the band {percent:.1} % of the time"), Tone::Error)
}

/// `2.6 mm (1.0 px)`.
fn with_pixels(value_m: f64) -> String {
    format!("{} ({:.1} px)", theme::fine_millimetres(value_m), value_m / PIXEL_M)
}

/// The run that is shown first, then the others, newest first.
pub fn rows(state: &State) -> Vec<Row> {
    let peers = update::peers(state);
    let gains = peers.first().map(|shown| &shown.experiment.control.parameters);
    let alone = reference(state);
    let lines = peers.iter().enumerate();
    lines
        .map(|(place, run)| {
            let mut notes = Vec::new();
            if Some(&run.experiment.control.parameters) != gains {
                notes.push("other gains".to_owned());
            }
            if let Some(asked) = run.experiment.control.interaction
                && Correction::of(&run.experiment) == Correction::Model
            {
                notes.push(format!("looks {} ahead", theme::fine_seconds(asked.horizon_s)));
            }
            let cells = match figures(state, run.id) {
                Some(figures) => cells(&figures, alone.filter(|_| figures.finished), run.id),
                None => {
                    notes.push(missing(state, run.id));
                    Cells::default()
                }
            };
            Row {
                run: run.id,
                is_shown: place == 0,
                ink: Ink::Robot(place),
                dashed: place >= theme::ROBOT_INKS,
                what: sentence_case(&correction::of_run(run)),
                when: theme::relative(run.created_at, state.clock.utc),
                cells,
                note: (!notes.is_empty()).then(|| notes.join(", ")),
            }
        })
        .collect()
}

fn sentence_case(text: &str) -> String {
    crate::pages::words::full_stop(text).trim_end_matches('.').to_owned()
}

fn cells(figures: &Figures, alone: Option<(&RunView, Figures)>, run: Uuid) -> Cells {
    let against = match alone {
        Some((reference, _)) if reference.id == run => "what others are held against".to_owned(),
        Some((_, reference)) if figures.rms_m > 0.0 => {
            let times = reference.rms_m / figures.rms_m;
            format!("{times:.1} times smaller").replace("1.0 times smaller", "alike")
        }
        _ => "\u{2013}".to_owned(),
    };
    let time_rms = figures.time_rms_m.map(theme::fine_millimetres);
    Cells {
        rms: with_pixels(figures.rms_m),
        largest: with_pixels(figures.largest_m),
        band: band_words(figures),
        time_rms: time_rms.unwrap_or_else(|| "not known".to_owned()),
        against,
    }
}

fn missing(state: &State, run: Uuid) -> String {
    match state.comparison.tracks.get(&run) {
        Some(Recording::Missing(why)) => why.clone(),
        Some(Recording::Here(_)) if state.comparison.found.contains_key(&run) => {
            "nothing of the robot was recorded".to_owned()
        }
        _ => "loading its track \u{2026}".to_owned(),
    }
}

/// What the paper tells of its own robot on this path, for the same columns.
pub fn paper() -> [(&'static str, Cells); 2] {
    let told = |largest: &str, band: &str, tone: Tone, against: &str| Cells {
        rms: "not told".to_owned(),
        largest: largest.to_owned(),
        band: (band.to_owned(), tone),
        time_rms: "not told".to_owned(),
        against: against.to_owned(),
    };
    [
        (
            "Paper, before learning",
            told(
                "> 91 px, > 120 px (228, 300 mm)",
                "physical and twin far apart",
                Tone::Error,
                "what the paper starts from",
            ),
        ),
        (
            "Paper, after learning",
            told(
                "within 30 px (75 mm)",
                "inside the band all the time",
                Tone::Good,
                "about 3 (\u{201c}300 %\u{201d})",
            ),
        ),
    ]
}

/// A line over time, millimetres.
#[derive(Debug, Clone, PartialEq)]
pub struct Line {
    pub name: String,
    pub ink: Ink,
    pub dashed: bool,
    pub points: Vec<[f64; 2]>,
}

/// Distance to the path over time, of all runs with figures.
pub fn lines(state: &State) -> Vec<Line> {
    let line = |row: Row| {
        let tracking = state.comparison.found.get(&row.run)?.as_ref()?;
        Some(Line {
            name: format!("{}, {}", row.what, row.when),
            ink: row.ink,
            dashed: row.dashed,
            points: tracking
                .errors
                .iter()
                .map(|[time_s, error_m]| [*time_s, 1000.0 * error_m])
                .collect(),
        })
    };
    rows(state).into_iter().filter_map(line).collect()
}

/// Whether the band is so near to the lines that it can be drawn in one picture with them.
pub fn band_is_near(lines: &[Line]) -> bool {
    let all = lines.iter().flat_map(|line| &line.points);
    all.map(|[_, mm]| *mm).fold(0.0, f64::max) > NEAR_BAND * 1000.0 * BAND_M
}

/// Trails of all runs over each other; the run that is shown on top.
pub fn scene(state: &State) -> Option<Scene> {
    let view = state.run.view.as_ref()?;
    let mut scene = Scene::of_arena(state.lab.arena_or_reference(&view.experiment.arena));
    let ways = courses(&view.experiment, &state.lab).into_iter();
    scene.paths = ways.flatten().map(|course| course.line).collect();
    scene.add_targets(&view.experiment);
    for row in rows(state).into_iter().rev() {
        if let Some(Some(tracking)) = state.comparison.found.get(&row.run) {
            scene.trails.push(Trail {
                points: tracking.trail.clone(),
                ink: row.ink,
                dashed: row.dashed,
                faint: false,
            });
        }
    }
    Some(scene)
}
