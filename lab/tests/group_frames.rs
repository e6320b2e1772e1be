//! Commands for several robots, over real sockets: frames for each robot at its own address, or one frame at the address for
//! groups.

use api::lab::LabDescription;
use lab::commander::Still;
use lab::epochs::EpochBook;
use lab::link::{HeldPort, Link};
use lab::pilot::Outlet;
use lab::robot_addresses::{OwnPlace, Place, RobotAddresses};
use lab::voice::Voice;
use robot::frame::{Counters, Header, Health, Payload, decode, decode_for, encode_counters, encode_health};
use robot::key::Key;
use std::collections::BTreeMap;
use std::net::UdpSocket;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, Instant};

const LIMIT: Duration = Duration::from_secs(10);

/// Two robots that listen on ports of their own and nowhere else.
struct Rig {
    robots: Vec<(u8, Key, UdpSocket)>,
    link: Arc<Link>,
}

impl Rig {
    fn start(groups: Option<&str>) -> Self {
        static RIGS: AtomicU32 = AtomicU32::new(0);
        let mut lab: LabDescription =
            serde_json::from_str(include_str!("../../examples/lab/reference.json")).expect("a laboratory");
        lab.robots.truncate(2);
        let robots: Vec<_> = lab
            .robots
            .iter()
            .map(|robot| {
                let socket = UdpSocket::bind("127.0.0.1:0").expect("a port");
                socket
                    .set_read_timeout(Some(Duration::from_millis(200)))
                    .expect("a socket");
                (robot.number, Key::new([robot.number; 16]), socket)
            })
            .collect();
        let own: Vec<OwnPlace> = robots
            .iter()
            .map(|(number, _, socket)| {
                let port = socket.local_addr().expect("an address").port();
                format!("{number}=127.0.0.1:{port}").parse().expect("a place")
            })
            .collect();
        let groups: Option<Place> = groups.map(|text| text.parse().expect("a place"));
        let addresses = RobotAddresses::resolve("127.0.0.1", 9000, &own, groups.as_ref()).expect("addresses");
        let keys: BTreeMap<u8, Key> = robots.iter().map(|(number, key, _)| (*number, *key)).collect();
        let count = RIGS.fetch_add(1, Ordering::Relaxed);
        let file = std::env::temp_dir().join(format!("robopheus-groups-{}-{count}.json", std::process::id()));
        let _ = std::fs::remove_file(&file);
        let mut book = EpochBook::open(&file).expect("a book");
        let link = Link::start(&lab.robots, &keys, &addresses, &mut book).expect("a link");
        let _ = std::fs::remove_file(&file);
        Self { robots, link }
    }

    fn ports(&self) -> Vec<HeldPort> {
        let ports = self
            .robots
            .iter()
            .map(|(number, ..)| self.link.robot(*number)?.take_port());
        ports.collect::<Option<_>>().expect("ports")
    }

    /// Every robot hears the laboratory and answers with its health: it reads groups.
    fn greet(&self, ports: &mut [HeldPort]) {
        for ((number, key, socket), port) in self.robots.iter().zip(ports.iter_mut()) {
            port.still(Still::Rest, 0);
            let mut buffer = [0; 700];
            let (length, lab) = socket.recv_from(&mut buffer).expect("a frame of its own");
            let heard = decode(&buffer[..length], key).expect("a command").header;
            let header = Header {
                robot: *number,
                epoch: heard.epoch,
                sequence: 1,
                tick: 0,
                clock_ms: 1,
                echo_ms: heard.clock_ms,
            };
            let mut out = [0; 160];
            let length = encode_health(&header, &Health::default(), key, &mut out);
            socket.send_to(&out[..length], lab).expect("sent");
            let begun = Instant::now();
            while self.link.robot(*number).expect("a robot").health().is_none() {
                assert!(begun.elapsed() < LIMIT, "robot {number} is not heard");
                std::thread::sleep(Duration::from_millis(2));
            }
        }
    }
}

/// One tick without motion for all.
fn tick(voice: &mut Voice, robots: usize) {
    for place in 0..robots {
        voice.still(place, Still::Rest, 7);
    }
    voice.finish(7);
}

#[test]
fn robots_that_bind_only_their_own_port_get_frames_of_their_own() {
    let rig = Rig::start(None);
    let mut ports = rig.ports();
    rig.greet(&mut ports);
    let mut voice = Voice::new(ports);
    tick(&mut voice, 2);
    for (number, key, socket) in &rig.robots {
        let mut buffer = [0; 700];
        let length = socket.recv(&mut buffer).expect("the robot is reached");
        let frame = decode(&buffer[..length], key).expect("a frame of type 1");
        assert!(matches!(frame.payload, Payload::Command(_)));
        assert_eq!((frame.header.robot, frame.header.tick), (*number, 7));
        assert_eq!(rig.link.robot(*number).expect("a robot").unsent(), 0);
    }
}

#[test]
fn one_broadcast_frame_reaches_all_where_there_is_an_address_for_it() {
    let common = UdpSocket::bind("0.0.0.0:0").expect("a port");
    common.set_read_timeout(Some(Duration::from_secs(5))).expect("a socket");
    let port = common.local_addr().expect("an address").port();
    let rig = Rig::start(Some(&format!("127.255.255.255:{port}")));
    let mut ports = rig.ports();
    rig.greet(&mut ports);
    assert!(ports.iter().all(|port| port.takes_groups()));
    let mut voice = Voice::new(ports);
    tick(&mut voice, 2);
    let mut buffer = [0; 700];
    let length = common.recv(&mut buffer).expect("a broadcast frame");
    for (number, key, socket) in &rig.robots {
        let frame = decode_for(&buffer[..length], *number, key).expect("a part for each");
        assert_eq!((frame.header.robot, frame.header.tick), (*number, 7));
        assert!(socket.recv(&mut [0; 700]).is_err(), "nothing besides");
        assert_eq!(rig.link.robot(*number).expect("a robot").unsent(), 0);
    }
}

#[test]
fn frames_that_cannot_be_sent_are_counted() {
    let own: Vec<OwnPlace> = vec!["1=255.255.255.255:9".parse().expect("a place")];
    let mut lab: LabDescription =
        serde_json::from_str(include_str!("../../examples/lab/reference.json")).expect("a laboratory");
    lab.robots.truncate(1);
    let addresses = RobotAddresses::resolve("127.0.0.1", 9000, &own, None).expect("addresses");
    let file = std::env::temp_dir().join(format!("robopheus-unsent-{}.json", std::process::id()));
    let _ = std::fs::remove_file(&file);
    let mut book = EpochBook::open(&file).expect("a book");
    let keys = BTreeMap::from([(1, Key::new([1; 16]))]);
    let link = Link::start(&lab.robots, &keys, &addresses, &mut book).expect("a link");
    let _ = std::fs::remove_file(&file);
    let robot = link.robot(1).expect("a robot");
    let mut port = robot.take_port().expect("its port");
    for count in 1..=3 {
        port.still(Still::Rest, 0);
        assert_eq!(robot.unsent(), count, "a broadcast address that the socket may not use");
    }
}

#[test]
fn what_a_robot_says_of_its_frames_is_kept_and_datagrams_for_nobody_are_counted() {
    let rig = Rig::start(None);
    let mut ports = rig.ports();
    rig.greet(&mut ports);
    ports[0].still(Still::Rest, 0);
    let (number, key, socket) = &rig.robots[0];
    let mut buffer = [0; 700];
    let (length, lab) = socket.recv_from(&mut buffer).expect("a frame");
    let heard = decode(&buffer[..length], key).expect("a command").header;
    let header = Header {
        robot: *number,
        epoch: heard.epoch,
        sequence: 2,
        tick: 0,
        clock_ms: 2,
        echo_ms: heard.clock_ms,
    };
    let counters = Counters {
        accepted: 41,
        mac: 3,
        stale: 7,
        ..Counters::default()
    };
    let mut out = [0; 160];
    let length = encode_counters(&header, &counters, key, &mut out);
    socket.send_to(&out[..length], lab).expect("sent");
    socket.send_to(b":0102FE", lab).expect("sent");
    socket.send_to(b"", lab).expect("sent");
    let robot = rig.link.robot(*number).expect("a robot");
    let begun = Instant::now();
    while robot.counters().is_none() || rig.link.strange_datagrams() < 2 {
        assert!(
            begun.elapsed() < LIMIT,
            "{:?} {}",
            robot.counters(),
            rig.link.strange_datagrams()
        );
        std::thread::sleep(Duration::from_millis(2));
    }
    assert_eq!(robot.counters(), Some(counters));
    assert_eq!((robot.statistics().received, rig.link.strange_datagrams()), (2, 2));
}
