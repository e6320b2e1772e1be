//! What `boot.js` calls.

use crate::app::App;
use crate::inspect;
use std::cell::RefCell;
use wasm_bindgen::{JsCast, JsError, prelude::wasm_bindgen};

thread_local! {
    /// Set once by [`start`].
    static RUNNER: RefCell<Option<eframe::WebRunner>> = const { RefCell::new(None) };
}

/// Draws the dashboard on the canvas with this id until the page is closed.
#[wasm_bindgen]
pub async fn start(canvas_id: String) -> Result<(), wasm_bindgen::JsValue> {
    let canvas = web_sys::window()
        .and_then(|w| w.document())
        .and_then(|d| d.get_element_by_id(&canvas_id))
        .and_then(|e| e.dyn_into::<web_sys::HtmlCanvasElement>().ok())
        .ok_or_else(|| JsError::new("the page has no canvas to draw on"))?;
    let runner = eframe::WebRunner::new();
    RUNNER.with(|slot| *slot.borrow_mut() = Some(runner.clone()));
    runner
        .start(
            canvas,
            eframe::WebOptions::default(),
            Box::new(|creation| Ok(Box::new(App::new(creation)))),
        )
        .await
}

/// The newest frame for tests, as JSON.
#[wasm_bindgen]
pub fn inspect() -> String {
    inspect::newest_json()
}

/// What went wrong, once the dashboard has stopped because of it.
#[wasm_bindgen]
pub fn crash_report() -> Option<String> {
    RUNNER.with(|slot| {
        slot.borrow()
            .as_ref()
            .and_then(eframe::WebRunner::panic_summary)
            .map(|s| s.message())
    })
}
