//! The OpenAPI document, from the handlers' annotations.

use crate::http::{
    archives, arenas, comparison, diagnoses, docs, events, experiments, health, lab, lab_files, lab_stream, live,
    models, robots, runs,
};
use std::sync::LazyLock;
use utoipa::OpenApi;
use utoipa::openapi::security::{HttpAuthScheme, HttpBuilder, SecurityScheme};

/// Every route of the API.
#[derive(OpenApi)]
#[openapi(
    info(
        title = "Robopheus",
        description = "Submit experiments, watch runs, fetch archives. Callers on the server's own machine need no token unless it serves other machines too."
    ),
    paths(
        health::show, docs::openapi_document,
        experiments::submit, experiments::list, experiments::show,
        runs::list, runs::show, runs::cancel, live::live, events::events, archives::archive, archives::file,
        robots::list, arenas::list,
        models::list, models::show, models::document, models::onnx, models::of_robot, models::choose, models::gaps, models::set_references,
        comparison::compare,
        diagnoses::submit, diagnoses::list, diagnoses::show, diagnoses::report, diagnoses::page,
        diagnoses::cancel, diagnoses::accept, diagnoses::next_experiment,
        lab::register, lab::claim, lab::status, lab_stream::stream, lab::heartbeat, lab::state, lab::salvage, lab::learned, lab_files::put,
    ),
    modifiers(&Tokens),
    security((), ("token" = []))
)]
pub struct Document;

struct Tokens;

impl utoipa::Modify for Tokens {
    fn modify(&self, document: &mut utoipa::openapi::OpenApi) {
        let scheme = HttpBuilder::new().scheme(HttpAuthScheme::Bearer).build();
        document
            .components
            .get_or_insert_default()
            .add_security_scheme("token", SecurityScheme::Http(scheme));
    }
}

static TEXT: LazyLock<String> = LazyLock::new(|| Document::openapi().to_json().unwrap_or_default());

/// The document as JSON.
pub fn text() -> &'static str {
    &TEXT
}
