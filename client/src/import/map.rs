//! Which of their columns is which of ours: a small JSON document, or one flag a column.

use super::unit::{Dimension, dimension, factor, names};
use anyhow::{Context, bail, ensure};
use identify::channel::Channel;
use serde::Deserialize;
use twin::robot::RobotDescription;

/// `format` of a column map.
pub const FORMAT: &str = "robopheus.columns/1";
/// Most columns of a bundle.
const MOST_COLUMNS: usize = 256;

/// A column map as it is written.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct Document {
    format: String,
    columns: Vec<Entry>,
}

/// One column. The value is `from` in `unit`, times `gain`, plus `offset` in the bundle's unit.
#[derive(Debug, Clone, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Entry {
    pub from: String,
    pub to: String,
    #[serde(default)]
    pub unit: Option<String>,
    #[serde(default)]
    pub gain: Option<f64>,
    #[serde(default)]
    pub offset: Option<f64>,
    /// The value counts only in rows where this column has changed: for channels that are sampled and held.
    #[serde(default)]
    pub fresh_with: Option<String>,
}

impl Entry {
    /// Reads `theirs=ours[:unit][*gain]`.
    pub fn parse(text: &str) -> anyhow::Result<Entry> {
        let form = "a column is written theirs=ours, theirs=ours:unit or theirs=ours:unit*gain";
        let (from, right) = text.rsplit_once('=').with_context(|| format!("{text:?}: {form}"))?;
        let (right, gain) = match right.split_once('*') {
            Some((right, gain)) => {
                let gain: f64 = gain
                    .parse()
                    .with_context(|| format!("{text:?}: the gain {gain:?} is no number"))?;
                (right, Some(gain))
            }
            None => (right, None),
        };
        let (to, unit) = match right.split_once(':') {
            Some((to, unit)) => (to, Some(unit.to_owned())),
            None => (right, None),
        };
        ensure!(!from.is_empty() && !to.is_empty(), "{text:?}: {form}");
        Ok(Entry {
            from: from.to_owned(),
            to: to.to_owned(),
            unit,
            gain,
            ..Entry::default()
        })
    }
}

/// Entries of a column map's text.
pub fn parse(text: &str) -> anyhow::Result<Vec<Entry>> {
    let document: Document = serde_json::from_str(text).context("is no column map")?;
    ensure!(
        document.format == FORMAT,
        "format {:?}; this reads {FORMAT:?}",
        document.format
    );
    Ok(document.columns)
}

/// A column that is written.
#[derive(Debug, Clone)]
pub struct Column {
    pub channel: Channel,
    /// Position among their columns, and of the column that it is fresh with.
    pub source: usize,
    pub fresh_with: Option<usize>,
    pub gain: f64,
    pub offset: f64,
    /// Their name.
    pub from: String,
}

/// What is read from their table.
#[derive(Debug, Clone)]
pub struct Plan {
    /// Position of the time stamp, its factor to seconds.
    pub time: usize,
    pub time_factor: f64,
    pub time_name: String,
    pub columns: Vec<Column>,
    /// Their columns that nothing asks for.
    pub ignored: Vec<String>,
}

/// Brings entries and header together. Their columns that have a name of the format and no entry are taken as they are.
pub fn plan(entries: &[Entry], header: &[String], robot: &RobotDescription) -> anyhow::Result<Plan> {
    let position = |name: &str| {
        header.iter().position(|other| other == name).with_context(|| {
            format!(
                "the table has no column {name:?}; it has {}. Mend the column map",
                header.join(", ")
            )
        })
    };
    let mut all = entries.to_vec();
    for name in header {
        let ours = name == "time_s" || Channel::parse(name).is_some();
        let used = |entry: &Entry| entry.from == *name || entry.to == *name;
        if ours && !entries.iter().any(used) {
            all.push(Entry {
                from: name.clone(),
                to: name.clone(),
                ..Entry::default()
            });
        }
    }
    ensure!(
        all.len() <= MOST_COLUMNS,
        "{} columns; at most {MOST_COLUMNS}",
        all.len()
    );
    let mut time = None;
    let mut columns: Vec<Column> = Vec::new();
    for entry in &all {
        let source = position(&entry.from)?;
        if entry.to == "time_s" {
            ensure!(time.is_none(), "two columns become time_s; a bundle has one");
            ensure!(
                entry.gain.is_none() && entry.offset.is_none(),
                "column {:?}: time has a unit, no gain and no offset",
                entry.from
            );
            let unit = entry.unit.as_deref().unwrap_or("s");
            let factor = known(entry, Dimension::Time, unit)?;
            time = Some((source, factor, entry.from.clone()));
            continue;
        }
        let column = column(entry, source, robot)?;
        if let Some(other) = columns.iter().find(|other| other.channel == column.channel) {
            bail!(
                "columns {:?} and {:?} both become {}; leave one out",
                other.from,
                entry.from,
                entry.to
            );
        }
        let fresh_with = entry.fresh_with.as_deref().map(position).transpose()?;
        columns.push(Column { fresh_with, ..column });
    }
    let (time, time_factor, time_name) =
        time.context("no column becomes time_s; every row needs its time stamp, for example --column stamp=time_s:ms")?;
    ensure!(!columns.is_empty(), "no column besides the time stamp is mapped");
    columns.sort_by_key(|column| column.channel);
    let ignored = (0..header.len())
        .filter(|k| *k != time && columns.iter().all(|c| c.source != *k && c.fresh_with != Some(*k)))
        .map(|k| header[k].clone())
        .collect();
    Ok(Plan {
        time,
        time_factor,
        time_name,
        columns,
        ignored,
    })
}

fn known(entry: &Entry, dimension: Dimension, unit: &str) -> anyhow::Result<f64> {
    factor(dimension, unit).with_context(|| {
        format!(
            "column {:?}: {} has no unit {unit:?}; possible are {} and 1 with a gain",
            entry.from,
            entry.to,
            names(dimension)
        )
    })
}

fn column(entry: &Entry, source: usize, robot: &RobotDescription) -> anyhow::Result<Column> {
    let channel = Channel::parse(&entry.to).with_context(|| {
        format!(
            "column {:?}: {:?} is no column of a run bundle (names in docs/how-to/import-your-logs.md)",
            entry.from, entry.to
        )
    })?;
    let dimension = dimension(channel);
    let factor = match (entry.unit.as_deref(), channel) {
        (None, _) => 1.0,
        (Some("1"), _) if dimension != Dimension::Count => {
            ensure!(
                entry.gain.is_some(),
                "column {:?}: a normalised value needs the gain to {}, as {}={}:1*GAIN",
                entry.from,
                entry.to,
                entry.from,
                entry.to
            );
            1.0
        }
        // Rim speeds: by the wheel's radius.
        (Some(unit), Channel::WheelSpeed(k) | Channel::CommandWheel(k))
            if super::unit::factor(Dimension::Speed, unit).is_some() =>
        {
            let radius_m = robot.wheels.get(k).and_then(|wheel| wheel.radius_m);
            let radius_m = radius_m.with_context(|| {
                format!(
                    "column {:?}: {} in {unit} needs the radius of wheel {k}; the robot has {} wheels",
                    entry.from,
                    entry.to,
                    robot.wheels.len()
                )
            })?;
            known(entry, Dimension::Speed, unit)? / radius_m
        }
        (Some(unit), _) => known(entry, dimension, unit)?,
    };
    let (gain, offset) = (factor * entry.gain.unwrap_or(1.0), entry.offset.unwrap_or(0.0));
    ensure!(
        gain.is_finite() && gain != 0.0 && offset.is_finite(),
        "column {:?}: gain {gain} and offset {offset} must be finite, the gain not 0",
        entry.from
    );
    Ok(Column {
        channel,
        source,
        fresh_with: None,
        gain,
        offset,
        from: entry.from.clone(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn flags_are_read() -> anyhow::Result<()> {
        let entry = Entry::parse("steer=command_steering_rad:1*-0.35")?;
        assert_eq!(
            (entry.from.as_str(), entry.to.as_str()),
            ("steer", "command_steering_rad")
        );
        assert_eq!((entry.unit.as_deref(), entry.gain), (Some("1"), Some(-0.35)));
        assert_eq!(Entry::parse("a=b=pose_x_m:mm")?.from, "a=b");
        for bad in ["", "x", "=pose_x_m", "x=", "x=pose_x_m:m*two"] {
            assert!(Entry::parse(bad).is_err(), "{bad}");
        }
        Ok(())
    }
}
