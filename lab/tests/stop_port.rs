//! The stop port latches, over restarts too, and only its own page or a program may clear it.

mod fixture;

use fixture::Folder;
use lab::edge::Edge;
use lab::stop_latch::StopLatch;
use lab::stop_port::{self, StateSource, StopState};
use std::io::{Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::sync::Arc;
use std::sync::mpsc::sync_channel;

struct Source(Arc<StopLatch>);

impl StateSource for Source {
    fn state(&self) -> StopState {
        StopState {
            stopped: self.0.is_pressed(),
            lab: "reference-lab".into(),
            run: None,
            phase: None,
            robots: Vec::new(),
            edge: Edge::default(),
        }
    }
}

fn start(folder: &Folder) -> (Arc<StopLatch>, SocketAddr) {
    let latch = Arc::new(StopLatch::open(folder.path()));
    let any = SocketAddr::from(([127, 0, 0, 1], 0));
    let address = stop_port::start(any, folder.path(), latch.clone(), Arc::new(Source(latch.clone()))).expect("a port");
    (latch, address)
}

/// Status and body.
fn ask(address: SocketAddr, method: &str, path: &str, origin: Option<&str>) -> (u16, String) {
    let mut stream = TcpStream::connect(address).expect("a connection");
    let origin = origin.map(|origin| format!("Origin: {origin}\r\n")).unwrap_or_default();
    write!(
        stream,
        "{method} {path} HTTP/1.1\r\nHost: {address}\r\n{origin}Content-Length: 0\r\nConnection: close\r\n\r\n"
    )
    .expect("a request");
    let mut reply = String::new();
    stream.read_to_string(&mut reply).expect("a reply");
    let (head, body) = reply.split_once("\r\n\r\n").expect("a head");
    (
        head.split(' ').nth(1).expect("a status").parse().expect("a number"),
        body.to_owned(),
    )
}

fn stopped(address: SocketAddr) -> bool {
    let (status, body) = ask(address, "GET", "/state", None);
    assert_eq!(status, 200);
    serde_json::from_str::<StopState>(&body).expect("a state").stopped
}

#[test]
fn the_address_stands_in_the_data_folder_and_the_page_has_the_button() {
    let folder = Folder::new("stop-page");
    let (_, address) = start(&folder);
    let written = std::fs::read_to_string(folder.path().join(stop_port::ADDRESS_FILE)).expect("the address");
    assert_eq!(written.trim(), address.to_string());
    let (status, page) = ask(address, "GET", "/", None);
    assert!(status == 200 && page.contains("STOP") && page.contains("\"/stop\""));
    assert_eq!(ask(address, "GET", "/stop", None).0, 404, "reading must not stop");
}

#[test]
fn a_press_latches_wakes_and_outlives_the_process() {
    let folder = Folder::new("stop-latch");
    let (latch, address) = start(&folder);
    let (wake, woken) = sync_channel(1);
    latch.wake_on_change(wake);
    assert!(!stopped(address));
    assert_eq!(
        ask(address, "POST", "/stop", Some("http://elsewhere.example")).0,
        200,
        "anyone may stop"
    );
    assert!(latch.is_pressed() && stopped(address));
    woken.try_recv().expect("the sender of frames was woken");

    // Another process with the same folder.
    let (again, address) = start(&folder);
    assert!(again.is_pressed() && stopped(address));
    assert_eq!(ask(address, "POST", "/clear", Some("http://elsewhere.example")).0, 403);
    assert!(again.is_pressed());
    let own = format!("http://{address}");
    assert_eq!(ask(address, "POST", "/clear", Some(&own)).0, 200);
    assert!(!again.is_pressed());
    assert!(!StopLatch::open(folder.path()).is_pressed());
    let audit = std::fs::read_to_string(folder.path().join("stop-audit.log")).expect("the audit");
    assert_eq!(audit.lines().filter(|line| line.contains(" pressed ")).count(), 1);
    assert_eq!(audit.lines().filter(|line| line.contains(" cleared ")).count(), 1);
}

#[test]
fn stops_even_when_the_mark_cannot_be_written() {
    let folder = Folder::new("stop-unwritable");
    let (latch, address) = start(&folder);
    std::fs::remove_dir_all(folder.path()).expect("the folder goes away");
    let (status, body) = ask(address, "POST", "/stop", None);
    assert!(status == 500 && body.contains("Stopped"), "{status} {body}");
    assert!(latch.is_pressed());
}
