//! How often locked runs count as made worse when the model is given the truth itself: what the row "locked runs made worse by > 5 % in any
//! channel" says of noise and of calibration, not of names.
//!
//! `cargo run --release -p blind --example worse -- SEED NUMBER...`: sets of one effect, as `--kind single` numbers them. Each set's runs are
//! taken two by two, as many as a diagnosis locks away of six.

use blind::kind::Kind;
use blind::model_errors::{LOCKED, errors};
use blind::set::{Set, Wish};
use identify::diagnose::calibrated_floor;
use identify::errors::rms;
use identify::gap::HORIZONS_S;
use identify::record::CHANNELS;
use identify::workers::Serial;

/// What counts as worse.
const WORSE: f64 = 1.05;

fn main() -> anyhow::Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    anyhow::ensure!(arguments.len() >= 2, "SEED NUMBER...");
    let wish = Wish {
        kind: Some(Kind::Single),
        ..Wish::standard()
    };
    let (mut pairs, mut worse_pairs, mut rows, mut worse_rows) = (0, 0, 0, 0);
    for number in &arguments[1..] {
        let set = Set::new(arguments[0].parse()?, number.parse()?, &wish)?;
        let driven = set.driven(0)?;
        let Some(known) = driven.known.first() else { continue };
        let floor = calibrated_floor(&Serial, &driven.references, None)?;
        let truth = floor.model.with(known.best.effect());
        for locked in driven.runs.chunks_exact(LOCKED) {
            let (before, after) = (errors(&floor, locked, &floor.model), errors(&floor, locked, &truth));
            let mut found = Vec::new();
            for (key, samples) in &before {
                let Some((_, now)) = after.iter().find(|(other, _)| other == key) else {
                    continue;
                };
                let (old, new) = (rms(samples), rms(now));
                rows += 1;
                if new > WORSE * old {
                    worse_rows += 1;
                    found.push(format!(
                        "{} {} s {:+.0} % of {} samples",
                        CHANNELS[key.0],
                        HORIZONS_S[key.1],
                        100.0 * (new / old - 1.0),
                        samples.len()
                    ));
                }
            }
            pairs += 1;
            worse_pairs += usize::from(!found.is_empty());
            println!("{number} {} {}: {}", set.chassis, known.drawn.name, found.join(", "));
        }
    }
    println!(
        "{worse_pairs} of {pairs} pairs of runs have a row that the truth makes worse by more than {:.0} %; {worse_rows} of {rows} rows",
        100.0 * (WORSE - 1.0)
    );
    Ok(())
}
