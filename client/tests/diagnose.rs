//! `robopheus diagnose` from files to files.

use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

fn folder(name: &str) -> PathBuf {
    let folder = std::env::temp_dir().join(format!("robopheus-diagnose-{name}-{}", std::process::id()));
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).expect("a folder");
    folder
}

fn robot() -> Value {
    let lab = Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples/lab/reference.json");
    let lab: Value = serde_json::from_str(&std::fs::read_to_string(lab).expect("the laboratory")).expect("JSON");
    let mut robot = lab["robots"][0].clone();
    if robot["description"].is_object() {
        robot = robot["description"].clone();
    }
    robot
}

fn robopheus(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_robopheus"))
        .args(arguments)
        .output()
        .expect("the program")
}

/// A bundle of the twin itself, simulated from commands that change every half second; numbers 7 apart are almost the same.
fn simulated(folder: &Path, number: u32) -> String {
    let commands = folder.join(format!("commands-{number}"));
    std::fs::create_dir_all(&commands).expect("a folder");
    let run = json!({"format": "robopheus.run/1", "robot": robot(), "floor": "lab-floor", "label": "test",
        "started": "2026-01-01T00:00:00Z", "change_free_reference": true, "stamp": "sample"});
    std::fs::write(commands.join("run.json"), run.to_string()).expect("run.json");
    let mut table = "time_s,command_forward_m_per_s,command_left_m_per_s,command_yaw_rate_rad_per_s,pose_x_m,pose_y_m,pose_yaw_rad\n".to_owned();
    for tick in 0..=960 {
        let pose = if tick == 0 { "0.5,-0.25,0" } else { ",," };
        let phase = f64::from((tick / 60 + number) % 7) - 3.0;
        table += &format!(
            "{:.6},{},0,{},{pose}\n",
            f64::from(tick) / 120.0,
            0.15 * phase * (1.0 + 0.002 * f64::from(number)),
            0.3 * phase
        );
    }
    std::fs::write(commands.join("telemetry.csv"), table).expect("telemetry.csv");
    let out = folder.join(format!("run-{number}")).display().to_string();
    let done = robopheus(&["simulate", "--commands", &commands.display().to_string(), "--out", &out]);
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    out
}

#[test]
fn the_twin_agrees_with_itself_and_three_files_are_written() {
    let folder = folder("agrees");
    let runs: Vec<String> = [0, 7, 14].map(|number| simulated(&folder, number)).to_vec();
    let out = folder.join("out");
    let shown = out.display().to_string();
    let arguments = [
        "diagnose",
        "--reference",
        &runs[0],
        "--runs",
        &runs[1],
        &runs[2],
        "--out",
        &shown,
        "--json",
    ];
    let done = robopheus(&arguments);
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    let summary: Value = serde_json::from_slice(&done.stdout).expect("JSON");
    assert_eq!(summary["verdict"], "no_discrepancy");
    let report: Value =
        serde_json::from_str(&std::fs::read_to_string(out.join("report.json")).expect("report")).expect("JSON");
    assert_eq!(report["format"], "robopheus.diagnosis/1");
    assert_eq!(report["data"].as_array().map(Vec::len), Some(3));
    assert_eq!(report["effects"], json!([]));
    let page = std::fs::read_to_string(out.join("report.html")).expect("page");
    assert!(page.contains("<svg") && !page.contains("http://") && !page.contains("src="));
    // The new version is a model that the twin takes.
    let model = out.join("model.json").display().to_string();
    let again = folder.join("again").display().to_string();
    let commands = folder.join("commands-7").display().to_string();
    let done = robopheus(&["simulate", "--model", &model, "--commands", &commands, "--out", &again]);
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    // Nothing is written over.
    let refused = robopheus(&arguments);
    assert_eq!(refused.status.code(), Some(1));
    let _ = std::fs::remove_dir_all(&folder);
}

#[test]
fn bad_bundles_are_refused_with_their_reason() {
    let folder = folder("bad");
    let run = simulated(&folder, 0);
    let table = Path::new(&run).join("telemetry.csv");
    let good = std::fs::read_to_string(&table).expect("table");
    let out = folder.join("out").display().to_string();
    let message = |text: &str| {
        std::fs::write(&table, text).expect("table");
        let done = robopheus(&["diagnose", "--runs", &run, "--out", &out]);
        assert!(!done.status.success());
        String::from_utf8_lossy(&done.stderr).into_owned()
    };
    let mut lines: Vec<&str> = good.lines().collect();
    lines.swap(10, 11);
    assert!(message(&lines.join("\n")).contains("backward"));
    assert!(message(&good.replacen("time_s", "seconds", 1)).contains("time_s"));
    let wheels = good.replace("wheel_3_rad_per_s", "wheel_5_rad_per_s");
    assert!(message(&wheels).contains("wheels"), "wheel count");
    let _ = std::fs::remove_dir_all(&folder);
}
