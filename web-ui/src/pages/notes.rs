//! What a user's own controller said and drew: the lines at a moment, and how they look.

use crate::command::Command;
use crate::output::Output;
use crate::theme::{self, Palette};
use api::CONTROL_HZ;
use api::note::{Note, TickNotes};
use egui::{Button, Label, RichText, ScrollArea, Ui, vec2};

/// A drawing is seen for so long after the tick that made it: two frames of a recording.
pub const DRAWN_S: f64 = 0.07;
const LINE_HEIGHT: f32 = 19.0;

/// Time of a tick since the run began.
pub fn time_s(tick: i64) -> f64 {
    tick as f64 / f64::from(CONTROL_HZ)
}

/// Drawings of the last tick at or before a moment that drew.
pub fn drawings_at(ticks: &[TickNotes], now_s: f64) -> Vec<Note> {
    let is_drawing = |note: &&Note| !matches!(note, Note::Log { .. });
    let seen = ticks.partition_point(|tick| time_s(tick.tick) <= now_s + 1e-9);
    let recent = ticks[..seen]
        .iter()
        .rev()
        .take_while(|tick| now_s - time_s(tick.tick) <= DRAWN_S);
    recent
        .map(|tick| tick.notes.iter().filter(is_drawing).cloned().collect::<Vec<_>>())
        .find(|drawings| !drawings.is_empty())
        .unwrap_or_default()
}

/// Log lines with their times, s.
pub fn lines(ticks: &[TickNotes]) -> Vec<(f64, &str)> {
    let of_tick = |tick: &'_ TickNotes| time_s(tick.tick);
    ticks
        .iter()
        .flat_map(|tick| tick.notes.iter().map(move |note| (of_tick(tick), note)))
        .filter_map(|(time_s, note)| match note {
            Note::Log { text } => Some((time_s, text.as_str())),
            _ => None,
        })
        .collect()
}

/// A list of log lines that follows its end, or the moment of a playback.
///
/// - `now_s`: lines after it are pale, and a press on a line leads to its moment; none while a run goes on.
pub fn log(
    ui: &mut Ui,
    output: &mut Output,
    palette: &Palette,
    name: &str,
    lines: &[(f64, &str)],
    now_s: Option<f64>,
    height: f32,
) {
    let shown = now_s.map_or(lines.len(), |now_s| {
        lines.partition_point(|line| line.0 <= now_s + 1e-9)
    });
    let area = ScrollArea::vertical()
        .id_salt(name)
        .max_height(height)
        .auto_shrink([false, true])
        .stick_to_bottom(now_s.is_none());
    let spacing = ui.spacing().item_spacing.y;
    ui.spacing_mut().item_spacing.y = 0.0;
    let response = area.show_rows(ui, LINE_HEIGHT, lines.len(), |ui, rows| {
        for row in rows {
            let (at_s, text) = lines[row];
            line(ui, output, palette, (at_s, text), row < shown, now_s.is_some());
        }
    });
    ui.spacing_mut().item_spacing.y = spacing;
    output.mark_rect(name, response.inner_rect, true);
}

fn line(ui: &mut Ui, output: &mut Output, palette: &Palette, (at_s, text): (f64, &str), is_past: bool, seeks: bool) {
    ui.horizontal(|ui| {
        ui.set_height(LINE_HEIGHT);
        ui.spacing_mut().button_padding = vec2(2.0, 0.0);
        ui.spacing_mut().interact_size.y = LINE_HEIGHT;
        let ink = if is_past {
            palette.ink
        } else {
            palette.faint_ink.gamma_multiply(0.7)
        };
        let stamp = RichText::new(theme::moment(at_s))
            .monospace()
            .size(11.5)
            .color(palette.faint_ink);
        if seeks {
            let response = ui
                .add(Button::new(stamp).frame(false))
                .on_hover_text("Show this moment");
            if response.clicked() {
                output.send(Command::Seek { time_s: at_s });
            }
        } else {
            ui.label(stamp);
        }
        ui.add(Label::new(RichText::new(text).monospace().size(12.0).color(ink)).truncate());
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    fn log_line(text: &str) -> Note {
        Note::Log { text: text.to_owned() }
    }

    fn point(x_m: f64) -> Note {
        Note::Point {
            at_m: [x_m, 0.0],
            colour: 2,
        }
    }

    #[test]
    fn drawings_are_those_of_the_moment_and_fade_with_it() {
        let ticks = [
            TickNotes {
                tick: 0,
                notes: vec![log_line("off"), point(0.0)],
            },
            TickNotes {
                tick: 12,
                notes: vec![point(1.0)],
            },
            TickNotes {
                tick: 14,
                notes: vec![log_line("there")],
            },
        ];
        assert_eq!(drawings_at(&ticks, 0.0), [point(0.0)]);
        assert_eq!(drawings_at(&ticks, 0.09), []);
        assert_eq!(drawings_at(&ticks, 0.12), [point(1.0)]);
        assert_eq!(drawings_at(&ticks, 5.0), []);
        assert_eq!(
            lines(&ticks).iter().map(|line| line.1).collect::<Vec<_>>(),
            ["off", "there"]
        );
    }
}
