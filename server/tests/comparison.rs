//! Two model versions on a stored run over HTTP: the figures, and what is refused.

#[path = "../../scheduler/tests/support/recorded.rs"]
mod recorded;
mod support;

use recorded::{Recipe, description, done_run};
use reqwest::{Method, StatusCode};
use serde_json::{Value, json};
use support::{Service, problem};
use twin::effect::Effect;
use twin::model_document::ModelDocument;
use twin::robot::RobotDescription;
use uuid::Uuid;

const ROBOT: &str = "omni-03";
/// Wheels larger than described.
const HIDDEN: &str = r#"[{"name": "wheel_radius", "index": null, "parameters": {"relative": 0.04}}]"#;

async fn compare(service: &Service, body: &Value) -> reqwest::Response {
    let call = service.call(Method::POST, "/models/compare").json(body);
    call.send().await.expect("answer")
}

/// Stores a version with wheels larger by a share.
async fn version(service: &Service, robot: RobotDescription, floor: &str, larger: f64) -> String {
    let name = robot.name.clone();
    let effect = Effect::new("wheel_radius", &[("relative", larger)]);
    let document = ModelDocument::new(None, robot, floor, vec![effect], json!({}));
    let document = serde_json::to_value(document).expect("JSON");
    let stored = service.store.model_put(&name, floor, None, &document).await;
    let view = service.store.model_get(stored.expect("stored")).await.expect("found");
    view.expect("a model").version
}

#[tokio::test]
async fn the_version_with_the_effect_is_nearer_than_the_nominal_twin_and_figures_have_units() {
    let service = Service::start().await;
    service.register_lab().await;
    let recipe = Recipe {
        robot: ROBOT,
        label: "new tyres",
        effects: HIDDEN,
        duration_s: 25.0,
        seed: 3,
    };
    let run = done_run(&service.store, &service.folder, &recipe).await;
    let right = version(&service, description(ROBOT), "lab-floor", 0.04).await;
    // Another robot of the kind, on another floor: a version may be tried on any run.
    let mut other = description(ROBOT);
    other.name = "omni-02".to_owned();
    let wrong = version(&service, other, "moon", -0.04).await;

    let body = json!({"robot": ROBOT, "run": run, "first": "nominal", "second": right});
    let response = compare(&service, &body).await;
    assert_eq!(response.status(), StatusCode::OK);
    let found: Value = response.json().await.expect("JSON");
    assert_eq!(
        (&found["nearer"], &found["label"], &found["floor"]),
        (&json!("second"), &json!("new tyres"), &json!("lab-floor"))
    );
    assert_eq!(
        (&found["first"]["id"], &found["second"]["version"]),
        (&Value::Null, &json!(right))
    );
    let row = |channel: &str, horizon_s: f64| {
        let rows = found["rows"].as_array().expect("rows");
        let row = rows
            .iter()
            .find(|row| row["channel"] == channel && row["horizon_s"] == horizon_s);
        row.cloned()
            .unwrap_or_else(|| panic!("no {channel} {horizon_s} s ahead in {found}"))
    };
    let pose = row("pose", 2.0);
    let [far_m, near_m] = ["first", "second"].map(|side| pose[side].as_f64().expect("a figure"));
    // 4 % of 0.4 m/s over 2 s, and the noise of the poses.
    assert!((0.012..0.05).contains(&far_m) && near_m < 0.3 * far_m, "{pose}");
    for (channel, unit) in [
        ("pose", "m"),
        ("yaw", "rad"),
        ("wheel", "rad/s"),
        ("gyro", "rad/s"),
        ("current", "A"),
    ] {
        assert_eq!(row(channel, 1.0)["unit"], unit);
    }
    assert!(
        found["ratio"]["high"].as_f64().is_some_and(|high| high < 0.5),
        "{found}"
    );
    assert!(found["course"].as_array().is_some_and(|course| course.len() > 20));
    let sentence = found["sentence"].as_str().unwrap_or_default();
    assert!(
        sentence.starts_with(&format!("{right} is nearer to this run than the nominal twin")),
        "{sentence}"
    );

    let body = json!({"robot": ROBOT, "run": run, "first": "nominal", "second": wrong});
    let found: Value = compare(&service, &body).await.json().await.expect("JSON");
    assert_eq!(
        (&found["nearer"], &found["second"]["floor"]),
        (&json!("first"), &json!("moon"))
    );
    service.stop().await;
}

#[tokio::test]
async fn what_cannot_be_compared_is_refused_with_field_limit_and_remedy() {
    let service = Service::start().await;
    service.register_lab().await;
    let recipe = Recipe {
        robot: ROBOT,
        label: "",
        effects: "[]",
        duration_s: 4.0,
        seed: 4,
    };
    let run = done_run(&service.store, &service.folder, &recipe).await;
    let other_kind = version(&service, description("diff-01"), "lab-floor", 0.04).await;
    let queued = service.queued_run().await;
    let nobody = Uuid::now_v7();
    let body =
        |robot: &str, run: Uuid, first: &str| json!({"robot": robot, "run": run, "first": first, "second": "nominal"});
    let cases = [
        (body(ROBOT, nobody, "nominal"), "run", "there is no run"),
        (body("diff-01", run, "nominal"), "run", "not of diff-01"),
        (body("omni-01", queued, "nominal"), "run", "`queued`"),
        (body(ROBOT, run, "omni-03/9"), "first", "there is no model"),
        (body(ROBOT, run, &other_kind), "first", "another kind of robot"),
    ];
    for (body, field, word) in cases {
        let response = compare(&service, &body).await;
        assert_eq!(response.status(), StatusCode::UNPROCESSABLE_ENTITY, "{body}");
        let problem = problem(response).await;
        let error = &problem["errors"][0];
        assert_eq!(
            (&problem["code"], &error["field"]),
            (&json!("invalid_comparison"), &json!(field)),
            "{problem}"
        );
        assert!(
            error["message"].as_str().is_some_and(|text| text.contains(word)),
            "{problem}"
        );
        for key in ["limit", "remedy"] {
            assert!(error[key].as_str().is_some_and(|text| !text.is_empty()), "{problem}");
        }
    }
    // More than a page can wait for is left to the reader's own machine.
    let large = i64::from(128 << 20) + 1;
    for (bytes, status) in [(large, StatusCode::UNPROCESSABLE_ENTITY), (large / 3, StatusCode::OK)] {
        let grow =
            format!("UPDATE run_files SET bytes = {bytes} WHERE run_id = '{run}' AND name LIKE '%telemetry.csv'");
        service.database.try_execute(&grow).await.expect("grown");
        let response = compare(&service, &body(ROBOT, run, "nominal")).await;
        assert_eq!(response.status(), status, "{bytes} bytes");
        if status != StatusCode::OK {
            let problem = problem(response).await;
            assert_eq!(problem["errors"][0]["field"], "run", "{problem}");
            let limit = problem["errors"][0]["limit"].as_str().unwrap_or_default();
            assert_eq!(limit, "at most 134217728 bytes");
        }
    }
    let short = json!({"robot": ROBOT, "run": run, "first": "nominal", "second": "nominal"});
    let short: Value = compare(&service, &short).await.json().await.expect("JSON");
    assert_eq!((&short["nearer"], &short["ratio"]), (&json!("unknown"), &Value::Null));
    // The records of another person's run are nobody else's.
    let mallory = service
        .store
        .token_create(store::Role::User, "mallory")
        .await
        .expect("token");
    let hidden = service.call(Method::POST, "/models/compare").bearer_auth(mallory);
    let hidden = hidden.json(&body(ROBOT, run, "nominal")).send().await.expect("answer");
    assert_eq!(
        problem(hidden).await["errors"][0]["message"],
        format!("there is no run {run}")
    );
    let laboratory = service.as_role(store::Role::Lab, Method::POST, "/models/compare");
    let laboratory = laboratory
        .json(&body(ROBOT, run, "nominal"))
        .send()
        .await
        .expect("answer");
    assert_eq!(laboratory.status(), StatusCode::FORBIDDEN);
    service.stop().await;
}
