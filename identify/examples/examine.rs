//! Diagnoses runs of the emulator's plant with a known change and prints what was found.
//!
//! `cargo run -p identify --example examine -- CHASSIS EFFECT SIZE [SEED] [REFERENCES] [RUNS]`

#[path = "../tests/plant/mod.rs"]
mod plant;
#[path = "../tests/threads/mod.rs"]
mod threads;

use identify::diagnose::{Input, diagnose};
use threads::Threads;

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let text = |k: usize, other: &str| arguments.get(k).cloned().unwrap_or_else(|| other.to_owned());
    let number = |k: usize, other: usize| text(k, &other.to_string()).parse::<usize>().unwrap_or(other);
    let chassis = text(0, "omni4");
    let effect = text(1, "none");
    let size: f64 = text(2, "0").parse().unwrap_or(0.0);
    let seed = number(3, 1) as u64;
    let (references, runs) = (number(4, 4), number(5, 6));
    let description = plant::robot(&chassis);
    let driven = description.wheels.iter().filter(|wheel| wheel.driven).count();
    let base = plant::background(seed, description.wheels.len(), driven);
    let changed = plant::with_effect(&base, &effect, size, &description);
    let make = |name: &str, change: &plant::Change, k: usize, reference: bool| {
        plant::run(
            &format!("{name}-{k}"),
            &description,
            change,
            1000 * seed + 10 * k as u64 + u64::from(reference),
            20,
            reference,
        )
    };
    let input = Input {
        references: (0..references).map(|k| make("reference", &base, k, true)).collect(),
        runs: (0..runs).map(|k| make("run", &changed, k, false)).collect(),
        locked: Vec::new(),
        model: None,
        seed: 1,
    };
    match diagnose(&Threads(number(6, 2)), &input) {
        Ok(found) => {
            let report = &found.report;
            let names: Vec<String> = report
                .effects
                .iter()
                .map(|effect| {
                    let values: Vec<String> = effect
                        .parameters
                        .iter()
                        .filter_map(|p| {
                            Some(format!(
                                "{}={:.4}[{:.4},{:.4}]",
                                p.name,
                                p.value?,
                                p.low.unwrap_or(f64::NAN),
                                p.high.unwrap_or(f64::NAN)
                            ))
                        })
                        .collect();
                    format!(
                        "{}{}({}) g={:.0}/{:.0} s={:.2} or {:?}",
                        effect.name,
                        effect.index.map_or(String::new(), |i| format!("[{i}]")),
                        values.join(" "),
                        effect.evidence.gain,
                        effect.evidence.threshold,
                        effect.evidence.stability,
                        effect.alternatives
                    )
                })
                .collect();
            println!(
                "{chassis} {effect} {size} seed {seed}: {:?} {} explained {:?}",
                report.verdict,
                names.join(" ; "),
                report.explained_fraction
            );
            if std::env::var_os("LONG").is_some() {
                println!("{}", report.text());
            }
        }
        Err(error) => println!("{chassis} {effect}: {error}"),
    }
}
