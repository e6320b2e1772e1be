//! Problem bodies (RFC 9457): the one place where an error becomes a status and a body.

use crate::app::error::AppError;
use api::problem::{FieldProblem, Problem};
use axum::body::Body;
use axum::extract::Request;
use axum::http::{HeaderValue, StatusCode, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use futures_util::FutureExt as _;
use std::panic::AssertUnwindSafe;

pub const MEDIA_TYPE: &str = "application/problem+json";
/// What a client is told to wait while the database is away.
const RETRY_AFTER_S: u32 = 2;

/// An error on its way to the caller. The detail is for people, the code for programs.
#[derive(Debug)]
pub struct ApiError {
    status: StatusCode,
    code: &'static str,
    detail: String,
    errors: Vec<FieldProblem>,
    retry_after_s: Option<u32>,
}

impl ApiError {
    pub fn new(status: StatusCode, code: &'static str, detail: impl Into<String>) -> Self {
        Self {
            status,
            code,
            detail: detail.into(),
            errors: Vec::new(),
            retry_after_s: None,
        }
    }

    pub fn with_errors(mut self, errors: Vec<FieldProblem>) -> Self {
        self.errors = errors;
        self
    }

    pub fn unauthorized(detail: impl Into<String>) -> Self {
        Self::new(StatusCode::UNAUTHORIZED, "unauthorized", detail)
    }

    pub fn forbidden(detail: impl Into<String>) -> Self {
        Self::new(StatusCode::FORBIDDEN, "forbidden", detail)
    }

    pub fn foreign_origin() -> Self {
        Self::new(
            StatusCode::FORBIDDEN,
            "foreign_origin",
            "pages of another origin may not change anything here",
        )
    }

    pub fn malformed(detail: impl Into<String>, errors: Vec<FieldProblem>) -> Self {
        Self::new(StatusCode::BAD_REQUEST, "malformed_request", detail).with_errors(errors)
    }

    pub fn too_many_watchers() -> Self {
        let mut error = Self::new(
            StatusCode::SERVICE_UNAVAILABLE,
            "too_many_watchers",
            "too many open live connections",
        );
        error.retry_after_s = Some(RETRY_AFTER_S);
        error
    }

    fn internal(source: &dyn std::fmt::Display) -> Self {
        tracing::error!(error = %source, "request failed inside");
        Self::new(
            StatusCode::INTERNAL_SERVER_ERROR,
            "internal_error",
            "something failed inside the service; it is in its log",
        )
    }
}

impl From<AppError> for ApiError {
    fn from(error: AppError) -> Self {
        match error {
            AppError::NotFound { noun, id } => {
                Self::new(StatusCode::NOT_FOUND, "not_found", format!("there is no {noun} {id}"))
            }
            AppError::Invalid { code, detail, errors } => {
                Self::new(StatusCode::UNPROCESSABLE_ENTITY, code, detail).with_errors(errors)
            }
            AppError::Conflict { code, detail } => Self::new(StatusCode::CONFLICT, code, detail),
            AppError::TooLarge { limit_bytes } => Self::new(
                StatusCode::PAYLOAD_TOO_LARGE,
                "payload_too_large",
                format!("the body is larger than {limit_bytes} bytes"),
            ),
            AppError::Interrupted => Self::malformed("the body ended before it was complete", Vec::new()),
            AppError::DatabaseUnavailable => {
                let mut error = Self::new(
                    StatusCode::SERVICE_UNAVAILABLE,
                    "database_unavailable",
                    "the database does not answer; try again shortly",
                );
                error.retry_after_s = Some(RETRY_AFTER_S);
                error
            }
            AppError::Corrupt { what } => {
                tracing::error!(%what, "stored bytes differ from their SHA-256");
                Self::new(
                    StatusCode::INTERNAL_SERVER_ERROR,
                    "stored_file_corrupt",
                    format!("{what} is damaged in the store"),
                )
            }
            AppError::Internal(source) => Self::internal(&source),
        }
    }
}

impl IntoResponse for ApiError {
    fn into_response(self) -> Response {
        let problem = Problem {
            kind: "about:blank".to_owned(),
            title: self.status.canonical_reason().unwrap_or("Error").to_owned(),
            status: self.status.as_u16(),
            detail: self.detail,
            code: self.code.to_owned(),
            errors: self.errors,
        };
        let body = serde_json::to_vec(&problem).unwrap_or_default();
        let mut response = (self.status, [(header::CONTENT_TYPE, MEDIA_TYPE)], body).into_response();
        if let Some(seconds) = self.retry_after_s {
            response
                .headers_mut()
                .insert(header::RETRY_AFTER, HeaderValue::from(seconds));
        }
        if self.status == StatusCode::UNAUTHORIZED {
            response
                .headers_mut()
                .insert(header::WWW_AUTHENTICATE, HeaderValue::from_static("Bearer"));
        }
        response
    }
}

/// Answer for a path that no route matches.
pub async fn no_such_route() -> ApiError {
    ApiError::new(
        StatusCode::NOT_FOUND,
        "not_found",
        "there is no such route; see /api/v1/docs",
    )
}

/// Turns a panic into a 500 that says nothing about the inside.
pub async fn catch_panic(request: Request, next: Next) -> Response {
    let route = request.uri().path().to_owned();
    match AssertUnwindSafe(next.run(request)).catch_unwind().await {
        Ok(response) => response,
        Err(_) => {
            tracing::error!(%route, "a handler panicked");
            ApiError::internal(&"panic").into_response()
        }
    }
}

/// Gives errors of the framework (405, failed WebSocket handshakes, ...) a problem body too.
pub async fn problems_everywhere(request: Request, next: Next) -> Response {
    let is_api = request.uri().path().starts_with("/api/");
    let response = next.run(request).await;
    let status = response.status();
    let is_error = status.is_client_error() || status.is_server_error();
    let is_problem = response
        .headers()
        .get(header::CONTENT_TYPE)
        .is_some_and(|value| value == MEDIA_TYPE);
    if !is_api || !is_error || is_problem {
        return response;
    }
    let (parts, _) = response.into_parts();
    let code = match status {
        StatusCode::METHOD_NOT_ALLOWED => "method_not_allowed",
        StatusCode::UPGRADE_REQUIRED => "websocket_expected",
        StatusCode::NOT_FOUND => "not_found",
        status if status.is_client_error() => "malformed_request",
        _ => "internal_error",
    };
    let detail = match status {
        StatusCode::METHOD_NOT_ALLOWED => "this route does not know that method",
        StatusCode::UPGRADE_REQUIRED => "this route speaks WebSocket only",
        _ => "the request cannot be answered",
    };
    let (own, body): (_, Body) = ApiError::new(status, code, detail).into_response().into_parts();
    let mut response = Response::from_parts(own, body);
    if let Some(allow) = parts.headers.get(header::ALLOW) {
        response.headers_mut().insert(header::ALLOW, allow.clone());
    }
    response
}
