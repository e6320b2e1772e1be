//! How far each of a set's true effects could show beside the others: the gain that its change is expected to have on the changed runs over noise,
//! everyday differences and what the references leave open, the sizes of the other true effects known, and with those free.
//!
//! `cargo run --release -p blind --example beside -- [KIND[:EFFECT]] SEED NUMBER...`: sets as `--kind KIND --effect EFFECT` (`pair` when absent)
//! numbers them. A diagnosis searches two thirds of the runs and asks 1.5 thresholds of some 35 of what joins a name.

use blind::effects::Truth;
use blind::set::{Set, Wish};
use identify::diagnose::calibrated_floor;
use identify::floor::knob_changes;
use identify::hypothesis::Hypothesis;
use identify::linear::Square;
use identify::record::{Record, Stages};
use identify::screen::{all_residuals, columns};
use identify::workers::Serial;

/// Step of a size that is free, as a share of it.
const STEP: f64 = 0.05;

/// Of all records.
type Vectors = Vec<Vec<f64>>;

/// A model with effects.
fn with<'a>(base: &Hypothesis, effects: impl Iterator<Item = &'a Truth>) -> Hypothesis {
    effects.fold(base.clone(), |model, truth| model.with(truth.effect()))
}

/// An effect with one of its sizes changed a little, for each; which set-points are lost is no size.
fn stepped(truth: &Truth) -> Vec<Truth> {
    let sizes = truth
        .parameters
        .iter()
        .filter(|(_, value)| value.is_finite() && **value != 0.0);
    let all = sizes.map(|(name, value)| {
        let mut other = truth.clone();
        other.parameters.insert(name.clone(), (1.0 + STEP) * value);
        other
    });
    if truth.name == "command_hold" {
        return Vec::new();
    }
    all.collect()
}

fn difference(from: &Vectors, to: &Vectors) -> Vectors {
    let pairs = from.iter().zip(to);
    pairs
        .map(|(from, to)| from.iter().zip(to).map(|(a, b)| a - b).collect())
        .collect()
}

/// Of the first vector what the others cannot imitate, in a product.
fn own_part(gram: &Square) -> f64 {
    let others: Vec<usize> = (1..gram.size).collect();
    let mut normal = gram.part(&others);
    for k in 0..normal.size {
        let ridge = 1e-6 * normal.at(k, k) + 1e-9;
        normal.add(k, k, ridge);
    }
    let right: Vec<f64> = others.iter().map(|k| gram.at(*k, 0)).collect();
    let solved = normal.cholesky().solve(&right);
    gram.at(0, 0) - right.iter().zip(&solved).map(|(a, b)| a * b).sum::<f64>()
}

fn main() -> anyhow::Result<()> {
    let mut arguments: Vec<String> = std::env::args().skip(1).collect();
    let wish = match arguments.first() {
        Some(first) if first.parse::<u64>().is_err() => Wish::named(&arguments.remove(0))?,
        _ => Wish::named("pair")?,
    };
    anyhow::ensure!(arguments.len() >= 2, "[KIND[:EFFECT]] SEED NUMBER...");
    let seed: u64 = arguments[0].parse()?;
    for number in &arguments[1..] {
        let number: u64 = number.parse()?;
        let set = Set::new(seed, number, &wish)?;
        let driven = set.driven(0)?;
        let floor = calibrated_floor(&Serial, &driven.references, None)?;
        let records: Vec<Record> = driven
            .runs
            .iter()
            .map(|run| Record::of(&run.path, &run.bundle))
            .collect();
        let simulated = |model: &Hypothesis| -> Option<Vectors> {
            all_residuals(&Serial, &records, model).ok()?.into_iter().collect()
        };
        let truths: Vec<&Truth> = driven.known.iter().map(|known| &known.best).collect();
        let Some(whole) = simulated(&with(&floor.model, truths.iter().copied())) else {
            println!("{number} {} cannot be simulated", set.chassis);
            continue;
        };
        let stages = vec![Stages::BOTH; floor.knobs.len()];
        let changes = knob_changes(
            &with(&floor.model, truths.iter().copied()),
            &floor.knobs,
            &floor.values,
            &stages,
        );
        let sensitivities = columns(&Serial, &records, &whole, &changes)?;
        let searched = (2 * records.len()).div_ceil(3);
        let part: Vec<Vectors> = sensitivities.iter().map(|knob| knob[..searched].to_vec()).collect();
        for (own, known) in driven.known.iter().enumerate() {
            let others = || truths.iter().enumerate().filter(move |(k, _)| *k != own);
            let Some(without) = simulated(&with(&floor.model, others().map(|(_, truth)| *truth))) else {
                continue;
            };
            let mut vectors = vec![difference(&without, &whole)];
            for (position, truth) in others() {
                for moved in stepped(truth) {
                    let all = truths
                        .iter()
                        .enumerate()
                        .map(|(k, truth)| if k == position { &moved } else { *truth });
                    vectors.extend(simulated(&with(&floor.model, all)).map(|other| difference(&whole, &other)));
                }
            }
            let products = |runs: usize, knobs: &[Vectors]| {
                let metric = floor.metric(&records[..runs], knobs);
                let views: Vec<Vec<&[f64]>> = vectors
                    .iter()
                    .map(|vector| vector[..runs].iter().map(Vec::as_slice).collect())
                    .collect();
                metric.gram(&views)
            };
            let (all, few) = (products(records.len(), &sensitivities), products(searched, &part));
            println!(
                "{number} {} {} {:?}: shows at {:.1} of the noise; expected gain, the others known {:.0}, free {:.0}; on {searched} of {} runs {:.0}, {:.0}",
                set.chassis,
                known.drawn.name,
                known.drawn.index,
                known.visible.ratios.iter().copied().fold(0.0, f64::max),
                all.at(0, 0),
                own_part(&all),
                records.len(),
                few.at(0, 0),
                own_part(&few),
            );
        }
    }
    Ok(())
}
