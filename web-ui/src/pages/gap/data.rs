//! What the Gap page shows.

use super::phrase;
use crate::report::{Gap, Region, Report};
use crate::state::State;
use crate::theme::{self, Tone};
use api::diagnosis::{DiagnosisOrigin, DiagnosisState, DiagnosisView};
use api::model::{RobotGaps, RunGap};
use std::collections::BTreeMap;
use uuid::Uuid;

/// A finished run that can be ticked.
#[derive(Debug, Clone, PartialEq)]
pub struct RunRow {
    pub run: Uuid,
    pub label: String,
    pub when: String,
    /// Gap two seconds ahead, or why there is none.
    pub gap: String,
    pub tone: Tone,
    pub hint: String,
    pub same: bool,
    pub changed: bool,
    pub locked: bool,
}

/// Newest first; `None` until the server answered.
pub fn runs(state: &State) -> Option<Vec<RunRow>> {
    let gaps = state.gap.gaps.as_ref()?;
    let limit_m = gaps.limit_position_m;
    let row = |run: &RunGap| {
        let (gap, tone, hint) = gap_of(run, gaps.horizon_s, limit_m);
        RunRow {
            run: run.run,
            label: if run.label.is_empty() {
                "(no label)".to_owned()
            } else {
                run.label.clone()
            },
            when: run
                .ended_at
                .map(|at| theme::relative(at, state.clock.utc))
                .unwrap_or_default(),
            gap,
            tone,
            hint,
            same: state.gap.references.contains(&run.run),
            changed: state.gap.changed.contains(&run.run),
            locked: state.gap.locked.contains(&run.run),
        }
    };
    Some(gaps.runs.iter().map(row).collect())
}

fn gap_of(run: &RunGap, horizon_s: f64, limit_m: Option<f64>) -> (String, Tone, String) {
    if let Some(problem) = &run.problem {
        return (
            "no gap".to_owned(),
            Tone::Neutral,
            format!("This run cannot be compared: {problem}."),
        );
    }
    let at = run
        .horizons
        .iter()
        .find(|gap| gap.horizon_s == horizon_s && gap.samples > 0);
    let Some(at) = at else {
        return if run.horizons.is_empty() {
            (
                "\u{2026}".to_owned(),
                Tone::Neutral,
                "The gap of this run is being computed.".to_owned(),
            )
        } else {
            (
                "too short".to_owned(),
                Tone::Neutral,
                format!("The run is too short for a prediction {horizon_s:.0} s ahead."),
            )
        };
    };
    let above = limit_m.is_some_and(|limit_m| at.position_m > limit_m);
    let tone = match (limit_m, above) {
        (None, _) => Tone::Neutral,
        (Some(_), true) => Tone::Warning,
        (Some(_), false) => Tone::Good,
    };
    let hint = format!(
        "Prediction {horizon_s:.0} s ahead against the measured poses, RMS: {} and {:.1}\u{b0}.",
        millimetres(at.position_m),
        at.yaw_rad.to_degrees()
    );
    (millimetres(at.position_m), tone, hint)
}

/// Tenths below ten millimetres.
pub fn millimetres(value_m: f64) -> String {
    if value_m.abs() < 0.01 {
        format!("{:.1} mm", 1000.0 * value_m)
    } else {
        theme::millimetres(value_m)
    }
}

/// What the gaps are compared with, in words.
pub fn floor_sentence(state: &State) -> String {
    let Some(gaps) = &state.gap.gaps else {
        return String::new();
    };
    match (gaps.floor_position_m, gaps.limit_position_m) {
        (Some(floor_m), Some(limit_m)) => format!(
            "Kept unchanged runs differ from the twin by {} {:.0} s ahead. A run above {} asks for a diagnosis by itself.",
            millimetres(floor_m),
            gaps.horizon_s,
            millimetres(limit_m)
        ),
        _ => "Tick two or more unchanged runs and keep them: they show what chance does, and runs that differ more ask for a \
              diagnosis by themselves."
            .to_owned(),
    }
}

/// An alarm in words when the robot has moved away from its model.
pub fn drift_sentence(state: &State) -> Option<String> {
    drift_of(state.gap.gaps.as_ref()?)
}

/// The same of a robot's gaps.
pub fn drift_of(gaps: &RobotGaps) -> Option<String> {
    let drift = gaps.drift?;
    let since = drift.since.map_or_else(String::new, |since| {
        format!(" since {}", since.format("%A, %-d %B %H:%M"))
    });
    Some(format!(
        "{} drifts: its gap is {:.1} times what it was{since}, {} instead of {} {:.0} s ahead.",
        gaps.robot,
        drift.factor,
        millimetres(drift.newest_m),
        millimetres(drift.before_m),
        gaps.horizon_s
    ))
}

/// A line of the list of diagnoses.
#[derive(Debug, Clone, PartialEq)]
pub struct DiagnosisRow {
    pub id: Uuid,
    pub state: &'static str,
    pub tone: Tone,
    pub text: String,
    pub when: String,
    pub shown: bool,
}

/// Diagnoses of the chosen robot, newest first.
pub fn diagnoses(state: &State) -> Vec<DiagnosisRow> {
    let of_robot = |view: &&DiagnosisView| Some(&view.robot) == state.gap.robot.as_ref();
    let all = state.gap.diagnoses.iter().flatten().filter(of_robot);
    all.map(|view| {
        let (word, tone) = state_word(view);
        DiagnosisRow {
            id: view.id,
            state: word,
            tone,
            text: row_text(view),
            when: theme::relative(view.created_at, state.clock.utc),
            shown: state.gap.selected == Some(view.id),
        }
    })
    .collect()
}

pub fn state_word(view: &DiagnosisView) -> (&'static str, Tone) {
    match view.state {
        DiagnosisState::Queued => ("Waiting", Tone::Neutral),
        DiagnosisState::Running => ("Running", Tone::Active),
        DiagnosisState::Done => {
            let (word, tone, _) = phrase::verdict(view.verdict.as_deref().unwrap_or_default());
            (word, tone)
        }
        DiagnosisState::Failed => ("Failed", Tone::Error),
        DiagnosisState::Cancelled => ("Cancelled", Tone::Neutral),
    }
}

fn row_text(view: &DiagnosisView) -> String {
    let (changed, same) = (view.changed_runs.len(), view.reference_runs.len());
    let runs = match view.locked_runs.len() {
        0 => format!("{changed} changed, {same} unchanged runs"),
        kept => format!("{changed} changed, {same} unchanged, {kept} kept back"),
    };
    match view.origin {
        DiagnosisOrigin::Person => runs,
        DiagnosisOrigin::Gap => format!("{runs}; asked for by a large gap"),
        DiagnosisOrigin::FollowUp => format!("{runs}; with the proposed run"),
    }
}

/// A line of before and after: a channel at a horizon.
#[derive(Debug, Clone, PartialEq)]
pub struct GapLine {
    pub horizon: String,
    pub before: f64,
    pub after: f64,
    pub floor: f64,
    pub texts: [String; 3],
}

/// Before and after by channel, poses first.
pub fn gap_lines(report: &Report) -> Vec<(String, Vec<GapLine>)> {
    const ORDER: [&str; 8] = ["pose", "yaw", "wheel", "gyro", "accel", "current", "bus", "steering"];
    let mut channels: BTreeMap<usize, (String, Vec<GapLine>)> = BTreeMap::new();
    for gap in &report.gap {
        let place = ORDER
            .iter()
            .position(|name| *name == gap.channel)
            .unwrap_or(ORDER.len());
        let entry = channels
            .entry(place)
            .or_insert_with(|| (channel(&gap.channel).to_owned(), Vec::new()));
        entry.1.push(GapLine {
            horizon: format!(
                "{} s ahead",
                phrase::figure(gap.horizon_s)
                    .trim_end_matches('0')
                    .trim_end_matches('.')
            ),
            before: gap.before,
            after: gap.after,
            floor: gap.floor,
            texts: [gap.before, gap.after, gap.floor].map(|value| gap_text(gap, value)),
        });
    }
    channels.into_values().collect()
}

fn gap_text(gap: &Gap, value: f64) -> String {
    error_text(&gap.unit, value)
}

/// An error with its unit, in two figures.
pub fn error_text(unit: &str, value: f64) -> String {
    match unit {
        "m" => millimetres(value),
        "rad" => format!("{:.1}\u{b0}", value.to_degrees()),
        unit => format!("{} {unit}", two_figures(value)),
    }
}

/// Two figures that count: comparing needs no more.
fn two_figures(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return "0".to_owned();
    }
    let before_point = value.abs().log10().floor() as i32;
    let decimals = (1 - before_point).clamp(0, 6) as usize;
    format!("{value:.decimals$}")
}

/// A measured quantity in words.
pub fn channel(name: &str) -> &str {
    match name {
        "pose" => "Position",
        "yaw" => "Heading",
        "wheel" => "Wheel speeds",
        "steering" => "Steering angle",
        "current" => "Motor currents",
        "bus" => "Battery voltage",
        "gyro" => "Yaw rate (gyro)",
        "accel" => "Acceleration",
        other => other,
    }
}

/// Regions worth a plot: those whose largest bin stands out most.
pub fn loud_regions(report: &Report) -> Vec<&Region> {
    let loudness = |region: &&Region| region.energy.iter().copied().fold(0.0, f64::max);
    let mut regions: Vec<&Region> = report
        .place
        .regions
        .iter()
        .filter(|region| region.energy.len() > 1 && region.edges.len() == region.energy.len() + 1)
        .collect();
    regions.sort_by(|a, b| loudness(b).total_cmp(&loudness(a)));
    regions.truncate(4);
    regions
}

/// What a diagnosis was made of and what came of it, as names and values.
pub fn facts(view: &DiagnosisView, report: Option<&Report>) -> Vec<(String, String)> {
    let role = |report: &Report, role: &str| report.data.iter().filter(|data| data.role == role).count();
    let mut rows = vec![
        (
            "Started from".to_owned(),
            view.parent_model
                .clone()
                .unwrap_or_else(|| "the nominal twin".to_owned()),
        ),
        ("Unchanged runs".to_owned(), view.reference_runs.len().to_string()),
        ("Changed runs".to_owned(), view.changed_runs.len().to_string()),
    ];
    if !view.locked_runs.is_empty() {
        rows.push((
            "Kept back by you".to_owned(),
            format!("{} runs, opened only for the figures", view.locked_runs.len()),
        ));
    }
    if let Some(report) = report {
        rows.push((
            "Their roles".to_owned(),
            format!(
                "{} to fit, {} to check, {} opened only for the figures",
                role(report, "train"),
                role(report, "validation"),
                role(report, "locked")
            ),
        ));
    }
    if let Some(model) = &view.model {
        let note = if view.model_is_current { ", in use now" } else { "" };
        rows.push(("New model".to_owned(), format!("{model}{note}")));
    }
    rows.push(("Asked for by".to_owned(), view.requested_by.clone()));
    if let (Some(begun), Some(ended)) = (view.started_at, view.ended_at) {
        let seconds = (ended - begun).num_milliseconds() as f64 / 1000.0;
        rows.push(("Took".to_owned(), theme::seconds(seconds)));
    }
    rows
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_stand_by_channel_with_poses_first_and_units() {
        let report: Report = serde_json::from_str(
            r#"{"gap": [{"channel": "gyro", "horizon_s": 0.5, "unit": "rad/s", "before": 0.2, "after": 0.1, "floor": 0.05},
                {"channel": "pose", "horizon_s": 0.5, "unit": "m", "before": 0.011, "after": 0.004, "floor": 0.002},
                {"channel": "pose", "horizon_s": 2.0, "unit": "m", "before": 0.041, "after": 0.006, "floor": 0.005}]}"#,
        )
        .expect("a report");
        let lines = gap_lines(&report);
        assert_eq!(
            lines.iter().map(|(name, _)| name.as_str()).collect::<Vec<_>>(),
            ["Position", "Yaw rate (gyro)"]
        );
        let pose = &lines[0].1;
        assert_eq!(
            (pose[0].horizon.as_str(), pose[1].horizon.as_str()),
            ("0.5 s ahead", "2 s ahead")
        );
        assert_eq!(pose[1].texts, ["41 mm", "6.0 mm", "5.0 mm"]);
        assert_eq!(lines[1].1[0].texts[0], "0.20 rad/s");
    }

    #[test]
    fn a_gap_above_the_limit_is_marked_and_one_to_come_says_so() {
        let run = |position_m: Option<f64>| RunGap {
            run: Uuid::nil(),
            label: String::new(),
            submitted_by: String::new(),
            ended_at: None,
            is_reference: false,
            horizons: position_m
                .map(|position_m| {
                    vec![api::model::HorizonGap {
                        horizon_s: 2.0,
                        position_m,
                        yaw_rad: 0.01,
                        samples: 3,
                    }]
                })
                .unwrap_or_default(),
            problem: None,
        };
        assert_eq!(gap_of(&run(Some(0.02)), 2.0, Some(0.015)).1, Tone::Warning);
        assert_eq!(gap_of(&run(Some(0.01)), 2.0, Some(0.015)).1, Tone::Good);
        assert_eq!(gap_of(&run(Some(0.01)), 2.0, None).1, Tone::Neutral);
        assert!(gap_of(&run(None), 2.0, None).2.contains("being computed"));
    }
}
