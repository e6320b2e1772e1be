//! The browser's dialogue for a file, and the file's bytes.

use crate::command::Event;
use crate::inbox::Inbox;
use crate::net::http::words;
use wasm_bindgen::closure::Closure;
use wasm_bindgen::{JsCast, JsValue};
use wasm_bindgen_futures::{JsFuture, spawn_local};
use web_sys::{File, HtmlElement, HtmlInputElement};

/// The page's field for files; one, made when it is first needed.
const FIELD: &str = "robopheus-module";
/// A file is not even read beyond this.
const READ_MAX_BYTES: f64 = 64.0 * 1024.0 * 1024.0;

/// Opens the dialogue; what is picked arrives in the inbox, nothing when it is closed.
pub fn open(inbox: &Inbox) {
    if let Some(field) = field(inbox) {
        // The same file may be picked again after it was built anew.
        field.set_value("");
        field.unchecked_ref::<HtmlElement>().click();
    }
}

fn field(inbox: &Inbox) -> Option<HtmlInputElement> {
    let document = web_sys::window()?.document()?;
    if let Some(known) = document.get_element_by_id(FIELD) {
        return known.dyn_into().ok();
    }
    let field: HtmlInputElement = document.create_element("input").ok()?.dyn_into().ok()?;
    field.set_type("file");
    field.set_id(FIELD);
    field.set_accept(".wasm,application/wasm,.onnx");
    field.set_hidden(true);
    document.body()?.append_child(&field).ok()?;
    let (to, picked) = (inbox.clone(), field.clone());
    let on_change = Closure::<dyn FnMut()>::new(move || {
        if let Some(file) = picked.files().and_then(|files| files.get(0)) {
            read(to.clone(), file);
        }
    });
    field.set_onchange(Some(on_change.as_ref().unchecked_ref()));
    // The field lives as long as the page.
    on_change.forget();
    Some(field)
}

fn read(inbox: Inbox, file: File) {
    spawn_local(async move {
        let name = file.name();
        let bytes = bytes(&file).await.map_err(|error| words(&error));
        inbox.push(Event::ModulePicked { name, bytes });
    });
}

async fn bytes(file: &File) -> Result<Vec<u8>, JsValue> {
    if file.size() > READ_MAX_BYTES {
        return Err("it is far larger than a module may be".into());
    }
    let buffer = JsFuture::from(file.array_buffer()).await?;
    Ok(js_sys::Uint8Array::new(&buffer).to_vec())
}
