//! What a diagnosis says of sets and of what is hidden in them: what was named, and in which list the truth ended and why.
//!
//! `cargo run --release -p blind --example why -- KIND[:EFFECT[:RUNS]] SEED NUMBER...`; with an effect, sets as `--effect EFFECT` numbers them.

use blind::set::{Set, Wish};
use identify::diagnose::{Input, diagnose};
use identify::workers::Serial;

fn main() -> anyhow::Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let wish = Wish::named(arguments.first().map_or("single", String::as_str))?;
    let seed: u64 = arguments.get(1).map_or(Ok(1), |text| text.parse())?;
    for number in arguments.iter().skip(2) {
        let set = Set::new(seed, number.parse()?, &wish)?;
        let driven = set.driven(0)?;
        println!("{number} {} {}", set.chassis, set.robot.name);
        for known in &driven.known {
            println!(
                "  hidden {} {:?} {:?}, best {:?}, visible {:?}",
                known.drawn.name,
                known.drawn.index,
                known.drawn.parameters,
                known.best.parameters,
                known.visible.ratios
            );
        }
        let input = Input {
            references: driven.references,
            runs: driven.runs,
            locked: Vec::new(),
            model: None,
            seed: 1,
        };
        let report = diagnose(&Serial, &input)?.report;
        println!(
            "  {}: {}",
            serde_json::to_string(&report.verdict)?,
            report.place.sentence
        );
        for effect in &report.effects {
            println!(
                "  named {} {:?} {}",
                effect.name,
                effect.index,
                serde_json::to_string(&effect)?
            );
        }
        for absorbed in &report.absorbed {
            println!("  absorbed {}", serde_json::to_string(absorbed)?);
        }
        for rejected in &report.rejected {
            println!("  rejected {}: {}", rejected.name, rejected.because);
        }
        for untestable in &report.untestable {
            println!("  untestable {}: {}", untestable.name, untestable.because);
        }
        for row in &report.gap {
            println!("  gap {}", serde_json::to_string(row)?);
        }
        for remark in &report.remarks {
            println!("  remark {remark}");
        }
    }
    Ok(())
}
