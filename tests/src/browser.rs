//! A real Chromium, driven with mouse and keyboard through ChromeDriver.
//!
//! The dashboard is one canvas: where its widgets are it says itself (`window.__robopheus.inspect()`); everything
//! that is done is done by real input events at those places.

use anyhow::{Context, ensure};
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};
use thirtyfour::{ChromiumLikeCapabilities, DesiredCapabilities, Key, WebDriver};

const DRIVER_LIMIT: Duration = Duration::from_secs(20);
/// Within this a widget is there and has stopped moving.
const STANDING_LIMIT: Duration = Duration::from_secs(20);
/// A page draws several times a second even when nothing happens; one that has not for so long is not waited for.
const IDLE_LIMIT: Duration = Duration::from_secs(3);

/// One notch of a mouse wheel.
const WHEEL_STEP_PX: i64 = 100;

pub struct Browser {
    driver: Child,
    pub page: WebDriver,
    profile: PathBuf,
    pub downloads: PathBuf,
}

impl Browser {
    /// Starts ChromeDriver on a free port and opens a window of 1400 x 900 on `address`.
    pub async fn open(address: &str, folder: &Path) -> anyhow::Result<Self> {
        let port = std::net::TcpListener::bind("127.0.0.1:0")?.local_addr()?.port();
        let log = std::fs::File::create(folder.join("chromedriver.log"))?;
        let driver = Command::new("chromedriver")
            .arg(format!("--port={port}"))
            .stdin(Stdio::null())
            .stdout(log.try_clone()?)
            .stderr(log)
            .spawn()
            .context("cannot start chromedriver (Debian: chromium-driver)")?;
        let (profile, downloads) = (folder.join("chromium"), folder.join("downloads"));
        std::fs::create_dir_all(&downloads)?;
        let mut wanted = DesiredCapabilities::chrome();
        for flag in [
            "--headless=new",
            "--no-sandbox",
            "--disable-gpu",
            "--enable-unsafe-swiftshader",
            "--disable-quic",
            "--no-first-run",
            "--disable-background-networking",
            "--disable-component-update",
            "--disable-sync",
            "--disable-dev-shm-usage",
            "--force-device-scale-factor=1",
            "--window-size=1400,900",
        ] {
            wanted.add_arg(flag)?;
        }
        wanted.add_arg(&format!("--user-data-dir={}", profile.display()))?;
        wanted.add_experimental_option(
            "prefs",
            serde_json::json!({ "download.default_directory": downloads, "download.prompt_for_download": false }),
        )?;
        let start = Instant::now();
        let page = loop {
            match WebDriver::new(&format!("http://127.0.0.1:{port}"), wanted.clone()).await {
                Ok(page) => break page,
                Err(error) if start.elapsed() > DRIVER_LIMIT => return Err(error).context("no answer of chromedriver"),
                Err(_) => tokio::time::sleep(Duration::from_millis(100)).await,
            }
        };
        page.goto(address).await?;
        Ok(Self {
            driver,
            page,
            profile,
            downloads,
        })
    }

    /// What the dashboard says of itself: page, places of its widgets, state.
    pub async fn inspect(&self) -> anyhow::Result<Value> {
        let script = "return window.__robopheus ? window.__robopheus.inspect() : 'null'";
        let value = self.page.execute(script, Vec::new()).await?.json().clone();
        Ok(match value {
            Value::String(text) => serde_json::from_str(&text)?,
            other => other,
        })
    }

    /// Waits until the dashboard's own description satisfies `holds`.
    pub async fn wait(&self, what: &str, limit: Duration, holds: impl Fn(&Value) -> bool) -> anyhow::Result<Value> {
        let start = Instant::now();
        loop {
            let seen = self.inspect().await?;
            if holds(&seen) {
                return Ok(seen);
            }
            if start.elapsed() > limit {
                let picture = std::env::temp_dir().join("robopheus-browser-failure.png");
                let _ = self.page.screenshot(&picture).await;
                anyhow::bail!(
                    "waited {limit:?} in vain for {what}; picture in {}; {seen:#}",
                    picture.display()
                );
            }
            tokio::time::sleep(Duration::from_millis(100)).await;
        }
    }

    /// Moves the mouse to the middle of a widget and clicks.
    pub async fn click(&self, widget: &str) -> anyhow::Result<()> {
        let (x, y) = self.middle(widget).await?;
        // Two steps: egui wants to see the pointer over a widget before it is pressed.
        let before = frame(&self.inspect().await?);
        self.page.action_chain().move_to(x, y).perform().await?;
        let _ = self.next_frames(before, 2).await?;
        self.page.action_chain().click().perform().await?;
        Ok(())
    }

    /// Presses the mouse in the middle of a widget, moves it and lets go.
    pub async fn drag(&self, widget: &str, right: i64, down: i64) -> anyhow::Result<()> {
        let (x, y) = self.middle(widget).await?;
        self.page
            .action_chain()
            .move_to(x, y)
            .click_and_hold()
            .perform()
            .await?;
        for step in 1..=5 {
            self.page
                .action_chain()
                .move_to(x + right * step / 5, y + down * step / 5)
                .perform()
                .await?;
            tokio::time::sleep(Duration::from_millis(50)).await;
        }
        self.page.action_chain().release().perform().await?;
        Ok(())
    }

    /// Turns the mouse wheel over a widget until another one can be seen, as somebody would who looks for it.
    pub async fn scroll_to(&self, widget: &str, over: &str) -> anyhow::Result<()> {
        let start = Instant::now();
        let mut seen = self.inspect().await?;
        while !seen["widgets"][widget].is_object() && start.elapsed() < STANDING_LIMIT {
            let (x, y) = self.middle(over).await?;
            let turn = serde_json::json!({
                "type": "mouseWheel", "x": x, "y": y, "deltaX": 0, "deltaY": WHEEL_STEP_PX,
            });
            self.page.cdp().send_raw("Input.dispatchMouseEvent", turn).await?;
            seen = self.next_frames(frame(&seen), 3).await?;
        }
        ensure!(
            seen["widgets"][widget].is_object(),
            "the wheel over {over} never brought {widget} into view"
        );
        Ok(())
    }

    pub async fn press(&self, key: char) -> anyhow::Result<()> {
        self.page.action_chain().key_down(key).key_up(key).perform().await?;
        Ok(())
    }

    pub async fn press_enter(&self) -> anyhow::Result<()> {
        let chain = self.page.action_chain().key_down(Key::Enter).key_up(Key::Enter);
        chain.perform().await?;
        Ok(())
    }

    pub async fn press_control(&self, key: char) -> anyhow::Result<()> {
        let chain = self.page.action_chain().key_down(Key::Control).key_down(key);
        chain.key_up(key).key_up(Key::Control).perform().await?;
        Ok(())
    }

    /// Types a text key by key, line by line.
    pub async fn type_text(&self, text: &str) -> anyhow::Result<()> {
        let mut lines = text.split('\n').peekable();
        while let Some(line) = lines.next() {
            if !line.is_empty() {
                self.page.action_chain().send_keys(line).perform().await?;
            }
            if lines.peek().is_some() {
                // A list of words that is open would take the key for itself.
                tokio::time::sleep(Duration::from_millis(120)).await;
                if self.inspect().await?["widgets"]["compose.words"].is_object() {
                    self.page
                        .action_chain()
                        .key_down(Key::Escape)
                        .key_up(Key::Escape)
                        .perform()
                        .await?;
                    tokio::time::sleep(Duration::from_millis(60)).await;
                }
                self.press_enter().await?;
                tokio::time::sleep(Duration::from_millis(60)).await;
            }
        }
        Ok(())
    }

    pub async fn press_control_enter(&self) -> anyhow::Result<()> {
        let chain = self.page.action_chain().key_down(Key::Control).key_down(Key::Enter);
        chain.key_up(Key::Enter).key_up(Key::Control).perform().await?;
        Ok(())
    }

    /// Where the middle of a widget is, once it stands still: lists that open find their place within a few frames.
    async fn middle(&self, widget: &str) -> anyhow::Result<(i64, i64)> {
        let present = |seen: &Value| seen["widgets"][widget].is_object();
        let start = Instant::now();
        let mut seen = self
            .wait(&format!("the widget {widget}"), STANDING_LIMIT, present)
            .await?;
        loop {
            let later = self.next_frames(frame(&seen), 2).await?;
            let stands = present(&later) && later["widgets"][widget] == seen["widgets"][widget];
            seen = later;
            if stands {
                break;
            }
            ensure!(
                start.elapsed() < STANDING_LIMIT,
                "the widget {widget} does not stand still"
            );
        }
        let place = &seen["widgets"][widget];
        let at = |key: &str| {
            place[key]
                .as_f64()
                .with_context(|| format!("widget {widget} has no {key}"))
        };
        Ok(((at("x")? + at("w")? / 2.0) as i64, (at("y")? + at("h")? / 2.0) as i64))
    }

    /// What the page says when it has drawn `count` frames more than `drawn`.
    async fn next_frames(&self, drawn: u64, count: u64) -> anyhow::Result<Value> {
        let start = Instant::now();
        loop {
            tokio::time::sleep(Duration::from_millis(50)).await;
            let seen = self.inspect().await?;
            if frame(&seen) >= drawn + count || start.elapsed() > IDLE_LIMIT {
                return Ok(seen);
            }
        }
    }

    /// Saves what the window shows; an image that is one colour is refused.
    pub async fn picture(&self, path: &Path) -> anyhow::Result<()> {
        if let Some(folder) = path.parent() {
            std::fs::create_dir_all(folder)?;
        }
        self.page.screenshot(path).await?;
        // A blank page of this size compresses to a few kilobytes.
        ensure!(
            std::fs::metadata(path)?.len() > 15_000,
            "{} looks blank",
            path.display()
        );
        Ok(())
    }

    pub async fn close(self) -> anyhow::Result<()> {
        self.page.clone().quit().await?;
        Ok(())
    }
}

impl Drop for Browser {
    fn drop(&mut self) {
        let _ = self.driver.kill();
        let _ = self.driver.wait();
        // A killed driver leaves its browser behind.
        kill_all_with(&self.profile.display().to_string());
        let _ = std::fs::remove_dir_all(&self.profile);
    }
}

fn frame(seen: &Value) -> u64 {
    seen["frame"].as_u64().unwrap_or_default()
}

/// SIGKILL to every process that has `argument` somewhere in its command line.
#[allow(unsafe_code)] // kill(2) has no safe wrapper in std
fn kill_all_with(argument: &str) {
    for entry in std::fs::read_dir("/proc").into_iter().flatten().flatten() {
        let Some(pid) = entry.file_name().to_str().and_then(|name| name.parse::<i32>().ok()) else {
            continue;
        };
        let line = std::fs::read(entry.path().join("cmdline")).unwrap_or_default();
        if String::from_utf8_lossy(&line).contains(argument) && pid > 1 {
            // SAFETY: kill takes two integers and touches no memory of ours.
            unsafe {
                libc::kill(pid, libc::SIGKILL);
            }
        }
    }
}
