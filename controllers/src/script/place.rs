//! Where a script stood when it passed a limit. The language puts the place of the call of `step`, which has none, over the
//! place of such an error; so the tick is carried out again, from the same state, and every place on its way is looked at.

use std::sync::{Arc, Mutex, PoisonError};

use rhai::debugger::{DebuggerCommand, DebuggerEvent};
use rhai::{Engine, EvalAltResult, Position};

use super::engine;
use crate::answer::Answer;
use crate::view::Setup;

/// The last place that `again` comes to; none when it does not fail this time.
///
/// - `operations`: as many as it had the first time; it comes just as far.
pub(super) fn find(
    setup: &Arc<Setup>,
    operations: u64,
    again: impl FnOnce(&Engine) -> Result<(), Box<EvalAltResult>>,
) -> Position {
    // What it says the second time is for nobody.
    let mut answer = Answer::default();
    answer.clear(setup.robots.len());
    let mut engine = engine(setup, &Arc::new(Mutex::new(answer)));
    engine.set_max_operations(operations);
    let last = Arc::new(Mutex::new(Position::NONE));
    let seen = last.clone();
    #[expect(deprecated, reason = "not deprecated, says its author: it may change")]
    engine.register_debugger(
        |_, debugger| debugger,
        move |_, event, _, _, position| {
            // Functions that are left because of the error come, too, with their ends.
            if matches!(event, DebuggerEvent::Step) && !position.is_none() {
                *seen.lock().unwrap_or_else(PoisonError::into_inner) = position;
            }
            Ok(DebuggerCommand::StepInto)
        },
    );
    match again(&engine) {
        Ok(()) => Position::NONE,
        Err(_) => *last.lock().unwrap_or_else(PoisonError::into_inner),
    }
}
