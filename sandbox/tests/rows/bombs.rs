//! Programs that are meant to keep the compiler busy.

use control::law::own::{MAX_MODULE_BYTES, MAX_SCRIPT_BYTES};
use controllers::source::Source;
use controllers::variety::{self, Draw};

use crate::hostile::{module, wasm};

/// Twenty, the largest that are allowed by their size or near it.
pub fn crafted() -> Vec<(String, Source)> {
    let repeated = |text: &str, times: usize| text.repeat(times);
    let nested = |open: &str, close: &str, times: usize| format!("{}{}", open.repeat(times), close.repeat(times));
    let exports: String = (0..900).map(|k| format!("(export \"e{k}\" (func $step))")).collect();
    let many_exports: String = (0..60_000).map(|k| format!("(export \"e{k}\" (func $step))")).collect();
    let labels = |count: usize| (0..count).map(|_| "0 ").collect::<String>();
    let table = |count: usize| format!("(block (br_table {}(local.get 0))) i32.const 0", labels(count));
    let chain: String = (0..9_000)
        .map(|k| {
            format!(
                "(func $f{k} (param i64) (result i64) (i64.add (call $f{} (local.get 0)) (i64.const {k})))",
                (k + 1) % 9_000
            )
        })
        .collect();
    let segments = repeated("(data (i32.const 0) \"x\")", 90_000);
    let few_segments = repeated("(data (i32.const 0) \"0123456789\")", 900);
    let one_function = repeated("(local.set $x (i32.add (local.get $x) (i32.const 1)))", 100_000);
    let locals = format!("(func (local {}))", repeated("i64 ", 49_000));
    let many_locals = repeated(
        "(func (local i64 i64 i64 i64 i64 i64 i64 i64 i64 i64 f64 f64 f64 f64 f64 f64))",
        9_000,
    );
    let modules = [
        (
            "empty functions",
            module(&repeated("(func)", 200_000), 2, "i32.const 0"),
        ),
        (
            "functions within the limit",
            module(&repeated("(func (drop (i32.const 1)))", 9_900), 2, "i32.const 0"),
        ),
        ("functions that call each other", module(&chain, 2, "i32.const 0")),
        (
            "one long function",
            module("", 2, &format!("{one_function} i32.const 0")),
        ),
        (
            "nested blocks",
            module("", 2, &format!("{} i32.const 0", nested("(block ", ")", 60_000))),
        ),
        (
            "nested loops",
            module("", 2, &format!("{} i32.const 0", nested("(loop ", ")", 5_000))),
        ),
        (
            "nested choices",
            module(
                "",
                2,
                &format!("{} i32.const 0", nested("(if (local.get 0) (then ", "))", 20_000)),
            ),
        ),
        ("locals beyond the limit", module(&locals, 2, "i32.const 0")),
        ("locals in every function", module(&many_locals, 2, "i32.const 0")),
        ("a wide table of branches", module("", 2, &table(900_000))),
        (
            "tables of branches",
            module("", 2, &table(3_000).repeat(250).replace("i32.const 0", "")),
        ),
        ("exports beyond the limit", module(&many_exports, 2, "i32.const 0")),
        ("exports", module(&exports, 2, "i32.const 0")),
        ("segments beyond the limit", module(&segments, 2, "i32.const 0")),
        ("segments", module(&few_segments, 2, "i32.const 0")),
        (
            "types",
            wasm(&format!(
                "(module {})",
                repeated("(type (func (param i32 i64 f64) (result i32)))", 100_000)
            )),
        ),
        ("a million bytes of nothing", Source::module(&vec![0; MAX_MODULE_BYTES])),
    ];
    let mut all: Vec<(String, Source)> = modules.map(|(name, source)| (name.to_owned(), source)).into();
    let step = |body: &str| Source::Script(format!("fn step(now) {{ {body} }}"));
    let statements = repeated("let a=1;", MAX_SCRIPT_BYTES / 8 - 8);
    let functions: String = (0..5_000).map(|k| format!("fn f{k}(){{}}")).collect();
    let values = format!("let a = [{}];", repeated("[[]],", MAX_SCRIPT_BYTES / 5 - 16));
    all.push(("script of statements".into(), step(&statements)));
    all.push((
        "script of functions".into(),
        Source::Script(format!("fn step(now) {{}} {functions}")),
    ));
    all.push(("script of one array".into(), step(&values)));
    all
}

/// A varied module or, every fourth time, a script, with up to four pieces changed, taken out, doubled or moved.
pub fn mutated(number: u64) -> Source {
    let mut draw = Draw::new(0xb0b5 + number);
    let is_script = number % 4 == 3;
    let mut bytes = if is_script {
        variety::script(number).into_bytes()
    } else {
        variety::module(number)
    };
    for _ in 0..draw.below(5) {
        let at = draw.below(bytes.len() as u64) as usize;
        let end = (at + 1 + draw.below(40) as usize).min(bytes.len());
        match draw.below(5) {
            0 => bytes[at] = draw.bits() as u8,
            1 => bytes[at] ^= 1 << draw.below(8),
            2 => drop(bytes.drain(at..end)),
            3 => {
                let piece = bytes[at..end].to_vec();
                let times = 1 + draw.below(50) as usize;
                bytes.splice(at..at, piece.repeat(times));
            }
            _ => {
                let piece: Vec<u8> = bytes.drain(at..end).collect();
                let to = draw.below(bytes.len() as u64 + 1) as usize;
                bytes.splice(to..to, piece);
            }
        }
    }
    if is_script {
        Source::Script(String::from_utf8_lossy(&bytes).into_owned())
    } else {
        Source::module(&bytes)
    }
}
