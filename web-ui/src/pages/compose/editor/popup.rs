//! The list of words at the cursor: arrows choose, Enter or Tab takes, Escape closes, Ctrl+Space asks for it.

use super::completion::{Suggestions, complete, suggestions};
use crate::output::Output;
use crate::theme::{self, Palette};
use controllers::vocabulary::Word;
use egui::{
    Area, Event, Frame, Id, InputOptions, InputState, Key, LayerId, Margin, Modifiers, Order, Rect, RichText,
    ScrollArea, Sense, Stroke, SurrenderFocusOn, Ui, pos2, vec2,
};

const WIDTH: f32 = 470.0;
const HEIGHT: f32 = 196.0;
const ROW_HEIGHT: f32 = 24.0;

/// What the list remembers from frame to frame; the widget's own, as is the cursor of the text.
#[derive(Debug, Clone, Default)]
pub struct Popup {
    selected: usize,
    /// The begun word that `selected` belongs to, and where it starts.
    word: (usize, String),
    is_open: bool,
    asked: bool,
    dismissed: Option<(usize, String)>,
    moved: isize,
    taken: bool,
}

fn popup_id() -> Id {
    Id::unique("program words")
}

impl Popup {
    pub fn load(ui: &Ui, id: Id) -> Self {
        let kept: Option<Self> = ui.data(|data| data.get_temp(id.with("words")));
        Self {
            moved: 0,
            taken: false,
            ..kept.unwrap_or_default()
        }
    }

    pub fn store(self, ui: &Ui, id: Id) {
        ui.data_mut(|data| data.insert_temp(id.with("words"), self));
    }

    pub fn is_open(&self) -> bool {
        self.is_open
    }

    /// Keys that are meant for the list never reach the text.
    pub fn take_keys(&mut self, ui: &Ui) {
        ui.input_mut(|input| {
            if input.consume_key(Modifiers::CTRL, Key::Space) {
                (self.asked, self.dismissed) = (true, None);
                input
                    .events
                    .retain(|event| !matches!(event, Event::Text(text) if text == " "));
            }
            if !self.is_open {
                return;
            }
            self.moved = count(input, Key::ArrowDown) - count(input, Key::ArrowUp);
            self.taken = count(input, Key::Enter) + count(input, Key::Tab) > 0;
            if count(input, Key::Escape) > 0 {
                (self.asked, self.dismissed) = (false, Some(self.word.clone()));
            }
        });
    }

    /// A press on the list leaves the keyboard with the text; the options to go back to.
    pub fn hold_focus(&self, ui: &Ui) -> InputOptions {
        let layer = LayerId::new(Order::Foreground, popup_id());
        let pointer = ui.ctx().pointer_interact_pos();
        let on_list = self.is_open && pointer.and_then(|at| ui.ctx().layer_id_at(at)) == Some(layer);
        let before = ui.ctx().options(|options| options.input_options);
        if on_list {
            ui.ctx()
                .options_mut(|options| options.input_options.surrender_focus_on = SurrenderFocusOn::Never);
        }
        before
    }

    pub fn let_focus(ui: &Ui, before: InputOptions) {
        ui.ctx().options_mut(|options| options.input_options = before);
    }

    /// Draws the list; text and cursor after a word was taken.
    #[expect(clippy::too_many_arguments, reason = "what one frame of an editor consists of")]
    pub fn show(
        &mut self,
        ui: &Ui,
        output: &mut Output,
        palette: &Palette,
        text: &str,
        cursor: usize,
        has_focus: bool,
        caret: Rect,
    ) -> Option<(String, usize)> {
        let found = suggestions(text, cursor, self.asked).filter(|_| has_focus);
        let found = found.filter(|found| self.dismissed.as_ref() != Some(&(found.start, found.begun.clone())));
        let was_open = std::mem::take(&mut self.is_open);
        let Some(found) = found else {
            self.asked = false;
            return None;
        };
        let word = (found.start, found.begun.clone());
        if self.word != word {
            // Another word is begun: what was asked for there is over.
            self.asked &= self.word.0 == word.0 || !was_open;
            (self.selected, self.word, self.dismissed) = (0, word, None);
        }
        let last = found.words.len() - 1;
        self.selected = self.selected.min(last).saturating_add_signed(self.moved).min(last);
        let clicked = if self.taken {
            None
        } else {
            self.list(ui, output, palette, &found, caret)
        };
        let chosen = clicked.or(self.taken.then_some(self.selected))?;
        (self.is_open, self.asked) = (false, false);
        let (text, cursor) = complete(text, cursor, &found, found.words[chosen]);
        // Not at once again for the word that is there now.
        self.dismissed = Some((found.start, found.words[chosen].name.to_owned()));
        Some((text, cursor))
    }

    fn list(
        &mut self,
        ui: &Ui,
        output: &mut Output,
        palette: &Palette,
        found: &Suggestions,
        caret: Rect,
    ) -> Option<usize> {
        self.is_open = true;
        let height = HEIGHT.min(found.words.len() as f32 * ROW_HEIGHT + 2.0);
        let screen = ui.ctx().content_rect();
        let below = caret.bottom() + 4.0;
        let top = if below + height + 8.0 < screen.bottom() {
            below
        } else {
            caret.top() - height - 14.0
        };
        let left = caret.left().min(screen.right() - WIDTH - 12.0);
        let area = Area::new(popup_id())
            .order(Order::Foreground)
            .fixed_pos(pos2(left, top));
        let mut clicked = None;
        let shown = area.constrain(false).show(ui.ctx(), |ui| {
            let frame = Frame::new()
                .fill(palette.raised)
                .stroke(Stroke::new(1.0, palette.line))
                .corner_radius(theme::CORNER)
                .shadow(ui.visuals().popup_shadow)
                .inner_margin(Margin::same(4));
            frame.show(ui, |ui| {
                ui.spacing_mut().item_spacing.y = 0.0;
                ScrollArea::vertical().max_height(height).show(ui, |ui| {
                    for (place, word) in found.words.iter().enumerate() {
                        if self.row(ui, output, palette, place, word) {
                            clicked = Some(place);
                        }
                    }
                });
            });
        });
        output.mark("compose.words", &shown.response);
        clicked
    }

    fn row(&mut self, ui: &mut Ui, output: &mut Output, palette: &Palette, place: usize, word: &Word) -> bool {
        let (rect, response) = ui.allocate_exact_size(vec2(WIDTH - 20.0, ROW_HEIGHT), Sense::click());
        if response.hovered() && ui.input(|input| input.pointer.is_moving()) {
            self.selected = place;
        }
        let is_selected = self.selected == place;
        if is_selected {
            ui.painter().rect_filled(rect, theme::CORNER, palette.accent_soft);
            if self.moved != 0 {
                response.scroll_to_me(None);
            }
        }
        let mut line = ui.new_child(
            egui::UiBuilder::new()
                .max_rect(rect.shrink2(vec2(8.0, 0.0)))
                .layout(egui::Layout::left_to_right(egui::Align::Center)),
        );
        line.add(egui::Label::new(RichText::new(word.form).monospace().color(palette.ink)).selectable(false));
        line.add(
            egui::Label::new(RichText::new(word.help).size(12.0).color(palette.faint_ink))
                .selectable(false)
                .truncate(),
        );
        let clicked = response.clicked();
        output.mark(format!("compose.word.{place}"), &response);
        response.on_hover_text(word.help);
        clicked
    }
}

/// Takes the presses of a key without others out of the frame's events.
fn count(input: &mut InputState, wanted: Key) -> isize {
    let before = input.events.len();
    input.events.retain(|event| {
        !matches!(event, Event::Key { key, modifiers, pressed: true, .. } if *key == wanted && modifiers.is_none())
    });
    (before - input.events.len()) as isize
}
