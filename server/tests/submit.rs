//! Submitting: what is accepted, and that everything else is refused with a reason and leaves nothing behind.

mod support;

use api::experiment::Experiment;
use reqwest::header::CONTENT_TYPE;
use reqwest::{Method, StatusCode};
use serde_json::{Value, json};
use support::{Service, laboratory, problem, submission, submission_of_four};

#[tokio::test]
async fn a_submission_is_stored_once_per_key() {
    let service = Service::start().await;
    service.register_lab().await;
    let send = |body: Value, key: &'static str| {
        service
            .call(Method::POST, "/experiments")
            .header("idempotency-key", key)
            .json(&body)
            .send()
    };
    let first = send(submission(), "a").await.expect("answer");
    assert_eq!(first.status(), StatusCode::CREATED);
    let location = first.headers()["location"].to_str().expect("ascii").to_owned();
    let first: Value = first.json().await.expect("JSON");
    assert_eq!(
        location,
        format!("/api/v1/experiments/{}", first["id"].as_str().expect("id"))
    );
    let document = |value: &Value| serde_json::from_value::<Experiment>(value.clone()).expect("experiment");
    assert_eq!(
        document(&first["experiment"]),
        document(&submission()["experiment"]),
        "it comes back as it was sent"
    );
    assert_eq!(first["submitted_by"], "local");

    let again = send(submission(), "a").await.expect("answer");
    assert_eq!(again.status(), StatusCode::OK);
    assert_eq!(again.json::<Value>().await.expect("JSON"), first);

    // The laboratory changed meanwhile: the repetition still gets its answer, a new submission the reason.
    let mut without_robots = laboratory();
    without_robots["robots"] = json!([]);
    service.lab("/lab/register", &without_robots).await;
    assert_eq!(send(submission(), "a").await.expect("answer").status(), StatusCode::OK);
    let refused = send(submission(), "c").await.expect("answer");
    assert_eq!(refused.status(), StatusCode::UNPROCESSABLE_ENTITY);
    service.register_lab().await;

    let mut other = submission();
    other["experiment"]["seed"] = json!(2);
    let conflict = send(other.clone(), "a").await.expect("answer");
    assert_eq!(conflict.status(), StatusCode::UNPROCESSABLE_ENTITY);
    assert_eq!(problem(conflict).await["code"], "idempotency_conflict");
    assert_eq!(send(other, "b").await.expect("answer").status(), StatusCode::CREATED);

    let runs = service.get("/runs").await;
    assert_eq!(runs["runs"].as_array().map(Vec::len), Some(2));
    let run = service
        .get(&format!("/runs/{}", first["run_id"].as_str().expect("id")))
        .await;
    assert_eq!(run["state"], "validating");
    assert_eq!(
        service.get("/experiments?limit=1").await.as_array().map(Vec::len),
        Some(1)
    );
    service.stop().await;
}

#[tokio::test]
async fn many_retries_at_once_make_one_run() {
    let service = Service::start().await;
    service.register_lab().await;
    let mut calls = tokio::task::JoinSet::new();
    for _ in 0..50 {
        calls.spawn(
            service
                .call(Method::POST, "/experiments")
                .header("idempotency-key", "k")
                .json(&submission())
                .send(),
        );
    }
    let (mut created, mut ids) = (0, Vec::new());
    while let Some(answer) = calls.join_next().await {
        let answer = answer.expect("task").expect("answer");
        created += i32::from(answer.status() == StatusCode::CREATED);
        ids.push(answer.json::<Value>().await.expect("JSON")["id"].clone());
    }
    ids.dedup();
    assert_eq!((created, ids.len()), (1, 1));
    assert_eq!(service.get("/runs").await["runs"].as_array().map(Vec::len), Some(1));
    service.stop().await;
}

/// A change to a good document that makes it bad.
struct Bad {
    what: &'static str,
    body: Value,
    field: &'static str,
}

fn changed(what: &'static str, field: &'static str, change: impl FnOnce(&mut Value)) -> Bad {
    let mut body = submission();
    change(&mut body["experiment"]);
    Bad { what, body, field }
}

fn rule_breakers() -> Vec<Bad> {
    let mut overlapping = submission_of_four();
    overlapping["experiment"]["robots"][1]["start"] = json!({"x_m": -1.2, "y_m": -0.7, "yaw_rad": 0.0});
    let mut envelope = submission();
    envelope["claim"] = json!({"digest": "XYZ", "twin_version": "twin-0", "engine": "browser"});
    let mut label = submission();
    label["label"] = json!("x".repeat(201));
    vec![
        Bad {
            what: "overlapping robots",
            body: overlapping,
            field: "robots[1].start",
        },
        Bad {
            what: "digest that is none",
            body: envelope,
            field: "claim.digest",
        },
        Bad {
            what: "long label",
            body: label,
            field: "label",
        },
        changed("negative duration", "duration_s", |e| e["duration_s"] = json!(-1.0)),
        changed("endless duration", "duration_s", |e| e["duration_s"] = json!(1e9)),
        changed("outside the arena", "robots[0].start.x_m", |e| {
            e["robots"][0]["start"]["x_m"] = json!(9.0)
        }),
        changed("51 robots", "robots", |e| {
            let robot = e["robots"][0].clone();
            e["robots"] = (0..51).map(|_| robot.clone()).collect();
        }),
        changed("no robots", "robots", |e| e["robots"] = json!([])),
        changed("unknown robot", "robots[0].name", |e| {
            e["robots"][0]["name"] = json!("nobody")
        }),
        changed("wrong chassis", "robots[0].chassis", |e| {
            e["robots"][0]["chassis"] = json!("diff2")
        }),
        changed("wrong controller", "robots[0].controller", |e| {
            e["robots"][0]["controller"] = json!("tx2")
        }),
        changed("unknown arena", "arena", |e| e["arena"] = json!("moon")),
        changed("unknown floor", "floor", |e| e["floor"] = json!("ice")),
        changed("unknown law", "control.law", |e| e["control"]["law"] = json!("magic")),
        changed("unknown model", "model", |e| e["model"] = json!("v7")),
        changed("other format", "format", |e| {
            e["format"] = json!("robopheus.experiment/2")
        }),
        changed("no targets", "targets", |e| e["targets"] = json!([])),
    ]
}

#[tokio::test]
async fn broken_rules_name_the_field_and_store_nothing() {
    let service = Service::start().await;
    service.register_lab().await;
    for bad in rule_breakers() {
        let response = service.submit(&bad.body).await;
        assert_eq!(response.status(), StatusCode::UNPROCESSABLE_ENTITY, "{}", bad.what);
        let problem = problem(response).await;
        assert_eq!(problem["code"], "invalid_experiment", "{}", bad.what);
        let errors = problem["errors"].as_array().expect("errors");
        let error = errors.iter().find(|error| error["field"] == bad.field);
        let error = error.unwrap_or_else(|| panic!("{}: no error for {} in {errors:?}", bad.what, bad.field));
        for key in ["message", "limit", "remedy"] {
            assert!(
                error[key].as_str().is_some_and(|text| !text.is_empty()),
                "{}: {key} of {error}",
                bad.what
            );
        }
    }
    assert_eq!(service.get("/experiments").await, json!([]));
    assert_eq!(service.get("/runs").await, json!({"runs": []}));
    service.stop().await;
}

#[tokio::test]
async fn unreadable_bodies_say_where_and_store_nothing() {
    let service = Service::start().await;
    service.register_lab().await;
    let good = submission().to_string();
    let cases = [
        (
            "unknown field",
            good.replace("\"floor\"", "\"flour\":1,\"floor\""),
            "flour",
        ),
        (
            "unknown field of a robot",
            good.replace("\"chassis\"", "\"chasis\":1,\"chassis\""),
            "robots[0].chasis",
        ),
        (
            "missing field",
            good.replace("\"seed\":1,", "").replace(",\"seed\":1", ""),
            "",
        ),
        (
            "NaN",
            good.replace("\"duration_s\":60", "\"duration_s\":NaN"),
            "duration_s",
        ),
        (
            "infinite number",
            good.replace("\"duration_s\":60", "\"duration_s\":1e999"),
            "duration_s",
        ),
        (
            "text for a number",
            good.replace("\"duration_s\":60", "\"duration_s\":\"60\""),
            "duration_s",
        ),
        ("negative seed", good.replace("\"seed\":1", "\"seed\":-1"), "seed"),
        ("cut off", good[..good.len() / 2].to_owned(), ""),
        ("two documents", format!("{good}{good}"), ""),
        ("empty", String::new(), ""),
        ("deep nesting", "[".repeat(100_000), ""),
    ];
    for (what, body, field) in cases {
        assert_ne!(body, good, "{what}: the change did not take");
        let request = service
            .call(Method::POST, "/experiments")
            .header(CONTENT_TYPE, "application/json");
        let response = request.body(body).send().await.expect("answer");
        assert_eq!(response.status(), StatusCode::BAD_REQUEST, "{what}");
        let problem = problem(response).await;
        assert_eq!(problem["code"], "malformed_request", "{what}");
        let error = &problem["errors"][0];
        if !field.is_empty() {
            assert_eq!(error["field"], field, "{what}: {error}");
        }
        let message = error["message"].as_str().unwrap_or_default();
        assert!(
            message.contains("line ") && message.contains("column "),
            "{what}: {error}"
        );
    }
    assert_eq!(service.get("/experiments").await, json!([]));
    service.stop().await;
}

#[tokio::test]
async fn type_size_and_parameters_are_checked() {
    let service = Service::start().await;
    service.register_lab().await;
    let expect = async |request: reqwest::RequestBuilder, status: u16, code: &str| {
        let response = request.send().await.expect("an answer, not a reset connection");
        assert_eq!(response.status().as_u16(), status, "{code}");
        let problem = problem(response).await;
        assert_eq!(problem["code"], code);
        problem
    };
    let post = || service.call(Method::POST, "/experiments");
    expect(post().body(submission().to_string()), 415, "unsupported_media_type").await;
    expect(
        post().header(CONTENT_TYPE, "text/plain").body(submission().to_string()),
        415,
        "unsupported_media_type",
    )
    .await;
    let ten_megabytes = format!("\"{}\"", "x".repeat(10_000_000));
    expect(
        post()
            .header(CONTENT_TYPE, "application/json")
            .body(ten_megabytes.clone()),
        413,
        "payload_too_large",
    )
    .await;
    expect(
        post().header(CONTENT_TYPE, "text/plain").body(ten_megabytes),
        415,
        "unsupported_media_type",
    )
    .await;
    expect(
        post().header("idempotency-key", "ä").json(&submission()),
        400,
        "malformed_request",
    )
    .await;

    let get = |path: &str| service.call(Method::GET, path);
    let unknown = "/runs/0199f3c0-1111-7000-8000-000000000000";
    expect(get(unknown), 404, "not_found").await;
    expect(get(&format!("{unknown}/archive")), 404, "not_found").await;
    expect(get(&format!("{unknown}/events")), 404, "not_found").await;
    expect(
        service.call(Method::POST, &format!("{unknown}/cancel")),
        404,
        "not_found",
    )
    .await;
    assert_eq!(
        expect(get("/runs/not-a-uuid"), 400, "malformed_request").await["errors"][0]["field"],
        "id"
    );
    expect(get("/experiments/%00"), 400, "malformed_request").await;
    expect(get("/runs/%ff"), 400, "malformed_request").await;
    for query in ["limit=0", "limit=501", "limit=x", "offset=3"] {
        expect(get(&format!("/runs?{query}")), 400, "malformed_request").await;
    }
    expect(get("/no/such/route"), 404, "not_found").await;
    let other_method = service.call(Method::DELETE, "/runs").send().await.expect("answer");
    assert!(other_method.headers().contains_key("allow"));
    assert_eq!(problem(other_method).await["code"], "method_not_allowed");
    assert_eq!(service.get("/experiments").await, json!([]));
    service.stop().await;
}

#[tokio::test]
async fn a_run_can_be_cancelled_once() {
    let service = Service::start().await;
    service.register_lab().await;
    let run = service.queued_run().await;
    let cancel = || service.call(Method::POST, &format!("/runs/{run}/cancel")).send();
    let cancelled: Value = cancel().await.expect("answer").json().await.expect("JSON");
    assert_eq!(cancelled["state"], "cancelled");
    let again = cancel().await.expect("answer");
    assert_eq!(again.status(), StatusCode::CONFLICT);
    assert_eq!(problem(again).await["code"], "run_ended");
    service.stop().await;
}
