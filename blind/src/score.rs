//! From a sealed truth and the reports to samples of every metric. Nothing here knows how either was made.

use crate::kind::Kind;
use crate::oracle::Visible;
use crate::set::Known;
use crate::truth::Sealed;
use identify::report::schema::{NamedEffect, Report, Verdict};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use twin::effect::library::find;

/// Samples by metric: 1 and 0 for rates, values for means and medians.
pub type Facts = BTreeMap<String, Vec<f64>>;

/// An effect that was named.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Named {
    pub name: String,
    pub index: Option<usize>,
    pub status: String,
    pub alternatives: Vec<String>,
    pub parameters: BTreeMap<String, Option<f64>>,
    pub gain: f64,
    pub threshold: f64,
    pub stability: f64,
    /// Whether it is true, or cannot be told from the truth on these runs.
    pub right: bool,
}

/// Whether a named effect and a true one change these runs alike (cosine above 0.95).
pub type Alike<'a> = &'a dyn Fn(&NamedEffect, &Known) -> bool;

/// A channel is right when the truth shows on it at least this much as on the loudest.
const LOUD: f64 = 0.5;
/// An effect shows so little below this that it must not be named.
pub const UNEXCITED: f64 = 0.1;
/// Parameters mean something when the library's law explains this much of what the plant does.
pub const DESCRIBED: f64 = 0.3;
/// A patch is found within this, m.
const PATCH_M: f64 = 0.15;
/// A gap has grown from this factor.
pub const WORSE: f64 = 1.05;
/// A gap is above its floor from this factor.
pub const ABOVE_FLOOR: f64 = 1.5;

/// The row of an effect by how far it shows.
fn how_loud(known: &Known) -> &'static str {
    match known.visible.largest() {
        ratio if ratio >= 2.0 => "in_set_loud",
        ratio if ratio >= 1.0 => "in_set_middle",
        _ => "in_set_faint",
    }
}

fn is_same(effect: &NamedEffect, known: &Known) -> bool {
    effect.name == known.best.name && effect.index == known.best.index
}

fn is_right(effect: &NamedEffect, known: &Known, alike: Alike<'_>) -> bool {
    is_same(effect, known) || alike(effect, known)
}

fn holds(effect: &NamedEffect, known: &Known, alike: Alike<'_>) -> bool {
    is_right(effect, known, alike) || effect.alternatives.contains(&known.best.name)
}

/// Effects of a report with what the truth says of them.
pub fn named(sealed: &Sealed, report: &Report, alike: Alike<'_>) -> Vec<Named> {
    report
        .effects
        .iter()
        .map(|effect| Named {
            name: effect.name.clone(),
            index: effect.index,
            status: effect.status.clone(),
            alternatives: effect.alternatives.clone(),
            parameters: effect.parameters.iter().map(|p| (p.name.clone(), p.value)).collect(),
            gain: effect.evidence.gain,
            threshold: effect.evidence.threshold,
            stability: effect.evidence.stability,
            right: sealed.known.iter().any(|known| is_right(effect, known, alike)),
        })
        .collect()
}

/// Collects samples.
struct Scorer<'a> {
    facts: Facts,
    alike: Alike<'a>,
}

impl Scorer<'_> {
    fn add(&mut self, metric: &str, value: f64) {
        self.facts.entry(metric.to_owned()).or_default().push(value);
    }

    fn check(&mut self, metric: &str, is_true: bool) {
        self.add(metric, f64::from(u8::from(is_true)));
    }

    /// A set in which a confirmed name is not true.
    fn wrong(&mut self, metric: &str, sealed: &Sealed, report: &Report) {
        let confirmed = report.effects.iter().filter(|effect| effect.status == "confirmed");
        let mut wrong = 0;
        for effect in confirmed {
            let right = sealed.known.iter().any(|known| is_right(effect, known, self.alike));
            self.check("confirmed_name_wrong", !right);
            wrong += usize::from(!right);
        }
        self.check(metric, wrong > 0);
        // Only where the whole report says so as well.
        self.check(
            "wrong_under_confirmed_verdict",
            wrong > 0 && report.verdict == Verdict::Confirmed,
        );
    }

    fn first_and_set(&mut self, suffix: &str, known: &Known, report: &Report) {
        let first = report.effects.first();
        self.check(
            &format!("right_first{suffix}"),
            first.is_some_and(|effect| is_right(effect, known, self.alike)),
        );
        let set = report.effects.iter().find(|effect| holds(effect, known, self.alike));
        self.check(&format!("in_set{suffix}"), set.is_some());
        for effect in &report.effects {
            self.add(&format!("set_size{suffix}"), 1.0 + effect.alternatives.len() as f64);
        }
    }

    fn parameters(&mut self, known: &Known, report: &Report) {
        let Some(effect) = report.effects.iter().find(|effect| is_same(effect, known)) else {
            return;
        };
        let Some(entry) = find(&known.best.name).filter(|_| known.described >= DESCRIBED) else {
            return;
        };
        let sized = || entry.parameters.iter().filter(|parameter| parameter.carries_size);
        for parameter in sized() {
            let Some(found) = effect.parameters.iter().find(|found| found.name == parameter.name) else {
                continue;
            };
            let (truth, drawn) = (
                known.best.value(parameter.name),
                known.best.parameters.contains_key(parameter.name),
            );
            let (Some(value), true) = (found.value, truth.is_finite() && drawn) else {
                continue;
            };
            let from = |value: f64, neutral: f64| if neutral.is_finite() { value - neutral } else { value };
            // Components of a vector count against its length.
            let size = sized()
                .filter(|other| other.unit == parameter.unit && known.best.parameters.contains_key(other.name))
                .map(|other| from(known.best.value(other.name), other.neutral).powi(2))
                .sum::<f64>()
                .sqrt();
            if size > 0.0 {
                self.add("parameter_error", (value - truth).abs() / size);
            }
            if let (Some(low), Some(high)) = (found.low, found.high) {
                self.check("covered", low <= truth && truth <= high);
            }
        }
        if known.best.name == "low_friction_patch" {
            let place = |name: &str| {
                effect
                    .parameters
                    .iter()
                    .find(|found| found.name == name)
                    .and_then(|p| p.value)
            };
            if let (Some(x), Some(y)) = (place("x"), place("y")) {
                let off_m = (x - known.best.value("x")).hypot(y - known.best.value("y"));
                self.check("patch_centre", off_m <= PATCH_M);
            }
        }
    }

    fn gaps(&mut self, explained: &str, report: &Report) {
        if let Some(fraction) = report.explained_fraction {
            self.add(explained, fraction);
        }
        if !report.effects.is_empty() && !report.gap.is_empty() {
            self.check(
                "locked_worse",
                report.gap.iter().any(|gap| gap.after > WORSE * gap.before),
            );
            // Below what references leave there is no gap that could get worse.
            self.check(
                "locked_worse_above_floor",
                report
                    .gap
                    .iter()
                    .any(|gap| gap.after > WORSE * gap.before && gap.after > gap.floor),
            );
            // A table has two dozen rows of a few windows each: some are worse by chance.
            self.check(
                "locked_worse_surely",
                report
                    .gap
                    .iter()
                    .any(|gap| gap.after > WORSE * gap.before && gap.before < gap.low),
            );
        }
    }
}

/// Samples of a set. Halves have two reports, rounds one a round, everything else one.
pub fn score(sealed: &Sealed, reports: &[Report], alike: Alike<'_>) -> Facts {
    let mut scorer = Scorer {
        facts: Facts::new(),
        alike,
    };
    let Some(report) = reports.first() else {
        return scorer.facts;
    };
    let shown = sealed.known.first().filter(|known| known.detectable);
    match sealed.kind {
        Kind::Single => {
            scorer.wrong("wrong_confirmed", sealed, report);
            if let Some(known) = sealed.known.first() {
                single(&mut scorer, known, report);
            }
        }
        Kind::None => {
            scorer.check("named_nothing_there", !report.effects.is_empty());
            scorer.wrong("wrong_confirmed", sealed, report);
        }
        Kind::Pair => pair(&mut scorer, sealed, report),
        Kind::Many => many(&mut scorer, sealed, report),
        Kind::Unknown => {
            scorer.wrong("wrong_confirmed", sealed, report);
            if sealed.unknown_visible.as_ref().is_some_and(Visible::is_detectable) {
                let open = matches!(report.verdict, Verdict::Unexplained | Verdict::Partial);
                scorer.check("unknown_left_open", open);
            }
        }
        Kind::Poor => poor(&mut scorer, sealed, report),
        Kind::Closed => {
            scorer.wrong("wrong_confirmed_closed", sealed, report);
            if let Some(known) = shown {
                scorer.first_and_set("_closed", known, report);
            }
        }
        Kind::Shifted => {
            scorer.wrong("wrong_confirmed_shifted", sealed, report);
            if let Some(known) = shown {
                scorer.first_and_set("_shifted", known, report);
            }
        }
        Kind::Halves => halves(&mut scorer, reports),
        Kind::Rounds => rounds(&mut scorer, reports),
    }
    scorer.facts
}

fn pair(scorer: &mut Scorer<'_>, sealed: &Sealed, report: &Report) {
    scorer.wrong("wrong_confirmed", sealed, report);
    if sealed.known.iter().all(|known| known.detectable) {
        let is_found = |known: &&Known| {
            report
                .effects
                .iter()
                .any(|effect| is_right(effect, known, scorer.alike))
        };
        let found = sealed.known.iter().filter(is_found).count();
        scorer.check("both_named", found == sealed.known.len());
        scorer.check("one_named", found > 0);
        scorer.gaps("explained_two", report);
    }
}

fn many(scorer: &mut Scorer<'_>, sealed: &Sealed, report: &Report) {
    scorer.wrong("wrong_confirmed_many", sealed, report);
    for known in sealed.known.iter().filter(|known| known.detectable) {
        let named = report
            .effects
            .iter()
            .any(|effect| is_right(effect, known, scorer.alike));
        scorer.check("named_of_many", named);
    }
    scorer.gaps("explained_many", report);
}

fn poor(scorer: &mut Scorer<'_>, sealed: &Sealed, report: &Report) {
    scorer.wrong("wrong_confirmed_poor", sealed, report);
    let unexcited = sealed.known.first().filter(|known| known.visible.largest() < UNEXCITED);
    if let Some(known) = unexcited {
        let named = report.effects.iter().any(|effect| holds(effect, known, scorer.alike));
        scorer.check("unexcited_not_named", !named);
        let listed = report.untestable.iter().any(|other| other.name == known.best.name);
        scorer.check("unexcited_listed_untestable", listed);
    }
}

fn halves(scorer: &mut Scorer<'_>, reports: &[Report]) {
    let [a, b, ..] = reports else { return };
    scorer.check("halves_same_verdict", a.verdict == b.verdict);
    let names = |report: &Report| -> Vec<_> { report.effects.iter().map(|e| (e.name.clone(), e.index)).collect() };
    scorer.check("halves_same_names", names(a) == names(b));
}

fn single(scorer: &mut Scorer<'_>, known: &Known, report: &Report) {
    if !known.detectable {
        scorer.check("undetectable_named", !report.effects.is_empty());
        return;
    }
    scorer.first_and_set("", known, report);
    let is_in_set = report.effects.iter().any(|effect| holds(effect, known, scorer.alike));
    scorer.check(how_loud(known), is_in_set);
    let exact = report.effects.first().is_some_and(|effect| is_same(effect, known));
    scorer.check("right_first_exact", exact);
    let untestable = report.untestable.iter().any(|other| other.name == known.best.name);
    scorer.check("detectable_called_untestable", untestable);
    scorer.parameters(known, report);
    scorer.gaps("explained_one", report);
    if let Some(channel) = report.place.channels.first() {
        scorer.check(
            "right_channel",
            known.visible.of(channel) >= LOUD * known.visible.largest(),
        );
    }
}

/// The gap that a round meets against the one that the round before met.
fn rounds(scorer: &mut Scorer<'_>, reports: &[Report]) {
    for pair in reports.windows(2) {
        let mut logs = Vec::new();
        for gap in pair[0].gap.iter().filter(|gap| gap.before > ABOVE_FLOOR * gap.floor) {
            let later = pair[1]
                .gap
                .iter()
                .find(|other| other.channel == gap.channel && other.horizon_s == gap.horizon_s);
            if let Some(later) = later.filter(|later| later.before > 0.0) {
                logs.push((later.before / gap.before).ln());
            }
        }
        if !logs.is_empty() {
            let mean = logs.iter().sum::<f64>() / logs.len() as f64;
            scorer.check("gap_rose", mean > WORSE.ln());
            scorer.add("gap_ratio_of_rounds", mean.exp());
        }
    }
}

/// The one fact that is of models and not of reports.
pub const REMOVED: &str = "accepted_then_removed";

/// Effects of a model version that the next one no longer has.
///
/// - `models`: name and wheel of every effect, round after round.
pub fn removed(models: &[Vec<(String, Option<usize>)>]) -> Facts {
    let mut facts = Facts::new();
    for pair in models.windows(2) {
        for effect in &pair[0] {
            let gone = !pair[1].contains(effect);
            facts
                .entry(REMOVED.to_owned())
                .or_default()
                .push(f64::from(u8::from(gone)));
        }
    }
    facts
}
