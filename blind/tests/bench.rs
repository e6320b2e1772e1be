//! A slice of the bench that takes seconds: the same seed gives the same bytes, truths are sealed, every effect acts.

use blind::background::{CHASSIS, background, robot};
use blind::bench::{Line, append, lines, rescored, results_path, run_set};
use blind::effects::{applicable, apply, draw};
use blind::kind::Kind;
use blind::set::{Robots, Set, Wish};
use blind::table::markdown;
use blind::truth::{Sealed, Vault};
use emulator::noise::Noise;
use std::path::PathBuf;

/// A new folder below the build's.
fn folder(name: &str) -> PathBuf {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("{name}-{}", std::process::id()));
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).expect("a folder");
    folder
}

fn small() -> Wish {
    Wish {
        kind: Some(Kind::Single),
        chassis: Some("diff2".to_owned()),
        effect: Some("command_delay".to_owned()),
        seconds: 6,
        references: 2,
        runs: 3,
        robots: Robots::Drawn,
    }
}

fn made(name: &str) -> (PathBuf, Line) {
    let out = folder(name);
    let vault = Vault::new(&out).expect("a vault");
    let mut line = run_set(5, 2, &small(), &vault, Some(&out)).expect("a set");
    assert!(line.make_s > 0.0 && line.name_s > 0.0);
    (line.make_s, line.name_s) = (0.0, 0.0);
    (out, line)
}

#[test]
fn the_same_seed_gives_the_same_bytes_and_results_are_read_again() {
    let ((out, line), (other, again)) = (made("a"), made("b"));
    assert_eq!(line, again);
    assert_eq!(line.error, None);
    assert_eq!((line.reports.len(), line.known.len()), (1, 1));
    let text = |folder: &PathBuf| std::fs::read(folder.join("truth/000002.json")).expect("a truth");
    assert_eq!(text(&out), text(&other));
    // What was kept are bundles that the public reader takes, the same bytes.
    let run = std::fs::read_to_string(out.join("000002/run-0-0/run.json")).expect("kept");
    let telemetry = std::fs::read(out.join("000002/run-0-0/telemetry.csv")).expect("kept");
    assert!(identify::bundle::Bundle::parse(&run, &telemetry).is_ok());
    assert!(out.join("000002/report-0.json").is_file());
    // Another number is another set.
    let next = Set::new(5, 3, &small()).expect("a set");
    assert_ne!(next.seed, Set::new(5, 2, &small()).expect("a set").seed);
    // A line that was cut off is not glued to the next one.
    let path = results_path(&out, (1, 2), false);
    std::fs::write(&path, "{\"set\": 7, \"ki").expect("written");
    append(&path, &line).expect("written");
    std::fs::write(out.join("z-cut.jsonl"), "{\"set\": 4, \"ki").expect("written");
    assert_eq!(lines(&out).expect("read"), vec![line.clone()]);
    // A set that was made again replaces the line before, by however many shards either was made.
    let mut later = line.clone();
    later.verdicts = vec!["made again".to_owned()];
    append(&results_path(&out, (0, 1), true), &later).expect("written");
    assert_eq!(lines(&out).expect("read"), vec![later]);
    // Reports that were kept give the same score, and those that were changed none.
    let vault = Vault::new(&out).expect("a vault");
    let mut old = line.clone();
    old.facts.clear();
    old.named.clear();
    let rescore = || rescored(5, &old, &small(), &vault, &out);
    assert_eq!(rescore().expect("scored"), line);
    let report = out.join("000002/report-0.json");
    let text = std::fs::read_to_string(&report).expect("kept");
    std::fs::write(&report, text.replacen("command_delay", "motor_lag", 1)).expect("written");
    assert!(rescore().is_err_and(|error| error.to_string().contains("is not what was scored")));
    assert!(markdown(&[line]).contains("| right name first, single detectable effect | 85 % | 95 % |"));
}

#[test]
fn a_truth_that_was_changed_is_refused() {
    let out = folder("seal");
    let vault = Vault::new(&out).expect("a vault");
    let set = Set::new(1, 0, &small()).expect("a set");
    let sealed = Sealed::new(&set, &set.driven(0).expect("driven"));
    assert_eq!(sealed.bundles.len(), 5);
    let seal = vault.seal(&sealed).expect("sealed");
    assert_eq!(vault.open(0, &seal).expect("open"), sealed);
    let seals = std::fs::read_to_string(out.join("truth/seals.txt")).expect("seals");
    assert_eq!(seals, format!("{seal}  000000.json\n"));
    let path = out.join("truth/000000.json");
    let text = std::fs::read_to_string(&path).expect("a truth");
    std::fs::write(&path, text.replace("command_delay", "motor_lag")).expect("written");
    assert!(vault.open(0, &seal).is_err());
}

#[test]
fn every_effect_of_the_library_does_something() {
    let mut silent = Vec::new();
    for (number, entry) in twin::effect::library::LIBRARY.iter().enumerate() {
        let wish = Wish {
            chassis: None,
            effect: Some(entry.name.to_owned()),
            seconds: 5,
            references: 0,
            runs: 1,
            ..small()
        };
        let set = Set::new(9, number as u64, &wish).expect("a set");
        let known = &set.driven(0).expect("driven").known[0];
        assert_eq!(known.drawn.name, entry.name);
        if known.visible.largest() == 0.0 {
            silent.push(entry.name);
        }
    }
    // A limit that the run does not reach, or a place that it does not pass, is possible for a few.
    let may = [
        "wheel_speed_saturation",
        "low_friction_patch",
        "cable_drag",
        "body_speed_saturation",
        "camera_seam",
    ];
    silent.retain(|name| !may.contains(name));
    assert!(silent.is_empty(), "{silent:?}");
}

#[test]
fn every_effect_changes_something_on_every_chassis_that_has_it() {
    for chassis in CHASSIS {
        let robot = robot(chassis, false);
        for entry in applicable(&robot) {
            let truth = draw(entry.name, &robot, &mut Noise::new(2, 3));
            let base = background(4, &robot);
            let mut changed = base.clone();
            apply(&mut changed, &truth, &robot);
            assert_ne!(format!("{base:?}"), format!("{changed:?}"), "{chassis} {}", entry.name);
            for parameter in entry
                .parameters
                .iter()
                .filter(|parameter| truth.parameters.contains_key(parameter.name))
            {
                let value = truth.value(parameter.name);
                assert!(parameter.low <= value && value <= parameter.high, "{chassis} {truth:?}");
            }
        }
    }
}

#[test]
fn wishes_that_cannot_be_are_refused() {
    let mut wish = small();
    wish.effect = Some("steering_lag".to_owned());
    assert!(Set::new(1, 0, &wish).is_err());
    wish.effect = Some("no_such_effect".to_owned());
    assert!(Set::new(1, 0, &wish).is_err());
}
