//! REST calls with the browser's `fetch`.

use super::route;
use crate::command::{Answer, Event, HttpAnswer, Request};
use crate::inbox::Inbox;
use uuid::Uuid;
use wasm_bindgen::{JsCast, JsValue};
use wasm_bindgen_futures::{JsFuture, spawn_local};
use web_sys::{Headers, RequestInit, Response};

/// Sends a request; its answer arrives in the inbox.
pub fn send(inbox: Inbox, request: Request, body: Option<String>, idempotency_key: Option<Uuid>) {
    spawn_local(async move {
        let answer = call(&request, body, idempotency_key).await.map_err(|e| words(&e));
        inbox.push(Event::Answer {
            request,
            answer: answer as Answer,
        });
    });
}

async fn call(request: &Request, body: Option<String>, idempotency_key: Option<Uuid>) -> Result<HttpAnswer, JsValue> {
    let (method, path) = route(request);
    let headers = Headers::new()?;
    headers.set("accept", "application/json, application/problem+json")?;
    if body.is_some() {
        headers.set("content-type", "application/json")?;
    }
    if let Some(key) = idempotency_key {
        headers.set("idempotency-key", &key.to_string())?;
    }
    let init = RequestInit::new();
    init.set_method(method);
    init.set_headers(headers.as_ref());
    if let Some(body) = body {
        init.set_body(&JsValue::from_str(&body));
    }
    let window = web_sys::window().ok_or("no window")?;
    let response: Response = JsFuture::from(window.fetch_with_str_and_init(&path, &init))
        .await?
        .dyn_into()?;
    let text = JsFuture::from(response.text()?).await?;
    Ok(HttpAnswer {
        status: response.status(),
        body: text.as_string().unwrap_or_default(),
    })
}

/// The browser's words for what went wrong.
pub fn words(error: &JsValue) -> String {
    error
        .dyn_ref::<js_sys::Error>()
        .map(|e| String::from(e.message()))
        .or_else(|| error.as_string())
        .unwrap_or_else(|| "no connection".to_owned())
}
