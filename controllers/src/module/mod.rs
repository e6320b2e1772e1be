//! Programs as core WebAssembly modules: exports `memory`, `buffer(words) -> pointer` and `step(pointer, words) -> pointer`.

mod host;
mod layout;

use control::law::{Fault, FaultKind};
use wasmi::{
    CompilationMode, Config, CustomFuelCosts, EnforcedLimits, Engine, Error, ExternType, Instance, Linker, Memory,
    Module, Store, StoreLimits, StoreLimitsBuilder, TrapCode, TypedFunc,
};

use crate::answer::Answer;
use crate::limits;
use crate::program::{Program, Reply};
use crate::source::refused;
use crate::view::{Setup, View};

/// What a running module's host keeps.
pub(crate) struct Host {
    limits: StoreLimits,
    answer: Answer,
}

/// See the module.
pub(crate) struct ModuleProgram {
    store: Store<Host>,
    memory: Memory,
    step: TypedFunc<(i32, i32), i32>,
    /// Where views are written in the module's memory.
    buffer: usize,
    setup: Setup,
    /// A view on its way.
    bytes: Vec<u8>,
}

impl std::fmt::Debug for ModuleProgram {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("ModuleProgram")
            .field("robots", &self.setup.robots.len())
            .finish()
    }
}

impl ModuleProgram {
    /// Checks, compiles and instantiates a module and asks it for its buffer.
    pub(crate) fn new(bytes: &[u8], setup: &Setup) -> Result<ModuleProgram, Fault> {
        let engine = Engine::new(&config());
        let module = Module::new(&engine, bytes).map_err(|error| refused(format!("not a usable module: {error}")))?;
        check(&module)?;
        let limits = StoreLimitsBuilder::new()
            .memory_size(limits::MODULE_MEMORY_BYTES)
            .table_elements(limits::MODULE_TABLE_ENTRIES)
            .instances(1)
            .memories(1)
            .tables(1)
            .build();
        let host = Host {
            limits,
            answer: Answer::default(),
        };
        let mut store = Store::new(&engine, host);
        store.limiter(|host| &mut host.limits);
        let fuel =
            |store: &mut Store<Host>, fuel: u64| store.set_fuel(fuel).map_err(|error| refused(error.to_string()));
        fuel(&mut store, limits::MODULE_START_FUEL)?;
        let mut linker = Linker::new(&engine);
        host::define(&mut linker).map_err(|error| refused(error.to_string()))?;
        let instance: Instance = linker
            .instantiate_and_start(&mut store, &module)
            .map_err(|error| stopped(&error, None, limits::MODULE_START_FUEL))?;
        let missing = |name: &str| refused(format!("the module does not export `{name}` as it must be"));
        let memory = instance.get_memory(&store, "memory").ok_or_else(|| missing("memory"))?;
        let buffer = instance
            .get_typed_func::<i32, i32>(&store, "buffer")
            .map_err(|_| missing("buffer"))?;
        let step = instance
            .get_typed_func::<(i32, i32), i32>(&store, "step")
            .map_err(|_| missing("step"))?;
        let words = layout::view_words(setup);
        let pointer = buffer
            .call(&mut store, words as i32)
            .map_err(|error| stopped(&error, None, limits::MODULE_START_FUEL))?;
        let buffer = pointer as u32 as usize;
        if buffer
            .checked_add(words * 8)
            .is_none_or(|end| end > memory.data_size(&store))
        {
            let reason = format!("`buffer` gave {buffer}, where {words} words do not fit into the memory");
            return Err(refused(reason));
        }
        Ok(ModuleProgram {
            store,
            memory,
            step,
            buffer,
            setup: setup.clone(),
            bytes: Vec::with_capacity(words * 8),
        })
    }
}

impl Program for ModuleProgram {
    fn step(&mut self, view: &View, answer: &mut Answer) -> Result<Reply, Fault> {
        let tick = Some(view.tick);
        let bad = |reason: &str| Fault::new(FaultKind::BadCommand, tick, reason);
        layout::write(view, &self.setup, &mut self.bytes);
        let words = (self.bytes.len() / 8) as i32;
        let memory = self.memory.data_mut(&mut self.store);
        let place = memory.get_mut(self.buffer..self.buffer + self.bytes.len());
        place
            .ok_or_else(|| bad("the buffer is no longer in the memory"))?
            .copy_from_slice(&self.bytes);
        self.store.data_mut().answer = std::mem::take(answer);
        let fuel = self.store.set_fuel(limits::MODULE_FUEL);
        fuel.map_err(|error| Fault::new(FaultKind::Failed, tick, error.to_string()))?;
        let called = self.step.call(&mut self.store, (self.buffer as i32, words));
        *answer = std::mem::take(&mut self.store.data_mut().answer);
        let pointer = called.map_err(|error| stopped(&error, tick, limits::MODULE_FUEL))? as u32 as usize;
        let memory = self.memory.data(&self.store);
        let length = answer.robots.len() * layout::ORDER_WORDS * 8;
        let orders = pointer.checked_add(length).and_then(|end| memory.get(pointer..end));
        let orders = orders.ok_or_else(|| bad("`step` gave a pointer whose commands lie outside the memory"))?;
        for (robot, (say, words)) in answer
            .robots
            .iter_mut()
            .zip(orders.chunks_exact(layout::ORDER_WORDS * 8))
            .enumerate()
        {
            *say = layout::read(words, robot).map_err(|reason| bad(&reason))?;
        }
        Ok(Reply::InTime)
    }
}

fn config() -> Config {
    let mut config = Config::default();
    config
        .consume_fuel(true)
        .fuel_cost(CustomFuelCosts {
            bytes_copied_per_fuel: limits::BYTES_PER_FUEL,
            fuel_per_bytes_translated: 7,
            fuel_per_bytes_validated: 2,
        })
        // Everything is translated before the first tick: none pays for it.
        .compilation_mode(CompilationMode::Eager)
        .enforced_limits(EnforcedLimits::strict())
        .set_max_recursion_depth(limits::MODULE_CALL_DEPTH)
        .set_max_stack_height(limits::MODULE_STACK_BYTES)
        .allow_start_fn(false)
        .wasm_multi_memory(false)
        .wasm_custom_page_sizes(false)
        .wasm_tail_call(false)
        .wasm_wide_arithmetic(false)
        .ignore_custom_sections(true);
    config
}

/// Imports must be the host's, and what has to be exported must be there, before anything runs.
fn check(module: &Module) -> Result<(), Fault> {
    for import in module.imports() {
        let known = import.module() == host::NAME && host::FUNCTIONS.contains(&import.name());
        if !known {
            return Err(refused(format!(
                "the import {}.{} is not there; a module may import from `{}`: {}",
                import.module(),
                import.name(),
                host::NAME,
                host::FUNCTIONS.join(", ")
            )));
        }
    }
    for name in ["memory", "buffer", "step"] {
        let fits = match module.get_export(name) {
            Some(ExternType::Memory(_)) => name == "memory",
            Some(ExternType::Func(_)) => name != "memory",
            _ => false,
        };
        if !fits {
            return Err(refused(format!("the module does not export `{name}` as it must be")));
        }
    }
    Ok(())
}

/// Why a call did not come back, in words.
fn stopped(error: &Error, tick: Option<u64>, fuel: u64) -> Fault {
    let (kind, reason) = match error.as_trap_code() {
        Some(TrapCode::OutOfFuel) => (
            FaultKind::Exhausted,
            format!("more than {fuel} units of fuel in one tick"),
        ),
        Some(TrapCode::StackOverflow) => {
            let (bytes, calls) = (limits::MODULE_STACK_BYTES, limits::MODULE_CALL_DEPTH);
            (
                FaultKind::Exhausted,
                format!("the stack holds {bytes} bytes and {calls} calls"),
            )
        }
        Some(code) => (FaultKind::Failed, format!("trap: {}", code.trap_message())),
        None => (FaultKind::Failed, error.to_string()),
    };
    let kind = if tick.is_none() { FaultKind::Refused } else { kind };
    Fault::new(kind, tick, reason)
}
