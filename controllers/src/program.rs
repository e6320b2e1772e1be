//! A compiled program, whatever it was written in.

use control::law::Fault;

use crate::answer::{Answer, readable};
use crate::module::ModuleProgram;
use crate::policy::PolicyProgram;
use crate::script::ScriptProgram;
use crate::source::Source;
use crate::view::{Setup, View};

/// Something that answers a view in every control tick.
pub trait Program: std::fmt::Debug + Send {
    /// Fills in the answer, which is cleared on entry.
    ///
    /// - Errors: it cannot go on and will not be asked again.
    fn step(&mut self, view: &View, answer: &mut Answer) -> Result<Reply, Fault>;
}

/// Whether the answer is that of this tick.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reply {
    InTime,
    Late,
}

/// Compiles a program and runs its first part.
///
/// - Errors: what is wrong with it, in a script with line and column.
pub fn compile(source: &Source, setup: &Setup) -> Result<Box<dyn Program>, Fault> {
    let compiled = || -> Result<Box<dyn Program>, Fault> {
        let bytes = source.bytes()?;
        Ok(match source {
            Source::Script(text) => Box::new(ScriptProgram::new(text, setup)?),
            Source::Policy(_) => Box::new(PolicyProgram::new(&bytes, setup)?),
            Source::Module(_) => Box::new(ModuleProgram::new(&bytes, setup)?),
        })
    };
    compiled().map_err(readable)
}
