//! How far the true effect of a set could show at most, and what takes it away: gains that the true change would have over the noise of
//! the references alone, with everyday differences from run to run beside it, and with what the calibration left open as well.
//!
//! `cargo run --release -p blind --example budget -- SEED NUMBER...`: sets of one effect, as `--kind single` numbers them.

use blind::kind::Kind;
use blind::set::{Set, Wish};
use identify::diagnose::calibrated_floor;
use identify::floor::{Floor, knob_changes};
use identify::linear::Square;
use identify::record::{CHANNELS, CLASSES, Record, Stages, residuals};
use identify::screen::columns;
use identify::workers::Serial;

fn views(vectors: &[Vec<f64>]) -> Vec<&[f64]> {
    vectors.iter().map(Vec::as_slice).collect()
}

/// Expected gain of the true change, and the gain that it has.
fn gains(
    floor: &Floor,
    records: &[Record],
    sensitivities: &[Vec<Vec<f64>>],
    change: &[Vec<Vec<f64>>; 2],
) -> (f64, f64) {
    let metric = floor.metric(records, sensitivities);
    let own: Vec<Vec<f64>> = change[0]
        .iter()
        .zip(&change[1])
        .map(|(base, changed)| base.iter().zip(changed).map(|(b, c)| b - c).collect())
        .collect();
    let gram = metric.gram(&[views(&change[0]), views(&change[1]), views(&own)]);
    (gram.at(2, 2), gram.at(0, 0) - gram.at(1, 1))
}

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
        let floor = calibrated_floor(&Serial, &driven.references, None)?;
        let changed_model = floor.model.with(known.best.effect());
        let stages = vec![Stages::BOTH; floor.knobs.len()];
        let records: Vec<Record> = driven
            .runs
            .iter()
            .map(|run| Record::of(&run.path, &run.bundle))
            .collect();
        let simulated = |model| -> Vec<Vec<f64>> {
            let all = records
                .iter()
                .map(|record| residuals(record, model, Stages::BOTH, None));
            all.map(Option::unwrap_or_default).collect()
        };
        let (base, changed) = (simulated(&floor.model), simulated(&changed_model));
        let sensitivities = columns(
            &Serial,
            &records,
            &base,
            &knob_changes(&floor.model, &floor.knobs, &floor.values, &stages),
        )?;
        let mut channels = [0.0; CLASSES];
        for ((record, base), changed) in records.iter().zip(&base).zip(&changed) {
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
        let tiny = |floor: &Floor, with_variation: bool| {
            let mut other = floor.clone();
            other.uncertainty = Square::zero(count);
            for k in 0..count {
                other.uncertainty.set(k, k, 1e-9);
                if !with_variation {
                    other.variation[k] = 1e-9;
                }
            }
            other
        };
        for (what, floor) in [
            ("noise", tiny(&floor, false)),
            ("and variation", tiny(&floor, true)),
            ("and calibration", floor.clone()),
        ] {
            for runs in [2, 6] {
                let part: Vec<Vec<Vec<f64>>> = sensitivities.iter().map(|knob| knob[..runs].to_vec()).collect();
                let change = [base[..runs].to_vec(), changed[..runs].to_vec()];
                let (expected, got) = gains(&floor, &records[..runs], &part, &change);
                println!("  {what:<16} {runs} runs: expected {expected:.1} got {got:.1}");
            }
        }
        // Which knob takes most: the calibration's share without the variation of one.
        let part = |floor: &Floor| gains(floor, &records, &sensitivities, &[base.clone(), changed.clone()]).0;
        let whole = part(&floor);
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
