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

#[test]
fn a_learned_residual_acts_in_the_replay() {
    let folder = folder("residual");
    let commands = bundle(&folder);
    let path = folder.join("model.json");
    let text = |path: &Path| path.display().to_string();
    // 0.5 m/s^2 against the way, whatever the robot does.
    let model = |residual: Value| json!({"format": "robopheus.model/1", "id": "", "robot": robot(), "floor": "lab-floor", "effects": [], "residual": residual});
    let residual = json!({"format": "robopheus.residual/1", "fade": 0.25,
        "inputs": [{"name": "forward_m_per_s", "mean": 0.0, "scale": 1.0, "low": -5.0, "high": 5.0}],
        "layers": [{"weights": [0.0], "bias": [1.0], "activation": "linear"}],
        "outputs": [{"name": "acceleration_forward_m_per_s2", "scale": -0.5, "limit": 1.0}]});
    let replay = |name: &str, residual: Value| {
        std::fs::write(&path, model(residual).to_string()).expect("model.json");
        let out = folder.join(name);
        let done = simulate(&[
            "--model",
            &text(&path),
            "--commands",
            &text(&commands),
            "--out",
            &text(&out),
        ]);
        (done, out)
    };
    let (first, plain) = replay("plain", Value::Null);
    let (second, pushed) = replay("pushed", residual.clone());
    assert!(
        first.status.success() && second.status.success(),
        "{first:?} {second:?}"
    );
    // At steady speed each of the four motors gives m a/(4 cos 45) R/(n k_t) more current; its sign is that of its wheel.
    let robot = robot();
    let number = |path: &str| robot.pointer(path).and_then(Value::as_f64).expect("a number");
    let torque_per_ampere = number("/motor/gear_ratio") * number("/motor/torque_constant_n_m_per_a");
    let force_n = 0.5 * number("/mass_kg") / (4.0 * core::f64::consts::FRAC_1_SQRT_2);
    let expected_a = force_n * number("/wheels/0/radius_m") / torque_per_ampere;
    let more_a = column(&pushed, "current_0_a")[240].abs() - column(&plain, "current_0_a")[240].abs();
    assert!(
        (more_a / expected_a - 1.0).abs() < 0.02,
        "{more_a} A against {expected_a} A"
    );
    let mut wrong = residual;
    wrong["layers"][0]["weights"] = json!([0.0, 1.0]);
    let (refused, out) = replay("refused", wrong);
    let said = String::from_utf8_lossy(&refused.stderr).into_owned();
    assert!(
        !refused.status.success() && said.contains("residual.layers[0].weights"),
        "{said}"
    );
    assert!(!out.exists(), "nothing is written");
    std::fs::remove_dir_all(folder).expect("removed");
}
