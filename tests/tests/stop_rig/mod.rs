//! An emulator and a laboratory as processes of their own, with a tap on the robot link between them; without a service, or
//! with one that runs elsewhere.
#![allow(dead_code, reason = "every test file uses its own part")]

use anyhow::{Context, ensure};
use robot::frame::{Payload, decode_for};
use robot::key::Key;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::net::UdpSocket;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::{Duration, Instant};
use system_tests::{PoseWatch, ask_hand, ask_stop_port};

const START_LIMIT: Duration = Duration::from_secs(30);

/// A frame with the stop flag on its way to a robot.
#[derive(Debug, Clone, Copy)]
pub struct StopFrame {
    pub robot: u8,
    pub at: Instant,
}

/// See the module. Everything ends when it is dropped.
pub struct StopRig {
    emulator: Child,
    lab: Option<Child>,
    folder: PathBuf,
    programs: PathBuf,
    tapped_base: u16,
    service: Service,
    pub numbers: Vec<u8>,
    /// Stop frames in the order of their passing.
    pub stops: Receiver<StopFrame>,
}

/// Where the laboratory looks for runs.
#[derive(Debug, Clone)]
pub struct Service {
    pub address: String,
    pub token_file: PathBuf,
}

/// What became of a press.
#[derive(Debug, Clone, Copy)]
pub struct Press {
    pub at: Instant,
    /// Until the first stop frame of the last robot had passed.
    pub first: Duration,
    /// Longest time between two stop frames of a robot, among the first [`REPEATS`].
    pub gap: Duration,
}

/// Stop frames that every robot gets at least, one a tick.
pub const REPEATS: usize = 10;

impl StopRig {
    /// Starts both, without a service; all robots have answered.
    pub fn start(name: &str) -> anyhow::Result<Self> {
        Self::start_for(name, None)
    }

    /// As [`Self::start`], with runs from a service.
    pub fn start_for(name: &str, service: Option<Service>) -> anyhow::Result<Self> {
        let folder = std::env::temp_dir().join(format!("robopheus-{name}-{}", std::process::id()));
        let _ = std::fs::remove_dir_all(&folder);
        std::fs::create_dir_all(&folder)?;
        std::fs::write(folder.join("token"), "nobody")?;
        let (udp_base, tapped_base) = (free_udp_base(0)?, free_udp_base(300)?);
        let programs = program_folder()?;
        let emulator = Command::new(programs.join("robopheus-emulator"))
            .arg("--lab")
            .arg(lab_file())
            .arg("--keys")
            .arg(folder.join("keys.json"))
            .arg("--make-keys")
            .args(["--robot-udp-base", &udp_base.to_string()])
            .arg("--tracker")
            .arg(folder.join("tracker.sock"))
            .arg("--hand")
            .arg(folder.join("hand.sock"))
            .arg("--watchdog-log")
            .arg(folder.join("watchdogs.csv"))
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(std::fs::File::create(folder.join("emulator.log"))?)
            .spawn()
            .context("start the emulator: build it first with `cargo build -p emulator`")?;
        wait(&folder.join("hand.sock"))?;
        let keys = keys(&folder.join("keys.json"))?;
        let (found, stops) = channel();
        for (number, key) in &keys {
            let port = |base: u16| base + u16::from(*number);
            tap(vec![(*number, *key)], port(udp_base), port(tapped_base), found.clone())?;
        }
        // Groups go to the base itself.
        let all = keys.iter().map(|(number, key)| (*number, *key)).collect();
        tap(all, udp_base, tapped_base, found)?;
        let nobody = Service {
            // Nobody listens there.
            address: "http://127.0.0.1:9".to_owned(),
            token_file: folder.join("token"),
        };
        let mut rig = Self {
            service: service.unwrap_or(nobody),
            emulator,
            lab: None,
            folder,
            programs,
            tapped_base,
            numbers: keys.into_keys().collect(),
            stops,
        };
        rig.start_lab()?;
        Ok(rig)
    }

    /// Starts the laboratory and waits until all robots are online.
    pub fn start_lab(&mut self) -> anyhow::Result<()> {
        let _ = std::fs::remove_file(self.folder.join("lab-stop.addr"));
        let lab = Command::new(self.programs.join("robopheus-lab"))
            .args(["--server", &self.service.address])
            .arg("--token-file")
            .arg(&self.service.token_file)
            .arg("--lab")
            .arg(lab_file())
            .arg("--keys")
            .arg(self.folder.join("keys.json"))
            .arg("--data")
            .arg(&self.folder)
            .args(["--robot-udp-base", &self.tapped_base.to_string()])
            .args(["--robot-broadcast", "127.0.0.1"])
            .arg("--tracker")
            .arg(self.folder.join("tracker.sock"))
            .arg("--hand")
            .arg(self.folder.join("hand.sock"))
            .args(["--stop-listen", "127.0.0.1:0"])
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(std::fs::File::create(self.folder.join("lab.log"))?)
            .spawn()
            .context("start the laboratory")?;
        self.lab = Some(lab);
        wait(&self.folder.join("lab-stop.addr"))?;
        self.until("all robots online", |state| {
            state["robots"]
                .as_array()
                .is_some_and(|robots| robots.iter().all(|robot| robot["online"] == true))
        })
    }

    /// SIGKILL to the laboratory.
    pub fn kill_lab(&mut self) -> anyhow::Result<()> {
        if let Some(mut lab) = self.lab.take() {
            lab.kill()?;
            lab.wait()?;
        }
        Ok(())
    }

    /// A request to the stop port; when it was sent, and the state that came back.
    pub fn ask(&self, request: &str) -> anyhow::Result<(Instant, Value)> {
        ask_stop_port(&self.folder, request)
    }

    /// `robopheus stop`, from a shell that knows neither a service nor a token.
    ///
    /// - `lab`: where it looks for the stop port; the right address when none.
    pub fn stop_by_command_line(&self, lab: Option<&str>) -> anyhow::Result<Output> {
        let address = std::fs::read_to_string(self.folder.join("lab-stop.addr"))?;
        let address = format!("http://{}", address.trim());
        let mut command = Command::new(self.programs.join("robopheus"));
        for variable in ["ROBOPHEUS_SERVER", "ROBOPHEUS_TOKEN", "ROBOPHEUS_STOP"] {
            command.env_remove(variable);
        }
        // Nobody listens at the service's address.
        command.env("HOME", &self.folder).env("XDG_CONFIG_HOME", &self.folder);
        command.args(["--json", "--server", "http://127.0.0.1:9", "stop", "--lab"]);
        Ok(command.arg(lab.unwrap_or(&address)).stdin(Stdio::null()).output()?)
    }

    /// Presses the stop and waits for [`REPEATS`] stop frames of every robot.
    pub fn press(&self) -> anyhow::Result<Press> {
        while self.stops.try_recv().is_ok() {}
        let (at, state) = self.ask("POST /stop")?;
        ensure!(state["stopped"] == true, "{state}");
        let mut seen: BTreeMap<u8, Vec<Instant>> = BTreeMap::new();
        let enough = |seen: &BTreeMap<u8, Vec<Instant>>| {
            seen.len() == self.numbers.len() && seen.values().all(|times| times.len() >= REPEATS)
        };
        while !enough(&seen) {
            let StopFrame { robot, at: passed } = self.stops.recv_timeout(Duration::from_secs(2))?;
            seen.entry(robot).or_default().push(passed);
            ensure!(at.elapsed() < Duration::from_secs(5), "{} robots", seen.len());
        }
        let first = seen.values().filter_map(|times| times.first()).max().copied();
        let gaps = seen
            .values()
            .flat_map(|times| times.iter().take(REPEATS).zip(times.iter().take(REPEATS).skip(1)))
            .map(|(one, next)| *next - *one);
        Ok(Press {
            at,
            first: first.map_or(Duration::MAX, |first| first - at),
            gap: gaps.max().unwrap_or_default(),
        })
    }

    /// Waits until every robot says that it obeys the stop.
    pub fn until_obeyed(&self) -> anyhow::Result<()> {
        self.until("every robot says that it stopped", |state| {
            state["robots"]
                .as_array()
                .is_some_and(|robots| robots.iter().all(|robot| robot["stop_acknowledged"] == true))
        })
    }

    /// A request to the hand that puts robots on the floor.
    pub fn hand(&self, request: &Value) -> anyhow::Result<()> {
        ask_hand(&self.folder.join("hand.sock"), request)
    }

    /// Follows where the robots are.
    pub fn watch_poses(&self) -> anyhow::Result<PoseWatch> {
        PoseWatch::start(&self.folder.join("tracker.sock"))
    }

    /// Waits for a state of the stop port.
    pub fn until(&self, what: &str, is: impl Fn(&Value) -> bool) -> anyhow::Result<()> {
        let start = Instant::now();
        loop {
            if let Ok((_, state)) = self.ask("GET /state")
                && is(&state)
            {
                return Ok(());
            }
            ensure!(start.elapsed() < START_LIMIT, "{what}: in vain");
            std::thread::sleep(Duration::from_millis(5));
        }
    }

    /// What the emulator wrote of the robots' watchdogs, a line a change.
    pub fn watchdog_log(&self) -> anyhow::Result<String> {
        Ok(std::fs::read_to_string(self.folder.join("watchdogs.csv"))?)
    }

    /// The laboratory's log so far.
    pub fn lab_log(&self) -> String {
        std::fs::read_to_string(self.folder.join("lab.log")).unwrap_or_default()
    }

    /// Share of frames lost, each way, at every robot.
    pub fn lose_frames(&self, fraction: f64) -> anyhow::Result<()> {
        for number in &self.numbers {
            self.hand(&json!({"fault": {"number": number, "kind": "drop_frames", "fraction": fraction}}))?;
        }
        Ok(())
    }

    /// Lines of the audit log.
    pub fn audit(&self) -> anyhow::Result<Vec<String>> {
        let text = std::fs::read_to_string(self.folder.join("lab/stop-audit.log"))?;
        Ok(text.lines().map(str::to_owned).collect())
    }
}

impl Drop for StopRig {
    fn drop(&mut self) {
        let _ = self.kill_lab();
        let _ = self.emulator.kill();
        let _ = self.emulator.wait();
        let _ = std::fs::remove_dir_all(&self.folder);
    }
}

/// Passes what comes to one port on, and the answers back, and tells of frames that stop a robot.
///
/// - `robots`: who is meant by frames that come to this port.
fn tap(robots: Vec<(u8, Key)>, port: u16, tapped_port: u16, found: Sender<StopFrame>) -> anyhow::Result<()> {
    let outside = UdpSocket::bind(("127.0.0.1", tapped_port))?;
    let inside = UdpSocket::bind("127.0.0.1:0")?;
    let (back_in, back_out) = (inside.try_clone()?, outside.try_clone()?);
    let (lab_known, lab) = channel();
    std::thread::spawn(move || {
        let mut buffer = [0; 2048];
        let mut last_lab = None;
        while let Ok((length, from)) = outside.recv_from(&mut buffer) {
            let at = Instant::now();
            let bytes = buffer.get(..length).unwrap_or_default();
            if last_lab.replace(from) != Some(from) && lab_known.send(from).is_err() {
                return;
            }
            for (robot, key) in &robots {
                if let Ok(frame) = decode_for(bytes, *robot, key)
                    && let Payload::Command(command) = frame.payload
                    && command.stop
                {
                    // Nobody listens any more only when the test is over.
                    let _over = found.send(StopFrame { robot: *robot, at });
                }
            }
            let _lost = inside.send_to(bytes, ("127.0.0.1", port));
        }
    });
    std::thread::spawn(move || {
        let mut buffer = [0; 2048];
        let mut to = None;
        loop {
            let length = match back_in.recv(&mut buffer) {
                Ok(length) => length,
                Err(_) => continue,
            };
            to = lab.try_iter().last().or(to);
            if let Some(to) = to {
                let _lost = back_out.send_to(buffer.get(..length).unwrap_or_default(), to);
            }
        }
    });
    Ok(())
}

fn lab_file() -> PathBuf {
    system_tests::repository().join("examples/lab/reference.json")
}

/// Where the programs under test lie: beside this one, or above it.
fn program_folder() -> anyhow::Result<PathBuf> {
    let own = std::env::current_exe()?;
    let has_programs =
        |folder: &&Path| folder.join("robopheus-lab").is_file() && folder.join("robopheus-emulator").is_file();
    let found = own.ancestors().find(has_programs);
    Ok(found.context("build first: cargo build -p lab -p emulator")?.to_owned())
}

fn keys(path: &Path) -> anyhow::Result<BTreeMap<u8, Key>> {
    let texts: BTreeMap<u8, String> = serde_json::from_slice(&std::fs::read(path)?)?;
    let key = |(number, text): (u8, String)| Some((number, Key::from_hex(&text)?));
    texts.into_iter().map(|entry| key(entry).context("a key")).collect()
}

/// A base with 256 free ports after it.
fn free_udp_base(shift: u16) -> anyhow::Result<u16> {
    let first = 20_000 + (std::process::id() % 60) as u16 * 600 + shift;
    let bases = (0..20u16).map(|k| 20_000 + (first - 20_000 + k * 600) % 40_000);
    for base in bases {
        let all: Result<Vec<_>, _> = (0..32)
            .map(|number| UdpSocket::bind(("127.0.0.1", base + number)))
            .collect();
        if all.is_ok() {
            return Ok(base);
        }
    }
    anyhow::bail!("no free UDP ports")
}

fn wait(path: &Path) -> anyhow::Result<()> {
    let start = Instant::now();
    while !path.exists() {
        ensure!(start.elapsed() < START_LIMIT, "{} does not appear", path.display());
        std::thread::sleep(Duration::from_millis(5));
    }
    Ok(())
}
