//! The twin's worker: physics runs there, never on the thread that draws.

use crate::command::Event;
use api::problem::FieldProblem;
use api::verdict::{Replay, Verdict};
use serde::Deserialize;
use serde_json::json;

/// What the worker says, as JSON objects.
#[derive(Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
enum Message {
    Progress {
        id: u32,
        fraction: f64,
    },
    Done {
        id: u32,
        verdict: Box<Document<Verdict>>,
        replay: Box<Document<Replay>>,
        digest: String,
        twin_version: String,
    },
    Problems {
        id: u32,
        problems: Document<Vec<FieldProblem>>,
    },
    Error {
        id: u32,
        message: String,
    },
}

/// The module hands its results over as JSON text; the worker may pass them on as text or as objects.
#[derive(Deserialize)]
#[serde(untagged)]
enum Document<T> {
    Object(T),
    Text(String),
}

impl<T: serde::de::DeserializeOwned> Document<T> {
    fn open(self) -> Result<T, serde_json::Error> {
        match self {
            Self::Object(value) => Ok(value),
            Self::Text(text) => serde_json::from_str(&text),
        }
    }
}

/// Request that starts a computation.
pub fn start_message(id: u32, scenario: &str) -> String {
    json!({ "kind": "start", "id": id, "scenario": scenario }).to_string()
}

/// Request that gives one up.
pub fn cancel_message(id: u32) -> String {
    json!({ "kind": "cancel", "id": id }).to_string()
}

/// Reads one message of the worker.
pub fn event(text: &str) -> Result<Event, serde_json::Error> {
    Ok(match serde_json::from_str(text)? {
        Message::Progress { id, fraction } => Event::TwinProgress { id, fraction },
        Message::Done {
            id,
            verdict,
            replay,
            digest,
            twin_version,
        } => Event::TwinDone {
            id,
            verdict: Box::new(verdict.open()?),
            replay: Box::new(replay.open()?),
            digest,
            twin_version,
        },
        Message::Problems { id, problems } => Event::TwinProblems {
            id,
            problems: problems.open()?,
        },
        Message::Error { id, message } => Event::TwinFailed { id, message },
    })
}

#[cfg(target_arch = "wasm32")]
pub use browser::SimWorker;

#[cfg(target_arch = "wasm32")]
mod browser {
    use super::{Event, event};
    use crate::inbox::Inbox;
    use crate::net::http::words;
    use std::cell::Cell;
    use std::rc::Rc;
    use wasm_bindgen::closure::Closure;
    use wasm_bindgen::{JsCast, JsValue};
    use web_sys::{ErrorEvent, MessageEvent, Worker, WorkerOptions, WorkerType};

    const SCRIPT: &str = "/sim-worker.js";

    /// Ends when dropped.
    pub struct SimWorker {
        worker: Worker,
        /// The computation an error without a number belongs to.
        current: Rc<Cell<u32>>,
        /// Its program could not be loaded or it died; a new one is needed.
        broken: Rc<Cell<bool>>,
        _on_message: Closure<dyn FnMut(MessageEvent)>,
        _on_error: Closure<dyn FnMut(ErrorEvent)>,
    }

    impl SimWorker {
        pub fn new(inbox: &Inbox) -> Result<Self, String> {
            let options = WorkerOptions::new();
            options.set_type(WorkerType::Module);
            let worker = Worker::new_with_options(SCRIPT, &options).map_err(|e| words(&e))?;
            let current = Rc::new(Cell::new(0));
            let broken = Rc::new(Cell::new(false));
            let (to, id, dead) = (inbox.clone(), Rc::clone(&current), Rc::clone(&broken));
            let on_message = Closure::<dyn FnMut(MessageEvent)>::new(move |message: MessageEvent| {
                let text = text_of(&message.data());
                let event = event(&text).unwrap_or_else(|e| Event::TwinFailed {
                    id: id.get(),
                    message: format!("its answer could not be read ({e})"),
                });
                // A program that failed to load or broke does not recover; the next start gets a new worker.
                if matches!(event, Event::TwinFailed { .. }) {
                    dead.set(true);
                }
                to.push(event);
            });
            let (to, id, dead) = (inbox.clone(), Rc::clone(&current), Rc::clone(&broken));
            let on_error = Closure::<dyn FnMut(ErrorEvent)>::new(move |error: ErrorEvent| {
                dead.set(true);
                let message = error.message();
                let message = if message.is_empty() {
                    "its program could not be loaded".to_owned()
                } else {
                    message
                };
                to.push(Event::TwinFailed { id: id.get(), message });
            });
            worker.set_onmessage(Some(on_message.as_ref().unchecked_ref()));
            worker.set_onerror(Some(on_error.as_ref().unchecked_ref()));
            Ok(Self {
                worker,
                current,
                broken,
                _on_message: on_message,
                _on_error: on_error,
            })
        }

        pub fn is_broken(&self) -> bool {
            self.broken.get()
        }

        /// Sends a JSON object.
        pub fn post(&self, id: u32, message: &str) -> Result<(), String> {
            self.current.set(id);
            let object = js_sys::JSON::parse(message).map_err(|e| words(&e))?;
            self.worker.post_message(&object).map_err(|e| words(&e))
        }
    }

    impl Drop for SimWorker {
        fn drop(&mut self) {
            self.worker.terminate();
        }
    }

    fn text_of(data: &JsValue) -> String {
        data.as_string()
            .or_else(|| js_sys::JSON::stringify(data).ok().map(String::from))
            .unwrap_or_default()
    }
}
