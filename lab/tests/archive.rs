//! An archive made from a journal opens in the readers that people use, and says the same as the records.

mod fixture;

use api::lab::Assignment;
use arrow_array::cast::AsArray;
use arrow_array::types::{Float64Type, Int64Type};
use arrow_array::{Array, RecordBatch};
use fixture::{Folder, START_US};
use lab::archive::{self, Manifest};
use lab::journal::{FILE_NAME, JournalWriter};
use lab::record::Record;
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;
use sha2::{Digest, Sha256};
use std::collections::BTreeMap;
use std::fs;

const TICKS: i64 = 60;

struct Built {
    _folder: Folder,
    out: std::path::PathBuf,
    manifest: Manifest,
}

fn build(records: &[Record], cut_bytes: u64) -> Built {
    let folder = Folder::new("archive");
    let mut journal = JournalWriter::create(folder.path()).expect("a new journal");
    for chunk in records.chunks(50) {
        chunk.iter().for_each(|record| journal.push(record).expect("push"));
        journal.flush().expect("flush");
    }
    let file = fs::OpenOptions::new()
        .write(true)
        .open(folder.path().join(FILE_NAME))
        .expect("the journal");
    file.set_len(file.metadata().expect("its length").len() - cut_bytes)
        .expect("cut");
    let out = folder.path().join("archive");
    let manifest = archive::build(folder.path(), &out).expect("an archive");
    Built {
        _folder: folder,
        out,
        manifest,
    }
}

fn assert_hashes_hold(built: &Built) {
    let text = fs::read(built.out.join("manifest.json")).expect("the manifest");
    assert_eq!(
        serde_json::from_slice::<Manifest>(&text).expect("its form"),
        built.manifest
    );
    let mut names = Vec::new();
    for file in &built.manifest.files {
        let bytes = fs::read(built.out.join(&file.name)).expect("a listed file");
        assert_eq!(bytes.len() as u64, file.bytes, "{}", file.name);
        let sha256: String = Sha256::digest(&bytes)
            .iter()
            .map(|byte| format!("{byte:02x}"))
            .collect();
        assert_eq!(sha256, file.sha256, "{}", file.name);
        names.push(file.name.as_str());
    }
    for name in [
        "experiment.json",
        "verdict.json",
        "log.txt",
        "run.mcap",
        "robots/omni-01/run.json",
        "robots/diff-01/telemetry.parquet",
    ] {
        assert!(names.contains(&name), "{name} is missing");
    }
}

/// Messages by topic.
fn messages(built: &Built) -> BTreeMap<String, Vec<mcap::Message<'static>>> {
    let bytes: &'static [u8] = fs::read(built.out.join("run.mcap")).expect("run.mcap").leak();
    let mut topics: BTreeMap<String, Vec<_>> = BTreeMap::new();
    for message in mcap::read::MessageStream::new(bytes).expect("an mcap file") {
        let message = message.expect("a message");
        topics.entry(message.channel.topic.clone()).or_default().push(message);
    }
    topics
}

fn table(built: &Built, robot: &str) -> RecordBatch {
    let file = fs::File::open(built.out.join(format!("robots/{robot}/telemetry.parquet"))).expect("the table");
    let reader = ParquetRecordBatchReaderBuilder::try_new(file)
        .expect("a parquet file")
        .with_batch_size(100_000);
    let mut batches: Vec<_> = reader
        .build()
        .expect("a reader")
        .map(|batch| batch.expect("rows"))
        .collect();
    assert_eq!(batches.len(), 1);
    batches.remove(0)
}

/// Values of a column by time in microseconds after the start; empty cells are left out.
fn column(table: &RecordBatch, name: &str) -> Vec<(i64, f64)> {
    let times = table.column(0).as_primitive::<Float64Type>();
    let column = table.column_by_name(name).unwrap_or_else(|| panic!("no column {name}"));
    let value = |row: usize| match column.data_type() {
        arrow_schema::DataType::Int64 => column.as_primitive::<Int64Type>().value(row) as f64,
        _ => column.as_primitive::<Float64Type>().value(row),
    };
    let filled = (0..table.num_rows()).filter(|row| column.is_valid(*row));
    filled
        .map(|row| ((times.value(row) * 1e6).round() as i64, value(row)))
        .collect()
}

fn number(assignment: &Assignment, name: &str) -> u8 {
    assignment
        .robots
        .iter()
        .find(|robot| robot.description.name == name)
        .expect("a robot")
        .number
}

#[test]
fn a_run_that_ended_is_complete_and_its_hashes_hold() {
    let built = build(&fixture::records(TICKS, true), 0);
    assert_hashes_hold(&built);
    let manifest = &built.manifest;
    assert!(manifest.complete);
    assert_eq!(
        (manifest.ticks_recorded, manifest.ticks_missed, manifest.epoch),
        (TICKS, 0, 3)
    );
    // Lateness runs from 50 to 109 microseconds, sleeps from 100 to 150 in steps of ten.
    let jitter = &manifest.tick_jitter;
    assert_eq!(
        (
            jitter.late_p50_ms,
            jitter.late_max_ms,
            jitter.bunched,
            jitter.sleep_samples
        ),
        (0.079, 0.109, 0, 6)
    );
    assert_eq!(jitter.sleep_late_p99_ms, 0.15);
    let log = fs::read_to_string(built.out.join("log.txt")).expect("the log");
    assert!(
        log.starts_with("2026-03-01T12:00:00.500000Z info robots are at their starts\n"),
        "{log}"
    );
    assert!(
        log.contains("run ended as done") && log.contains("60 recorded, 0 missed"),
        "{log}"
    );
    assert!(log.contains("info controller: past the gate\n"), "{log}");
    let track = fs::read(built.out.join("track.json")).expect("the track");
    let track: api::verdict::Replay = serde_json::from_slice(&track).expect("a replay");
    let notes: Vec<_> = track.notes.iter().map(|tick| (tick.tick, tick.notes.len())).collect();
    assert_eq!(notes, [(8, 2)]);
}

#[test]
fn run_json_is_a_run_bundle_of_the_described_robot() {
    let built = build(&fixture::records(3, true), 0);
    let run: serde_json::Value =
        serde_json::from_slice(&fs::read(built.out.join("robots/omni-01/run.json")).expect("run.json")).expect("json");
    assert_eq!(run["format"], "robopheus.run/1");
    assert_eq!(run["stamp"], "sample");
    assert_eq!(run["floor"], "lab-floor");
    assert_eq!(run["started"], "2026-03-01T12:00:01.000000Z");
    let description: api::robot::RobotDescription =
        serde_json::from_value(run["robot"].clone()).expect("a description");
    assert!(
        fixture::assignment()
            .robots
            .iter()
            .any(|robot| robot.description == description)
    );
}

#[test]
fn mcap_holds_poses_transforms_commands_interventions_and_log_at_wall_times() {
    let built = build(&fixture::records(TICKS, true), 0);
    let topics = messages(&built);
    let count = |topic: &str| topics.get(topic).map_or(0, Vec::len) as i64;
    assert_eq!(count("/robots/omni-01/pose"), TICKS);
    assert_eq!(count("/tf"), 2 * TICKS);
    assert_eq!(count("/robots/omni-01/pose_quality"), TICKS);
    let quality: serde_json::Value =
        serde_json::from_slice(&topics["/robots/omni-01/pose_quality"][0].data).expect("json");
    assert_eq!(quality["accepted"], true);
    assert_eq!(quality["age_us"], 8100);
    assert_eq!(
        (&quality["position_sigma_m"], &quality["yaw_sigma_rad"]),
        (&serde_json::json!(0.0004), &serde_json::json!(0.001))
    );
    assert_eq!(count("/robots/diff-01/command"), TICKS);
    assert_eq!(count("/robots/diff-01/telemetry"), TICKS);
    assert_eq!((count("/safety"), count("/log"), count("/controller/notes")), (1, 2, 1));
    let safety: serde_json::Value = serde_json::from_slice(&topics["/safety"][0].data).expect("json");
    assert_eq!(safety["requested"], serde_json::json!([0.5, 0.0, 0.25]));
    assert_eq!(
        safety["pressures"],
        serde_json::json!([{"cause": "wall_left", "other": null, "push_m_per_s": 0.125}])
    );
    let told: serde_json::Value = serde_json::from_slice(&topics["/controller/notes"][0].data).expect("json");
    assert_eq!(told["tick"], 8);
    assert_eq!(
        told["notes"][1],
        serde_json::json!({"kind": "point", "at_m": [0.5, -0.25], "colour": 3})
    );
    assert_eq!(topics["/controller/notes"][0].log_time, topics["/log"][1].log_time);
    let first = &topics["/robots/omni-01/pose"][0];
    let schema = first.channel.schema.as_ref().expect("a schema");
    assert_eq!(
        (schema.name.as_str(), schema.encoding.as_str()),
        ("foxglove.PoseInFrame", "jsonschema")
    );
    serde_json::from_slice::<serde_json::Value>(&schema.data).expect("the schema is JSON");
    // Start of the motion is 12:00:01; the first exposure lies 4 ms before, its arrival 4.1 ms after.
    let start_ns = 1_772_366_401_000_000_000_u64;
    assert_eq!(
        (first.publish_time, first.log_time),
        (start_ns - 4_000_000, start_ns + 4_100_000)
    );
    let pose: serde_json::Value = serde_json::from_slice(&first.data).expect("json");
    assert_eq!(pose["frame_id"], "world");
    assert_eq!(pose["pose"]["position"]["x"], 0.1);
    assert_eq!(
        pose["timestamp"],
        serde_json::json!({"sec": 1_772_366_400, "nsec": 996_000_000})
    );
}

#[test]
fn parquet_rows_are_the_records() {
    let built = build(&fixture::records(TICKS, true), 0);
    let assignment = fixture::assignment();
    for name in ["omni-01", "diff-01"] {
        let table = table(&built, name);
        let robot = number(&assignment, name);
        let times = table.column(0).as_primitive::<Float64Type>();
        assert!(
            times.values().windows(2).all(|pair| pair[0] < pair[1]),
            "rows in order of time"
        );
        assert_eq!(times.value(0), 0.0003, "nothing from before the start");

        let commands: Vec<_> = (0..TICKS).map(|tick| fixture::command(robot, tick)).collect();
        let expect: Vec<_> = commands
            .iter()
            .map(|command| (command.sent_us - START_US, command.wheel_rad_per_s[1]))
            .collect();
        assert_eq!(column(&table, "command_wheel_1_rad_per_s"), expect);
        let expect: Vec<_> = commands
            .iter()
            .map(|command| (command.sent_us - START_US, f64::from(command.sequence)))
            .collect();
        assert_eq!(column(&table, "command_seq_sent"), expect);

        // The first exposure lies before the start.
        let poses: Vec<_> = (1..TICKS).map(|tick| fixture::pose(robot, tick)).collect();
        let expect: Vec<_> = poses
            .iter()
            .map(|pose| (pose.exposure_us - START_US, pose.x_m))
            .collect();
        assert_eq!(column(&table, "pose_x_m"), expect);
        let arrivals = column(&table, "pose_arrival_s");
        assert!(
            arrivals
                .iter()
                .all(|(exposure_us, arrival_s)| (arrival_s * 1e6).round() as i64 == exposure_us + 8100)
        );

        let telemetry: Vec<_> = (0..TICKS).map(|tick| fixture::telemetry(robot, tick)).collect();
        let expect: Vec<_> = telemetry
            .iter()
            .map(|sample| (sample.sample_us - START_US, sample.wheel_rad[0]))
            .collect();
        assert_eq!(column(&table, "wheel_0_rad"), expect);
        let expect: Vec<_> = telemetry
            .iter()
            .map(|sample| (sample.sample_us - START_US, f64::from(sample.applied_sequence)))
            .collect();
        assert_eq!(column(&table, "command_seq_applied"), expect);
    }
    let diff = table(&built, "diff-01");
    assert!(
        diff.column_by_name("command_wheel_2_rad_per_s").is_none(),
        "undriven wheels have no columns"
    );
    assert!(diff.column_by_name("steering_rad").is_none());
    assert_eq!(
        column(&table(&built, "omni-01"), "wheel_2_rad_per_s").len() as i64,
        TICKS
    );
    let cameras = diff.column_by_name("camera_id").expect("cameras").as_string::<i32>();
    assert_eq!(
        cameras.iter().flatten().filter(|camera| *camera == "tracker").count() as i64,
        TICKS - 1
    );
}

/// Zeros are no set-points of a robot that brakes by a ramp of its own.
#[test]
fn frames_after_the_end_have_a_number_and_no_set_points() {
    let mut records = fixture::records(TICKS, true);
    for record in &mut records {
        if let Record::Command(command) = record
            && command.tick >= TICKS - 5
        {
            (command.enable, command.ended) = (false, true);
        }
    }
    let table = table(&build(&records, 0), "omni-01");
    let count = |name: &str| column(&table, name).len() as i64;
    assert_eq!(count("command_seq_sent"), TICKS);
    assert_eq!(count("command_wheel_0_rad_per_s"), TICKS - 5);
    assert_eq!(count("wheel_0_rad_per_s"), TICKS);
}

#[test]
fn a_journal_cut_off_by_a_crash_gives_a_partial_archive_that_opens() {
    let built = build(&fixture::records(TICKS, false), 17);
    assert_hashes_hold(&built);
    assert!(!built.manifest.complete);
    assert!(built.manifest.state.is_none());
    let ticks = built.manifest.ticks_recorded;
    assert!(ticks > TICKS - 10 && ticks < TICKS, "{ticks} ticks");
    assert!(messages(&built)["/robots/omni-01/pose"].len() as i64 >= ticks);
    assert!(column(&table(&built, "omni-01"), "pose_x_m").len() as i64 >= ticks - 1);
    let log = fs::read_to_string(built.out.join("log.txt")).expect("the log");
    assert!(
        log.contains("stopped without ending the run") && log.contains("damaged"),
        "{log}"
    );
}

#[test]
fn building_again_replaces_the_archive() {
    let folder = Folder::new("archive-again");
    let mut journal = JournalWriter::create(folder.path()).expect("a new journal");
    fixture::records(5, true)
        .iter()
        .for_each(|record| journal.push(record).expect("push"));
    journal.flush().expect("flush");
    let out = folder.path().join("archive");
    let first = archive::build(folder.path(), &out).expect("an archive");
    fs::write(out.join("leftover.txt"), "x").expect("a stray file");
    assert_eq!(archive::build(folder.path(), &out).expect("an archive"), first);
    assert!(!out.join("leftover.txt").exists());
}

#[test]
fn a_run_that_never_moved_still_has_its_log() {
    let records: Vec<_> = fixture::records(0, true)
        .into_iter()
        .filter(|record| !matches!(record, Record::Motion(_)))
        .collect();
    let built = build(&records, 0);
    assert_hashes_hold(&built);
    assert!(built.manifest.complete);
    assert_eq!(built.manifest.ticks_recorded, 0);
    let log = fs::read_to_string(built.out.join("log.txt")).expect("the log");
    assert!(log.contains("robots are at their starts"), "{log}");
    assert_eq!(table_rows(&built), 0);
}

fn table_rows(built: &Built) -> i64 {
    let file = fs::File::open(built.out.join("robots/omni-01/telemetry.parquet")).expect("the table");
    ParquetRecordBatchReaderBuilder::try_new(file)
        .expect("a parquet file")
        .metadata()
        .file_metadata()
        .num_rows()
}
