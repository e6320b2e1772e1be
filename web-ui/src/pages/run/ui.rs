//! How the Run page looks: facts at the left, measured motion and twin on one floor, errors over time below.

use super::{comparison, data};
use crate::arena_view::{self, colour};
use crate::command::Command;
use crate::output::Output;
use crate::pages::{notes, parts, queue, words};
use crate::state::{Page, RunSide, State};
use crate::theme::{self, Palette, Tone};
use crate::update;
use api::run::{RunState, RunView};
use egui::{Button, CentralPanel, Frame, Label, Margin, Panel, RichText, ScrollArea, Stroke, Ui, vec2};
use egui_plot::{HLine, Line, LineStyle, Plot, PlotPoints, VLine};

const PLOT_SHARE: f32 = 0.36;
const PLAYBACK_HEIGHT: f32 = 40.0;
const LOG_HEIGHT: f32 = 150.0;

pub fn show(ui: &mut Ui, state: &State, output: &mut Output, palette: &Palette) {
    let ground = Frame::new().fill(palette.ground);
    let Some(view) = &state.run.view else {
        CentralPanel::default()
            .frame(ground.inner_margin(Margin::same(theme::PAGE_MARGIN)))
            .show(ui, |ui| nothing(ui, state, output, palette));
        return;
    };
    let side = ground.inner_margin(Margin {
        left: theme::PAGE_MARGIN,
        right: 0,
        top: 0,
        bottom: 0,
    });
    Panel::left("run facts")
        .exact_size(theme::SIDE_WIDTH)
        .resizable(false)
        .frame(side)
        .show(ui, |ui| {
            ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
                ui.set_width(theme::SIDE_WIDTH - f32::from(theme::PAGE_MARGIN) - 18.0);
                facts(ui, state, view, output, palette);
            });
        });
    CentralPanel::default()
        .frame(ground.inner_margin(Margin::symmetric(theme::PAGE_MARGIN, 6)))
        .show(ui, |ui| {
            centre(ui, state, view, output, palette);
        });
    if let Some(run) = state.queue.cancel_asked {
        queue::ui::confirm(ui, state, run, output, palette);
    }
}

fn centre(ui: &mut Ui, state: &State, view: &RunView, output: &mut Output, palette: &Palette) {
    let leads = update::leads_along_a_path(view);
    if leads && view.state.is_terminal() {
        comparison::ui::head(ui, state, output, palette);
    }
    match state.comparison.side {
        RunSide::Comparison if leads && view.state.is_terminal() => {
            comparison::ui::show(ui, state, output, palette);
        }
        _ => motion(ui, state, view, output, palette),
    }
}

fn nothing(ui: &mut Ui, state: &State, output: &mut Output, palette: &Palette) {
    let (title, text, action) = match (&state.run.missing, state.run.selected) {
        (Some(why), _) => ("This run cannot be shown", why.as_str(), Some("Back to the queue")),
        (None, Some(_)) => ("Loading the run \u{2026}", "The server has not answered yet.", None),
        (None, None) => (
            "No run yet",
            "Submit an experiment; its measurements appear here beside the twin.",
            Some("Compose one"),
        ),
    };
    if let Some(response) = parts::empty(ui, palette, title, text, action) {
        let page = if state.run.missing.is_some() {
            Page::Queue
        } else {
            Page::Compose
        };
        output.on_click("run.elsewhere", &response, Command::ShowPage(page));
    }
}

fn facts(ui: &mut Ui, state: &State, view: &RunView, output: &mut Output, palette: &Palette) {
    ui.add_space(f32::from(theme::PAGE_MARGIN));
    ui.add(Label::new(RichText::new(&view.label).text_style(egui::TextStyle::Heading).strong()).wrap());
    let (word, tone) = words::run_state(view.state);
    ui.horizontal_wrapped(|ui| {
        parts::pill(ui, palette, word, tone);
        ui.add(Label::new(RichText::new(words::run_state_explained(view.state)).color(palette.faint_ink)).wrap());
    });
    if let Some(fault) = &view.fault {
        parts::card(ui, palette, |ui| {
            ui.add(Label::new(RichText::new(words::fault(fault)).color(palette.error)).wrap())
        });
    }
    actions(ui, view, output);
    ui.add_space(theme::GAP);
    parts::facts(ui, palette, "run facts", &data::facts(state, view));
    ui.add_space(theme::SECTION_GAP);
    verdict(ui, view, output, palette);
    ui.add_space(theme::SECTION_GAP);
    log(ui, state, output, palette);
    parts::section(ui, "Twin against twin");
    let (sentence, tone, facts) = data::digest(view);
    let ink = if tone == Tone::Neutral {
        palette.faint_ink
    } else {
        palette.tone(tone)
    };
    ui.add(Label::new(RichText::new(sentence).color(ink)).wrap());
    parts::facts(ui, palette, "digest facts", &facts);
    ui.add_space(theme::SECTION_GAP);
    downloads(ui, view, output, palette);
    ui.add_space(theme::SECTION_GAP);
}

/// The lines of the run's own controller, when it said anything.
fn log(ui: &mut Ui, state: &State, output: &mut Output, palette: &Palette) {
    let (ticks, source) = data::controller_notes(state);
    let lines = notes::lines(ticks);
    if lines.is_empty() {
        return;
    }
    parts::section(ui, &format!("Controller's log {source}"));
    let now_s = state.run.playback.time_s;
    notes::log(ui, output, palette, "run.log", &lines, Some(now_s), LOG_HEIGHT);
    ui.add_space(theme::SECTION_GAP);
}

fn actions(ui: &mut Ui, view: &RunView, output: &mut Output) {
    let running = matches!(view.state, RunState::Preparing | RunState::Running);
    let cancellable = queue::data::can_cancel(view.state);
    if !running && !cancellable {
        return;
    }
    ui.horizontal(|ui| {
        if running {
            let response = ui.add(Button::new("Watch live"));
            output.on_click("run.live", &response, Command::ShowPage(Page::Live));
        }
        if cancellable {
            let response = ui.add(Button::new("Cancel the run"));
            output.on_click("run.cancel", &response, Command::AskCancel(view.id));
        }
    });
}

fn verdict(ui: &mut Ui, view: &RunView, output: &mut Output, palette: &Palette) {
    parts::section(ui, "The server's twin");
    let Some(verdict) = &view.verdict else {
        ui.label(RichText::new("It has not driven the experiment yet.").color(palette.faint_ink));
        return;
    };
    let tone = if verdict.accepted { Tone::Good } else { Tone::Error };
    ui.add(Label::new(RichText::new(words::full_stop(&verdict.sentence)).color(palette.tone(tone))).wrap());
    ui.add(Label::new(RichText::new(words::verdict_figures(verdict)).color(palette.faint_ink)).wrap());
    for (index, (at_s, tone, text)) in data::findings(view).into_iter().enumerate() {
        let text = RichText::new(format!("{}   {text}", theme::moment(at_s))).color(palette.tone(tone));
        let response = ui
            .add(Button::new(text).wrap().fill(palette.raised))
            .on_hover_text("Show this moment");
        output.on_click(
            format!("run.finding.{index}"),
            &response,
            Command::Seek { time_s: at_s },
        );
    }
}

fn downloads(ui: &mut Ui, view: &RunView, output: &mut Output, palette: &Palette) {
    parts::section(ui, "Downloads");
    let Some(archive) = data::archive(view) else {
        let text = if view.state.is_terminal() {
            "Nothing was kept of this run."
        } else {
            "They are ready when the run is over."
        };
        ui.label(RichText::new(text).color(palette.faint_ink));
        return;
    };
    let text = format!("Everything as archive.zip ({} before packing)", archive.size);
    let response = ui.add(Button::new(text).min_size(vec2(ui.available_width(), 36.0)));
    output.on_click(
        "run.download.archive",
        &response,
        Command::Download {
            url: archive.url,
            file_name: archive.file_name,
        },
    );
    for file in data::files(view) {
        let button = Button::new(RichText::new(&file.name).size(13.0))
            .truncate()
            .right_text(RichText::new(&file.size).size(12.5).color(palette.faint_ink))
            .fill(palette.ground);
        let response = ui
            .add(button.min_size(vec2(ui.available_width(), 28.0)))
            .on_hover_text(format!("Download {}", file.name));
        output.on_click(
            format!("run.download.{}", file.name),
            &response,
            Command::Download {
                url: file.url,
                file_name: file.file_name,
            },
        );
    }
}

fn motion(ui: &mut Ui, state: &State, view: &RunView, output: &mut Output, palette: &Palette) {
    let series = data::series(state, view);
    let plot_height = if series.is_empty() {
        0.0
    } else {
        (ui.available_height() * PLOT_SHARE).max(150.0)
    };
    legend(ui, state, palette);
    let height = ui.available_height() - plot_height - PLAYBACK_HEIGHT - theme::GAP;
    let arena = arena_view::show(ui, &data::scene(state, view), height);
    output.mark_rect("run.arena", arena.floor, true);
    let recordings = [
        state.run.twin.replay().map(update::duration_s),
        data::physical(state).map(|(r, _)| update::duration_s(&r)),
    ];
    let duration_s = recordings.into_iter().flatten().fold(0.0, f64::max);
    parts::playback_bar(ui, output, &state.run.playback, duration_s, "run");
    if !series.is_empty() {
        plot_legend(ui, state, view, &series, palette);
        plot(ui, state, view, series, output, palette);
    }
}

/// Names and figures of the lines, above the plot where they hide nothing.
fn plot_legend(ui: &mut Ui, state: &State, view: &RunView, series: &[data::Series], palette: &Palette) {
    ui.horizontal_wrapped(|ui| {
        for item in series {
            sample(ui, colour(item.ink, palette), item.dashed);
            let figures = data::largest_and_rms_mm(&item.points).map_or_else(String::new, |(largest, rms)| {
                format!(
                    ": at most {}, RMS {}",
                    theme::fine_millimetres(largest / 1000.0),
                    theme::fine_millimetres(rms / 1000.0)
                )
            });
            ui.label(RichText::new(format!("{}{figures}", item.name)).size(13.0));
            ui.add_space(theme::GAP);
        }
        if data::has_path(state, view) {
            sample(ui, palette.good, true);
            ui.label(RichText::new("band \u{b1}75 mm (30 px)").size(13.0));
        }
    });
}

fn legend(ui: &mut Ui, state: &State, palette: &Palette) {
    ui.horizontal_wrapped(|ui| {
        sample(ui, palette.physical, false);
        ui.label("measured");
        ui.add_space(theme::GAP);
        sample(ui, palette.twin, true);
        ui.label("twin");
        for note in data::picture_notes(state) {
            ui.add_space(theme::GAP);
            ui.label(RichText::new(note).color(palette.faint_ink));
        }
    });
}

/// A short piece of the line as it stands on the floor.
fn sample(ui: &mut Ui, ink: egui::Color32, dashed: bool) {
    let (rect, _) = ui.allocate_exact_size(vec2(26.0, theme::CONTROL_HEIGHT * 0.6), egui::Sense::hover());
    let ends = [rect.left_center(), rect.right_center()];
    if dashed {
        ui.painter()
            .extend(egui::Shape::dashed_line(&ends, Stroke::new(2.0, ink), 6.0, 4.0));
    } else {
        ui.painter().line_segment(ends, Stroke::new(2.5, ink));
    }
}

fn plot(ui: &mut Ui, state: &State, view: &RunView, series: Vec<data::Series>, output: &mut Output, palette: &Palette) {
    let with_band = data::has_path(state, view);
    let band_mm = data::band_mm();
    let now_s = state.run.playback.time_s;
    let plot = Plot::new("run errors")
        .height(ui.available_height())
        .allow_scroll(false)
        .allow_drag([true, false])
        .allow_zoom([true, false])
        .allow_boxed_zoom(false)
        .include_y(0.0)
        .include_y(if with_band { band_mm * 1.15 } else { 1.0 })
        .x_axis_label("time in s")
        .y_axis_label("distance in mm")
        .grid_color(palette.wall.gamma_multiply(0.35))
        .label_formatter(|position| match position {
            egui_plot::HoverPosition::NearDataPoint {
                plot_name, position, ..
            } => Some(format!("{plot_name}\n{:.0} mm at {:.1} s", position.y, position.x)),
            egui_plot::HoverPosition::Elsewhere { .. } => None,
        });
    let palette = *palette;
    let response = plot.show(ui, move |plot| {
        if with_band {
            plot.hline(
                HLine::new("Band \u{b1}75 mm (30 px)", band_mm)
                    .color(palette.good)
                    .style(LineStyle::dashed_loose())
                    .width(1.5),
            );
        }
        for item in series {
            let style = if item.dashed {
                LineStyle::dashed_dense()
            } else {
                LineStyle::Solid
            };
            plot.line(
                Line::new(item.name, PlotPoints::from(item.points))
                    .color(colour(item.ink, &palette))
                    .width(1.8)
                    .style(style),
            );
        }
        plot.vline(VLine::new("", now_s).color(palette.faint_ink).width(1.0));
        (plot.response().clicked(), plot.pointer_coordinate())
    });
    output.mark("run.plot", &response.response);
    if let (true, Some(place)) = response.inner {
        output.send(Command::Seek {
            time_s: place.x.max(0.0),
        });
    }
}
