//! The dashboard's files and the headers that stand on everything.

mod support;

use reqwest::{Method, StatusCode};
use support::Service;

#[tokio::test]
async fn pages_come_packed_typed_and_guarded() {
    let service = Service::start().await;
    let page = |path: &str| service.http.get(format!("{}{path}", service.base));
    let missing = page("/").send().await.expect("answer");
    assert_eq!(missing.status(), StatusCode::SERVICE_UNAVAILABLE);
    let text = missing.text().await.expect("text");
    assert!(
        text.contains("cargo xtask wasm") && text.contains("bundle/web_ui_bg.wasm"),
        "{text}"
    );

    let folder = service.folder.join("static");
    std::fs::create_dir_all(folder.join("bundle")).expect("folder");
    for (name, content) in [
        ("index.html", "<!doctype html>"),
        ("sim-worker.js", "// worker"),
        ("bundle/web_ui.js", "// ui"),
        ("bundle/web_ui_bg.wasm", "wasm"),
        ("bundle/web_ui_bg.wasm.br", "packed with brotli"),
        ("bundle/web_ui_bg.wasm.gz", "packed with gzip"),
        (".secret", "no"),
    ] {
        std::fs::write(folder.join(name), content).expect("page");
    }
    let index = page("/").send().await.expect("answer");
    assert_eq!(index.headers()["content-type"], "text/html; charset=utf-8");
    assert_eq!(index.headers()["cache-control"], "no-cache");
    let etag = index.headers()["etag"].clone();
    assert_eq!(
        page("/")
            .header("if-none-match", etag)
            .send()
            .await
            .expect("answer")
            .status(),
        StatusCode::NOT_MODIFIED
    );
    for (accepts, encoding, body) in [
        ("gzip, br", Some("br"), "packed with brotli"),
        ("gzip", Some("gzip"), "packed with gzip"),
        ("identity", None, "wasm"),
    ] {
        let wasm = page("/bundle/web_ui_bg.wasm")
            .header("accept-encoding", accepts)
            .send()
            .await
            .expect("answer");
        assert_eq!(wasm.headers()["content-type"], "application/wasm");
        assert_eq!(wasm.headers()["vary"], "accept-encoding");
        assert_eq!(
            wasm.headers()
                .get("content-encoding")
                .and_then(|value| value.to_str().ok()),
            encoding
        );
        assert_eq!(wasm.text().await.expect("text"), body);
    }
    assert_eq!(
        page("/sim-worker.js").send().await.expect("answer").headers()["content-type"],
        "text/javascript; charset=utf-8"
    );
    for path in [
        "/.secret",
        "/bundle",
        "/bundle/",
        "/nothing.js",
        "/%2e%2e/tokens/operator",
        "/..%2ftokens%2foperator",
        "/%2fetc%2fpasswd",
    ] {
        assert_eq!(
            page(path).send().await.expect("answer").status(),
            StatusCode::NOT_FOUND,
            "{path}"
        );
    }
    let posted = service
        .http
        .post(format!("{}/", service.base))
        .send()
        .await
        .expect("answer");
    assert_eq!(posted.status(), StatusCode::NOT_FOUND);
    service.stop().await;
}

#[tokio::test]
async fn every_answer_carries_the_security_headers() {
    let service = Service::start().await;
    let paths = [
        "/",
        "/nothing",
        "/api/v1/health",
        "/api/v1/nothing",
        "/api/v1/runs/x",
        "/api/v1/lab/claim",
        "/api/v1/docs/",
        "/api/v1/openapi.json",
    ];
    for path in paths {
        for method in [Method::GET, Method::POST, Method::HEAD, Method::OPTIONS] {
            let request = service.http.request(method.clone(), format!("{}{path}", service.base));
            let response = request.send().await.expect("answer");
            let policy = response.headers()["content-security-policy"].to_str().expect("ascii");
            assert!(
                policy.starts_with("default-src 'none'; script-src 'self' 'wasm-unsafe-eval';"),
                "{method} {path}"
            );
            assert_eq!(
                response.headers()["x-content-type-options"],
                "nosniff",
                "{method} {path}"
            );
            assert_eq!(response.headers()["referrer-policy"], "no-referrer", "{method} {path}");
            assert!(
                !response.headers().contains_key("access-control-allow-origin"),
                "{method} {path}"
            );
        }
    }
    let docs = service
        .http
        .get(format!("{}/api/v1/docs", service.base))
        .send()
        .await
        .expect("answer");
    let page = docs.text().await.expect("text");
    assert!(page.contains("swagger-ui"), "the redirect leads to the page");
    assert!(
        !page.contains("<script>"),
        "an inline script would be stopped by the policy"
    );
    service.stop().await;
}
