//! Modules that hand random pointers, lengths and numbers to every function of the host; what the host reads is checked
//! against the memory as it was written.

use std::fmt::{self, Display, Write};

use control::law::{FaultKind, Note};
use controllers::answer::{Answer, Motion};
use controllers::limits::{LINE_BYTES, LOG_BYTES_PER_TICK, NOTES_PER_TICK};
use controllers::program::compile;
use controllers::variety::Draw;

use crate::hostile::wasm;
use crate::team::{ROBOTS, setup, view};

const UNARY: [&str; 10] = ["sin", "cos", "tan", "asin", "acos", "atan", "exp", "ln", "tanh", "wrap"];
const BINARY: [&str; 3] = ["atan2", "hypot", "pow"];
const PAGE: u64 = 65_536;
/// Where results of functions of numbers and commands are written, and behind them the view; texts are read from elsewhere.
const RESULTS_AT: u64 = 4_096;
const BUFFER_AT: u64 = 6_144;
const BUSY_END: u64 = 8_192;
/// Random bytes that texts are read from, at the end of the memory.
const PATTERN_BYTES: u64 = 4_096;
/// Odd bit patterns of numbers: zeros, subnormal, infinite, no numbers with and without sign and payload, the largest.
const ODD: [u64; 12] = [
    0,
    1 << 63,
    1,
    0x7ff0_0000_0000_0000,
    0xfff0_0000_0000_0000,
    0x7ff8_0000_0000_0000,
    0xfff8_0000_0000_0000,
    0x7ff0_0000_dead_beef,
    0x7fef_ffff_ffff_ffff,
    0x3ff0_0000_0000_0000,
    0xc1e0_0000_0000_0000,
    0x43e0_0000_0000_0000,
];

/// What came of all cases.
#[derive(Debug, Default)]
pub struct Seen {
    answered: u64,
    traps: u64,
    exhausted: u64,
    bad_commands: u64,
    lines: u64,
    drawings: u64,
    most_log_bytes: usize,
    numbers: u64,
}

impl Seen {
    /// Every outcome was there: the cases are no dead ones.
    pub fn is_varied(&self) -> bool {
        let least = [self.answered, self.traps, self.exhausted, self.bad_commands, self.lines];
        least
            .into_iter()
            .chain([self.drawings, self.numbers])
            .all(|count| count > 0)
    }
}

impl Display for Seen {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{} ticks answered, {} trapped, {} out of fuel, {} bad commands; {} lines and {} drawings as expected, {} numbers with one pattern, log of a tick at most {} bytes (65536)",
            self.answered,
            self.traps,
            self.exhausted,
            self.bad_commands,
            self.lines,
            self.drawings,
            self.numbers,
            self.most_log_bytes
        )
    }
}

/// What a case is expected to say before it is stopped.
#[derive(Debug, Default)]
struct Expected {
    /// Texts of log lines and drawings in their order; none of drawings without a text.
    notes: Vec<Option<String>>,
    /// Words of the answer that hold results of the host's functions of numbers.
    results: u64,
    /// A text outside the memory was asked for.
    is_outside: bool,
    /// It logs until it is stopped or the tick's volume is full.
    floods: bool,
    /// The commands are where the results are.
    tells_results: bool,
}

fn number(draw: &mut Draw) -> u64 {
    match draw.below(4) {
        0 => *draw.pick(&ODD),
        1 => draw.bits(),
        _ => draw.hundredths(-500, 500).to_bits(),
    }
}

fn float(bits: u64) -> String {
    format!("(f64.reinterpret_i64 (i64.const {}))", bits as i64)
}

/// A pointer and a length: near the pattern, at the edges of the memory, or anything.
fn place(draw: &mut Draw, end: u64) -> (u32, u32) {
    let pattern = end - PATTERN_BYTES;
    let pointer = match draw.below(8) {
        0 => draw.bits() as u32,
        1 => (end - 8 + draw.below(16)) as u32,
        2 => *draw.pick(&[0, u32::MAX, i32::MAX as u32, i32::MIN as u32]),
        _ => (pattern + draw.below(PATTERN_BYTES)) as u32,
    };
    let length = match draw.below(8) {
        0 => draw.bits() as u32,
        1 => *draw.pick(&[0, u32::MAX, i32::MAX as u32, i32::MIN as u32]),
        2 => (end.saturating_sub(pointer.into()) as u32)
            .wrapping_add(draw.below(3) as u32)
            .wrapping_sub(1),
        _ => draw.below(60) as u32,
    };
    (pointer, length)
}

/// What the host makes of a text: its first bytes without control characters and control sequences, each byte that is no text
/// replaced. Written once more, and differently, than in the product.
fn shown(bytes: &[u8]) -> String {
    let text: Vec<char> = String::from_utf8_lossy(&bytes[..bytes.len().min(LINE_BYTES)])
        .chars()
        .collect();
    let mut kept = String::new();
    let mut at = 0;
    while at < text.len() {
        if text[at] == '\u{1b}' && text.get(at + 1) == Some(&'[') {
            at += 2;
            while at < text.len() && !matches!(text[at], '@'..='~') {
                at += 1;
            }
        } else if !text[at].is_control() {
            if kept.len() + text[at].len_utf8() > LINE_BYTES {
                break;
            }
            kept.push(text[at]);
        }
        at += 1;
    }
    kept
}

/// A random module with the memory's pattern and what it should say.
fn module(draw: &mut Draw) -> (String, Expected) {
    let pages = 1 + draw.below(3);
    let end = pages * PAGE;
    let pattern: Vec<u8> = (0..PATTERN_BYTES)
        .map(|_| match draw.below(6) {
            0 => draw.bits() as u8,
            1 => *draw.pick(&[0x1b, b'[', b'm', b'\n', 0x9b, 0xc2]),
            _ => b' ' + draw.below(95) as u8,
        })
        .collect();
    let byte = |at: u64| {
        if at >= end - PATTERN_BYTES {
            pattern[(at + PATTERN_BYTES - end) as usize]
        } else {
            0
        }
    };
    let read = |pointer: u32, length: u32| -> Option<String> {
        let (from, to) = (u64::from(pointer), u64::from(pointer) + u64::from(length));
        let bytes = || (from..to.min(from + LINE_BYTES as u64)).map(byte).collect::<Vec<u8>>();
        (to <= end).then(|| shown(&bytes()))
    };
    let mut expected = Expected::default();
    let mut body = String::new();
    for _ in 0..1 + draw.below(10) {
        let (pointer, length) = loop {
            let (pointer, length) = place(draw, end);
            let (from, to) = (u64::from(pointer), u64::from(pointer) + u64::from(length));
            if to > end || to <= RESULTS_AT || from >= BUSY_END {
                break (pointer, length);
            }
        };
        let at = format!("(i32.const {}) (i32.const {})", pointer as i32, length as i32);
        let shade = format!("(i32.const {})", draw.bits() as i32);
        let numbers: Vec<u64> = (0..4).map(|_| number(draw)).collect();
        let finite = |count: usize| numbers[..count].iter().all(|bits| f64::from_bits(*bits).is_finite());
        let words = |count: usize| numbers[..count].iter().map(|bits| float(*bits)).collect::<String>();
        let mut says = None;
        match draw.below(6) {
            0 | 1 => {
                let _ = write!(body, "(call $log {at})");
                says = Some((true, read(pointer, length)));
            }
            2 => {
                let _ = write!(body, "(call $text {} {at} {shade})", words(2));
                says = Some((finite(2), read(pointer, length)));
            }
            3 => {
                let _ = write!(body, "(call $point {} {shade})", words(2));
                expected.notes.extend(finite(2).then_some(None));
            }
            4 => {
                let _ = write!(body, "(call $line {} {shade})", words(4));
                expected.notes.extend(finite(4).then_some(None));
            }
            _ => {
                let call = if draw.chance(70) {
                    format!("(call ${} {})", draw.pick(&UNARY), words(1))
                } else {
                    format!("(call ${} {})", draw.pick(&BINARY), words(2))
                };
                // As wheel speeds of the first robot.
                if expected.results < 8 {
                    let _ = write!(
                        body,
                        "(f64.store (i32.const {}) {call})",
                        RESULTS_AT + 8 + 8 * expected.results
                    );
                    expected.results += 1;
                }
            }
        }
        match says {
            Some((shown, Some(text))) => expected.notes.extend(shown.then_some(Some(text))),
            Some((_, None)) => {
                expected.is_outside = true;
                break;
            }
            None => {}
        }
    }
    let flood = if draw.chance(3) {
        format!(
            "(loop $l (call $log (i32.const {}) (i32.const 900)) (br $l))",
            end - PATTERN_BYTES
        )
    } else if draw.chance(5) {
        format!(
            "(loop $l (call $log (i32.const {}) (i32.const 900)) (br_if $l (local.tee $n (i32.sub (local.get $n) (i32.const 1)))))",
            end - PATTERN_BYTES
        )
    } else {
        String::new()
    };
    let result = if draw.chance(8) {
        draw.bits() as i32
    } else {
        RESULTS_AT as i32
    };
    let kind = if draw.chance(5) { number(draw) } else { 3f64.to_bits() };
    let escaped: String = pattern.iter().map(|byte| format!("\\{byte:02x}")).collect();
    let imports: String = UNARY
        .iter()
        .map(|name| format!("(import \"robopheus\" \"{name}\" (func ${name} (param f64) (result f64)))"))
        .chain(
            BINARY
                .iter()
                .map(|name| format!("(import \"robopheus\" \"{name}\" (func ${name} (param f64 f64) (result f64)))")),
        )
        .collect();
    let text = format!(
        "(module (import \"robopheus\" \"log\" (func $log (param i32 i32)))
         (import \"robopheus\" \"text\" (func $text (param f64 f64 i32 i32 i32)))
         (import \"robopheus\" \"point\" (func $point (param f64 f64 i32)))
         (import \"robopheus\" \"line\" (func $line (param f64 f64 f64 f64 i32)))
         {imports} (memory (export \"memory\") {pages}) (data (i32.const {}) \"{escaped}\")
         (func (export \"buffer\") (param i32) (result i32) i32.const {BUFFER_AT})
         (func (export \"step\") (param i32 i32) (result i32) (local $n i32) (local.set $n (i32.const 90))
           (f64.store (i32.const {RESULTS_AT}) {}) {body} {flood} i32.const {result}))",
        end - PATTERN_BYTES,
        float(kind)
    );
    expected.floods = !flood.is_empty();
    expected.tells_results = result == RESULTS_AT as i32;
    (text, expected)
}

/// One random module, asked once.
pub fn case(number: u64, seen: &mut Seen) {
    let mut draw = Draw::new(0x0605_0000_0000 + number);
    let (text, expected) = module(&mut draw);
    let mut program = compile(&wasm(&text), &setup()).unwrap_or_else(|fault| panic!("case {number}: {fault}\n{text}"));
    let mut answer = Answer::default();
    answer.clear(ROBOTS);
    let told = program.step(&view(0), &mut answer);
    let texts: Vec<Option<&str>> = answer
        .notes
        .iter()
        .map(|note| match note {
            Note::Log { text } | Note::Text { text, .. } => Some(text.as_str()),
            _ => None,
        })
        .collect();
    let log_bytes: usize = answer
        .notes
        .iter()
        .map(|note| if let Note::Log { text } = note { text.len() } else { 0 })
        .sum();
    let wanted: Vec<Option<&str>> = expected.notes.iter().map(Option::as_deref).collect();
    let is_wanted = if expected.floods {
        texts.starts_with(&wanted)
    } else {
        texts == wanted
    };
    assert!(is_wanted, "case {number}: {texts:?} is not {wanted:?}\n{text}");
    assert!(
        log_bytes <= LOG_BYTES_PER_TICK && texts.len() <= NOTES_PER_TICK,
        "case {number}"
    );
    seen.most_log_bytes = seen.most_log_bytes.max(log_bytes);
    seen.lines += texts.iter().filter(|text| text.is_some()).count() as u64;
    seen.drawings += texts.iter().filter(|text| text.is_none()).count() as u64;
    match told {
        Ok(_) => {
            assert!(!expected.is_outside, "case {number} reads outside the memory\n{text}");
            seen.answered += 1;
            if expected.tells_results {
                check_numbers(number, &answer, seen);
            }
        }
        Err(fault) => {
            let count = match fault.kind {
                FaultKind::Failed => &mut seen.traps,
                FaultKind::Exhausted => &mut seen.exhausted,
                FaultKind::BadCommand => &mut seen.bad_commands,
                kind => panic!("case {number}: {kind:?} {fault}\n{text}"),
            };
            *count += 1;
            let outside = fault.kind == FaultKind::Failed && fault.reason.contains("outside the memory");
            assert_eq!(outside, expected.is_outside, "case {number}: {fault}\n{text}");
        }
    }
}

/// What is not a number has one pattern, and commands that hold it are refused by the law.
fn check_numbers(case: u64, answer: &Answer, seen: &mut Seen) {
    for (robot, say) in answer.robots.iter().enumerate() {
        let Some(order) = &say.order else { continue };
        if let Motion::Wheels(speeds) = order.motion {
            for speed in speeds.iter().filter(|speed| speed.is_nan()) {
                assert_eq!(speed.to_bits(), 0x7ff8_0000_0000_0000, "case {case}, robot {robot}");
                assert!(order.check(robot).is_err());
                seen.numbers += 1;
            }
        }
    }
}
