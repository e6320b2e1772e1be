//! How often the gap of a robot that is known to the last number rises from one day's runs to the next's: what the row "three rounds: gap rises from a
//! round to the next" says of other runs on another day, not of names.
//!
//! `cargo run --release -p blind --example days -- SEED NUMBER...`: sets of three rounds, as the whole bench numbers them. The model is the
//! calibrated one with all true effects, the same on all days. Of each day two runs count, as many as a diagnosis locks away of six, and all of them.

use blind::bench::ROUNDS;
use blind::kind::Kind;
use blind::model_errors::{LOCKED, errors};
use blind::score::{ABOVE_FLOOR, WORSE};
use blind::set::{Set, Wish};
use identify::diagnose::calibrated_floor;
use identify::errors::{Errors, rms};
use identify::workers::Serial;

/// Mean ratio of the rows that were above the floor, as the bench scores rounds; `None` where none was.
fn ratio([before, after]: [&Errors; 2], references: &Errors) -> Option<f64> {
    let of = |errors: &Errors, key: &_| {
        errors
            .iter()
            .find(|(other, _)| other == key)
            .map(|(_, samples)| rms(samples))
    };
    let logs: Vec<f64> = before
        .iter()
        .filter_map(|(key, samples)| {
            let (old, new, floor) = (rms(samples), of(after, key)?, of(references, key)?);
            (old > ABOVE_FLOOR * floor && new > 0.0).then(|| (new / old).ln())
        })
        .collect();
    (!logs.is_empty()).then(|| (logs.iter().sum::<f64>() / logs.len() as f64).exp())
}

fn main() -> anyhow::Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    anyhow::ensure!(arguments.len() >= 2, "SEED NUMBER...");
    let mut counts = [(0, 0); 2];
    for number in &arguments[1..] {
        let set = Set::new(arguments[0].parse()?, number.parse()?, &Wish::standard())?;
        anyhow::ensure!(set.kind == Kind::Rounds, "{number} is no set of three rounds");
        let days: Vec<_> = (0..ROUNDS).map(|day| set.driven(day)).collect::<Result<_, _>>()?;
        let floor = calibrated_floor(&Serial, &days[0].references, None)?;
        let mut truth = floor.model.clone();
        truth
            .effects
            .extend(days[0].known.iter().map(|known| known.best.effect()));
        let references = errors(&floor, &days[0].references, &floor.model);
        for (taken, count) in [LOCKED, usize::MAX].into_iter().zip(&mut counts) {
            let found: Vec<Errors> = days
                .iter()
                .map(|day| errors(&floor, &day.runs[day.runs.len().saturating_sub(taken)..], &truth))
                .collect();
            let ratios: Vec<f64> = found
                .windows(2)
                .filter_map(|pair| ratio([&pair[0], &pair[1]], &references))
                .collect();
            count.0 += ratios.iter().filter(|ratio| **ratio > WORSE).count();
            count.1 += ratios.len();
            let what = if taken == LOCKED { "two runs a day" } else { "all runs" };
            let shown: Vec<String> = ratios.iter().map(|ratio| format!("{ratio:.2}")).collect();
            println!("{number} {} {what}: {}", set.chassis, shown.join(", "));
        }
    }
    for ((rises, steps), what) in counts.into_iter().zip(["two runs a day", "all runs"]) {
        println!(
            "{what}: the gap of the truth itself rises by more than {:.0} % in {rises} of {steps} steps",
            100.0 * (WORSE - 1.0)
        );
    }
    Ok(())
}
