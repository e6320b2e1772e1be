//! One method per call of the service.

use crate::ClientError;
use api::arena::ArenaView;
use api::comparison::{ComparisonRequest, ComparisonView};
use api::diagnosis::{DiagnosisList, DiagnosisRequest, DiagnosisView};
use api::experiment::{ExperimentView, SubmitRequest};
use api::model::{ModelChoice, ModelView, RobotModel};
use api::problem::Problem;
use api::robot::RobotView;
use api::run::{RunList, RunView};
use reqwest::{Method, RequestBuilder, Response};
use serde::de::DeserializeOwned;
use std::time::Duration;
use uuid::Uuid;

/// Longest wait for an answer that is not a download.
const CALL_TIMEOUT: Duration = Duration::from_secs(30);

/// A service at one address, with an optional bearer token.
#[derive(Debug, Clone)]
pub struct Client {
    pub(crate) base: String,
    pub(crate) token: Option<String>,
    pub(crate) http: reqwest::Client,
}

/// What the service made of a submission.
#[derive(Debug, Clone, serde::Serialize)]
pub struct Submission {
    pub view: ExperimentView,
}

impl Client {
    /// - `base`: address without path, for example `http://127.0.0.1:8080`.
    pub fn new(base: &str, token: Option<String>) -> Result<Self, ClientError> {
        let base = base.trim_end_matches('/').to_owned();
        let http = reqwest::Client::builder()
            .connect_timeout(Duration::from_secs(10))
            .build()
            .map_err(|source| ClientError::Unreachable {
                url: base.clone(),
                source,
            })?;
        Ok(Self { base, token, http })
    }

    /// Submits under an idempotency key: repeating the call with the same key never makes a second run.
    pub async fn experiment_submit(&self, request: &SubmitRequest, key: &str) -> Result<Submission, ClientError> {
        let builder = self
            .request(Method::POST, "/experiments")
            .header("idempotency-key", key)
            .json(request);
        Ok(Submission {
            view: self.json(builder).await?,
        })
    }

    pub async fn run_get(&self, id: Uuid) -> Result<RunView, ClientError> {
        self.json(self.request(Method::GET, &format!("/runs/{id}"))).await
    }

    pub async fn run_list(&self) -> Result<Vec<RunView>, ClientError> {
        let list: RunList = self.json(self.request(Method::GET, "/runs")).await?;
        Ok(list.runs)
    }

    pub async fn run_cancel(&self, id: Uuid) -> Result<RunView, ClientError> {
        self.json(self.request(Method::POST, &format!("/runs/{id}/cancel")))
            .await
    }

    pub async fn robot_list(&self) -> Result<Vec<RobotView>, ClientError> {
        self.json(self.request(Method::GET, "/robots")).await
    }

    pub async fn arena_list(&self) -> Result<Vec<ArenaView>, ClientError> {
        self.json(self.request(Method::GET, "/arenas")).await
    }

    /// Asks for a diagnosis under an idempotency key.
    pub async fn diagnosis_submit(&self, request: &DiagnosisRequest, key: &str) -> Result<DiagnosisView, ClientError> {
        let builder = self
            .request(Method::POST, "/diagnoses")
            .header("idempotency-key", key)
            .json(request);
        self.json(builder).await
    }

    pub async fn diagnosis_get(&self, id: Uuid) -> Result<DiagnosisView, ClientError> {
        self.json(self.request(Method::GET, &format!("/diagnoses/{id}"))).await
    }

    /// Newest first; of one robot when given.
    pub async fn diagnosis_list(&self, robot: Option<&str>) -> Result<Vec<DiagnosisView>, ClientError> {
        let query = robot
            .map(|robot| format!("?robot={}", escaped(robot)))
            .unwrap_or_default();
        let list: DiagnosisList = self
            .json(self.request(Method::GET, &format!("/diagnoses{query}")))
            .await?;
        Ok(list.diagnoses)
    }

    /// - `verb`: `cancel`, `accept` or `next-experiment`.
    pub async fn diagnosis_post(&self, id: Uuid, verb: &str) -> Result<DiagnosisView, ClientError> {
        self.json(self.request(Method::POST, &format!("/diagnoses/{id}/{verb}")))
            .await
    }

    /// - `name`: `report.json` or `report.html`.
    pub async fn diagnosis_file(&self, id: Uuid, name: &str) -> Result<Vec<u8>, ClientError> {
        self.file(&format!("/diagnoses/{id}/{name}")).await
    }

    async fn file(&self, path: &str) -> Result<Vec<u8>, ClientError> {
        let builder = self.request(Method::GET, path);
        let response = self.send(builder.timeout(CALL_TIMEOUT)).await?;
        let url = response.url().to_string();
        let bytes = response.bytes().await;
        Ok(bytes
            .map_err(|source| ClientError::Unreachable { url, source })?
            .to_vec())
    }

    /// Model versions, newest first; of one robot and floor when given.
    pub async fn model_list(&self, robot: Option<&str>, floor: Option<&str>) -> Result<Vec<ModelView>, ClientError> {
        let wanted = [("robot", robot), ("floor", floor)];
        let query: Vec<String> = wanted
            .into_iter()
            .filter_map(|(name, value)| Some(format!("{name}={}", escaped(value?))))
            .collect();
        let path = format!("/models?{}", query.join("&"));
        self.json(self.request(Method::GET, &path)).await
    }

    /// The learned residual of a version as an ONNX file.
    pub async fn model_onnx(&self, id: Uuid) -> Result<Vec<u8>, ClientError> {
        self.file(&format!("/models/{id}/onnx")).await
    }

    /// Which of two versions predicts a stored run better.
    pub async fn model_compare(&self, request: &ComparisonRequest) -> Result<ComparisonView, ClientError> {
        let builder = self.request(Method::POST, "/models/compare").json(request);
        self.json(builder).await
    }

    /// Models of the robots that do not use the nominal twin.
    pub async fn models_current(&self) -> Result<Vec<ModelView>, ClientError> {
        self.json(self.request(Method::GET, "/models?current=true")).await
    }

    /// - `model`: a version or id, or `nominal`.
    pub async fn robot_model_set(&self, robot: &str, model: &str) -> Result<RobotModel, ClientError> {
        let choice = ModelChoice {
            model: model.to_owned(),
        };
        self.json(
            self.request(Method::PUT, &format!("/robots/{}/model", escaped(robot)))
                .json(&choice),
        )
        .await
    }

    pub(crate) fn request(&self, method: Method, path: &str) -> RequestBuilder {
        let builder = self
            .http
            .request(method, format!("{}{}{path}", self.base, api::BASE_PATH));
        match &self.token {
            Some(token) => builder.bearer_auth(token),
            None => builder,
        }
    }

    async fn json<T: DeserializeOwned>(&self, builder: RequestBuilder) -> Result<T, ClientError> {
        let response = self.send(builder.timeout(CALL_TIMEOUT)).await?;
        let (url, status) = (response.url().to_string(), response.status().as_u16());
        let bytes = response.bytes().await.map_err(|source| ClientError::Unreachable {
            url: url.clone(),
            source,
        })?;
        serde_json::from_slice(&bytes).map_err(|error| ClientError::Unexpected {
            url,
            status,
            detail: error.to_string(),
        })
    }

    /// Sends and turns every answer that is not a success into a typed error.
    pub(crate) async fn send(&self, builder: RequestBuilder) -> Result<Response, ClientError> {
        let response = builder.send().await.map_err(|source| ClientError::Unreachable {
            url: self.base.clone(),
            source,
        })?;
        if response.status().is_success() {
            return Ok(response);
        }
        let (url, status) = (response.url().to_string(), response.status().as_u16());
        let body = response.bytes().await.unwrap_or_default();
        Err(match serde_json::from_slice::<Problem>(&body) {
            Ok(problem) => ClientError::Refused(Box::new(problem)),
            Err(_) => ClientError::Unexpected {
                url,
                status,
                detail: "the body is not a problem document".into(),
            },
        })
    }
}

/// A name as it may stand in an address.
fn escaped(name: &str) -> String {
    name.bytes().fold(String::new(), |mut text, byte| {
        if byte.is_ascii_alphanumeric() || b"-._~".contains(&byte) {
            text.push(char::from(byte));
        } else {
            text.push_str(&format!("%{byte:02X}"));
        }
        text
    })
}
