//! A run without the set-points that were lost.

use super::Lost;
use crate::bundle::Bundle;

/// The same run with the set-points of some spans left out: the one before holds until the end of a span, then the last one sent is in force.
///
/// - `spans`: in the order of time, none over another.
pub fn without(bundle: &Bundle, spans: &[Lost]) -> Bundle {
    let mut rest = bundle.clone();
    let times = &bundle.telemetry.time_s;
    let delay_s = bundle.run.command_delay_s;
    let of = |row: u32| {
        let time_s = times[row as usize] + delay_s;
        let after = spans.partition_point(|span| span.from_s <= time_s);
        spans[..after].last().filter(|span| span.has(time_s))
    };
    // The first row after a span and those that follow it at once.
    let end = |span: &Lost| {
        let mut at = times.partition_point(|time_s| time_s + delay_s < span.to_s);
        while let Some(next) = (at < times.len()).then(|| of(at as u32)).flatten() {
            at = times.partition_point(|time_s| time_s + delay_s < next.to_s).max(at + 1);
        }
        at
    };
    let commands = rest
        .telemetry
        .channels
        .iter_mut()
        .filter(|(channel, _)| channel.is_command());
    for (_, series) in commands {
        let (mut rows, mut values) = (
            Vec::with_capacity(series.rows.len()),
            Vec::with_capacity(series.rows.len()),
        );
        let mut due: Option<(u32, f64)> = None;
        for (row, value) in series.rows.iter().zip(&series.values) {
            if let Some((at, held)) = due.filter(|(at, _)| at <= row) {
                if at < *row {
                    rows.push(at);
                    values.push(held);
                }
                due = None;
            }
            match of(*row) {
                Some(span) => {
                    let at = end(span);
                    due = (at < times.len()).then_some((at as u32, *value));
                }
                None => {
                    rows.push(*row);
                    values.push(*value);
                }
            }
        }
        if let Some((at, held)) = due {
            rows.push(at);
            values.push(held);
        }
        // Something is told first, whatever was lost.
        if rows.is_empty() {
            continue;
        }
        (series.rows, series.values) = (rows, values);
    }
    rest
}
