//! `cargo xtask bench controllers`: time of a tick of own controllers, in the profile that the product runs in.

use anyhow::Result;

use crate::{End, run};

/// What `controllers/examples/bench.rs` prints.
pub fn bench() -> Result<End> {
    run::succeed(&mut run::cargo([
        "run",
        "--quiet",
        "--locked",
        "--package",
        "controllers",
        "--example",
        "bench",
    ]))?;
    Ok(End::Good)
}
