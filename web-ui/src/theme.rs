//! Colours, sizes and number formats. Nothing else in the dashboard chooses a colour or writes a unit.

mod colours;
mod format;

pub use colours::{Palette, ROBOT_INKS, Tone, palette};
pub use format::*;

use egui::{Context, CornerRadius, FontFamily, FontId, Margin, Stroke, Style, TextStyle, Theme, Visuals, vec2};

/// Distance between neighbours.
pub const GAP: f32 = 8.0;
/// Distance between sections.
pub const SECTION_GAP: f32 = 20.0;
/// Margin of a page.
pub const PAGE_MARGIN: i8 = 16;
/// Width of the panel at the left of Compose and Run.
pub const SIDE_WIDTH: f32 = 348.0;
/// Height of ordinary buttons and fields.
pub const CONTROL_HEIGHT: f32 = 30.0;
pub const CORNER: u8 = 6;

/// Text style of section titles.
pub fn section_style() -> TextStyle {
    TextStyle::Name("section".into())
}

/// Installs both themes.
pub fn install(context: &Context) {
    for (theme, dark) in [(Theme::Dark, true), (Theme::Light, false)] {
        context.style_mut_of(theme, |style| set_style(style, &palette(dark)));
    }
}

fn set_style(style: &mut Style, palette: &Palette) {
    let proportional = |size| FontId::new(size, FontFamily::Proportional);
    style.text_styles = [
        (TextStyle::Heading, proportional(20.0)),
        (section_style(), proportional(16.5)),
        (TextStyle::Body, proportional(14.0)),
        (TextStyle::Button, proportional(14.0)),
        (TextStyle::Small, proportional(12.0)),
        (TextStyle::Monospace, FontId::new(12.5, FontFamily::Monospace)),
    ]
    .into();
    let spacing = &mut style.spacing;
    spacing.item_spacing = vec2(GAP, GAP);
    spacing.button_padding = vec2(12.0, 5.0);
    spacing.interact_size = vec2(44.0, CONTROL_HEIGHT);
    spacing.slider_width = 150.0;
    spacing.menu_margin = Margin::same(8);
    spacing.tooltip_width = 360.0;
    spacing.scroll.bar_width = 8.0;
    style.interaction.selectable_labels = true;
    style.interaction.tooltip_delay = 0.35;
    style.animation_time = 0.08;
    set_visuals(&mut style.visuals, palette);
}

fn set_visuals(visuals: &mut Visuals, palette: &Palette) {
    *visuals = if palette.dark {
        Visuals::dark()
    } else {
        Visuals::light()
    };
    visuals.panel_fill = palette.ground;
    visuals.window_fill = palette.raised;
    visuals.window_stroke = Stroke::new(1.0, palette.line);
    visuals.extreme_bg_color = palette.sunken;
    visuals.faint_bg_color = palette.stripe;
    visuals.code_bg_color = palette.sunken;
    visuals.hyperlink_color = palette.accent;
    visuals.warn_fg_color = palette.warning;
    visuals.error_fg_color = palette.error;
    visuals.weak_text_color = Some(palette.faint_ink);
    visuals.selection.bg_fill = palette.accent_soft;
    visuals.selection.stroke = Stroke::new(1.5, palette.accent);
    visuals.slider_trailing_fill = true;
    visuals.handle_shape = egui::style::HandleShape::Circle;
    visuals.striped = false;
    visuals.window_corner_radius = CornerRadius::same(CORNER + 4);
    visuals.menu_corner_radius = CornerRadius::same(CORNER);
    let widgets = &mut visuals.widgets;
    for widget in [
        &mut widgets.noninteractive,
        &mut widgets.inactive,
        &mut widgets.hovered,
        &mut widgets.active,
        &mut widgets.open,
    ] {
        widget.corner_radius = CornerRadius::same(CORNER);
        widget.expansion = 0.0;
        widget.fg_stroke.color = palette.ink;
    }
    widgets.noninteractive.bg_stroke = Stroke::new(1.0, palette.line);
    widgets.inactive.bg_fill = palette.control;
    widgets.inactive.weak_bg_fill = palette.control;
    widgets.inactive.bg_stroke = Stroke::new(1.0, palette.line);
    widgets.hovered.bg_fill = palette.control_hover;
    widgets.hovered.weak_bg_fill = palette.control_hover;
    widgets.hovered.bg_stroke = Stroke::new(1.0, palette.accent);
    // Focus by keyboard and pressing look alike: a thick frame in the accent colour.
    widgets.active.bg_fill = palette.control_hover;
    widgets.active.weak_bg_fill = palette.control_hover;
    widgets.active.bg_stroke = Stroke::new(2.0, palette.accent);
    widgets.open.bg_fill = palette.control_hover;
    widgets.open.weak_bg_fill = palette.control_hover;
    widgets.open.bg_stroke = Stroke::new(1.0, palette.accent);
}
