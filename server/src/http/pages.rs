//! The dashboard's files: `index.html`, the worker and the bundles.

use super::file_reply::FileReply;
use super::headers;
use super::problem::no_such_route;
use crate::state::AppState;
use axum::extract::{Request, State};
use axum::http::{HeaderMap, HeaderValue, Method, StatusCode, header};
use axum::response::{IntoResponse, Response};
use std::path::{Component, Path, PathBuf};
use std::time::UNIX_EPOCH;

/// Without these the page cannot start.
const NEEDED: [&str; 3] = ["index.html", "bundle/web_ui.js", "bundle/web_ui_bg.wasm"];
/// Browsers ask again each time; an unchanged file costs a 304.
const REVALIDATE: &str = "no-cache";

/// Answer for every path outside the API.
pub async fn serve(State(state): State<AppState>, request: Request) -> Response {
    let path = request.uri().path();
    if path.starts_with("/api/") || !matches!(*request.method(), Method::GET | Method::HEAD) {
        return no_such_route().await.into_response();
    }
    let folder = state.static_dir();
    let relative = path.trim_start_matches('/');
    let relative = if relative.is_empty() { "index.html" } else { relative };
    if relative == "index.html" {
        let missing: Vec<_> = NEEDED.into_iter().filter(|name| !folder.join(name).is_file()).collect();
        if !missing.is_empty() {
            return not_built(folder, &missing);
        }
    }
    match find(folder, relative, request.headers()).await {
        Some(reply) => {
            let mut response = reply.send(request.headers()).await.unwrap_or_else(|_| not_found());
            response
                .headers_mut()
                .append(header::VARY, HeaderValue::from_static("accept-encoding"));
            if relative == "index.html" {
                // The button of the protective stop calls the laboratories themselves.
                let policy = headers::content_security_policy(&state.stop_origins().await);
                response.headers_mut().insert(header::CONTENT_SECURITY_POLICY, policy);
            }
            response
        }
        None => not_found(),
    }
}

async fn find(folder: &Path, relative: &str, request: &HeaderMap) -> Option<FileReply> {
    let path = inside(folder, relative)?;
    let media_type = media_type(relative);
    for (encoding, suffix) in [("br", ".br"), ("gzip", ".gz")] {
        if accepts(request, encoding) {
            let mut packed = path.clone().into_os_string();
            packed.push(suffix);
            if let Some(reply) = reply(packed.into(), media_type, Some(encoding)).await {
                return Some(reply);
            }
        }
    }
    reply(path, media_type, None).await
}

async fn reply(path: PathBuf, media_type: &str, encoding: Option<&'static str>) -> Option<FileReply> {
    let metadata = tokio::fs::metadata(&path)
        .await
        .ok()
        .filter(|metadata| metadata.is_file())?;
    let changed = metadata.modified().ok()?.duration_since(UNIX_EPOCH).ok()?;
    Some(FileReply {
        path,
        media_type: media_type.to_owned(),
        etag: format!(
            "{:x}-{:x}-{}",
            metadata.len(),
            changed.as_nanos(),
            encoding.unwrap_or("plain")
        ),
        save_as: None,
        cache_control: REVALIDATE,
        encoding,
    })
}

/// The path below `folder`, unless it tries to leave it or names a hidden file.
fn inside(folder: &Path, relative: &str) -> Option<PathBuf> {
    let plain = relative
        .bytes()
        .all(|byte| byte.is_ascii_alphanumeric() || b"._-/".contains(&byte));
    let hidden = relative.split('/').any(|part| part.starts_with('.') || part.is_empty());
    let normal = Path::new(relative)
        .components()
        .all(|part| matches!(part, Component::Normal(_)));
    (plain && normal && !hidden).then(|| folder.join(relative))
}

/// Whether `Accept-Encoding` names this coding with a weight above zero.
fn accepts(request: &HeaderMap, coding: &str) -> bool {
    let offers = request
        .get_all(header::ACCEPT_ENCODING)
        .iter()
        .filter_map(|value| value.to_str().ok());
    offers.flat_map(|list| list.split(',')).any(|offer| {
        let mut parts = offer.split(';').map(str::trim);
        let named = parts.next().is_some_and(|name| name.eq_ignore_ascii_case(coding));
        let weight = parts
            .find_map(|part| part.strip_prefix("q="))
            .and_then(|text| text.parse::<f32>().ok());
        named && weight.unwrap_or(1.0) > 0.0
    })
}

fn media_type(name: &str) -> &'static str {
    match name.rsplit('.').next().unwrap_or_default() {
        "html" => "text/html; charset=utf-8",
        "js" | "mjs" => "text/javascript; charset=utf-8",
        "wasm" => "application/wasm",
        "css" => "text/css; charset=utf-8",
        "json" | "map" => "application/json",
        "svg" => "image/svg+xml",
        "png" => "image/png",
        "ico" => "image/x-icon",
        "woff2" => "font/woff2",
        "ttf" => "font/ttf",
        "txt" => "text/plain; charset=utf-8",
        "webmanifest" => "application/manifest+json",
        _ => "application/octet-stream",
    }
}

fn not_found() -> Response {
    (
        StatusCode::NOT_FOUND,
        [(header::CONTENT_TYPE, "text/plain; charset=utf-8")],
        "There is no such page.\n",
    )
        .into_response()
}

fn not_built(folder: &Path, missing: &[&str]) -> Response {
    let list: String = missing
        .iter()
        .map(|name| format!("<li><code>{name}</code></li>"))
        .collect();
    let folder = folder.display().to_string().replace('&', "&amp;").replace('<', "&lt;");
    let page = format!(
        "<!doctype html><html lang=\"en\"><meta charset=\"utf-8\"><title>Robopheus: dashboard not built</title>\
         <body style=\"font-family:sans-serif;max-width:40em;margin:3em auto\"><h1>The dashboard is not built yet</h1>\
         <p>These files are missing in <code>{folder}</code>:</p><ul>{list}</ul>\
         <p>Build them with <code>cargo xtask wasm</code> and load this page again. \
         The API works meanwhile: <a href=\"/api/v1/docs/\">documentation</a>.</p></body></html>"
    );
    let headers = [
        (header::CONTENT_TYPE, "text/html; charset=utf-8"),
        (header::CACHE_CONTROL, "no-store"),
    ];
    (StatusCode::SERVICE_UNAVAILABLE, headers, page).into_response()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_path_leaves_the_folder() {
        let folder = Path::new("/srv/static");
        assert_eq!(
            inside(folder, "bundle/web_ui.js"),
            Some(PathBuf::from("/srv/static/bundle/web_ui.js"))
        );
        for bad in [
            "../secret",
            "bundle/../../x",
            "/etc/passwd",
            "bundle//x",
            ".git/config",
            "a/%2e%2e/b",
            "a\0b",
        ] {
            assert_eq!(inside(folder, bad), None, "{bad}");
        }
    }

    #[test]
    fn a_coding_with_weight_zero_is_not_accepted() {
        let mut headers = HeaderMap::new();
        headers.insert(header::ACCEPT_ENCODING, HeaderValue::from_static("gzip;q=0.5, br;q=0"));
        assert!(accepts(&headers, "gzip"));
        assert!(!accepts(&headers, "br"));
    }
}
