//! Effects and verdicts as a person says them.

use crate::report::{Effect, Gap, Parameter, Report};
use crate::theme::Tone;

/// A verdict in a word, and what it means for somebody who sees it for the first time.
pub fn verdict(name: &str) -> (&'static str, Tone, &'static str) {
    match name {
        "confirmed" => (
            "Confirmed",
            Tone::Good,
            "The effect explains runs that were not used to find it, and no other effect of the library does as well.",
        ),
        "partial" => (
            "Partly explained",
            Tone::Warning,
            "An effect was found, but something is left over, or there were too few runs to prove it on runs that were not used. \
             More runs make it certain.",
        ),
        "ambiguous" => (
            "More than one explanation",
            Tone::Warning,
            "Several effects explain these runs, or a part of what they show, equally well. The proposed experiment moves the robot so that they differ.",
        ),
        "unexplained" => (
            "Unexplained",
            Tone::Warning,
            "Robot and twin disagree by more than chance, and no effect of the library could be shown to explain it. The maps below show where to look.",
        ),
        "no_discrepancy" => (
            "No difference",
            Tone::Good,
            "Robot and twin agree as well as in the unchanged runs: there is nothing to explain.",
        ),
        _ => ("Done", Tone::Neutral, ""),
    }
}

/// Name of an effect with spaces.
pub fn plain(name: &str) -> String {
    name.replace('_', " ")
}

/// The finding in one sentence, with its figures first.
pub fn headline(report: &Report) -> String {
    let robot = if report.robot.is_empty() {
        "The robot"
    } else {
        &report.robot
    };
    if report.effects.is_empty() {
        return match report.verdict.as_str() {
            "no_discrepancy" => format!("{robot} drives as its twin predicts."),
            "unexplained" => format!("{robot} and its twin disagree, and no known effect explains it."),
            _ => report.sentence.clone(),
        };
    }
    let of = |is_open: bool| -> Vec<String> {
        let own = report.effects.iter().filter(|effect| is_ambiguous(effect) == is_open);
        own.map(effect).collect()
    };
    let (sure, open) = (of(false), of(true));
    let gap = pose_gap(report).map_or_else(String::new, |(gap, runs)| {
        let on = match runs {
            0 => "the runs".to_owned(),
            1 => "one run that was not used".to_owned(),
            n => format!("{} runs that were not used", number_word(n)),
        };
        format!(
            "; pose gap {:.0} s ahead {} \u{2192} {} on {on}",
            gap.horizon_s,
            length(gap.before),
            length(gap.after)
        )
    });
    match (sure.is_empty(), open.is_empty()) {
        (true, _) => format!("Not proven: {robot} {}{gap}.", open.join(" and ")),
        (false, true) => format!("{robot} {}{gap}.", sure.join(" and ")),
        (false, false) => format!(
            "{robot} {}, and perhaps {}{gap}.",
            sure.join(" and "),
            open.join(" and ")
        ),
    }
}

fn is_ambiguous(effect: &Effect) -> bool {
    effect.status == "ambiguous"
}

/// The figure that people look at first: positions two seconds ahead, and how many runs it was measured on.
pub fn pose_gap(report: &Report) -> Option<(&Gap, usize)> {
    let gap = report
        .gap
        .iter()
        .find(|gap| gap.channel == "pose" && (gap.horizon_s - 2.0).abs() < 1e-9)?;
    let locked = report.data.iter().filter(|data| data.role == "locked").count();
    Some((gap, locked))
}

fn number_word(n: usize) -> String {
    const WORDS: [&str; 7] = ["no", "one", "two", "three", "four", "five", "six"];
    WORDS.get(n).map_or_else(|| n.to_string(), |word| (*word).to_owned())
}

fn length(value_m: f64) -> String {
    let millimetres = 1000.0 * value_m;
    if millimetres < 10.0 {
        format!("{millimetres:.1}\u{a0}mm")
    } else {
        format!("{millimetres:.0}\u{a0}mm")
    }
}

/// What the robot does, as a predicate: "slips on a patch at ...".
pub fn effect(effect: &Effect) -> String {
    let get = |name: &str| {
        effect
            .parameters
            .iter()
            .find(|one| one.name == name)
            .and_then(|one| one.value)
    };
    let wheel = effect
        .index
        .map_or_else(|| "one wheel".to_owned(), |index| format!("wheel {}", index + 1));
    let percent = |value: f64| format!("{:.1} %", 100.0 * value.abs());
    let more = |value: f64| if value < 0.0 { "smaller" } else { "larger" };
    let known = match effect.name.as_str() {
        "low_friction_patch" => patch(&get),
        "floor_friction" => {
            get("scale").map(|scale| format!("has {scale:.2} times the described friction on this floor"))
        }
        "wheel_radius" => {
            get("relative").map(|share| format!("has wheels {} {} than described", percent(share), more(share)))
        }
        "wheel_radius_one" => {
            get("relative").map(|share| format!("has {wheel} {} {} than described", percent(share), more(share)))
        }
        "payload" => get("mass")
            .or_else(|| get("mass_kg"))
            .map(|mass_kg| format!("carries {mass_kg:.1} kg more than described")),
        "command_delay" => get("delay")
            .or_else(|| get("delay_s"))
            .map(|delay_s| format!("obeys its commands {:.0} ms late", 1000.0 * delay_s)),
        "gyro_bias" => get("bias").map(|bias| format!("has a gyro that reads {bias:.3} rad/s at rest")),
        _ => None,
    };
    known.unwrap_or_else(|| generic(effect))
}

fn patch(get: &impl Fn(&str) -> Option<f64>) -> Option<String> {
    let (x, y) = (get("x")?, get("y")?);
    let size = get("radius").map_or_else(String::new, |radius_m| format!(" (radius {radius_m:.2} m)"));
    let friction = get("scale")
        .or_else(|| get("mu_scale"))
        .map_or_else(String::new, |scale| format!(" with {scale:.2} times the friction"));
    Some(format!(
        "slips on a patch at ({}, {}) m{size}{friction}",
        signed(x),
        signed(y)
    ))
}

fn signed(value: f64) -> String {
    format!("{value:.1}").replace('-', "\u{2212}")
}

fn generic(effect: &Effect) -> String {
    let wheel = effect
        .index
        .map_or_else(String::new, |index| format!(" of wheel {}", index + 1));
    let values: Vec<String> = effect.parameters.iter().filter_map(parameter).collect();
    if values.is_empty() {
        format!("shows {}{wheel}", plain(&effect.name))
    } else {
        format!("shows {}{wheel} ({})", plain(&effect.name), values.join(", "))
    }
}

/// Value with unit, without the interval; none for limits that are not there.
pub fn parameter(one: &Parameter) -> Option<String> {
    Some(format!("{} {}{}", plain(&one.name), figure(one.value?), unit(one)))
}

/// Value with its interval.
pub fn parameter_with_interval(one: &Parameter) -> String {
    let Some(value) = one.value else {
        return format!("{} unlimited", plain(&one.name));
    };
    let interval = match (one.low, one.high) {
        (Some(low), Some(high)) => format!("  (95 %: {} to {})", figure(low), figure(high)),
        _ => String::new(),
    };
    format!("{} {}{}{interval}", plain(&one.name), figure(value), unit(one))
}

fn unit(one: &Parameter) -> String {
    if one.unit.is_empty() || one.unit == "1" {
        String::new()
    } else {
        format!(" {}", one.unit)
    }
}

pub fn figure(value: f64) -> String {
    let size = value.abs();
    let text = if size == 0.0 {
        "0".to_owned()
    } else if size >= 100.0 {
        format!("{value:.0}")
    } else if size >= 1.0 {
        format!("{value:.2}")
    } else if size >= 0.01 {
        format!("{value:.3}")
    } else {
        format!("{value:.5}")
    };
    text.replace('-', "\u{2212}")
}

/// What is done in words; the manoeuvres' own text where there is one.
pub fn manoeuvre(draft: &serde_json::Value) -> Option<String> {
    let text = |key: &str| draft.get(key).and_then(serde_json::Value::as_str).map(str::to_owned);
    text("what").or_else(|| text("manoeuvre").map(|name| plain(&name)))
}

/// A stage of the work, for a person.
pub fn stage(name: &str) -> String {
    match name {
        "" => "waiting".to_owned(),
        "read" => "reading the runs".to_owned(),
        "calibrate" => "calibrating with the unchanged runs".to_owned(),
        "sensitivities" => "asking what each effect would change".to_owned(),
        "report" => "opening the runs that were held back, writing the report".to_owned(),
        name => match name.strip_prefix("round ") {
            Some(number) => format!("round {number}: screening all effects and fitting the best"),
            None => name.to_owned(),
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn report(text: &str) -> Report {
        serde_json::from_str(text).expect("a report")
    }

    #[test]
    fn the_sentence_says_what_where_and_how_much() {
        let report = report(
            r#"{"robot": "omni-03", "verdict": "confirmed",
                "data": [{"path": "run 1", "role": "train"}, {"path": "run 2", "role": "locked"}, {"path": "run 3", "role": "locked"}],
                "effects": [{"name": "low_friction_patch", "index": null, "parameters": [
                    {"name": "x", "value": 0.8, "unit": "m"}, {"name": "y", "value": -0.2, "unit": "m"},
                    {"name": "radius", "value": 0.3, "unit": "m"}, {"name": "scale", "value": 0.39, "unit": "1"}]}],
                "gap": [{"channel": "pose", "horizon_s": 2.0, "unit": "m", "floor": 0.004, "before": 0.041, "after": 0.006}]}"#,
        );
        assert_eq!(
            headline(&report),
            "omni-03 slips on a patch at (0.8, \u{2212}0.2) m (radius 0.30 m) with 0.39 times the friction; \
             pose gap 2 s ahead 41\u{a0}mm \u{2192} 6.0\u{a0}mm on two runs that were not used."
        );
    }

    #[test]
    fn effects_without_a_phrase_of_their_own_keep_name_and_value() {
        let report = report(
            r#"{"robot": "rwd-01", "verdict": "partial", "effects": [{"name": "steering_offset",
                "parameters": [{"name": "offset", "value": 0.04, "unit": "rad"}, {"name": "limit", "value": null, "unit": "rad"}]}]}"#,
        );
        assert_eq!(headline(&report), "rwd-01 shows steering offset (offset 0.040 rad).");
    }

    #[test]
    fn what_is_not_proven_is_not_told_as_a_fact() {
        let of = |statuses: [&str; 2]| {
            let effects = statuses.map(|status| {
                format!(r#"{{"name": "payload", "status": "{status}", "parameters": [{{"name": "mass", "value": 2.0, "unit": "kg"}}]}}"#)
            });
            headline(&report(&format!(
                r#"{{"robot": "rwd-01", "verdict": "partial", "effects": [{}]}}"#,
                effects.join(", ")
            )))
        };
        let more = "carries 2.0 kg more than described";
        assert!(of(["ambiguous", "ambiguous"]).starts_with("Not proven: rwd-01 carries 2.0 kg more than described"));
        let mixed = format!("rwd-01 {more}, and perhaps {more}.");
        assert_eq!(of(["confirmed", "ambiguous"]), mixed);
        assert_eq!(of(["ambiguous", "confirmed"]), mixed);
        assert_eq!(of(["confirmed", "confirmed"]), format!("rwd-01 {more} and {more}."));
    }

    #[test]
    fn every_verdict_is_explained() {
        for name in ["confirmed", "partial", "ambiguous", "unexplained", "no_discrepancy"] {
            let (word, _, explanation) = verdict(name);
            assert!(word != "Done" && explanation.len() > 40, "{name}");
        }
    }
}
