//! Programs as rhai scripts: `fn step(now)`, and `fn start(now)` if something is to be made ready. Both have a map `this` that
//! lasts for the run.

mod maths;
mod place;
mod robots;
mod spans;
mod state;
mod words;

use std::sync::{Arc, Mutex, PoisonError};

use control::law::{Fault, FaultKind};
use rhai::packages::{
    ArithmeticPackage, BasicArrayPackage, BasicFnPackage, BasicIteratorPackage, BasicMapPackage, BasicStringPackage,
    LogicPackage, MoreStringPackage, Package,
};
use rhai::{AST, CallFnOptions, Dynamic, Engine, EvalAltResult, OptimizationLevel, Position, Scope};

use crate::answer::{Answer, readable};
use crate::limits;
use crate::program::{Program, Reply};
use crate::source::refused;
use crate::view::{Setup, View};
use robots::Now;

/// Words of the language that reach out of a script or call the machine's own mathematics.
const DISABLED: [&str; 7] = ["eval", "import", "export", "sleep", "**", "**=", "debug"];
const STEP: &str = "step";
const START: &str = "start";

/// See the module.
pub(crate) struct ScriptProgram {
    engine: Engine,
    ast: AST,
    state: Dynamic,
    setup: Arc<Setup>,
    spoken: Arc<Mutex<Answer>>,
    has_start: bool,
}

impl std::fmt::Debug for ScriptProgram {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("ScriptProgram")
            .field("robots", &self.setup.robots.len())
            .finish()
    }
}

impl ScriptProgram {
    /// Compiles a script.
    pub(crate) fn new(text: &str, setup: &Setup) -> Result<ScriptProgram, Fault> {
        let setup = Arc::new(setup.clone());
        let spoken = Arc::new(Mutex::new(Answer::default()));
        let engine = engine(&setup, &spoken);
        let ast = engine.compile(text).map_err(|error| {
            let reason = error.err_type().to_string();
            placed(refused(reason), error.position())
        })?;
        let has = |name: &str| ast.iter_functions().any(|f| f.name == name && f.params.len() == 1);
        if !has(STEP) {
            return Err(refused("the script has no `fn step(now)`".into()));
        }
        if let Some(outside) = statement_outside(&ast) {
            let reason = "statements outside functions are never carried out; put them into `fn start(now)`";
            return Err(placed(refused(reason.into()), outside));
        }
        Ok(ScriptProgram {
            has_start: has(START),
            state: Dynamic::from_map(rhai::Map::new()),
            engine,
            ast,
            setup,
            spoken,
        })
    }

    fn call(&mut self, name: &str, now: Now, operations: u64) -> Result<(), Fault> {
        let tick = now.tick();
        self.engine.set_max_operations(operations);
        let before = self.state.clone();
        match call(&self.engine, &self.ast, &mut self.state, name, now.clone()) {
            Ok(()) => state::check(&self.state).map_err(|reason| Fault::new(FaultKind::Exhausted, Some(tick), reason)),
            Err(error) => {
                let fault = fault(&error, tick, operations);
                if fault.kind != FaultKind::Exhausted {
                    return Err(fault);
                }
                let found = place::find(&self.setup, operations, |engine| {
                    call(engine, &self.ast, &mut before.clone(), name, now.clone())
                });
                Err(placed(fault, found))
            }
        }
    }
}

/// Calls a function of the script.
fn call(engine: &Engine, ast: &AST, state: &mut Dynamic, name: &str, now: Now) -> Result<(), Box<EvalAltResult>> {
    let options = CallFnOptions::new().eval_ast(false).bind_this_ptr(state);
    let done = engine.call_fn_with_options::<Dynamic>(options, &mut Scope::new(), ast, name, (now,));
    done.map(|_| ())
}

impl Program for ScriptProgram {
    fn step(&mut self, view: &View, answer: &mut Answer) -> Result<Reply, Fault> {
        // Taken, not copied: the script speaks into it meanwhile.
        *lock(&self.spoken) = std::mem::take(answer);
        let now = Now::new(&self.setup, view);
        let mut done = Ok(());
        if std::mem::take(&mut self.has_start) {
            done = self.call(START, now.clone(), limits::SCRIPT_START_OPERATIONS);
        }
        let done = done.and_then(|()| self.call(STEP, now, limits::SCRIPT_OPERATIONS));
        *answer = std::mem::take(&mut *lock(&self.spoken));
        done.map(|()| Reply::InTime)
    }
}

fn lock(answer: &Mutex<Answer>) -> std::sync::MutexGuard<'_, Answer> {
    answer.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Seed of the engine's hash tables. Its own is drawn when it is compiled, another one in every build.
const HASHES: [u64; 4] = [0x0052_6f62, 0x6f70, 0x6865, 0x7573];

/// An engine that knows nothing, with the same hash tables in every build.
fn empty_engine() -> Engine {
    // Refused when it is set already: to the same.
    let _already_set = rhai::config::hashing::set_hashing_seed(Some(HASHES));
    Engine::new_raw()
}

fn engine(setup: &Arc<Setup>, spoken: &Arc<Mutex<Answer>>) -> Engine {
    let mut engine = empty_engine();
    // The packages that neither wait, nor load, nor call the machine's own mathematics; the language's core comes as words.
    engine.register_global_module(ArithmeticPackage::new().as_shared_module());
    engine.register_global_module(BasicStringPackage::new().as_shared_module());
    engine.register_global_module(BasicIteratorPackage::new().as_shared_module());
    engine.register_global_module(BasicFnPackage::new().as_shared_module());
    engine.register_global_module(LogicPackage::new().as_shared_module());
    engine.register_global_module(BasicArrayPackage::new().as_shared_module());
    engine.register_global_module(BasicMapPackage::new().as_shared_module());
    engine.register_global_module(MoreStringPackage::new().as_shared_module());
    for word in DISABLED {
        engine.disable_symbol(word);
    }
    engine.set_optimization_level(OptimizationLevel::Simple);
    engine.set_strict_variables(true);
    engine.set_fail_on_invalid_map_property(true);
    engine.set_max_call_levels(limits::SCRIPT_CALL_DEPTH);
    engine.set_max_expr_depths(limits::SCRIPT_EXPRESSION_DEPTH, limits::SCRIPT_EXPRESSION_DEPTH);
    engine.set_max_string_size(limits::SCRIPT_STRING_BYTES);
    engine.set_max_array_size(limits::SCRIPT_ARRAY_VALUES);
    engine.set_max_map_size(limits::SCRIPT_MAP_ENTRIES);
    engine.set_max_functions(limits::SCRIPT_NAMES);
    engine.set_max_variables(limits::SCRIPT_NAMES);
    engine.set_max_strings_interned(limits::SCRIPT_NAMES);
    maths::register(&mut engine);
    robots::register(&mut engine);
    words::register(&mut engine, setup, spoken);
    spans::register(&mut engine);
    let log = spoken.clone();
    engine.on_print(move |text| lock(&log).log(text));
    engine
}

/// Where the first statement outside all functions stands: an engine that knows nothing is stopped by it at once.
fn statement_outside(ast: &AST) -> Option<Position> {
    let mut engine = empty_engine();
    engine.on_progress(|_| Some(Dynamic::UNIT));
    let done = engine.run_ast(&ast.clone_statements_only());
    done.err().map(|error| error.position())
}

/// An error of a running script in words, with the innermost place.
fn fault(error: &EvalAltResult, tick: u64, operations: u64) -> Fault {
    let inner = error.unwrap_inner();
    let (kind, reason) = match inner {
        EvalAltResult::ErrorTooManyOperations(_) => (
            FaultKind::Exhausted,
            format!("more than {operations} operations in one tick"),
        ),
        EvalAltResult::ErrorStackOverflow(_) => {
            let depth = limits::SCRIPT_CALL_DEPTH;
            (
                FaultKind::Exhausted,
                format!("more than {depth} functions that call each other"),
            )
        }
        EvalAltResult::ErrorDataTooLarge(what, _) => (FaultKind::Exhausted, format!("{what} is too large")),
        EvalAltResult::ErrorRuntime(value, _) => (FaultKind::Failed, value.to_string()),
        other => {
            let mut bare = format!("{other}");
            if let Some(at) = bare.rfind(" (line ") {
                bare.truncate(at);
            }
            (FaultKind::Failed, bare)
        }
    };
    let kind = if reason.contains(words::BAD_COMMAND) {
        FaultKind::BadCommand
    } else {
        kind
    };
    let position = if inner.position().is_none() {
        error.position()
    } else {
        inner.position()
    };
    readable(placed(Fault::new(kind, Some(tick), reason), position))
}

fn placed(fault: Fault, position: Position) -> Fault {
    Fault {
        line: position.line().map(|line| line as u32),
        column: position.line().map(|_| position.position().unwrap_or(1) as u32),
        ..fault
    }
}
