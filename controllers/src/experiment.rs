//! Experiments whose law may be the user's own: checks, team and rehearsal for all laws alike.

use control::law::{self, Fault, OWN};
use control::rehearsal::{Outcome, Rehearsal};
use control::scenario::{FieldProblem, Scenario};
use control::team::{Team, robots};

use crate::law::OwnLaw;
use crate::program::{Program, compile};
use crate::ranges::Surroundings;
use crate::source::Source;
use crate::view::Setup;

/// What the program of a scenario sees that does not change.
///
/// - Errors: robots whose descriptions cannot be used.
pub fn setup(scenario: &Scenario) -> Result<Setup, Vec<FieldProblem>> {
    let bodies = law::bodies(scenario, &robots(scenario)?);
    let arena_m = [scenario.arena.width_m, scenario.arena.height_m];
    let parameters = law::own::numbers(&scenario.experiment.control);
    Ok(Setup::new(&bodies, &law::goals(scenario), arena_m, parameters))
}

/// Whether the scenario's law is the user's own.
pub fn is_own(scenario: &Scenario) -> bool {
    scenario.experiment.control.law == OWN
}

/// Control for a scenario, whatever its law; the program runs in this process.
pub fn team(scenario: &Scenario) -> Result<Team, Vec<FieldProblem>> {
    team_with(scenario, compile)
}

/// [`team`], with a program that `make` brings up: elsewhere, for example.
pub fn team_with(
    scenario: &Scenario,
    make: impl FnOnce(&Source, &Setup) -> Result<Box<dyn Program>, Fault>,
) -> Result<Team, Vec<FieldProblem>> {
    if !is_own(scenario) {
        return Team::new(scenario);
    }
    let problems = scenario.check();
    if !problems.is_empty() {
        return Err(problems);
    }
    let source = Source::of(&scenario.experiment.control).ok_or_else(|| vec![no_program()])?;
    let program = make(&source, &setup(scenario)?).map_err(|fault| vec![problem(&source, &fault)])?;
    team_of(scenario, program)
}

/// Control for a scenario by a program that is already up.
pub fn team_of(scenario: &Scenario, program: Box<dyn Program>) -> Result<Team, Vec<FieldProblem>> {
    let arena_m = [scenario.arena.width_m, scenario.arena.height_m];
    let surroundings = Surroundings::new(arena_m, &scenario.arena.contents);
    let law = OwnLaw::new(program, robots(scenario)?, surroundings);
    Team::corrected(scenario, Box::new(law))
}

/// All rules of an experiment and of its program; empty when it may be simulated.
pub fn check(scenario: &Scenario) -> Vec<FieldProblem> {
    let problems = scenario.check();
    if !problems.is_empty() || !is_own(scenario) {
        return problems;
    }
    team(scenario).err().unwrap_or_default()
}

/// A rehearsal of a scenario, whatever its law.
pub fn rehearsal(scenario: &Scenario) -> Result<Rehearsal, Vec<FieldProblem>> {
    Rehearsal::with_team(scenario, team(scenario)?)
}

/// Rehearses a scenario from start to end.
pub fn rehearse_json(scenario_json: &str) -> Result<Outcome, Vec<FieldProblem>> {
    let mut rehearsal = rehearsal(&Scenario::from_json(scenario_json)?)?;
    while rehearsal.step() {}
    Ok(rehearsal.finish())
}

fn no_program() -> FieldProblem {
    FieldProblem {
        field: "control.parameters".into(),
        message: "there is no program".into(),
        limit: "one of `script` and `module`".into(),
        remedy: "give exactly one of the two".into(),
    }
}

/// A program that is refused, as a problem of its field.
pub fn problem(source: &Source, fault: &Fault) -> FieldProblem {
    let remedy = match (fault.line, fault.column) {
        (Some(line), Some(column)) => format!("correct the script at line {line}, column {column}"),
        _ => "correct the program; docs/controllers.md says what it may use".to_owned(),
    };
    FieldProblem {
        field: format!("control.parameters.{}", source.key()),
        message: fault.to_string(),
        limit: "a program that compiles, starts and stays within its limits".into(),
        remedy,
    }
}
