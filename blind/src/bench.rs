//! The bench: sets one after the other, each sealed, named, opened, scored, and written as a line.

use crate::effects::Truth;
use crate::fit::cosine;
use crate::kind::Kind;
use crate::namer::name;
use crate::score::{Facts, Named, REMOVED, named, removed, score};
use crate::set::{Driven, Known, Set, Wish};
use crate::telemetry::hex;
use crate::truth::{Sealed, Vault};
use anyhow::{Context, Result, anyhow, ensure};
use identify::diagnose::Diagnosis;
use identify::report::schema::{NamedEffect, Report, Verdict};
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use std::fs;
use std::io::{Read, Write};
use std::path::{Path, PathBuf};

/// Cosine from which two effects count as one name.
const ONE_CLASS: f64 = 0.95;
/// Rounds of diagnose, accept, rerun.
pub const ROUNDS: u64 = 3;

/// One set's result.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Line {
    pub set: u64,
    pub kind: Kind,
    pub chassis: String,
    pub seal: String,
    pub reports: Vec<String>,
    pub known: Vec<Known>,
    pub unknown: Option<String>,
    pub verdicts: Vec<String>,
    /// Of every report.
    pub named: Vec<Vec<Named>>,
    pub untestable: Vec<String>,
    pub absorbed: Vec<String>,
    pub channels: Vec<String>,
    pub explained: Option<f64>,
    pub facts: Facts,
    pub error: Option<String>,
    /// CPU seconds of plant and oracle, and of the diagnosis.
    pub make_s: f64,
    pub name_s: f64,
}

impl Line {
    fn empty(set: &Set) -> Line {
        Line {
            set: set.number,
            kind: set.kind,
            chassis: set.chassis.clone(),
            seal: String::new(),
            reports: Vec::new(),
            known: Vec::new(),
            unknown: set.unknown.clone(),
            verdicts: Vec::new(),
            named: Vec::new(),
            untestable: Vec::new(),
            absorbed: Vec::new(),
            channels: Vec::new(),
            explained: None,
            facts: Facts::new(),
            error: None,
            make_s: 0.0,
            name_s: 0.0,
        }
    }

    /// What reports said of a set, and how right that was.
    fn judge(&mut self, set: &Set, driven: &Driven, sealed: &Sealed, reports: &[Report]) {
        let alike = |effect: &NamedEffect, known: &Known| is_alike(set, driven, effect, known);
        self.facts = score(sealed, reports, &alike);
        self.named = reports.iter().map(|report| named(sealed, report, &alike)).collect();
    }
}

/// Scores the reports that were kept of a set again: the runs are made anew, nothing is diagnosed.
///
/// - `kept`: folder of kept sets.
/// - Errors: a truth or a report that is not the one of the line; no report.
pub fn rescored(seed: u64, old: &Line, wish: &Wish, vault: &Vault, kept: &Path) -> Result<Line> {
    let set = Set::new(seed, old.set, wish)?;
    let mut line = old.clone();
    if old.error.is_some() {
        return Ok(line);
    }
    let driven = set.driven(0)?;
    let sealed = vault.open(old.set, &old.seal)?;
    ensure!(
        Sealed::new(&set, &driven).text()?.1 == old.seal,
        "set {} is made otherwise by now: its reports are of other runs",
        old.set
    );
    let folder = kept.join(format!("{:06}", old.set));
    let mut reports = Vec::new();
    for (position, wanted) in old.reports.iter().enumerate() {
        let path = report_path(&folder, position);
        let text = fs::read_to_string(&path).with_context(|| {
            format!(
                "cannot read {}: make the set again with --only {} --keep, or name others with --only",
                path.display(),
                old.set
            )
        })?;
        ensure!(hash(&text) == *wanted, "{} is not what was scored", path.display());
        reports.push(serde_json::from_str(&text).with_context(|| format!("{} is no report", path.display()))?);
    }
    line.facts.clear();
    line.judge(&set, &driven, &sealed, &reports);
    // What models were is not kept.
    line.facts.extend(
        old.facts
            .get_key_value(REMOVED)
            .map(|(fact, all)| (fact.clone(), all.clone())),
    );
    Ok(line)
}

fn report_path(folder: &Path, position: usize) -> PathBuf {
    folder.join(format!("report-{position}.json"))
}

fn hash(text: &str) -> String {
    hex(&Sha256::digest(text.as_bytes()))
}

/// CPU seconds of this thread.
pub fn cpu_s() -> f64 {
    let text = fs::read_to_string("/proc/thread-self/schedstat").unwrap_or_default();
    let nanoseconds = text.split_whitespace().next().and_then(|word| word.parse::<f64>().ok());
    nanoseconds.unwrap_or(0.0) * 1e-9
}

/// Drives, seals, names, opens and scores one set.
///
/// - `keep`: a folder for bundles and reports as files.
/// - Errors: the bench itself cannot go on; what a set does wrong stands in its line.
pub fn run_set(seed: u64, number: u64, wish: &Wish, vault: &Vault, keep: Option<&Path>) -> Result<Line> {
    let before = cpu_s();
    let mut set = Set::new(seed, number, wish)?;
    set.keep = keep.map(|folder| folder.join(format!("{number:06}")));
    let mut line = Line::empty(&set);
    let driven = match set.driven(0) {
        Ok(driven) => driven,
        Err(error) => {
            line.error = Some(format!("{error:#}"));
            return Ok(line);
        }
    };
    line.seal = vault.seal(&Sealed::new(&set, &driven))?;
    let made = cpu_s();
    let outcome = diagnoses(&set, &driven);
    (line.make_s, line.name_s) = (made - before, cpu_s() - made);
    let sealed = vault.open(number, &line.seal)?;
    line.known.clone_from(&sealed.known);
    match outcome {
        Ok(all) => {
            let reports: Vec<Report> = all.iter().map(|one| one.report.clone()).collect();
            line.judge(&set, &driven, &sealed, &reports);
            if set.kind == Kind::Rounds {
                let effects = |one: &Diagnosis| one.model.effects.iter().map(|e| (e.name.clone(), e.index)).collect();
                line.facts.extend(removed(&all.iter().map(effects).collect::<Vec<_>>()));
            }
            for (position, report) in reports.iter().enumerate() {
                if let Some(folder) = &set.keep {
                    fs::write(report_path(folder, position), report.text())?;
                }
                line.reports.push(hash(&report.text()));
                line.verdicts.push(verdict_text(report.verdict));
            }
            if let Some(report) = reports.first() {
                line.untestable = report.untestable.iter().map(|other| other.name.clone()).collect();
                line.absorbed = report.absorbed.iter().map(|other| other.name.clone()).collect();
                line.channels.clone_from(&report.place.channels);
                line.explained = report.explained_fraction;
            }
        }
        Err(error) => line.error = Some(format!("{error:#}")),
    }
    Ok(line)
}

fn verdict_text(verdict: Verdict) -> String {
    let text = serde_json::to_value(verdict).ok();
    text.and_then(|text| text.as_str().map(str::to_owned))
        .unwrap_or_default()
}

/// The diagnosis with nothing but bundles, as often as the kind of set asks for.
fn diagnoses(set: &Set, driven: &Driven) -> Result<Vec<Diagnosis>> {
    let (references, runs) = (&driven.references, &driven.runs);
    match set.kind {
        Kind::Halves => {
            let (a, b) = (references.split_at(references.len() / 2), runs.split_at(runs.len() / 2));
            Ok(vec![name(a.0, b.0, None)?, name(a.1, b.1, None)?])
        }
        Kind::Rounds => {
            let mut all = vec![name(references, runs, None)?];
            for day in 1..ROUNDS {
                // What has been accepted describes the runs of the first round: they are the references now.
                let later = set.driven(day)?;
                let count = references.len().min(runs.len());
                let model = all.last().map(|last| last.model.clone());
                all.push(name(&runs[..count], &later.runs, model)?);
            }
            Ok(all)
        }
        _ => Ok(vec![name(references, runs, None)?]),
    }
}

/// Whether what was named changes the first run as the truth does.
fn is_alike(set: &Set, driven: &Driven, effect: &NamedEffect, known: &Known) -> bool {
    let parameters = effect
        .parameters
        .iter()
        .filter_map(|p| Some((p.name.clone(), p.value?)));
    let said = Truth {
        name: effect.name.clone(),
        index: effect.index,
        parameters: parameters.collect(),
    };
    cosine(&set.robot, &said, &known.best, (&driven.trace, set.sensing())).abs() > ONE_CLASS
}

/// File of a shard's results; sets that are made or scored again have one of their own.
///
/// - `shard`: from 0.
pub fn results_path(out: &Path, (shard, shards): (u64, u64), is_again: bool) -> PathBuf {
    let again = if is_again { "remade-" } else { "" };
    out.join(format!("results-{again}{}-of-{shards}.jsonl", shard + 1))
}

/// Results of a folder, of all shards, by set.
pub fn lines(out: &Path) -> Result<Vec<Line>> {
    let mut lines: Vec<Line> = Vec::new();
    let mut paths: Vec<PathBuf> = fs::read_dir(out)?
        .filter_map(|entry| Some(entry.ok()?.path()))
        .collect();
    paths.sort();
    for path in paths
        .iter()
        .filter(|path| path.extension().is_some_and(|end| end == "jsonl"))
    {
        let text = fs::read_to_string(path)?;
        for (number, line) in text.lines().enumerate() {
            // A line that the machine's end cut off is made again.
            match serde_json::from_str(line) {
                Ok(line) => lines.push(line),
                Err(_) if number + 1 == text.lines().count() => {}
                Err(error) => return Err(anyhow!("{} line {}: {error}", path.display(), number + 1)),
            }
        }
    }
    // Of a set that was made again the last line counts: names of their files come last ([`results_path`]).
    lines.reverse();
    lines.sort_by_key(|line: &Line| line.set);
    lines.dedup_by_key(|line| line.set);
    Ok(lines)
}

/// Appends a result, in place of what the machine's end left of a line.
pub fn append(path: &Path, line: &Line) -> Result<()> {
    let mut file = fs::OpenOptions::new().create(true).read(true).append(true).open(path)?;
    let mut before = Vec::new();
    file.read_to_end(&mut before)?;
    let whole = before.iter().rposition(|byte| *byte == b'\n').map_or(0, |end| end + 1);
    if whole < before.len() {
        file.set_len(whole as u64)?;
    }
    let text = serde_json::to_string(line)?;
    writeln!(file, "{text}").with_context(|| format!("cannot write {}", path.display()))
}
