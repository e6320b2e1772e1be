//! Figures of a diagnosis: before and after, where, how strong.

use super::{data, phrase};
use crate::output::Output;
use crate::pages::parts;
use crate::report::{Effect, FloorMap, Region, Report};
use crate::state::State;
use crate::theme::{self, Palette};
use api::diagnosis::DiagnosisView;
use egui::{Align2, Color32, FontId, Label, Pos2, Rect, RichText, Sense, Stroke, Ui, pos2, vec2};
use egui_plot::{Bar, BarChart, HLine, LineStyle, Plot};

const BAR_HEIGHT: f32 = 11.0;
const LINE_HEIGHT: f32 = 50.0;
const CHANNEL_WIDTH: f32 = 275.0;
const REGION_WIDTH: f32 = 380.0;
const REGION_HEIGHT: f32 = 150.0;

/// Prediction error by channel and horizon: before, after, and what chance gives.
pub fn before_after(ui: &mut Ui, report: &Report, palette: &Palette) {
    parts::section(ui, "The gap before and after");
    let chance = if report.floor_source == "references" {
        "what unchanged runs show as well"
    } else {
        "what the sensors' noise gives"
    };
    let text = match report.data.iter().filter(|data| data.role == "locked").count() {
        0 => "Prediction error, RMS.".to_owned(),
        n => format!("Prediction error (RMS) on the {n} runs that were held back until the model was final."),
    };
    ui.add(Label::new(RichText::new(text).color(palette.faint_ink)).wrap());
    ui.horizontal_wrapped(|ui| {
        for (ink, name) in [
            (before_ink(palette), "before"),
            (palette.good, "after"),
            (palette.faint_ink, chance),
        ] {
            let (rect, _) = ui.allocate_exact_size(vec2(16.0, 12.0), Sense::hover());
            ui.painter().rect_filled(rect, 2.0, ink);
            ui.label(RichText::new(name).size(13.0));
            ui.add_space(theme::GAP);
        }
    });
    let count = columns_for(ui, CHANNEL_WIDTH);
    ui.columns(count, |columns| {
        for (place, (name, lines)) in data::gap_lines(report).into_iter().enumerate() {
            let ui = &mut columns[place % count];
            parts::card(ui, palette, |ui| channel(ui, &name, &lines, palette));
            ui.add_space(theme::GAP / 2.0);
        }
    });
}

/// Columns of at least this width that fit.
fn columns_for(ui: &Ui, width: f32) -> usize {
    ((ui.available_width() / width) as usize).clamp(1, 4)
}

fn before_ink(palette: &Palette) -> Color32 {
    palette.warning
}

fn channel(ui: &mut Ui, name: &str, lines: &[data::GapLine], palette: &Palette) {
    ui.label(RichText::new(name).strong());
    let most = lines
        .iter()
        .flat_map(|line| [line.before, line.after, line.floor])
        .fold(f64::MIN_POSITIVE, f64::max);
    for line in lines {
        let (rect, _) = ui.allocate_exact_size(vec2(ui.available_width(), LINE_HEIGHT - 6.0), Sense::hover());
        let painter = ui.painter_at(rect.expand(2.0));
        let font = FontId::proportional(12.5);
        painter.text(
            rect.left_center(),
            Align2::LEFT_CENTER,
            &line.horizon,
            font.clone(),
            palette.faint_ink,
        );
        let (left, right) = (rect.min.x + 84.0, rect.max.x - 78.0);
        let values = [line.before, line.after, line.floor];
        let inks = [before_ink(palette), palette.good, palette.faint_ink];
        for (place, ((value, ink), text)) in values.into_iter().zip(inks).zip(&line.texts).enumerate() {
            let top = rect.min.y + 3.0 + place as f32 * (BAR_HEIGHT + 2.5);
            let width = ((right - left) * (value / most) as f32).max(1.5);
            let bar = Rect::from_min_size(pos2(left, top), vec2(width, BAR_HEIGHT));
            painter.rect_filled(bar, 2.0, ink);
            painter.text(
                bar.right_center() + vec2(6.0, 0.0),
                Align2::LEFT_CENTER,
                text,
                FontId::proportional(11.5),
                palette.ink,
            );
        }
    }
}

/// Where the gap is: in words, by channel, on the floor, by state of the robot.
pub fn place(
    ui: &mut Ui,
    state: &State,
    view: &DiagnosisView,
    report: &Report,
    output: &mut Output,
    palette: &Palette,
) {
    let place = &report.place;
    let regions = data::loud_regions(report);
    if place.sentence.is_empty() && regions.is_empty() && place.floor_map.energy.is_empty() {
        return;
    }
    parts::section(ui, "Where they differ");
    ui.add(Label::new(&place.sentence).wrap());
    let count = columns_for(ui, REGION_WIDTH).min(2);
    let has_map = !place.floor_map.energy.is_empty();
    ui.columns(count, |columns| {
        if has_map {
            parts::card(&mut columns[0], palette, |ui| {
                floor(ui, state, view, report, output, palette);
            });
            columns[0].add_space(theme::GAP / 2.0);
        }
        for (place, region) in regions.into_iter().enumerate() {
            // The map is as tall as two of these.
            const BESIDE_MAP: [usize; 4] = [1, 1, 0, 1];
            let column = if has_map {
                BESIDE_MAP.get(place).copied().unwrap_or(0)
            } else {
                place % count
            };
            let ui = &mut columns[column.min(count - 1)];
            parts::card(ui, palette, |ui| by_region(ui, region, palette));
            ui.add_space(theme::GAP / 2.0);
        }
    });
}

/// Squares of the floor, the darker the more the twin is wrong there.
fn floor(ui: &mut Ui, state: &State, view: &DiagnosisView, report: &Report, output: &mut Output, palette: &Palette) {
    ui.label(RichText::new("On the floor").strong());
    let map = &report.place.floor_map;
    let arena = state.lab.arena_or_reference(&view.arena);
    let (width_m, height_m) = (arena.width_m as f32, arena.height_m as f32);
    let width = ui.available_width();
    let (rect, response) = ui.allocate_exact_size(vec2(width, width * height_m / width_m), Sense::hover());
    let painter = ui.painter_at(rect);
    painter.rect(
        rect,
        2.0,
        palette.floor,
        Stroke::new(1.5, palette.wall),
        egui::StrokeKind::Inside,
    );
    let scale = rect.width() / width_m;
    let at = |x_m: f64, y_m: f64| -> Pos2 { rect.center() + vec2(x_m as f32 * scale, -(y_m as f32) * scale) };
    let most = map.energy.iter().copied().fold(1.0, f64::max);
    let side = map.cell_m as f32 * scale;
    for ((x_m, y_m), energy) in map.x_m.iter().zip(&map.y_m).zip(&map.energy) {
        let cell = Rect::from_center_size(at(*x_m, *y_m), vec2(side, side)).shrink(0.5);
        painter.rect_filled(cell, 0.0, heat(palette, *energy, most));
    }
    let mark = Stroke::new(2.0, palette.accent);
    for effect in &report.effects {
        if let Some((x_m, y_m, radius_m)) = disc(effect) {
            painter.circle_stroke(at(x_m, y_m), (radius_m as f32 * scale).max(4.0), mark);
            painter.text(
                at(x_m, y_m) + vec2(0.0, -(radius_m as f32 * scale) - 4.0),
                Align2::CENTER_BOTTOM,
                "found here",
                FontId::proportional(12.0),
                palette.accent,
            );
        }
    }
    painter.text(
        rect.left_bottom() + vec2(6.0, -4.0),
        Align2::LEFT_BOTTOM,
        format!("{width_m:.1} m \u{d7} {height_m:.1} m, x right, y up"),
        FontId::proportional(11.5),
        palette.faint_ink,
    );
    output.mark("gap.floor", &response);
    if let Some(pointer) = response.hover_pos()
        && let Some(energy) = nearest(map, |x_m, y_m| (at(x_m, y_m) - pointer).length() < side * 0.71)
    {
        response.on_hover_text(format!("{energy:.1} times what chance gives"));
    }
    legend(ui, most, palette);
}

fn nearest(map: &FloorMap, is_here: impl Fn(f64, f64) -> bool) -> Option<f64> {
    let cells = map.x_m.iter().zip(&map.y_m).zip(&map.energy);
    cells
        .filter(|((x_m, y_m), _)| is_here(**x_m, **y_m))
        .map(|(_, energy)| *energy)
        .next()
}

/// Centre and radius of an effect that has a place.
fn disc(effect: &Effect) -> Option<(f64, f64, f64)> {
    let get = |name: &str| effect.parameters.iter().find(|one| one.name == name)?.value;
    Some((get("x")?, get("y")?, get("radius")?))
}

/// 1 and below is the floor's colour; on a logarithmic scale from there.
fn heat(palette: &Palette, energy: f64, most: f64) -> Color32 {
    let share = if energy <= 1.0 || most <= 1.0 {
        0.0
    } else {
        (energy.ln() / most.ln()).clamp(0.0, 1.0)
    };
    let base = palette.stripe;
    let mix = |a: u8, b: u8| (f64::from(a) + (f64::from(b) - f64::from(a)) * share).round() as u8;
    let hot = palette.error;
    Color32::from_rgb(mix(base.r(), hot.r()), mix(base.g(), hot.g()), mix(base.b(), hot.b()))
}

fn legend(ui: &mut Ui, most: f64, palette: &Palette) {
    ui.horizontal(|ui| {
        ui.label(RichText::new("as by chance").size(12.0).color(palette.faint_ink));
        for step in 0..8 {
            let energy = most.powf(f64::from(step) / 7.0);
            let (rect, _) = ui.allocate_exact_size(vec2(16.0, 10.0), Sense::hover());
            ui.painter().rect_filled(rect, 0.0, heat(palette, energy, most));
            ui.add_space(-theme::GAP);
        }
        ui.add_space(theme::GAP);
        let text = format!("{most:.0} times as much");
        ui.label(RichText::new(text).size(12.0).color(palette.faint_ink));
    });
}

/// Energy of the residual over a variable; 1 is what chance gives.
fn by_region(ui: &mut Ui, region: &Region, palette: &Palette) {
    let unit = if region.unit.is_empty() || region.unit == "1" {
        String::new()
    } else {
        format!(" in {}", region.unit)
    };
    let title = format!(
        "{} over {}",
        data::channel(&region.channel),
        phrase::plain(&region.variable)
    );
    ui.add(Label::new(RichText::new(title).strong()).truncate());
    let bars: Vec<Bar> = region
        .edges
        .windows(2)
        .zip(&region.energy)
        .map(|(ends, energy)| {
            Bar::new(0.5 * (ends[0] + ends[1]), *energy)
                .width(0.92 * (ends[1] - ends[0]))
                .fill(before_ink(palette))
        })
        .collect();
    let id = format!("gap region {} {}", region.variable, region.channel);
    Plot::new(id)
        .height(REGION_HEIGHT)
        .allow_scroll(false)
        .allow_drag(false)
        .allow_zoom(false)
        .allow_boxed_zoom(false)
        .include_y(0.0)
        .include_y(1.5)
        .x_axis_label(format!("{}{unit}", phrase::plain(&region.variable)))
        .y_axis_label("times chance")
        .grid_color(palette.wall.gamma_multiply(0.25))
        .show(ui, |plot| {
            plot.bar_chart(BarChart::new("", bars).color(before_ink(palette)));
            plot.hline(
                HLine::new("chance", 1.0)
                    .color(palette.faint_ink)
                    .style(LineStyle::dashed_loose())
                    .width(1.2),
            );
        });
}

/// A large figure in groups of three.
fn thousands(value: f64) -> String {
    let digits = format!("{value:.0}");
    let mut text = String::new();
    for (place, digit) in digits.chars().enumerate() {
        if place > 0 && (digits.len() - place).is_multiple_of(3) {
            text.push('\u{2009}');
        }
        text.push(digit);
    }
    text
}

/// How much an effect explains, against what chance gives.
pub fn evidence(ui: &mut Ui, effect: &Effect, largest: f64, palette: &Palette) {
    let evidence = effect.evidence;
    if evidence.gain <= 0.0 {
        return;
    }
    let (rect, response) = ui.allocate_exact_size(vec2(ui.available_width().min(560.0), 22.0), Sense::hover());
    let painter = ui.painter_at(rect.expand(1.0));
    // Logarithmic: effects differ by powers of ten.
    let top = largest.max(10.0).ln();
    let place = |value: f64| rect.min.x + rect.width() * 0.72 * ((value.max(1.0).ln() / top) as f32).clamp(0.0, 1.0);
    let bar = Rect::from_min_max(
        rect.min + vec2(0.0, 5.0),
        pos2(place(evidence.gain).max(rect.min.x + 2.0), rect.max.y - 5.0),
    );
    painter.rect_filled(bar, 2.0, palette.accent);
    let chance = place(evidence.threshold);
    painter.vline(chance, rect.y_range(), Stroke::new(2.0, palette.warning));
    painter.text(
        bar.right_center() + vec2(8.0, 0.0),
        Align2::LEFT_CENTER,
        format!("evidence {}", thousands(evidence.gain)),
        FontId::proportional(12.5),
        palette.ink,
    );
    response.on_hover_text("How much of the disagreement the effect takes away, in units of noise; the mark is what chance reaches (logarithmic)");
    let stability = if evidence.stability > 0.0 {
        format!(
            " It won in {:.0} % of the half-splits of the runs.",
            100.0 * evidence.stability
        )
    } else {
        String::new()
    };
    let text = format!("Chance reaches {:.0} (the mark).{stability}", evidence.threshold);
    ui.add(Label::new(RichText::new(text).color(palette.faint_ink).size(13.0)).wrap());
}
