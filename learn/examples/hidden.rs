//! Learns on plants with an effect that the library does not have, and prints the three-way table of each.
//!
//! `cargo run --release -p learn --example hidden -- [--twist] [--seconds N] [--runs N] CHASSIS:EFFECT...`; all when none is named.

use std::sync::atomic::{AtomicUsize, Ordering};

use blind::kind::Kind;
use blind::set::{Set, Wish};
use blind::unknown;
use identify::workers::Workers;
use learn::linear::Target;
use learn::session::{Request, learn};

/// Two threads.
struct Threads;

impl Workers for Threads {
    fn run(&self, count: usize, work: &(dyn Fn(usize) + Sync)) {
        let next = AtomicUsize::new(0);
        std::thread::scope(|scope| {
            for _ in 0..2 {
                scope.spawn(|| {
                    loop {
                        let item = next.fetch_add(1, Ordering::Relaxed);
                        if item >= count {
                            break;
                        }
                        work(item);
                    }
                });
            }
        });
    }
}

const SEED: u64 = 20_261_122;
const USUAL: [&str; 5] = [
    "diff2:air_drag",
    "omni4:sideways_force",
    "omni4:force_hill",
    "rwd:air_drag",
    "diff4:one_sided_loop_gain",
];

/// The set of a chassis with a named unknown effect.
fn set(chassis: &str, effect: &str, wish: &Wish) -> Option<Set> {
    let wish = Wish {
        kind: Some(Kind::Unknown),
        chassis: Some(chassis.to_owned()),
        ..wish.clone()
    };
    let robot = blind::background::robot(chassis, false);
    let number = unknown::names(&robot).iter().position(|name| *name == effect)?;
    Set::new(SEED, number as u64, &wish).ok()
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut wish = Wish {
        seconds: 40,
        references: 4,
        runs: 9,
        ..Wish::standard()
    };
    let (mut target, mut cases) = (Target::Path, Vec::new());
    let mut arguments = std::env::args().skip(1);
    while let Some(argument) = arguments.next() {
        let mut number = || arguments.next().unwrap_or_default().parse::<u32>();
        match argument.as_str() {
            "--twist" => target = Target::Twist,
            "--seconds" => wish.seconds = number()?,
            "--runs" => wish.runs = number()? as usize,
            _ => cases.push(argument),
        }
    }
    if cases.is_empty() {
        cases = USUAL.map(str::to_owned).to_vec();
    }
    for case in cases {
        let (chassis, effect) = case.split_once(':').ok_or("name CHASSIS:EFFECT")?;
        let set = set(chassis, effect, &wish).ok_or("no such chassis or effect")?;
        let driven = set.driven(0)?;
        let begun = std::time::Instant::now();
        let mut request = Request::new(&driven.runs);
        request.references = &driven.references;
        request.target = target;
        let outcome = learn(&Threads, &request)?;
        println!("{case}, {:.1} s", begun.elapsed().as_secs_f64());
        for attempt in &outcome.report.attempts {
            let rounds: Vec<String> = attempt
                .rounds
                .iter()
                .map(|round| {
                    let course = &round.course;
                    format!(
                        "[{} epochs, kept {}, train {:.3} stop {:.3} -> {:.3}; driven {:.3}]",
                        course.epochs,
                        course.kept,
                        course.train,
                        course.validation_before,
                        course.validation,
                        round.validation
                    )
                })
                .collect();
            println!(
                "  {:?}: {} inputs, loss {:.3} -> {:.3} {}",
                attempt.sight,
                attempt.inputs,
                attempt.physics,
                attempt.validation,
                rounds.join(" ")
            );
        }
        println!("{}", outcome.report.table());
    }
    Ok(())
}
