//! Every route, grouped by who calls it. Who may is in `access.rs`.

use crate::access;
use crate::http::{
    archives, arenas, comparison, diagnoses, docs, events, experiments, headers, health, lab, lab_files, lab_stream,
    live, models, pages, problem, robots, runs,
};
use crate::state::AppState;
use axum::Router;
use axum::middleware::{from_fn, from_fn_with_state};
use axum::routing::{get, post, put};

/// The whole service: routes, pages, and what stands in front of all of them.
pub fn router(state: AppState) -> Router {
    let api = Router::new()
        // Anyone with a role
        .route("/api/v1/health", get(health::show))
        .route("/api/v1/openapi.json", get(docs::openapi_document))
        // People: browser, command line, scripts
        .route("/api/v1/experiments", post(experiments::submit).get(experiments::list))
        .route("/api/v1/experiments/{id}", get(experiments::show))
        .route("/api/v1/runs", get(runs::list))
        .route("/api/v1/runs/{id}", get(runs::show))
        .route("/api/v1/runs/{id}/cancel", post(runs::cancel))
        .route("/api/v1/runs/{id}/live", get(live::live))
        .route("/api/v1/runs/{id}/events", get(events::events))
        .route("/api/v1/runs/{id}/archive", get(archives::archive))
        .route("/api/v1/runs/{id}/files/{*name}", get(archives::file))
        .route("/api/v1/robots", get(robots::list))
        .route("/api/v1/arenas", get(arenas::list))
        .route(
            "/api/v1/robots/{robot}/model",
            get(models::of_robot).put(models::choose),
        )
        .route("/api/v1/robots/{robot}/gaps", get(models::gaps))
        .route("/api/v1/robots/{robot}/references", put(models::set_references))
        .route("/api/v1/models", get(models::list))
        .route("/api/v1/models/compare", post(comparison::compare))
        .route("/api/v1/models/{id}", get(models::show))
        .route("/api/v1/models/{id}/model.json", get(models::document))
        .route("/api/v1/models/{id}/onnx", get(models::onnx))
        .route("/api/v1/diagnoses", post(diagnoses::submit).get(diagnoses::list))
        .route("/api/v1/diagnoses/{id}", get(diagnoses::show))
        .route("/api/v1/diagnoses/{id}/report.json", get(diagnoses::report))
        .route("/api/v1/diagnoses/{id}/report.html", get(diagnoses::page))
        .route("/api/v1/diagnoses/{id}/cancel", post(diagnoses::cancel))
        .route("/api/v1/diagnoses/{id}/accept", post(diagnoses::accept))
        .route(
            "/api/v1/diagnoses/{id}/next-experiment",
            post(diagnoses::next_experiment),
        )
        // Laboratories
        .route("/api/v1/lab/register", post(lab::register))
        .route("/api/v1/lab/claim", post(lab::claim))
        .route("/api/v1/lab/status", post(lab::status))
        .route("/api/v1/lab/stream", get(lab_stream::stream))
        .route("/api/v1/lab/runs/{id}/heartbeat", post(lab::heartbeat))
        .route("/api/v1/lab/runs/{id}/state", post(lab::state))
        .route("/api/v1/lab/runs/{id}/files/{*name}", put(lab_files::put))
        .route("/api/v1/lab/runs/{id}/salvage", post(lab::salvage))
        .route("/api/v1/lab/runs/{id}/models", post(lab::learned));
    api.merge(docs::page())
        .fallback(pages::serve)
        // From the inside out
        .layer(from_fn_with_state(state.clone(), access::authorise))
        .layer(from_fn(problem::catch_panic))
        .layer(from_fn(problem::problems_everywhere))
        .layer(from_fn(headers::secure))
        .with_state(state)
}
