//! Programs that mean harm, and mistakes: refused or stopped, each with its reason, and nothing moves afterwards.

use control::law::{Fault, FaultKind};
use control::scenario::Scenario;
use controllers::experiment::{rehearsal, rehearse_json, setup};
use controllers::gallery::scenario_json;
use controllers::program::compile;
use controllers::source::Source;

/// Two seconds of the program in the twin: what the verdict says and the fault.
fn run(source: &Source) -> Result<Fault, String> {
    let scenario = Scenario::from_json(&scenario_json(source, 2.0)).map_err(|problems| problems[0].message.clone())?;
    let mut rehearsal = rehearsal(&scenario).map_err(|problems| problems[0].message.clone())?;
    while rehearsal.step() {}
    let fault = rehearsal.fault().cloned();
    let outcome = rehearsal.finish();
    let fault = fault.unwrap_or_else(|| panic!("accepted: {}", outcome.verdict.sentence));
    assert!(!outcome.verdict.accepted && outcome.verdict.findings.iter().any(|f| f.code == "controller_fault"));
    Ok(fault)
}

/// Refused before the first tick, with these words; a place where one is given.
fn refused(source: &Source, words: &str) {
    let message = run(source).expect_err("is refused");
    assert!(message.contains(words), "{message:?} lacks {words:?}");
}

fn stopped(source: &Source, kind: FaultKind, words: &str) -> Fault {
    let fault = run(source).unwrap_or_else(|message| panic!("refused: {message}"));
    assert_eq!(fault.kind, kind, "{fault}");
    assert!(
        fault.tick.is_some() && fault.reason.contains(words),
        "{fault} lacks {words:?}"
    );
    fault
}

fn script(text: &str) -> Source {
    Source::Script(text.into())
}

/// A module with these exports besides a memory of one page.
fn module(rest: &str, step: &str) -> Source {
    let text = format!(
        "(module {rest} (memory (export \"memory\") 2)
           (func (export \"buffer\") (param i32) (result i32) i32.const 0)
           (func $step (export \"step\") (param i32 i32) (result i32) {step}))"
    );
    Source::module(&wat::parse_str(&text).unwrap_or_else(|error| panic!("{error}")))
}

fn wasm(text: &str) -> Source {
    Source::module(&wat::parse_str(text).unwrap_or_else(|error| panic!("{error}")))
}

#[test]
fn scripts_that_never_end_are_stopped() {
    for text in [
        "fn step(now) { loop {} }",
        "fn step(now) { while true { let a = [1, 2, 3]; } }",
        "fn step(now) { for k in 0..9223372036854775807 { let a = k; } }",
        "fn step(now) { try { loop {} } catch { loop {} } }",
        "fn start(now) { loop {} } fn step(now) {}",
    ] {
        println!("{text}");
        stopped(&script(text), FaultKind::Exhausted, "operations");
    }
}

#[test]
fn recursion_is_stopped() {
    let text = "fn down(n) { down(n + 1) } fn step(now) { down(0); }";
    stopped(&script(text), FaultKind::Exhausted, "call each other");
    let text = "fn step(now) { let f = |g| g.call(g); f.call(f); }";
    assert!(run(&script(text)).is_ok());
}

#[test]
fn scripts_cannot_fill_the_memory() {
    for text in [
        "fn step(now) { let s = \"xxxxxxxxxxxxxxxx\"; loop { s += s; } }",
        "fn step(now) { let a = [1]; loop { a += a; } }",
        "fn step(now) { let a = []; a.pad(1000000000, 1); }",
        "fn step(now) { let s = \"\"; s.pad(1000000000, 'x'); }",
        "fn start(now) { this.all = #{}; } fn step(now) { for r in 0..3 { stop(r); } for k in 0..100 { this.all[`${now.tick} ${k}`] = 1; } }",
        "fn step(now) { let a = []; loop { a = [a, a]; } }",
        "fn start(now) { this.a = [0]; } fn step(now) { for r in 0..3 { stop(r); } let b = [0]; b[0] = this.a; this.a = b; }",
    ] {
        println!("{text}");
        stopped(&script(text), FaultKind::Exhausted, "");
    }
}

#[test]
fn scripts_cannot_reach_out() {
    for (text, words) in [
        ("fn step(now) { eval(\"1\"); }", "eval"),
        ("import \"os\" as os; fn step(now) { os::run(); }", "import"),
        ("fn step(now) { let x = 2.0 ** 0.5; }", "**"),
    ] {
        refused(&script(text), words);
    }
    for text in [
        "fn step(now) { open(\"/etc/passwd\"); }",
        "fn step(now) { timestamp(); }",
        "fn step(now) { sleep(10); }",
        "fn step(now) { let p = Fn(\"**\"); let x = p.call(2.0, 0.5); twist(0, x, 0, 0); exit(); }",
    ] {
        assert_eq!(run(&script(text)).expect("runs").kind, FaultKind::Failed, "{text}");
    }
    // Ranges are read and run through; kept, they could make texts grow without a limit.
    for text in [
        "fn step(now) { let n = 0; for k in 0..4 { n += k; } for k in range(0, 4) { n += k; } for k in 0..=[n][0] { n -= 1; } }",
        "fn step(now) { let k = 2; let a = [1, 2]; a[k - 1] = 4; a[0] += 2; for (x, at) in a.map(|v| v + 1) { for b in 0..at { k += b; } } }",
        "fn step(now) { for s in [`${now.tick}`, \"b\"] { print(s.sub_string(0, 1)); } let there = 3 in [1, 2]; }",
    ] {
        // It ran on, and told no robot anything.
        assert_eq!(run(&script(text)).expect("runs").kind, FaultKind::Silent, "{text}");
    }
    for body in [
        "let s = \"text\"; s[0..2] = \"longer\";",
        "let s = \"text\"; s[0..=now.tick] += \"longer\";",
        "let s = \"text\"; s[0..1].pad(8000, 'x');",
        "let s = \"text\"; print(s[0..2].len);",
        "let there = now.tick in 0..4;",
        "for r in [0..2] { }",
        "for k in (|x| { 0..x }).call(3) { }",
        "for k in 0..2 in [1] { }",
        "for k in [1] { let r = 0..2; }",
        "switch now.tick { 0..4 => (), _ => () }",
        "print(`${0..2}`);",
        "let r = 0..2;",
        "let r = 0..now.tick;",
        "this.r = 0..2;",
        "let r = [0..2];",
        "let r = #{a: 0..2};",
        "let f = |x| 0..x; let r = f.call(2); let s = \"text\"; s[r] = \"longer\";",
        "let f = |x| { 0..x }; let r = f.call(2); let s = \"text\"; s[r] = \"longer\";",
        "helper(0..2);",
        "let s = \"text\"; s[if true { 0..2 } else { 1 }] = 3;",
        "let a = [\"text\"]; a[0][0..2] = \"longer\";",
        "0..2",
        "return 0..2;",
    ] {
        println!("{body}");
        refused(
            &script(&format!("fn helper(r) {{ r }} fn step(now) {{ {body} }}")),
            "a range may stand in the head",
        );
    }
    for body in [
        "let s = \"text\"; let r = range(0, 2); s[r] = \"longer\";",
        "let s = \"text\"; let r = Fn(\"range\").call(0, 2); s[r] = \"longer\";",
        "let s = \"text\"; let f = Fn(\"..\"); let r = f.call(0, 2); s[r] = \"longer\"; print(s);",
        "let s = \"text\"; let f = Fn(\"..=\"); let r = f.call(0, 2); s[r] = \"longer\"; print(s);",
    ] {
        let fault = run(&script(&format!("fn step(now) {{ {body} }}"))).expect(body);
        assert_eq!(fault.kind, FaultKind::Failed, "{body}: {fault}");
    }
    // What a script throws ends up on other people's screens.
    for (thrown, words) in [
        ("\"\"", "an error without words"),
        ("()", "an error without words"),
        ("\"a\\x1b[2Jb\"", "ab"),
    ] {
        let fault = run(&script(&format!("fn step(now) {{ throw {thrown}; }}"))).expect("runs");
        assert_eq!((fault.reason.as_str(), fault.line), (words, Some(1)));
    }
}

#[test]
fn errors_of_scripts_have_line_and_column() {
    let scenario = Scenario::from_json(&scenario_json(&script("fn step(now) {}"), 1.0)).expect("a scenario");
    let setup = setup(&scenario).expect("robots");
    for (text, line) in [
        ("fn step(now) {\n  let x = ;\n}", 2),
        ("fn step(now) {\n\n  y + 1;\n}", 3),
        ("let a = 1;\nfn step(now) {}", 1),
    ] {
        let fault = compile(&script(text), &setup).err().unwrap_or_else(|| panic!("{text}"));
        assert_eq!(
            (fault.kind, fault.line),
            (FaultKind::Refused, Some(line)),
            "{text}: {fault}"
        );
        assert!(fault.column.is_some());
    }
    let fault = stopped(
        &script("fn step(now) {\n  let a = [1];\n  let b = a[7];\n}"),
        FaultKind::Failed,
        "",
    );
    assert_eq!((fault.line, fault.tick), (Some(3), Some(0)), "{fault}");
    refused(&script("fn other(now) {}"), "fn step(now)");
}

#[test]
fn scripts_that_pass_a_limit_are_told_where_they_stood() {
    for (text, line) in [
        (
            "fn step(now) {\n  let n = 0;\n  n += 1;\n  // Here.\n  loop { n += 1; }\n}",
            5,
        ),
        (
            "fn step(now) { turn(1); }\n\nfn turn(n) {\n  while true { n += 1; }\n}",
            4,
        ),
        ("fn step(now) { let n = 0;\n while n < 100000 {\n  n += 1; } }", 3),
        ("fn start(now) {\n  loop {}\n}\nfn step(now) {}", 2),
        ("fn down(n) {\n  down(n + 1)\n}\nfn step(now) { down(0); }", 2),
        ("fn step(now) {\n  let s = \"xx\";\n  loop {\n s += s;\n }\n}", 4),
        // What was kept from earlier ticks decides where it stands.
        (
            "fn start(now) { this.n = 0; }\nfn step(now) { for r in 0..3 { stop(r); } this.n += 1;\n if this.n > 3 { loop {\n } }\n let a = 0; }",
            3,
        ),
    ] {
        let fault = stopped(&script(text), FaultKind::Exhausted, "");
        assert!(fault.line == Some(line) && fault.column.is_some(), "{text}: {fault:?}");
    }
}

#[test]
fn commands_that_are_no_numbers_or_for_nobody_stop_the_run() {
    for text in [
        "fn step(now) { twist(0, 0.0 / 0.0, 0, 0); }",
        "fn step(now) { velocity(0, 1.0 / 0.0, 0); }",
        "fn step(now) { wheels(0, [1e300, 0, 0, 0]); }",
        "fn step(now) { twist(7, 0, 0, 0); }",
        "fn step(now) { twist(-1, 0, 0, 0); }",
    ] {
        let fault = stopped(&script(text), FaultKind::BadCommand, "command for robot");
        assert_eq!(fault.line, Some(1), "{text}: {fault}");
    }
}

#[test]
fn silent_programs_stop_the_run() {
    let fault = stopped(&script("fn step(now) {}"), FaultKind::Silent, "told nothing");
    assert_eq!(fault.tick, Some(60));
    stopped(
        &script("fn step(now) { stop(0); stop(1); }"),
        FaultKind::Silent,
        "robot 2",
    );
    let still =
        "fn step(now) { if now.tick < 30 { for r in 0..3 { stop(r); } } else { for r in 0..3 { finished(r); } } }";
    assert!(
        rehearse_json(&scenario_json(&script(still), 2.0))
            .expect("a rehearsal")
            .verdict
            .accepted
    );
}

#[test]
fn modules_that_never_end_or_trap_are_stopped() {
    let loops = "(loop $l (br $l)) i32.const 0";
    stopped(&module("", loops), FaultKind::Exhausted, "fuel");
    let fill = "(loop $l (memory.fill (i32.const 0) (i32.const 1) (i32.const 131072)) (br $l)) i32.const 0";
    stopped(&module("", fill), FaultKind::Exhausted, "fuel");
    let copy = "(loop $l (memory.copy (i32.const 0) (i32.const 1) (i32.const 131000)) (br $l)) i32.const 0";
    stopped(&module("", copy), FaultKind::Exhausted, "fuel");
    let recursion = "(call $step (local.get 0) (local.get 1))";
    stopped(&module("", recursion), FaultKind::Exhausted, "stack");
    stopped(&module("", "unreachable"), FaultKind::Failed, "trap");
    stopped(
        &module("", "(i32.div_u (i32.const 1) (i32.const 0))"),
        FaultKind::Failed,
        "trap",
    );
    stopped(
        &module("", "(i32.load (i32.const 99999999))"),
        FaultKind::Failed,
        "trap",
    );
    let wild = "(call_indirect (param i32 i32) (result i32) (local.get 0) (local.get 1) (i32.const 77))";
    stopped(&module("(table 1 funcref)", wild), FaultKind::Failed, "trap");
    let log = "(import \"robopheus\" \"log\" (func $log (param i32 i32)))";
    let shout = "(loop $l (call $log (i32.const 0) (i32.const 1000)) (br $l)) i32.const 0";
    stopped(&module(log, shout), FaultKind::Exhausted, "fuel");
}

#[test]
fn modules_cannot_have_more_memory_than_allowed() {
    let grows = "(drop (memory.grow (i32.const 2000))) (i32.store (i32.const 67108864) (i32.const 1)) i32.const 0";
    stopped(&module("", grows), FaultKind::Failed, "trap");
    let large =
        "(module (memory (export \"memory\") 1025) (func (export \"buffer\") (param i32) (result i32) i32.const 0)
        (func (export \"step\") (param i32 i32) (result i32) i32.const 0))";
    refused(&wasm(large), "memory");
    refused(&module("(table 20000 funcref)", "i32.const 0"), "table");
    refused(&module("(table 1 funcref) (table 1 funcref)", "i32.const 0"), "");
}

#[test]
fn modules_that_lie_about_pointers_are_stopped() {
    for pointer in ["-8", "131000", "2147483647"] {
        stopped(
            &module("", &format!("i32.const {pointer}")),
            FaultKind::BadCommand,
            "outside the memory",
        );
    }
    let log = "(import \"robopheus\" \"log\" (func $log (param i32 i32)))";
    let reads = "(call $log (i32.const 131070) (i32.const 100)) i32.const 0";
    stopped(&module(log, reads), FaultKind::Failed, "outside the memory");
    let huge = "(call $log (i32.const -1) (i32.const -1)) i32.const 0";
    stopped(&module(log, huge), FaultKind::Failed, "outside the memory");
    let nan = "(f64.store (i32.const 0) (f64.const 1)) (f64.store (i32.const 8) (f64.const nan)) i32.const 4096";
    let nan = nan
        .replace("i32.const 0)", "i32.const 4096)")
        .replace("i32.const 8)", "i32.const 4104)");
    let nan = nan.as_str();
    stopped(&module("", nan), FaultKind::BadCommand, "robot 0");
    let kind = "(f64.store (i32.const 4096) (f64.const 9)) i32.const 4096";
    stopped(&module("", kind), FaultKind::BadCommand, "kind");
    let away =
        "(module (memory (export \"memory\") 1) (func (export \"buffer\") (param i32) (result i32) i32.const 65000)
        (func (export \"step\") (param i32 i32) (result i32) i32.const 0))";
    refused(&wasm(away), "buffer");
}

#[test]
fn modules_that_ask_for_more_than_the_host_gives_are_refused() {
    refused(
        &module(
            "(import \"wasi_snapshot_preview1\" \"fd_write\" (func (param i32 i32 i32 i32) (result i32)))",
            "i32.const 0",
        ),
        "wasi_snapshot_preview1.fd_write",
    );
    refused(
        &module("(import \"robopheus\" \"open\" (func (param i32)))", "i32.const 0"),
        "robopheus.open",
    );
    refused(
        &module(
            "(import \"robopheus\" \"sin\" (func (param i32) (result i32)))",
            "i32.const 0",
        ),
        "",
    );
    refused(
        &module("(func $begin (loop $l (br $l))) (start $begin)", "i32.const 0"),
        "",
    );
    refused(&wasm("(module (memory (export \"memory\") 1))"), "buffer");
    refused(&Source::module(b"\0asm\x01\0\0\0junk"), "not a usable module");
    refused(&Source::module(b"MZ"), "not a usable module");
    refused(&Source::Module("not base64!".into()), "base64");
    refused(&Source::module(&vec![0; 1024 * 1024 + 16]), "bytes");
    refused(&script(&" ".repeat(65 * 1024)), "bytes");
    let deep = format!("fn step(now) {{ let x = {}1{}; }}", "(".repeat(5000), ")".repeat(5000));
    refused(&script(&deep), "");
}
