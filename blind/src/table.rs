//! The table of the specification from the samples of all sets.

use crate::bench::Line;
use crate::interval::{clopper_pearson_upper, median, wilson};
use crate::set::Kind;
use std::collections::BTreeMap;
use std::fmt::Write;

/// How a metric is read.
#[derive(Clone, Copy)]
enum Reading {
    Rate,
    /// Small is good; the one-sided bound counts.
    Limit,
    Median,
    Mean,
}

struct Row {
    metric: &'static str,
    says: &'static str,
    must: &'static str,
    aim: &'static str,
    reading: Reading,
}

const fn row(metric: &'static str, says: &'static str, must: &'static str, aim: &'static str, reading: Reading) -> Row {
    Row {
        metric,
        says,
        must,
        aim,
        reading,
    }
}

use Reading::{Limit, Mean, Median, Rate};

const ROWS: &[Row] = &[
    row(
        "right_first",
        "right name first, single detectable effect",
        "85 %",
        "95 %",
        Rate,
    ),
    row("in_set", "true name inside the returned set", "95 %", "98 %", Rate),
    row("set_size", "mean set size", "1.5", "", Mean),
    row("named_nothing_there", "any name on no-effect data", "2 %", "1 %", Limit),
    row(
        "wrong_confirmed",
        "sets with a confirmed name that is not true (single, none, pair, unknown)",
        "5 %",
        "2 %",
        Limit,
    ),
    row(
        "wrong_under_confirmed_verdict",
        "the same where the verdict is confirmed too (all kinds)",
        "",
        "",
        Limit,
    ),
    row(
        "confirmed_name_wrong",
        "of the confirmed names (all kinds)",
        "",
        "",
        Limit,
    ),
    row(
        "unknown_left_open",
        "effect outside the library reported unexplained or partial",
        "70 %",
        "90 %",
        Rate,
    ),
    row(
        "unexcited_not_named",
        "unexcited effect untestable or absent",
        "95 %",
        "99 %",
        Rate,
    ),
    row(
        "unexcited_listed_untestable",
        "of these listed as untestable",
        "",
        "",
        Rate,
    ),
    row(
        "wrong_confirmed_poor",
        "poorly excited: wrong confirmed",
        "5 %",
        "2 %",
        Limit,
    ),
    row("parameter_error", "parameter error, median", "10 %", "3 %", Median),
    row("covered", "95 % intervals that cover", "90-98 %", "", Rate),
    row(
        "explained_one",
        "explained fraction on locked runs, one effect, median",
        "0.8",
        "0.95",
        Median,
    ),
    row("explained_two", "the same, two effects", "0.7", "0.9", Median),
    row(
        "locked_worse",
        "locked runs made worse by > 5 % in any channel (sets)",
        "2 %",
        "0",
        Limit,
    ),
    row("both_named", "two effects: both named", "60 %", "80 %", Rate),
    row("one_named", "two effects: at least one", "90 %", "98 %", Rate),
    row(
        "patch_centre",
        "patch centre within 0.15 m (of the patches named)",
        "80 %",
        "95 %",
        Rate,
    ),
    row("right_channel", "right channel first", "80 %", "95 %", Rate),
    row(
        "halves_same_verdict",
        "same verdict on two disjoint halves",
        "85 %",
        "95 %",
        Rate,
    ),
    row("halves_same_names", "and the same names", "", "", Rate),
    row(
        "explained_many",
        "no references, 4-6 effects: explained fraction, median",
        "0.7",
        "0.9",
        Median,
    ),
    row(
        "named_of_many",
        "no references, 4-6 effects: effects named",
        "50 %",
        "75 %",
        Rate,
    ),
    row(
        "wrong_confirmed_many",
        "no references, 4-6 effects: sets with a wrong confirmed name",
        "5 %",
        "2 %",
        Limit,
    ),
    row(
        "right_first_shifted",
        "references driven otherwise: right name first",
        "5 points",
        "2 points",
        Rate,
    ),
    row(
        "in_set_shifted",
        "references driven otherwise: inside the set",
        "5 points",
        "2 points",
        Rate,
    ),
    row(
        "wrong_confirmed_shifted",
        "references driven otherwise: wrong confirmed",
        "5 points",
        "2 points",
        Limit,
    ),
    row(
        "wrong_confirmed_closed",
        "closed-loop task data only: wrong confirmed",
        "2 %",
        "1 %",
        Limit,
    ),
    row(
        "right_first_closed",
        "closed-loop task data only: right name first",
        "",
        "",
        Rate,
    ),
    row(
        "gap_rose",
        "three rounds: gap rises from a round to the next",
        "0",
        "0",
        Limit,
    ),
    row(
        "undetectable_named",
        "single effects that do not show: any name",
        "",
        "",
        Rate,
    ),
    row(
        "detectable_called_untestable",
        "single effects that show and are called untestable",
        "",
        "",
        Rate,
    ),
];

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

/// Truth to what was named first, single effects only, and names where nothing was.
fn confusions(lines: &[Line]) -> String {
    let mut counts: BTreeMap<(String, String), (usize, Vec<u64>)> = BTreeMap::new();
    for line in lines.iter().filter(|line| line.error.is_none()) {
        let truth = match (line.kind, &line.unknown) {
            (Kind::Single | Kind::Closed | Kind::Shifted | Kind::Poor, _) => {
                let Some(known) = line.known.first() else { continue };
                let shows = if known.detectable { "" } else { " (does not show)" };
                let kind = if line.kind == Kind::Single {
                    String::new()
                } else {
                    format!(" ({:?})", line.kind).to_lowercase()
                };
                format!("{}{shows}{kind}", known.best.name)
            }
            (Kind::None, _) => "nothing".to_owned(),
            (Kind::Unknown, Some(name)) => format!("{name} (unknown)"),
            _ => continue,
        };
        let named = line.named.first().map(Vec::as_slice).unwrap_or_default();
        if named.iter().all(|named| named.right) && !named.is_empty() {
            continue;
        }
        if named.is_empty() && matches!(line.kind, Kind::None | Kind::Poor) {
            continue;
        }
        if named.is_empty() && line.known.first().is_some_and(|known| !known.detectable) {
            continue;
        }
        let said = if named.is_empty() {
            line.verdicts.first().cloned().unwrap_or_default()
        } else {
            let texts: Vec<String> = named
                .iter()
                .map(|named| {
                    let mark = if named.right { "+" } else { "" };
                    let open = if named.alternatives.is_empty() {
                        String::new()
                    } else {
                        format!(" or {}", named.alternatives.join(" or "))
                    };
                    format!("{}{mark}{open}", named.name)
                })
                .collect();
            texts.join(", ")
        };
        let entry = counts.entry((truth, said)).or_default();
        entry.0 += 1;
        entry.1.push(line.set);
    }
    let mut sorted: Vec<_> = counts.into_iter().collect();
    sorted.sort_by(|a, b| b.1.0.cmp(&a.1.0).then(a.0.cmp(&b.0)));
    let mut out = "\n| truth | named (+ right) | times | sets |\n|---|---|---|---|\n".to_owned();
    for ((truth, said), (count, sets)) in sorted {
        let sets: Vec<String> = sets.iter().map(u64::to_string).collect();
        let _ = writeln!(out, "| {truth} | {said} | {count} | {} |", sets.join(" "));
    }
    out
}
