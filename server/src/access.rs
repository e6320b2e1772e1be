//! Who may call what: one table, one place where it is applied.

use crate::http::problem::ApiError;
use crate::state::AppState;
use axum::extract::{ConnectInfo, MatchedPath, Request, State};
use axum::http::{HeaderMap, Method, header};
use axum::middleware::Next;
use axum::response::Response;
use std::net::{IpAddr, SocketAddr};
pub use store::Role;

/// The caller, as every handler sees it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Principal {
    pub name: String,
    pub roles: Vec<Role>,
}

impl Principal {
    pub fn is(&self, role: Role) -> bool {
        self.roles.contains(&role)
    }

    /// Users see and stop what they submitted; operators see and stop everything.
    pub fn may_see_what_belongs_to(&self, owner: &str) -> bool {
        self.is(Role::Operator) || self.name == owner
    }
}

/// One line of the table.
#[derive(Debug, Clone, Copy)]
pub struct Rule {
    pub method: &'static str,
    /// Route pattern as in `router.rs`.
    pub path: &'static str,
    /// Any of these is enough.
    pub roles: &'static [Role],
}

const fn rule(method: &'static str, path: &'static str, roles: &'static [Role]) -> Rule {
    Rule { method, path, roles }
}

const ANY: &[Role] = &Role::ALL;
const PEOPLE: &[Role] = &[Role::User, Role::Operator];
const OPERATORS: &[Role] = &[Role::Operator];
const LAB: &[Role] = &[Role::Lab];
const PEOPLE_AND_LAB: &[Role] = &[Role::User, Role::Operator, Role::Lab];

/// Every route of the API. What is not here is refused; static pages are outside the API and open.
pub const RULES: &[Rule] = &[
    rule("GET", "/api/v1/health", ANY),
    rule("GET", "/api/v1/openapi.json", ANY),
    rule("GET", "/api/v1/docs", ANY),
    rule("GET", "/api/v1/docs/", ANY),
    rule("GET", "/api/v1/docs/{*rest}", ANY),
    rule("POST", "/api/v1/experiments", PEOPLE),
    rule("GET", "/api/v1/experiments", PEOPLE),
    rule("GET", "/api/v1/experiments/{id}", PEOPLE),
    rule("GET", "/api/v1/runs", PEOPLE),
    rule("GET", "/api/v1/runs/{id}", PEOPLE),
    rule("POST", "/api/v1/runs/{id}/cancel", PEOPLE),
    rule("GET", "/api/v1/runs/{id}/live", PEOPLE),
    rule("GET", "/api/v1/runs/{id}/events", PEOPLE),
    rule("GET", "/api/v1/runs/{id}/archive", PEOPLE),
    rule("GET", "/api/v1/runs/{id}/files/{*name}", PEOPLE),
    rule("GET", "/api/v1/robots", PEOPLE),
    // Laboratories ask whether their arena is anybody's before robots drive home.
    rule("GET", "/api/v1/arenas", PEOPLE_AND_LAB),
    rule("GET", "/api/v1/robots/{robot}/model", PEOPLE),
    // What changes the twin that everybody's experiments are checked with is for operators.
    rule("PUT", "/api/v1/robots/{robot}/model", OPERATORS),
    rule("GET", "/api/v1/robots/{robot}/gaps", PEOPLE),
    rule("PUT", "/api/v1/robots/{robot}/references", OPERATORS),
    rule("GET", "/api/v1/models", PEOPLE),
    rule("POST", "/api/v1/models/compare", PEOPLE),
    rule("GET", "/api/v1/models/{id}", PEOPLE),
    rule("GET", "/api/v1/models/{id}/model.json", PEOPLE),
    rule("GET", "/api/v1/models/{id}/onnx", PEOPLE),
    rule("POST", "/api/v1/diagnoses", PEOPLE),
    rule("GET", "/api/v1/diagnoses", PEOPLE),
    rule("GET", "/api/v1/diagnoses/{id}", PEOPLE),
    rule("GET", "/api/v1/diagnoses/{id}/report.json", PEOPLE),
    rule("GET", "/api/v1/diagnoses/{id}/report.html", PEOPLE),
    rule("POST", "/api/v1/diagnoses/{id}/cancel", PEOPLE),
    rule("POST", "/api/v1/diagnoses/{id}/accept", OPERATORS),
    rule("POST", "/api/v1/diagnoses/{id}/next-experiment", PEOPLE),
    rule("POST", "/api/v1/lab/register", LAB),
    rule("POST", "/api/v1/lab/claim", LAB),
    rule("POST", "/api/v1/lab/status", LAB),
    rule("GET", "/api/v1/lab/stream", LAB),
    rule("POST", "/api/v1/lab/runs/{id}/heartbeat", LAB),
    rule("POST", "/api/v1/lab/runs/{id}/state", LAB),
    rule("PUT", "/api/v1/lab/runs/{id}/files/{*name}", LAB),
    rule("POST", "/api/v1/lab/runs/{id}/salvage", LAB),
    rule("POST", "/api/v1/lab/runs/{id}/models", LAB),
];

/// Offered by a browser that has to put its token somewhere in a WebSocket handshake.
pub const TOKEN_PROTOCOL_PREFIX: &str = "bearer.";
/// The WebSocket subprotocol the service answers with.
pub const PROTOCOL: &str = "robopheus";

enum Found {
    Rule(&'static Rule),
    /// The path exists, the method does not: the router answers 405.
    OtherMethod,
    Nothing,
}

fn find(method: &Method, path: &str) -> Found {
    let method = if method == Method::HEAD { "GET" } else { method.as_str() };
    let mut known = false;
    for rule in RULES.iter().filter(|rule| rule.path == path) {
        if rule.method == method {
            return Found::Rule(rule);
        }
        known = true;
    }
    if known { Found::OtherMethod } else { Found::Nothing }
}

/// The one authorisation point, in front of every route.
pub async fn authorise(State(state): State<AppState>, mut request: Request, next: Next) -> Result<Response, ApiError> {
    let Some(pattern) = request.extensions().get::<MatchedPath>().cloned() else {
        return Ok(next.run(request).await); // no such route: a static page or 404
    };
    let rule = match find(request.method(), pattern.as_str()) {
        Found::Rule(rule) => rule,
        Found::OtherMethod => return Ok(next.run(request).await),
        Found::Nothing => {
            tracing::error!(route = pattern.as_str(), "route without an entry in the access table");
            return Err(ApiError::forbidden("this route has no entry in the access table"));
        }
    };
    let changes_something = rule.method != "GET";
    if changes_something || is_websocket(request.headers()) {
        refuse_foreign_origin(&state, request.headers())?;
    }
    let peer = request
        .extensions()
        .get::<ConnectInfo<SocketAddr>>()
        .map(|info| info.0.ip());
    let principal = principal(&state, request.headers(), peer).await?;
    if !rule.roles.iter().any(|role| principal.is(*role)) {
        let needed: Vec<_> = rule.roles.iter().map(|role| role.as_str()).collect();
        return Err(ApiError::forbidden(format!(
            "this route needs the role {}",
            needed.join(" or ")
        )));
    }
    request.extensions_mut().insert(principal);
    Ok(next.run(request).await)
}

async fn principal(state: &AppState, headers: &HeaderMap, peer: Option<IpAddr>) -> Result<Principal, ApiError> {
    if let Some(token) = token_of(headers)? {
        return state
            .principal_of_token(token)
            .await?
            .ok_or_else(|| ApiError::unauthorized("the token is not known"));
    }
    match state.local_user() {
        Some(local) if peer.is_some_and(|ip| ip.is_loopback()) => {
            if !state.is_own_host(host_of(headers)) {
                return Err(ApiError::forbidden("the Host header is not this service's address"));
            }
            Ok(local.clone())
        }
        _ => Err(ApiError::unauthorized("send `Authorization: Bearer <token>`")),
    }
}

fn token_of(headers: &HeaderMap) -> Result<Option<&str>, ApiError> {
    if let Some(value) = headers.get(header::AUTHORIZATION) {
        let text = value.to_str().unwrap_or_default();
        return match text.split_once(' ') {
            Some((scheme, token)) if scheme.eq_ignore_ascii_case("bearer") => Ok(Some(token.trim())),
            _ => Err(ApiError::unauthorized(
                "the Authorization header is not `Bearer <token>`",
            )),
        };
    }
    let offered = headers
        .get_all(header::SEC_WEBSOCKET_PROTOCOL)
        .iter()
        .filter_map(|value| value.to_str().ok());
    Ok(offered
        .flat_map(|list| list.split(','))
        .find_map(|name| name.trim().strip_prefix(TOKEN_PROTOCOL_PREFIX)))
}

fn host_of(headers: &HeaderMap) -> &str {
    headers
        .get(header::HOST)
        .and_then(|value| value.to_str().ok())
        .unwrap_or_default()
}

fn is_websocket(headers: &HeaderMap) -> bool {
    headers
        .get(header::UPGRADE)
        .is_some_and(|value| value.as_bytes().eq_ignore_ascii_case(b"websocket"))
}

/// A browser names the page that makes it call; only our own pages may change something.
fn refuse_foreign_origin(state: &AppState, headers: &HeaderMap) -> Result<(), ApiError> {
    let Some(origin) = headers.get(header::ORIGIN) else {
        return Ok(());
    };
    let host = origin
        .to_str()
        .ok()
        .and_then(|text| text.strip_prefix("http://").or(text.strip_prefix("https://")));
    match host {
        Some(host) if state.is_own_host(host) || (state.local_user().is_none() && host == host_of(headers)) => Ok(()),
        _ => Err(ApiError::foreign_origin()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn head_counts_as_get_and_unknown_methods_are_told_apart_from_unknown_paths() {
        assert!(matches!(find(&Method::HEAD, "/api/v1/runs"), Found::Rule(rule) if rule.method == "GET"));
        assert!(matches!(find(&Method::DELETE, "/api/v1/runs"), Found::OtherMethod));
        assert!(matches!(find(&Method::GET, "/api/v1/secrets"), Found::Nothing));
    }

    #[test]
    fn the_table_has_no_route_twice_and_none_without_a_role() {
        for (index, rule) in RULES.iter().enumerate() {
            assert!(!rule.roles.is_empty(), "{} {}", rule.method, rule.path);
            assert!(
                !RULES[..index]
                    .iter()
                    .any(|other| other.method == rule.method && other.path == rule.path)
            );
        }
    }

    #[test]
    fn tokens_come_from_the_header_or_the_websocket_subprotocol() {
        let mut headers = HeaderMap::new();
        assert_eq!(token_of(&headers).ok().flatten(), None);
        headers.insert(
            header::SEC_WEBSOCKET_PROTOCOL,
            "robopheus, bearer.abc".parse().expect("ascii"),
        );
        assert_eq!(token_of(&headers).ok().flatten(), Some("abc"));
        headers.insert(header::AUTHORIZATION, "bearer xyz".parse().expect("ascii"));
        assert_eq!(token_of(&headers).ok().flatten(), Some("xyz"));
        headers.insert(header::AUTHORIZATION, "Basic eHl6".parse().expect("ascii"));
        assert!(token_of(&headers).is_err());
    }
}
