//! States and codes of the service in words.

use crate::theme::{self, Tone};
use api::run::{Fault, RunState, Whose};
use api::verdict::{Finding, Verdict};

pub const fn run_state(state: RunState) -> (&'static str, Tone) {
    match state {
        RunState::Draft => ("Draft", Tone::Neutral),
        RunState::Validating => ("Checking", Tone::Active),
        RunState::Rejected => ("Rejected", Tone::Error),
        RunState::Queued => ("Queued", Tone::Active),
        RunState::Preparing => ("Preparing", Tone::Active),
        RunState::Running => ("Running", Tone::Good),
        RunState::Uploading => ("Uploading", Tone::Active),
        RunState::Done => ("Done", Tone::Good),
        RunState::Failed => ("Failed", Tone::Error),
        RunState::Cancelled => ("Cancelled", Tone::Neutral),
        RunState::Interrupted => ("Interrupted", Tone::Warning),
    }
}

pub const fn run_state_explained(state: RunState) -> &'static str {
    match state {
        RunState::Draft => "Not submitted yet.",
        RunState::Validating => "The server drives it in its own twin.",
        RunState::Rejected => "The server's twin found a reason not to run it.",
        RunState::Queued => "Waits for its turn.",
        RunState::Preparing => "The robots go to their start poses.",
        RunState::Running => "The robots are driving.",
        RunState::Uploading => "The measurements are on their way to the server.",
        RunState::Done => "Everything was driven and recorded.",
        RunState::Failed => "It ended before it was done.",
        RunState::Cancelled => "Someone took it back.",
        RunState::Interrupted => "The robots had begun to move when it was broken off; what was measured is kept.",
    }
}

pub const fn whose(whose: Whose) -> &'static str {
    match whose {
        Whose::User => "the experiment",
        Whose::Platform => "the platform, not your experiment",
        Whose::Robot => "a robot",
        Whose::Operator => "the operator",
    }
}

pub fn fault(fault: &Fault) -> String {
    format!(
        "{} The cause lies with {}.",
        full_stop(&fault.message),
        whose(fault.whose)
    )
}

/// A sentence that begins and ends as one. Names of robots (`omni-01`) keep their small letter.
pub fn full_stop(text: &str) -> String {
    let text = text.trim();
    let is_name = text
        .split_whitespace()
        .next()
        .is_some_and(|word| word.chars().any(|c| c.is_ascii_digit()));
    let mut letters = text.chars();
    let begun = match letters.next() {
        Some(first) if !is_name => first.to_uppercase().collect::<String>() + letters.as_str(),
        _ => text.to_owned(),
    };
    ended(&begun)
}

/// Part of a sentence with its stop.
pub fn ended(text: &str) -> String {
    let text = text.trim_end();
    if text.is_empty() || text.ends_with(['.', '!', '?']) {
        text.to_owned()
    } else {
        format!("{text}.")
    }
}

/// What the finding says, with its figure and limit when the message does not carry them.
pub fn finding(finding: &Finding) -> String {
    let mut text = full_stop(&finding.message);
    if let (Some(value), Some(limit)) = (finding.value, finding.limit) {
        let unit = finding.unit.as_deref();
        let figure = theme::with_unit(value, unit);
        if !text.chars().any(|c| c.is_ascii_digit()) {
            text.push_str(&format!(" {figure}, limit {}.", theme::with_unit(limit, unit)));
        }
    }
    text
}

pub fn finding_tone(finding: &Finding) -> Tone {
    if finding.severity == "error" {
        Tone::Error
    } else {
        Tone::Warning
    }
}

/// The figures of a verdict, in one line.
pub fn verdict_figures(verdict: &Verdict) -> String {
    let mut parts = vec![format!(
        "{} driven",
        theme::seconds(verdict.ticks as f64 / f64::from(api::CONTROL_HZ))
    )];
    if let Some(separation_m) = verdict.smallest_separation_m {
        parts.push(format!("robots at least {} apart", theme::metres(separation_m)));
    }
    parts.push(format!(
        "walls at least {} away",
        theme::metres(verdict.smallest_wall_distance_m)
    ));
    if let Some(error_m) = verdict.largest_path_error_m {
        parts.push(format!("at most {} off the path", theme::millimetres(error_m)));
    }
    parts.join("  \u{b7}  ")
}

/// What the safety filter did.
pub fn safety(code: &str) -> &str {
    match code {
        "wall" => "held off the wall",
        "robot" => "held off a robot",
        "speed" => "slowed down",
        "stop" => "stopped",
        other => other,
    }
}

/// Chassis as people call it.
pub fn chassis(code: &str) -> &str {
    match code {
        "omni4" => "four omni wheels",
        "diff2" => "two driven wheels",
        "diff4" => "four driven wheels, skid steering",
        "fwd" => "front-wheel drive, steered",
        "rwd" => "rear-wheel drive, steered",
        "awd" => "all-wheel drive, steered",
        other => other,
    }
}

/// The field of a problem as it stands on the page.
pub fn field(path: &str) -> String {
    let words = path.trim_start_matches("experiment.");
    let (noun, rest) = words.split_once('[').unwrap_or((words, ""));
    let Some((number, tail)) = rest
        .split_once(']')
        .and_then(|(n, t)| Some((n.parse::<usize>().ok()? + 1, t)))
    else {
        return readable(words);
    };
    let noun = match noun {
        "robots" => "Robot",
        "targets" => "Target",
        other => other,
    };
    match tail.trim_start_matches('.') {
        "" => format!("{noun} {number}"),
        tail => format!("{noun} {number}, {}", readable(tail).to_lowercase()),
    }
}

fn readable(path: &str) -> String {
    let path = path
        .trim_start_matches("control.parameters.")
        .trim_start_matches("control.");
    let text = match path {
        "duration_s" => "duration".to_owned(),
        "start.x_m" => "start, x".to_owned(),
        "start.y_m" => "start, y".to_owned(),
        "start.yaw_rad" => "start, heading".to_owned(),
        "x_m" => "x".to_owned(),
        "y_m" => "y".to_owned(),
        "yaw_rad" => "heading".to_owned(),
        other => other.replace(['_', '.'], " "),
    };
    let mut letters = text.chars();
    letters
        .next()
        .map_or_else(String::new, |c| c.to_uppercase().collect::<String>() + letters.as_str())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_are_named_as_on_the_page() {
        assert_eq!(field("robots[1].start.x_m"), "Robot 2, start, x");
        assert_eq!(field("targets[0].y_m"), "Target 1, y");
        assert_eq!(field("duration_s"), "Duration");
        assert_eq!(field("control.parameters.epsilon_p"), "Epsilon p");
        assert_eq!(field("robots"), "Robots");
    }

    #[test]
    fn a_finding_carries_its_figure_once() {
        let mut f = Finding {
            severity: "error".to_owned(),
            code: "robots_collide".to_owned(),
            at_s: 4.2,
            robots: vec!["omni-01".to_owned(), "omni-02".to_owned()],
            value: Some(0.031),
            limit: Some(0.1),
            unit: Some("m".to_owned()),
            message: "the robots come too close".to_owned(),
        };
        assert_eq!(finding(&f), "The robots come too close. 31 mm, limit 100 mm.");
        f.message = "only 31 mm remain".to_owned();
        assert_eq!(finding(&f), "Only 31 mm remain.");
    }
}
