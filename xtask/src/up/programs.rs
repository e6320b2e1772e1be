//! The processes of a running system: how each is started and when it is ready.

use std::fs;
use std::io::{Read, Write};
use std::net::{Ipv4Addr, TcpStream};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Duration;

use anyhow::{Context, Result, bail};

use super::keys;
use super::ports::Ports;
use super::supervisor::{Plan, StopWay};
use crate::cluster::{Cluster, short_socket_folder};
use crate::{paths, sys};

const HEALTH_LIMIT: Duration = Duration::from_secs(2);

const TRACKER_SOCKET: &str = "tracker.sock";
const HAND_SOCKET: &str = "hand.sock";

/// A camera of the reference laboratory and the process beside it.
struct Camera {
    /// Of the process.
    name: &'static str,
    calibration: &'static str,
    /// Sockets of its pictures and of the poses found in them.
    frames: &'static str,
    poses: &'static str,
}

const CAMERAS: [Camera; 2] = [
    Camera {
        name: "camera-0",
        calibration: "examples/lab/cameras/cam-0.json",
        frames: "camera-0.sock",
        poses: "camera-0.poses.sock",
    },
    Camera {
        name: "camera-1",
        calibration: "examples/lab/cameras/cam-1.json",
        frames: "camera-1.sock",
        poses: "camera-1.poses.sock",
    },
];

/// Everything needed to start the processes, again and again.
pub struct Programs {
    data: PathBuf,
    folder: PathBuf,
    lab_file: PathBuf,
    socket_folder: PathBuf,
    ports: Ports,
    cluster: Option<Cluster>,
    database_url: String,
    with_lab: bool,
    with_tracker: bool,
    docks: Option<PathBuf>,
    quick: bool,
    measure: bool,
    truth: bool,
}

/// What of the laboratory is started.
#[derive(Debug, Clone)]
pub struct Choice {
    pub lab: bool,
    /// Its document; relative to the checkout where it is not absolute.
    pub lab_file: PathBuf,
    /// A tracker instead of cameras.
    pub tracker: bool,
    /// File of the docks, absolute.
    pub docks: Option<PathBuf>,
    /// Virtual time: one program instead of emulator, cameras and laboratory.
    pub quick: bool,
    /// Write down when robots applied commands.
    pub measure: bool,
    /// True poses beside the cameras.
    pub truth: bool,
}

impl Choice {
    pub fn of(arguments: &super::UpArguments) -> Result<Self> {
        // The programs are started in the checkout, not where the user is.
        let absolute = |path: &PathBuf| path.canonicalize().with_context(|| format!("find {}", path.display()));
        // The reference laboratory is the checkout's wherever the command is given.
        let lab_file = match arguments.lab == Path::new(super::REFERENCE) {
            true => arguments.lab.clone(),
            false => absolute(&arguments.lab)?,
        };
        Ok(Self {
            lab: !arguments.no_lab,
            lab_file,
            tracker: arguments.tracker,
            docks: arguments.docks.as_ref().map(absolute).transpose()?,
            quick: arguments.quick,
            measure: arguments.measure,
            truth: arguments.truth,
        })
    }
}

impl Programs {
    /// Checks that everything that will be started is there.
    pub fn new(
        data: &Path,
        ports: Ports,
        cluster: Option<Cluster>,
        own_database: Option<String>,
        choice: Choice,
    ) -> Result<Self> {
        let database_url = match (&cluster, own_database) {
            (Some(cluster), _) => cluster.url(),
            (None, Some(url)) => url,
            (None, None) => bail!("neither a database cluster nor DATABASE_URL"),
        };
        let programs = Self {
            data: data.to_path_buf(),
            folder: paths::program_folder()?,
            lab_file: paths::root().join(choice.lab_file),
            socket_folder: short_socket_folder(data)?,
            ports,
            cluster,
            database_url,
            with_lab: choice.lab,
            with_tracker: choice.tracker,
            docks: choice.docks,
            quick: choice.quick,
            measure: choice.measure,
            truth: choice.truth,
        };
        programs.check()?;
        if programs.with_lab {
            keys::make_missing(&programs.keys_file(), &programs.lab_file)?;
        }
        Ok(programs)
    }

    fn check(&self) -> Result<()> {
        let lab: &[&str] = if self.quick {
            &["robopheus-quick-lab", "robopheus-simulate"]
        } else if self.with_lab {
            &[
                "robopheus-emulator",
                "robopheus-camera",
                "robopheus-lab",
                "robopheus-simulate",
                "robopheus-learning",
            ]
        } else {
            &[]
        };
        let names = [
            "robopheus-server",
            "robopheus-scheduler",
            "robopheus-diagnose-worker",
            "robopheus-controller",
        ]
        .iter()
        .chain(lab);
        let absent: Vec<&str> = names
            .copied()
            .filter(|name| !paths::is_executable(&self.folder.join(name)))
            .collect();
        if !absent.is_empty() {
            bail!(
                "not built in {}: {}; run `cargo build`",
                self.folder.display(),
                absent.join(", ")
            );
        }
        Ok(())
    }

    pub fn ports(&self) -> &Ports {
        &self.ports
    }

    pub fn is_quick(&self) -> bool {
        self.quick
    }

    pub fn has_lab(&self) -> bool {
        self.with_lab
    }

    /// True for the process that answers users.
    pub fn serves(&self, name: &str) -> bool {
        name == "server"
    }

    /// In the order of starting; stopping goes by each plan's rank.
    pub fn plans(&self) -> Result<Vec<Plan<'_>>> {
        let mut plans = Vec::new();
        if let Some(cluster) = &self.cluster {
            plans.push(Plan {
                name: "postgres",
                command: Box::new(move || cluster.clear_leftovers().map(|()| cluster.server_command())),
                stop: StopWay {
                    rank: 6,
                    ask: libc::SIGINT,
                    insist: libc::SIGQUIT,
                    patience: Duration::from_millis(2500),
                },
                on_our_death: libc::SIGINT,
            });
        }
        plans.push(self.plan("server", 5, 1500, Self::server));
        plans.push(self.plan("scheduler", 4, 1500, Self::scheduler));
        plans.push(self.plan("diagnose", 4, 1500, Self::diagnose));
        if self.quick {
            plans.push(self.plan("lab", 1, 3000, Self::quick_lab));
            plans.push(self.plan("simulate", 1, 500, Self::simulate));
        } else if self.with_lab {
            plans.push(self.plan("emulator", 3, 1000, Self::emulator));
            if !self.with_tracker {
                plans.extend(CAMERAS.iter().map(|camera| self.camera_plan(camera)));
            }
            plans.push(self.plan("lab", 1, 3000, Self::lab));
            plans.push(self.plan("simulate", 1, 500, Self::simulate));
            plans.push(self.plan("learning", 1, 500, Self::learning));
        }
        Ok(plans)
    }

    fn plan(&self, name: &'static str, rank: u8, patience_ms: u64, make: fn(&Self) -> Command) -> Plan<'_> {
        Plan {
            name,
            command: Box::new(move || Ok(make(self))),
            stop: StopWay {
                rank,
                ask: libc::SIGTERM,
                insist: libc::SIGKILL,
                patience: Duration::from_millis(patience_ms),
            },
            on_our_death: libc::SIGKILL,
        }
    }

    fn camera_plan(&self, camera: &'static Camera) -> Plan<'_> {
        Plan {
            name: camera.name,
            command: Box::new(move || Ok(self.camera(camera))),
            stop: StopWay {
                rank: 2,
                ask: libc::SIGTERM,
                insist: libc::SIGKILL,
                patience: Duration::from_millis(500),
            },
            on_our_death: libc::SIGKILL,
        }
    }

    fn command(&self, name: &str) -> Command {
        let mut command = Command::new(self.folder.join(name));
        // Logs go to files, where colours are noise.
        command
            .current_dir(paths::root())
            .stdin(Stdio::null())
            .env("NO_COLOR", "1");
        command
    }

    /// By environment, not by flag: an address may carry a password and flags are visible to everybody.
    fn with_database(&self, name: &str) -> Command {
        let mut command = self.command(name);
        command
            .env("DATABASE_URL", &self.database_url)
            .arg("--data")
            .arg(&self.data);
        command
    }

    fn server(&self) -> Command {
        let mut command = self.with_database("robopheus-server");
        command.arg("--listen").arg(format!("127.0.0.1:{}", self.ports.server));
        command.arg("--static").arg(paths::root().join("static"));
        command
    }

    fn scheduler(&self) -> Command {
        self.with_database("robopheus-scheduler")
    }

    /// At low priority: the 120 Hz loop may run on the same machine.
    fn nice(&self, niceness: &str, name: &str) -> Command {
        let mut command = Command::new("nice");
        command.args(["-n", niceness]).arg(self.folder.join(name));
        command
            .current_dir(paths::root())
            .stdin(Stdio::null())
            .env("NO_COLOR", "1");
        command
    }

    /// Minutes of processor time.
    fn diagnose(&self) -> Command {
        let mut command = self.nice("15", "robopheus-diagnose-worker");
        command
            .env("DATABASE_URL", &self.database_url)
            .arg("--data")
            .arg(&self.data);
        command
    }

    fn learning(&self) -> Command {
        let mut command = self.nice("10", "robopheus-learning");
        command
            .arg("--server")
            .arg(format!("http://127.0.0.1:{}", self.ports.server));
        command.arg("--token-file").arg(self.data.join("tokens/lab"));
        command.arg("--data").arg(&self.data);
        command
    }

    fn emulator(&self) -> Command {
        // Its own only: a camera's process goes on listening while the emulator is away.
        let frames = CAMERAS.iter().map(|camera| camera.frames);
        self.remove_files([TRACKER_SOCKET, HAND_SOCKET].into_iter().chain(frames));
        let mut command = self.command("robopheus-emulator");
        self.add_robot_flags(&mut command);
        if self.measure {
            command.arg("--applied-log").arg(self.data.join("logs/applied.csv"));
        }
        if self.with_tracker || self.truth {
            command.arg("--tracker").arg(self.socket(TRACKER_SOCKET));
        }
        if !self.with_tracker {
            for camera in &CAMERAS {
                let mut value = paths::root().join(camera.calibration).into_os_string();
                value.push(",");
                value.push(self.socket(camera.frames));
                command.arg("--camera").arg(value);
            }
        }
        command
    }

    fn camera(&self, camera: &Camera) -> Command {
        fs::remove_file(self.socket(camera.poses)).ok();
        let mut command = self.command("robopheus-camera");
        command
            .arg("serve")
            .arg("--calibration")
            .arg(paths::root().join(camera.calibration));
        command.arg("--frames").arg(self.socket(camera.frames));
        command.arg("--poses").arg(self.socket(camera.poses));
        command
    }

    fn lab(&self) -> Command {
        for file in ["lab-stop.addr", "lab-hub.addr"] {
            fs::remove_file(self.data.join(file)).ok();
        }
        let mut command = self.command("robopheus-lab");
        command
            .arg("--server")
            .arg(format!("http://127.0.0.1:{}", self.ports.server));
        command.arg("--token-file").arg(self.data.join("tokens/lab"));
        command
            .arg("--data")
            .arg(&self.data)
            .args(["--robot-host", "127.0.0.1"]);
        // The emulator's robots hear groups at their base port.
        command.args(["--robot-broadcast", "127.0.0.1"]);
        command
            .arg("--stop-listen")
            .arg(format!("127.0.0.1:{}", self.ports.lab_stop));
        self.add_robot_flags(&mut command);
        if self.with_tracker {
            command.arg("--tracker").arg(self.socket(TRACKER_SOCKET));
        } else {
            for camera in &CAMERAS {
                command.arg("--camera").arg(self.socket(camera.poses));
            }
        }
        command
    }

    fn quick_lab(&self) -> Command {
        self.remove_files([HAND_SOCKET].into_iter());
        fs::remove_file(self.data.join("lab-hub.addr")).ok();
        let mut command = self.command("robopheus-quick-lab");
        command
            .arg("--server")
            .arg(format!("http://127.0.0.1:{}", self.ports.server));
        command.arg("--token-file").arg(self.data.join("tokens/lab"));
        command.arg("--data").arg(&self.data).arg("--lab").arg(&self.lab_file);
        command.arg("--keys").arg(self.keys_file());
        command.arg("--hand").arg(self.socket(HAND_SOCKET));
        command
    }

    fn simulate(&self) -> Command {
        let mut command = self.command("robopheus-simulate");
        command
            .arg("--server")
            .arg(format!("http://127.0.0.1:{}", self.ports.server));
        command.arg("--token-file").arg(self.data.join("tokens/lab"));
        command.arg("--data").arg(&self.data).arg("--lab").arg(&self.lab_file);
        command
    }

    fn add_robot_flags(&self, command: &mut Command) {
        command
            .arg("--lab")
            .arg(&self.lab_file)
            .arg("--keys")
            .arg(self.keys_file());
        command
            .arg("--robot-udp-base")
            .arg(self.ports.robot_udp_base.to_string());
        command.arg("--hand").arg(self.socket(HAND_SOCKET));
        if let Some(docks) = &self.docks {
            command.arg("--docks").arg(docks);
        }
    }

    fn keys_file(&self) -> PathBuf {
        self.data.join("link-keys.json")
    }

    fn socket(&self, name: &str) -> PathBuf {
        self.socket_folder.join(name)
    }

    /// Removes the laboratory's sockets, which nobody listens on any more.
    pub fn remove_sockets(&self) {
        let cameras = CAMERAS.iter().flat_map(|camera| [camera.frames, camera.poses]);
        self.remove_files([TRACKER_SOCKET, HAND_SOCKET].into_iter().chain(cameras));
    }

    fn remove_files<'a>(&self, names: impl Iterator<Item = &'a str>) {
        for name in names {
            fs::remove_file(self.socket(name)).ok();
        }
    }

    /// True once the process does what the next one needs.
    pub fn is_ready(&self, name: &str) -> bool {
        match name {
            "postgres" => self.cluster.as_ref().is_none_or(Cluster::is_ready),
            "server" => is_healthy(self.ports.server),
            "lab" if self.quick => self.socket(HAND_SOCKET).exists(),
            "emulator" => self.socket(HAND_SOCKET).exists(),
            name if name.starts_with("camera-") => CAMERAS
                .iter()
                .filter(|camera| camera.name == name)
                .all(|camera| self.socket(camera.poses).exists()),
            "lab" => self.data.join("lab-stop.addr").is_file(),
            _ => true,
        }
    }
}

/// Asks the health endpoint.
fn is_healthy(port: u16) -> bool {
    let ask = || -> std::io::Result<bool> {
        let mut stream = TcpStream::connect_timeout(&(Ipv4Addr::LOCALHOST, port).into(), HEALTH_LIMIT)?;
        stream.set_read_timeout(Some(HEALTH_LIMIT))?;
        // The server refuses a Host that is not its own address. One write: with `write!` every
        // piece would be a packet, and a peer may answer and close after the first.
        let request = format!("GET /api/v1/health HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nConnection: close\r\n\r\n");
        stream.write_all(request.as_bytes())?;
        let mut start = [0_u8; 12];
        stream.read_exact(&mut start)?;
        Ok(start.starts_with(b"HTTP/1.1 200"))
    };
    sys::ends_asked() == 0 && ask().unwrap_or(false)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::{BufRead, BufReader};
    use std::net::TcpListener;

    fn answer_once(answer: &'static [u8]) -> u16 {
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
        let port = listener.local_addr().unwrap().port();
        std::thread::spawn(move || {
            let (mut stream, _) = listener.accept().unwrap();
            let mut request = BufReader::new(&stream).lines();
            // Closing with a part of the request unread would reset the connection.
            while request.next().is_some_and(|line| !line.unwrap().is_empty()) {}
            stream.write_all(answer).unwrap();
        });
        port
    }

    #[test]
    fn only_a_good_answer_is_healthy() {
        assert!(is_healthy(answer_once(b"HTTP/1.1 200 OK\r\n\r\n")));
        assert!(!is_healthy(answer_once(b"HTTP/1.1 503 Service Unavailable\r\n\r\n")));
    }
}
