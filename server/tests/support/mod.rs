//! A running service with a database of its own, and a person's view of it.
#![allow(dead_code)] // each test file uses its part

use reqwest::{Method, RequestBuilder, Response, StatusCode};
use serde_json::{Value, json};
use server::config::Config;
use sha2::{Digest as _, Sha256};
use std::path::PathBuf;
use std::time::Duration;
use store::testing::TestDatabase;
use store::{FileRecord, Role, Store, StoreOptions, VerdictRecord};
use tokio::task::JoinHandle;
use tokio_util::sync::CancellationToken;
use uuid::Uuid;

/// Longest wait for anything.
const PATIENCE: Duration = Duration::from_secs(20);

pub struct Service {
    pub base: String,
    pub folder: PathBuf,
    pub http: reqwest::Client,
    /// The same database, past the service.
    pub store: Store,
    pub database: TestDatabase,
    shutdown: CancellationToken,
    task: JoinHandle<anyhow::Result<()>>,
}

/// What differs between services under test.
#[derive(Default)]
pub struct Options {
    /// Everybody needs a token, as on an address that other machines reach.
    pub allow_remote: bool,
    /// A database server that the test may take away.
    pub private_database: bool,
}

impl Service {
    pub async fn start() -> Self {
        Self::start_with(Options::default()).await
    }

    pub async fn start_with(options: Options) -> Self {
        let _installed_before = rustls::crypto::ring::default_provider().install_default();
        let database = if options.private_database {
            TestDatabase::private().await
        } else {
            TestDatabase::new().await
        };
        let folder = std::env::temp_dir().join(format!("robopheus-server-{}", Uuid::now_v7()));
        let config = Config {
            listen: "127.0.0.1:0".parse().expect("an address"),
            database_url: database.url.clone(),
            data: folder.clone(),
            static_dir: folder.join("static"),
            allow_remote: options.allow_remote,
        };
        let address_file = config.address_file();
        let shutdown = CancellationToken::new();
        let task = tokio::spawn(server::startup::run(config, shutdown.clone()));
        let address = eventually("the address file", || async {
            assert!(!task.is_finished(), "the service ended at start");
            std::fs::read_to_string(&address_file).ok()
        })
        .await;
        let store = Store::connect(&database.url, StoreOptions::default())
            .await
            .expect("database");
        let http = reqwest::Client::builder().timeout(PATIENCE).build().expect("client");
        Self {
            base: format!("http://{}", address.trim()),
            folder,
            http,
            store,
            database,
            shutdown,
            task,
        }
    }

    /// Orderly end, as after SIGTERM.
    pub async fn stop(self) {
        self.shutdown.cancel();
        let ended = tokio::time::timeout(PATIENCE, self.task)
            .await
            .expect("ends in time")
            .expect("no panic");
        ended.expect("ends without an error");
        self.store.close().await;
        std::fs::remove_dir_all(&self.folder).expect("data folder");
    }

    pub fn token(&self, role: Role) -> String {
        let path = self.folder.join("tokens").join(role.as_str());
        std::fs::read_to_string(path)
            .expect("first-start token")
            .trim()
            .to_owned()
    }

    /// A call without a token: the person at this machine.
    pub fn call(&self, method: Method, path: &str) -> RequestBuilder {
        self.http.request(method, format!("{}/api/v1{path}", self.base))
    }

    pub fn as_role(&self, role: Role, method: Method, path: &str) -> RequestBuilder {
        self.call(method, path).bearer_auth(self.token(role))
    }

    pub async fn get(&self, path: &str) -> Value {
        let response = self.call(Method::GET, path).send().await.expect("answer");
        assert_eq!(response.status(), StatusCode::OK, "GET {path}");
        response.json().await.expect("JSON")
    }

    /// A call of the laboratory that has to succeed.
    pub async fn lab(&self, path: &str, body: &Value) -> Value {
        let response = self
            .as_role(Role::Lab, Method::POST, path)
            .json(body)
            .send()
            .await
            .expect("answer");
        let (status, text) = (response.status(), response.text().await.expect("text"));
        assert!(status.is_success(), "POST {path}: {status} {text}");
        if text.is_empty() {
            Value::Null
        } else {
            serde_json::from_str(&text).expect("JSON")
        }
    }

    pub async fn register_lab(&self) {
        self.lab("/lab/register", &laboratory()).await;
    }

    pub async fn submit(&self, request: &Value) -> Response {
        self.call(Method::POST, "/experiments")
            .json(request)
            .send()
            .await
            .expect("answer")
    }

    /// A run in the queue that nobody claims meanwhile. Returns the run's id.
    pub async fn queued_run(&self) -> Uuid {
        let run = self.queue_run().await;
        assert_eq!(self.get(&format!("/runs/{run}")).await["state"], "queued");
        run
    }

    /// Submits the example and plays the scheduler: its run is queued. Returns the run's id.
    pub async fn queue_run(&self) -> Uuid {
        let response = self.submit(&submission()).await;
        assert_eq!(response.status(), StatusCode::CREATED);
        let view: Value = response.json().await.expect("JSON");
        let job = self
            .store
            .job_claim("rehearse", Uuid::now_v7(), Duration::from_secs(30))
            .await
            .expect("claim");
        let job = job.expect("a job for the submission");
        let replay = b"{\"format\":\"robopheus.replay/1\"}";
        let object_path = format!("runs/{}/0/replay.json", job.run_id);
        let path = self.folder.join("objects").join(&object_path);
        std::fs::create_dir_all(path.parent().expect("parent")).expect("folder");
        std::fs::write(path, replay).expect("replay");
        let record = VerdictRecord {
            verdict: serde_json::from_value(verdict()).expect("verdict"),
            accepted: true,
            fault: None,
            replay: FileRecord {
                name: "replay.json".to_owned(),
                bytes: i64::try_from(replay.len()).expect("small"),
                sha256: sha256(replay),
                media_type: "application/json".to_owned(),
                object_path,
            },
        };
        self.store.run_verdict_set(&job, &record).await.expect("verdict stored");
        let run = id(&view["run_id"]);
        assert_eq!(run, job.run_id);
        run
    }

    /// Leases the next run as the laboratory.
    pub async fn claim(&self) -> Attempt {
        let instance = Uuid::now_v7();
        let body = json!({"lab": "reference-lab", "arena": "reference", "instance": instance, "wait_s": 10.0});
        let assignment = self.lab("/lab/claim", &body).await;
        Attempt {
            run: id(&assignment["run_id"]),
            epoch: assignment["epoch"].as_i64().expect("epoch"),
            instance,
        }
    }

    pub async fn report(&self, attempt: &Attempt, state: &str) -> Value {
        let body = json!({"epoch": attempt.epoch, "instance": attempt.instance, "state": state});
        self.lab(&format!("/lab/runs/{}/state", attempt.run), &body).await
    }

    pub async fn put(&self, attempt: &Attempt, name: &str, bytes: &[u8], sha256: &str) -> Response {
        let path = format!("/lab/runs/{}/files/{name}?epoch={}", attempt.run, attempt.epoch);
        let request = self
            .as_role(Role::Lab, Method::PUT, &path)
            .header("x-content-sha256", sha256);
        request.body(bytes.to_vec()).send().await.expect("answer")
    }

    pub async fn put_ok(&self, attempt: &Attempt, name: &str, bytes: &[u8]) {
        let response = self.put(attempt, name, bytes, &sha256(bytes)).await;
        assert_eq!(response.status(), StatusCode::OK, "PUT {name}");
    }
}

/// A run in the laboratory's hands.
#[derive(Debug, Clone, Copy)]
pub struct Attempt {
    pub run: Uuid,
    pub epoch: i64,
    pub instance: Uuid,
}

/// Reads a problem body and checks what holds for all of them.
pub async fn problem(response: Response) -> Value {
    let status = response.status();
    let media_type = response
        .headers()
        .get("content-type")
        .and_then(|value| value.to_str().ok())
        .map(str::to_owned);
    assert_eq!(media_type.as_deref(), Some("application/problem+json"), "{status}");
    let problem: Value = response.json().await.expect("JSON");
    assert_eq!(problem["status"], status.as_u16());
    for key in ["type", "title", "detail", "code"] {
        assert!(
            problem[key].as_str().is_some_and(|text| !text.is_empty()),
            "{key} of {problem}"
        );
    }
    problem
}

/// Polls until there is something.
pub async fn eventually<T, F, Fut>(what: &str, mut look: F) -> T
where
    F: FnMut() -> Fut,
    Fut: Future<Output = Option<T>>,
{
    let waiting = async {
        loop {
            if let Some(found) = look().await {
                return found;
            }
            tokio::time::sleep(Duration::from_millis(20)).await;
        }
    };
    tokio::time::timeout(PATIENCE, waiting)
        .await
        .unwrap_or_else(|_| panic!("waited in vain for {what}"))
}

pub fn laboratory() -> Value {
    example("lab/reference.json")
}

/// One robot on the paper's path.
pub fn submission() -> Value {
    json!({"experiment": example("experiments/rectangle-omni4.json"), "label": "from a test"})
}

/// Four robots that swap corners.
pub fn submission_of_four() -> Value {
    json!({"experiment": example("experiments/swap-corners.json")})
}

fn example(name: &str) -> Value {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../examples").join(name);
    serde_json::from_str(&std::fs::read_to_string(path).expect("example")).expect("JSON")
}

fn verdict() -> Value {
    json!({"format": "robopheus.verdict/1", "accepted": true, "sentence": "It works.", "findings": [],
        "digest": "00112233445566778899aabbccddeeff", "twin_version": twin::VERSION, "ticks": 7200,
        "smallest_separation_m": null, "smallest_wall_distance_m": 0.5, "largest_path_error_m": 0.01})
}

pub fn id(value: &Value) -> Uuid {
    value.as_str().expect("text").parse().expect("UUID")
}

pub fn sha256(bytes: &[u8]) -> String {
    server::objects::hex(&Sha256::digest(bytes))
}
