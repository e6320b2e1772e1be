//! Time of a tick of own controllers: `cargo run -p controllers --example tick_times`. Medians and 99th percentiles of many ticks.

use std::time::Instant;

use controllers::answer::Answer;
use controllers::limits;
use controllers::policy::KEY;
use controllers::program::compile;
use controllers::source::Source;
use controllers::workload::{Workload, programs, setup, view};
use onnx::Sequence;

const TICKS: usize = 2_000;

/// Two inputs, `WIDE` numbers three times, a twist: near the bytes that a file may have and, for two robots, the operations.
fn largest_policy() -> Vec<u8> {
    const WIDE: usize = 340;
    let weights = |from: usize, to: usize| vec![0.5 / from as f32; from * to];
    let manifest = r#"{"format": "robopheus.policy/1", "observation": ["goal_forward_m", "goal_left_m"], "command": "twist",
        "rate_hz": 120, "limits": [0.3, 0.3, 1.5]}"#;
    Sequence::new("observation", 2)
        .linear(&weights(2, WIDE), &[0.1; WIDE])
        .node("Tanh", &[], &[])
        .linear(&weights(WIDE, WIDE), &[0.1; WIDE])
        .node("Relu", &[], &[])
        .linear(&weights(WIDE, WIDE), &[0.1; WIDE])
        .node("Relu", &[], &[])
        .linear(&weights(WIDE, 3), &[0.0; 3])
        .file("command", 3, &[(KEY, manifest)])
}

/// Milliseconds of each tick, sorted; `None` when the program was stopped by its limits.
fn time(source: &Source, robots: usize) -> Option<Vec<f64>> {
    let mut work = Workload::new(source, robots).ok()?;
    let mut times_ms = Vec::with_capacity(TICKS);
    for _ in 0..TICKS {
        let view = work.next_view();
        let begun = Instant::now();
        work.step(&view).ok()?;
        times_ms.push(begun.elapsed().as_secs_f64() * 1e3);
    }
    times_ms.sort_by(f64::total_cmp);
    Some(times_ms)
}

fn line(name: &str, robots: usize, times_ms: Option<Vec<f64>>) {
    match times_ms {
        Some(times_ms) => println!(
            "{name:28} {robots:3} robots  p50 {:7.3} ms  p99 {:7.3} ms",
            times_ms[times_ms.len() / 2],
            times_ms[times_ms.len() * 99 / 100]
        ),
        None => println!("{name:28} {robots:3} robots  stopped by its limits"),
    }
}

/// One tick of a program that never ends, until its limit stops it: median of several.
fn at_limit(name: &str, source: &Source) {
    let mut times_ms: Vec<f64> = (0..15)
        .filter_map(|_| {
            let mut program = compile(source, &setup(1)).ok()?;
            let mut answer = Answer::default();
            answer.clear(1);
            let begun = Instant::now();
            let stopped = program.step(&view(1, 1), &mut answer).is_err();
            stopped.then(|| begun.elapsed().as_secs_f64() * 1e3)
        })
        .collect();
    times_ms.sort_by(f64::total_cmp);
    match times_ms.get(times_ms.len() / 2) {
        Some(median) => println!("at the limit: {name:40} {median:8.3} ms"),
        None => println!("at the limit: {name:40} never stopped"),
    }
}

fn main() {
    for robots in [1, 10, 50] {
        for (name, source) in programs() {
            line(&name, robots, time(&source, robots));
        }
    }
    let largest = Source::policy(&largest_policy());
    line("policy, as large as allowed", 2, time(&largest, 2));
    println!(
        "script: {} operations, module: {} fuel",
        limits::SCRIPT_OPERATIONS,
        limits::MODULE_FUEL
    );
    let script = |name: &str, body: &str| at_limit(name, &Source::Script(format!("fn step(now) {{ {body} }}")));
    script("script, counting", "let n = 0; loop { n += 1; }");
    script("script, sines", "let x = 0.1; loop { x = sin(x) + 0.1; }");
    script("script, robots", "loop { let r = now.robots; }");
    script(
        "script, copying an array of 1000",
        "let a = []; a.pad(1000, 0.5); let b = a; loop { b = a; }",
    );
    script(
        "script, calls on an array of 1000",
        "let a = []; a.pad(1000, 0.5); loop { a.len(); }",
    );
    script(
        "script, sorting an array of 1000",
        "let a = []; for k in 0..1000 { a.push(sin(k)); } loop { a.sort(); a.reverse(); }",
    );
    script(
        "script, texts of 8 kB",
        "let s = \"\"; s.pad(8000, 'x'); loop { let t = s + \"y\"; }",
    );
    let module = |name: &str, rest: &str, body: &str| {
        let text = format!(
            "(module {rest} (memory (export \"memory\") 2)
               (func (export \"buffer\") (param i32) (result i32) i32.const 0)
               (func (export \"step\") (param i32 i32) (result i32) (local $x f64) {body}))"
        );
        match wat::parse_str(&text) {
            Ok(bytes) => at_limit(name, &Source::module(&bytes)),
            Err(error) => println!("{name}: {error}"),
        }
    };
    module("module, branches", "", "(loop $l (br $l)) i32.const 0");
    module(
        "module, divisions",
        "",
        "(loop $l (local.set $x (f64.sqrt (f64.div (f64.const 3) (local.get $x)))) (br $l)) i32.const 0",
    );
    module(
        "module, filling 128 kB",
        "",
        "(loop $l (memory.fill (i32.const 0) (i32.const 1) (i32.const 131072)) (br $l)) i32.const 0",
    );
    module(
        "module, memory.grow",
        "",
        "(loop $l (drop (memory.grow (i32.const 1))) (br $l)) i32.const 0",
    );
    let sin = "(import \"robopheus\" \"sin\" (func $sin (param f64) (result f64)))";
    module(
        "module, sines of the host",
        sin,
        "(loop $l (local.set $x (call $sin (f64.const 1e9))) (br $l)) i32.const 0",
    );
}
