//! A run without the set-points that were lost.

use super::Lost;
use crate::bundle::Bundle;

/// The same run with the set-points of some spans left out: the one before holds until the end of a span, then the last one sent is in force.
pub fn without(bundle: &Bundle, spans: &[Lost]) -> Bundle {
    let mut rest = bundle.clone();
    let times = &bundle.telemetry.time_s;
    let delay_s = bundle.run.command_delay_s;
    let of = |row: u32| spans.iter().find(|span| span.has(times[row as usize] + delay_s));
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
                if at < *row && of(at).is_none() {
                    rows.push(at);
                    values.push(held);
                }
                due = None;
            }
            match of(*row) {
                Some(span) => {
                    let end = times.partition_point(|time_s| time_s + delay_s < span.to_s);
                    due = (end < times.len()).then_some((end as u32, *value));
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
