//! Starts `cargo xtask up` on free ports in a temporary folder and talks to it as a stranger would.

use anyhow::{Context, bail, ensure};
use api::experiment::ExperimentView;
use api::run::{RunState, RunView};
use serde::Deserialize;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};
use uuid::Uuid;

/// From the start of `up` (nothing to build) to a laboratory that takes runs.
const START_LIMIT: Duration = Duration::from_secs(60);
const STOP_LIMIT: Duration = Duration::from_secs(20);

/// A running system; stopped when dropped.
pub struct System {
    up: Child,
    pub data: PathBuf,
    pub http: reqwest::Client,
    pub base: String,
}

/// What `up` writes for programs: `<data>/up.json`.
#[derive(Debug, Deserialize)]
pub struct UpFile {
    pub server: String,
    pub pids: BTreeMap<String, i32>,
}

/// The checkout that the tests belong to.
pub fn repository() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .parent()
        .map(Path::to_owned)
        .unwrap_or_default()
}

impl System {
    /// Starts everything and waits until the laboratory is connected.
    pub async fn start(name: &str) -> anyhow::Result<Self> {
        Self::start_with(name, &[]).await
    }

    /// As [`Self::start`], with further flags of `up`.
    pub async fn start_with(name: &str, flags: &[&str]) -> anyhow::Result<Self> {
        let _ = rustls::crypto::ring::default_provider().install_default();
        let data = std::env::temp_dir().join(format!("robopheus-{name}-{}", std::process::id()));
        if data.exists() {
            std::fs::remove_dir_all(&data).with_context(|| format!("cannot clear {}", data.display()))?;
        }
        std::fs::create_dir_all(&data)?;
        let log = std::fs::File::create(data.join("up.log"))?;
        let up = Command::new(up_program()?)
            .args(["up", "--port", "0", "--skip-build", "--data"])
            .arg(&data)
            .args(flags)
            .current_dir(repository())
            .stdin(Stdio::null())
            .stdout(log.try_clone()?)
            .stderr(log)
            .spawn()
            .context("cannot start `xtask up`")?;
        let http = reqwest::Client::builder().timeout(Duration::from_secs(60)).build()?;
        let mut system = Self {
            up,
            data,
            http,
            base: String::new(),
        };
        system.wait_until_ready(!flags.contains(&"--no-lab")).await?;
        Ok(system)
    }

    async fn wait_until_ready(&mut self, with_lab: bool) -> anyhow::Result<()> {
        let start = Instant::now();
        loop {
            if let Some(status) = self.up.try_wait()? {
                bail!("`up` ended with {status}:\n{}", self.log("up.log"));
            }
            // The file is written when the service is up and again when everything is; the laboratory may register in between.
            if let Ok(file) = self.up_file()
                && (!with_lab || file.pids.keys().any(|name| name.contains("lab")))
            {
                let address = file
                    .server
                    .trim_start_matches("http://")
                    .trim_end_matches('/')
                    .to_owned();
                self.base = format!("http://{address}");
                if let Ok(arenas) = self.get("/api/v1/arenas").await
                    && arenas
                        .as_array()
                        .is_some_and(|all| !with_lab || all.iter().any(|arena| arena["state"] == "free"))
                {
                    return Ok(());
                }
            }
            ensure!(
                start.elapsed() < START_LIMIT,
                "no free arena after {START_LIMIT:?}:\n{}",
                self.log("up.log")
            );
            tokio::time::sleep(Duration::from_millis(100)).await;
        }
    }

    pub fn up_file(&self) -> anyhow::Result<UpFile> {
        Ok(serde_json::from_slice(&std::fs::read(self.data.join("up.json"))?)?)
    }

    /// Process identifier of one of the system's processes: `server`, `scheduler`, `lab`, `emulator`, `postgres`.
    pub fn pid(&self, name: &str) -> anyhow::Result<i32> {
        let file = self.up_file()?;
        file.pids
            .get(name)
            .copied()
            .with_context(|| format!("no process {name:?} among {:?}", file.pids.keys()))
    }

    /// Sends a signal to one of the processes.
    pub fn signal(&self, name: &str, number: i32) -> anyhow::Result<()> {
        signal(self.pid(name)?, number)
    }

    /// Sends a signal to one of the processes and to its children, which a database server has many of.
    pub fn signal_all(&self, name: &str, number: i32) -> anyhow::Result<()> {
        let parent = self.pid(name)?;
        for child in children(parent) {
            // One that has just ended needs no signal.
            let _ended = signal(child, number);
        }
        signal(parent, number)
    }

    /// SIGKILL, without any chance to tidy up.
    pub fn kill_9(&self, name: &str) -> anyhow::Result<()> {
        signal(self.pid(name)?, libc::SIGKILL)
    }

    pub async fn get(&self, path: &str) -> anyhow::Result<Value> {
        let response = self.http.get(format!("{}{path}", self.base)).send().await?;
        let status = response.status();
        let body = response.text().await?;
        ensure!(status.is_success(), "GET {path}: {status}: {body}");
        Ok(serde_json::from_str(&body)?)
    }

    /// Submits an experiment document; returns the run.
    pub async fn submit(&self, experiment: &Value, claim: Option<Value>) -> anyhow::Result<Uuid> {
        let body = json!({ "experiment": experiment, "claim": claim, "label": "system test" });
        let request = self.http.post(format!("{}/api/v1/experiments", self.base));
        let response = request
            .header("idempotency-key", Uuid::now_v7().to_string())
            .json(&body)
            .send()
            .await?;
        let status = response.status();
        let text = response.text().await?;
        ensure!(status.is_success(), "submitting: {status}: {text}");
        Ok(serde_json::from_str::<ExperimentView>(&text)?.run_id)
    }

    pub async fn run(&self, id: Uuid) -> anyhow::Result<RunView> {
        Ok(serde_json::from_value(self.get(&format!("/api/v1/runs/{id}")).await?)?)
    }

    /// Waits for a state or a later one; a service that is being restarted meanwhile is no failure.
    pub async fn wait_for_state(&self, id: Uuid, state: RunState, limit: Duration) -> anyhow::Result<RunView> {
        let start = Instant::now();
        loop {
            let seen = self.run(id).await;
            if let Ok(run) = &seen
                && (run.state >= state || run.state.is_terminal())
            {
                return seen;
            }
            ensure!(
                start.elapsed() < limit,
                "run {id} not {} after {limit:?}: {seen:?}",
                state.as_str()
            );
            tokio::time::sleep(Duration::from_millis(50)).await;
        }
    }

    pub async fn wait_until_ended(&self, id: Uuid, limit: Duration) -> anyhow::Result<RunView> {
        self.wait_for_state(id, RunState::Done, limit).await
    }

    pub async fn download(&self, path: &str) -> anyhow::Result<Vec<u8>> {
        let response = self.http.get(format!("{}{path}", self.base)).send().await?;
        let status = response.status();
        let body = response.bytes().await?;
        ensure!(
            status.is_success(),
            "GET {path}: {status}: {}",
            String::from_utf8_lossy(&body)
        );
        Ok(body.to_vec())
    }

    /// The end of a log file, for messages of failed tests.
    pub fn log(&self, name: &str) -> String {
        let text = std::fs::read(self.data.join(name)).unwrap_or_default();
        let tail = &text[text.len().saturating_sub(4000)..];
        String::from_utf8_lossy(tail).into_owned()
    }

    /// Stops everything as Ctrl-C does and returns what was left behind: processes and sockets.
    pub fn stop(self) -> anyhow::Result<Vec<String>> {
        self.stop_and(|| Ok(()))
    }

    /// As [`Self::stop`], with a last look at the folder before it goes.
    pub fn stop_and(mut self, look: impl FnOnce() -> std::io::Result<()>) -> anyhow::Result<Vec<String>> {
        let pids = self.up_file().map(|file| file.pids).unwrap_or_default();
        let status = self.stop_up()?;
        look()?;
        let mut left = Vec::new();
        if !status.success() {
            left.push(format!("`up` ended with {status}"));
        }
        for (name, pid) in pids {
            if Path::new(&format!("/proc/{pid}")).exists() {
                left.push(format!("process {name} ({pid})"));
            }
        }
        for socket in [
            "hand.sock",
            "camera-0.sock",
            "camera-0.poses.sock",
            "camera-1.sock",
            "camera-1.poses.sock",
        ] {
            if self.data.join(socket).exists() {
                left.push(format!("socket {socket}"));
            }
        }
        Ok(left)
    }

    fn stop_up(&mut self) -> anyhow::Result<std::process::ExitStatus> {
        if let Some(status) = self.up.try_wait()? {
            return Ok(status);
        }
        signal(i32::try_from(self.up.id())?, libc::SIGINT)?;
        let start = Instant::now();
        while start.elapsed() < STOP_LIMIT {
            if let Some(status) = self.up.try_wait()? {
                return Ok(status);
            }
            std::thread::sleep(Duration::from_millis(50));
        }
        self.up.kill()?;
        bail!("`up` did not stop within {STOP_LIMIT:?}")
    }
}

impl Drop for System {
    fn drop(&mut self) {
        let _ = self.stop_up();
        if std::env::var_os("ROBOPHEUS_KEEP").is_none() {
            let _ = std::fs::remove_dir_all(&self.data);
        }
    }
}

/// `xtask` beside this test's own program, or what ROBOPHEUS_UP names.
fn up_program() -> anyhow::Result<PathBuf> {
    if let Some(path) = std::env::var_os("ROBOPHEUS_UP") {
        return Ok(path.into());
    }
    let own = std::env::current_exe()?;
    let found = own
        .ancestors()
        .map(|folder| folder.join("xtask"))
        .find(|path| path.is_file());
    found.context("no program xtask beside the tests: run them with `cargo xtask test`")
}

/// Processes that this one started.
fn children(parent: i32) -> Vec<i32> {
    let all = std::fs::read_dir("/proc").into_iter().flatten().flatten();
    let numbers = all.filter_map(|entry| entry.file_name().to_str()?.parse::<i32>().ok());
    let is_child = |pid: &i32| {
        let stat = std::fs::read_to_string(format!("/proc/{pid}/stat")).unwrap_or_default();
        // "pid (name) state parent ..."; a name may hold anything but ends at the last bracket.
        let fields = stat.rsplit_once(')').map_or("", |(_, fields)| fields);
        fields.split_whitespace().nth(1) == Some(&parent.to_string())
    };
    numbers.filter(is_child).collect()
}

#[allow(unsafe_code)] // kill(2) has no safe wrapper in std
fn signal(pid: i32, signal: i32) -> anyhow::Result<()> {
    ensure!(pid > 1, "refusing to signal process {pid}");
    // SAFETY: kill takes two integers and touches no memory of ours.
    ensure!(
        unsafe { libc::kill(pid, signal) } == 0,
        "cannot signal {pid}: {}",
        std::io::Error::last_os_error()
    );
    Ok(())
}
