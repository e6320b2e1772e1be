//! What the plant says of every effect, without a diagnosis: drawn and best parameters, and how far it shows by channel.
//!
//! `cargo run -p blind --example oracle -- [SEED] [KIND]`

use blind::kind::Kind;
use blind::oracle::CHANNELS;
use blind::set::{Set, Wish};
use clap::ValueEnum;

fn main() -> anyhow::Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let seed = arguments.first().map_or(Ok(1), |text| text.parse())?;
    let kind = arguments
        .get(1)
        .map_or(Ok(Kind::Single), |text| Kind::from_str(text, true));
    let wish = Wish {
        kind: Some(kind.map_err(anyhow::Error::msg)?),
        references: 0,
        runs: 2,
        ..Wish::standard()
    };
    let sets = twin::effect::library::LIBRARY.len() as u64;
    for number in 0..sets {
        let set = Set::new(seed, number, &wish)?;
        let driven = set.driven(0)?;
        let trace = driven
            .trace
            .ticks
            .iter()
            .map(|tick| tick.pose[0].abs().max(tick.pose[1].abs()));
        let far = trace.fold(0.0, f64::max);
        if let (Some(name), Some(visible)) = (&set.unknown, &driven.unknown) {
            println!("{} {name}: {:?}", set.chassis, visible.ratios);
        }
        for known in driven.known {
            let ratios: Vec<String> = CHANNELS
                .iter()
                .map(|channel| format!("{channel} {:.2}", known.visible.of(channel)))
                .collect();
            println!(
                "{number} {} {} {:?} {:?} -> {:?} ({}): {} far {far:.1} m",
                set.chassis,
                known.drawn.name,
                known.drawn.index,
                known.drawn.parameters,
                known.best.parameters,
                known.described,
                ratios.join(" ")
            );
        }
    }
    Ok(())
}
