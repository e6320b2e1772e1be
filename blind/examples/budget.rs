//! How far the true effect of a set could show at most, and what takes it away: gains that the true change would have over the noise of
//! the references alone, with everyday differences from run to run beside it, and with what the calibration left open as well.
//!
//! `cargo run --release -p blind --example budget -- SEED NUMBER...`: sets of one effect, as `--kind single` numbers them.

use blind::kind::Kind;
use blind::reach::Reach;
use blind::set::{Set, Wish};
use identify::floor::Floor;
use identify::record::{CHANNELS, CLASSES};

fn main() -> anyhow::Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let seed: u64 = arguments.first().map_or(Ok(1), |text| text.parse())?;
    let wish = Wish {
        kind: Some(Kind::Single),
        ..Wish::standard()
    };
    for number in arguments.iter().skip(1) {
        let number: u64 = number.parse()?;
        let set = Set::new(seed, number, &wish)?;
        let driven = set.driven(0)?;
        let Some(known) = driven.known.first() else { continue };
        println!(
            "{number} {} {} {:?} best {:?}",
            set.chassis, known.drawn.name, known.drawn.index, known.best.parameters
        );
        let reach = Reach::of(&driven, known)?;
        let (floor, runs) = (&reach.floor, reach.records.len());
        let mut channels = [0.0; CLASSES];
        for ((record, base), changed) in reach.records.iter().zip(&reach.without).zip(&reach.with) {
            let weights = floor.noise.weights(record);
            for (((place, w), b), c) in record.places().iter().zip(weights).zip(base).zip(changed) {
                if let Some(quantity) = place.quantity {
                    channels[quantity.class()] += w * (b - c) * (b - c);
                }
            }
        }
        let shown: Vec<String> = CHANNELS
            .iter()
            .zip(channels)
            .map(|(name, gain)| format!("{name} {gain:.0}"))
            .collect();
        println!("  by channel, noise alone, all runs: {}", shown.join(" "));
        let count = floor.knobs.len();
        for (what, floor) in [
            ("noise", reach.known(true)),
            ("and variation", reach.known(false)),
            ("and calibration", floor.clone()),
        ] {
            for runs in [2, runs] {
                let gain = reach.gain(&floor, 0..runs);
                println!(
                    "  {what:<16} {runs} runs: expected {:.1} got {:.1}",
                    gain.expected, gain.got
                );
            }
        }
        // Which knob takes most: the calibration's share without the variation of one.
        let part = |floor: &Floor| reach.gain(floor, 0..runs).expected;
        let whole = part(floor);
        let mut takers: Vec<(f64, String)> = (0..count)
            .map(|k| {
                let mut other = floor.clone();
                other.variation[k] = 1e-9;
                (
                    part(&other) - whole,
                    format!("{} {:.3}", floor.knobs[k].label(), floor.variation[k].sqrt()),
                )
            })
            .collect();
        takers.sort_by(|a, b| b.0.total_cmp(&a.0));
        for (gain, label) in takers.iter().take(6) {
            println!("    without the variation of {label}: {gain:+.1}");
        }
        let mut takers: Vec<(f64, String)> = (0..count)
            .map(|k| {
                let mut other = floor.clone();
                for l in 0..count {
                    if l != k {
                        other.uncertainty.set(k, l, 0.0);
                        other.uncertainty.set(l, k, 0.0);
                    }
                }
                other.uncertainty.set(k, k, 1e-9);
                (
                    part(&other) - whole,
                    format!(
                        "{} {:.2} of {:.2}",
                        floor.knobs[k].label(),
                        floor.values[k],
                        floor.sigmas[k]
                    ),
                )
            })
            .collect();
        takers.sort_by(|a, b| b.0.total_cmp(&a.0));
        for (gain, label) in takers.iter().take(6) {
            println!("    were known exactly {label}: {gain:+.1}");
        }
    }
    Ok(())
}
