//! What a diagnosis says of the same runs when they are recorded otherwise: at other rates, with fewer channels, with coarser digits.
//!
//! `cargo run --release -p blind --example recorded -- RECORDER[,RECORDER]... KIND[:EFFECT] SEED NUMBER...`, `all` for all recorders.

use blind::recorder::Recorder;
use blind::set::{Set, Wish};
use clap::ValueEnum;
use identify::diagnose::{Input, Run, diagnose};
use identify::workers::Serial;

/// A recorder as the command line takes it.
fn word(recorder: Recorder) -> String {
    recorder
        .to_possible_value()
        .map_or_else(String::new, |value| value.get_name().to_owned())
}

fn main() -> anyhow::Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    anyhow::ensure!(
        arguments.len() >= 4,
        "RECORDER[,RECORDER]... KIND[:EFFECT] SEED NUMBER..."
    );
    let recorders: Vec<Recorder> = if arguments[0] == "all" {
        Recorder::value_variants().to_vec()
    } else {
        let parsed = arguments[0].split(',').map(|name| Recorder::from_str(name, true));
        parsed.collect::<Result<_, _>>().map_err(|name| {
            let known: Vec<String> = Recorder::value_variants()
                .iter()
                .map(|recorder| word(*recorder))
                .collect();
            anyhow::anyhow!("recorder: {name}; one of all, {}", known.join(", "))
        })?
    };
    let wish = Wish::named(&arguments[1])?;
    let seed: u64 = arguments[2].parse()?;
    for number in &arguments[3..] {
        let set = Set::new(seed, number.parse()?, &wish)?;
        let driven = set.driven(0)?;
        let hidden: Vec<String> = driven
            .known
            .iter()
            .map(|known| {
                let shown = known.visible.ratios.iter().copied().fold(0.0, f64::max);
                format!(
                    "{} {:?} at {shown:.1} of a sensor's noise",
                    known.drawn.name, known.drawn.parameters
                )
            })
            .collect();
        println!("{number} {}: {}", set.chassis, hidden.join(", "));
        for recorder in &recorders {
            let recorded = |runs: &[Run]| {
                runs.iter()
                    .map(|run| recorder.of(run))
                    .collect::<anyhow::Result<Vec<_>>>()
            };
            let input = Input {
                references: recorded(&driven.references)?,
                runs: recorded(&driven.runs)?,
                locked: Vec::new(),
                model: None,
                seed: 1,
            };
            let named = match diagnose(&Serial, &input) {
                Ok(found) => {
                    let of = |effect: &identify::report::schema::NamedEffect| {
                        let values: Vec<String> = effect
                            .parameters
                            .iter()
                            .map(|p| format!("{} {:.3}", p.name, p.value.unwrap_or(f64::INFINITY)))
                            .collect();
                        format!("{} ({})", effect.name, values.join(", "))
                    };
                    let names: Vec<String> = found.report.effects.iter().map(of).collect();
                    let why = found
                        .report
                        .untestable
                        .iter()
                        .find(|other| driven.known.iter().any(|known| known.drawn.name == other.name));
                    format!(
                        "{:?} {}{}",
                        found.report.verdict,
                        names.join(", "),
                        why.map_or_else(String::new, |why| format!("; {} untestable: {}", why.name, why.because))
                    )
                }
                Err(error) => format!("refused: {error}"),
            };
            println!("  {}: {named}", word(*recorder));
        }
    }
    Ok(())
}
