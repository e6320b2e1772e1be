//! Carries effects out in the browser: fetch, WebSocket, worker, clipboard, downloads.

use crate::command::{Effect, Event};
use crate::file_dialogue;
use crate::inbox::Inbox;
use crate::net::{http, socket};
use crate::worker::{SimWorker, cancel_message, start_message};
use chrono::{DateTime, Utc};
use wasm_bindgen::JsCast;
use web_sys::{HtmlAnchorElement, HtmlElement};

const THEME_KEY: &str = "robopheus.theme";

pub struct Platform {
    inbox: Inbox,
    worker: Option<SimWorker>,
    live: Option<socket::Live>,
}

impl Platform {
    pub const fn new(inbox: Inbox) -> Self {
        Self {
            inbox,
            worker: None,
            live: None,
        }
    }

    pub fn run(&mut self, context: &egui::Context, effect: Effect) {
        match effect {
            Effect::Send {
                request,
                body,
                idempotency_key,
            } => http::send(self.inbox.clone(), request, body, idempotency_key),
            Effect::StartTwin { id, scenario } => self.start_twin(id, &scenario),
            Effect::CancelTwin { id } => {
                if let Some(worker) = &self.worker {
                    // A worker that takes no messages any more has nothing to cancel.
                    let _posted = worker.post(id, &cancel_message(id));
                }
            }
            Effect::PickModule => file_dialogue::open(&self.inbox),
            Effect::OpenLive { run } => self.live = socket::Live::open(&self.inbox, run),
            Effect::CloseLive => self.live = None,
            Effect::CopyText(text) => context.copy_text(text),
            Effect::Download { url, file_name } => download(&url, &file_name),
            Effect::SetAddress(address) => {
                if let Some(window) = web_sys::window() {
                    // The address is a convenience; a browser that refuses it loses nothing.
                    let _set = window.location().set_hash(&address);
                }
            }
            Effect::OpenBeside(address) => {
                if let Some(window) = web_sys::window() {
                    // A browser that opens no second page says so itself.
                    let _opened = window.open_with_url_and_target(&address, "_blank");
                }
            }
            Effect::StoreTheme { dark } => {
                if let Some(storage) = storage() {
                    let _stored = storage.set_item(THEME_KEY, if dark { "dark" } else { "light" });
                }
            }
        }
    }

    fn start_twin(&mut self, id: u32, scenario: &str) {
        let started = match self.worker.take().filter(|w| !w.is_broken()) {
            Some(worker) => Ok(worker),
            None => SimWorker::new(&self.inbox),
        };
        let posted = started.and_then(|worker| worker.post(id, &start_message(id, scenario)).map(|()| worker));
        match posted {
            Ok(worker) => self.worker = Some(worker),
            Err(message) => self.inbox.push(Event::TwinFailed { id, message }),
        }
    }
}

fn download(url: &str, file_name: &str) {
    let Some(document) = web_sys::window().and_then(|w| w.document()) else {
        return;
    };
    let Some(link) = document
        .create_element("a")
        .ok()
        .and_then(|e| e.dyn_into::<HtmlAnchorElement>().ok())
    else {
        return;
    };
    link.set_href(url);
    link.set_download(file_name);
    link.unchecked_ref::<HtmlElement>().click();
}

fn storage() -> Option<web_sys::Storage> {
    web_sys::window()?.local_storage().ok()?
}

/// What the person chose on an earlier visit.
pub fn stored_theme_is_dark() -> Option<bool> {
    storage()?.get_item(THEME_KEY).ok()?.map(|name| name == "dark")
}

pub fn utc_now() -> DateTime<Utc> {
    DateTime::from_timestamp_millis(js_sys::Date::now() as i64).unwrap_or_default()
}
