//! The OpenAPI document and the page to browse it.

use crate::openapi;
use axum::http::header;
use axum::response::{IntoResponse, Response};
use utoipa_swagger_ui::{Config, SwaggerUi};

/// The OpenAPI 3.1 document.
#[utoipa::path(get, path = "/api/v1/openapi.json", tag = "service", responses((status = 200, content_type = "application/json", body = Object)))]
pub async fn openapi_document() -> Response {
    ([(header::CONTENT_TYPE, "application/json")], openapi::text()).into_response()
}

/// Swagger UI, served from this binary; its scripts satisfy the same content security policy as the dashboard.
pub fn page() -> SwaggerUi {
    SwaggerUi::new("/api/v1/docs").config(Config::from("/api/v1/openapi.json"))
}
