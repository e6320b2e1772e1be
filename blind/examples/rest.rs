//! What is left of a set once its true effects are in the model: the windows of runs and references that are loudest by the references' noise, and
//! on which channels.
//!
//! `cargo run --release -p blind --example rest -- [KIND] SEED NUMBER...`: sets as `--kind KIND` (`single` when absent) numbers them. Where nothing is hidden that
//! the library has, under the calibration alone.

use blind::kind::Kind;
use blind::set::{Set, Wish};
use clap::ValueEnum;
use identify::diagnose::calibrated_floor;
use identify::floor::Floor;
use identify::hypothesis::Hypothesis;
use identify::record::{CHANNELS, CLASSES, Record, Stages, residuals};
use identify::workers::Serial;

/// Windows shown of references and of runs.
const SHOWN: usize = 8;

/// Energy over the noise of every window by channel, with its number of cells.
fn windows(floor: &Floor, record: &Record, model: &Hypothesis) -> Vec<[(f64, usize); CLASSES]> {
    let mut sums = vec![[(0.0, 0); CLASSES]; record.windows.len()];
    let Some(residual) = residuals(record, model, Stages::BOTH, None) else {
        return sums;
    };
    let weights = floor.noise.weights(record);
    for ((place, weight), value) in record.places().iter().zip(weights).zip(&residual) {
        if let Some(quantity) = place.quantity {
            let sum = &mut sums[place.window][quantity.class()];
            sum.0 += weight * value * value;
            sum.1 += 1;
        }
    }
    sums
}

/// Energy of a cell over the noise where references reach and beyond, by how far.
fn by_activity(floor: &Floor, records: &[Record], model: &Hypothesis, class: usize, name: &str) {
    let noise = &floor.noise.classes[class];
    let mut bins: [(f64, usize, Vec<f64>); 4] = Default::default();
    for record in records {
        let Some(residual) = residuals(record, model, Stages::BOTH, None) else {
            continue;
        };
        let places = record.places();
        for ((place, activity), value) in places.iter().zip(record.activities()).zip(&residual) {
            if place.quantity.is_some_and(|quantity| quantity.class() == class) {
                let far = activity / noise.reach.max(1e-9);
                let bin = [0.3, 1.0, 2.0].iter().filter(|edge| far > **edge).count();
                let square = value * value / noise.at(activity);
                bins[bin].0 += square;
                bins[bin].1 += 1;
                bins[bin].2.push(square);
            }
        }
    }
    let words: Vec<String> = bins
        .iter_mut()
        .filter(|bin| bin.1 > 0)
        .map(|(sum, count, squares)| {
            squares.sort_by(f64::total_cmp);
            format!(
                "{:.2} ({:.2}; {count})",
                *sum / *count as f64,
                squares[*count / 2] / 0.455
            )
        })
        .collect();
    if !words.is_empty() {
        println!(
            "    {name}: reach {:.3}, level {:.2e} slope {:.2e} beyond {:.2e}; mean (median) to 0.3, 1, 2, more of it: {}",
            noise.reach,
            noise.level,
            noise.slope,
            noise.beyond,
            words.join(", ")
        );
    }
}

fn show(floor: &Floor, records: &[Record], model: &Hypothesis) {
    let mut all: Vec<(f64, String)> = Vec::new();
    let mut totals = [(0.0, 0); CLASSES];
    for record in records {
        for (window, classes) in record.windows.iter().zip(windows(floor, record, model)) {
            let excess: Vec<(usize, f64)> = (0..CLASSES)
                .filter(|class| classes[*class].1 > 0)
                .map(|class| (class, classes[class].0 - classes[class].1 as f64))
                .collect();
            for class in 0..CLASSES {
                totals[class].0 += classes[class].0;
                totals[class].1 += classes[class].1;
            }
            let words: Vec<String> = excess
                .iter()
                .filter(|(_, excess)| excess.abs() > 5.0)
                .map(|(class, excess)| format!("{} {excess:+.0} of {}", CHANNELS[*class], classes[*class].1))
                .collect();
            let sum: f64 = excess.iter().map(|pair| pair.1).sum();
            let (pose, twist) = (window.start.pose, window.start.twist);
            let [vx, vy, yaw_rate] = [twist.forward_m_per_s, twist.left_m_per_s, twist.yaw_rate_rad_per_s];
            all.push((
                sum,
                format!(
                    "{} {:.1} to {:.1} s, starts at ({:.2}, {:.2}) m with {vx:.2} {vy:.2} m/s {yaw_rate:.2} rad/s: {}",
                    record.name,
                    window.from_s,
                    window.to_s,
                    pose.x_m,
                    pose.y_m,
                    words.join(", ")
                ),
            ));
        }
    }
    let shares: Vec<String> = totals
        .iter()
        .zip(CHANNELS)
        .filter(|(total, _)| total.1 > 0)
        .map(|(total, name)| format!("{name} {:.2}", total.0 / total.1 as f64))
        .collect();
    println!("  energy of a cell by channel: {}", shares.join(" "));
    for (class, name) in CHANNELS.iter().enumerate() {
        by_activity(floor, records, model, class, name);
    }
    all.sort_by(|a, b| b.0.total_cmp(&a.0));
    for (excess, words) in all.iter().take(SHOWN) {
        println!("    {excess:+8.0} {words}");
    }
}

fn main() -> anyhow::Result<()> {
    let mut arguments: Vec<String> = std::env::args().skip(1).collect();
    let named = arguments.first().and_then(|text| Kind::from_str(text, true).ok());
    if named.is_some() {
        arguments.remove(0);
    }
    let seed: u64 = arguments.first().map_or(Ok(1), |text| text.parse())?;
    let wish = Wish {
        kind: Some(named.unwrap_or(Kind::Single)),
        ..Wish::standard()
    };
    for number in arguments.iter().skip(1) {
        let set = Set::new(seed, number.parse()?, &wish)?;
        let driven = set.driven(0)?;
        println!("{number} {}", set.chassis);
        for known in &driven.known {
            println!("  hidden {} {:?}", known.drawn.name, known.best.parameters);
        }
        let floor = calibrated_floor(&Serial, &driven.references, None)?;
        println!("  references, calibrated");
        show(&floor, &floor.references, &floor.model);
        let records: Vec<Record> = driven
            .runs
            .iter()
            .map(|run| Record::of(&run.path, &run.bundle))
            .collect();
        println!("  runs, with what is hidden in the model, as far as the library has it");
        let base = floor.model.clone();
        let truth = driven
            .known
            .iter()
            .fold(base, |model, known| model.with(known.best.effect()));
        show(&floor, &records, &truth);
    }
    Ok(())
}
