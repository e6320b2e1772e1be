//! How long a control tick takes when ten robots are corrected by their models.

use anyhow::Result;

use crate::{End, run};

/// `cargo xtask bench interaction`.
pub fn bench() -> Result<End> {
    let mut command = run::cargo([
        "run",
        "--quiet",
        "--locked",
        "--release",
        "--package",
        "control",
        "--example",
        "interaction_bench",
    ]);
    Ok(if command.status()?.success() {
        End::Good
    } else {
        End::Failed
    })
}
