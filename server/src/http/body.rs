//! Reading JSON bodies: type, size, and errors that name the field.

use super::problem::ApiError;
use api::problem::FieldProblem;
use axum::Json;
use axum::body::{Body, Bytes};
use axum::extract::rejection::JsonRejection;
use axum::extract::{FromRequest, Request};
use axum::http::{HeaderMap, StatusCode, header};
use futures_util::StreamExt as _;
use serde::de::DeserializeOwned;
use std::time::Duration;

/// Largest JSON body: an experiment with a WebAssembly module of 1 MiB in base64 fits.
pub const JSON_LIMIT_BYTES: u64 = 2 * 1024 * 1024;
/// A longer body is read and thrown away up to here, so that its sender gets to see the problem.
const DRAIN_LIMIT_BYTES: u64 = 32 * 1024 * 1024;
/// A sender that is slower than this is given up.
const READ_TIMEOUT: Duration = Duration::from_secs(30);

/// A JSON body together with its bytes.
#[derive(Debug)]
pub struct JsonBody<T> {
    pub value: T,
    pub bytes: Bytes,
}

impl<S, T> FromRequest<S> for JsonBody<T>
where
    S: Send + Sync,
    T: DeserializeOwned,
{
    type Rejection = ApiError;

    async fn from_request(request: Request, _: &S) -> Result<Self, ApiError> {
        let (parts, body) = request.into_parts();
        let is_json = is_json(&parts.headers);
        let bytes = if expects_continue(&parts.headers) && (!is_json || announced(&parts.headers) > JSON_LIMIT_BYTES) {
            None // the sender waits for our word and sends nothing
        } else {
            tokio::time::timeout(READ_TIMEOUT, read(body)).await.map_err(|_| {
                ApiError::new(StatusCode::REQUEST_TIMEOUT, "request_timeout", "the body took too long")
            })??
        };
        if !is_json {
            return Err(ApiError::new(
                StatusCode::UNSUPPORTED_MEDIA_TYPE,
                "unsupported_media_type",
                "send the document with `Content-Type: application/json`",
            ));
        }
        let bytes = bytes.ok_or_else(too_large)?;
        let Json(value) = Json::from_bytes(&bytes).map_err(malformed)?;
        Ok(Self { value, bytes })
    }
}

/// The body, or nothing when it is too large.
async fn read(body: Body) -> Result<Option<Bytes>, ApiError> {
    let mut chunks = body.into_data_stream();
    let mut bytes = Vec::new();
    let mut seen: u64 = 0;
    while let Some(chunk) = chunks.next().await {
        let chunk = chunk.map_err(|_| ApiError::malformed("the body ended before it was complete", Vec::new()))?;
        seen += chunk.len() as u64;
        if seen > DRAIN_LIMIT_BYTES {
            break;
        }
        if seen <= JSON_LIMIT_BYTES {
            bytes.extend_from_slice(&chunk);
        }
    }
    Ok((seen <= JSON_LIMIT_BYTES).then(|| bytes.into()))
}

fn too_large() -> ApiError {
    ApiError::new(
        StatusCode::PAYLOAD_TOO_LARGE,
        "payload_too_large",
        format!("a JSON body may have at most {JSON_LIMIT_BYTES} bytes"),
    )
}

fn is_json(headers: &HeaderMap) -> bool {
    let value = headers
        .get(header::CONTENT_TYPE)
        .and_then(|value| value.to_str().ok())
        .unwrap_or_default();
    value
        .split(';')
        .next()
        .unwrap_or_default()
        .trim()
        .eq_ignore_ascii_case("application/json")
}

fn expects_continue(headers: &HeaderMap) -> bool {
    headers
        .get(header::EXPECT)
        .is_some_and(|value| value.as_bytes().eq_ignore_ascii_case(b"100-continue"))
}

fn announced(headers: &HeaderMap) -> u64 {
    let length = headers
        .get(header::CONTENT_LENGTH)
        .and_then(|value| value.to_str().ok());
    length.and_then(|text| text.parse().ok()).unwrap_or(0)
}

/// The parser's text is `<what failed>: <path>: <why> at line L column C`; the path becomes the field.
fn malformed(rejection: JsonRejection) -> ApiError {
    let text = rejection.body_text();
    let text = text.split_once(": ").map_or(text.as_str(), |(_, rest)| rest);
    let (why, place) = match text.rsplit_once(" at line ") {
        Some((why, place)) => (why, format!("line {}", place.replace(" column ", ", column "))),
        None => (text, "unknown place".to_owned()),
    };
    let (field, why) = match why.split_once(": ") {
        Some((field, why)) if !field.contains(' ') => (field, why),
        _ => ("", why),
    };
    // The parser names the struct for a field it does not know; the field itself is more useful.
    let unknown = why
        .strip_prefix("unknown field `")
        .and_then(|rest| rest.split('`').next());
    let field = match unknown {
        Some(name) if field.is_empty() || field == "." => name.to_owned(),
        Some(name) if field.rsplit('.').next() != Some(name) => format!("{field}.{name}"),
        _ if field == "." => String::new(),
        _ => field.to_owned(),
    };
    // Paths are those of the experiment document, as in the problems of its rules.
    let field = field.strip_prefix("experiment.").map_or(field.clone(), str::to_owned);
    let problem = FieldProblem {
        field,
        message: format!("{why} ({place})"),
        limit: "a JSON document as described in /api/v1/docs".to_owned(),
        remedy: match unknown {
            Some(name) => format!("remove `{name}` or correct its spelling"),
            None => "correct the document at that place".to_owned(),
        },
    };
    ApiError::malformed(format!("the document cannot be read at {place}: {why}"), vec![problem])
}
