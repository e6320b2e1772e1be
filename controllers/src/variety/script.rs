//! Varied scripts: functions of numbers, arrays, maps, texts, closures, loops, state in `this`, drawings.

use super::Draw;

/// Floating numbers that an expression of `step` may name.
const NAMES: [&str; 8] = ["t", "x", "y", "yaw", "a", "b", "sum", "phase"];
const ONE: [&str; 14] = [
    "sin(E)",
    "cos(E)",
    "tan(E)",
    "atan(E)",
    "tanh(E)",
    "sqrt(abs(E))",
    "exp(clamp(E, -4.0, 2.0))",
    "ln(1.0 + abs(E))",
    "asin(clamp(E, -1.0, 1.0))",
    "acos(clamp(E, -1.0, 1.0))",
    "floor(E)",
    "round(E)",
    "fraction(E)",
    "cbrt(E)",
];
const TWO: [&str; 13] = [
    "(E + E)",
    "(E - E)",
    "(E * E)",
    "(E / E)",
    "(E % E)",
    "atan2(E, E)",
    "hypot(E, E)",
    "min(E, E)",
    "max(E, E)",
    "pow(abs(E), clamp(E, -2.0, 2.0))",
    "helper(E, E)",
    "(if E < E { wrap(E) } else { sinh(clamp(E, -3.0, 3.0)) })",
    "to_float(to_int(clamp(E, -1e6, 1e6)) % 7)",
];

/// Parts that a script may have at its beginning, those with the same number at the place in `start` and in `step`.
const PARTS: [(&str, &str); 9] = [
    (
        "this.trail = [0.5];",
        "this.trail.push(E); if this.trail.len() > 16 { this.trail.remove(0); }
    for value in this.trail { sum += tame(value) * 0.1; }",
    ),
    (
        "this.table = #{}; for robot in now.robots { this.table[robot.name] = E; }",
        "for key in this.table.keys() { this.table[key] = tame(this.table[key] + E); sum += this.table[key] * 0.1; }",
    ),
    (
        "this.n = 7;",
        "for k in 0..9 { this.n = (this.n * 37 + 11 + k) % 1009; sum += (to_float(this.n ^ 21) / 1009.0 - 0.5) * 0.1; }",
    ),
    (
        "this.word = \"\";",
        "this.word += `${now.tick % 10}`; if this.word.len() > 40 { this.word = this.word.sub_string(20); }
    sum += to_float(this.word.len()) / 100.0; if this.word.contains(\"89\") { sum += 0.05; }",
    ),
    (
        "this.rows = [[1.0, 0.5], [-0.25, 2.0]];",
        "for row in this.rows { for value in row { sum += tame(value * E) * 0.05; } } this.rows[now.tick % 2][1] = tame(E);",
    ),
    (
        "this.mode = 0;",
        "switch this.mode { 0 => { sum += 0.1; } 1 => { sum -= tame(E) * 0.1; } _ => { sum *= 0.5; } }
    if now.tick % 20 == 19 { this.mode = (this.mode + 1) % 3; }",
    ),
    (
        "this.scale = |v| tame(v) * 0.3;",
        "let values = [E, E, E, E].map(|v| tame(v) * 0.2).filter(|v| v > -0.9); values.sort(); values.reverse();
    sum += values.reduce(|all, v| all + v, 0.0); sum += this.scale.call(sum);",
    ),
    (
        "this.errors = 0;",
        "try { let none = [1.0][now.tick % 3]; sum += none * 0.1; } catch { this.errors += 1; sum -= 0.05; }
    sum += to_float(this.errors) / 1000.0;",
    ),
    (
        "this.last = 0.3;",
        "let k = 0; while k < 12 { k += 1; this.last = 3.7 * this.last * (1.0 - this.last); if k == 9 { break; } }
    sum += this.last * 0.1;",
    ),
];

/// What a robot is told; the first for any, the last for robots with four wheels.
const ORDERS: [&str; 4] = [
    "velocity(i, S * cos(phase) + a, S * sin(phase) + b);",
    "velocity(i, S * cos(phase) + a, S * sin(phase) + b, wrap(phase));",
    "twist(i, S + a, b, 0.6 * sin(phase));",
    "if robot.drive == \"holonomic\" { wheels(i, [3.0 + a, 2.0 + b, 2.0 - b, 3.0 - a]); } else { twist(i, S, 0, a * 3.0); }",
];

const SAYS: [&str; 6] = [
    "if now.tick % 30 == i { print(`robot ${robot.name} at ${x} ${y}, sum ${sum}`); }",
    "point(x, y, i);",
    "line(x, y, x + a, y + b, now.tick % 8);",
    "text(x, y, robot.drive + \" \" + i, 3); target(i, x + a, y + b);",
    "for other in robot.neighbours(1.5) { line(x, y, other.x_m, other.y_m, 2); a += 0.01; }",
    "a += robot.ranges_m[now.tick % 8] * 0.02; for goal in robot.targets { b += tame(goal.x_m - x) * 0.02; }",
];

/// Script number `number`: 0 to [`super::COUNT`] - 1, or any other seed.
pub fn script(number: u64) -> String {
    let mut draw = Draw::new(0x7363_7269_7074 ^ (number << 20));
    let draw = &mut draw;
    let mut chosen: Vec<_> = (0..1 + draw.below(3)).map(|_| *draw.pick(&PARTS)).collect();
    chosen.sort_unstable();
    chosen.dedup();
    let mut text = format!("// Script {number} of many.\nfn start(now) {{\n    this.phase = [];\n");
    for _ in 0..3 {
        let phase = draw.hundredths(-314, 314);
        text.push_str(&format!("    this.phase.push({phase:.2});\n"));
    }
    for (start, _) in &chosen {
        text.push_str(&format!("    {}\n", filled(start, draw, 1, &[])));
    }
    let helper = filled("E", draw, 3, &["u", "v"]).replace("helper(", "hypot(");
    text.push_str(&format!(
        "}}\n\nfn helper(u, v) {{\n    {helper}\n}}\n\nfn tame(v) {{\n    let v = to_float(v);\n    if is_finite(v) {{ clamp(v, -1.0, 1.0) }} else {{ 0.1 }}\n}}\n\n"
    ));
    text.push_str("fn step(now) {\n    let t = now.time_s;\n    let sum = 0.0;\n");
    for (_, step) in &chosen {
        text.push_str(&format!("    {}\n", filled(step, draw, 2, &["t", "sum"])));
    }
    text.push_str(
        "    for robot in now.robots {\n        let i = robot.index;\n        let x = robot.x_m;\n        let y = robot.y_m;\n        let yaw = robot.yaw_rad;\n",
    );
    let rate = draw.hundredths(-150, 150);
    text.push_str(&format!("        let phase = this.phase[i] + {rate:.2} * t;\n"));
    let (small, smaller) = (draw.hundredths(2, 12), draw.hundredths(2, 12));
    let a = filled("E", draw, 4, &["t", "x", "y", "yaw", "sum", "phase"]);
    text.push_str(&format!("        let a = tame({a}) * {small:.2};\n"));
    let b = filled("E", draw, 4, &NAMES.map(|name| if name == "b" { "a" } else { name }));
    text.push_str(&format!("        let b = tame({b} + sum) * {smaller:.2};\n"));
    for says in SAYS {
        if draw.chance(30) {
            text.push_str(&format!("        {says}\n"));
        }
    }
    let speed = format!("{:.2}", draw.hundredths(12, 30));
    let order = draw.pick(&ORDERS).replace('S', &speed);
    text.push_str(&format!("        {order}\n    }}\n}}\n"));
    text
}

/// The text with an expression of numbers in the place of every `E`.
fn filled(text: &str, draw: &mut Draw, depth: u32, names: &[&str]) -> String {
    let mut parts = text.split('E');
    let mut whole = parts.next().unwrap_or_default().to_owned();
    for part in parts {
        whole.push_str(&expression(draw, depth, names));
        whole.push_str(part);
    }
    whole
}

fn expression(draw: &mut Draw, depth: u32, names: &[&str]) -> String {
    if depth == 0 || draw.chance(15) {
        if names.is_empty() || draw.chance(35) {
            return format!("{:.2}", draw.hundredths(-300, 300));
        }
        return (*draw.pick(names)).to_owned();
    }
    let form = if draw.chance(45) {
        *draw.pick(&ONE)
    } else {
        *draw.pick(&TWO)
    };
    filled(form, draw, depth - 1, names)
}
