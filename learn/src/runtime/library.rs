//! Where `libonnxruntime` is, and a session of one thread.

use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use ort::environment::Environment;
use ort::session::Session;
use ort::value::TensorRef;

use crate::onnx::{INPUT, OUTPUT};

/// Environment variable with the library's path.
pub const VARIABLE: &str = "ORT_DYLIB_PATH";
/// Folder under the user's cache that `cargo xtask` unpacks the library into.
const CACHE: &str = "robopheus/onnxruntime";
const STEM: &str = "libonnxruntime.so";

/// Why ONNX Runtime cannot be asked.
#[derive(Debug, thiserror::Error)]
pub enum RuntimeError {
    #[error(
        "ONNX Runtime is absent: looked at {looked}; set ORT_DYLIB_PATH to a libonnxruntime.so of version 1.24 or newer (PyPI's onnxruntime wheel carries one)"
    )]
    Absent { looked: String },
    #[error("{path} cannot be used: {message}")]
    Library { path: String, message: String },
    #[error("ONNX Runtime: {0}")]
    Runtime(String),
}

/// Where the library may be, in the order of preference: `ORT_DYLIB_PATH`, beside the program, the cache.
pub fn candidates() -> Vec<PathBuf> {
    let mut all: Vec<PathBuf> = Vec::new();
    if let Some(given) = std::env::var_os(VARIABLE).filter(|given| !given.is_empty()) {
        // What is named is meant: nothing else is tried.
        return vec![PathBuf::from(given)];
    }
    let beside = std::env::current_exe()
        .ok()
        .and_then(|program| program.parent().map(Path::to_path_buf));
    let cache = std::env::var_os("XDG_CACHE_HOME")
        .map(PathBuf::from)
        .or_else(|| Some(PathBuf::from(std::env::var_os("HOME")?).join(".cache")));
    for folder in [beside, cache.map(|cache| cache.join(CACHE))].into_iter().flatten() {
        let names = std::fs::read_dir(&folder).into_iter().flatten().flatten();
        let mut found: Vec<PathBuf> = names
            .map(|entry| entry.path())
            .filter(|path| {
                path.file_name()
                    .is_some_and(|name| name.to_string_lossy().starts_with(STEM))
            })
            .collect();
        found.sort();
        all.extend(found.into_iter().rev());
    }
    all
}

/// A loaded library; one a process, the first one stays.
pub struct Runtime {
    environment: Environment,
    /// The file it came from.
    pub path: PathBuf,
}

impl Runtime {
    /// Loads the first library of [`candidates`] that is there.
    ///
    /// - Errors: none is there, or it cannot be loaded or is older than 1.24.
    pub fn load() -> Result<Runtime, RuntimeError> {
        let candidates = candidates();
        let Some(path) = candidates.iter().find(|path| path.is_file()) else {
            let looked: Vec<String> = candidates.iter().map(|path| path.display().to_string()).collect();
            let looked = if looked.is_empty() {
                format!("${VARIABLE}, beside the program, ~/.cache/{CACHE}")
            } else {
                looked.join(", ")
            };
            return Err(RuntimeError::Absent { looked });
        };
        Runtime::load_from(path)
    }

    /// Loads a file, unless the process has loaded one already: the first stays, and so does its failure.
    ///
    /// - Errors: it cannot be loaded or is older than 1.24.
    pub fn load_from(path: &Path) -> Result<Runtime, RuntimeError> {
        let wrong = |path: &Path, message: String| RuntimeError::Library {
            path: path.display().to_string(),
            message,
        };
        if !path.is_file() {
            return Err(wrong(path, "there is no such file".to_owned()));
        }
        // `ort` keeps a library that it could not load as if it had: a second attempt of the process would panic.
        static FIRST: OnceLock<(PathBuf, Result<(), String>)> = OnceLock::new();
        let (path, loaded) = FIRST.get_or_init(|| {
            let loaded = ort::init_from(path).map(drop).map_err(|error| error.to_string());
            (path.to_path_buf(), loaded)
        });
        if let Err(message) = loaded {
            return Err(wrong(path, message.clone()));
        }
        let builder = ort::init_from(path).map_err(|error| wrong(path, error.to_string()))?;
        let environment = builder.build().map_err(|error| wrong(path, error.to_string()))?;
        Ok(Runtime {
            environment,
            path: path.clone(),
        })
    }

    /// A session on one thread.
    ///
    /// - Errors: bytes that ONNX Runtime does not take.
    pub fn session(&self, bytes: &[u8]) -> Result<Inference, RuntimeError> {
        let wrong = |error: String| RuntimeError::Runtime(error);
        let mut builder = Session::builder(&self.environment)
            .map_err(|error| wrong(error.to_string()))?
            .with_intra_threads(1)
            .map_err(|error| wrong(error.to_string()))?;
        let session = builder
            .commit_from_memory(bytes)
            .map_err(|error| wrong(error.to_string()))?;
        Ok(Inference { session })
    }
}

/// A loaded model.
pub struct Inference {
    session: Session,
}

impl Inference {
    /// Outputs of rows of inputs, row by row.
    ///
    /// - Errors: another width than the model's.
    pub fn run(&mut self, rows: usize, width: usize, inputs: &[f32]) -> Result<Vec<f32>, RuntimeError> {
        self.run_named([INPUT, OUTPUT], rows, width, inputs)
    }

    /// [`Self::run`] of a model whose input and output have other names.
    pub fn run_named(
        &mut self,
        [input, output]: [&str; 2],
        rows: usize,
        width: usize,
        inputs: &[f32],
    ) -> Result<Vec<f32>, RuntimeError> {
        let wrong = |error: ort::Error| RuntimeError::Runtime(error.to_string());
        let tensor = TensorRef::from_array_view(([rows, width], inputs)).map_err(wrong)?;
        let outputs = self.session.run(ort::inputs![input => tensor]).map_err(wrong)?;
        let found = outputs
            .get(output)
            .ok_or_else(|| RuntimeError::Runtime(format!("no output {output:?}")))?;
        let (_, values) = found.try_extract_tensor::<f32>().map_err(wrong)?;
        Ok(values.to_vec())
    }
}
