//! Why a run waits, in words a person understands.

use crate::RUN_OVERHEAD_S;
use api::run::RunState;

/// What is known about a run's arena at one moment.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Situation {
    pub arena: String,
    pub arena_known: bool,
    /// The twin is to carry the run out.
    pub is_virtual: bool,
    pub lab_connected: bool,
    pub stopped: bool,
    pub held_reason: Option<String>,
    pub robots_missing: Vec<String>,
    /// Sentences without a full stop: why robots of the run get none.
    pub robots_unfit: Vec<String>,
    /// Runs before this one in its side's queue.
    pub ahead: i64,
    /// Time those runs are expected to take.
    pub ahead_s: f64,
    /// Time left of the run that has the arena now.
    pub busy_s: Option<f64>,
}

impl Situation {
    /// Who carries the run out.
    const fn who(&self) -> &'static str {
        if self.is_virtual {
            "simulation server"
        } else {
            "laboratory"
        }
    }
}

/// One sentence; `None` once the robots move or the run has ended.
pub(crate) fn waiting_reason(state: RunState, situation: &Situation) -> Option<String> {
    match state {
        RunState::Draft => Some("not submitted yet".to_owned()),
        RunState::Validating => Some("the twin is checking the experiment".to_owned()),
        RunState::Queued => Some(queued_reason(situation)),
        RunState::Preparing if situation.is_virtual => Some("the simulation server is getting ready".to_owned()),
        RunState::Preparing => Some("the laboratory is placing the robots".to_owned()),
        _ => None,
    }
}

fn queued_reason(situation: &Situation) -> String {
    let arena = &situation.arena;
    if !situation.arena_known {
        return format!("no laboratory has registered the arena {arena}");
    }
    if !situation.lab_connected {
        return format!("the {} is not connected", situation.who());
    }
    if situation.stopped {
        return format!("the arena {arena} is held: the protective stop is pressed");
    }
    if let Some(reason) = &situation.held_reason {
        return format!("the arena {arena} is held: {reason}");
    }
    if !situation.robots_missing.is_empty() {
        let (names, verb) = (
            situation.robots_missing.join(", "),
            if situation.robots_missing.len() == 1 {
                "is"
            } else {
                "are"
            },
        );
        return format!("{names} {verb} not in the arena {arena}");
    }
    if !situation.robots_unfit.is_empty() {
        return situation.robots_unfit.join("; ");
    }
    match situation.ahead + i64::from(situation.busy_s.is_some()) {
        0 => format!("next in line: the {} is about to take it", situation.who()),
        1 => format!("one run ahead of you in arena {arena}"),
        n => format!("{} runs ahead of you in arena {arena}", in_words(n)),
    }
}

fn in_words(n: i64) -> String {
    const WORDS: [&str; 11] = [
        "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten", "eleven", "twelve",
    ];
    let word = usize::try_from(n - 2).ok().and_then(|index| WORDS.get(index));
    word.map_or_else(|| n.to_string(), |word| (*word).to_owned())
}

/// Seconds until the run is expected to start; `None` when nobody can tell.
pub(crate) fn expected_wait_s(state: RunState, situation: &Situation) -> Option<f64> {
    let predictable = state == RunState::Queued
        && situation.lab_connected
        && !situation.stopped
        && situation.held_reason.is_none()
        && situation.robots_missing.is_empty()
        && situation.robots_unfit.is_empty();
    predictable.then(|| situation.busy_s.unwrap_or(0.0) + situation.ahead_s + RUN_OVERHEAD_S / 2.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn free() -> Situation {
        Situation {
            arena: "reference".to_owned(),
            arena_known: true,
            lab_connected: true,
            ..Situation::default()
        }
    }

    #[test]
    fn counts_in_words() {
        let reason = |situation| waiting_reason(RunState::Queued, &situation).unwrap();
        assert_eq!(reason(free()), "next in line: the laboratory is about to take it");
        assert_eq!(
            reason(Situation {
                busy_s: Some(1.0),
                ..free()
            }),
            "one run ahead of you in arena reference"
        );
        assert_eq!(
            reason(Situation {
                ahead: 1,
                busy_s: Some(1.0),
                ..free()
            }),
            "two runs ahead of you in arena reference"
        );
        assert_eq!(
            reason(Situation { ahead: 12, ..free() }),
            "twelve runs ahead of you in arena reference"
        );
        assert_eq!(
            reason(Situation { ahead: 13, ..free() }),
            "13 runs ahead of you in arena reference"
        );
    }

    #[test]
    fn a_held_arena_has_no_expected_start() {
        assert!(expected_wait_s(RunState::Queued, &free()).is_some());
        assert_eq!(
            expected_wait_s(
                RunState::Queued,
                &Situation {
                    stopped: true,
                    ..free()
                }
            ),
            None
        );
        assert_eq!(expected_wait_s(RunState::Running, &free()), None);
    }
}
