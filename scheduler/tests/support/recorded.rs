//! Finished runs without a laboratory: bundles that a twin with given effects drove, in the object folder and the database.
#![allow(dead_code)]

use api::experiment::Experiment;
use api::lab::{LabDescription, StateReport};
use api::run::RunState;
use sha2::{Digest, Sha256};
use std::fmt::Write;
use std::path::Path;
use std::time::Duration;
use store::{Claim, FilePut, FileRecord, NewSubmission, Reported, Store, Submitted, VerdictRecord};
use twin::effect::Effect;
use twin::pose::Pose;
use twin::replay::{CommandRow, replay};
use twin::robot::{Robot, RobotDescription};
use uuid::Uuid;

const TICK_HZ: f64 = 120.0;
const SPEED_M_PER_S: f64 = 0.4;

/// A run to be made.
pub struct Recipe<'a> {
    /// An `omni4` of the reference laboratory.
    pub robot: &'a str,
    pub label: &'a str,
    /// What the robot has and its description does not.
    pub effects: &'a str,
    pub duration_s: f64,
    /// Other noise and another way for every seed.
    pub seed: u64,
}

pub fn lab() -> LabDescription {
    serde_json::from_str(include_str!("../../../examples/lab/reference.json")).unwrap()
}

/// A robot of the laboratory with its sensors' noise.
pub fn description(name: &str) -> RobotDescription {
    let lab = lab();
    let robot = lab.robots.iter().find(|robot| robot.description.name == name);
    let mut text = serde_json::to_value(&robot.expect("of the laboratory").description).unwrap();
    text["noise"] = serde_json::json!({"pose_xy_m": 0.001, "pose_yaw_rad": 0.003, "wheel_rad_per_s": 0.05,
        "current_a": 0.03, "gyro_rad_per_s": 0.006});
    serde_json::from_value(text).unwrap()
}

/// Brings a run to `done`, with its bundle; the laboratory must be registered and nothing else queued.
pub async fn done_run(store: &Store, data: &Path, recipe: &Recipe<'_>) -> Uuid {
    let run = submitted(store, recipe).await;
    let claim = Claim {
        lab: "reference-lab".to_owned(),
        arena: "reference".to_owned(),
        instance: Uuid::now_v7(),
        side: api::lab::Side::Physical,
    };
    let claimed = store
        .run_claim(&claim, Duration::from_secs(60))
        .await
        .unwrap()
        .expect("the run is next");
    assert_eq!(claimed.run_id, run);
    let (run_json, csv) = bundle(recipe);
    for (name, bytes) in [("run.json", run_json), ("telemetry.csv", csv)] {
        let object_path = format!("runs/{run}/{}/{name}", claimed.epoch);
        let path = data.join("objects").join(&object_path);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(&path, &bytes).unwrap();
        let record = FileRecord {
            name: format!("robots/{}/{name}", recipe.robot),
            bytes: bytes.len() as i64,
            sha256: hex(&Sha256::digest(bytes.as_bytes())),
            media_type: "text/plain".to_owned(),
            object_path,
        };
        assert_eq!(
            store.run_file_put(run, claimed.epoch, &record).await.unwrap(),
            FilePut::Ok
        );
    }
    for state in [RunState::Running, RunState::Uploading, RunState::Done] {
        let report = StateReport {
            epoch: claimed.epoch,
            instance: claim.instance,
            state,
            fault: None,
            ticks_recorded: None,
            ticks_missed: None,
        };
        assert_eq!(store.run_state_report(run, &report).await.unwrap(), Reported::Ok);
    }
    run
}

async fn submitted(store: &Store, recipe: &Recipe<'_>) -> Uuid {
    let mut experiment: Experiment =
        serde_json::from_str(include_str!("../../../examples/experiments/rectangle-omni4.json")).unwrap();
    experiment.robots[0].name = recipe.robot.to_owned();
    let submission = NewSubmission {
        user: "local".to_owned(),
        label: recipe.label.to_owned(),
        experiment,
        claim: None,
        idempotency_key: None,
        request_hash: [0; 32],
    };
    let Submitted::Created(view) = store.experiment_submit(submission).await.unwrap() else {
        panic!("not stored")
    };
    let claimed = store.job_claim("rehearse", Uuid::now_v7(), Duration::from_secs(60));
    let Some(job) = claimed.await.unwrap() else {
        // A scheduler at work was faster; it says the same.
        while store.run_get(view.run_id).await.unwrap().unwrap().state != RunState::Queued {
            tokio::time::sleep(Duration::from_millis(20)).await;
        }
        return view.run_id;
    };
    let verdict = serde_json::json!({"format": "robopheus.verdict/1", "accepted": true, "sentence": "It works.", "findings": [],
        "digest": "00112233445566778899aabbccddeeff", "twin_version": "test", "ticks": 7200,
        "smallest_separation_m": null, "smallest_wall_distance_m": 0.5, "largest_path_error_m": null});
    let record = VerdictRecord {
        verdict: serde_json::from_value(verdict).unwrap(),
        accepted: true,
        fault: None,
        replay: FileRecord {
            name: "replay.json".to_owned(),
            bytes: 2,
            sha256: hex(&Sha256::digest(b"{}")),
            media_type: "application/json".to_owned(),
            object_path: format!("runs/{}/0/replay.json", view.run_id),
        },
    };
    store.run_verdict_set(&job, &record).await.unwrap();
    view.run_id
}

/// `run.json` and telemetry as CSV.
pub fn bundle(recipe: &Recipe<'_>) -> (String, String) {
    let described = description(recipe.robot);
    let effects: Vec<Effect> = serde_json::from_str(recipe.effects).unwrap();
    let robot = Robot::with_effects(described.clone(), &effects).unwrap();
    let mut noise = Noise(recipe.seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1);
    let commands = commands(&described, recipe.duration_s, &mut noise);
    let start = Pose {
        x_m: 0.0,
        y_m: 0.0,
        yaw_rad: 0.0,
    };
    let rows = replay(&robot, start, &commands).unwrap();
    let mut csv = "time_s".to_owned();
    for wheel in 0..4 {
        let _ = write!(
            csv,
            ",command_wheel_{wheel}_rad_per_s,wheel_{wheel}_rad_per_s,current_{wheel}_a"
        );
    }
    csv.push_str(",gyro_z_rad_per_s,pose_x_m,pose_y_m,pose_yaw_rad\n");
    for (command, row) in commands.iter().zip(&rows) {
        let _ = write!(csv, "{:.6}", row.time_s);
        for wheel in 0..4 {
            let speed = row.state.wheel_rad_per_s[wheel] + 0.05 * noise.normal();
            let current = row.state.current_a[wheel] + 0.03 * noise.normal();
            let set = command.wheel_rad_per_s[wheel].unwrap_or(0.0);
            let _ = write!(csv, ",{set:.6},{speed:.6},{current:.6}");
        }
        let pose = row.state.pose;
        let yaw = twin::pose::wrapped_rad(pose.yaw_rad + 0.003 * noise.normal());
        let gyro = row.state.twist.yaw_rate_rad_per_s + 0.006 * noise.normal();
        let (x, y) = (pose.x_m + 0.001 * noise.normal(), pose.y_m + 0.001 * noise.normal());
        let _ = writeln!(csv, ",{gyro:.6},{x:.6},{y:.6},{yaw:.6}");
    }
    let run = serde_json::json!({"format": "robopheus.run/1", "robot": described, "floor": "lab-floor", "label": recipe.label,
        "started": "2026-01-01T00:00:00Z", "change_free_reference": false, "stamp": "sample"});
    (run.to_string(), csv)
}

/// A way over the floor from place to place, turning now and then, as wheel speeds.
fn commands(robot: &RobotDescription, duration_s: f64, noise: &mut Noise) -> Vec<CommandRow> {
    let (mut x, mut y, mut yaw, mut rate) = (0.0_f64, 0.0_f64, 0.0_f64, 0.0_f64);
    let mut goal = [0.0, 0.0];
    let mut left_s = 0.0;
    let mut rows = Vec::new();
    for tick in 0..(duration_s * TICK_HZ) as u32 {
        let away = [goal[0] - x, goal[1] - y];
        let distance_m = away[0].hypot(away[1]);
        if left_s <= 0.0 || distance_m < 0.05 {
            goal = [1.2 * noise.uniform(), 0.9 * noise.uniform()];
            rate = 1.2 * noise.uniform();
            left_s = 3.0;
        }
        left_s -= 1.0 / TICK_HZ;
        let speed = if distance_m < 0.05 {
            0.0
        } else {
            SPEED_M_PER_S / distance_m
        };
        let (vx, vy) = (speed * away[0], speed * away[1]);
        let (sin, cos) = yaw.sin_cos();
        let (u, v) = (cos * vx + sin * vy, cos * vy - sin * vx);
        let mut row = CommandRow {
            time_s: f64::from(tick) / TICK_HZ,
            ..CommandRow::default()
        };
        for (wheel, place) in robot.wheels.iter().enumerate() {
            let (sin, cos) = place.rolling_direction_rad.sin_cos();
            let along = (u - rate * place.y_m) * cos + (v + rate * place.x_m) * sin;
            row.wheel_rad_per_s[wheel] = Some(along / place.radius_m.unwrap_or(0.05));
        }
        rows.push(row);
        x += vx / TICK_HZ;
        y += vy / TICK_HZ;
        yaw += rate / TICK_HZ;
    }
    rows
}

/// Seeded noise; not for statistics of its own.
struct Noise(u64);

impl Noise {
    /// -1 to 1.
    fn uniform(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }

    /// Variance 1, from twelve uniform draws.
    fn normal(&mut self) -> f64 {
        0.5 * (0..12).map(|_| self.uniform()).sum::<f64>()
    }
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}
