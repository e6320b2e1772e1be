//! Own controllers from the command line: what an experiment brings along, and a program behind a pipe.

use std::path::Path;
use std::process::{Command, Output};

fn validate(experiment: &str, further: &[&str]) -> Output {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let mut command = Command::new(env!("CARGO_BIN_EXE_robopheus"));
    command
        .current_dir(root)
        .args(["--json", "validate", experiment, "--lab", "examples/lab/reference.json"]);
    command.args(further).output().expect("the program")
}

fn verdict(output: &Output) -> serde_json::Value {
    let problem = String::from_utf8_lossy(&output.stderr);
    serde_json::from_slice(&output.stdout).unwrap_or_else(|error| panic!("{error}: {problem}"))
}

#[test]
fn an_experiment_with_a_script_is_accepted() {
    let told = verdict(&validate("examples/controllers/avoid-each-other.json", &[]));
    assert_eq!(told["accepted"], true, "{told}");
}

#[test]
fn a_program_in_python_drives_the_twin() {
    let python = ["--controller", "python3 examples/controllers/circle.py"];
    let first = verdict(&validate("examples/experiments/swap-corners.json", &python));
    assert!(first["ticks"].as_u64().is_some_and(|ticks| ticks > 1000), "{first}");
    assert!(!first.to_string().contains("controller_fault"), "{first}");
    let broken = verdict(&validate(
        "examples/experiments/swap-corners.json",
        &["--controller", "read s; echo '{\"ready\":{}}'"],
    ));
    assert_eq!(broken["accepted"], false);
    assert!(broken.to_string().contains("controller_fault"), "{broken}");
}
