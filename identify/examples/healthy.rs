//! What a calibrated twin leaves of a healthy robot, by channel: of references it was calibrated on, and of other runs.
//!
//! `cargo run --release -p identify --example healthy -- CHASSIS SEED [EFFECT=VALUE[,VALUE...]]...`: the effects are added to the nominal
//! twin before it is calibrated, first values of their parameters in the library's order.

#[path = "../tests/plant/mod.rs"]
mod plant;

use identify::diagnose::calibrated;
use identify::record::{CHANNELS, CLASSES, Record, Stages, residuals};
use identify::workers::Serial;
use std::process::ExitCode;
use twin::effect::Effect;
use twin::effect::library::find;
use twin::model_document::ModelDocument;

const REFERENCES: usize = 6;
const OTHERS: usize = 6;

fn effect(text: &str) -> Option<Effect> {
    let (name, values) = text.split_once('=')?;
    let entry = find(name)?;
    let values: Vec<f64> = values
        .split(',')
        .map(|value| value.parse().ok())
        .collect::<Option<_>>()?;
    let parameters: Vec<(&str, f64)> = entry
        .parameters
        .iter()
        .map(|parameter| parameter.name)
        .zip(values)
        .collect();
    Some(Effect::new(name, &parameters))
}

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let chassis = arguments.first().map_or("diff2", String::as_str);
    let seed: u64 = arguments.get(1).and_then(|text| text.parse().ok()).unwrap_or(1);
    let description = plant::robot(chassis);
    let driven = description.wheels.iter().filter(|wheel| wheel.driven).count();
    let base = plant::background(seed, description.wheels.len(), driven);
    let make = |k: usize| plant::run(&format!("{k}"), &description, &base, 1000 * seed + k as u64, 20, true);
    let references: Vec<_> = (0..REFERENCES).map(make).collect();
    let others: Vec<_> = (REFERENCES..REFERENCES + OTHERS).map(make).collect();
    let effects: Vec<Effect> = arguments.iter().skip(2).filter_map(|text| effect(text)).collect();
    let model = ModelDocument::new(None, description.clone(), "hall", effects, serde_json::Value::Null);
    let Ok(hypothesis) = calibrated(&Serial, &references, Some(&model)) else {
        eprintln!("not calibrated");
        return ExitCode::FAILURE;
    };
    for effect in &hypothesis.effects {
        println!("  {} {:?} {:?}", effect.name, effect.index, effect.parameters);
    }
    if let Some(tread) = hypothesis.description.tread {
        println!("  {tread:?}");
    }
    for (what, runs) in [("references", &references), ("others", &others)] {
        let mut sums = [(0.0, 0.0_f64); CLASSES];
        for run in runs {
            let record = Record::of(&run.path, &run.bundle);
            let Some(left) = residuals(&record, &hypothesis, Stages::BOTH, None) else {
                continue;
            };
            for (place, value) in record.places().iter().zip(left) {
                if let Some(quantity) = place.quantity {
                    let sum = &mut sums[quantity.class()];
                    *sum = (sum.0 + value * value, sum.1 + 1.0);
                }
            }
        }
        print!("{what:<11}");
        for (channel, (sum, count)) in CHANNELS.iter().zip(sums) {
            print!(" {channel} {:.5}", (sum / count.max(1.0)).sqrt());
        }
        println!();
    }
    ExitCode::SUCCESS
}
