//! The second implementation of a robot, in Python: its frames are the golden ones, and it keeps the link's rules over UDP.

use robot::frame::{
    Command as Drive, GroupHeader, Header, Part, Payload, Telemetry, decode, encode_command, encode_group,
};
use robot::key::Key;
use std::io::{BufRead, BufReader};
use std::net::UdpSocket;
use std::os::unix::net::UnixStream;
use std::path::PathBuf;
use std::process::{Child, Command};
use std::time::{Duration, Instant};

const KEY_HEX: &str = "000102030405060708090a0b0c0d0e0f";

fn checkout() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("..")
}

fn python(script: &str) -> Command {
    let mut command = Command::new("python3");
    command
        .arg("-B")
        .arg(checkout().join("examples/robots/python").join(script));
    command
}

#[test]
fn the_python_codec_makes_and_reads_the_golden_frames() {
    let output = python("golden.py")
        .arg(checkout().join("tests/fixtures/link-frames.txt"))
        .output()
        .expect("python3, 3.11 or newer, on the path");
    let text = String::from_utf8_lossy(&output.stdout);
    assert!(
        output.status.success(),
        "{text}{}",
        String::from_utf8_lossy(&output.stderr)
    );
    assert!(text.contains("15 golden frames agree"), "{text}");
}

struct PythonRobot {
    child: Child,
    folder: PathBuf,
    socket: UdpSocket,
    key: Key,
    sequence: u32,
    echo_ms: u32,
    started: Instant,
}

impl PythonRobot {
    fn start() -> Self {
        let folder = std::env::temp_dir().join(format!("robopheus-python-robot-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        std::fs::write(folder.join("keys.json"), format!("{{\"3\":\"{KEY_HEX}\"}}")).unwrap();
        let port = UdpSocket::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
        let child = python("robot.py")
            .args(["--number", "3", "--port", &port.to_string(), "--key-file"])
            .arg(folder.join("keys.json"))
            .arg("--tracker")
            .arg(folder.join("tracker.sock"))
            .spawn()
            .expect("python3, 3.11 or newer, on the path");
        let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
        socket.connect(("127.0.0.1", port)).unwrap();
        socket.set_nonblocking(true).unwrap();
        Self {
            child,
            folder,
            socket,
            key: Key::from_hex(KEY_HEX).unwrap(),
            sequence: 0,
            echo_ms: 0,
            started: Instant::now(),
        }
    }

    fn clock_ms(&self) -> u32 {
        70_000 + self.started.elapsed().as_millis() as u32
    }

    fn header(&self, epoch: u32, sequence: u32) -> Header {
        Header {
            robot: 3,
            epoch,
            sequence,
            tick: sequence,
            clock_ms: self.clock_ms(),
            echo_ms: self.echo_ms,
        }
    }

    fn send(&mut self, speed: f64) -> Vec<u8> {
        self.sequence += 1;
        let command = Drive {
            enable: true,
            wheel_rad_per_s: [speed; 4],
            ..Drive::default()
        };
        let frame = if self.sequence.is_multiple_of(2) {
            let mut out = [0; 96];
            let length = encode_command(&self.header(5, self.sequence), &command, &self.key, &mut out);
            out[..length].to_vec()
        } else {
            let shared = GroupHeader {
                epoch: 5,
                sequence: self.sequence,
                tick: self.sequence,
                clock_ms: self.clock_ms(),
            };
            let part = |robot: u8, key: Key| Part {
                robot,
                echo_ms: self.echo_ms,
                command,
                key,
            };
            let mut out = [0; robot::frame::MAX_CHARACTERS];
            let parts = [part(2, Key::new([7; 16])), part(3, self.key)];
            let length = encode_group(&shared, &parts, &mut out);
            out[..length].to_vec()
        };
        // The robot may not listen yet.
        let _ = self.socket.send(&frame);
        frame
    }

    /// Everything that has come in.
    fn receive(&mut self) -> Vec<Payload> {
        let (mut payloads, mut buffer) = (Vec::new(), [0; 512]);
        while let Ok(length) = self.socket.recv(&mut buffer) {
            let frame = decode(&buffer[..length], &self.key).expect("a frame of the link");
            self.echo_ms = frame.header.clock_ms;
            payloads.push(frame.payload);
        }
        payloads
    }

    /// A period of 8 ms; the newest telemetry.
    fn period(&mut self, speed: Option<f64>) -> Vec<Payload> {
        if let Some(speed) = speed {
            self.send(speed);
        }
        std::thread::sleep(Duration::from_millis(8));
        self.receive()
    }
}

impl Drop for PythonRobot {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
        let _ = std::fs::remove_dir_all(&self.folder);
    }
}

fn motion(payloads: &[Payload]) -> Vec<Telemetry> {
    payloads
        .iter()
        .filter_map(|payload| match payload {
            Payload::Telemetry(telemetry) => Some(*telemetry),
            _ => None,
        })
        .collect()
}

#[test]
fn the_python_robot_keeps_the_rules_of_the_link() {
    let mut robot = PythonRobot::start();
    let begun = Instant::now();
    let mut cruising = 0;
    while cruising < 40 {
        assert!(begun.elapsed() < Duration::from_secs(30), "it does not drive");
        let payloads = robot.period(Some(4.0));
        for telemetry in motion(&payloads) {
            if telemetry.status.running && telemetry.status.clock_known && telemetry.wheel_rad_per_s == [4.0; 4] {
                cruising += 1;
            }
        }
    }
    let tracker = UnixStream::connect(robot.folder.join("tracker.sock")).unwrap();
    tracker.set_read_timeout(Some(Duration::from_secs(5))).unwrap();
    let mut line = String::new();
    BufReader::new(tracker).read_line(&mut line).unwrap();
    let picture: emulator::tracker::TrackerFrame = serde_json::from_str(&line).unwrap();
    assert!(picture.poses.len() == 1 && picture.poses[0].number == 3, "{picture:?}");
    // Old frames of the same laboratory, forgeries, and an older epoch: nothing of it keeps it going.
    let replay = robot.send(4.0);
    let cut = Instant::now();
    let (mut ramping_at, mut latched_at, mut health, mut counters) = (None, None, 0, None);
    while cut.elapsed() < Duration::from_millis(1800) {
        let _ = robot.socket.send(&replay);
        let mut out = [0; 96];
        let forger = Key::new([9; 16]);
        let fast = Drive {
            enable: true,
            clear: true,
            wheel_rad_per_s: [-30.0; 4],
            ..Drive::default()
        };
        for (header, key) in [(robot.header(6, 1), &forger), (robot.header(4, 1_000_000), &robot.key)] {
            let length = encode_command(&header, &fast, key, &mut out);
            let _ = robot.socket.send(&out[..length]);
        }
        for payload in robot.period(None) {
            match payload {
                Payload::Telemetry(telemetry) => {
                    let speed = telemetry.wheel_rad_per_s[0];
                    assert!((0.0..=4.0).contains(&speed), "{telemetry:?}");
                    if speed < 4.0 && ramping_at.is_none() {
                        ramping_at = Some(cut.elapsed());
                    }
                    if telemetry.status.latched && latched_at.is_none() {
                        assert!(speed == 0.0 && !telemetry.status.stopped);
                        latched_at = Some(cut.elapsed());
                    }
                }
                Payload::Health(told) => {
                    health += 1;
                    assert!(!told.anchored);
                }
                Payload::Counters(told) => counters = Some(told),
                other => panic!("a robot does not send {other:?}"),
            }
        }
    }
    let (ramping_at, latched_at) = (ramping_at.expect("it ramps"), latched_at.expect("it latches"));
    println!("ramping after {ramping_at:?}, latched after {latched_at:?}, {health} health frames, {counters:?}");
    // The tests' host may be late; the robot may not be early.
    assert!(ramping_at > Duration::from_millis(90) && ramping_at < Duration::from_millis(300));
    assert!(latched_at > Duration::from_millis(480) && latched_at < Duration::from_millis(900));
    let counters = counters.expect("counters come once a second");
    assert!(health >= 10 && counters.mac > 20 && counters.old_epoch > 20 && counters.out_of_order > 20);
}
