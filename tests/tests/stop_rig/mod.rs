//! An emulator and a laboratory as processes of their own, without service and database, and a tap on the robot link
//! between them.

use anyhow::{Context, ensure};
use robot::frame::{Payload, decode_for};
use robot::key::Key;
use serde_json::Value;
use std::collections::BTreeMap;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::{SocketAddr, TcpStream, UdpSocket};
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::{Duration, Instant};

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
    pub numbers: Vec<u8>,
    /// Stop frames in the order of their passing.
    pub stops: Receiver<StopFrame>,
}

impl StopRig {
    /// Starts both; all robots have answered.
    pub fn start(name: &str) -> anyhow::Result<Self> {
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
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(std::fs::File::create(folder.join("emulator.log"))?)
            .spawn()
            .context("start the emulator: build it first with `cargo build -p emulator`")?;
        wait(&folder.join("hand.sock"))?;
        let keys = keys(&folder.join("keys.json"))?;
        let (found, stops) = channel();
        for (number, key) in &keys {
            tap(*number, *key, udp_base, tapped_base, found.clone())?;
        }
        let mut rig = Self {
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
            // Nobody listens there.
            .args(["--server", "http://127.0.0.1:9"])
            .arg("--token-file")
            .arg(self.folder.join("token"))
            .arg("--lab")
            .arg(lab_file())
            .arg("--keys")
            .arg(self.folder.join("keys.json"))
            .arg("--data")
            .arg(&self.folder)
            .args(["--robot-udp-base", &self.tapped_base.to_string()])
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
        let address: SocketAddr = std::fs::read_to_string(self.folder.join("lab-stop.addr"))?
            .trim()
            .parse()?;
        let mut stream = TcpStream::connect(address)?;
        let text = format!("{request} HTTP/1.1\r\nHost: {address}\r\nContent-Length: 0\r\nConnection: close\r\n\r\n");
        let sent = Instant::now();
        stream.write_all(text.as_bytes())?;
        let mut reply = String::new();
        stream.read_to_string(&mut reply)?;
        let (head, body) = reply.split_once("\r\n\r\n").context("no HTTP answer")?;
        ensure!(head.starts_with("HTTP/1.1 200"), "{request}: {reply}");
        Ok((sent, serde_json::from_str(body)?))
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

    /// Share of frames lost, each way, at every robot.
    pub fn lose_frames(&self, fraction: f64) -> anyhow::Result<()> {
        for number in &self.numbers {
            let mut stream = UnixStream::connect(self.folder.join("hand.sock"))?;
            writeln!(
                stream,
                r#"{{"fault":{{"number":{number},"kind":"drop_frames","fraction":{fraction}}}}}"#
            )?;
            let mut reply = String::new();
            BufReader::new(stream).read_line(&mut reply)?;
            ensure!(reply.contains("true"), "{reply}");
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

/// Passes frames of one robot on, both ways, and tells of those that stop it.
fn tap(number: u8, key: Key, udp_base: u16, tapped_base: u16, found: Sender<StopFrame>) -> anyhow::Result<()> {
    let port = |base: u16| base + u16::from(number);
    let outside = UdpSocket::bind(("127.0.0.1", port(tapped_base)))?;
    let inside = UdpSocket::bind("127.0.0.1:0")?;
    inside.connect(("127.0.0.1", port(udp_base)))?;
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
            if let Ok(frame) = decode_for(bytes, number, &key)
                && let Payload::Command(command) = frame.payload
                && command.stop
            {
                // Nobody listens any more only when the test is over.
                let _over = found.send(StopFrame { robot: number, at });
            }
            let _lost = inside.send(bytes);
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
