//! The gallery's programs do what they say, and do it the same way each time.

use control::law::Note;
use control::scenario::Scenario;
use controllers::experiment::{rehearsal, rehearse_json};
use controllers::gallery::{MODULE, POLICY, SCRIPTS, digests, scenario_json, varied};
use controllers::source::Source;
use std::path::Path;
use std::process::Command;

fn script(name: &str) -> Source {
    let found = SCRIPTS.iter().find(|example| example.name == name);
    Source::Script(found.expect("an example").script.into())
}

#[test]
fn the_module_is_the_assembled_text() {
    let assembled = wat::parse_str(include_str!("../gallery/go_to_point.wat")).expect("assembles");
    if std::env::var_os("ROBOPHEUS_WRITE_GALLERY").is_some() {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/gallery/go_to_point.wasm");
        std::fs::write(path, &assembled).expect("written");
    }
    assert_eq!(assembled, MODULE);
}

/// A tanh of each of three sums: forward and to the left towards the target, turning until it is ahead.
fn go_to_point() -> Vec<u8> {
    let manifest = r#"{"format":"robopheus.policy/1","observation":["goal_forward_m","goal_left_m"],"command":"twist","rate_hz":30,"limits":[0.3,0.3,1.5]}"#;
    onnx::Sequence::new("observation", 2)
        .linear(&[2.0, 0.0, 0.0, 0.0, 2.0, 4.0], &[0.0, 0.0, 0.0])
        .node("Tanh", &[], &[])
        .constant("scale", &[1, 3], &[0.3, 0.3, 1.5])
        .node("Mul", &["scale"], &[])
        .file("command", 3, &[(controllers::policy::KEY, manifest)])
}

#[test]
fn the_policy_is_the_one_that_is_built_here() {
    let built = go_to_point();
    if std::env::var_os("ROBOPHEUS_WRITE_GALLERY").is_some() {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/gallery/go_to_point.onnx");
        std::fs::write(path, &built).expect("written");
    }
    assert_eq!(built, POLICY);
}

#[test]
fn every_program_is_accepted() {
    let sources = SCRIPTS.iter().map(|example| (example.name, script(example.name)));
    for (name, source) in sources.chain([("module", Source::module(MODULE)), ("policy", Source::policy(POLICY))]) {
        let outcome =
            rehearse_json(&scenario_json(&source, 20.0)).unwrap_or_else(|problems| panic!("{name}: {problems:#?}"));
        println!("{name}: {}", outcome.verdict.sentence);
        assert!(outcome.verdict.accepted, "{name}: {}", outcome.verdict.sentence);
    }
}

#[test]
fn script_and_module_of_one_law_bring_everybody_to_the_same_places() {
    for source in [script("go_to_point"), Source::module(MODULE)] {
        let outcome = rehearse_json(&scenario_json(&source, 40.0)).expect("a rehearsal");
        assert!(outcome.verdict.findings.is_empty(), "{:#?}", outcome.verdict);
        for (robot, [x_m, y_m]) in outcome
            .replay
            .robots
            .iter()
            .zip([[0.6, 0.9], [-1.2, -0.7], [1.3, -0.6]])
        {
            let [x, y, _] = *robot.poses.last().expect("a pose");
            assert!((x - x_m).hypot(y - y_m) < 0.08, "{}: {x} {y}", robot.name);
        }
    }
}

#[test]
fn equal_programs_give_equal_digests() {
    let first = digests();
    assert!(
        first.len() >= 210 && first.values().all(|digest| digest.len() >= 32),
        "{first:#?}"
    );
    assert_eq!(first, digests());
    // The same law in two languages, and nothing else, drives the same way.
    assert_eq!(first["script go_to_point"], first["module go_to_point"]);
    let mut values: Vec<&String> = first.values().collect();
    values.sort();
    values.dedup();
    assert_eq!(values.len() + 1, first.len(), "{first:#?}");
}

#[test]
fn varied_programs_move_every_robot_and_none_is_stopped() {
    let mut said = 0;
    for (name, source) in varied() {
        let outcome = rehearse_json(&scenario_json(&source, controllers::variety::DURATION_S))
            .unwrap_or_else(|problems| panic!("{name}: {problems:#?}\n{source:?}"));
        let faults: Vec<_> = outcome
            .verdict
            .findings
            .iter()
            .filter(|f| f.code == "controller_fault")
            .collect();
        assert!(
            faults.is_empty() && outcome.verdict.ticks == 120,
            "{name}: {faults:#?}\n{source:?}"
        );
        said += usize::from(!outcome.replay.notes.is_empty());
        for robot in &outcome.replay.robots {
            let (first, last) = (robot.poses[0], robot.poses.last().expect("a pose"));
            let way = (0..3).map(|part| (last[part] - first[part]).abs()).fold(0.0, f64::max);
            assert!(way > 0.01, "{name}: {} moves by {way}", robot.name);
        }
    }
    assert!(said > 100, "{said} of them log or draw");
}

#[test]
fn drawings_come_out_beside_the_motion() {
    let scenario = Scenario::from_json(&scenario_json(&script("go_to_point"), 2.0)).expect("a scenario");
    let mut rehearsal = rehearsal(&scenario).expect("a rehearsal");
    rehearsal.step();
    let lines = rehearsal
        .notes()
        .iter()
        .filter(|note| matches!(note, Note::Line { .. }))
        .count();
    assert_eq!(lines, 3);
}

#[test]
fn limits_stop_growing_scripts_at_the_same_tick() {
    let told = digests();
    for (name, reason) in [
        ("operations", "operations in one tick"),
        ("depth", "functions that call each other"),
        ("array", "too large"),
    ] {
        let sentence = &told[&format!("bound {name}")];
        assert!(
            sentence.contains(reason) && sentence.contains("tick"),
            "{name}: {sentence}"
        );
    }
}

/// The target's library stands where rustup puts it; other set-ups build their bundles otherwise.
fn builds_modules() -> bool {
    let told = Command::new("rustc").args(["--print", "sysroot"]).output();
    let sysroot = told.map(|told| String::from_utf8_lossy(&told.stdout).trim().to_owned());
    sysroot.is_ok_and(|root| Path::new(&root).join("lib/rustlib/wasm32-unknown-unknown/lib").is_dir())
}

/// Whether a compiler of C that makes WebAssembly is here, with its linker.
fn builds_c_modules() -> bool {
    let runs = |program: &str, argument: &str| {
        let output = Command::new(program).arg(argument).output();
        output.ok().filter(|output| output.status.success())
    };
    let targets = runs("clang", "--print-targets");
    targets.is_some_and(|output| String::from_utf8_lossy(&output.stdout).contains("wasm32"))
        && runs("wasm-ld", "--version").is_some()
}

/// Builds an example by the command in its first lines.
///
/// - `prompt`: what stands before the command there.
fn built(example: &str, prompt: &str) -> Vec<u8> {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("gallery").join(example);
    let text = std::fs::read_to_string(&source).expect("the example");
    let line = text.lines().find_map(|line| line.strip_prefix(prompt));
    let out = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("{example}.wasm"));
    let mut words = line.expect("its command").trim_end_matches('`').split(' ');
    let mut compiler = Command::new(words.next().expect("a compiler"));
    for word in words {
        match word {
            word if word == example => compiler.arg(&source),
            "go_to_point.wasm" => compiler.arg(&out),
            word => compiler.arg(word),
        };
    }
    assert!(compiler.status().expect("the compiler").success(), "{line:?}");
    std::fs::read(out).expect("a module")
}

fn drives_as_the_one_in_text(module: &[u8]) {
    let [built, assembled] = [module, MODULE].map(|module| {
        let mut outcome = rehearse_json(&scenario_json(&Source::module(module), 8.0)).expect("a rehearsal");
        // They drive alike; what each says is its own.
        outcome.replay.notes.clear();
        outcome
    });
    // Not by `assert_eq`, which would print every pose.
    assert!(
        built == assembled,
        "{} {}",
        built.verdict.digest,
        assembled.verdict.digest
    );
}

#[test]
fn the_module_in_rust_builds_as_it_says_and_drives_as_the_one_in_text() {
    if builds_modules() {
        drives_as_the_one_in_text(&built("go_to_point.rs", "//! Build: `"));
    } else {
        println!("rustc has no wasm32-unknown-unknown here: the example in Rust is not built");
    }
}

#[test]
fn the_module_in_c_builds_as_it_says_and_drives_as_the_one_in_text() {
    if builds_c_modules() {
        drives_as_the_one_in_text(&built("go_to_point.c", " * Build: "));
    } else {
        println!("no clang with wasm32 and wasm-ld here: the example in C is not built");
    }
}
