//! Counts of the laboratory's edge reach those who show them.

mod fixture;

use fixture::{Folder, records};
use lab::archive;
use lab::camera::refusals::{PictureRefusals, RefusalLine};
use lab::edge::{CameraEdge, Edge, HeardCounts, RobotEdge, ToldCounts};
use lab::journal::JournalWriter;
use lab::localisation::{Localisation, Source};
use localise::{CameraHealth, FusionCounts};
use serde_json::Value;
use std::io::Write;
use std::os::unix::net::UnixListener;
use std::time::{Duration, Instant};

#[test]
fn the_manifest_has_the_counts_of_the_run() {
    let edge = Edge {
        fusion: Some(FusionCounts {
            used: 900,
            jumps: 2,
            ..FusionCounts::default()
        }),
        cameras: vec![CameraEdge {
            name: Some("cam-0".to_owned()),
            health: "live".to_owned(),
            refused: PictureRefusals { size: 4, pixels: 1 },
        }],
        robots: vec![RobotEdge {
            robot: "omni-01".to_owned(),
            unsent: 5,
            heard: HeardCounts {
                replayed: 6,
                ..HeardCounts::default()
            },
            told: Some(ToldCounts {
                mac: 7,
                ..ToldCounts::default()
            }),
        }],
        strange_datagrams: 8,
    };
    let mut records = records(20, true);
    let end = records.pop().expect("the end");
    records.push(edge.clone().record());
    records.push(end);
    let folder = Folder::new("edge");
    let mut journal = JournalWriter::create(folder.path()).expect("a journal");
    records.iter().for_each(|record| journal.push(record).expect("push"));
    journal.flush().expect("flush");
    let out = folder.path().join("archive");
    let manifest = archive::build(folder.path(), &out).expect("an archive");
    assert_eq!(manifest.edge, Some(edge));
    let text = std::fs::read_to_string(out.join("manifest.json")).expect("a manifest");
    let document: Value = serde_json::from_str(&text).expect("JSON");
    let edge = &document["edge"];
    assert_eq!(edge["fusion"]["jumps"], 2);
    assert_eq!(edge["cameras"][0]["health"], "live");
    assert_eq!(edge["cameras"][0]["refused"]["size"], 4);
    assert_eq!(edge["robots"][0]["told"]["mac"], 7);
    assert_eq!(edge["robots"][0]["heard"]["replayed"], 6);
    assert_eq!(edge["strange_datagrams"], 8);
}

#[test]
fn pictures_that_a_cameras_process_refuses_are_known_in_the_laboratory() {
    let folder = Folder::new("refusals");
    let socket = folder.path().join("camera-0.sock");
    let listener = UnixListener::bind(&socket).expect("a socket");
    let localisation = Localisation::start(Source::Cameras(vec![socket])).expect("a localisation");
    assert_eq!(localisation.counts(), Some(FusionCounts::default()));
    let (mut stream, _) = listener.accept().expect("the laboratory connects");
    let refused = PictureRefusals { size: 12, pixels: 3 };
    let line = RefusalLine {
        camera: "cam-0".to_owned(),
        refused,
    };
    writeln!(stream, "{}", serde_json::to_string(&line).expect("a line")).expect("sent");
    let begun = Instant::now();
    loop {
        let cameras = localisation.cameras();
        let [camera] = cameras.as_slice() else {
            panic!("{cameras:?}");
        };
        if camera.refused == refused {
            assert_eq!(camera.name.as_deref(), Some("cam-0"));
            assert_eq!(camera.health, CameraHealth::Silent);
            return;
        }
        assert!(begun.elapsed() < Duration::from_secs(10), "{camera:?}");
        std::thread::sleep(Duration::from_millis(5));
    }
}
