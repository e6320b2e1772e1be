//! Set-points that a run's wheels say never arrived, run by run: energy of the wheel speeds over the noise without and with them.
//!
//! `cargo run --release -p blind --example losses -- KIND SEED NUMBER...`

use blind::kind::Kind;
use blind::set::{Set, Wish};
use clap::ValueEnum;
use identify::diagnose::calibrated_floor;
use identify::lost::arrived;
use identify::record::{Place, Quantity, Record};
use identify::workers::Serial;

fn main() -> anyhow::Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let kind = arguments.first().map_or("single", String::as_str);
    let kind = Kind::from_str(kind, true).map_err(|error| anyhow::anyhow!("{error}"))?;
    let seed: u64 = arguments.get(1).map_or(Ok(1), |text| text.parse())?;
    let wish = Wish {
        kind: Some(kind),
        ..Wish::standard()
    };
    for number in arguments.iter().skip(2) {
        let number: u64 = number.parse()?;
        let set = Set::new(seed, number, &wish)?;
        let driven = set.driven(0)?;
        println!("{number} {}", set.chassis);
        for known in &driven.known {
            println!("  hidden {} {:?}", known.drawn.name, known.drawn.parameters);
        }
        let floor = calibrated_floor(&Serial, &driven.references, None)?;
        for run in driven.references.iter().take(2).chain(&driven.runs) {
            let record = Record::of(&run.path, &run.bundle);
            let wheels = |place: &&Place| matches!(place.quantity, Some(Quantity::Wheel(_)));
            let cells = record.places().iter().filter(wheels).count() as f64;
            let start = std::time::Instant::now();
            let Some(found) = arrived(&run.path, &run.bundle, &floor.model, &floor.noise) else {
                continue;
            };
            let lengths: Vec<String> = found
                .spans
                .iter()
                .map(|span| format!("{:.0}", 1e3 * (span.to_s - span.from_s)))
                .collect();
            println!(
                "  {}: energy {:.0} -> {:.0}, expected {:.0}; {} spans, seen {:.2} s, lost {:.2} s: {:.3}; {:.1} s; ms {}",
                run.path,
                found.wheels[0],
                found.wheels[1],
                cells / floor.noise.classes[0].correlation,
                found.spans.len(),
                found.seen.open_s,
                found.seen.lost_s,
                found.seen.lost_s / found.seen.open_s.max(1e-9),
                start.elapsed().as_secs_f64(),
                lengths.join(" ")
            );
        }
    }
    Ok(())
}
