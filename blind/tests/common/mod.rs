//! Diagnoses of sets of the bench.

use blind::set::{Driven, Set, Wish};
use identify::diagnose::{Input, diagnose};
use identify::report::Report;
use identify::workers::Serial;

/// Diagnosis of the runs of a set that hides these effects, of which it is not told.
pub fn diagnosed(kind: &str, seed: u64, number: u64, hidden: &[&str]) -> Report {
    let wish = Wish::named(kind).expect("a kind");
    let driven: Driven = Set::new(seed, number, &wish)
        .and_then(|set| set.driven(0))
        .expect("runs");
    let names: Vec<&str> = driven.known.iter().map(|known| known.drawn.name.as_str()).collect();
    assert_eq!(names, hidden);
    let input = Input {
        references: driven.references,
        runs: driven.runs,
        locked: Vec::new(),
        model: None,
        seed: 1,
    };
    diagnose(&Serial, &input).expect("a diagnosis").report
}

/// Names and wheels, in order.
pub fn named(report: &Report) -> Vec<(&str, Option<usize>)> {
    let effects = report.effects.iter();
    effects.map(|effect| (effect.name.as_str(), effect.index)).collect()
}

/// First size of an effect.
pub fn size(report: &Report, effect: usize) -> f64 {
    report.effects[effect].parameters[0].value.unwrap_or(f64::NAN)
}
