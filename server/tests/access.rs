//! Who may call what: every route of the OpenAPI document, every kind of caller.

mod support;

use reqwest::{Method, StatusCode};
use serde_json::Value;
use server::access::RULES;
use store::Role;
use support::{Options, Service, eventually, problem, submission};

/// `(method, path as in the access table)` of every operation in the document.
fn documented() -> Vec<(String, String)> {
    let document: Value = serde_json::from_str(server::openapi::text()).expect("JSON");
    assert_eq!(document["openapi"].as_str().map(|version| &version[..3]), Some("3.1"));
    let mut found = Vec::new();
    for (path, operations) in document["paths"].as_object().expect("paths") {
        for method in operations.as_object().expect("operations").keys() {
            found.push((method.to_uppercase(), path.replace("{name}", "{*name}")));
        }
    }
    found
}

#[test]
fn the_document_and_the_table_list_the_same_routes() {
    let documented = documented();
    for (method, path) in &documented {
        assert!(
            RULES.iter().any(|rule| rule.method == method && rule.path == path),
            "{method} {path} has no entry in the table"
        );
    }
    for rule in RULES.iter().filter(|rule| !rule.path.starts_with("/api/v1/docs")) {
        let is_documented = documented
            .iter()
            .any(|(method, path)| method == rule.method && path == rule.path);
        assert!(
            is_documented,
            "{} {} is not in the OpenAPI document",
            rule.method, rule.path
        );
    }
}

#[tokio::test]
async fn every_route_refuses_whoever_lacks_the_role() {
    let service = Service::start_with(Options {
        allow_remote: true,
        ..Options::default()
    })
    .await;
    let mut checked = 0;
    for rule in RULES {
        let path = rule
            .path
            .replace("{id}", "0199f3c0-1111-7000-8000-000000000000")
            .replace("{*name}", "a.txt")
            .replace("{*rest}", "x");
        let method: Method = rule.method.parse().expect("method");
        let send = async |token: Option<&str>| {
            let request = service.http.request(method.clone(), format!("{}{path}", service.base));
            let request = match token {
                Some(token) => request.bearer_auth(token),
                None => request,
            };
            request.send().await.expect("answer")
        };
        for token in [None, Some("rph_00000000000000000000000000000000"), Some("")] {
            let response = send(token).await;
            assert_eq!(
                response.status(),
                StatusCode::UNAUTHORIZED,
                "{} {} with {token:?}",
                rule.method,
                rule.path
            );
            assert_eq!(response.headers()["www-authenticate"], "Bearer");
            assert_eq!(problem(response).await["code"], "unauthorized");
            checked += 1;
        }
        for role in Role::ALL {
            let response = send(Some(&service.token(role))).await;
            let refused = [StatusCode::UNAUTHORIZED, StatusCode::FORBIDDEN].contains(&response.status());
            assert_eq!(
                !refused,
                rule.roles.contains(&role),
                "{} {} as {}",
                rule.method,
                rule.path,
                role.as_str()
            );
            if refused {
                assert_eq!(problem(response).await["code"], "forbidden");
            }
            checked += 1;
        }
    }
    println!("{checked} refusals and admissions as the table says");
    assert_eq!(checked, RULES.len() * 7);
    service.stop().await;
}

#[tokio::test]
async fn the_person_at_this_machine_needs_no_token_and_is_no_laboratory() {
    let service = Service::start().await;
    for rule in RULES.iter().filter(|rule| rule.path.starts_with("/api/v1/lab/")) {
        let path = rule
            .path
            .replace("{id}", "0199f3c0-1111-7000-8000-000000000000")
            .replace("{*name}", "a.txt");
        let request = service
            .http
            .request(rule.method.parse().expect("method"), format!("{}{path}", service.base));
        assert_eq!(
            request.send().await.expect("answer").status(),
            StatusCode::FORBIDDEN,
            "{} {}",
            rule.method,
            rule.path
        );
    }
    service.get("/runs").await;
    for role in Role::ALL {
        use std::os::unix::fs::PermissionsExt as _;
        let path = service.folder.join("tokens").join(role.as_str());
        assert_eq!(
            std::fs::metadata(path).expect("token").permissions().mode() & 0o777,
            0o600
        );
    }
    service.stop().await;
}

#[tokio::test]
async fn pages_of_another_origin_change_nothing() {
    let service = Service::start().await;
    service.register_lab().await;
    for origin in [
        "http://evil.example",
        "null",
        "http://127.0.0.1:1",
        "https://localhost.evil.example",
    ] {
        for rule in RULES
            .iter()
            .filter(|rule| rule.method != "GET" && !rule.path.contains("/lab/"))
        {
            let path = rule.path.replace("{id}", "0199f3c0-1111-7000-8000-000000000000");
            let request = service
                .http
                .request(rule.method.parse().expect("method"), format!("{}{path}", service.base));
            let response = request
                .header("origin", origin)
                .json(&submission())
                .send()
                .await
                .expect("answer");
            assert_eq!(
                response.status(),
                StatusCode::FORBIDDEN,
                "{origin} {} {}",
                rule.method,
                rule.path
            );
            assert_eq!(problem(response).await["code"], "foreign_origin");
        }
        let socket = service.call(Method::GET, "/runs/0199f3c0-1111-7000-8000-000000000000/live");
        let socket = socket
            .header("origin", origin)
            .header("upgrade", "websocket")
            .header("connection", "upgrade");
        assert_eq!(
            problem(socket.send().await.expect("answer")).await["code"],
            "foreign_origin"
        );
    }
    assert_eq!(service.get("/runs").await["runs"].as_array().map(Vec::len), Some(0));
    let own = service
        .call(Method::POST, "/experiments")
        .header("origin", &service.base)
        .json(&submission());
    assert_eq!(own.send().await.expect("answer").status(), StatusCode::CREATED);
    let rebound = service
        .call(Method::GET, "/runs")
        .header("host", "evil.example")
        .send()
        .await
        .expect("answer");
    assert_eq!(rebound.status(), StatusCode::FORBIDDEN);
    service.stop().await;
}

#[tokio::test]
async fn somebody_elses_run_does_not_exist() {
    let service = Service::start().await;
    service.register_lab().await;
    let run = service.queued_run().await;
    let mallory = service.store.token_create(Role::User, "mallory").await.expect("token");
    for (method, path) in [
        (Method::GET, ""),
        (Method::GET, "/archive"),
        (Method::GET, "/files/replay.json"),
        (Method::GET, "/events"),
        (Method::POST, "/cancel"),
    ] {
        let foreign = service
            .call(method.clone(), &format!("/runs/{run}{path}"))
            .bearer_auth(&mallory)
            .send()
            .await
            .expect("answer");
        assert_eq!(foreign.status(), StatusCode::NOT_FOUND, "{method} {path}");
    }
    let list: Value = service
        .call(Method::GET, "/runs")
        .bearer_auth(&mallory)
        .send()
        .await
        .expect("answer")
        .json()
        .await
        .expect("JSON");
    assert_eq!(list["runs"], serde_json::json!([]));
    assert_eq!(
        service.get(&format!("/runs/{run}")).await["state"],
        "queued",
        "still there, not cancelled"
    );
    service.store.token_revoke(&mallory).await.expect("revoked");
    let revoked = service
        .call(Method::GET, "/runs")
        .bearer_auth(&mallory)
        .send()
        .await
        .expect("answer");
    assert_eq!(revoked.status(), StatusCode::UNAUTHORIZED);
    service.stop().await;
}

#[tokio::test]
async fn a_database_outage_is_told_and_heals() {
    let mut service = Service::start_with(Options {
        private_database: true,
        ..Options::default()
    })
    .await;
    assert_eq!(service.get("/health").await["database_reachable"], true);
    service.database.cluster.as_mut().expect("private").kill();
    let response = service.call(Method::GET, "/runs").send().await.expect("answer");
    assert_eq!(response.status(), StatusCode::SERVICE_UNAVAILABLE);
    assert!(response.headers().contains_key("retry-after"));
    assert_eq!(problem(response).await["code"], "database_unavailable");
    let health = service.get("/health").await;
    assert_eq!(
        (&health["status"], &health["database_reachable"]),
        (&"degraded".into(), &false.into())
    );
    service.database.cluster.as_mut().expect("private").resume();
    eventually("the database's return", || async {
        let response = service.call(Method::GET, "/runs").send().await.expect("answer");
        (response.status() == StatusCode::OK).then_some(())
    })
    .await;
    service.stop().await;
}
