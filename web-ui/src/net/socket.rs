//! The live connection: one WebSocket at a time.

use super::live_path;
use crate::command::Event;
use crate::inbox::Inbox;
use crate::net::http::words;
use uuid::Uuid;
use wasm_bindgen::JsCast;
use wasm_bindgen::closure::Closure;
use web_sys::{CloseEvent, MessageEvent, WebSocket};

/// Closes when dropped.
pub struct Live {
    socket: WebSocket,
    _on_open: Closure<dyn FnMut()>,
    _on_message: Closure<dyn FnMut(MessageEvent)>,
    _on_close: Closure<dyn FnMut(CloseEvent)>,
}

impl Live {
    /// Connects; `None` (and a closed event) when the browser refuses the address.
    pub fn open(inbox: &Inbox, run: Uuid) -> Option<Self> {
        let socket = match WebSocket::new(&address(run)?) {
            Ok(socket) => socket,
            Err(error) => {
                inbox.push(Event::LiveClosed {
                    run,
                    reason: words(&error),
                });
                return None;
            }
        };
        let to = inbox.clone();
        let on_open = Closure::<dyn FnMut()>::new(move || to.push(Event::LiveOpened { run }));
        let to = inbox.clone();
        let on_message = Closure::<dyn FnMut(MessageEvent)>::new(move |message: MessageEvent| {
            if let Some(text) = message.data().as_string() {
                to.push(Event::LiveFrame { run, text });
            }
        });
        let to = inbox.clone();
        let on_close = Closure::<dyn FnMut(CloseEvent)>::new(move |event: CloseEvent| {
            to.push(Event::LiveClosed {
                run,
                reason: event.reason(),
            });
        });
        socket.set_onopen(Some(on_open.as_ref().unchecked_ref()));
        socket.set_onmessage(Some(on_message.as_ref().unchecked_ref()));
        socket.set_onclose(Some(on_close.as_ref().unchecked_ref()));
        Some(Self {
            socket,
            _on_open: on_open,
            _on_message: on_message,
            _on_close: on_close,
        })
    }
}

impl Drop for Live {
    fn drop(&mut self) {
        self.socket.set_onopen(None);
        self.socket.set_onmessage(None);
        self.socket.set_onclose(None);
        // Closing fails only when it is closed already.
        let _closed = self.socket.close();
    }
}

fn address(run: Uuid) -> Option<String> {
    let location = web_sys::window()?.location();
    let scheme = if location.protocol().ok()? == "https:" {
        "wss"
    } else {
        "ws"
    };
    Some(format!("{scheme}://{}{}", location.host().ok()?, live_path(run)))
}
