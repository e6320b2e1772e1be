//! The service as the laboratory sees it: a client of `/api/v1/lab`.

use api::BASE_PATH;
use api::arena::ArenaView;
use api::lab::{
    Assignment, ClaimRequest, Heartbeat, HeartbeatReply, LabDescription, LabStatus, LearnedModel, SalvageReport,
    StateReport,
};
use api::model::ModelView;
use api::problem::Problem;
use api::run::RunView;
use reqwest::{Body, Client, Method, RequestBuilder, Response, StatusCode};
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::path::Path;
use std::time::Duration;
use tokio_util::io::ReaderStream;
use uuid::Uuid;

/// Connecting takes no longer.
const CONNECT_TIMEOUT: Duration = Duration::from_secs(2);
/// An ordinary request takes no longer.
const REQUEST_TIMEOUT: Duration = Duration::from_secs(5);
/// A heartbeat that takes longer is worth less than the next one.
const HEARTBEAT_TIMEOUT: Duration = Duration::from_millis(2500);
/// What a claim may take beyond the wait that was asked for.
const CLAIM_SLACK: Duration = Duration::from_secs(5);
/// One file takes no longer.
const UPLOAD_TIMEOUT: Duration = Duration::from_secs(300);

/// Why a request had no effect that we know of.
#[derive(Debug, thiserror::Error)]
pub enum ServiceError {
    /// No answer: the request may or may not have been carried out.
    #[error("the service cannot be reached")]
    Unreachable(#[from] reqwest::Error),
    /// An answer, and it is no.
    #[error("the service refused with {status} {code}: {detail}")]
    Refused {
        status: StatusCode,
        code: String,
        detail: String,
    },
    #[error("a file cannot be read")]
    File(#[from] std::io::Error),
}

impl ServiceError {
    /// Trying again may help.
    pub fn is_temporary(&self) -> bool {
        match self {
            Self::Unreachable(_) => true,
            Self::Refused { status, .. } => status.is_server_error() || *status == StatusCode::TOO_MANY_REQUESTS,
            Self::File(_) => false,
        }
    }

    /// This attempt is not the current one.
    pub fn is_stale_epoch(&self) -> bool {
        matches!(self, Self::Refused { code, .. } if code == "stale_epoch")
    }
}

/// A file on its way up.
#[derive(Debug, Clone, Copy)]
pub struct Upload<'a> {
    pub run_id: Uuid,
    pub epoch: i64,
    /// Path inside the archive.
    pub name: &'a str,
    pub path: &'a Path,
    pub sha256: &'a str,
}

/// See the module.
#[derive(Debug, Clone)]
pub struct Service {
    client: Client,
    server: String,
    token: String,
}

impl Service {
    /// - `server`: for example `http://127.0.0.1:8080`.
    pub fn new(server: &str, token: &str) -> reqwest::Result<Self> {
        let client = Client::builder().connect_timeout(CONNECT_TIMEOUT).no_proxy().build()?;
        Ok(Self {
            client,
            server: server.trim_end_matches('/').to_owned(),
            token: token.trim().to_owned(),
        })
    }

    /// Bearer token of the role `lab`.
    pub fn token(&self) -> &str {
        &self.token
    }

    /// Address of the live stream.
    pub fn stream_address(&self) -> String {
        let server = match self.server.split_once("://") {
            Some(("https", rest)) => format!("wss://{rest}"),
            Some((_, rest)) => format!("ws://{rest}"),
            None => format!("ws://{}", self.server),
        };
        format!("{server}{BASE_PATH}/lab/stream")
    }

    fn request(&self, method: Method, path: &str) -> RequestBuilder {
        self.client
            .request(method, format!("{}{BASE_PATH}{path}", self.server))
            .bearer_auth(&self.token)
    }

    async fn post(&self, path: &str, body: &impl Serialize, timeout: Duration) -> Result<Response, ServiceError> {
        accepted(
            self.request(Method::POST, path)
                .timeout(timeout)
                .json(body)
                .send()
                .await?,
        )
        .await
    }

    async fn ask<R: DeserializeOwned>(
        &self,
        path: &str,
        body: &impl Serialize,
        timeout: Duration,
    ) -> Result<R, ServiceError> {
        Ok(self.post(path, body, timeout).await?.json().await?)
    }

    /// Tells the service which robots are here.
    pub async fn register(&self, lab: &LabDescription) -> Result<(), ServiceError> {
        self.post("/lab/register", lab, REQUEST_TIMEOUT).await.map(|_| ())
    }

    /// Robots' health.
    pub async fn status(&self, status: &LabStatus) -> Result<(), ServiceError> {
        self.post("/lab/status", status, REQUEST_TIMEOUT).await.map(|_| ())
    }

    /// What an arena is doing; none when the service does not know it.
    pub async fn arena(&self, name: &str) -> Result<Option<ArenaView>, ServiceError> {
        let request = self.request(Method::GET, "/arenas").timeout(HEARTBEAT_TIMEOUT);
        let arenas: Vec<ArenaView> = accepted(request.send().await?).await?.json().await?;
        Ok(arenas.into_iter().find(|view| view.arena.name == name))
    }

    /// The next run, or none within the wait.
    pub async fn claim(&self, request: &ClaimRequest) -> Result<Option<Assignment>, ServiceError> {
        let timeout = Duration::from_secs_f64(request.wait_s) + CLAIM_SLACK;
        let reply = self.post("/lab/claim", request, timeout).await?;
        if reply.status() == StatusCode::NO_CONTENT {
            Ok(None)
        } else {
            Ok(Some(reply.json().await?))
        }
    }

    /// Keeps the lease.
    pub async fn heartbeat(&self, run_id: Uuid, beat: &Heartbeat) -> Result<HeartbeatReply, ServiceError> {
        self.ask(&format!("/lab/runs/{run_id}/heartbeat"), beat, HEARTBEAT_TIMEOUT)
            .await
    }

    /// Moves the run on.
    pub async fn report(&self, run_id: Uuid, report: &StateReport) -> Result<(), ServiceError> {
        self.post(&format!("/lab/runs/{run_id}/state"), report, REQUEST_TIMEOUT)
            .await
            .map(|_| ())
    }

    /// Closes an attempt that an earlier process left behind; the run as it is then.
    pub async fn salvage(&self, run_id: Uuid, report: &SalvageReport) -> Result<RunView, ServiceError> {
        self.ask(&format!("/lab/runs/{run_id}/salvage"), report, REQUEST_TIMEOUT)
            .await
    }

    /// Hands in a version that was learned in a run; the same document again is the same version.
    pub async fn learned(&self, run_id: Uuid, model: &LearnedModel) -> Result<ModelView, ServiceError> {
        self.ask(&format!("/lab/runs/{run_id}/models"), model, REQUEST_TIMEOUT)
            .await
    }

    /// Sends one file; the service checks the hash before it counts.
    pub async fn upload(&self, upload: Upload<'_>) -> Result<(), ServiceError> {
        let file = tokio::fs::File::open(upload.path).await?;
        let bytes = file.metadata().await?.len();
        let path = format!(
            "/lab/runs/{}/files/{}?epoch={}",
            upload.run_id, upload.name, upload.epoch
        );
        let request = self
            .request(Method::PUT, &path)
            .header("x-content-sha256", upload.sha256)
            .header(reqwest::header::CONTENT_LENGTH, bytes)
            .timeout(UPLOAD_TIMEOUT)
            .body(Body::wrap_stream(ReaderStream::new(file)));
        accepted(request.send().await?).await.map(|_| ())
    }
}

async fn accepted(reply: Response) -> Result<Response, ServiceError> {
    let status = reply.status();
    if status.is_success() {
        return Ok(reply);
    }
    let text = reply.text().await.unwrap_or_default();
    Err(match serde_json::from_str::<Problem>(&text) {
        Ok(problem) => ServiceError::Refused {
            status,
            code: problem.code,
            detail: problem.detail,
        },
        Err(_) => ServiceError::Refused {
            status,
            code: String::new(),
            detail: text.chars().take(200).collect(),
        },
    })
}
