//! Learns on plants with a force that the library does not have, or on logs of real robots, and prints the three-way table
//! of each.
//!
//! `cargo run --release -p learn --example hidden -- [--twist] [--motion] [--seconds N] [--runs N] CASE...`; a case is
//! `CHASSIS:EFFECT`, `husky`, `dart` or `mrclam`.

#[path = "../tests/support/plants.rs"]
mod plants;
#[path = "../../identify/tests/real_logs/mod.rs"]
mod real_logs;
#[path = "../tests/support/threads.rs"]
mod threads;

use identify::diagnose::Run;
use learn::inputs::Sight;
use learn::linear::Target;
use learn::report::Report;
use learn::session::{Request, Shelf, learn};

use threads::Threads;

const USUAL: [&str; 6] = [
    "diff2:air_drag",
    "omni4:sideways_force",
    "omni4:force_hill",
    "husky",
    "dart",
    "mrclam",
];

/// References and runs of a case; `None` where the logs are absent.
fn case(name: &str, seconds: u32, runs: usize) -> Option<(Vec<Run>, Vec<Run>)> {
    let none = Vec::new();
    Some(match name {
        "husky" => (
            none,
            real_logs::husky::runs(real_logs::husky::ROBOT, &[true, false, true, false], 12, 20, true)?,
        ),
        "dart" => {
            let mut all = Vec::new();
            for name in real_logs::dart::FREE {
                all.extend(real_logs::dart::runs(name, 3)?);
            }
            (none, all)
        }
        "mrclam" => (none, real_logs::mrclam::runs(1, 100.0, 60.0, 8)?),
        plant => {
            let (chassis, effect) = plant.split_once(':')?;
            let driven = plants::driven(chassis, effect, seconds, 3, runs);
            (driven.references, driven.runs)
        }
    })
}

fn courses(report: &Report) {
    for attempt in &report.attempts {
        println!(
            "  {:?}: {} inputs, loss {:.3} -> {:.3}",
            attempt.sight, attempt.inputs, attempt.physics, attempt.validation
        );
        for round in &attempt.rounds {
            let course = &round.course;
            println!(
                "    {} epochs, kept {}: train {:.3}, stop {:.3} -> {:.3}; step {}, driven {:.3}",
                course.epochs,
                course.kept,
                course.train,
                course.validation_before,
                course.validation,
                round.step,
                round.validation
            );
        }
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let (mut seconds, mut runs) = (30, 9);
    let (mut target, mut motion, mut cases) = (Target::Path, false, Vec::new());
    let mut arguments = std::env::args().skip(1);
    while let Some(argument) = arguments.next() {
        match argument.as_str() {
            "--twist" => target = Target::Twist,
            "--motion" => motion = true,
            "--seconds" => seconds = arguments.next().unwrap_or_default().parse()?,
            "--runs" => runs = arguments.next().unwrap_or_default().parse()?,
            _ => cases.push(argument),
        }
    }
    if cases.is_empty() {
        cases = USUAL.map(str::to_owned).to_vec();
    }
    for name in cases {
        let Some((references, runs)) = case(&name, seconds, runs) else {
            continue;
        };
        // Real robots: what can be named is named first, on runs that are not locked.
        let (mut runs, mut locked, mut model) = (runs, Vec::new(), None);
        if references.is_empty() {
            locked = runs.split_off(runs.len() - runs.len() / 4);
            let input = identify::diagnose::Input {
                references: Vec::new(),
                runs: runs.clone(),
                locked: Vec::new(),
                model: None,
                seed: 1,
            };
            let found = identify::diagnose::diagnose(&Threads, &input)?;
            let names: Vec<&str> = found.model.effects.iter().map(|effect| effect.name.as_str()).collect();
            println!("{name}: {}; model: {}", found.report.sentence, names.join(", "));
            model = Some(found.model);
        }
        let mut request = Request::new(&runs);
        request.references = &references;
        request.locked = (!locked.is_empty()).then_some(&locked as &dyn Shelf);
        request.model = model;
        request.target = target;
        if motion {
            request.sights = vec![Sight::Motion];
        }
        println!("{name}");
        match learn(&Threads, &request) {
            Ok(outcome) => {
                courses(&outcome.report);
                println!("{}", outcome.report.table());
            }
            Err(error) => println!("  refused: {error}\n"),
        }
    }
    Ok(())
}
