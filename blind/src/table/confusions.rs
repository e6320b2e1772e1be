//! What was named in place of the truth.

use crate::bench::Line;
use crate::kind::Kind;
use std::collections::BTreeMap;
use std::fmt::Write;

/// Truth to what was named first, single effects only, and names where nothing was.
pub(super) fn confusions(lines: &[Line]) -> String {
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
