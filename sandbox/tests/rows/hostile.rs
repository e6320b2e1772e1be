//! Programs that mean harm, and hungry ones.

use control::law::FaultKind;
use controllers::source::Source;

pub struct Hostile {
    pub name: &'static str,
    pub source: Source,
    /// How it may end.
    pub ends: &'static [FaultKind],
    /// Part of the reason.
    pub words: &'static str,
}

const LOG: &str = "(import \"robopheus\" \"log\" (func $log (param i32 i32)))";

pub fn wasm(text: &str) -> Source {
    Source::module(&wat::parse_str(text).unwrap_or_else(|error| panic!("{error}")))
}

/// A module with these parts besides a memory of so many pages, and this body of `step`.
pub fn module(rest: &str, pages: u32, step: &str) -> Source {
    wasm(&format!(
        "(module {rest} (memory (export \"memory\") {pages})
           (func (export \"buffer\") (param i32) (result i32) i32.const 8192)
           (func $step (export \"step\") (param i32 i32) (result i32) (local $x i32) {step}))"
    ))
}

fn script(text: &str) -> Source {
    Source::Script(text.into())
}

/// A script that does nothing.
pub fn idle() -> Source {
    script("fn step(now) { for r in 0..3 { stop(r); } }")
}

/// Within its operations it copies arrays for seconds.
pub fn hangs() -> Source {
    script("fn start(now) { let a = []; a.pad(2000, \"x\"); let b = a; loop { b = a; } } fn step(now) {}")
}

pub fn programs() -> Vec<Hostile> {
    use FaultKind::{BadCommand, Exhausted, Failed, Refused, Silent};
    let row = |name, source, ends: &'static [FaultKind], words| Hostile {
        name,
        source,
        ends,
        words,
    };
    let deep = format!("fn step(now) {{ let x = {}1{}; }}", "(".repeat(9000), ")".repeat(9000));
    let giant = format!("fn step(now) {{ print(\"{}\"); }}", "x".repeat(60_000));
    let flood = format!(
        "fn step(now) {{ loop {{ print(\"\\u001b[31m{}\"); }} }}",
        "x".repeat(7_000)
    );
    let functions = "(func (param i64) (result i64) local.get 0 i64.const 3 i64.mul)".repeat(9_900);
    vec![
        row("script: loop", script("fn step(now) { loop {} }"), &[Exhausted], "operations"),
        row(
            "script: recursion",
            script("fn down(n) { down(n + 1) } fn step(now) { down(0); }"),
            &[Exhausted],
            "call each other",
        ),
        row(
            "script: texts that double",
            script("fn step(now) { let s = \"xx\"; loop { s += s; } }"),
            &[Exhausted],
            "too large",
        ),
        row(
            "script: arrays in arrays",
            script("fn step(now) { let a = []; loop { a = [a, a]; } }"),
            &[Exhausted],
            "",
        ),
        row("script: log flood", script(&flood), &[Exhausted], "operations"),
        row(
            "script: no numbers",
            script("fn step(now) { for r in 0..3 { twist(r, 0.0 / 0.0, 0, 0); } }"),
            &[BadCommand],
            "command for robot 0",
        ),
        row("script: giant literal", script(&giant), &[Refused], ""),
        row("script: deep brackets", script(&deep), &[Refused], ""),
        row(
            "script: errors caught for ever",
            script("fn step(now) { loop { try { throw 1; } catch { } } }"),
            &[Exhausted],
            "operations",
        ),
        // Its operations may take longer than the loop asks.
        row(
            "script: copies",
            script("fn step(now) { let a = []; a.pad(2000, \"x\"); let b = a; loop { b = a; } }"),
            &[Exhausted, Silent],
            "",
        ),
        row("module: loop", module("", 2, "(loop $l (br $l)) i32.const 0"), &[Exhausted], "fuel"),
        row(
            "module: recursion",
            module("", 2, "(call $step (local.get 0) (local.get 1))"),
            &[Exhausted],
            "stack",
        ),
        row(
            "module: copies 64 MiB",
            module(
                "",
                1024,
                "(loop $l (memory.copy (i32.const 0) (i32.const 1) (i32.const 67108000)) (br $l)) i32.const 0",
            ),
            &[Exhausted],
            "fuel",
        ),
        row(
            "module: fills in pieces",
            module(
                "",
                1024,
                "(loop $l (memory.fill (local.get $x) (i32.const 1) (i32.const 65536))
                   (local.set $x (i32.and (i32.add (local.get $x) (i32.const 65536)) (i32.const 0x3feffff))) (br $l)) i32.const 0",
            ),
            &[Exhausted],
            "fuel",
        ),
        row(
            "module: start function that loops",
            module("(func $begin (loop $l (br $l))) (start $begin)", 2, "i32.const 0"),
            &[Refused],
            "",
        ),
        row(
            "module: traps",
            module("", 2, "(i32.load (i32.div_u (i32.const 1) (i32.sub (local.get $x) (local.get $x))))"),
            &[Failed],
            "trap",
        ),
        row(
            "module: log flood",
            module(LOG, 2, "(loop $l (call $log (i32.const 0) (i32.const 1000)) (br $l)) i32.const 0"),
            &[Exhausted],
            "fuel",
        ),
        row(
            "module: memory that grows",
            module("", 2, "(loop $l (drop (memory.grow (i32.const 1))) (br $l)) i32.const 0"),
            &[Exhausted],
            "fuel",
        ),
        row(
            "module: table that grows",
            module(
                "(table 1 funcref)",
                2,
                "(loop $l (drop (table.grow 0 (ref.null func) (i32.const 7))) (br $l)) i32.const 0",
            ),
            &[Exhausted],
            "fuel",
        ),
        row(
            "module: many functions, then a loop",
            module(&functions, 2, "(loop $l (br $l)) i32.const 0"),
            &[Refused, Exhausted],
            "",
        ),
    ]
}

/// Name, program, whether it is to touch all of the memory that modules may have.
pub fn hungry() -> Vec<(&'static str, Source, bool)> {
    let orders = "(f64.store (i32.const 0) (f64.const 1)) (f64.store (i32.const 128) (f64.const 1)) (f64.store (i32.const 256) (f64.const 1))";
    // A good megabyte a tick, behind the view: all of it in 55 ticks.
    let fill = format!(
        "{orders} (if (i32.lt_u (global.get $at) (i32.const 65908864)) (then
           (memory.fill (global.get $at) (i32.const 7) (i32.const 1200000))
           (global.set $at (i32.add (global.get $at) (i32.const 1200000)))))
           i32.const 0"
    );
    let touched = "(global $at (mut i32) (i32.const 65536))";
    let grow = format!("(drop (memory.grow (i32.const 19))) {fill}");
    vec![
        ("module: 64 MiB", module(touched, 1024, &fill), true),
        ("module: 64 MiB, grown", module(touched, 2, &grow), true),
        (
            "module: 64 MiB and a table",
            module(&format!("{touched} (table 10000 funcref)"), 1024, &fill),
            true,
        ),
        (
            "script: long texts in an array",
            script(
                "fn step(now) { for r in 0..3 { stop(r); } let a = []; a.pad(1900, ()); let s = \"\"; s.pad(8000, 'x');
                 for k in 0..1900 { a[k] = s + k; } }",
            ),
            false,
        ),
        (
            "script: arrays in an array",
            script(
                "fn step(now) { for r in 0..3 { stop(r); } let b = []; b.pad(1900, 0.5); let a = []; a.pad(1900, ());
                 for k in 0..1200 { let c = b; c[0] = k; a[k] = c; } }",
            ),
            false,
        ),
        (
            "script: maps in maps",
            script(
                "fn step(now) { for r in 0..3 { stop(r); } let m = #{}; for k in 0..400 { m[`${k}`] = k; }
                 let a = []; a.pad(1900, ()); for k in 0..1900 { a[k] = m; } }",
            ),
            false,
        ),
        (
            "script: keeps what it may",
            script("fn start(now) { this.a = []; this.a.pad(1900, 0.5); } fn step(now) { for r in 0..3 { stop(r); } }"),
            false,
        ),
    ]
}
