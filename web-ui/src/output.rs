//! What a frame of drawing gives back: commands, and where widgets are.

use crate::command::Command;
use crate::inspect::Place;
use egui::{Rect, Response};
use std::collections::BTreeMap;

#[derive(Default)]
pub struct Output {
    pub commands: Vec<Command>,
    pub widgets: BTreeMap<String, Place>,
    /// CSS pixels per point of the page.
    pub scale: f32,
}

impl Output {
    pub fn send(&mut self, command: Command) {
        self.commands.push(command);
    }

    /// Names a widget for tests.
    pub fn mark(&mut self, name: impl Into<String>, response: &Response) {
        self.mark_rect(
            name,
            response.rect.intersect(response.interact_rect),
            response.enabled(),
        );
    }

    pub fn mark_rect(&mut self, name: impl Into<String>, rect: Rect, enabled: bool) {
        if rect.is_positive() {
            let place = Place {
                x: rect.min.x * self.scale,
                y: rect.min.y * self.scale,
                w: rect.width() * self.scale,
                h: rect.height() * self.scale,
                enabled,
            };
            self.widgets.insert(name.into(), place);
        }
    }

    /// Names a button and sends its command when it is pressed.
    pub fn on_click(&mut self, name: impl Into<String>, response: &Response, command: Command) {
        self.mark(name, response);
        if response.clicked() {
            self.send(command);
        }
    }
}
