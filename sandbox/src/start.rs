//! Bringing programs up in the sandbox, for whoever runs experiments.

use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::time::Duration;

use control::law::{Fault, FaultKind};
use control::rehearsal::Rehearsal;
use control::scenario::{FieldProblem, Scenario};
use control::team::Team;
use controllers::experiment::team_with;
use controllers::source::Source;
use controllers::view::Setup;

use crate::pipe::PipeProgram;

/// The sandbox's program beside this one; `ROBOPHEUS_CONTROLLER` names another.
const PROGRAM: &str = "robopheus-controller";
/// Longest wait in a rehearsal: nothing is driving, and its result must not hang on how busy the machine is.
pub const REHEARSAL_PATIENCE: Duration = Duration::from_secs(10);
/// Longest wait in a run on robots: the rest of a tick's deadline of 4 ms is the filter's and the link's.
pub const RUN_PATIENCE: Duration = Duration::from_micros(2_500);

/// Where the sandbox's program is.
pub fn program() -> Result<PathBuf, Fault> {
    if let Some(path) = std::env::var_os("ROBOPHEUS_CONTROLLER") {
        return Ok(path.into());
    }
    let own = std::env::current_exe().ok();
    // Tests and examples stand one folder deeper.
    let folders = own.iter().flat_map(|own| own.ancestors().skip(1).take(2));
    let found = folders.map(|folder| folder.join(PROGRAM)).find(|path| path.is_file());
    found.ok_or_else(|| {
        Fault::new(
            FaultKind::Died,
            None,
            format!("the program {PROGRAM} is not installed here"),
        )
    })
}

/// A user's program in a process of its own: no environment, no files, no network ([`crate::confine`]).
///
/// - Errors: what is wrong with the program, or that it cannot be confined here; it is not started then.
pub fn start(source: &Source, setup: &Setup, patience: Duration) -> Result<PipeProgram, Fault> {
    let mut command = Command::new(program()?);
    command.env_clear().current_dir("/").stderr(Stdio::null());
    let program = PipeProgram::start(command, Some(source), setup, patience)?;
    let layers = program.confined();
    if !crate::confine::ESSENTIAL
        .iter()
        .all(|layer| layers.iter().any(|known| known == layer))
    {
        let reason = format!(
            "this machine cannot confine programs of users: only {}",
            layers.join(", ")
        );
        return Err(Fault::new(FaultKind::Refused, None, reason));
    }
    Ok(program)
}

/// Control for a scenario, whatever its law; a user's program runs in the sandbox.
pub fn team(scenario: &Scenario, patience: Duration) -> Result<Team, Vec<FieldProblem>> {
    team_with(scenario, |source, setup| Ok(Box::new(start(source, setup, patience)?)))
}

/// A rehearsal of a scenario, whatever its law; a user's program runs in the sandbox.
pub fn rehearsal(scenario: &Scenario) -> Result<Rehearsal, Vec<FieldProblem>> {
    Rehearsal::with_team(scenario, team(scenario, REHEARSAL_PATIENCE)?)
}
