//! CPU seconds of a diagnosis of ten minutes of logs with the whole library on one thread, by stage.
//!
//! `cargo xtask bench identify`, or
//! `cargo run --release -p identify --example ten_minutes -- [CHASSIS] [EFFECT] [SIZE] [SEED] [REPORT]`, which writes report.json.
//! The logs are thirty runs of 20 s of the emulator's plant, ten of them references; making them is not counted. The diagnosis
//! is serial, so what passes between two calls of it is its own: a stage is what it says of itself ([`Workers::progress`]), and
//! within a round what comes before the first fit is screening.

#[path = "../tests/plant/mod.rs"]
mod plant;

use identify::diagnose::{Input, diagnose};
use identify::workers::Workers;
use std::collections::BTreeMap;
use std::process::ExitCode;
use std::sync::Mutex;

const REFERENCES: usize = 10;
const RUNS: usize = 20;
const SECONDS: usize = 20;
/// What is asked: DISCREPANCY, 10 min of logs on one core.
const ASKED_S: f64 = 60.0;
/// Work items of a screening are one for each column of the library and run, hundreds; fits are tens.
const SCREENING_ITEMS: usize = 150;
/// Of the times in `/proc/self/stat`.
const CLOCK_HZ: f64 = 100.0;

/// User and system time of this process, s.
fn cpu_s() -> f64 {
    let text = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    // Behind the name, which may contain anything; user and system time are fields 14 and 15.
    let fields: Vec<&str> = text.rsplit(')').next().unwrap_or_default().split_whitespace().collect();
    let field = |number: usize| {
        fields
            .get(number - 3)
            .and_then(|text| text.parse::<f64>().ok())
            .unwrap_or(f64::NAN)
    };
    (field(14) + field(15)) / CLOCK_HZ
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Stage {
    Floor,
    Screening,
    Fits,
    GapTable,
}

#[derive(Debug)]
struct Watch {
    now: Stage,
    since_s: f64,
    seconds: BTreeMap<Stage, f64>,
    rounds: usize,
}

impl Watch {
    fn enter(&mut self, stage: Stage) {
        let now_s = cpu_s();
        *self.seconds.entry(self.now).or_default() += now_s - self.since_s;
        (self.now, self.since_s) = (stage, now_s);
    }
}

/// The calling thread, with a watch.
struct Watched(Mutex<Watch>);

impl Watched {
    fn with(&self, act: impl FnOnce(&mut Watch)) {
        if let Ok(mut watch) = self.0.lock() {
            act(&mut watch);
        }
    }
}

impl Workers for Watched {
    fn run(&self, count: usize, work: &(dyn Fn(usize) + Sync)) {
        self.with(|watch| {
            if watch.now == Stage::Screening && count < SCREENING_ITEMS {
                watch.enter(Stage::Fits);
            }
        });
        (0..count).for_each(work);
    }

    fn progress(&self, stage: &str, _share: f64) {
        self.with(|watch| {
            let next = match stage {
                "report" => Stage::GapTable,
                "final fit" => Stage::Fits,
                stage if stage.starts_with("round") => {
                    watch.rounds += 1;
                    Stage::Screening
                }
                _ => Stage::Floor,
            };
            watch.enter(next);
        });
    }
}

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let text = |k: usize, other: &str| arguments.get(k).cloned().unwrap_or_else(|| other.to_owned());
    let (chassis, effect) = (text(0, "omni4"), text(1, "payload"));
    let size: f64 = text(2, "3").parse().unwrap_or(3.0);
    let seed: u64 = text(3, "1").parse().unwrap_or(1);
    let description = plant::robot(&chassis);
    let driven = description.wheels.iter().filter(|wheel| wheel.driven).count();
    let base = plant::background(seed, description.wheels.len(), driven);
    let changed = plant::with_effect(&base, &effect, size, &description);
    let make = |name: &str, change: &plant::Change, k: usize, reference: bool| {
        let own_seed = 1000 * seed + 10 * k as u64 + u64::from(reference);
        plant::run(
            &format!("{name}-{k}"),
            &description,
            change,
            own_seed,
            SECONDS,
            reference,
        )
    };
    let input = Input {
        references: (0..REFERENCES).map(|k| make("reference", &base, k, true)).collect(),
        runs: (0..RUNS).map(|k| make("run", &changed, k, false)).collect(),
        locked: Vec::new(),
        model: None,
        seed: 1,
    };
    let begun_s = cpu_s();
    let watched = Watched(Mutex::new(Watch {
        now: Stage::Floor,
        since_s: begun_s,
        seconds: BTreeMap::new(),
        rounds: 0,
    }));
    let found = match diagnose(&watched, &input) {
        Ok(found) => found,
        Err(error) => {
            eprintln!("no diagnosis: {error}");
            return ExitCode::FAILURE;
        }
    };
    watched.with(|watch| watch.enter(Stage::Floor));
    let Ok(watch) = watched.0.into_inner() else {
        return ExitCode::FAILURE;
    };
    let total_s: f64 = watch.seconds.values().sum();
    let names: Vec<&str> = found.report.effects.iter().map(|effect| effect.name.as_str()).collect();
    println!(
        "{chassis}, {effect} {size} hidden: {:?}, named {names:?}, {} rounds",
        found.report.verdict, watch.rounds
    );
    if let Some(path) = arguments.get(4)
        && let Err(error) = std::fs::write(path, serde_json::to_string_pretty(&found.report).unwrap_or_default())
    {
        eprintln!("cannot write {path}: {error}");
        return ExitCode::FAILURE;
    }
    println!("{} runs of {SECONDS} s, one thread", REFERENCES + RUNS);
    println!("{:<12} {:>8} {:>7}", "stage", "CPU s", "share");
    for (stage, name) in [
        (Stage::Floor, "floor"),
        (Stage::Screening, "screening"),
        (Stage::Fits, "fits"),
        (Stage::GapTable, "gap table"),
    ] {
        let seconds = watch.seconds.get(&stage).copied().unwrap_or(0.0);
        println!("{name:<12} {seconds:>8.1} {:>5.1} %", 100.0 * seconds / total_s);
    }
    let holds = total_s < ASKED_S;
    println!(
        "{:<12} {total_s:>8.1}  asked < {ASKED_S:.0}: {}",
        "all",
        if holds { "holds" } else { "MISSED" }
    );
    if holds { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}
