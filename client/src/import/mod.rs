//! Another laboratory's table becomes run bundles: one pass, a row at a time, in constant memory.

pub mod map;
mod plausible;
mod table;
mod unit;
mod writer;

use anyhow::{Context, bail, ensure};
use identify::bundle::{Bundle, Run};
use identify::telemetry::{MAX_BYTES, MAX_ROWS};
use map::Plan;
use plausible::Plausibility;
use std::path::{Path, PathBuf};
use table::Table;
use writer::{Draft, Rows};

/// Lines of every kind of remark that are told.
const MOST_REMARKS: usize = 20;
/// Most runs of one table.
const MOST_RUNS: usize = 10_000;

/// Where runs end.
#[derive(Debug, Clone, Default)]
pub struct Cuts {
    /// A pause of the time stamps longer than this ends a run, s.
    pub gap_s: Option<f64>,
    /// Name of their column: a run ends where it changes.
    pub by: Option<String>,
    /// Shorter runs are left out, s.
    pub shortest_s: f64,
    /// Rows whose time does not grow are left out instead of refused.
    pub drop_bad_time: bool,
}

impl Cuts {
    fn any(&self) -> bool {
        self.gap_s.is_some() || self.by.is_some()
    }
}

/// A bundle that was written.
#[derive(Debug, Clone, serde::Serialize)]
pub struct Written {
    pub folder: PathBuf,
    pub rows: u64,
    pub duration_s: f64,
}

/// What was done.
#[derive(Debug, Clone, Default, serde::Serialize)]
pub struct Imported {
    pub bundles: Vec<Written>,
    pub columns: Vec<String>,
    /// Their columns that nothing was made of.
    pub ignored: Vec<String>,
    pub remarks: Vec<String>,
}

/// Reads `from`, writes one bundle to `out`, or one a run into it where the table is cut.
///
/// - Errors: what cannot be meant, with line, column, limit and remedy. Nothing is left behind then.
pub fn import(from: &Path, entries: &[map::Entry], run: &Run, cuts: &Cuts, out: &Path) -> anyhow::Result<Imported> {
    let table = Table::open(from).with_context(|| from.display().to_string())?;
    let plan = map::plan(entries, &table.header, &run.robot).with_context(|| from.display().to_string())?;
    let by = match &cuts.by {
        None => None,
        Some(name) => Some(
            table
                .header
                .iter()
                .position(|other| other == name)
                .with_context(|| format!("the table has no column {name:?} to cut the runs by"))?,
        ),
    };
    let names: Vec<String> = plan.columns.iter().map(|column| column.channel.name()).collect();
    check_run(run, &names)?;
    let mut pass = Pass {
        plausibility: Plausibility::new(plan.columns.iter().map(|c| (c.channel, c.from.clone())).collect()),
        plan,
        cuts,
        by,
        run,
        names,
        out,
        draft: Draft::new(out)?,
        rows: None,
        base: Stamp::default(),
        before_s: None,
        group: String::new(),
        seen: Vec::new(),
        done: Imported::default(),
        dropped: 0,
        first_dropped: 0,
        short: 0,
    };
    pass.read(table).with_context(|| from.display().to_string())?;
    pass.finish().with_context(|| from.display().to_string())
}

/// Robot description and columns as `diagnose` will see them.
fn check_run(run: &Run, names: &[String]) -> anyhow::Result<()> {
    let mut table = "time_s".to_owned();
    let mut row = "\n0".to_owned();
    for name in names {
        table.push(',');
        table.push_str(name);
        row.push(',');
    }
    table.push_str(&row);
    Bundle::parse(&serde_json::to_string(run)?, table.as_bytes())?;
    Ok(())
}

/// A time stamp without the loss of digits that nanoseconds since 1970 would have.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
struct Stamp {
    whole: i64,
    part: f64,
}

impl Stamp {
    fn parse(text: &str) -> Option<Stamp> {
        if let Ok(whole) = text.parse::<i64>() {
            return Some(Stamp { whole, part: 0.0 });
        }
        let split = text.split_once('.').filter(|(whole, part)| {
            !whole.starts_with('-') && part.len() < 16 && part.bytes().all(|byte| byte.is_ascii_digit())
        });
        if let Some((whole, part)) = split
            && let (Ok(whole), Ok(part)) = (whole.parse::<i64>(), format!("0.{part}").parse::<f64>())
        {
            return Some(Stamp { whole, part });
        }
        let value: f64 = text.parse().ok()?;
        (value.abs() < 9e15).then(|| Stamp {
            whole: value.floor() as i64,
            part: value - value.floor(),
        })
    }

    fn since(self, base: Stamp) -> f64 {
        self.whole.wrapping_sub(base.whole) as f64 + (self.part - base.part)
    }
}

struct Pass<'a> {
    plan: Plan,
    plausibility: Plausibility,
    cuts: &'a Cuts,
    by: Option<usize>,
    run: &'a Run,
    names: Vec<String>,
    out: &'a Path,
    draft: Draft,
    /// The run that is being written.
    rows: Option<Rows>,
    base: Stamp,
    before_s: Option<f64>,
    /// Value of the column that runs are cut by.
    group: String,
    /// Last text of the column that a column is fresh with.
    seen: Vec<Option<String>>,
    done: Imported,
    dropped: u64,
    first_dropped: u64,
    short: u64,
}

impl Pass<'_> {
    fn read(&mut self, mut table: Table) -> anyhow::Result<()> {
        let columns = self.plan.columns.len();
        self.seen = vec![None; columns];
        let mut cells = csv::StringRecord::new();
        let mut values: Vec<Option<f64>> = vec![None; columns];
        while let Some(line) = table.next_row(&mut cells)? {
            let Some(time_s) = self.time(&cells, line)? else {
                continue;
            };
            let mut any = false;
            for (k, slot) in values.iter_mut().enumerate() {
                *slot = self.value(k, &cells, line, time_s)?;
                any |= slot.is_some();
            }
            if any {
                self.write(time_s, &values)?;
            }
        }
        Ok(())
    }

    /// Seconds since the start of the run; a new run begins where the table is cut. `None` for a row that is left out.
    fn time(&mut self, cells: &csv::StringRecord, line: u64) -> anyhow::Result<Option<f64>> {
        let text = cells.get(self.plan.time).unwrap_or("");
        let name = &self.plan.time_name;
        let stamp = Stamp::parse(text).with_context(|| {
            format!("line {line}, column {name:?}: the time stamp {text:?} is no finite number; delete the row")
        })?;
        let group = self.by.map_or("", |by| cells.get(by).unwrap_or(""));
        if self.rows.is_none() || group != self.group {
            self.end_run()?;
            group.clone_into(&mut self.group);
            self.begin(stamp)?;
            return Ok(Some(0.0));
        }
        let time_s = stamp.since(self.base) * self.plan.time_factor;
        let before_s = self.before_s.unwrap_or(time_s);
        if self.before_s.is_some() && time_s <= before_s {
            if self.cuts.drop_bad_time {
                self.dropped += 1;
                if self.first_dropped == 0 {
                    self.first_dropped = line;
                }
                return Ok(None);
            }
            let what = if time_s == before_s {
                "stands twice"
            } else {
                "runs backward"
            };
            bail!(
                "line {line}, column {name:?}: the time stamp {text} {what} ({time_s} s after {before_s} s since the start); stamps must grow; sort the table, cut the runs there (--cut-by), or leave such rows out (--drop-bad-time)"
            );
        }
        if self.cuts.gap_s.is_some_and(|gap_s| time_s - before_s > gap_s) {
            self.begin(stamp)?;
            return Ok(Some(0.0));
        }
        self.before_s = Some(time_s);
        Ok(Some(time_s))
    }

    fn begin(&mut self, stamp: Stamp) -> anyhow::Result<()> {
        self.end_run()?;
        self.base = stamp;
        self.before_s = Some(0.0);
        self.seen.iter_mut().for_each(|seen| *seen = None);
        self.plausibility.cut();
        ensure!(
            self.done.bundles.len() < MOST_RUNS,
            "more than {MOST_RUNS} runs; cut at longer gaps (--cut-gap)"
        );
        let folder = self.folder();
        self.rows = Some(Rows::create(&folder, &self.names)?);
        Ok(())
    }

    /// Where the present run is drafted.
    fn folder(&self) -> PathBuf {
        if self.cuts.any() {
            self.draft.folder().join(self.run_name())
        } else {
            self.draft.folder().to_owned()
        }
    }

    fn run_name(&self) -> String {
        format!("run-{:03}", self.done.bundles.len() + 1)
    }

    fn value(&mut self, k: usize, cells: &csv::StringRecord, line: u64, time_s: f64) -> anyhow::Result<Option<f64>> {
        let column = &self.plan.columns[k];
        if let Some(with) = column.fresh_with {
            let text = cells.get(with).unwrap_or("");
            if self.seen[k].as_deref() == Some(text) {
                return Ok(None);
            }
            self.seen[k] = Some(text.to_owned());
        }
        let text = cells.get(column.source).unwrap_or("");
        if text.is_empty()
            || ["nan", "null", "none", "na"]
                .iter()
                .any(|empty| text.eq_ignore_ascii_case(empty))
        {
            return Ok(None);
        }
        let number: f64 = text
            .parse()
            .ok()
            .filter(|number: &f64| number.is_finite())
            .with_context(|| {
                format!(
                    "line {line}, column {:?}: {text:?} is no finite number; leave the cell empty where there is no sample",
                    column.from
                )
            })?;
        let value = number * column.gain + column.offset;
        self.plausibility.see(k, line, time_s, value)?;
        Ok(Some(if column.channel == identify::channel::Channel::PoseYaw {
            twin::pose::wrapped_rad(value)
        } else {
            value
        }))
    }

    fn write(&mut self, time_s: f64, values: &[Option<f64>]) -> anyhow::Result<()> {
        let Some(rows) = &mut self.rows else { return Ok(()) };
        rows.push(time_s, values)?;
        ensure!(
            rows.rows <= MAX_ROWS as u64 && rows.bytes <= MAX_BYTES as u64,
            "a run of more than {MAX_ROWS} rows or {MAX_BYTES} bytes cannot be diagnosed; cut the table into runs (--cut-gap, --cut-by) or map fewer columns"
        );
        Ok(())
    }

    fn end_run(&mut self) -> anyhow::Result<()> {
        let Some(rows) = self.rows.take() else { return Ok(()) };
        let folder = self.folder();
        let (count, duration_s) = (rows.rows, rows.last_s);
        rows.close()?;
        if self.cuts.any() && (duration_s < self.cuts.shortest_s || count < 2) {
            self.short += 1;
            std::fs::remove_dir_all(folder)?;
            return Ok(());
        }
        ensure!(count > 0, "no row has a sample in a mapped column");
        let mut run = self.run.clone();
        if !self.group.is_empty() {
            run.label = format!("{} {}", run.label, self.group).trim().to_owned();
        }
        std::fs::write(folder.join("run.json"), serde_json::to_string_pretty(&run)? + "\n")?;
        let place = if self.cuts.any() {
            self.out.join(self.run_name())
        } else {
            self.out.to_owned()
        };
        self.done.bundles.push(Written {
            folder: place,
            rows: count,
            duration_s,
        });
        Ok(())
    }

    fn finish(mut self) -> anyhow::Result<Imported> {
        self.end_run()?;
        ensure!(
            !self.done.bundles.is_empty(),
            "no run is left: {} shorter than {} s were left out; lower --shortest",
            self.short,
            self.cuts.shortest_s
        );
        let mut remarks = self.plausibility.judge(&self.run.robot)?;
        if self.dropped > 0 {
            remarks.push(format!(
                "{} rows whose time does not grow were left out, the first in line {}",
                self.dropped, self.first_dropped
            ));
        }
        if self.short > 0 {
            remarks.push(format!(
                "{} runs shorter than {} s were left out",
                self.short, self.cuts.shortest_s
            ));
        }
        let more = remarks.len().saturating_sub(MOST_REMARKS);
        remarks.truncate(MOST_REMARKS);
        if more > 0 {
            remarks.push(format!("and {more} more remarks"));
        }
        self.done.remarks = remarks;
        self.done.columns = self.names;
        self.done.ignored = self.plan.ignored;
        self.draft.keep()?;
        Ok(self.done)
    }
}
