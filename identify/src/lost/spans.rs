//! Spans in which set-points were lost, window by window: the one that explains most of what is left of the wheel speeds, then the next.

use twin::MAX_WHEELS;
use twin::replay::HeldCommand;

use super::StepResponse;
use crate::bundle::Bundle;
use crate::record::{Cell, Chain, Quantity, Record, Window};

/// Energy that a span costs: twice the logarithm of the number of spans that it could be.
pub const COST: f64 = 15.0;
/// Lengths that are tried, s.
const LENGTHS_S: [f64; 10] = [0.025, 0.05, 0.075, 0.1, 0.125, 0.15, 0.2, 0.25, 0.3, 0.4];
/// Time before the set-points that are looked at from which it is worked out what acted, s.
const MEMORY_S: f64 = 1.0;
/// Moves of the ends of the best of them, set-points, and how many are made at most.
const ENDS: [(isize, isize); 6] = [(-1, 0), (1, 0), (0, -1), (0, 1), (-1, -1), (1, 1)];
const MOST_MOVES: usize = 12;
/// Length by which it is told when a loss would be seen, s.
const USUAL_S: f64 = 0.05;
/// Set-points further apart than this say nothing of losses between them, s.
const LONGEST_STEP_S: f64 = 0.2;
/// Losses before a window's comparison that still show in it, s, and time after which one does not any more.
const BEFORE_S: f64 = 0.3;
const AFTER_S: f64 = 0.6;
/// Set-points that change by less from one to the next say nothing new, and those that would be missing by less all the time are not missed,
/// rad/s.
const UNCHANGED_RAD_PER_S: f64 = 1e-3;
const SAME_RAD_PER_S: f64 = 0.05;
/// Losses that would show so many times their cost are found.
const SURELY_SEEN: f64 = 4.0;
const MOST_A_WINDOW: usize = 24;

/// A span, from the first set-point that was lost to the first that arrived, s.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lost {
    pub from_s: f64,
    pub to_s: f64,
}

impl Lost {
    pub fn has(&self, time_s: f64) -> bool {
        time_s >= self.from_s && time_s < self.to_s
    }
}

/// How long losses would have been seen, and how long there were some that were, s.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Seen {
    pub open_s: f64,
    pub lost_s: f64,
}

/// Set-points of the driven wheels as sent.
#[derive(Debug, Clone, Default)]
pub struct Sent {
    time_s: Vec<f64>,
    wheel_rad_per_s: Vec<[f64; MAX_WHEELS]>,
}

impl Sent {
    pub fn of(bundle: &Bundle) -> Sent {
        let mut held = HeldCommand::default();
        let mut sent = Sent::default();
        for row in bundle.command_rows() {
            held.apply(&bundle.robot, &row);
            sent.time_s.push(row.time_s + bundle.run.command_delay_s);
            sent.wheel_rad_per_s.push(held.command().wheel_rad_per_s);
        }
        sent
    }

    /// What acted at some of the set-points when spans were lost.
    fn acted(&self, spans: &[Lost], near: &core::ops::Range<usize>) -> Acted {
        let from_s = self.time_s.get(near.start).copied().unwrap_or(0.0) - MEMORY_S;
        let first = self.time_s.partition_point(|time_s| *time_s < from_s);
        let last = near.end.min(self.time_s.len());
        let mut acted = Acted {
            first,
            wheel_rad_per_s: Vec::with_capacity(last.saturating_sub(first)),
        };
        for k in first..last {
            let is_lost = spans.iter().any(|span| span.has(self.time_s[k]));
            let held = acted.wheel_rad_per_s.last().filter(|_| is_lost).copied();
            acted.wheel_rad_per_s.push(held.unwrap_or(self.wheel_rad_per_s[k]));
        }
        acted
    }
}

/// Set-points that acted, from the one at `first` on.
struct Acted {
    first: usize,
    wheel_rad_per_s: Vec<[f64; MAX_WHEELS]>,
}

impl Acted {
    /// In force before a set-point.
    fn before(&self, position: usize) -> Option<[f64; MAX_WHEELS]> {
        let before = position.checked_sub(self.first + 1)?;
        self.wheel_rad_per_s.get(before).copied()
    }
}

/// A cell of a wheel with what is left of it.
struct Left {
    time_s: f64,
    wheel: usize,
    residual: f64,
    weight: f64,
}

/// Everything that a search in a window needs.
struct Search<'a> {
    sent: &'a Sent,
    response: &'a StepResponse,
    cells: Vec<Left>,
}

/// Spans known before and new ones, in the order of time.
///
/// - `residual`, `weights`: of the record, under the spans known before.
pub fn lost(
    record: &Record,
    residual: &[f64],
    weights: &[f64],
    sent: &Sent,
    known: &[Lost],
    response: &StepResponse,
) -> Vec<Lost> {
    let mut spans = known.to_vec();
    let mut from = 0;
    for window in &record.windows {
        let mut search = Search::of(window, &residual[from..], &weights[from..], sent, response);
        let range = near(&spans, window);
        let mut own = spans[range.clone()].to_vec();
        // What the window before has just found is not in the residual yet.
        for span in own.iter().filter(|span| !is_among(known, span)) {
            let others: Vec<Lost> = own.iter().copied().filter(|other| other != span).collect();
            search.take(*span, &others, 1.0);
        }
        search.withdraw(&mut own, window.from_s, window.to_s);
        let starts = search.starts(window);
        for _ in 0..MOST_A_WINDOW {
            let Some(span) = search.best(starts.clone(), &own) else {
                break;
            };
            search.take(span, &own, 1.0);
            own.push(span);
        }
        own.sort_by(|a, b| a.from_s.total_cmp(&b.from_s));
        spans.splice(range, own);
        from += window.drive.len() + window.rolling.as_ref().map_or(0, Chain::len);
    }
    spans
}

/// How long losses would be seen in a record, and how long there were some.
///
/// - `spans`: in the order of time.
pub fn seen(record: &Record, weights: &[f64], sent: &Sent, spans: &[Lost], response: &StepResponse) -> Seen {
    let mut seen = Seen::default();
    let mut from = 0;
    let nothing = vec![0.0; weights.len()];
    for window in &record.windows {
        let search = Search::of(window, &nothing[from..], &weights[from..], sent, response);
        let own = &spans[near(spans, window)];
        let starts = search.starts(window);
        let as_sent = sent.acted(&[], &starts);
        for start in starts {
            let time_s = sent.time_s[start];
            let step_s = time_s - sent.time_s[start - 1];
            let is_told = !is_unchanged(&sent.wheel_rad_per_s[start - 1], &sent.wheel_rad_per_s[start]);
            if time_s < window.from_s || step_s > LONGEST_STEP_S || !is_told {
                continue;
            }
            let change = search.change(start, search.end(start, USUAL_S), &as_sent);
            let shown: f64 = change
                .iter()
                .map(|(cell, value)| search.cells[*cell].weight * value * value)
                .sum();
            if shown > SURELY_SEEN * COST {
                seen.open_s += step_s;
                if own.iter().any(|span| span.has(time_s)) {
                    seen.lost_s += step_s;
                }
            }
        }
        from += window.drive.len() + window.rolling.as_ref().map_or(0, Chain::len);
    }
    seen
}

/// - `spans`: in the order of time.
pub(super) fn is_among(spans: &[Lost], span: &Lost) -> bool {
    let found = spans.binary_search_by(|other| other.from_s.total_cmp(&span.from_s));
    found.is_ok_and(|found| spans[found] == *span)
}

/// Which spans can matter to a window.
fn near(spans: &[Lost], window: &Window) -> core::ops::Range<usize> {
    let position = |time_s: f64| spans.partition_point(|span| span.from_s < time_s);
    position(window.from_s - BEFORE_S - MEMORY_S)..position(window.to_s)
}

fn is_unchanged(one: &[f64; MAX_WHEELS], other: &[f64; MAX_WHEELS]) -> bool {
    one.iter().zip(other).all(|(a, b)| (a - b).abs() < UNCHANGED_RAD_PER_S)
}

impl<'a> Search<'a> {
    /// - `residual`, `weights`: from the window's first on.
    fn of(
        window: &Window,
        residual: &[f64],
        weights: &[f64],
        sent: &'a Sent,
        response: &'a StepResponse,
    ) -> Search<'a> {
        let cells = window.drive.cells.iter().zip(residual).zip(weights);
        let left = |((cell, residual), weight): ((&Cell, &f64), &f64)| match cell.quantity {
            Quantity::Wheel(wheel) => Some(Left {
                time_s: cell.time_s,
                wheel,
                residual: *residual,
                weight: *weight,
            }),
            _ => None,
        };
        Search {
            sent,
            response,
            cells: cells.filter_map(left).collect(),
        }
    }

    /// Set-points whose loss could show in a window.
    fn starts(&self, window: &Window) -> core::ops::Range<usize> {
        let position = |from_s: f64| self.sent.time_s.partition_point(|time_s| *time_s < from_s);
        position(window.from_s - BEFORE_S).max(1)..position(window.to_s)
    }

    /// First set-point after so much time.
    fn end(&self, start: usize, length_s: f64) -> usize {
        let to_s = self.sent.time_s[start] + length_s - 1e-6;
        self.sent.time_s.partition_point(|time_s| *time_s < to_s)
    }

    /// Change of the wheel speeds, cell by cell, when set-points `start..end` do not arrive.
    ///
    /// - `acted`: what acted before and until then.
    fn change(&self, start: usize, end: usize, acted: &Acted) -> Vec<(usize, f64)> {
        let sent = &self.sent.wheel_rad_per_s;
        let Some(last) = end.checked_sub(1).filter(|last| *last < sent.len()) else {
            return Vec::new();
        };
        let Some(held) = acted.before(start) else {
            return Vec::new();
        };
        // Steps of what is missing: at every set-point that differs from the one before, and back at the end.
        let mut steps: Vec<(f64, [f64; MAX_WHEELS])> = Vec::new();
        let mut missing = [0.0; MAX_WHEELS];
        let mut most = 0.0_f64;
        for (time_s, sent) in self.sent.time_s[start..end].iter().zip(&sent[start..end]) {
            let now: [f64; MAX_WHEELS] = core::array::from_fn(|wheel| held[wheel] - sent[wheel]);
            let step = core::array::from_fn(|wheel| now[wheel] - missing[wheel]);
            if step.iter().any(|value| *value != 0.0) {
                steps.push((*time_s, step));
            }
            missing = now;
            most = missing.iter().fold(most, |most, value| most.max(value.abs()));
        }
        if most < SAME_RAD_PER_S {
            return Vec::new();
        }
        let to_s = self.sent.time_s.get(end).copied().unwrap_or(self.sent.time_s[last]);
        steps.push((to_s, missing.map(|value| -value)));
        let from_s = self.sent.time_s[start];
        let near = self.cells.iter().enumerate();
        near.filter(|(_, cell)| cell.time_s > from_s - 0.05 && cell.time_s < to_s + AFTER_S)
            .map(|(position, cell)| {
                let parts = steps
                    .iter()
                    .map(|(at_s, step)| step[cell.wheel] * self.response.at(cell.time_s - at_s));
                (position, parts.sum())
            })
            .collect()
    }

    /// Decrease of the energy by a change.
    fn gain(&self, change: &[(usize, f64)]) -> f64 {
        let of = |(cell, value): &(usize, f64)| {
            let cell = &self.cells[*cell];
            cell.weight * value * (2.0 * cell.residual - value)
        };
        change.iter().map(of).sum()
    }

    /// The span that explains most of what is left, if it is worth its cost.
    fn best(&self, starts: core::ops::Range<usize>, spans: &[Lost]) -> Option<Lost> {
        let acted = self.sent.acted(spans, &starts);
        let mut best: Option<(f64, usize, usize)> = None;
        for start in starts.clone() {
            let from_s = self.sent.time_s[start];
            if spans.iter().any(|span| span.has(from_s)) {
                continue;
            }
            for length_s in LENGTHS_S {
                let end = self.end(start, length_s);
                let to_s = self.sent.time_s.get(end).copied();
                let Some(to_s) = to_s else { continue };
                if spans.iter().any(|span| span.from_s < to_s && span.to_s > from_s) {
                    break;
                }
                let gain = self.gain(&self.change(start, end, &acted));
                if gain > best.map_or(COST, |best| best.0) {
                    best = Some((gain, start, end));
                }
            }
        }
        let (mut gain, mut start, mut end) = best?;
        // Ends by single set-points, until none is better.
        for _ in 0..MOST_MOVES {
            let moves = ENDS.iter().filter_map(|(from, to)| {
                let (start, end) = (start.checked_add_signed(*from)?, end.checked_add_signed(*to)?);
                let (from_s, to_s) = (*self.sent.time_s.get(start)?, *self.sent.time_s.get(end)?);
                let is_free = !spans.iter().any(|span| span.from_s < to_s && span.to_s > from_s);
                let is_open = starts.contains(&start) && start < end && is_free;
                is_open.then(|| (self.gain(&self.change(start, end, &acted)), start, end))
            });
            let Some(moved) = moves.max_by(|a, b| a.0.total_cmp(&b.0)).filter(|moved| moved.0 > gain) else {
                break;
            };
            (gain, start, end) = moved;
        }
        // Of set-points that stay as they are nobody knows whether they arrived.
        let held = acted.before(start)?;
        while start + 1 < end && is_unchanged(&held, &self.sent.wheel_rad_per_s[start]) {
            start += 1;
        }
        Some(Lost {
            from_s: self.sent.time_s[start],
            to_s: self.sent.time_s[end],
        })
    }

    /// Takes what a span explains off what is left, or gives it back.
    fn take(&mut self, span: Lost, others: &[Lost], sign: f64) {
        let start = self.sent.time_s.partition_point(|time_s| *time_s < span.from_s);
        let end = self.sent.time_s.partition_point(|time_s| *time_s < span.to_s);
        let acted = self.sent.acted(others, &(start..end));
        for (cell, value) in self.change(start, end, &acted) {
            self.cells[cell].residual -= sign * value;
        }
    }

    /// Spans in the window that explain less than they cost are none.
    fn withdraw(&mut self, spans: &mut Vec<Lost>, from_s: f64, to_s: f64) {
        let own: Vec<Lost> = spans
            .iter()
            .copied()
            .filter(|span| span.from_s >= from_s && span.from_s < to_s - 0.1)
            .collect();
        for span in own {
            let others: Vec<Lost> = spans.iter().copied().filter(|other| *other != span).collect();
            self.take(span, &others, -1.0);
            let start = self.sent.time_s.partition_point(|time_s| *time_s < span.from_s);
            let end = self.sent.time_s.partition_point(|time_s| *time_s < span.to_s);
            let acted = self.sent.acted(&others, &(start..end));
            let gain = self.gain(&self.change(start, end, &acted));
            if gain > COST {
                self.take(span, &others, 1.0);
            } else {
                *spans = others;
            }
        }
    }
}
