//! Telemetry rows as CSV text.

use std::collections::BTreeMap;

use crate::channel::Channel;

/// Most rows of one telemetry file (24 h at 600 rows per second).
pub const MAX_ROWS: usize = 52_000_000;
/// Most bytes of one telemetry file.
pub const MAX_BYTES: usize = 2 << 30;
/// Rows so far apart stay apart and in order when their time stamps are rounded to microseconds.
const FAR_APART_S: f64 = 5e-6;

/// Why a bundle cannot be used. Lines count from 1, the header included.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum BundleError {
    #[error("run.json line {line}, column {column}: {message}")]
    RunText {
        line: usize,
        column: usize,
        message: String,
    },
    #[error("run.json {field}: {message}")]
    RunField { field: String, message: String },
    #[error("telemetry line {line}: {message}")]
    Row { line: u64, message: String },
    #[error("telemetry line {line}, column {column:?}: {message}")]
    Cell { line: u64, column: String, message: String },
    #[error("telemetry column {column:?}: {message}")]
    Column { column: String, message: String },
    #[error("telemetry: {message}")]
    Whole { message: String },
}

/// Samples of one channel.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Series {
    /// Row numbers, growing.
    pub rows: Vec<u32>,
    pub values: Vec<f64>,
}

impl Series {
    /// Value of the last sample at or before a row.
    pub fn held(&self, row: usize) -> Option<f64> {
        let after = self.rows.partition_point(|sample| *sample as usize <= row);
        after.checked_sub(1).map(|index| self.values[index])
    }

    /// True when there are at least two samples and all are equal.
    pub fn is_constant(&self) -> bool {
        self.values.len() > 1 && self.values.windows(2).all(|pair| pair[0] == pair[1])
    }
}

/// Time stamps and the channels that have samples.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Telemetry {
    /// Strictly growing, s.
    pub time_s: Vec<f64>,
    /// Only channels with at least one sample.
    pub channels: BTreeMap<Channel, Series>,
    /// Columns that are there but empty in every row.
    pub empty: Vec<Channel>,
    /// Columns that the format does not know; their cells are not read.
    pub unknown: Vec<String>,
}

impl Telemetry {
    /// Samples of a channel; `None` when absent.
    pub fn series(&self, channel: Channel) -> Option<&Series> {
        self.channels.get(&channel)
    }

    /// The same with time stamps that count from the first one, rounded to microseconds where all rows stay apart: what is found should not depend on where
    /// a recorder's clock begins, nor on the 0.2 us to which a double holds the seconds since 1970. A stamp within that of half a microsecond may be
    /// rounded either way.
    pub fn from_start(mut self) -> Telemetry {
        let first_s = self.time_s.first().copied().unwrap_or(0.0);
        let is_far_apart = self.time_s.windows(2).all(|pair| pair[1] - pair[0] > FAR_APART_S);
        for time_s in &mut self.time_s {
            *time_s -= first_s;
            if is_far_apart {
                *time_s = libm::round(*time_s * 1e6) / 1e6;
            }
        }
        self
    }

    /// Keeps the first rows, and the channels that have samples in them.
    pub fn truncate(&mut self, rows: usize) {
        self.time_s.truncate(rows);
        for series in self.channels.values_mut() {
            let kept = series.rows.partition_point(|row| (*row as usize) < rows);
            series.rows.truncate(kept);
            series.values.truncate(kept);
        }
        self.channels.retain(|_, series| !series.rows.is_empty());
    }

    /// Reads CSV bytes (UTF-8, comma, header in the first line).
    ///
    /// - Errors name line and column: a cell that is no finite number, a row of another length, time that does not grow,
    ///   columns twice.
    pub fn from_csv(bytes: &[u8]) -> Result<Telemetry, BundleError> {
        if bytes.len() > MAX_BYTES {
            return Err(BundleError::Whole {
                message: format!("{} bytes; at most {MAX_BYTES} are read", bytes.len()),
            });
        }
        let text = core::str::from_utf8(bytes).map_err(|error| BundleError::Row {
            line: 1 + bytes[..error.valid_up_to()]
                .iter()
                .filter(|byte| **byte == b'\n')
                .count() as u64,
            message: "not UTF-8 text".to_owned(),
        })?;
        let text = text.strip_prefix('\u{feff}').unwrap_or(text);
        let mut reader = csv::ReaderBuilder::new()
            .has_headers(true)
            .trim(csv::Trim::All)
            .from_reader(text.as_bytes());
        let header = reader.headers().map_err(|error| row_error(&error))?.clone();
        let (mut telemetry, columns, time_column) = read_header(&header)?;
        let mut series: BTreeMap<Channel, Series> = columns
            .iter()
            .flatten()
            .map(|channel| (*channel, Series::default()))
            .collect();
        let mut record = csv::StringRecord::new();
        while reader.read_record(&mut record).map_err(|error| row_error(&error))? {
            let line = record.position().map_or(0, csv::Position::line);
            telemetry.push_time(&record, time_column, line)?;
            let row = (telemetry.time_s.len() - 1) as u32;
            for (cell, column) in record.iter().zip(&columns) {
                let Some(channel) = column else { continue };
                if cell.is_empty() {
                    continue;
                }
                let value = number(cell).map_err(|message| BundleError::Cell {
                    line,
                    column: channel.name(),
                    message,
                })?;
                if let Some(series) = series.get_mut(channel) {
                    series.rows.push(row);
                    series.values.push(value);
                }
            }
        }
        if telemetry.time_s.is_empty() {
            return Err(BundleError::Whole {
                message: "no rows below the header".to_owned(),
            });
        }
        for (channel, series) in series {
            if series.values.is_empty() {
                telemetry.empty.push(channel);
            } else {
                telemetry.channels.insert(channel, series);
            }
        }
        Ok(telemetry)
    }

    fn push_time(&mut self, record: &csv::StringRecord, column: usize, line: u64) -> Result<(), BundleError> {
        let wrong = |message: String| BundleError::Cell {
            line,
            column: "time_s".to_owned(),
            message,
        };
        let time_s = number(record.get(column).unwrap_or("")).map_err(&wrong)?;
        if let Some(before_s) = self.time_s.last() {
            if time_s == *before_s {
                return Err(wrong(format!("time stamp {time_s} s stands twice; merge the rows")));
            }
            if time_s < *before_s {
                return Err(wrong(format!("time runs backward: {time_s} s after {before_s} s")));
            }
        }
        if self.time_s.len() >= MAX_ROWS {
            return Err(BundleError::Whole {
                message: format!("more than {MAX_ROWS} rows"),
            });
        }
        self.time_s.push(time_s);
        Ok(())
    }
}

fn row_error(error: &csv::Error) -> BundleError {
    let line = error.position().map_or(1, csv::Position::line);
    let message = match error.kind() {
        csv::ErrorKind::UnequalLengths { expected_len, len, .. } => {
            format!("{len} cells where the header has {expected_len}")
        }
        _ => error.to_string(),
    };
    BundleError::Row { line, message }
}

type Columns = Vec<Option<Channel>>;

fn read_header(header: &csv::StringRecord) -> Result<(Telemetry, Columns, usize), BundleError> {
    let mut telemetry = Telemetry::default();
    let mut columns: Columns = Vec::new();
    let mut time_column = None;
    for (index, name) in header.iter().enumerate() {
        let twice = header.iter().take(index).any(|before| before == name);
        if twice {
            return Err(BundleError::Column {
                column: name.to_owned(),
                message: "stands twice in the header".to_owned(),
            });
        }
        let channel = Channel::parse(name);
        if name == "time_s" {
            time_column = Some(index);
        } else if channel.is_none() {
            telemetry.unknown.push(name.to_owned());
        }
        columns.push(channel);
    }
    let Some(time_column) = time_column else {
        return Err(BundleError::Column {
            column: "time_s".to_owned(),
            message: "missing; every row needs its time stamp".to_owned(),
        });
    };
    Ok((telemetry, columns, time_column))
}

fn number(cell: &str) -> Result<f64, String> {
    match cell.parse::<f64>() {
        Ok(value) if value.is_finite() => Ok(value),
        Ok(_) => Err(format!(
            "{cell:?} is not finite; leave the cell empty where there is no sample"
        )),
        Err(_) if cell.is_empty() => Err("empty".to_owned()),
        Err(_) => Err(format!("{cell:?} is not a number")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rows every 1/960 s, as their recorder wrote them.
    fn recorded(origin_s: f64, period_s: f64) -> Telemetry {
        Telemetry {
            time_s: (0..960).map(|k| origin_s + f64::from(k) * period_s).collect(),
            ..Telemetry::default()
        }
    }

    #[test]
    fn where_a_clock_begins_changes_no_time_from_the_start() {
        let of = |origin_s: f64| recorded(origin_s, 1.0 / 960.0).from_start().time_s;
        let from_zero = of(0.0);
        assert_eq!(from_zero[0], 0.0);
        assert_eq!(from_zero[1], 0.001042, "to the microsecond");
        for origin_s in [-3.7, 12.345_678_9, 1.764e9, 1.764e9 + 0.1234567] {
            assert_eq!(of(origin_s), from_zero, "{origin_s}");
        }
    }

    #[test]
    fn rows_that_are_close_are_not_rounded_together() {
        let close = recorded(5.0, 1e-6).from_start().time_s;
        assert!(close.windows(2).all(|pair| pair[1] > pair[0]));
        assert!((close[959] - 959e-6).abs() < 1e-12);
    }
}
