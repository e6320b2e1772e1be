//! `robopheus simulate` from files to files.

use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

fn folder(name: &str) -> PathBuf {
    let folder = std::env::temp_dir().join(format!("robopheus-simulate-{name}-{}", std::process::id()));
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).expect("a folder");
    folder
}

/// `omni-01` of the reference laboratory.
fn robot() -> Value {
    let lab = Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples/lab/reference.json");
    let lab: Value = serde_json::from_str(&std::fs::read_to_string(lab).expect("the laboratory")).expect("JSON");
    let mut robot = lab["robots"][0].clone();
    if robot["description"].is_object() {
        robot = robot["description"].clone();
    }
    robot
}

/// Two seconds forward.
fn bundle(folder: &Path) -> PathBuf {
    let bundle = folder.join("run");
    std::fs::create_dir_all(&bundle).expect("a folder");
    let run = json!({"format": "robopheus.run/1", "robot": robot(), "floor": "lab-floor", "label": "test",
        "started": "2026-01-01T00:00:00Z", "change_free_reference": true, "stamp": "sample"});
    std::fs::write(bundle.join("run.json"), run.to_string()).expect("run.json");
    let mut table = "time_s,command_forward_m_per_s,command_left_m_per_s,command_yaw_rate_rad_per_s,pose_x_m,pose_y_m,pose_yaw_rad\n".to_owned();
    for tick in 0..=240 {
        let pose = if tick == 0 { "0.5,-0.25,0" } else { ",," };
        table += &format!("{:.6},0.5,0,0,{pose}\n", f64::from(tick) / 120.0);
    }
    std::fs::write(bundle.join("telemetry.csv"), table).expect("telemetry.csv");
    bundle
}

fn simulate(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_robopheus"))
        .arg("simulate")
        .args(arguments)
        .output()
        .expect("the program")
}

/// A column of the simulated bundle.
fn column(bundle: &Path, name: &str) -> Vec<f64> {
    let text = std::fs::read_to_string(bundle.join("telemetry.csv")).expect("a table");
    let mut lines = text.lines();
    let header: Vec<&str> = lines.next().expect("a header").split(',').collect();
    let place = header.iter().position(|column| *column == name).expect("the column");
    lines
        .map(|line| line.split(',').nth(place).expect("a cell").parse().expect("a number"))
        .collect()
}

#[test]
fn a_model_changes_the_replay_and_the_nominal_twin_does_not_know_it() {
    let folder = folder("model");
    let commands = bundle(&folder);
    let model = json!({"format": "robopheus.model/1", "id": "", "parent": null, "robot": robot(), "floor": "lab-floor",
        "effects": [{"name": "wheel_radius", "index": null, "parameters": {"relative": 0.1}},
                    {"name": "gyro_bias", "index": null, "parameters": {"bias": 0.05}}],
        "residual": null, "provenance": {}});
    let path = folder.join("model.json");
    std::fs::write(&path, model.to_string()).expect("model.json");
    let text = |path: &Path| path.display().to_string();
    let (plain, changed) = (folder.join("plain"), folder.join("changed"));
    let first = simulate(&["--commands", &text(&commands), "--out", &text(&plain)]);
    assert!(first.status.success(), "{first:?}");
    let second = simulate(&[
        "--model",
        &text(&path),
        "--commands",
        &text(&commands),
        "--out",
        &text(&changed),
    ]);
    assert!(second.status.success(), "{second:?}");
    let way = |bundle: &Path| column(bundle, "pose_x_m")[240] - 0.5;
    assert!(
        (way(&changed) / way(&plain) - 1.1).abs() < 0.01,
        "{} {}",
        way(&changed),
        way(&plain)
    );
    assert!((column(&changed, "gyro_z_rad_per_s")[0] - 0.05).abs() < 1e-9);
    // What was written is a bundle again.
    let again = folder.join("again");
    let third = simulate(&["--commands", &text(&changed), "--out", &text(&again)]);
    assert!(third.status.success(), "{third:?}");
    assert_eq!(column(&again, "pose_x_m"), column(&plain, "pose_x_m"));
    std::fs::remove_dir_all(folder).expect("removed");
}

#[test]
fn a_model_that_cannot_be_used_is_refused_by_field() {
    let folder = folder("refused");
    let commands = bundle(&folder);
    let path = folder.join("model.json");
    let text = |path: &Path| path.display().to_string();
    let out = folder.join("out");
    for (effect, words) in [
        (json!({"name": "phlogiston", "parameters": {}}), "effects[0].name"),
        (
            json!({"name": "floor_friction", "parameters": {"scale": 9.0}}),
            "0.02 to 3",
        ),
        (
            json!({"name": "weak_motor", "parameters": {"gain": 0.9}}),
            "effects[0].index",
        ),
    ] {
        let model = json!({"format": "robopheus.model/1", "id": "", "robot": robot(), "floor": "lab-floor", "effects": [effect]});
        std::fs::write(&path, model.to_string()).expect("model.json");
        let refused = simulate(&[
            "--model",
            &text(&path),
            "--commands",
            &text(&commands),
            "--out",
            &text(&out),
        ]);
        let said = String::from_utf8_lossy(&refused.stderr).into_owned();
        assert!(!refused.status.success() && said.contains(words), "{said}");
        assert!(!out.exists(), "nothing is written");
    }
    std::fs::remove_dir_all(folder).expect("removed");
}
