//! The table of the specification from the samples of all sets.

mod confusions;
mod rows;

use crate::bench::Line;
use crate::interval::{clopper_pearson_upper, median, wilson};
use crate::kind::Kind;
use confusions::confusions;
use rows::{ROWS, Reading};
use std::fmt::Write;

fn percent(value: f64) -> String {
    format!("{:.1} %", 100.0 * value)
}

fn got(reading: Reading, samples: &[f64]) -> (String, String) {
    let n = samples.len();
    if n == 0 {
        return ("-".to_owned(), String::new());
    }
    let mean = samples.iter().sum::<f64>() / n as f64;
    let hits = samples.iter().filter(|sample| **sample > 0.5).count();
    match reading {
        Reading::Rate => {
            let (low, high) = wilson(hits, n);
            (percent(mean), format!("{} .. {}", percent(low), percent(high)))
        }
        Reading::Limit => (
            percent(mean),
            format!("below {}", percent(clopper_pearson_upper(hits, n))),
        ),
        Reading::Median => median(samples).map_or_else(Default::default, |(middle, low, high)| {
            (format!("{middle:.3}"), format!("{low:.3} .. {high:.3}"))
        }),
        Reading::Mean => {
            let variance = samples.iter().map(|s| (s - mean).powi(2)).sum::<f64>() / n as f64;
            let half = 1.96 * (variance / n as f64).sqrt();
            (
                format!("{mean:.2}"),
                format!("{:.2} .. {:.2}", mean - half, mean + half),
            )
        }
    }
}

/// The table, the confusions and the time, as markdown.
pub fn markdown(lines: &[Line]) -> String {
    let mut out = "| metric | must | aim | got | 95 % interval | n |\n|---|---|---|---|---|---|\n".to_owned();
    for row in ROWS {
        let samples: Vec<f64> = lines
            .iter()
            .filter_map(|line| line.facts.get(row.metric))
            .flatten()
            .copied()
            .collect();
        let (got, interval) = got(row.reading, &samples);
        let _ = writeln!(
            out,
            "| {} | {} | {} | {got} | {interval} | {} |",
            row.says,
            row.must,
            row.aim,
            samples.len()
        );
    }
    out.push_str(&times(lines));
    out.push_str(&confusions(lines));
    out
}

fn times(lines: &[Line]) -> String {
    let mut out =
        "\n| kind | sets | errors | CPU s to make, mean | CPU s to name, mean |\n|---|---|---|---|---|\n".to_owned();
    let mut kinds: Vec<Kind> = lines.iter().map(|line| line.kind).collect();
    kinds.sort_unstable();
    kinds.dedup();
    for kind in kinds {
        let of: Vec<&Line> = lines.iter().filter(|line| line.kind == kind).collect();
        let mean = |value: fn(&Line) -> f64| of.iter().map(|line| value(line)).sum::<f64>() / of.len() as f64;
        let errors = of.iter().filter(|line| line.error.is_some()).count();
        let name = format!("{kind:?}").to_lowercase();
        let (make, naming) = (mean(|line| line.make_s), mean(|line| line.name_s));
        let _ = writeln!(out, "| {name} | {} | {errors} | {make:.1} | {naming:.1} |", of.len());
    }
    out
}
