//! States and faults as they stand in SQL.

use api::run::{Fault, RunState, Whose};

const ALL: [RunState; 11] = [
    RunState::Draft,
    RunState::Validating,
    RunState::Rejected,
    RunState::Queued,
    RunState::Preparing,
    RunState::Running,
    RunState::Uploading,
    RunState::Done,
    RunState::Failed,
    RunState::Cancelled,
    RunState::Interrupted,
];

/// State of a name that a CHECK constraint has let in.
pub(crate) fn state_from_sql(name: &str) -> RunState {
    match ALL.into_iter().find(|state| state.as_str() == name) {
        Some(state) => state,
        None => unreachable!("the constraint runs_state_known let `{name}` in"),
    }
}

pub(crate) const fn whose_to_sql(whose: Whose) -> &'static str {
    match whose {
        Whose::User => "user",
        Whose::Platform => "platform",
        Whose::Robot => "robot",
        Whose::Operator => "operator",
    }
}

pub(crate) fn fault_from_sql(whose: Option<String>, code: Option<String>, message: Option<String>) -> Option<Fault> {
    let whose = match whose?.as_str() {
        "user" => Whose::User,
        "robot" => Whose::Robot,
        "operator" => Whose::Operator,
        _ => Whose::Platform,
    };
    Some(Fault {
        whose,
        code: code?,
        message: message?,
    })
}

pub(crate) fn fault(whose: Whose, code: &str, message: impl Into<String>) -> Fault {
    Fault {
        whose,
        code: code.to_owned(),
        message: message.into(),
    }
}

pub(crate) fn fault_of_cancel(by: Option<&str>) -> Fault {
    match by {
        Some(name) => fault(Whose::User, "cancelled_by_user", format!("Cancelled by {name}.")),
        None => fault(
            Whose::Operator,
            "cancelled_in_laboratory",
            "Cancelled in the laboratory.",
        ),
    }
}

/// Where a run goes when its attempt is lost: a run that moved is never repeated by itself.
pub(crate) fn after_lost_attempt(lost: LostAttempt<'_>) -> (RunState, Option<Fault>) {
    match lost.state {
        RunState::Preparing if lost.cancel_requested => (RunState::Cancelled, Some(fault_of_cancel(lost.cancelled_by))),
        RunState::Preparing if lost.attempts < lost.attempts_limit => (RunState::Queued, None),
        RunState::Preparing => {
            let message = format!(
                "The laboratory was lost {} times while it prepared this run. Last: {}",
                lost.attempts, lost.cause.message
            );
            (
                RunState::Failed,
                Some(fault(Whose::Platform, "attempts_used_up", message)),
            )
        }
        _ => (RunState::Interrupted, Some(lost.cause.clone())),
    }
}

pub(crate) struct LostAttempt<'a> {
    pub state: RunState,
    pub attempts: i32,
    pub attempts_limit: i32,
    pub cancel_requested: bool,
    pub cancelled_by: Option<&'a str>,
    pub cause: &'a Fault,
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lost(state: RunState, attempts: i32, cancel_requested: bool) -> RunState {
        let cause = fault(Whose::Platform, "lease_lost", "lost");
        after_lost_attempt(LostAttempt {
            state,
            attempts,
            attempts_limit: 3,
            cancel_requested,
            cancelled_by: None,
            cause: &cause,
        })
        .0
    }

    #[test]
    fn only_a_run_that_never_moved_is_repeated() {
        assert_eq!(lost(RunState::Preparing, 1, false), RunState::Queued);
        assert_eq!(lost(RunState::Preparing, 3, false), RunState::Failed);
        assert_eq!(lost(RunState::Preparing, 1, true), RunState::Cancelled);
        assert_eq!(lost(RunState::Running, 1, false), RunState::Interrupted);
        assert_eq!(lost(RunState::Uploading, 1, true), RunState::Interrupted);
    }

    #[test]
    fn every_state_reads_back() {
        for state in ALL {
            assert_eq!(state_from_sql(state.as_str()), state);
        }
    }
}
