//! Findings in sentences.

use super::schema::{NamedEffect, Verdict};

/// What sentences say of names that runs cannot tell apart, and what is so where driving is not expected to.
const ANOTHER_RUN: &str = "another run can tell";
const NO_RUN: &str = "no manoeuvre of the catalogue is expected to tell";

/// A verdict's sentence; that another run can tell is said only where one is expected to.
///
/// - `is_so`: no manoeuvre is expected to set the names apart.
pub fn told_by_no_run(sentence: String, is_so: bool) -> String {
    if is_so {
        sentence.replace(ANOTHER_RUN, NO_RUN)
    } else {
        sentence
    }
}

/// Effect name as a person says it.
pub fn plain(name: &str) -> String {
    name.replace('_', " ")
}

fn number(value: f64) -> String {
    let size = value.abs();
    if size == 0.0 {
        "0".to_owned()
    } else if size >= 100.0 {
        format!("{value:.0}")
    } else if size >= 1.0 {
        format!("{value:.2}")
    } else if size >= 0.01 {
        format!("{value:.3}")
    } else {
        format!("{value:.5}")
    }
}

/// One named effect with its numbers and what else it could be.
pub fn effect_sentence(effect: &NamedEffect) -> String {
    let mut text = plain(&effect.name);
    if let Some(index) = effect.index {
        text.push_str(&format!(" of wheel {index}"));
    }
    let parts: Vec<String> = effect
        .parameters
        .iter()
        .filter_map(|parameter| {
            let value = parameter.value?;
            let unit = if parameter.unit == "1" { "" } else { &parameter.unit };
            let interval = match (parameter.low, parameter.high) {
                (Some(low), Some(high)) => format!(" ({} to {})", number(low), number(high)),
                _ => String::new(),
            };
            Some(
                format!("{} {}{interval} {unit}", plain(&parameter.name), number(value))
                    .trim_end()
                    .to_owned(),
            )
        })
        .collect();
    text.push_str(&format!(": {}", parts.join(", ")));
    if !effect.alternatives.is_empty() {
        let others: Vec<String> = effect.alternatives.iter().map(|name| plain(name)).collect();
        text.push_str(&format!("; these runs cannot tell it from {}", others.join(", ")));
    }
    text
}

/// The whole in one sentence.
///
/// - `suspect`: effect that explains runs, but could not be checked on others.
/// - `has_references`: without them the robot's description was calibrated on the very runs.
pub fn verdict_sentence(
    verdict: Verdict,
    effects: &[NamedEffect],
    explained: Option<f64>,
    where_it_is: &str,
    suspect: Option<&str>,
    has_references: bool,
) -> String {
    let names: Vec<String> = effects.iter().map(|effect| plain(&effect.name)).collect();
    let names = names.join(", ");
    let who = match (has_references, effects.len() > 1) {
        (true, false) => "It",
        (true, true) => "Together they",
        (false, false) => "With the robot's description calibrated on these runs it",
        (false, true) => "With the robot's description calibrated on these runs together they",
    };
    let does = does(explained, effects.len() > 1);
    let share = does.map_or(String::new(), |does| {
        format!(" {who} {does} the gap on runs that were not used.")
    });
    match verdict {
        Verdict::NoDiscrepancy if !has_references => {
            "With the robot's description calibrated on these runs twin and measurement agree: nothing is to be named."
                .to_owned()
        }
        Verdict::NoDiscrepancy => {
            "Twin and measurement agree as well as in the references: nothing is to be named.".to_owned()
        }
        Verdict::Unexplained if suspect.is_some() => format!(
            "The disagreement is real: {} would explain it in the runs that show it, but too few do, and the others cannot check it. {where_it_is}",
            suspect.map(plain).unwrap_or_default()
        ),
        Verdict::Unexplained => {
            format!("The disagreement is real and no effect of the library explains it. {where_it_is}")
        }
        Verdict::Confirmed => format!("Missing in the twin: {names}.{share}"),
        Verdict::Partial if suspect.is_some() => format!(
            "The disagreement is real: {names} would explain it, but these runs do not prove it; another run can tell.{share}"
        ),
        Verdict::Partial | Verdict::Ambiguous => format!("{}{share}", told_apart(verdict, effects)),
    }
}

/// Names, those that are confirmed before the others.
fn told_apart(verdict: Verdict, effects: &[NamedEffect]) -> String {
    let of = |is_sure: bool| -> Vec<String> {
        let own = effects
            .iter()
            .filter(|effect| (effect.status == "confirmed") == is_sure);
        own.map(|effect| told(effect, effects)).collect()
    };
    let (sure, open) = (of(true), of(false));
    let is_partial = verdict == Verdict::Partial;
    if sure.is_empty() || open.is_empty() {
        let end = match (is_partial, effects.len() > 1) {
            (true, _) => ", but not proven or not all.".to_owned(),
            (false, true) => format!("; these runs cannot tell for sure, {ANOTHER_RUN}."),
            (false, false) => format!("; {ANOTHER_RUN}."),
        };
        return format!("Missing in the twin: {}{end}", [sure, open].concat().join(", "));
    }
    format!(
        "Missing in the twin: {}. Not proven beside {}: {}; {ANOTHER_RUN}.{}",
        sure.join(", "),
        if sure.len() == 1 { "it" } else { "them" },
        open.join(", "),
        if is_partial { " More may be missing." } else { "" }
    )
}

/// A name, with its wheel where there are several of it, and that it may be another one.
fn told(effect: &NamedEffect, effects: &[NamedEffect]) -> String {
    let mut text = plain(&effect.name);
    let is_twice = effects.iter().filter(|other| other.name == effect.name).count() > 1;
    if let Some(index) = effect.index.filter(|_| is_twice) {
        text.push_str(&format!(" of wheel {index}"));
    }
    if !effect.alternatives.is_empty() {
        text.push_str(" or its like");
    }
    text
}

/// What names do to a gap: of all of it and of more no more is said than of all.
fn does(explained: Option<f64>, are_many: bool) -> Option<String> {
    let s = if are_many { "" } else { "s" };
    match 100.0 * explained? {
        percent if percent >= 99.5 => Some(format!("explain{s} all of")),
        percent if percent >= 0.5 => Some(format!("explain{s} {percent:.0} % of")),
        percent if percent >= -0.5 => Some(format!("explain{s} nothing of")),
        percent if percent < -0.5 => Some(if are_many { "enlarge" } else { "enlarges" }.to_owned()),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_confirmed_is_told_apart_from_what_is_not() {
        let effect = |name: &str, status: &str, index: Option<usize>, alternatives: &[&str]| -> NamedEffect {
            let value = serde_json::json!({"name": name, "status": status, "index": index, "alternatives": alternatives,
                "parameters": [], "evidence": {"gain": 1.0, "threshold": 1.0, "stability": 1.0, "gain_validation": 1.0},
                "excluded": [], "sentence": ""});
            serde_json::from_value(value).expect("an effect")
        };
        let limit = || effect("acceleration_limit", "confirmed", None, &[]);
        let clock = || effect("clock_offset", "ambiguous", None, &["command_delay"]);
        let motor = |status: &str, wheel: usize| effect("weak_motor", status, Some(wheel), &[]);
        let said = |verdict, effects: &[NamedEffect]| verdict_sentence(verdict, effects, None, "", None, true);
        for (verdict, effects, words) in [
            (
                Verdict::Ambiguous,
                vec![clock(), limit()],
                "acceleration limit. Not proven beside it: clock offset or its like; another run can tell.",
            ),
            (
                Verdict::Partial,
                vec![motor("confirmed", 0), limit(), motor("ambiguous", 2)],
                "weak motor of wheel 0, acceleration limit. Not proven beside them: weak motor of wheel 2; another run can tell. More may be missing.",
            ),
            (
                Verdict::Partial,
                vec![limit()],
                "acceleration limit, but not proven or not all.",
            ),
            (
                Verdict::Ambiguous,
                vec![clock()],
                "clock offset or its like; another run can tell.",
            ),
            (
                Verdict::Ambiguous,
                vec![limit(), motor("confirmed", 0)],
                "acceleration limit, weak motor; these runs cannot tell for sure, another run can tell.",
            ),
        ] {
            assert_eq!(said(verdict, &effects), format!("Missing in the twin: {words}"));
        }
    }

    #[test]
    fn of_a_gap_no_more_than_all_is_explained_and_one_that_grows_is_told() {
        for (fraction, words) in [
            (1.02, Some("explains all of")),
            (0.996, Some("explains all of")),
            (0.42, Some("explains 42 % of")),
            (0.003, Some("explains nothing of")),
            (-0.3, Some("enlarges")),
            (f64::NAN, None),
        ] {
            assert_eq!(does(Some(fraction), false).as_deref(), words);
        }
        assert_eq!(does(Some(0.42), true).as_deref(), Some("explain 42 % of"));
        assert_eq!(does(None, true), None);
    }

    #[test]
    fn no_run_is_promised_that_would_not_tell() {
        let said = "Missing in the twin: encoder scale or its like; another run can tell. It explains 85 % of the gap.";
        assert_eq!(told_by_no_run(said.to_owned(), false), said);
        assert_eq!(
            told_by_no_run(said.to_owned(), true),
            "Missing in the twin: encoder scale or its like; no manoeuvre of the catalogue is expected to tell. It explains 85 % of the gap."
        );
    }
}
