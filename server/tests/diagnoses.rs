//! Asking for diagnoses over HTTP: refusals, idempotency, cancelling, accepting, going back, the next experiment.

mod support;

use api::diagnosis::DiagnosisProblem;
use reqwest::{Method, StatusCode};
use serde_json::{Value, json};
use std::time::Duration;
use store::{DiagnosisLease, DiagnosisRecord, FileRecord, JobWrite, Role};
use support::{Service, id, problem, sha256, submission};
use uuid::Uuid;

const PAGE: &str = "<!doctype html><title>a report</title><style>p{color:red}</style><p>found";

/// A finished run of `omni-01`.
async fn done_run(service: &Service) -> Uuid {
    service.queued_run().await;
    let attempt = service.claim().await;
    for state in ["running", "uploading", "done"] {
        service.report(&attempt, state).await;
    }
    attempt.run
}

async fn ask(service: &Service, body: &Value) -> reqwest::Response {
    let call = service.call(Method::POST, "/diagnoses").json(body);
    call.send().await.expect("answer")
}

async fn post(service: &Service, path: &str) -> reqwest::Response {
    service.call(Method::POST, path).send().await.expect("answer")
}

async fn put(service: &Service, path: &str, body: &Value) -> reqwest::Response {
    let call = service.call(Method::PUT, path).json(body);
    call.send().await.expect("answer")
}

async fn asked(service: &Service, body: &Value) -> Uuid {
    let response = ask(service, body).await;
    assert_eq!(response.status(), StatusCode::CREATED);
    id(&response.json::<Value>().await.expect("JSON")["id"])
}

async fn lease(service: &Service) -> DiagnosisLease {
    let lease = service
        .store
        .diagnosis_claim(Uuid::now_v7(), Duration::from_secs(60))
        .await;
    lease.expect("claim").expect("a diagnosis waits")
}

/// Plays the worker; `number` makes the model document another one.
async fn carry_out(service: &Service, number: u32, next: Value) -> Uuid {
    let lease = lease(service).await;
    let object_path = format!("diagnoses/{}/1/report.html", lease.id);
    let path = service.folder.join("objects").join(&object_path);
    std::fs::create_dir_all(path.parent().expect("parent")).expect("folder");
    std::fs::write(path, PAGE).expect("page");
    let report =
        json!({"format": "robopheus.diagnosis/1", "next_experiment": {"why": "tells more", "experiment": next}});
    let record = DiagnosisRecord {
        verdict: "confirmed".to_owned(),
        sentence: "Missing in the twin: floor friction.".to_owned(),
        next_why: Some("tells more".to_owned()),
        report: report.to_string(),
        page: FileRecord {
            name: "report.html".to_owned(),
            bytes: i64::try_from(PAGE.len()).expect("small"),
            sha256: sha256(PAGE.as_bytes()),
            media_type: "text/html".to_owned(),
            object_path,
        },
        model: json!({"format": "robopheus.model/1", "id": format!("{number:064x}")}),
    };
    let written = service.store.diagnosis_complete(&lease, &record).await;
    assert_eq!(written.expect("stored"), JobWrite::Ok);
    lease.id
}

#[tokio::test]
async fn what_cannot_be_diagnosed_is_refused_with_field_limit_and_remedy() {
    let service = Service::start().await;
    service.register_lab().await;
    let (first, second) = (done_run(&service).await, done_run(&service).await);
    let queued = service.queued_run().await;
    let nobody = Uuid::now_v7();
    let cases = [
        (
            json!({"robot": "omni-99", "changed_runs": [first, second]}),
            "robot",
            "omni-99",
        ),
        (
            json!({"robot": "omni-01", "changed_runs": [first]}),
            "changed_runs",
            "chance",
        ),
        (
            json!({"robot": "omni-01", "changed_runs": [first, first]}),
            "changed_runs[1]",
            "changed_runs[0]",
        ),
        (
            json!({"robot": "omni-01", "reference_runs": [first], "changed_runs": [second, first]}),
            "changed_runs[1]",
            "reference_runs[0]",
        ),
        (
            json!({"robot": "omni-01", "changed_runs": [first, nobody]}),
            "changed_runs[1]",
            "there is no run",
        ),
        (
            json!({"robot": "omni-01", "changed_runs": [first, queued]}),
            "changed_runs[1]",
            "`queued`",
        ),
        (
            json!({"robot": "diff-01", "changed_runs": [first, second]}),
            "changed_runs[0]",
            "not of diff-01",
        ),
        (
            json!({"robot": "omni-01", "changed_runs": [first, second], "locked_runs": [nobody]}),
            "locked_runs[0]",
            "there is no run",
        ),
        (
            json!({"robot": "omni-01", "changed_runs": [first, second], "model": "omni-01/7"}),
            "model",
            "omni-01/7",
        ),
    ];
    for (body, field, word) in cases {
        let response = ask(&service, &body).await;
        assert_eq!(response.status(), StatusCode::UNPROCESSABLE_ENTITY, "{body}");
        let problem = problem(response).await;
        let error = &problem["errors"][0];
        assert_eq!(error["field"], field, "{problem}");
        assert!(
            error["message"].as_str().is_some_and(|text| text.contains(word)),
            "{problem}"
        );
        for key in ["limit", "remedy"] {
            assert!(error[key].as_str().is_some_and(|text| !text.is_empty()), "{problem}");
        }
    }
    let unknown = ask(
        &service,
        &json!({"robot": "omni-01", "changed_runs": [first, second], "seed": 1}),
    )
    .await;
    assert_eq!(unknown.status(), StatusCode::BAD_REQUEST);
    assert_eq!(
        service.get("/diagnoses").await["diagnoses"],
        json!([]),
        "nothing was stored"
    );
    service.stop().await;
}

#[tokio::test]
async fn a_repeated_request_makes_one_diagnosis_and_open_ones_are_limited() {
    let service = Service::start().await;
    service.register_lab().await;
    let body = json!({"robot": "omni-01", "changed_runs": [done_run(&service).await, done_run(&service).await]});
    let keyed = async |body: &Value| {
        let call = service.call(Method::POST, "/diagnoses").header("idempotency-key", "k");
        let response = call.json(body).send().await.expect("answer");
        (response.status(), response.json::<Value>().await.expect("JSON"))
    };
    let (status, first) = keyed(&body).await;
    assert_eq!((status, &first["state"]), (StatusCode::CREATED, &json!("queued")));
    let (status, again) = keyed(&body).await;
    assert_eq!((status, &again["id"]), (StatusCode::OK, &first["id"]));
    let mut other = body.clone();
    other["model"] = json!("nominal");
    let (status, conflict) = keyed(&other).await;
    assert_eq!(
        (status, &conflict["code"]),
        (StatusCode::UNPROCESSABLE_ENTITY, &json!("idempotency_conflict"))
    );
    for _ in 1..store::DIAGNOSES_OPEN_MOST {
        asked(&service, &body).await;
    }
    let full = ask(&service, &body).await;
    assert_eq!(full.status(), StatusCode::CONFLICT);
    assert_eq!(problem(full).await["code"], "too_many_diagnoses");
    service.stop().await;
}

#[tokio::test]
async fn a_waiting_diagnosis_is_cancelled_at_once_a_running_one_through_its_worker() {
    let service = Service::start().await;
    service.register_lab().await;
    let body = json!({"robot": "omni-01", "changed_runs": [done_run(&service).await, done_run(&service).await]});
    let waiting = asked(&service, &body).await;
    let view: Value = post(&service, &format!("/diagnoses/{waiting}/cancel"))
        .await
        .json()
        .await
        .expect("JSON");
    assert_eq!(
        (&view["state"], &view["problem"]["code"]),
        (&json!("cancelled"), &json!("cancelled_by_user"))
    );
    let again = post(&service, &format!("/diagnoses/{waiting}/cancel")).await;
    assert_eq!(problem(again).await["code"], "diagnosis_ended");

    let running = asked(&service, &body).await;
    let lease = lease(&service).await;
    assert_eq!(lease.id, running);
    let view: Value = post(&service, &format!("/diagnoses/{running}/cancel"))
        .await
        .json()
        .await
        .expect("JSON");
    assert_eq!(
        (&view["state"], &view["cancel_requested"]),
        (&json!("running"), &json!(true))
    );
    let beat = service
        .store
        .diagnosis_heartbeat(&lease, Duration::from_secs(60), "fit", 0.4)
        .await;
    assert_eq!(beat.expect("beat"), store::DiagnosisBeat::Ok { cancel_requested: true });
    let end = DiagnosisProblem {
        code: "x".to_owned(),
        message: "x".to_owned(),
    };
    assert_eq!(
        service.store.diagnosis_fail(&lease, &end).await.expect("written"),
        JobWrite::Ok
    );
    let view = service.get(&format!("/diagnoses/{running}")).await;
    assert_eq!(
        (&view["state"], &view["problem"]["message"]),
        (&json!("cancelled"), &json!("Cancelled by local."))
    );
    let report = service.call(Method::GET, &format!("/diagnoses/{running}/report.json"));
    let report = problem(report.send().await.expect("answer")).await;
    assert_eq!(report["code"], "diagnosis_not_done");
    assert!(
        report["detail"]
            .as_str()
            .is_some_and(|text| text.contains("Cancelled by local"))
    );
    service.stop().await;
}

#[tokio::test]
async fn a_result_is_read_accepted_and_taken_back() {
    let service = Service::start().await;
    service.register_lab().await;
    let body = json!({"robot": "omni-01", "changed_runs": [done_run(&service).await, done_run(&service).await]});
    let diagnosis = asked(&service, &body).await;
    let early = post(&service, &format!("/diagnoses/{diagnosis}/accept")).await;
    assert_eq!(problem(early).await["code"], "diagnosis_not_done");
    carry_out(&service, 1, Value::Null).await;
    let view = service.get(&format!("/diagnoses/{diagnosis}")).await;
    assert_eq!(
        (&view["verdict"], &view["model"]),
        (&json!("confirmed"), &json!("omni-01/1"))
    );
    assert_eq!(
        service.get(&format!("/diagnoses/{diagnosis}/report.json")).await["format"],
        "robopheus.diagnosis/1"
    );
    let page = service.call(Method::GET, &format!("/diagnoses/{diagnosis}/report.html"));
    let page = page.send().await.expect("answer");
    assert_eq!(page.headers()["content-type"], "text/html; charset=utf-8");
    assert_eq!(page.text().await.expect("text"), PAGE);

    let view: Value = post(&service, &format!("/diagnoses/{diagnosis}/accept"))
        .await
        .json()
        .await
        .expect("JSON");
    assert_eq!(view["model_is_current"], true);
    post(&service, &format!("/diagnoses/{diagnosis}/accept")).await;
    let now = service.get("/robots/omni-01/model").await;
    assert_eq!(
        (&now["version"], now["history"].as_array().map(Vec::len)),
        (&json!("omni-01/1"), Some(1))
    );
    assert_eq!(
        (&now["history"][0]["chosen_by"], &now["history"][0]["diagnosis"]),
        (&json!("local"), &json!(diagnosis))
    );

    // The next diagnosis starts from the accepted model.
    asked(&service, &body).await;
    carry_out(&service, 2, Value::Null).await;
    let models = service.get("/models?robot=omni-01").await;
    assert_eq!(
        (&models[0]["version"], &models[0]["parent"]),
        (&json!("omni-01/2"), &json!("omni-01/1"))
    );

    let reverted = put(&service, "/robots/omni-01/model", &json!({"model": "nominal"})).await;
    assert_eq!(reverted.status(), StatusCode::OK);
    let now = service.get("/robots/omni-01/model").await;
    assert_eq!(
        (&now["model"], now["history"].as_array().map(Vec::len)),
        (&Value::Null, Some(2)),
        "the record only grows"
    );
    let chosen = put(&service, "/robots/omni-01/model", &json!({"model": "omni-01/2"})).await;
    assert_eq!(chosen.json::<Value>().await.expect("JSON")["version"], "omni-01/2");
    let foreign = put(&service, "/robots/omni-02/model", &json!({"model": "omni-01/2"})).await;
    let foreign = problem(foreign).await;
    assert_eq!(
        (&foreign["code"], &foreign["errors"][0]["limit"]),
        (&json!("invalid_model"), &json!("nominal"))
    );
    let nobody = put(&service, "/robots/omni-99/model", &json!({"model": "nominal"})).await;
    assert_eq!(nobody.status(), StatusCode::NOT_FOUND);
    for table in ["models", "model_uses"] {
        let refused = service.database.try_execute(&format!("DELETE FROM {table}")).await;
        assert!(refused.is_err(), "{table} is only added to");
    }
    service.stop().await;
}

#[tokio::test]
async fn the_proposed_experiment_is_submitted_once_and_again_after_it_failed() {
    let service = Service::start().await;
    service.register_lab().await;
    let body = json!({"robot": "omni-01", "changed_runs": [done_run(&service).await, done_run(&service).await]});
    asked(&service, &body).await;
    let nothing = carry_out(&service, 1, Value::Null).await;
    let none = post(&service, &format!("/diagnoses/{nothing}/next-experiment")).await;
    assert_eq!(problem(none).await["code"], "no_next_experiment");

    asked(&service, &body).await;
    let diagnosis = carry_out(&service, 2, json!({"manoeuvre": "circles"})).await;
    let path = format!("/diagnoses/{diagnosis}/next-experiment");
    let made = post(&service, &path).await;
    assert_eq!(made.status(), StatusCode::CREATED);
    let run = made.json::<Value>().await.expect("JSON")["next_run"].clone();
    let again = post(&service, &path).await;
    assert_eq!(again.status(), StatusCode::OK);
    assert_eq!(again.json::<Value>().await.expect("JSON")["next_run"], run);
    let view = service.get(&format!("/runs/{}", id(&run))).await;
    assert_eq!(view["experiment"]["robots"][0]["name"], "omni-01");
    assert!(
        view["experiment"]["targets"]
            .as_array()
            .is_some_and(|targets| targets.len() > 20)
    );

    post(&service, &format!("/runs/{}/cancel", id(&run))).await;
    let anew = post(&service, &path).await;
    assert_eq!(anew.status(), StatusCode::CREATED);
    assert_ne!(anew.json::<Value>().await.expect("JSON")["next_run"], run);
    service.stop().await;
}

#[tokio::test]
async fn references_are_set_by_operators_and_shown_with_the_gaps() {
    let service = Service::start().await;
    service.register_lab().await;
    let (first, second) = (done_run(&service).await, done_run(&service).await);
    let set = put(&service, "/robots/omni-01/references", &json!({"runs": [first]})).await;
    assert_eq!(set.status(), StatusCode::OK);
    let gaps = service.get("/robots/omni-01/gaps").await;
    let marks: Vec<_> = gaps["runs"]
        .as_array()
        .expect("runs")
        .iter()
        .map(|run| (id(&run["run"]), run["is_reference"] == true))
        .collect();
    assert_eq!(marks, [(second, false), (first, true)]);
    assert_eq!(gaps["limit_position_m"], Value::Null, "one reference is no floor");
    let wrong = put(
        &service,
        "/robots/omni-01/references",
        &json!({"runs": [second, Uuid::now_v7()]}),
    )
    .await;
    let wrong = problem(wrong).await;
    assert_eq!(
        (&wrong["code"], &wrong["errors"][0]["field"]),
        (&json!("invalid_references"), &json!("runs[1]"))
    );
    assert_eq!(
        service.get("/robots/omni-01/gaps").await["runs"][1]["is_reference"],
        true,
        "nothing changed"
    );
    let emptied = put(&service, "/robots/omni-01/references", &json!({"runs": []})).await;
    assert_eq!(
        emptied.json::<Value>().await.expect("JSON")["runs"][1]["is_reference"],
        false
    );
    service.stop().await;
}

#[tokio::test]
async fn somebody_elses_diagnosis_and_runs_do_not_exist() {
    let service = Service::start().await;
    service.register_lab().await;
    let body = json!({"robot": "omni-01", "changed_runs": [done_run(&service).await, done_run(&service).await]});
    let diagnosis = asked(&service, &body).await;
    let mallory = service.store.token_create(Role::User, "mallory").await.expect("token");
    let as_mallory = async |method: Method, path: &str, body: &Value| {
        let call = service.call(method, path).bearer_auth(&mallory).json(body);
        call.send().await.expect("answer")
    };
    for (method, path) in [
        (Method::GET, ""),
        (Method::GET, "/report.json"),
        (Method::GET, "/report.html"),
        (Method::POST, "/cancel"),
        (Method::POST, "/next-experiment"),
    ] {
        let response = as_mallory(method, &format!("/diagnoses/{diagnosis}{path}"), &json!({})).await;
        assert_eq!(response.status(), StatusCode::NOT_FOUND, "{path}");
    }
    let stolen = as_mallory(Method::POST, "/diagnoses", &body).await;
    assert!(
        problem(stolen).await["errors"][0]["message"]
            .as_str()
            .is_some_and(|text| text.starts_with("there is no run"))
    );
    let seen: Value = as_mallory(Method::GET, "/robots/omni-01/gaps", &json!({}))
        .await
        .json()
        .await
        .expect("JSON");
    assert_eq!(seen["runs"], json!([]));
    assert_eq!(service.submit(&submission()).await.status(), StatusCode::CREATED);
    service.stop().await;
}
