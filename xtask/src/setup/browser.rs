//! The browser of the browser tests and its driver.

use std::path::PathBuf;
use std::process::Command;

use super::Missing;
use crate::paths;

/// A browser and the program that steers it.
#[derive(Debug)]
pub struct Browser {
    pub chromium: PathBuf,
    pub chromedriver: PathBuf,
}

impl Browser {
    /// Tells a test process which browser to use.
    pub fn export(&self, command: &mut Command) {
        command
            .env("ROBOPHEUS_CHROMIUM", &self.chromium)
            .env("ROBOPHEUS_CHROMEDRIVER", &self.chromedriver);
    }
}

/// Looks on PATH.
pub fn find() -> Result<Browser, Missing> {
    let chromium = ["chromium", "chromium-browser", "google-chrome", "google-chrome-stable"]
        .into_iter()
        .find_map(paths::on_path);
    let chromedriver = ["chromedriver", "chromium-driver"].into_iter().find_map(paths::on_path);
    match (chromium, chromedriver) {
        (Some(chromium), Some(chromedriver)) => Ok(Browser { chromium, chromedriver }),
        _ => Err(Missing {
            what: "Chromium and chromedriver (browser tests)",
            remedy: "install both with your system's package manager so that `chromium` and `chromedriver` are on PATH",
            packages: &["chromium", "chromium-driver"],
        }),
    }
}
