//! Two explanations of one set beside each other: gains, by run, and energies by channel of the truth and of other effects, on the calibrated model.
//!
//! `cargo run --release -p blind --example versus -- [KIND[:EFFECT]] SEED NUMBER [NAME[@WHEEL]:PARAMETER=VALUE[,PARAMETER=VALUE]]...`: a set as
//! `--kind KIND --effect EFFECT` (`single` and all of them when absent) numbers them.

use blind::set::{Set, Wish};
use identify::diagnose::calibrated_floor;
use identify::floor::knob_changes;
use identify::hypothesis::Hypothesis;
use identify::record::{CHANNELS, CLASSES, Record, Stages, residuals};
use identify::screen::columns;
use identify::workers::Serial;
use twin::effect::Effect;

/// An effect from its words.
fn effect(text: &str) -> Option<Effect> {
    let (name, parameters) = text.split_once(':')?;
    let (name, index) = match name.split_once('@') {
        Some((name, index)) => (name, Some(index.parse().ok()?)),
        None => (name, None),
    };
    let values: Vec<(&str, f64)> = parameters
        .split(',')
        .map(|pair| {
            let (name, value) = pair.split_once('=')?;
            Some((name, value.parse().ok()?))
        })
        .collect::<Option<_>>()?;
    let effect = Effect::new(name, &values);
    Some(match index {
        Some(index) => effect.at(index),
        None => effect,
    })
}

fn main() -> anyhow::Result<()> {
    let mut arguments: Vec<String> = std::env::args().skip(1).collect();
    let wish = match arguments.first() {
        Some(first) if first.parse::<u64>().is_err() => Wish::named(&arguments.remove(0))?,
        _ => Wish::named("single")?,
    };
    anyhow::ensure!(
        arguments.len() >= 2,
        "[KIND[:EFFECT]] SEED NUMBER [NAME[@WHEEL]:PARAMETER=VALUE]..."
    );
    let set = Set::new(arguments[0].parse()?, arguments[1].parse()?, &wish)?;
    let driven = set.driven(0)?;
    let floor = calibrated_floor(&Serial, &driven.references, None)?;
    for (knob, (value, sigma)) in floor.knobs.iter().zip(floor.values.iter().zip(&floor.sigmas)) {
        println!("  {} {value:.2} of {sigma:.2}", knob.label());
    }
    let mut rivals: Vec<(String, Option<Effect>)> = vec![("nothing".to_owned(), None)];
    rivals.extend(
        driven
            .known
            .iter()
            .map(|known| (format!("truth {}", known.drawn.name), Some(known.drawn.effect()))),
    );
    rivals.extend(arguments[2..].iter().map(|text| (text.clone(), effect(text))));
    let stages = vec![Stages::BOTH; floor.knobs.len()];
    let records: Vec<Record> = driven
        .runs
        .iter()
        .map(|run| Record::of(&run.path, &run.bundle))
        .collect();
    let simulated = |model: &Hypothesis| -> Vec<Vec<f64>> {
        records
            .iter()
            .filter_map(|record| residuals(record, model, Stages::BOTH, None))
            .collect()
    };
    let base = simulated(&floor.model);
    let changes = knob_changes(&floor.model, &floor.knobs, &floor.values, &stages);
    let sensitivities = columns(&Serial, &records, &base, &changes)?;
    let metric = floor.metric(&records, &sensitivities);
    let whole = |vectors: &[Vec<f64>]| {
        let views: Vec<&[f64]> = vectors.iter().map(Vec::as_slice).collect();
        metric.gram(&[views]).at(0, 0)
    };
    for (label, effect) in rivals {
        let model = effect.map_or_else(|| floor.model.clone(), |effect| floor.model.with(effect));
        let left = simulated(&model);
        let mut sums = [(0.0, 0.0, 0.0); CLASSES];
        for (run, record) in records.iter().enumerate() {
            let rest = metric.rest(run, &left[run]);
            for ((place, rest), plain) in record.places().iter().zip(rest).zip(&left[run]) {
                if let Some(quantity) = place.quantity {
                    let sum = &mut sums[quantity.class()];
                    *sum = (sum.0 + rest * rest, sum.1 + plain * plain, sum.2 + 1.0);
                }
            }
        }
        println!("{label}: gain {:.0}", whole(&base) - whole(&left));
        let of_run = |run: usize, vectors: &[Vec<f64>]| metric.gram_of_run(run, &[&vectors[run]]).at(0, 0);
        let gains = (0..records.len()).map(|run| format!("{:.0}", of_run(run, &base) - of_run(run, &left)));
        println!("    of each run: {}", gains.collect::<Vec<_>>().join(", "));
        for (channel, (rest, plain, count)) in CHANNELS.iter().zip(sums) {
            println!(
                "    {channel:<9} weighed {rest:9.1}, plain {:.5}",
                (plain / f64::max(count, 1.0)).sqrt()
            );
        }
    }
    Ok(())
}
