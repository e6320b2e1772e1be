//! `cargo xtask bench controllers`: time of a tick of own controllers, in the profile that the product runs in.

use anyhow::Result;

use crate::{End, run};

/// What `controllers/examples/tick_times.rs` prints.
pub fn bench() -> Result<End> {
    run::succeed(&mut run::cargo([
        "run",
        "--quiet",
        "--locked",
        "--package",
        "controllers",
        "--example",
        "tick_times",
    ]))?;
    Ok(End::Good)
}
