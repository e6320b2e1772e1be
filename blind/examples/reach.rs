//! How many single effects of a bench anybody could see: by the gain that the true change would have over what nobody knows. What was
//! made of them stands beside.
//!
//! `cargo run --release -p blind --example reach -- FOLDER SEED [PART/PARTS]`: a folder of results of `cargo xtask blind`, and its seed. With a part
//! only every so manieth set is looked at.

use anyhow::{Context, Result, ensure};
use blind::bench::{Line, lines};
use blind::interval::{normal_point, normal_tail};
use blind::kind::Kind;
use blind::reach::Reach;
use blind::set::{Set, Wish};
use std::path::Path;
use twin::effect::library::LIBRARY;

/// Names that healthy robots may get.
const FALSE_NAMES: f64 = 0.02;
/// Upper ends of the table's rows.
const ROWS: [f64; 5] = [10.0, 30.0, 100.0, 300.0, f64::INFINITY];

/// One detectable effect: gains that nobody can exceed, and what became of it.
struct Seen {
    gains: [f64; 3],
    is_first: bool,
    is_in_set: bool,
}

fn seen(line: &Line, seed: u64) -> Result<Option<Seen>> {
    let set = Set::new(seed, line.set, &Wish::standard())?;
    let driven = set.driven(0)?;
    let Some(known) = driven.known.first().filter(|known| known.detectable) else {
        return Ok(None);
    };
    let is_same = line.known.first().is_some_and(|own| own.drawn == known.drawn);
    ensure!(is_same, "set {} is another one: not of seed {seed}?", line.set);
    let reach = Reach::of(&driven, known)?;
    let floors = [reach.known(true), reach.known(false), reach.floor.clone()];
    let runs = reach.records.len();
    let gains = floors.map(|floor| reach.gain(&floor, runs).expected);
    let fact = |name: &str| line.facts.get(name).and_then(|all| all.first()) == Some(&1.0);
    let seen = Seen {
        gains,
        is_first: fact("right_first"),
        is_in_set: fact("in_set"),
    };
    println!(
        "{} {} {} shows {:.1}, gain: noise {:.0}, and every day {:.0}, and calibration {:.0}{}",
        line.set,
        line.chassis,
        known.drawn.name,
        known.visible.largest(),
        gains[0],
        gains[1],
        gains[2],
        if seen.is_in_set { "" } else { "  MISSED" }
    );
    Ok(Some(seen))
}

fn part(text: Option<&String>) -> Result<(u64, u64)> {
    let Some(text) = text else { return Ok((0, 1)) };
    let (part, parts) = text.split_once('/').context("PART/PARTS")?;
    let (part, parts): (u64, u64) = (part.parse()?, parts.parse()?);
    ensure!(0 < part && part <= parts, "PART/PARTS: from 1 to PARTS");
    Ok((part - 1, parts))
}

fn main() -> Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    ensure!(arguments.len() >= 2, "FOLDER SEED [PART/PARTS]");
    let seed: u64 = arguments[1].parse().context("SEED")?;
    let (part, parts) = part(arguments.get(2))?;
    let mut all = Vec::new();
    for line in lines(Path::new(&arguments[0]))? {
        if line.kind == Kind::Single && line.error.is_none() && line.set % parts == part {
            all.extend(seen(&line, seed)?);
        }
    }
    println!("\n| gain that the truth could have | effects | named first | in the set |\n|---|---|---|---|");
    let mut low = f64::NEG_INFINITY;
    for high in ROWS {
        let here = || all.iter().filter(|seen| low <= seen.gains[2] && seen.gains[2] < high);
        let (first, in_set) = (
            here().filter(|seen| seen.is_first).count(),
            here().filter(|seen| seen.is_in_set).count(),
        );
        println!("| below {high} | {} | {first} | {in_set} |", here().count());
        low = high;
    }
    // Nobody names the library's effects better who may be wrong on so many healthy robots.
    let bar = normal_point(FALSE_NAMES / LIBRARY.len() as f64);
    for (level, words) in [
        "noise alone",
        "and everyday differences",
        "and what the references leave open",
    ]
    .iter()
    .enumerate()
    {
        let seen: f64 = all.iter().map(|seen| normal_tail(bar - seen.gains[level].sqrt())).sum();
        println!(
            "who knows all but {words} sees {seen:.1} of {} ({:.1} %)",
            all.len(),
            100.0 * seen / all.len().max(1) as f64
        );
    }
    Ok(())
}
