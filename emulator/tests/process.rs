//! The program itself: sockets, keys, signals.

use emulator::tracker::TrackerFrame;
use robot::frame::{
    Command as Drive, GroupHeader, Header, MAX_CHARACTERS, Part, Payload, Telemetry, decode, encode_command,
    encode_group,
};
use robot::key::Key;
use std::collections::BTreeMap;
use std::io::{BufRead, BufReader, Write};
use std::net::UdpSocket;
use std::os::unix::fs::PermissionsExt;
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

struct Emulator {
    child: Child,
    folder: PathBuf,
    udp_base: u16,
}

impl Emulator {
    fn start(name: &str) -> Self {
        let folder = std::env::temp_dir().join(format!("robopheus-emulator-{name}-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        // A left-over socket file that nobody answers on.
        drop(UnixListener::bind(folder.join("tracker.sock")).unwrap());
        let udp_base = free_udp_base();
        let child = command(&folder, udp_base).spawn().unwrap();
        let emulator = Self {
            child,
            folder,
            udp_base,
        };
        emulator.connect("hand.sock");
        emulator
    }

    /// Connects as soon as the program listens.
    fn connect(&self, socket: &str) -> UnixStream {
        let started = Instant::now();
        loop {
            match UnixStream::connect(self.folder.join(socket)) {
                Ok(stream) => {
                    stream.set_read_timeout(Some(Duration::from_secs(10))).unwrap();
                    return stream;
                }
                Err(error) => assert!(started.elapsed() < Duration::from_secs(20), "{socket}: {error}"),
            }
            std::thread::sleep(Duration::from_millis(5));
        }
    }

    fn hand(&self, line: &str) -> String {
        let mut stream = self.connect("hand.sock");
        stream.write_all(format!("{line}\n").as_bytes()).unwrap();
        let mut reply = String::new();
        BufReader::new(stream).read_line(&mut reply).unwrap();
        reply
    }

    fn key(&self, number: &str) -> Key {
        let text = std::fs::read_to_string(self.folder.join("link-keys.json")).unwrap();
        let keys: BTreeMap<String, String> = serde_json::from_str(&text).unwrap();
        Key::from_hex(&keys[number]).unwrap()
    }

    /// Sends SIGTERM and waits for the end.
    fn terminate(&mut self) -> std::process::ExitStatus {
        assert!(
            Command::new("kill")
                .arg(self.child.id().to_string())
                .status()
                .unwrap()
                .success()
        );
        let started = Instant::now();
        loop {
            if let Some(status) = self.child.try_wait().unwrap() {
                return status;
            }
            assert!(started.elapsed() < Duration::from_secs(5), "does not end");
            std::thread::sleep(Duration::from_millis(5));
        }
    }
}

impl Drop for Emulator {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
        let _ = std::fs::remove_dir_all(&self.folder);
    }
}

fn command(folder: &Path, udp_base: u16) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_robopheus-emulator"));
    command
        .arg("--lab")
        .arg(concat!(env!("CARGO_MANIFEST_DIR"), "/../examples/lab/reference.json"));
    command
        .arg("--keys")
        .arg(folder.join("link-keys.json"))
        .arg("--make-keys");
    command
        .arg("--tracker")
        .arg(folder.join("tracker.sock"))
        .arg("--hand")
        .arg(folder.join("hand.sock"));
    command
        .arg("--robot-udp-base")
        .arg(udp_base.to_string())
        .stderr(Stdio::null());
    command
}

/// Robots of the reference laboratory.
const ROBOTS: u16 = 16;

/// A base with free ports above it for all robots of the reference laboratory.
fn free_udp_base() -> u16 {
    for _ in 0..100 {
        let base = UdpSocket::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
        let held: Vec<_> = (0..=ROBOTS)
            .filter_map(|number| UdpSocket::bind(("127.0.0.1", base.checked_add(number)?)).ok())
            .collect();
        if held.len() == 1 + usize::from(ROBOTS) {
            return base;
        }
    }
    panic!("no free UDP ports");
}

/// Drives robot 1 straight for a while over real UDP; returns the telemetry that came back.
fn drive(emulator: &Emulator, periods: u32) -> Vec<Telemetry> {
    let key = emulator.key("1");
    let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
    socket.connect(("127.0.0.1", emulator.udp_base + 1)).unwrap();
    socket.set_nonblocking(true).unwrap();
    let (started, mut echo_ms, mut telemetry) = (Instant::now(), 0, Vec::new());
    let forward = 0.4 / 0.05 / 2f64.sqrt();
    let set_points = [-forward, -forward, forward, forward];
    for sequence in 1..=periods {
        let header = Header {
            robot: 1,
            epoch: 3,
            sequence,
            tick: sequence,
            clock_ms: 7000 + started.elapsed().as_millis() as u32,
            echo_ms,
        };
        let mut out = [0; 96];
        let length = encode_command(
            &header,
            &Drive {
                enable: true,
                wheel_rad_per_s: set_points,
                ..Drive::default()
            },
            &key,
            &mut out,
        );
        socket.send(&out[..length]).unwrap();
        std::thread::sleep((Duration::from_micros(8333) * sequence).saturating_sub(started.elapsed()));
        let mut buffer = [0; 512];
        while let Ok(length) = socket.recv(&mut buffer) {
            let frame = decode(&buffer[..length], &key).unwrap();
            echo_ms = frame.header.clock_ms;
            match frame.payload {
                Payload::Telemetry(payload) => telemetry.push(payload),
                Payload::Health(_) | Payload::Counters(_) => {}
                other => panic!("a robot does not send {other:?}"),
            }
        }
    }
    telemetry
}

#[test]
fn a_robot_drives_over_udp_and_the_tracker_sees_it() {
    let mut emulator = Emulator::start("drive");
    assert_eq!(
        std::fs::metadata(emulator.folder.join("link-keys.json"))
            .unwrap()
            .permissions()
            .mode()
            & 0o777,
        0o600
    );
    assert_eq!(
        emulator.hand(r#"{"place":[{"number":1,"x_m":-1,"y_m":0.5,"yaw_rad":0}]}"#),
        "{\"ok\":true}\n"
    );
    let mut lines = BufReader::new(emulator.connect("tracker.sock")).lines();
    let mut next = || -> TrackerFrame { serde_json::from_str(&lines.next().unwrap().unwrap()).unwrap() };
    let first = std::iter::repeat_with(&mut next)
        .find(|frame| !frame.poses.is_empty())
        .unwrap();
    assert!(
        (first.poses[0].x_m + 1.0).abs() < 0.01 && first.poses.len() == 1,
        "{first:?}"
    );
    assert!(
        (5_000..60_000).contains(&(first.sent_us - first.exposure_us)),
        "{first:?}"
    );
    let telemetry = drive(&emulator, 120);
    assert!(
        (80..=130).contains(&telemetry.len()),
        "{} telemetry frames in a second",
        telemetry.len()
    );
    let last = telemetry.last().unwrap();
    assert!(last.status.running && last.status.clock_known, "{:?}", last.status);
    let seen = std::iter::repeat_with(&mut next)
        .take(200)
        .filter_map(|frame| frame.poses.first().copied())
        .last()
        .unwrap();
    assert!(seen.x_m > -0.85, "{seen:?}");
    assert!(emulator.terminate().success());
    assert!(!emulator.folder.join("tracker.sock").exists() && !emulator.folder.join("hand.sock").exists());
}

#[test]
fn a_second_emulator_on_the_same_sockets_is_refused() {
    let emulator = Emulator::start("second");
    let status = command(&emulator.folder, free_udp_base()).status().unwrap();
    assert!(!status.success());
    assert_eq!(emulator.hand(r#"{"place":[]}"#), "{\"ok\":true}\n");
}

#[test]
fn one_group_on_the_base_port_drives_two_robots_and_their_health_comes_back() {
    let emulator = Emulator::start("group");
    let placed =
        r#"{"place":[{"number":1,"x_m":-1,"y_m":0.5,"yaw_rad":0},{"number":2,"x_m":1,"y_m":0.5,"yaw_rad":0}]}"#;
    assert_eq!(emulator.hand(placed), "{\"ok\":true}\n");
    let keys = ["1", "2"].map(|number| emulator.key(number));
    let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
    socket.set_nonblocking(true).unwrap();
    let (started, mut echo_ms, mut running, mut health) = (Instant::now(), [0; 2], [0; 2], [0; 2]);
    for sequence in 1..=120 {
        let shared = GroupHeader {
            epoch: 3,
            sequence,
            tick: sequence,
            clock_ms: 7000 + started.elapsed().as_millis() as u32,
        };
        let part = |index: usize, speed: f64| Part {
            robot: index as u8 + 1,
            echo_ms: echo_ms[index],
            command: Drive {
                enable: true,
                wheel_rad_per_s: [speed; 4],
                ..Drive::default()
            },
            key: keys[index],
        };
        let mut out = [0; MAX_CHARACTERS];
        let length = encode_group(&shared, &[part(0, 3.0), part(1, -2.0)], &mut out);
        socket
            .send_to(&out[..length], ("127.0.0.1", emulator.udp_base))
            .unwrap();
        std::thread::sleep((Duration::from_micros(8333) * sequence).saturating_sub(started.elapsed()));
        let mut buffer = [0; 512];
        while let Ok((length, from)) = socket.recv_from(&mut buffer) {
            let index = usize::from(from.port() - emulator.udp_base - 1);
            let frame = decode(&buffer[..length], &keys[index]).unwrap();
            echo_ms[index] = frame.header.clock_ms;
            match frame.payload {
                Payload::Telemetry(telemetry) => {
                    let expected = [3.0, -2.0][index];
                    let follows = (telemetry.wheel_rad_per_s[0] - expected).abs() < 0.5;
                    running[index] += u32::from(telemetry.status.running && follows);
                }
                Payload::Health(told) => {
                    health[index] += 1;
                    assert!(told.rest_v > 20.0 && !told.anchored, "{told:?}");
                }
                Payload::Counters(_) => {}
                other => panic!("a robot does not send {other:?}"),
            }
        }
    }
    println!("driving in {running:?} telemetry frames, {health:?} health frames");
    assert!(running.iter().all(|count| *count > 40), "{running:?}");
    assert!(health.iter().all(|count| (5..=13).contains(count)), "{health:?}");
}

#[test]
fn a_medium_that_does_not_exist_is_refused_with_the_names_of_those_that_do() {
    let folder = std::env::temp_dir();
    let output = command(&folder, 0)
        .args(["--medium", "telepathy"])
        .stderr(Stdio::piped())
        .output()
        .unwrap();
    let told = String::from_utf8_lossy(&output.stderr);
    assert!(!output.status.success() && told.contains("digimesh"), "{told}");
}
