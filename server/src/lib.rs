//! REST, WebSocket and static files of the service.
//!
//! `router.rs` lists every route, `access.rs` says who may call it, `http/<noun>.rs` extracts and answers,
//! `app/<noun>.rs` says what it means, the SQL is in `store`.

pub mod access;
pub mod app;
pub mod archive_file;
pub mod config;
pub mod http;
pub mod live;
pub mod objects;
pub mod openapi;
pub mod router;
pub mod startup;
pub mod state;
mod stop_pages;
pub mod tokens;
