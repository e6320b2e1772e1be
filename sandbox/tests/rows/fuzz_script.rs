//! Random scripts: sentences of the language with any function and any value, and the language's words in any order.

use std::fmt::{self, Display};
use std::time::{Duration, Instant};

use control::law::FaultKind;
use controllers::answer::Answer;
use controllers::program::compile;
use controllers::source::Source;
use controllers::variety::{self, Draw};
use controllers::vocabulary::{Of, WORDS};

use crate::figures::Spread;
use crate::team::{ROBOTS, setup, view};

/// Longest tick that is no hang: the rehearsal's patience.
const LONGEST: Duration = Duration::from_secs(10);
const TICKS: u64 = 3;
/// Most times that are kept.
const KEPT: usize = 200_000;

const VALUES: [&str; 34] = [
    "0",
    "1",
    "-1",
    "7",
    "63",
    "64",
    "2000",
    "9223372036854775807",
    "-9223372036854775808",
    "0.0",
    "-0.0",
    "0.5",
    "-2.5",
    "1e300",
    "1e-320",
    "(0.0 / 0.0)",
    "(1.0 / 0.0)",
    "true",
    "false",
    "()",
    "'x'",
    "'ä'",
    "\"\"",
    "\"text\"",
    "\"ä€🤖\"",
    "`${1 + 1} ${now.tick}`",
    "[]",
    "[1, 2.0, \"three\", ()]",
    "#{}",
    "#{a: 1, b: [2, 3], c: #{d: ()}}",
    "(|u| u)",
    "(|u, v| u + v)",
    "range(0, 10)",
    "now",
];
/// Ranges are refused everywhere but in heads of loops; words in any order have them.
const OPERATORS: [&str; 19] = [
    "+", "-", "*", "/", "%", "<<", ">>", "&", "|", "^", "==", "!=", "<", "<=", ">", ">=", "??", "in", "!in",
];
const ASSIGNMENTS: [&str; 11] = ["=", "+=", "-=", "*=", "/=", "%=", "<<=", ">>=", "&=", "|=", "^="];
const PLACES: [&str; 14] = [
    "a",
    "b",
    "c",
    "this",
    "this.x",
    "this.list",
    "this.map",
    "this[\"x\"]",
    "a[0]",
    "a[b]",
    "b.c",
    "a[-1]",
    "c[range(0, 2)]",
    "now.robots[0]",
];
/// Methods of the language's packages beside those of the vocabulary.
const METHODS: [&str; 46] = [
    "push",
    "pop",
    "shift",
    "insert",
    "remove",
    "append",
    "pad",
    "truncate",
    "chop",
    "clear",
    "reverse",
    "len",
    "get",
    "set",
    "map",
    "filter",
    "reduce",
    "reduce_rev",
    "sort",
    "index_of",
    "find",
    "find_map",
    "some",
    "all",
    "dedup",
    "drain",
    "retain",
    "splice",
    "extract",
    "split",
    "chunks",
    "zip",
    "order",
    "keys",
    "values",
    "mixin",
    "fill_with",
    "contains",
    "to_string",
    "sub_string",
    "crop",
    "replace",
    "trim",
    "to_upper",
    "bits",
    "type_of",
];
const TOKENS: [&str; 42] = [
    "fn",
    "step",
    "(now)",
    "{",
    "}",
    "(",
    ")",
    "[",
    "]",
    "#{",
    ";",
    ",",
    ":",
    "=>",
    "=",
    "let",
    "const",
    "if",
    "else",
    "while",
    "loop",
    "for",
    "in",
    "do",
    "until",
    "break",
    "continue",
    "return",
    "throw",
    "try",
    "catch",
    "switch",
    "this",
    "|",
    "?.",
    "?[",
    "`${",
    "private",
    "is_def_fn",
    "Fn",
    "..",
    "..=",
];

/// What came of all scripts.
#[derive(Debug, Default)]
pub struct Seen {
    refused: u64,
    faults: u64,
    exhausted: u64,
    with_line: u64,
    ran: u64,
    ticks: Spread,
    longest: Duration,
}

impl Seen {
    /// Every outcome was there.
    pub fn is_varied(&self) -> bool {
        [self.refused, self.faults, self.exhausted, self.ran]
            .into_iter()
            .all(|count| count > 0)
    }
}

impl Display for Seen {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{} refused, {} stopped by an error, {} by a limit ({} of both with their line), {} ran; a tick p50 {:.2}, p99 {:.2}, longest {:.0} ms (10000)",
            self.refused,
            self.faults,
            self.exhausted,
            self.with_line,
            self.ran,
            self.ticks.ms(0.5),
            self.ticks.ms(0.99),
            self.longest.as_secs_f64() * 1e3
        )
    }
}

/// One random script, asked a few times.
pub fn case(number: u64, seen: &mut Seen) {
    let text = text(number);
    let mut program = match compile(&Source::Script(text.clone()), &setup()) {
        Ok(program) => program,
        Err(fault) => {
            assert!(
                fault.kind == FaultKind::Refused && !fault.reason.is_empty(),
                "{text}: {fault}"
            );
            seen.refused += 1;
            return;
        }
    };
    let mut answer = Answer::default();
    for tick in 0..TICKS {
        answer.clear(ROBOTS);
        let begun = Instant::now();
        let told = program.step(&view(tick), &mut answer);
        let took = begun.elapsed();
        assert!(took < LONGEST, "{took:?}:\n{text}");
        seen.longest = seen.longest.max(took);
        if seen.ticks.count() < KEPT {
            seen.ticks.add(took);
        }
        if let Err(fault) = told {
            assert!(!fault.reason.is_empty() && fault.tick == Some(tick), "{text}: {fault}");
            match fault.kind {
                FaultKind::Exhausted => seen.exhausted += 1,
                FaultKind::Failed | FaultKind::BadCommand => seen.faults += 1,
                kind => panic!("{kind:?} {fault}: {text}"),
            }
            seen.with_line += u64::from(fault.line.is_some());
            return;
        }
        assert_eq!(answer.robots.len(), ROBOTS);
    }
    seen.ran += 1;
}

fn text(number: u64) -> String {
    let mut draw = Draw::new(0x0707_0000_0000 + number);
    let draw = &mut draw;
    match number % 8 {
        0 => soup(draw),
        1 => mangled(draw, number),
        _ => {
            let mut whole = String::from("fn start(now) { this.x = 1; this.list = [1, 2, 3]; this.map = #{k: 1}; ");
            if draw.chance(20) {
                let kept = block(draw, 2, false);
                whole.push_str(&format!("let a = 1; let b = [1]; let c = \"c\"; {kept}"));
            }
            whole.push_str(&format!(
                "}}\nfn helper(a, b) {{ let c = 3; let now = a; {} }}\nfn other(a) {{ let b = a; let c = 0; let now = b; {} }}\nfn step(now) {{\n let a = 2; let b = [1, 2.5, \"x\"]; let c = #{{c: 3}};\n{}\n{}\n{}\n{}\n}}\n",
                block(draw, 1, false),
                block(draw, 1, false),
                simple(draw),
                simple(draw),
                simple(draw),
                block(draw, 3, false)
            ));
            whole
        }
    }
}

/// Words of the language in any order, now and then within a function.
fn soup(draw: &mut Draw) -> String {
    let mut words = String::new();
    for _ in 0..draw.below(60) {
        let word = match draw.below(6) {
            0 => *draw.pick(&VALUES),
            1 => *draw.pick(&OPERATORS),
            2 => *draw.pick(&PLACES),
            3 => draw.pick(WORDS).form,
            _ => *draw.pick(&TOKENS),
        };
        words.push_str(word);
        words.push(' ');
    }
    if draw.chance(70) {
        format!("fn step(now) {{ {words} }}")
    } else {
        words
    }
}

/// A varied script with pieces taken out, doubled or moved.
fn mangled(draw: &mut Draw, number: u64) -> String {
    let script = variety::script(number);
    let mut pieces: Vec<&str> = script.split_inclusive([' ', '(', ')', ';', ',']).collect();
    for _ in 0..1 + draw.below(4) {
        let at = draw.below(pieces.len() as u64) as usize;
        let to = draw.below(pieces.len() as u64) as usize;
        match draw.below(3) {
            0 => drop(pieces.remove(at)),
            1 => pieces.insert(to, pieces[at]),
            _ => pieces.swap(at, to),
        }
    }
    pieces.concat()
}

fn block(draw: &mut Draw, depth: u32, in_loop: bool) -> String {
    let count = 1 + draw.below(5);
    (0..count)
        .map(|_| statement(draw, depth, in_loop))
        .collect::<Vec<_>>()
        .join("\n")
}

fn statement(draw: &mut Draw, depth: u32, in_loop: bool) -> String {
    if depth == 0 {
        return match draw.below(24) {
            0 if in_loop => "break;".into(),
            1 if in_loop => "continue;".into(),
            2 => format!("return {};", value(draw, 1)),
            3 => format!("throw {};", value(draw, 1)),
            _ => simple(draw),
        };
    }
    let next = depth - 1;
    let within = |draw: &mut Draw| block(draw, next, in_loop);
    match draw.below(18) {
        0 => format!(
            "if {} {{ {} }} else {{ {} }}",
            condition(draw),
            within(draw),
            within(draw)
        ),
        1 => format!("while {} {{ {} }}", condition(draw), block(draw, next, true)),
        2 => format!("loop {{ {} break; }}", block(draw, next, true)),
        3 => format!("for c in {} {{ {} }}", items(draw), block(draw, next, true)),
        4 => format!("for (c, k) in {} {{ {} }}", items(draw), block(draw, next, true)),
        5 => format!("do {{ {} }} until {};", block(draw, next, true), condition(draw)),
        6 | 7 => format!("try {{ {} }} catch (c) {{ {} }}", within(draw), within(draw)),
        8 => format!(
            "switch {} {{ {} => {{ {} }} 10 if {} => {{ {} }} _ => () }}",
            value(draw, 1),
            draw.below(5),
            within(draw),
            condition(draw),
            within(draw)
        ),
        9 => "for robot in now.robots { velocity(robot.index, 0.1, 0.1); }".into(),
        10 => format!("for k in 0..{} {{ {} }}", draw.below(400), block(draw, next, true)),
        11 => format!("loop {{ {} }}", block(draw, next, true)),
        _ => simple(draw),
    }
}

/// What the language takes for true or false before it runs.
fn condition(draw: &mut Draw) -> String {
    match draw.below(6) {
        0 => "(a == b && c != 1)".into(),
        1 => format!("({} || {})", condition(draw), condition(draw)),
        2 => format!("is_def_fn(\"helper\", {})", draw.below(4)),
        _ => format!(
            "({} {} {})",
            value(draw, 1),
            draw.pick(&OPERATORS[10..16]),
            value(draw, 1)
        ),
    }
}

/// What the language takes for something to run over before it runs.
fn items(draw: &mut Draw) -> String {
    match draw.below(5) {
        0 => (*draw.pick(&PLACES)).to_owned(),
        1 => format!("range(0, {}, {})", draw.below(300), draw.pick(&VALUES)),
        2 => {
            let dots = draw.pick(&["..", "..="]);
            format!("{}{dots}{}", draw.pick(&VALUES[..9]), draw.pick(&VALUES[..9]))
        }
        3 => "now.robots".into(),
        _ => format!("[{}, {}]", value(draw, 1), value(draw, 1)),
    }
}

/// Most go on after an error: else few scripts would come beyond their first line.
fn simple(draw: &mut Draw) -> String {
    let sentence = sentence(draw);
    if draw.chance(90) && !sentence.starts_with("let") {
        return format!("try {{ {sentence} }} catch {{}}");
    }
    sentence
}

fn sentence(draw: &mut Draw) -> String {
    match draw.below(6) {
        0 => format!("let {} = {};", draw.pick(&["a", "b", "c", "d"]), value(draw, 0)),
        1 | 2 => format!("{} {} {};", draw.pick(&PLACES), draw.pick(&ASSIGNMENTS), value(draw, 2)),
        3 => format!("{};", method(draw, 2)),
        4 => format!("{};", call(draw, 2)),
        _ => format!("{};", value(draw, 3)),
    }
}

fn value(draw: &mut Draw, depth: u32) -> String {
    if depth == 0 {
        return if draw.chance(60) {
            (*draw.pick(&VALUES)).to_owned()
        } else {
            (*draw.pick(&PLACES)).to_owned()
        };
    }
    let next = depth - 1;
    match draw.below(12) {
        0..4 => format!(
            "({} {} {})",
            value(draw, next),
            draw.pick(&OPERATORS),
            value(draw, next)
        ),
        4 => format!("(- {})", value(draw, next)),
        5 => format!("(!{})", condition(draw)),
        6 => format!("[{}, {}]", value(draw, next), value(draw, next)),
        7 => format!("{}[{}]", draw.pick(&["a", "b", "c"]), value(draw, next)),
        8 => method(draw, next),
        9 => call(draw, next),
        _ => value(draw, 0),
    }
}

fn values(draw: &mut Draw, depth: u32) -> String {
    let count = draw.below(4);
    (0..count).map(|_| value(draw, depth)).collect::<Vec<_>>().join(", ")
}

fn method(draw: &mut Draw, depth: u32) -> String {
    let name = if draw.chance(80) {
        *draw.pick(&METHODS)
    } else {
        named(draw, |of| matches!(of, Of::Collection | Of::Robot | Of::Now))
    };
    format!("{}.{name}({})", draw.pick(&PLACES), values(draw, depth.min(1)))
}

fn call(draw: &mut Draw, depth: u32) -> String {
    let name = match draw.below(10) {
        0 => "helper",
        1 => "other",
        2 => "range",
        _ => named(draw, |of| of == Of::Function),
    };
    format!("{name}({})", values(draw, depth.min(1)))
}

fn named(draw: &mut Draw, of: impl Fn(Of) -> bool) -> &'static str {
    let fitting: Vec<&str> = WORDS.iter().filter(|word| of(word.of)).map(|word| word.name).collect();
    draw.pick::<&str>(&fitting)
}
