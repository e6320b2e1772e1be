//! How far each of several true effects could show without references: gains that it has when all the others are in the model, and alone in
//! the nominal twin, each beside the gain that just this change would have; and what all of them together leave, by channel. Both with tyres
//! and filters as described and as the first two runs show them.
//!
//! `cargo run --release -p blind --example first_day -- SEED NUMBER...`: sets as `--kind many` numbers them.

use blind::kind::Kind;
use blind::set::{Set, Wish};
use identify::diagnose::calibrated_floor;
use identify::floor::{Floor, knob_changes};
use identify::hypothesis::Hypothesis;
use identify::record::{CHANNELS, CLASSES, Record, Stages, residuals};
use identify::screen::columns;
use identify::workers::Serial;

fn views(vectors: &[Vec<f64>]) -> Vec<&[f64]> {
    vectors.iter().map(Vec::as_slice).collect()
}

fn main() -> anyhow::Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let seed: u64 = arguments.first().map_or(Ok(1), |text| text.parse())?;
    let wish = Wish {
        kind: Some(Kind::Many),
        ..Wish::standard()
    };
    for number in arguments.iter().skip(1) {
        let number: u64 = number.parse()?;
        let set = Set::new(seed, number, &wish)?;
        let driven = set.driven(0)?;
        println!("{number} {}", set.chassis);
        let first = driven.runs.first().map(|run| &run.bundle.run.robot);
        let Some(first) = first else { continue };
        println!("  {}", first.name);
        let knobs = calibrated_floor(&Serial, &driven.runs[..1], None)?.knobs;
        let records: Vec<Record> = driven
            .runs
            .iter()
            .map(|run| Record::of(&run.path, &run.bundle))
            .collect();
        let stages = vec![Stages::BOTH; knobs.len()];
        let nominal = Hypothesis::nominal(first);
        let described = Floor::stated(nominal.clone(), knobs.clone());
        let told = Floor::told_by_runs(&Serial, nominal, knobs, &stages, records[..2].to_vec())?;
        for (tyres, stated) in [("described", described), ("two runs show them", told)] {
            println!("  tyres as {tyres}:");
            let simulated = |model: &Hypothesis| -> Vec<Vec<f64>> {
                let all = records
                    .iter()
                    .map(|record| residuals(record, model, Stages::BOTH, None));
                all.map(Option::unwrap_or_default).collect()
            };
            let with = |left_out: Option<usize>| {
                let mut model = stated.model.clone();
                for (k, known) in driven.known.iter().enumerate() {
                    if Some(k) != left_out {
                        model = model.with(known.best.effect());
                    }
                }
                model
            };
            let (nominal, truth) = (simulated(&stated.model), simulated(&with(None)));
            let sensitivities = |model: &Hypothesis, base: &[Vec<f64>]| {
                columns(
                    &Serial,
                    &records,
                    base,
                    &knob_changes(model, &stated.knobs, &stated.values, &stages),
                )
            };
            let at_nominal = stated.metric(&records, &sensitivities(&stated.model, &nominal)?);
            let at_truth = stated.metric(&records, &sensitivities(&with(None), &truth)?);
            for (name, vectors) in [("nothing", &nominal), ("all", &truth)] {
                let mut channels = [0.0; CLASSES];
                let mut counts = [0.0; CLASSES];
                for (record, residual) in records.iter().zip(vectors) {
                    let weights = stated.noise.weights(record);
                    for ((place, w), r) in record.places().iter().zip(weights).zip(residual) {
                        if let Some(quantity) = place.quantity {
                            channels[quantity.class()] += w * r * r;
                            counts[quantity.class()] += f64::from(u8::from(w > 0.0));
                        }
                    }
                }
                let words: Vec<String> = (0..CLASSES)
                    .filter(|class| counts[*class] > 0.0)
                    .map(|class| format!("{} {:.2}", CHANNELS[class], channels[class] / counts[class]))
                    .collect();
                let energy = at_truth.gram(&[views(vectors)]).at(0, 0);
                let expected: f64 = (0..records.len()).map(|run| at_truth.expected(run)).sum();
                println!(
                    "  with {name} of the truth: energy {energy:.0}, expected {expected:.0}; over the noise {}",
                    words.join(" ")
                );
            }
            for (k, known) in driven.known.iter().enumerate() {
                let without = simulated(&with(Some(k)));
                let alone = simulated(&stated.model.with(known.best.effect()));
                let difference = |a: &[Vec<f64>], b: &[Vec<f64>]| -> Vec<Vec<f64>> {
                    a.iter()
                        .zip(b)
                        .map(|(a, b)| a.iter().zip(b).map(|(a, b)| a - b).collect())
                        .collect()
                };
                let own = difference(&without, &truth);
                let gram = at_truth.gram(&[views(&without), views(&truth), views(&own)]);
                let own_alone = difference(&nominal, &alone);
                let nominal_gram = at_nominal.gram(&[views(&nominal), views(&alone), views(&own_alone)]);
                println!(
                    "  {} {:?} {:?}: beside the others it gains {:.0} of {:.0}, alone {:.0} of {:.0}",
                    known.drawn.name,
                    known.drawn.index,
                    known.best.parameters,
                    gram.at(0, 0) - gram.at(1, 1),
                    gram.at(2, 2),
                    nominal_gram.at(0, 0) - nominal_gram.at(1, 1),
                    nominal_gram.at(2, 2)
                );
            }
        }
    }
    Ok(())
}
