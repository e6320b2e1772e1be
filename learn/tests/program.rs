//! The program on bundles on disk: three files, then the check in ONNX Runtime.

#[path = "support/logs.rs"]
#[allow(dead_code)]
mod logs;

use std::path::Path;
use std::process::{Command, Output};

use learn::onnx::parse;
use learn::runtime::candidates;
use logs::{Log, csv, description, truth};
use twin::model_document::ModelDocument;
use twin::robot::Robot;

fn program(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_robopheus-learn"))
        .args(arguments)
        .output()
        .unwrap()
}

fn bundle(folder: &Path, number: usize) -> String {
    let residual = truth(-2.0, 1.5);
    let robot = Robot::with_model(description(), &[], Some(&residual)).unwrap();
    let at = folder.join(format!("run-{number}"));
    std::fs::create_dir_all(&at).unwrap();
    let description = serde_json::to_string(&description()).unwrap();
    let run = format!(
        "{{\"format\":\"robopheus.run/1\",\"robot\":{description},\"floor\":\"hall\",\"label\":\"\",\"started\":\"\",\"change_free_reference\":false}}"
    );
    std::fs::write(at.join("run.json"), run).unwrap();
    let log = Log::usual(0.37 + 1.13 * number as f64);
    std::fs::write(at.join("telemetry.csv"), csv(&robot, &log)).unwrap();
    at.display().to_string()
}

#[test]
fn train_writes_a_model_an_onnx_file_and_a_report_that_agree() {
    let folder = std::env::temp_dir().join(format!("robopheus-learn-{}", std::process::id()));
    let runs: Vec<String> = (0..4).map(|number| bundle(&folder, number)).collect();
    let out = folder.join("out").display().to_string();
    let mut arguments = vec!["train", "--motion-only", "--out", &out, "--runs"];
    arguments.extend(runs.iter().map(String::as_str));
    let trained = program(&arguments);
    let said = String::from_utf8_lossy(&trained.stdout).into_owned();
    assert!(
        trained.status.success(),
        "{said} {}",
        String::from_utf8_lossy(&trained.stderr)
    );
    assert!(said.contains("black box"), "{said}");
    let text = std::fs::read_to_string(Path::new(&out).join("model.json")).unwrap();
    let model = ModelDocument::parse(&text).unwrap();
    assert!(model.residual.is_some() && model.robot().is_ok());
    let file = parse(&std::fs::read(Path::new(&out).join("model.onnx")).unwrap()).unwrap();
    let id = file
        .metadata_props
        .iter()
        .find(|entry| entry.key == "model_id")
        .unwrap();
    assert_eq!(id.value, model.id);
    let report = std::fs::read_to_string(Path::new(&out).join("report.json")).unwrap();
    let report: serde_json::Value = serde_json::from_str(&report).unwrap();
    assert_eq!(report["format"], "robopheus.learning/1");
    assert_eq!(report["model"].as_str(), Some(model.id.as_str()));
    // A folder that is there is not written over.
    assert_eq!(program(&arguments).status.code(), Some(2));
    let checked = program(&["check", &out]);
    if candidates().iter().any(|path| path.is_file()) {
        assert!(checked.status.success(), "{}", String::from_utf8_lossy(&checked.stderr));
        assert_eq!(report["onnx"]["agrees"], true);
    } else {
        println!("skipped: no ONNX Runtime; ORT_DYLIB_PATH names one");
        assert_eq!(checked.status.code(), Some(2));
        assert!(String::from_utf8_lossy(&checked.stderr).contains("ORT_DYLIB_PATH"));
    }
    predicts_in_python(&out, &runs[0]);
    std::fs::remove_dir_all(&folder).unwrap();
}

/// `examples/learn/predict.py` comes nearer to the log with the network than without it, in the mean over starts.
fn predicts_in_python(out: &str, run: &str) {
    let python = std::env::var("ROBOPHEUS_PYTHON").unwrap_or_else(|_| "python3".to_owned());
    let has = Command::new(&python).args(["-c", "import numpy, onnxruntime"]).output();
    if !has.is_ok_and(|has| has.status.success()) {
        println!("skipped: {python} has no onnxruntime; ROBOPHEUS_PYTHON names one that has");
        return;
    }
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/../examples/learn/predict.py");
    let mut sums = [0.0; 2];
    for start_s in ["4", "8", "12", "16"] {
        let said = Command::new(&python)
            .args([script, out, run, start_s])
            .output()
            .unwrap();
        let text = String::from_utf8_lossy(&said.stdout).into_owned();
        assert!(said.status.success(), "{}", String::from_utf8_lossy(&said.stderr));
        let last = text.lines().last().unwrap();
        let numbers: Vec<f64> = last.split(' ').filter_map(|word| word.parse().ok()).collect();
        assert_eq!(numbers.len(), 3, "{last}");
        sums[0] += numbers[1];
        sums[1] += numbers[2];
    }
    assert!(sums[1] < sums[0], "{sums:?}");
}

#[test]
fn a_bundle_that_is_not_there_is_named() {
    let refused = program(&["train", "--out", "/nonexistent/out", "--runs", "/nonexistent/a"]);
    assert_eq!(refused.status.code(), Some(2));
}
