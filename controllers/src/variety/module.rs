//! Varied modules: arithmetic of all three number types, branches, loops, memory, calls, and the host's functions.

use super::Draw;
use super::code::*;

/// Host functions in the order of their imports: name and number of its type among [`types`].
const IMPORTS: [(&str, u8); 17] = [
    ("log", 0),
    ("point", 1),
    ("line", 2),
    ("text", 3),
    ("sin", 4),
    ("cos", 4),
    ("tan", 4),
    ("asin", 4),
    ("acos", 4),
    ("atan", 4),
    ("exp", 4),
    ("ln", 4),
    ("tanh", 4),
    ("wrap", 4),
    ("atan2", 5),
    ("hypot", 5),
    ("pow", 5),
];
const FIRST_UNARY: u32 = 4;
const FIRST_BINARY: u32 = 14;
const OF_NUMBERS: u32 = 5;
/// Functions of the module behind the imports; those before `MIX` take and give floating numbers.
const HELPERS: u32 = 17;
const HELPER_COUNT: u32 = 3;
const MIX: u32 = HELPERS + HELPER_COUNT;
const DESCEND: u32 = MIX + 1;
const TAME: u32 = DESCEND + 1;
const BUFFER: u32 = TAME + 1;
const STEP: u32 = BUFFER + 1;

/// Places in the memory; the commands are at 0.
const TEXT_AT: i32 = 1024;
const SCRATCH_AT: u32 = 2048;
/// Bytes of it, a power of two.
const SCRATCH_BYTES: i32 = 2048;
const VIEW_AT: i32 = 8192;
const TEXT: &[u8; 24] = b"one of a hundred modules";

/// What an expression may read: locals of each type, and how many of the helpers it may call.
struct Names {
    f64s: &'static [u32],
    i64s: &'static [u32],
    helpers: u32,
}

/// Module number `number`: 0 to [`super::COUNT`] - 1, or any other seed.
pub fn module(number: u64) -> Vec<u8> {
    let mut draw = Draw::new(0x6d6f_6475_6c65 ^ (number << 20));
    let draw = &mut draw;
    let mut bodies: Vec<Vec<u8>> = (0..HELPER_COUNT).map(|helper| helper_body(draw, helper)).collect();
    bodies.extend([mix(draw), descend(draw), tame(draw)]);
    let mut buffer = Code::default();
    buffer.i32(VIEW_AT);
    bodies.extend([buffer.body(&[]), step(draw)]);
    let import = |(name, kind): &(&str, u8)| [sized(b"robopheus"), sized(name.as_bytes()), vec![0, *kind]].concat();
    let export = |name: &str, kind: u8, index: u32| {
        let mut bytes = [sized(name.as_bytes()), vec![kind]].concat();
        unsigned(&mut bytes, index);
        bytes
    };
    let global = |kind: u8, value: Code| [vec![kind, 1], value.constant()].concat();
    let (mut whole, mut floating, mut zero, mut text_at) = <(Code, Code, Code, Code)>::default();
    whole.i64(draw.bits() as i64);
    floating.f64(draw.hundredths(-100, 100));
    zero.i32(0);
    text_at.i32(TEXT_AT);
    let helpers: Vec<Vec<u8>> = (HELPERS..MIX).map(|index| vec![index as u8]).collect();
    assembled(&[
        (1, list(&types())),
        (2, list(&IMPORTS.iter().map(import).collect::<Vec<_>>())),
        (3, list(&[5, 5, 5, 6, 7, 4, 8, 9].map(|kind| vec![kind]))),
        (4, list(&[vec![0x70, 0, HELPER_COUNT as u8]])),
        (5, list(&[vec![0, 2]])),
        (6, list(&[global(F64, floating), global(I64, whole)])),
        (
            7,
            list(&[
                export("memory", 2, 0),
                export("buffer", 0, BUFFER),
                export("step", 0, STEP),
            ]),
        ),
        (9, list(&[[vec![0], zero.constant(), list(&helpers)].concat()])),
        (10, list(&bodies)),
        (11, list(&[[vec![0], text_at.constant(), sized(TEXT)].concat()])),
    ])
}

fn types() -> [Vec<u8>; 10] {
    [
        function_type(&[I32, I32], &[]),
        function_type(&[F64, F64, I32], &[]),
        function_type(&[F64, F64, F64, F64, I32], &[]),
        function_type(&[F64, F64, I32, I32, I32], &[]),
        function_type(&[F64], &[F64]),
        function_type(&[F64, F64], &[F64]),
        function_type(&[I64, I64], &[I64]),
        function_type(&[I32, F64], &[F64]),
        function_type(&[I32], &[I32]),
        function_type(&[I32, I32], &[I32]),
    ]
}

/// Adds instructions that leave one floating number.
fn f64_of(code: &mut Code, draw: &mut Draw, depth: u32, names: &Names) {
    if depth == 0 || draw.chance(12) {
        match draw.below(5) {
            0 => code.f64(draw.hundredths(-300, 300)),
            1 => code.get_global(0),
            _ => code.get(*draw.pick(names.f64s)),
        };
        return;
    }
    let next = depth - 1;
    match draw.below(9) {
        // add, sub, mul, div, min, max, copysign
        0..3 => {
            f64_of(code, draw, next, names);
            f64_of(code, draw, next, names);
            code.op(0xa0 + draw.below(7) as u8);
        }
        // abs, neg, ceil, floor, trunc, nearest, sqrt: also of negative numbers
        3 => {
            f64_of(code, draw, next, names);
            code.op(0x99 + draw.below(7) as u8);
        }
        4 => {
            f64_of(code, draw, next, names);
            code.call(FIRST_UNARY + draw.below(10) as u32);
        }
        5 => {
            f64_of(code, draw, next, names);
            f64_of(code, draw, next, names);
            let own = names.helpers > 0 && draw.chance(60);
            code.call(if own {
                HELPERS + draw.below(names.helpers.into()) as u32
            } else {
                FIRST_BINARY + draw.below(3) as u32
            });
        }
        // Through single precision, from whole numbers with and without sign.
        6 => {
            f64_of(code, draw, next, names);
            code.ops(&[0xb6, 0xbb]);
        }
        7 => {
            i64_of(code, draw, next, names);
            code.op(*draw.pick(&[0xb9, 0xba])).f64(1e-18).op(F64_MUL);
        }
        _ => {
            f64_of(code, draw, next, names);
            f64_of(code, draw, next, names);
            f64_of(code, draw, next, names);
            // lt, gt, le, ge of the last with a constant choose between the others.
            code.f64(draw.hundredths(-100, 100)).op(F64_LT + draw.below(4) as u8);
            code.op(SELECT);
        }
    }
}

/// Adds instructions that leave one whole number of 64 bits.
fn i64_of(code: &mut Code, draw: &mut Draw, depth: u32, names: &Names) {
    if depth == 0 || draw.chance(12) {
        match draw.below(4) {
            0 => code.i64((draw.bits() >> draw.below(64)) as i64),
            1 => code.get_global(1),
            _ => code.get(*draw.pick(names.i64s)),
        };
        return;
    }
    let next = depth - 1;
    match draw.below(7) {
        // add, sub, mul, and, or, xor, shl, shr_s, shr_u, rotl, rotr
        0..3 => {
            i64_of(code, draw, next, names);
            i64_of(code, draw, next, names);
            code.op(*draw.pick(&[0x7c, 0x7d, 0x7e, 0x83, 0x84, 0x85, 0x86, 0x87, 0x88, 0x89, 0x8a]));
        }
        // div_u, rem_s, rem_u by an odd number
        3 => {
            i64_of(code, draw, next, names);
            i64_of(code, draw, next, names);
            code.i64(1).op(0x84).op(*draw.pick(&[0x80, 0x81, 0x82]));
        }
        // clz, ctz, popcnt, extend of 8, 16, 32 bits
        4 => {
            i64_of(code, draw, next, names);
            code.op(*draw.pick(&[0x79, 0x7a, 0x7b, 0xc2, 0xc3, 0xc4]));
        }
        // The bits of a floating number, which may be no number; or cut to a whole number.
        5 => {
            f64_of(code, draw, next, names);
            code.ops(draw.pick::<&[u8]>(&[&[0xbd], &[0xfc, 6], &[0xfc, 7]]));
        }
        // Through 32 bits: add, sub, mul, and, or, xor, shl, shr_s, shr_u, rotl, rotr.
        _ => {
            i64_of(code, draw, next, names);
            code.op(0xa7);
            code.i32(draw.bits() as i32)
                .op(*draw.pick(&[0x6a, 0x6b, 0x6c, 0x71, 0x72, 0x73, 0x74, 0x75, 0x76, 0x77, 0x78]));
            code.op(*draw.pick(&[0xac, 0xad]));
        }
    }
}

fn helper_body(draw: &mut Draw, helper: u32) -> Vec<u8> {
    let names = Names {
        f64s: &[0, 1],
        i64s: &[2],
        helpers: helper,
    };
    let mut code = Code::default();
    i64_of(&mut code, draw, 2, &names);
    code.set(2);
    f64_of(&mut code, draw, 3, &names);
    code.body(&[(1, I64)])
}

fn mix(draw: &mut Draw) -> Vec<u8> {
    let names = Names {
        f64s: &[2],
        i64s: &[0, 1],
        helpers: 0,
    };
    let mut code = Code::default();
    f64_of(&mut code, draw, 2, &names);
    code.set(2);
    i64_of(&mut code, draw, 4, &names);
    code.body(&[(1, F64)])
}

/// Calls itself as often as its first parameter says.
fn descend(draw: &mut Draw) -> Vec<u8> {
    let mut code = Code::default();
    code.get(0).op(I32_EQZ).begin(IF, F64).get(1).op(ELSE);
    code.get(0).i32(1).op(I32_SUB);
    code.get(1).f64(draw.hundredths(30, 95)).op(F64_MUL);
    code.f64(draw.hundredths(-50, 50)).op(F64_ADD);
    code.call(DESCEND).op(END);
    code.body(&[])
}

/// Any number to one within 0.1 of zero; what is no number to 0.05.
fn tame(draw: &mut Draw) -> Vec<u8> {
    let mut code = Code::default();
    code.get(0).f64(draw.hundredths(5, 30)).op(F64_MUL);
    code.f64(-0.1).op(F64_MAX).f64(0.1).op(F64_MIN);
    code.f64(0.05).get(0).op(F64_ABS).f64(1e9).op(F64_LT).op(SELECT);
    code.body(&[])
}

// Locals of `step` behind its two parameters: robot, its place in the view, its command; pose, time and two results; two whole
// numbers; a counter.
const ROBOT: u32 = 2;
const AT: u32 = 3;
const OUT: u32 = 4;
const X: u32 = 5;
const Y: u32 = 6;
const YAW: u32 = 7;
const TIME: u32 = 8;
const A: u32 = 9;
const B: u32 = 10;
const M: u32 = 11;
const N: u32 = 12;
const COUNTER: u32 = 13;

fn step(draw: &mut Draw) -> Vec<u8> {
    let names = Names {
        f64s: &[X, Y, YAW, TIME, A, B],
        i64s: &[M, N],
        helpers: HELPER_COUNT,
    };
    let mut code = Code::default();
    let code = &mut code;
    code.get(0).load_f64(16).set(TIME).get_global(1).set(M);
    code.get(0).get(0).load_f64(64).ops(&[0xfc, 2]).i32(8);
    code.op(I32_MUL).op(I32_ADD).set(AT);
    code.begin(BLOCK, NOTHING).begin(LOOP, NOTHING);
    // Until all robots have their commands.
    code.get(ROBOT)
        .get(0)
        .load_f64(24)
        .ops(&[0xfc, 2])
        .op(I32_GE_U)
        .br_if(1);
    code.get(AT).load_f64(0).set(X).get(AT).load_f64(8).set(Y);
    code.get(AT).load_f64(16 + 8 * draw.below(4) as u32).set(YAW);
    i64_of(code, draw, 3, &names);
    code.get(M).call(MIX).set(N);
    f64_of(code, draw, 4, &names);
    code.set(A);
    inner_loop(code, draw, &names);
    f64_of(code, draw, 4, &names);
    code.get(A);
    code.get(N).op(0xa7).i32(HELPER_COUNT as i32).op(I32_REM_U);
    code.call_chosen(OF_NUMBERS).set(B);
    code.get(B).call(TAME).set_global(0).get(N).set_global(1);
    says(code, draw);
    orders(code, draw);
    for (local, step) in [(ROBOT, 1), (AT, 192), (OUT, 128)] {
        code.get(local).i32(step).op(I32_ADD).set(local);
    }
    code.br(0).op(END).op(END).i32(0);
    let code = std::mem::take(code);
    code.body(&[(3, I32), (6, F64), (2, I64), (1, I32)])
}

/// A few rounds through the scratch memory.
fn inner_loop(code: &mut Code, draw: &mut Draw, names: &Names) {
    let place = |code: &mut Code, local: u32| {
        code.get(local).op(0xa7).i32((SCRATCH_BYTES - 1) & !7).op(I32_AND);
    };
    code.i32(2 + draw.below(10) as i32).set(COUNTER).begin(LOOP, NOTHING);
    place(code, N);
    f64_of(code, draw, 2, names);
    code.store_f64(SCRATCH_AT);
    place(code, M);
    code.get(N).store_i64(SCRATCH_AT);
    place(code, M);
    code.load_f64(SCRATCH_AT + 8).set(B);
    i64_of(code, draw, 2, names);
    place(code, N);
    code.load_i64(SCRATCH_AT).call(MIX).set(N);
    if draw.chance(50) {
        // memory.copy or memory.fill of a part of it
        code.i32(SCRATCH_AT as i32 + draw.below(900) as i32);
        code.i32(SCRATCH_AT as i32 + draw.below(900) as i32)
            .i32(draw.below(900) as i32);
        code.ops(draw.pick::<&[u8]>(&[&[0xfc, 0x0a, 0, 0], &[0xfc, 0x0b, 0]]));
    }
    code.i32(draw.below(40) as i32).get(A).call(DESCEND).set(A);
    code.get(COUNTER)
        .i32(1)
        .op(I32_SUB)
        .set(COUNTER)
        .get(COUNTER)
        .br_if(0)
        .op(END);
}

/// Log line and drawings.
fn says(code: &mut Code, draw: &mut Draw) {
    if draw.chance(40) {
        code.i32(TEXT_AT).i32(draw.below(25) as i32).call(0);
    }
    if draw.chance(40) {
        code.get(X).get(Y).get(COUNTER).call(1);
    }
    if draw.chance(30) {
        code.get(X).get(Y).f64(draw.hundredths(-100, 100)).get(X).i32(3).call(2);
    }
    if draw.chance(30) {
        code.get(X)
            .get(Y)
            .i32(TEXT_AT)
            .i32(draw.below(25) as i32)
            .i32(1)
            .call(3);
    }
}

/// A twist or a velocity that is never zero for long and holds what was computed.
fn orders(code: &mut Code, draw: &mut Draw) {
    let kind = if draw.chance(50) { 1.0 } else { 2.0 };
    code.get(OUT).f64(kind).store_f64(0);
    let speed_m_per_s = draw.hundredths(15, 30);
    for (word, function, value) in [(8, FIRST_UNARY + 1, A), (16, FIRST_UNARY, B)] {
        code.get(OUT).get(value).call(TAME);
        code.get(TIME).f64(draw.hundredths(-80, 80)).op(F64_MUL).call(function);
        code.f64(speed_m_per_s).op(F64_MUL).op(F64_ADD).store_f64(word);
    }
    code.get(OUT)
        .get(B)
        .call(TAME)
        .f64(draw.hundredths(-300, 300))
        .op(F64_MUL);
    code.store_f64(24);
}
