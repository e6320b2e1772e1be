//! A second effect that shows on channels on which the first one left no gap is named beside it.

use blind::set::{Set, Wish};
use identify::diagnose::{Input, diagnose};
use identify::workers::Serial;

/// A car of which the tracker is late, and whose track width moves motor currents and hardly anything else.
const SEED: u64 = 330;
const NUMBER: u64 = 1;

#[test]
fn a_track_width_is_named_beside_a_latency() {
    let wish = Wish::named("pair").expect("a kind");
    let driven = Set::new(SEED, NUMBER, &wish)
        .and_then(|set| set.driven(0))
        .expect("runs");
    let hidden: Vec<&str> = driven.known.iter().map(|known| known.drawn.name.as_str()).collect();
    assert_eq!(hidden, ["localization_latency", "track_width"]);
    let input = Input {
        references: driven.references,
        runs: driven.runs,
        locked: Vec::new(),
        model: None,
        seed: 1,
    };
    let report = diagnose(&Serial, &input).expect("a diagnosis").report;
    let named: Vec<&str> = report.effects.iter().map(|effect| effect.name.as_str()).collect();
    assert_eq!(named, hidden);
    let width = report.effects[1].parameters[0].value.unwrap_or(0.0);
    assert!((width + 0.0815).abs() < 0.01, "{width}");
}
