//! Programs in the sandbox's process: the same results as in one's own, and no harm when the process misbehaves.

use std::path::PathBuf;
use std::process::Command;
use std::time::{Duration, Instant};

use control::law::FaultKind;
use control::rehearsal::Rehearsal;
use control::scenario::Scenario;
use controllers::experiment::{rehearse_json, setup, team_of};
use controllers::gallery::{MODULE, SCRIPTS, scenario_json};
use controllers::source::Source;
use sandbox::pipe::PipeProgram;
use sandbox::start;

fn scenario(source: &Source, duration_s: f64) -> Scenario {
    Scenario::from_json(&scenario_json(source, duration_s)).expect("a scenario")
}

fn script(text: &str) -> Source {
    Source::Script(text.into())
}

fn finished(mut rehearsal: Rehearsal) -> control::rehearsal::Outcome {
    while rehearsal.step() {}
    rehearsal.finish()
}

/// A program of the shell in place of the sandbox's.
fn shell(text: &str, patience: Duration) -> Result<(Scenario, PipeProgram), control::law::Fault> {
    let scenario = scenario(&script("fn step(now) {}"), 2.0);
    let mut command = Command::new("sh");
    command.args(["-c", text]);
    let setup = setup(&scenario).expect("robots");
    PipeProgram::start(command, None, &setup, patience).map(|program| (scenario, program))
}

#[test]
fn the_sandbox_gives_the_digest_of_ones_own_process() {
    let sources = [
        script(SCRIPTS[0].script),
        script(SCRIPTS[5].script),
        Source::module(MODULE),
    ];
    for source in sources {
        let here = rehearse_json(&scenario_json(&source, 6.0)).expect("a rehearsal");
        let there = finished(start::rehearsal(&scenario(&source, 6.0)).expect("a rehearsal"));
        assert!(here.verdict.ticks > 100);
        assert_eq!(here, there);
    }
}

#[test]
fn problems_and_faults_come_back_in_the_same_words() {
    for text in [
        "fn step(now) {\n let x = ; }",
        "fn step(now) { loop {} }",
        "fn step(now) { let a = [1];\n a[3]; }",
    ] {
        let here = rehearse_json(&scenario_json(&script(text), 2.0));
        let there = start::rehearsal(&scenario(&script(text), 2.0)).map(finished);
        assert_eq!(here, there, "{text}");
    }
}

#[test]
fn the_process_is_confined() {
    let setup = setup(&scenario(&script("fn step(now) {}"), 1.0)).expect("robots");
    let program = start::start(&script("fn step(now) {}"), &setup, Duration::from_secs(1)).expect("starts");
    println!("{:?}", program.confined());
    let status = std::fs::read_to_string(format!("/proc/{}/status", program.process_id())).expect("a process");
    assert!(
        status.contains("Seccomp:\t2") && status.contains("NoNewPrivs:\t1"),
        "{status}"
    );
    if program.confined().iter().any(|layer| layer == "user") {
        assert!(status.contains("Uid:\t65534\t65534\t65534\t65534"), "{status}");
    }
}

#[test]
fn programs_may_give_memory_back() {
    // Tens of megabytes, and none of it after the tick.
    let text = "fn step(now) { for r in 0..3 { stop(r); } let b = []; b.pad(1900, 0.5); let a = []; a.pad(1900, ());
                for k in 0..1200 { let c = b; c[0] = k; a[k] = c; } }";
    let here = rehearse_json(&scenario_json(&script(text), 0.2)).expect("a rehearsal");
    let there = finished(start::rehearsal(&scenario(&script(text), 0.2)).expect("a rehearsal"));
    assert_eq!((here.verdict.ticks, &here), (24, &there), "{}", there.verdict.sentence);
}

#[test]
fn a_program_that_is_killed_ends_the_run_at_once() {
    let source = script("fn step(now) { for r in 0..3 { twist(r, 0.2, 0, 0); } }");
    let scenario = scenario(&source, 10.0);
    let program = start::start(&source, &setup(&scenario).expect("robots"), Duration::from_secs(5)).expect("starts");
    let id = program.process_id();
    let mut rehearsal =
        Rehearsal::with_team(&scenario, team_of(&scenario, Box::new(program)).expect("a team")).expect("a world");
    for _ in 0..60 {
        assert!(rehearsal.step());
    }
    assert!(
        Command::new("kill")
            .args(["-9", &id.to_string()])
            .status()
            .expect("kill")
            .success()
    );
    assert!(!rehearsal.step());
    let fault = rehearsal.fault().expect("a fault");
    assert_eq!((fault.kind, fault.tick), (FaultKind::Died, Some(60)), "{fault}");
    let orders = rehearsal.outputs().iter().map(|output| output.safe.twist());
    for twist in orders {
        assert!(twist.forward_m_per_s.abs() < 0.2, "{twist:?}");
    }
}

#[test]
fn late_answers_never_hold_anybody_up_and_silence_ends_the_run() {
    let patience = Duration::from_millis(3);
    let (scenario, program) = shell("read s; echo '{\"ready\":{}}'; exec sleep 60", patience).expect("starts");
    let mut rehearsal =
        Rehearsal::with_team(&scenario, team_of(&scenario, Box::new(program)).expect("a team")).expect("a world");
    let begun = Instant::now();
    let mut ticks = 0;
    while rehearsal.step() {
        ticks += 1;
    }
    let fault = rehearsal.fault().expect("a fault").clone();
    assert_eq!((fault.kind, ticks), (FaultKind::Silent, 30), "{fault}");
    // 31 waits of 3 ms; the rest is the machine's.
    assert!(begun.elapsed() < Duration::from_secs(20), "{:?}", begun.elapsed());
    let gone = Instant::now();
    drop(rehearsal);
    assert!(gone.elapsed() < Duration::from_secs(10));
}

#[test]
fn processes_that_talk_nonsense_are_faulty() {
    let long = Duration::from_secs(5);
    let dies = shell("exit 3", long).expect_err("died");
    assert_eq!(dies.kind, FaultKind::Died);
    assert_eq!(
        shell("echo hello; exec sleep 5", long).expect_err("nonsense").kind,
        FaultKind::BadCommand
    );
    let flood = shell("yes | tr -d '\\n'", long).expect_err("a flood");
    assert_eq!(flood.kind, FaultKind::Exhausted);
    for (answer, kind) in [
        ("{\"answer\":{\"tick\":5,\"robots\":[]}}", FaultKind::BadCommand),
        ("{\"answer\":{\"tick\":0,\"robots\":[]}}", FaultKind::BadCommand),
        (
            "{\"answer\":{\"tick\":0,\"robots\":[{\"order\":{\"motion\":{\"twist\":[1e300,0,0]}}},{},{}]}}",
            FaultKind::BadCommand,
        ),
        (
            "{\"fault\":{\"kind\":\"failed\",\"tick\":0,\"line\":null,\"column\":null,\"reason\":\"x\"}}",
            FaultKind::Failed,
        ),
    ] {
        let text = format!("read s; echo '{{\"ready\":{{}}}}'; read v; echo '{answer}'; exec sleep 5");
        let (scenario, program) = shell(&text, long).expect("starts");
        let mut rehearsal =
            Rehearsal::with_team(&scenario, team_of(&scenario, Box::new(program)).expect("a team")).expect("a world");
        assert!(!rehearsal.step());
        assert_eq!(rehearsal.fault().expect("a fault").kind, kind, "{answer}");
    }
}

/// The example beside the tests' programs.
fn attacker() -> PathBuf {
    let own = std::env::current_exe().expect("a program");
    own.ancestors().nth(2).expect("a folder").join("examples/attacker")
}

#[test]
fn native_code_in_the_sandbox_cannot_do_anything_either() {
    let list = Command::new(attacker()).output().expect("the attacker");
    let names = String::from_utf8(list.stdout).expect("names");
    let mut free = 0;
    for name in names.lines() {
        let told = Command::new(attacker()).arg(name).output().expect("the attacker");
        let told = String::from_utf8_lossy(&told.stdout).into_owned();
        assert!(told.contains("system calls"), "{name}: {told}");
        assert!(!told.contains("done"), "{name} succeeds");
        let unconfined = Command::new(attacker())
            .args([name, "free"])
            .output()
            .expect("the attacker");
        free += usize::from(String::from_utf8_lossy(&unconfined.stdout).contains("done"));
    }
    assert_eq!(names.lines().count(), 30);
    // The attempts are real ones: most succeed where nothing confines them.
    assert!(free >= 12, "{free}");
}
