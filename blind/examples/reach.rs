//! What a matched filter would see of the single effects of a bench: somebody who knows direction and size of the true change, and has nothing but the
//! diagnosis's windows, noise and everyday differences. Beside it stands what the diagnosis made of them.
//!
//! `cargo run --release -p blind --example reach -- FOLDER [PART/PARTS [KIND]]`: a folder of whole results of `cargo xtask blind`. With a part only every
//! so manieth set is looked at; sets of one effect of another kind (`shifted`, `closed`) with its name. The noise is the references' own: where runs are driven harder a diagnosis
//! hears a louder one.

use anyhow::{Context, Result, ensure};
use blind::bench::{Line, lines};
use blind::interval::{normal_point, normal_tail};
use blind::kind::Kind;
use blind::reach::Reach;
use blind::score::DESCRIBED;
use blind::set::{Set, Wish};
use clap::ValueEnum;
use std::path::Path;
use twin::effect::library::LIBRARY;

/// Names that healthy robots may get, as a share of sets.
const FALSE_NAMES: f64 = 0.02;
/// Lower and upper ends of the table's rows.
const ROWS: [(f64, f64); 5] = [
    (f64::NEG_INFINITY, 10.0),
    (10.0, 30.0),
    (30.0, 100.0),
    (100.0, 300.0),
    (300.0, f64::INFINITY),
];
const LEVELS: [&str; 3] = [
    "against noise alone",
    "against noise and everyday differences",
    "against noise, everyday differences and what references leave open",
];
/// Which set-points were lost is of a run: the twin's own dice say nothing of it.
const LOST: &str = "command_hold";

/// One detectable effect: gains of the matched filter by level, and what became of it.
struct Seen {
    gains: [f64; 3],
    is_first: bool,
    is_in_set: bool,
}

/// `None` for effects that are not detectable or that the library does not describe.
fn seen(line: &Line, seed: u64, wish: &Wish) -> Result<Option<Seen>> {
    let set = Set::new(seed, line.set, wish)?;
    let driven = set.driven(0)?;
    let Some(known) = driven.known.first() else {
        return Ok(None);
    };
    if !known.detectable {
        return Ok(None);
    }
    let fact = |name: &str| line.facts.get(name).and_then(|all| all.first()) == Some(&1.0);
    // Facts of other kinds than single sets have the kind behind their names.
    let kind = line
        .kind
        .to_possible_value()
        .map_or_else(String::new, |kind| kind.get_name().to_owned());
    let of_kind = |name: &str| fact(name) || fact(&format!("{name}_{kind}"));
    let (is_first, is_in_set) = (of_kind("right_first"), of_kind("in_set"));
    let missed = if is_in_set { "" } else { "  MISSED" };
    let (number, chassis, name) = (line.set, &line.chassis, &known.drawn.name);
    if known.described < DESCRIBED || name == LOST {
        println!("{number} {chassis} {name}: not in the library as the plant has it{missed}");
        return Ok(None);
    }
    let reach = Reach::of(&driven, known)?;
    let floors = [reach.known(true), reach.known(false), reach.floor.clone()];
    let runs = reach.records.len();
    let gains = floors.map(|floor| reach.gain(&floor, 0..runs).expected.max(0.0));
    let by_run = (0..runs).map(|run| {
        let gain = reach.gain(&reach.floor, run..run + 1);
        format!("{:.0} ({:.0})", gain.expected, gain.got)
    });
    println!(
        "{number} {chassis} {name} shows {:.1}; gain {:.0}, {:.0}, {:.0}; by run {}{missed}",
        known.visible.largest(),
        gains[0],
        gains[1],
        gains[2],
        by_run.collect::<Vec<_>>().join(", "),
    );
    Ok(Some(Seen {
        gains,
        is_first,
        is_in_set,
    }))
}

fn part(text: Option<&String>) -> Result<(u64, u64)> {
    let Some(text) = text else { return Ok((0, 1)) };
    let (part, parts) = text.split_once('/').context("PART/PARTS")?;
    let (part, parts): (u64, u64) = (part.parse()?, parts.parse()?);
    ensure!(0 < part && part <= parts, "PART/PARTS: from 1 to PARTS");
    Ok((part - 1, parts))
}

/// Seed and wish of a folder of sets as they are without wishes, or all of a kind.
fn sets_of(folder: &Path, kind: Kind) -> Result<(u64, Wish)> {
    let path = folder.join("settings.txt");
    let text = std::fs::read_to_string(&path).with_context(|| format!("cannot read {}", path.display()))?;
    let seed = text.strip_prefix("seed ").and_then(|rest| rest.split(' ').next());
    let seed: u64 = seed.context("settings.txt names no seed")?.parse()?;
    let wishes = [None, Some(kind)].map(|kind| Wish {
        kind,
        ..Wish::standard()
    });
    let wish = wishes
        .into_iter()
        .find(|wish| text == format!("seed {seed} {wish:?}\n"));
    let wish = wish.with_context(|| format!("{} is of other sets: {text}", folder.display()))?;
    Ok((seed, wish))
}

fn main() -> Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let folder = Path::new(arguments.first().context("FOLDER [PART/PARTS [KIND]]")?);
    let (part, parts) = part(arguments.get(1))?;
    let name = arguments.get(2).map_or("single", String::as_str);
    let kind = Kind::from_str(name, true).map_err(anyhow::Error::msg)?;
    let is_of_one = matches!(kind, Kind::Single | Kind::Shifted | Kind::Closed);
    ensure!(
        is_of_one,
        "sets of kind {name} have no one effect: single, shifted or closed"
    );
    let (seed, wish) = sets_of(folder, kind)?;
    println!(
        "gains {}; then of each run alone (and what its measurements give)",
        LEVELS.join("; ")
    );
    let mut all = Vec::new();
    for line in lines(folder)? {
        if line.kind == kind && line.error.is_none() && line.set % parts == part {
            all.extend(seen(&line, seed, &wish)?);
        }
    }
    println!(
        "\n| gain {} | effects | named first | in the set |\n|---|---|---|---|",
        LEVELS[2]
    );
    for (low, high) in ROWS {
        let here: Vec<&Seen> = all
            .iter()
            .filter(|seen| low <= seen.gains[2] && seen.gains[2] < high)
            .collect();
        let words = match (low.is_finite(), high.is_finite()) {
            (false, _) => format!("below {high}"),
            (_, false) => format!("{low} and more"),
            _ => format!("{low} to {high}"),
        };
        let first = here.iter().filter(|seen| seen.is_first).count();
        let in_set = here.iter().filter(|seen| seen.is_in_set).count();
        println!("| {words} | {} | {first} | {in_set} |", here.len());
    }
    println!(
        "\n| a matched filter sees, of {} | with one effect to look for | with all {} |\n|---|---|---|",
        all.len(),
        LIBRARY.len()
    );
    for (level, words) in LEVELS.iter().enumerate() {
        let [one, library] = [1, LIBRARY.len()].map(|effects| {
            let bar = normal_point(FALSE_NAMES / effects as f64);
            let chances = all.iter().map(|seen| normal_tail(bar - seen.gains[level].sqrt()));
            let count: f64 = chances.sum();
            format!("{count:.1} ({:.1} %)", 100.0 * count / all.len().max(1) as f64)
        });
        println!("| {words} | {one} | {library} |");
    }
    Ok(())
}
