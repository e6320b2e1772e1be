//! One frame: take in what arrived, let time pass, draw, carry out what was done.

use crate::command::{Command, Event};
use crate::inbox::Inbox;
use crate::inspect;
use crate::output::Output;
use crate::pages;
use crate::platform::{Platform, stored_theme_is_dark, utc_now};
use crate::state::{Clock, Page, State};
use crate::theme;
use crate::update;
use egui::{Context, Key, Modifiers, Ui};
use uuid::Uuid;

/// How often the dashboard looks around when nothing moves.
const IDLE_S: f32 = 0.25;

pub struct App {
    state: State,
    inbox: Inbox,
    platform: Platform,
    /// The address the page had when it was looked at last.
    address: String,
}

impl App {
    pub fn new(creation: &eframe::CreationContext<'_>) -> Self {
        let context = &creation.egui_ctx;
        theme::install(context);
        let inbox = Inbox::new(context.clone());
        let dark = stored_theme_is_dark().unwrap_or_else(|| context.system_theme() == Some(egui::Theme::Dark));
        let state = State::new(
            Uuid::now_v7(),
            Clock {
                time_s: 0.0,
                utc: utc_now(),
            },
            dark,
        );
        Self {
            state,
            platform: Platform::new(inbox.clone()),
            inbox,
            address: String::new(),
        }
    }

    fn command(&mut self, context: &Context, command: Command) {
        for effect in update::command(&mut self.state, command) {
            self.platform.run(context, effect);
        }
        context.request_repaint();
    }

    fn event(&mut self, context: &Context, event: Event) {
        for effect in update::event(&mut self.state, event) {
            self.platform.run(context, effect);
        }
    }

    fn follow_address(&mut self, context: &Context, frame: &eframe::Frame) {
        let address = hash_of(frame);
        if address != self.address {
            self.address.clone_from(&address);
            self.command(context, Command::FollowAddress(address));
        }
    }
}

impl eframe::App for App {
    fn logic(&mut self, context: &Context, frame: &mut eframe::Frame) {
        self.follow_address(context, frame);
        for event in self.inbox.take() {
            self.event(context, event);
        }
        let clock = Clock {
            time_s: context.input(|i| i.time),
            utc: utc_now(),
        };
        for effect in update::tick(&mut self.state, clock) {
            self.platform.run(context, effect);
        }
        context.set_theme(if self.state.dark {
            egui::Theme::Dark
        } else {
            egui::Theme::Light
        });
        for command in keys(context, self.state.page) {
            self.command(context, command);
        }
        if pages::is_moving(&self.state) {
            context.request_repaint();
        } else {
            context.request_repaint_after_secs(next_look_s(&self.state));
        }
    }

    fn ui(&mut self, ui: &mut Ui, _frame: &mut eframe::Frame) {
        let context = ui.ctx().clone();
        let mut output = Output {
            scale: context.zoom_factor(),
            ..Output::default()
        };
        pages::show(ui, &self.state, &mut output);
        for command in output.commands {
            self.command(&context, command);
        }
        inspect::publish(inspect::Inspection {
            page: self.state.page.name(),
            widgets: output.widgets,
            state: inspect::summary(&self.state),
            ..inspect::Inspection::default()
        });
    }

    fn clear_color(&self, visuals: &egui::Visuals) -> [f32; 4] {
        visuals.panel_fill.to_normalized_gamma_f32()
    }
}

/// Sooner than usual while the twin waits for its pause to pass.
fn next_look_s(state: &State) -> f32 {
    match state.compose.twin.status {
        crate::state::TwinStatus::Waiting { start_at_s } => {
            ((start_at_s - state.clock.time_s).max(0.0) as f32 + 0.005).min(IDLE_S)
        }
        _ => IDLE_S,
    }
}

/// 1 to 6 switch pages, space plays and pauses, Ctrl+Enter submits.
fn keys(context: &Context, page: Page) -> Vec<Command> {
    let mut commands = Vec::new();
    if page == Page::Compose && context.input_mut(|i| i.consume_key(Modifiers::COMMAND, Key::Enter)) {
        commands.push(Command::Submit);
    }
    if context.text_edit_focused() || context.egui_wants_keyboard_input() {
        return commands;
    }
    let digits = [
        Key::Num1,
        Key::Num2,
        Key::Num3,
        Key::Num4,
        Key::Num5,
        Key::Num6,
        Key::Num7,
    ];
    for (key, page) in digits.into_iter().zip(Page::ALL) {
        if context.input_mut(|i| i.consume_key(Modifiers::NONE, key)) {
            commands.push(Command::ShowPage(page));
        }
    }
    let focused = context.memory(|m| m.focused().is_some());
    if !focused && context.input_mut(|i| i.consume_key(Modifiers::NONE, Key::Space)) {
        commands.push(Command::PlayPause);
    }
    commands
}

fn hash_of(frame: &eframe::Frame) -> String {
    frame.info().web_info.location.hash.clone()
}
