//! Robot-seconds per CPU-second of the twin: `cargo run --release -p twin --example speed [-- OPTIONS]`.
//!
//! The scenario is [`twin::workload`]; how to read the figures is in `docs/speed.md`. Options: `--all` for all six
//! chassis, `--repetitions N` (at least 5), `--json` for one JSON document instead of a table.
#![allow(
    clippy::disallowed_methods,
    reason = "a benchmark reads the clock; the library does not"
)]

use serde::Serialize;
use twin::workload::{LAP_TICKS, Variation, Workload};

#[path = "../../tests/support/allocation.rs"]
mod allocation;

#[global_allocator]
static ALLOCATOR: allocation::Counting = allocation::Counting;

const COUNTS: [usize; 4] = [1, 10, 100, 1000];
/// What a repetition simulates, robot-seconds; more where one lap is more.
const REPETITION_ROBOT_S: f64 = 2000.0;
const LEAST_REPETITIONS: usize = 5;

/// One line of the table.
#[derive(Serialize)]
struct Row {
    chassis: &'static str,
    robots: usize,
    effect: &'static str,
    digest: bool,
    /// Robot-seconds per CPU-second of this thread, one per repetition.
    rates: Vec<f64>,
    share_above_half_friction: f64,
    contact_ticks: u64,
    smallest_gap_m: f64,
    /// Digest of a lap, the same in every engine; none without hashing.
    lap_digest: Option<String>,
}

#[derive(Serialize)]
struct Memory {
    chassis: &'static str,
    effect: &'static str,
    bytes_per_robot: usize,
    allocations_per_tick: f64,
}

#[derive(Serialize)]
struct Report {
    twin_version: &'static str,
    rows: Vec<Row>,
    memory: Vec<Memory>,
}

struct Options {
    chassis: Vec<&'static str>,
    repetitions: usize,
    json: bool,
}

fn options() -> Result<Options, String> {
    let mut options = Options {
        chassis: vec!["omni4", "awd"],
        repetitions: 7,
        json: false,
    };
    let mut words = std::env::args().skip(1);
    while let Some(word) = words.next() {
        match word.as_str() {
            "--all" => options.chassis = twin::parameter::CHASSIS.to_vec(),
            "--json" => options.json = true,
            "--repetitions" => {
                let count = words.next().and_then(|count| count.parse().ok());
                let enough = count.filter(|count| *count >= LEAST_REPETITIONS);
                options.repetitions =
                    enough.ok_or(format!("--repetitions needs a number from {LEAST_REPETITIONS} on"))?;
            }
            other => {
                return Err(format!(
                    "unknown option {other}; there are --all, --json, --repetitions N"
                ));
            }
        }
    }
    Ok(options)
}

/// Time this thread was on a CPU, s.
fn cpu_s() -> Result<f64, String> {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").map_err(|error| error.to_string())?;
    let nanoseconds = text.split(' ').next().and_then(|number| number.parse::<f64>().ok());
    Ok(nanoseconds.ok_or("no scheduler statistics")? * 1e-9)
}

/// A workload with its row so far.
fn prepared(chassis: &'static str, robots: usize, effect: Variation, digest: bool) -> Result<(Workload, Row), String> {
    let work = Workload::new(chassis, robots, effect, digest).map_err(|error| error.to_string())?;
    let survey = work.survey().map_err(|error| error.to_string())?;
    let end = work.lap().map_err(|error| error.to_string())?;
    let row = Row {
        chassis,
        robots,
        effect: effect.name(),
        digest,
        rates: Vec::new(),
        share_above_half_friction: survey.share_above_half_friction,
        contact_ticks: survey.contact_ticks,
        smallest_gap_m: survey.smallest_gap_m,
        lap_digest: digest.then(|| end.digest().to_string()),
    };
    Ok((work, row))
}

/// One repetition, robot-seconds per CPU-second.
fn rate(work: &Workload) -> Result<f64, String> {
    let laps = work.laps_for(REPETITION_ROBOT_S);
    let begun = cpu_s()?;
    for _ in 0..laps {
        std::hint::black_box(work.lap().map_err(|error| error.to_string())?);
    }
    Ok(f64::from(laps) * work.lap_robot_s() / (cpu_s()? - begun))
}

fn memory(chassis: &'static str, effect: Variation) -> Result<Memory, String> {
    let held = |robots: usize| -> Result<(usize, f64), String> {
        let work = Workload::new(chassis, robots, effect, true).map_err(|error| error.to_string())?;
        let before = allocation::held_bytes();
        let mut world = work.lap().map_err(|error| error.to_string())?;
        let bytes = allocation::held_bytes() - before;
        let calls = allocation::calls();
        for tick in 0..LAP_TICKS {
            world.step(work.commands(tick)).map_err(|error| error.to_string())?;
        }
        Ok((bytes, (allocation::calls() - calls) as f64 / LAP_TICKS as f64))
    };
    let ((one, _), (many, allocations_per_tick)) = (held(1)?, held(1000)?);
    Ok(Memory {
        chassis,
        effect: effect.name(),
        bytes_per_robot: (many - one) / 999,
        allocations_per_tick,
    })
}

fn measure(options: &Options) -> Result<Report, String> {
    let mut pairs = Vec::new();
    let mut memories = Vec::new();
    for chassis in &options.chassis {
        for effect in Variation::ALL {
            memories.push(memory(chassis, effect)?);
            for robots in COUNTS {
                for digest in [true, false] {
                    pairs.push(prepared(chassis, robots, effect, digest)?);
                }
            }
        }
    }
    // Round after round, so that a busy minute of the machine falls on all rows alike.
    for _ in 0..options.repetitions {
        for (work, row) in &mut pairs {
            row.rates.push(rate(work)?);
        }
    }
    Ok(Report {
        twin_version: twin::VERSION,
        rows: pairs.into_iter().map(|(_, row)| row).collect(),
        memory: memories,
    })
}

fn print(report: &Report) {
    println!("robot-seconds per CPU-second; share: physics steps above half friction");
    for row in &report.rows {
        let mut rates = row.rates.clone();
        rates.sort_by(f64::total_cmp);
        println!(
            "{:>6} N={:<5} {:<18} digest {:<3} median {:>7.0} least {:>7.0} most {:>7.0}  share {:>4.1} %  contacts {}",
            row.chassis,
            row.robots,
            row.effect,
            if row.digest { "on" } else { "off" },
            rates[rates.len() / 2],
            rates[0],
            rates[rates.len() - 1],
            100.0 * row.share_above_half_friction,
            row.contact_ticks
        );
    }
    for one in &report.memory {
        println!(
            "{:>6} {:<18} {} bytes a robot, {} allocations a tick",
            one.chassis, one.effect, one.bytes_per_robot, one.allocations_per_tick
        );
    }
}

fn main() -> Result<(), String> {
    let options = options()?;
    let report = measure(&options)?;
    if options.json {
        println!("{}", serde_json::to_string(&report).map_err(|error| error.to_string())?);
    } else {
        print(&report);
    }
    Ok(())
}
