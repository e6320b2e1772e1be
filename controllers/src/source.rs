//! The text or the bytes of a program, as an experiment carries them.

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use control::law::own::{MAX_MODULE_BYTES, MAX_POLICY_BYTES, MAX_SCRIPT_BYTES, MODULE, POLICY, SCRIPT};
use control::law::{Fault, FaultKind};
use control::scenario::Control;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

/// A program before it is compiled.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Source {
    /// A rhai script.
    Script(String),
    /// A WebAssembly module in base64.
    Module(String),
    /// A trained network, an ONNX file in base64.
    Policy(String),
}

impl Source {
    /// The program of a `control` section that has passed its checks; `None` when there is none.
    pub fn of(control: &Control) -> Option<Source> {
        let text = |key: &str| control.parameters.get(key)?.as_str().map(str::to_owned);
        text(SCRIPT)
            .map(Source::Script)
            .or_else(|| text(MODULE).map(Source::Module))
            .or_else(|| text(POLICY).map(Source::Policy))
    }

    /// A module from its bytes.
    pub fn module(bytes: &[u8]) -> Source {
        Source::Module(STANDARD.encode(bytes))
    }

    /// A policy from the bytes of its ONNX file.
    pub fn policy(bytes: &[u8]) -> Source {
        Source::Policy(STANDARD.encode(bytes))
    }

    /// Bytes of the program.
    ///
    /// - Errors: base64 that cannot be read, and programs above [`MAX_SCRIPT_BYTES`], [`MAX_MODULE_BYTES`] or
    ///   [`MAX_POLICY_BYTES`].
    pub fn bytes(&self) -> Result<Vec<u8>, Fault> {
        let decoded = |text: &str, what: &str| {
            let bytes = STANDARD.decode(text);
            bytes.map_err(|error| refused(format!("the {what} is not base64: {error}")))
        };
        let (bytes, most, what) = match self {
            Source::Script(text) => (text.as_bytes().to_vec(), MAX_SCRIPT_BYTES, "script"),
            Source::Module(text) => (decoded(text, "module")?, MAX_MODULE_BYTES, "module"),
            Source::Policy(text) => (decoded(text, "policy")?, MAX_POLICY_BYTES, "policy"),
        };
        if bytes.is_empty() || bytes.len() > most {
            return Err(refused(format!(
                "the {what} has {} bytes; 1 to {most} are allowed",
                bytes.len()
            )));
        }
        Ok(bytes)
    }

    /// SHA-256 of the bytes, lower-case hexadecimal: what a program is known by.
    pub fn sha256(&self) -> Result<String, Fault> {
        Ok(format!("{:x}", Sha256::digest(self.bytes()?)))
    }

    /// Key in `control.parameters`.
    pub fn key(&self) -> &'static str {
        match self {
            Source::Script(_) => SCRIPT,
            Source::Module(_) => MODULE,
            Source::Policy(_) => POLICY,
        }
    }
}

pub(crate) fn refused(reason: String) -> Fault {
    Fault::new(FaultKind::Refused, None, reason)
}
