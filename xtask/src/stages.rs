//! Stages of a long command and the table at its end.

use std::time::{Duration, Instant};

use anyhow::Result;

use crate::End;

/// How a stage ended.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Outcome {
    Passed,
    Failed(String),
    /// Could not run because of another failure: counts as failed.
    NotRun(String),
    /// Left out for a reason that is no failure; the table says it.
    LeftOut(String),
}

struct Row {
    name: &'static str,
    outcome: Outcome,
    time: Duration,
}

/// Stages so far.
pub struct Stages {
    rows: Vec<Row>,
    only: Vec<String>,
    begun: Instant,
}

impl Stages {
    /// With names in `only`, all other stages are left out.
    pub fn new(only: &[String]) -> Self {
        Self {
            rows: Vec::new(),
            only: only.to_vec(),
            begun: Instant::now(),
        }
    }

    /// Runs a stage now. `true` when it passed or was left out.
    pub fn run(&mut self, name: &'static str, stage: impl FnOnce() -> Result<()>) -> bool {
        if !self.only.is_empty() && !self.only.iter().any(|wanted| wanted == name) {
            self.push(name, Outcome::LeftOut("--only".to_owned()), Duration::ZERO);
            return true;
        }
        println!("\n== {name}");
        let started = Instant::now();
        let outcome = match stage() {
            Ok(()) => Outcome::Passed,
            Err(error) => Outcome::Failed(format!("{error:#}")),
        };
        if let Outcome::Failed(words) = &outcome {
            eprintln!("{name}: {words}");
        }
        let passed = outcome == Outcome::Passed;
        self.push(name, outcome, started.elapsed());
        passed
    }

    /// Runs a stage only if `ready` holds; otherwise it counts as failed.
    pub fn run_if(
        &mut self,
        ready: bool,
        why_not: &str,
        name: &'static str,
        stage: impl FnOnce() -> Result<()>,
    ) -> bool {
        if ready {
            return self.run(name, stage);
        }
        self.push(name, Outcome::NotRun(why_not.to_owned()), Duration::ZERO);
        false
    }

    /// Notes a stage that is left out for a reason that is no failure.
    pub fn leave_out(&mut self, name: &'static str, why: &str) {
        println!("\n== {name}: left out, {why}");
        self.push(name, Outcome::LeftOut(why.to_owned()), Duration::ZERO);
    }

    fn push(&mut self, name: &'static str, outcome: Outcome, time: Duration) {
        self.rows.push(Row { name, outcome, time });
    }

    /// Prints the table.
    pub fn finish(self) -> End {
        println!("\n{:<14} {:>8}  result", "stage", "time");
        for row in &self.rows {
            println!(
                "{:<14} {:>7.1}s  {}",
                row.name,
                row.time.as_secs_f64(),
                in_words(&row.outcome)
            );
        }
        let failed = self.rows.iter().filter(|row| is_failure(&row.outcome)).count();
        let minutes = self.begun.elapsed().as_secs_f64() / 60.0;
        println!(
            "{} of {} stages failed, {minutes:.1} min in all",
            failed,
            self.rows.len()
        );
        if failed == 0 { End::Good } else { End::Failed }
    }
}

fn is_failure(outcome: &Outcome) -> bool {
    matches!(outcome, Outcome::Failed(_) | Outcome::NotRun(_))
}

fn in_words(outcome: &Outcome) -> String {
    let first_line = |words: &str| words.lines().next().unwrap_or_default().to_owned();
    match outcome {
        Outcome::Passed => "passed".to_owned(),
        Outcome::Failed(words) => format!("FAILED: {}", first_line(words)),
        Outcome::NotRun(words) => format!("NOT RUN: {}", first_line(words)),
        Outcome::LeftOut(words) => format!("left out: {}", first_line(words)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_failed_stage_fails_the_whole_and_the_rest_still_runs() {
        let mut stages = Stages::new(&[]);
        assert!(!stages.run("first", || anyhow::bail!("no")));
        let mut ran = false;
        assert!(stages.run("second", || {
            ran = true;
            Ok(())
        }));
        assert!(ran);
        assert_eq!(stages.finish(), End::Failed);
    }

    #[test]
    fn a_stage_that_could_not_run_is_a_failure_and_one_left_out_is_none() {
        let mut stages = Stages::new(&[]);
        stages.leave_out("licences", "cargo-deny is not installed");
        assert!(!stages.run_if(false, "the build failed", "smoke", || Ok(())));
        assert_eq!(stages.finish(), End::Failed);
        let mut stages = Stages::new(&["second".to_owned()]);
        assert!(stages.run("first", || anyhow::bail!("must not run")));
        assert_eq!(stages.finish(), End::Good);
    }
}
