//! Model versions: `robopheus.model/1`.

use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::effect::Effect;
use crate::parameter::ParameterError;
use crate::residual::ResidualDocument;
use crate::robot::{Robot, RobotDescription};

/// The format this crate reads and writes.
pub const FORMAT: &str = "robopheus.model/1";

/// A model as a document: nominal robot, effects in their order, learned residual, where the numbers came from.
///
/// Immutable: the identifier is the SHA-256 of the document without it (keys sorted, no white space).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ModelDocument {
    pub format: String,
    pub id: String,
    #[serde(default)]
    pub parent: Option<String>,
    pub robot: RobotDescription,
    pub floor: String,
    #[serde(default)]
    pub effects: Vec<Effect>,
    #[serde(default)]
    pub residual: Option<ResidualDocument>,
    #[serde(default)]
    pub provenance: Value,
}

/// Why a document is no model.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ModelError {
    #[error("not a model document: {0}")]
    Json(String),
    #[error("format {found:?} is not {FORMAT:?}")]
    Format { found: String },
    #[error("id {found} is not that of the document, {expected}: it was changed after it was made")]
    Id { found: String, expected: String },
    #[error(transparent)]
    Parameter(#[from] ParameterError),
}

impl ModelDocument {
    /// A version made from a parent, with its identifier.
    pub fn new(
        parent: Option<String>,
        robot: RobotDescription,
        floor: &str,
        effects: Vec<Effect>,
        provenance: Value,
    ) -> ModelDocument {
        let mut document = ModelDocument {
            format: FORMAT.to_owned(),
            id: String::new(),
            parent,
            robot,
            floor: floor.to_owned(),
            effects,
            residual: None,
            provenance,
        };
        document.id = document.expected_id();
        document
    }

    /// The same version with a learned residual, and the identifier that this gives.
    pub fn with_residual(mut self, residual: ResidualDocument) -> ModelDocument {
        self.residual = Some(residual);
        self.id = self.expected_id();
        self
    }

    /// Reads and checks a document; an empty identifier (a draft written by hand) is filled in.
    ///
    /// - Errors: not JSON of this shape, another format, an identifier of another document; a robot, effect or residual out of range.
    pub fn parse(text: &str) -> Result<ModelDocument, ModelError> {
        let mut document: ModelDocument =
            serde_json::from_str(text).map_err(|error| ModelError::Json(error.to_string()))?;
        if document.format != FORMAT {
            return Err(ModelError::Format { found: document.format });
        }
        let expected = document.expected_id();
        if document.id.is_empty() {
            document.id = expected;
        } else if document.id != expected {
            return Err(ModelError::Id {
                found: document.id,
                expected,
            });
        }
        document.robot()?;
        Ok(document)
    }

    /// The robot with the effects and the residual of this model.
    pub fn robot(&self) -> Result<Robot, ModelError> {
        Ok(Robot::with_model(
            self.robot.clone(),
            &self.effects,
            self.residual.as_ref(),
        )?)
    }

    /// SHA-256 of the document without its identifier, as 64 hexadecimal characters.
    pub fn expected_id(&self) -> String {
        let mut value = serde_json::to_value(self).unwrap_or_default();
        if let Some(object) = value.as_object_mut() {
            object.remove("id");
        }
        use sha2::Digest;
        let mut text = String::new();
        write_sorted(&value, &mut text);
        let hash = sha2::Sha256::digest(text.as_bytes());
        hash.iter().map(|byte| format!("{byte:02x}")).collect()
    }
}

/// JSON with sorted keys, whatever order a map keeps.
fn write_sorted(value: &Value, out: &mut String) {
    match value {
        Value::Object(members) => {
            let mut keys: Vec<&String> = members.keys().collect();
            keys.sort();
            out.push('{');
            for (position, key) in keys.into_iter().enumerate() {
                if position > 0 {
                    out.push(',');
                }
                out.push_str(&Value::from(key.as_str()).to_string());
                out.push(':');
                write_sorted(&members[key], out);
            }
            out.push('}');
        }
        Value::Array(items) => {
            out.push('[');
            for (position, item) in items.iter().enumerate() {
                if position > 0 {
                    out.push(',');
                }
                write_sorted(item, out);
            }
            out.push(']');
        }
        other => out.push_str(&other.to_string()),
    }
}
