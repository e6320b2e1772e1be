//! Runs of the twin, and virtual robots that follow physical ones.

mod fixture;

use api::experiment::Mode;
use control::rehearsal::Rehearsal;
use fixture::twin_run::{assignment, run, scenario};
use fixture::{Folder, START_US};
use lab::archive;
use lab::journal::JournalWriter;
use lab::record::{End, Record};
use lab::safety::Ending;
use lab::shadow::ShadowRun;
use lab::virtual_run::{CAMERA, VirtualEnding};

#[test]
fn a_virtual_run_is_the_rehearsal_to_the_bit() {
    for example in ["rectangle-omni4.json", "swap-ten.json"] {
        let assignment = assignment(example, Mode::Virtual);
        let mut rehearsal = Rehearsal::new(&scenario(&assignment)).expect("a rehearsal");
        while rehearsal.step() {}
        let verdict = rehearsal.finish().verdict;
        let (_, ending, digest) = run(&assignment);
        assert_eq!(ending, VirtualEnding::As(Ending::Finished), "{example}");
        assert_eq!(digest, verdict.digest, "{example}");
    }
}

#[test]
fn the_archive_of_a_virtual_run_is_like_any_other() {
    let assignment = assignment("rectangle-omni4.json", Mode::Virtual);
    let (mut records, _, _) = run(&assignment);
    let ticks = records
        .iter()
        .filter(|record| matches!(record, Record::Tick(_)))
        .count() as i64;
    records.push(Record::End(Box::new(End {
        at_us: START_US + ticks * 1_000_000 / 120,
        state: api::run::RunState::Done,
        fault: None,
        records_dropped: 0,
    })));
    let folder = Folder::new("virtual");
    let mut journal = JournalWriter::create(folder.path()).expect("a new journal");
    for chunk in records.chunks(1000) {
        chunk.iter().for_each(|record| journal.push(record).expect("push"));
        journal.flush().expect("flush");
    }
    let manifest = archive::build(folder.path(), &folder.path().join("archive")).expect("an archive");
    assert!(manifest.complete);
    assert_eq!((manifest.ticks_recorded, manifest.ticks_missed), (ticks, 0));
    assert_eq!(manifest.stages.localisation, CAMERA);
    let tables = manifest
        .files
        .iter()
        .filter(|file| file.name.ends_with("telemetry.parquet"));
    assert_eq!(tables.count(), assignment.robots.len());
}

/// The physical side is the twin itself here: whoever follows it with the right commands is where it is.
#[test]
fn a_follower_of_the_twin_is_where_the_twin_is() {
    let assignment = assignment("rectangle-omni4.json", Mode::Interactive);
    let (records, _, _) = run(&assignment);
    let mut shadow = ShadowRun::default();
    let (mut pictures, mut gaps, mut newest) = (0, 0, [0.0; 3]);
    for record in &records {
        if let Record::Pose(pose) = record {
            newest = [pose.x_m, pose.y_m, pose.yaw_rad];
        }
        let Some(picture) = shadow.take(record).expect("a shadow") else {
            continue;
        };
        // A tick's record stands behind the poses at its end: 1/120 s after the moment of the picture.
        for robot in &picture.robots {
            let off_m = (robot.x_m - newest[0]).hypot(robot.y_m - newest[1]);
            assert!(off_m < 1e-6 + 1.0 / 120.0, "tick {}: {off_m} m", picture.tick);
            if let Some(gap_m) = robot.gap_m {
                assert!(gap_m < 1e-9, "tick {}: gap {gap_m} m", picture.tick);
                gaps += 1;
            }
            pictures += 1;
        }
    }
    assert!(pictures > 300 && gaps > 300, "{pictures} pictures, {gaps} gaps");
}

/// Poses 50 ms old and a heading that is seen wrong at first: the follower is ahead of the pictures and comes back.
#[test]
fn a_follower_makes_up_for_old_pictures() {
    const LATE_TICKS: usize = 6;
    let assignment = assignment("rectangle-omni4.json", Mode::Interactive);
    let (records, _, _) = run(&assignment);
    let poses: Vec<_> = records
        .iter()
        .filter_map(|record| match record {
            Record::Pose(pose) => Some(pose.clone()),
            _ => None,
        })
        .collect();
    let mut shadow = ShadowRun::default();
    let mut worst_m: f64 = 0.0;
    for record in &records {
        let record = match record {
            // The laboratory learns of this one only now.
            Record::Pose(pose) => match (pose.frame as usize).checked_sub(LATE_TICKS) {
                Some(late) => Record::Pose(lab::record::Pose {
                    arrival_us: pose.arrival_us,
                    ..poses[late].clone()
                }),
                None => continue,
            },
            other => other.clone(),
        };
        if let Some(picture) = shadow.take(&record).expect("a shadow")
            && picture.tick > LATE_TICKS as i64
        {
            let true_pose = &poses[picture.tick as usize];
            let robot = &picture.robots[0];
            worst_m = worst_m.max((robot.x_m - true_pose.x_m).hypot(robot.y_m - true_pose.y_m));
        }
    }
    assert!(worst_m < 1e-9, "{worst_m} m");
}
