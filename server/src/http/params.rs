//! Parameters from path, query and headers, with problems that name them.

use super::problem::ApiError;
use api::problem::FieldProblem;
use axum::extract::rejection::{PathRejection, QueryRejection};
use axum::extract::{FromRequestParts, Path, Query};
use axum::http::request::Parts;
use serde::Deserialize;
use uuid::Uuid;

/// `{id}` of the path.
#[derive(Debug, Clone, Copy)]
pub struct Id(pub Uuid);

/// `{robot}` of the path.
#[derive(Debug, Clone)]
pub struct RobotName(pub String);

/// `{id}` and `{*name}` of the path.
#[derive(Debug, Clone)]
pub struct FilePath {
    pub run: Uuid,
    pub name: String,
}

/// Query string of a type that refuses what it does not know.
#[derive(Debug, FromRequestParts)]
#[from_request(via(Query), rejection(ApiError))]
pub struct QueryOf<T>(pub T);

#[derive(Deserialize)]
struct RawId {
    id: String,
}

#[derive(Deserialize)]
struct RawRobot {
    robot: String,
}

#[derive(Deserialize)]
struct RawFilePath {
    id: String,
    name: String,
}

impl<S: Send + Sync> FromRequestParts<S> for Id {
    type Rejection = ApiError;

    async fn from_request_parts(parts: &mut Parts, state: &S) -> Result<Self, ApiError> {
        let Path(raw) = Path::<RawId>::from_request_parts(parts, state).await?;
        Ok(Self(uuid(&raw.id)?))
    }
}

impl<S: Send + Sync> FromRequestParts<S> for RobotName {
    type Rejection = ApiError;

    async fn from_request_parts(parts: &mut Parts, state: &S) -> Result<Self, ApiError> {
        let Path(raw) = Path::<RawRobot>::from_request_parts(parts, state).await?;
        Ok(Self(raw.robot))
    }
}

impl<S: Send + Sync> FromRequestParts<S> for FilePath {
    type Rejection = ApiError;

    async fn from_request_parts(parts: &mut Parts, state: &S) -> Result<Self, ApiError> {
        let Path(raw) = Path::<RawFilePath>::from_request_parts(parts, state).await?;
        Ok(Self {
            run: uuid(&raw.id)?,
            name: raw.name,
        })
    }
}

fn uuid(text: &str) -> Result<Uuid, ApiError> {
    Uuid::try_parse(text).map_err(|error| {
        ApiError::malformed(
            "the id in the path is not a UUID",
            vec![FieldProblem {
                field: "id".to_owned(),
                message: error.to_string(),
                limit: "a UUID such as 0199f3c0-1111-7000-8000-000000000000".to_owned(),
                remedy: "take the id from a list or from the answer to the submission".to_owned(),
            }],
        )
    })
}

/// A problem with one named query parameter or header.
pub fn bad_parameter(field: &str, message: impl Into<String>, limit: &str) -> ApiError {
    let message = message.into();
    let problem = FieldProblem {
        field: field.to_owned(),
        message: message.clone(),
        limit: limit.to_owned(),
        remedy: format!("correct `{field}`"),
    };
    ApiError::malformed(format!("{field}: {message}"), vec![problem])
}

impl From<PathRejection> for ApiError {
    fn from(rejection: PathRejection) -> Self {
        Self::malformed(rejection.body_text(), Vec::new())
    }
}

impl From<QueryRejection> for ApiError {
    fn from(rejection: QueryRejection) -> Self {
        bad_parameter("query", rejection.body_text(), "the parameters listed in /api/v1/docs")
    }
}
