//! What a laboratory does with a run, and what comes of it for the person who waits.

mod support;

use futures_util::{SinkExt as _, StreamExt as _};
use reqwest::{Method, StatusCode};
use serde_json::{Value, json};
use std::time::{Duration, Instant};
use store::Role;
use support::{Attempt, Service, eventually, id, problem, sha256};
use tokio_tungstenite::tungstenite::Message;
use tokio_tungstenite::tungstenite::client::IntoClientRequest as _;
use tokio_tungstenite::{MaybeTlsStream, WebSocketStream, connect_async};
use uuid::Uuid;

type Socket = WebSocketStream<MaybeTlsStream<tokio::net::TcpStream>>;

async fn socket(service: &Service, path: &str, token: Option<String>) -> Socket {
    let address = format!("{}/api/v1{path}", service.base.replace("http://", "ws://"));
    let mut request = address.into_client_request().expect("address");
    if let Some(token) = token {
        request
            .headers_mut()
            .insert("authorization", format!("Bearer {token}").parse().expect("ascii"));
    }
    connect_async(request).await.expect("handshake").0
}

fn frame(attempt: &Attempt, epoch: i64, tick: i64) -> Message {
    let robot = json!({"name": "omni-01", "x_m": 0.1, "y_m": 0.2, "yaw_rad": 0.3, "target_x_m": 1.0, "target_y_m": 1.0,
        "pose_age_ms": 8.0, "link_age_ms": 4.0, "bus_v": 24.1, "safety": null});
    let frame = json!({"run_id": attempt.run, "epoch": epoch, "tick": tick, "time_s": 0.5, "robots": [robot], "ticks_missed": 0});
    Message::text(frame.to_string())
}

/// The next text, skipping pings; nothing when the other side closed.
async fn text(socket: &mut Socket) -> Option<Value> {
    loop {
        match tokio::time::timeout(Duration::from_secs(10), socket.next())
            .await
            .expect("in time")?
        {
            Ok(Message::Text(text)) => return serde_json::from_str(&text).ok(),
            Ok(Message::Close(_)) | Err(_) => return None,
            Ok(_) => {}
        }
    }
}

#[tokio::test]
async fn a_run_goes_through_the_laboratory_and_comes_back_as_an_archive() {
    let service = Service::start().await;
    service.register_lab().await;
    let run = service.queued_run().await;
    let attempt = service.claim().await;
    assert_eq!(attempt.run, run);
    assert_eq!(service.get(&format!("/runs/{run}")).await["state"], "preparing");

    let mut watcher = socket(&service, &format!("/runs/{run}/live"), None).await;
    let mut lab = socket(&service, "/lab/stream", Some(service.token(Role::Lab))).await;
    lab.send(Message::text("not a frame")).await.expect("sent");
    lab.send(frame(&attempt, attempt.epoch, 1)).await.expect("sent");
    lab.send(frame(&attempt, attempt.epoch - 1, 2)).await.expect("sent");
    lab.send(frame(&attempt, attempt.epoch, 3)).await.expect("sent");
    assert_eq!(text(&mut watcher).await.expect("frame")["tick"], 1);
    assert_eq!(
        text(&mut watcher).await.expect("frame")["tick"],
        3,
        "the frame of the old epoch is dropped"
    );

    assert_eq!(service.report(&attempt, "running").await["state"], "running");
    let beat = json!({"epoch": attempt.epoch, "instance": attempt.instance});
    let reply = service.lab(&format!("/lab/runs/{run}/heartbeat"), &beat).await;
    assert_eq!(reply, json!({"lease_s": 15.0, "cancel_requested": false}));
    let early = service
        .call(Method::GET, &format!("/runs/{run}/archive"))
        .send()
        .await
        .expect("answer");
    assert_eq!(problem(early).await["code"], "archive_not_ready");

    service.report(&attempt, "uploading").await;
    service
        .put_ok(&attempt, "robots/omni-01/telemetry.parquet", &[7; 300_000])
        .await;
    service.put_ok(&attempt, "log.txt", b"a log").await;
    service.put_ok(&attempt, "log.txt", b"a longer log").await;
    service.put_ok(&attempt, "track.json", b"{}").await;
    service
        .put_ok(&attempt, "manifest.json", b"{\"complete\":true,\"files\":[]}")
        .await;
    let done = service.report(&attempt, "done").await;
    assert_eq!(done["state"], "done");
    assert_eq!(text(&mut watcher).await, None, "watchers are let go");
    check_archive(&service, run).await;
    check_file(&service, run).await;

    let sealed = service
        .put(&attempt, "log.txt", b"another log", &sha256(b"another log"))
        .await;
    assert_eq!(sealed.status(), StatusCode::CONFLICT);
    assert_eq!(problem(sealed).await["code"], "file_sealed");
    let log = service
        .call(Method::GET, &format!("/runs/{run}/files/log.txt"))
        .send()
        .await
        .expect("answer");
    assert_eq!(log.text().await.expect("text"), "a longer log");
    service.stop().await;
}

async fn check_archive(service: &Service, run: Uuid) {
    let path = format!("/runs/{run}/archive");
    let whole = service.call(Method::GET, &path).send().await.expect("answer");
    assert_eq!(whole.status(), StatusCode::OK);
    let headers = whole.headers().clone();
    assert_eq!(headers["content-type"], "application/zip");
    assert!(
        headers["content-disposition"]
            .to_str()
            .expect("ascii")
            .starts_with("attachment")
    );
    let bytes = whole.bytes().await.expect("bytes");
    let etag = headers["etag"].to_str().expect("ascii").to_owned();
    assert_eq!(etag, format!("\"{}\"", sha256(&bytes)));
    let mut zip = zip::ZipArchive::new(std::io::Cursor::new(bytes.clone())).expect("a zip");
    let names: Vec<_> = (0..zip.len())
        .map(|i| zip.by_index(i).expect("member").name().expect("name").into_owned())
        .collect();
    assert_eq!(
        names,
        ["manifest.json", "log.txt", "robots/omni-01/telemetry.parquet"],
        "without the page's own files"
    );

    // Fifty interrupted downloads give the same bytes.
    let mut pieces = Vec::new();
    let step = bytes.len() / 50 + 1;
    while pieces.len() < bytes.len() {
        let last = (pieces.len() + step - 1).min(bytes.len() + 5);
        let request = service
            .call(Method::GET, &path)
            .header("range", format!("bytes={}-{last}", pieces.len()));
        let part = request.header("if-range", &etag).send().await.expect("answer");
        assert_eq!(part.status(), StatusCode::PARTIAL_CONTENT);
        pieces.extend_from_slice(&part.bytes().await.expect("bytes"));
    }
    assert_eq!(sha256(&pieces), sha256(&bytes));

    let get = |name: &'static str, value: String| service.call(Method::GET, &path).header(name, value).send();
    let beyond = get("range", format!("bytes={}-", bytes.len())).await.expect("answer");
    assert_eq!(beyond.status(), StatusCode::RANGE_NOT_SATISFIABLE);
    assert_eq!(beyond.headers()["content-range"], format!("bytes */{}", bytes.len()));
    assert_eq!(problem(beyond).await["code"], "range_not_satisfiable");
    assert_eq!(
        get("if-none-match", etag).await.expect("answer").status(),
        StatusCode::NOT_MODIFIED
    );
    let changed = service
        .call(Method::GET, &path)
        .header("range", "bytes=5-")
        .header("if-range", "\"other\"");
    assert_eq!(changed.send().await.expect("answer").status(), StatusCode::OK);
    let head = service.call(Method::HEAD, &path).send().await.expect("answer");
    assert_eq!(head.headers()["content-length"], bytes.len().to_string());
    assert_eq!(head.bytes().await.expect("bytes").len(), 0);
}

async fn check_file(service: &Service, run: Uuid) {
    let path = format!("/runs/{run}/files/robots/omni-01/telemetry.parquet");
    let file = service
        .call(Method::GET, &path)
        .header("range", "bytes=-4")
        .send()
        .await
        .expect("answer");
    assert_eq!(file.status(), StatusCode::PARTIAL_CONTENT);
    assert_eq!(
        file.headers()["content-disposition"],
        "attachment; filename=\"telemetry.parquet\""
    );
    assert_eq!(file.headers()["x-content-type-options"], "nosniff");
    assert_eq!(file.bytes().await.expect("bytes").as_ref(), [7; 4]);
    let missing = service
        .call(Method::GET, &format!("/runs/{run}/files/../../etc/passwd"))
        .send()
        .await
        .expect("answer");
    assert_eq!(missing.status(), StatusCode::NOT_FOUND);
    // One flipped bit on disk is noticed before anything is sent.
    let record = service
        .store
        .run_file_get(run, "robots/omni-01/telemetry.parquet")
        .await
        .expect("store")
        .expect("there");
    let stored = service.folder.join("objects").join(record.object_path);
    let mut bytes = std::fs::read(&stored).expect("stored");
    bytes[1000] ^= 1;
    std::fs::write(&stored, &bytes).expect("damaged");
    let damaged = service.call(Method::GET, &path).send().await.expect("answer");
    assert_eq!(damaged.status(), StatusCode::INTERNAL_SERVER_ERROR);
    assert_eq!(problem(damaged).await["code"], "stored_file_corrupt");
}

#[tokio::test]
async fn uploads_are_checked_before_they_count() {
    let service = Service::start().await;
    service.register_lab().await;
    service.queued_run().await;
    let attempt = service.claim().await;
    let wrong = service
        .put(&attempt, "log.txt", b"a log", &sha256(b"another log"))
        .await;
    assert_eq!(wrong.status(), StatusCode::UNPROCESSABLE_ENTITY);
    assert_eq!(problem(wrong).await["code"], "hash_mismatch");
    let none = service.put(&attempt, "log.txt", b"a log", "").await;
    assert_eq!(problem(none).await["errors"][0]["field"], "x-content-sha256");
    for name in [
        "..%2f..%2fetc%2fpasswd",
        "%2fetc%2fpasswd",
        "a%5cb",
        "archive.zip",
        ".hidden",
        "a%00b",
        "%C3%BC.txt",
    ] {
        let refused = service.put(&attempt, name, b"x", &sha256(b"x")).await;
        assert_eq!(refused.status(), StatusCode::UNPROCESSABLE_ENTITY, "{name}");
        assert_eq!(problem(refused).await["code"], "invalid_file", "{name}");
    }
    let stale = Attempt {
        epoch: attempt.epoch - 1,
        ..attempt
    };
    let refused = service.put(&stale, "log.txt", b"a log", &sha256(b"a log")).await;
    assert_eq!(refused.status(), StatusCode::CONFLICT);
    assert_eq!(problem(refused).await["code"], "stale_epoch");
    let path = format!("/lab/runs/{}", attempt.run);
    let old = json!({"epoch": stale.epoch, "instance": attempt.instance, "state": "running"});
    let beat = json!({"epoch": stale.epoch, "instance": attempt.instance});
    let fault = json!({"whose": "platform", "code": "lab_restarted", "message": "The laboratory was restarted."});
    let salvage = json!({"epoch": stale.epoch, "fault": fault});
    for (what, body) in [("state", old), ("heartbeat", beat), ("salvage", salvage)] {
        let answer = service
            .as_role(Role::Lab, Method::POST, &format!("{path}/{what}"))
            .json(&body)
            .send()
            .await
            .expect("answer");
        assert_eq!(answer.status(), StatusCode::CONFLICT, "{what}");
        assert_eq!(problem(answer).await["code"], "stale_epoch", "{what}");
    }
    assert_eq!(
        service.get(&format!("/runs/{}", attempt.run)).await["state"],
        "preparing"
    );
    let left = std::fs::read_dir(service.folder.join("objects/tmp"))
        .expect("folder")
        .count();
    assert_eq!(left, 0, "refused uploads leave nothing behind");
    service.stop().await;
}

#[tokio::test]
async fn what_a_crash_left_can_still_be_had() {
    let service = Service::start().await;
    service.register_lab().await;
    let run = service.queued_run().await;
    let attempt = service.claim().await;
    service.report(&attempt, "running").await;
    let fault = json!({"whose": "platform", "code": "lab_restarted", "message": "The laboratory was restarted."});
    let ended = service
        .lab(
            &format!("/lab/runs/{run}/salvage"),
            &json!({"epoch": attempt.epoch, "fault": fault}),
        )
        .await;
    assert_eq!(ended["state"], "interrupted");
    assert_eq!(ended["fault"], fault);
    service.put_ok(&attempt, "log.txt", b"the first half").await;
    let archive = service
        .call(Method::GET, &format!("/runs/{run}/archive"))
        .send()
        .await
        .expect("answer");
    assert_eq!(archive.status(), StatusCode::OK);
    let first = archive.headers()["etag"].clone();
    service
        .put_ok(&attempt, "manifest.json", b"{\"complete\":false,\"files\":[]}")
        .await;
    let archive = service
        .call(Method::GET, &format!("/runs/{run}/archive"))
        .send()
        .await
        .expect("answer");
    assert_ne!(
        archive.headers()["etag"],
        first,
        "files that come later are in the archive"
    );
    service.stop().await;
}

#[tokio::test]
async fn a_waiting_laboratory_is_woken_by_a_new_run() {
    let service = Service::start().await;
    service.register_lab().await;
    let empty = json!({"lab": "reference-lab", "arena": "reference", "instance": Uuid::now_v7(), "wait_s": 0.0});
    assert_eq!(service.lab("/lab/claim", &empty).await, Value::Null);
    let (run, attempt) = tokio::join!(service.queue_run(), service.claim());
    assert_eq!(run, attempt.run);
    let begun = Instant::now();
    let patient = json!({"lab": "reference-lab", "arena": "reference", "instance": Uuid::now_v7(), "wait_s": 1.0});
    assert_eq!(service.lab("/lab/claim", &patient).await, Value::Null);
    assert!(
        begun.elapsed() >= Duration::from_millis(900),
        "waited {:?}",
        begun.elapsed()
    );
    for wait_s in ["-1", "1e300", "null"] {
        let body = format!(
            "{{\"lab\":\"x\",\"arena\":\"reference\",\"instance\":\"{}\",\"wait_s\":{wait_s}}}",
            Uuid::nil()
        );
        let request = service
            .as_role(Role::Lab, Method::POST, "/lab/claim")
            .header("content-type", "application/json");
        let status = request.body(body).send().await.expect("answer").status();
        assert!(status.is_client_error(), "{wait_s}: {status}");
    }
    service.stop().await;
}

#[tokio::test]
async fn events_tell_each_change() {
    let service = Service::start().await;
    service.register_lab().await;
    let run = service.queued_run().await;
    let response = service
        .call(Method::GET, &format!("/runs/{run}/events"))
        .send()
        .await
        .expect("answer");
    assert_eq!(response.headers()["content-type"], "text/event-stream");
    let mut chunks = response.bytes_stream();
    let mut seen = String::new();
    let mut state_after = async |wanted: &str| {
        eventually_contains(&mut chunks, &mut seen, &format!("\"state\":\"{wanted}\"")).await;
    };
    state_after("queued").await;
    let attempt = service.claim().await;
    state_after("preparing").await;
    service.report(&attempt, "running").await;
    state_after("running").await;
    let health = eventually("the laboratory", || async {
        let health = service.get("/health").await;
        (health["lab_connected"] == true).then_some(health)
    })
    .await;
    assert_eq!(health["twin_version"], twin::VERSION);
    service.stop().await;
}

async fn eventually_contains<S, B, E>(chunks: &mut S, seen: &mut String, wanted: &str)
where
    S: futures_util::Stream<Item = Result<B, E>> + Unpin,
    B: AsRef<[u8]>,
    E: std::fmt::Debug,
{
    while !seen.contains(wanted) {
        let chunk = tokio::time::timeout(Duration::from_secs(5), chunks.next()).await;
        let chunk = chunk
            .unwrap_or_else(|_| panic!("no event with {wanted}"))
            .expect("open")
            .expect("bytes");
        seen.push_str(&String::from_utf8_lossy(chunk.as_ref()));
    }
}

#[tokio::test]
async fn a_version_that_was_learned_in_a_run_is_kept_and_not_used_by_itself() {
    let service = Service::start().await;
    service.register_lab().await;
    let run = service.queued_run().await;
    let lab = support::laboratory();
    let robots = lab["robots"].as_array().expect("robots");
    let description = |name: &str| {
        let robot = robots
            .iter()
            .find(|robot| robot["name"] == name || robot["description"]["name"] == name);
        robot.expect("a robot")["description"].clone()
    };
    let floor = service.get(&format!("/runs/{run}")).await["experiment"]["floor"].clone();
    let document = |robot: &str, floor: &Value, parent: Value, note: u32| {
        let draft = json!({"format": "robopheus.model/1", "id": "", "parent": parent, "robot": description(robot), "floor": floor,
            "effects": [], "residual": null, "provenance": {"note": note}});
        let made = twin::model_document::ModelDocument::parse(&draft.to_string()).expect("a model");
        serde_json::to_value(made).expect("JSON")
    };
    let path = format!("/lab/runs/{run}/models");
    let first = document("omni-01", &floor, Value::Null, 1);
    let stored = service
        .lab(&path, &json!({"robot": "omni-01", "document": first}))
        .await;
    assert_eq!(stored["version"], "omni-01/1");
    assert_eq!(
        (&stored["parent"], &stored["is_current"]),
        (&Value::Null, &json!(false))
    );
    let again = service
        .lab(&path, &json!({"robot": "omni-01", "document": first}))
        .await;
    assert_eq!(again["id"], stored["id"], "the same document is the same version");
    let child = document("omni-01", &floor, first["id"].clone(), 2);
    let child = service
        .lab(&path, &json!({"robot": "omni-01", "document": child}))
        .await;
    assert_eq!(
        (&child["version"], &child["parent"]),
        (&json!("omni-01/2"), &json!("omni-01/1"))
    );
    assert_eq!(service.get("/robots/omni-01/model").await["model"], Value::Null);
    let mut changed = first.clone();
    changed["provenance"]["note"] = json!(7);
    let refused = [
        (
            "another robot's",
            "omni-01",
            document("diff-01", &floor, Value::Null, 3),
        ),
        (
            "one that was not in the run",
            "diff-01",
            document("diff-01", &floor, Value::Null, 3),
        ),
        (
            "another floor",
            "omni-01",
            document("omni-01", &json!("moon"), Value::Null, 3),
        ),
        (
            "no such parent",
            "omni-01",
            document("omni-01", &floor, json!("0".repeat(64)), 3),
        ),
        ("changed after it was made", "omni-01", changed),
        ("no model", "omni-01", json!({"format": "robopheus.model/1"})),
    ];
    for (what, robot, document) in refused {
        let answer = service
            .as_role(Role::Lab, Method::POST, &path)
            .json(&json!({"robot": robot, "document": document}))
            .send()
            .await
            .expect("answer");
        assert_eq!(answer.status(), StatusCode::UNPROCESSABLE_ENTITY, "{what}");
        assert_eq!(problem(answer).await["code"], "invalid_model", "{what}");
    }
    let models = service.get("/models?robot=omni-01").await;
    assert_eq!(models.as_array().map(Vec::len), Some(2));
    let bare = format!("/models/{}/onnx", id(&stored["id"]));
    let answer = service.call(Method::GET, &bare).send().await.expect("answer");
    assert_eq!(answer.status(), StatusCode::NOT_FOUND, "it has no residual");
    let residual = json!({"format": "robopheus.residual/1", "fade": 0.25,
        "inputs": [{"name": "forward_m_per_s", "mean": 0.0, "scale": 0.5, "low": -1.0, "high": 1.0}],
        "layers": [{"weights": [-0.4], "bias": [0.1], "activation": "linear"}],
        "outputs": [{"name": "acceleration_forward_m_per_s2", "scale": 1.0, "limit": 2.0}]});
    let mut carrying = document("omni-01", &floor, Value::Null, 4);
    (carrying["id"], carrying["residual"]) = (json!(""), residual);
    let carrying = service
        .lab(&path, &json!({"robot": "omni-01", "document": carrying}))
        .await;
    let path = format!("/models/{}/onnx", id(&carrying["id"]));
    let answer = service.call(Method::GET, &path).send().await.expect("answer");
    assert_eq!(
        answer.headers()["content-disposition"],
        "attachment; filename=\"omni-01-3.onnx\""
    );
    let file = learn::onnx::parse(&answer.bytes().await.expect("bytes")).expect("an ONNX file");
    assert!(file.graph.is_some_and(|graph| !graph.node.is_empty()));
    let elsewhere = service.get("/models?robot=omni-01&floor=moon").await;
    assert_eq!(elsewhere, json!([]));
    service.stop().await;
}
