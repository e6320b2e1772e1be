//! What a script may use, for people and for editors that complete words: name, form, one line of help. A test holds each
//! form to the engine.

/// Where a word may stand.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Of {
    /// A word of the language.
    Language,
    /// A function, anywhere.
    Function,
    /// Behind `now.`
    Now,
    /// Behind a robot and a dot.
    Robot,
    /// Behind a target and a dot.
    Target,
    /// Behind an array, a map or a text and a dot.
    Collection,
}

/// One word.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Word {
    pub name: &'static str,
    /// How it is written.
    pub form: &'static str,
    /// What it does, in one line.
    pub help: &'static str,
    pub of: Of,
}

const fn word(of: Of, name: &'static str, form: &'static str, help: &'static str) -> Word {
    Word { name, form, help, of }
}

/// All words, those that drive robots first.
pub const WORDS: &[Word] = &[
    word(
        Of::Function,
        "velocity",
        "velocity(i, x, y)",
        "robot i moves with this velocity in the world, m/s; any chassis",
    ),
    word(
        Of::Function,
        "velocity",
        "velocity(i, x, y, yaw)",
        "the same, with this heading, rad",
    ),
    word(
        Of::Function,
        "twist",
        "twist(i, forward, left, yaw_rate)",
        "robot i moves with this body twist, m/s and rad/s",
    ),
    word(
        Of::Function,
        "wheels",
        "wheels(i, speeds)",
        "speeds of robot i's wheels, an array in rad/s",
    ),
    word(
        Of::Function,
        "wheels",
        "wheels(i, speeds, steering)",
        "the same, with a steering angle, rad",
    ),
    word(Of::Function, "stop", "stop(i)", "robot i stands still"),
    word(
        Of::Function,
        "finished",
        "finished(i)",
        "robot i is done; the run ends when all are for a second",
    ),
    word(
        Of::Function,
        "target",
        "target(i, x, y)",
        "shows where robot i is going; moves nothing",
    ),
    word(
        Of::Function,
        "parameter",
        "parameter(name, otherwise)",
        "a number of the experiment, and what it is when none is given",
    ),
    word(
        Of::Function,
        "parameter",
        "parameter(name)",
        "a number that the experiment must give",
    ),
    word(
        Of::Function,
        "print",
        "print(value)",
        "a line in the log; `x is ${x}` puts values into a text",
    ),
    word(
        Of::Function,
        "point",
        "point(x, y, colour)",
        "a dot on the floor, m; colours 0 to 7",
    ),
    word(
        Of::Function,
        "line",
        "line(x, y, x2, y2, colour)",
        "a line on the floor, m; colours 0 to 7",
    ),
    word(
        Of::Function,
        "text",
        "text(x, y, words, colour)",
        "words on the floor, m; colours 0 to 7",
    ),
    word(Of::Function, "sin", "sin(x)", "sine of an angle in rad"),
    word(Of::Function, "cos", "cos(x)", "cosine of an angle in rad"),
    word(Of::Function, "tan", "tan(x)", "tangent of an angle in rad"),
    word(Of::Function, "asin", "asin(c)", "angle with this sine, rad"),
    word(Of::Function, "acos", "acos(c)", "angle with this cosine, rad"),
    word(Of::Function, "atan", "atan(x)", "angle with this tangent, rad"),
    word(
        Of::Function,
        "atan2",
        "atan2(y, x)",
        "angle of the direction (x, y), rad",
    ),
    word(Of::Function, "hypot", "hypot(x, y)", "length of (x, y)"),
    word(Of::Function, "sqrt", "sqrt(c)", "square root"),
    word(Of::Function, "pow", "pow(x, y)", "x to the power of y"),
    word(Of::Function, "exp", "exp(x)", "e to the power of x"),
    word(Of::Function, "ln", "ln(c)", "natural logarithm"),
    word(Of::Function, "log", "log(c)", "logarithm to base 10"),
    word(Of::Function, "floor", "floor(x)", "largest whole number below"),
    word(Of::Function, "ceiling", "ceiling(x)", "smallest whole number above"),
    word(Of::Function, "round", "round(x)", "nearest whole number"),
    word(Of::Function, "abs", "abs(x)", "the value without its sign"),
    word(Of::Function, "min", "min(x, y)", "the smaller one"),
    word(Of::Function, "max", "max(x, y)", "the larger one"),
    word(
        Of::Function,
        "clamp",
        "clamp(x, low, high)",
        "x, but not below low and not above high",
    ),
    word(Of::Function, "wrap", "wrap(x)", "the angle between -PI and PI"),
    word(Of::Function, "PI", "PI()", "the number pi, 3.14159"),
    word(
        Of::Now,
        "robots",
        "now.robots",
        "all robots, in the order of the experiment",
    ),
    word(Of::Now, "robot", "now.robot(i)", "robot i, counted from 0"),
    word(Of::Now, "count", "now.count", "number of robots"),
    word(Of::Now, "time_s", "now.time_s", "seconds since the run began"),
    word(Of::Now, "tick", "now.tick", "ticks since the run began, 120 a second"),
    word(Of::Now, "period_s", "now.period_s", "length of a tick, s"),
    word(Of::Now, "arena_width_m", "now.arena_width_m", "the floor along x, m"),
    word(Of::Now, "arena_height_m", "now.arena_height_m", "the floor along y, m"),
    word(Of::Robot, "index", "robot.index", "its number, for commands"),
    word(Of::Robot, "x_m", "robot.x_m", "where it is, x to the right"),
    word(Of::Robot, "y_m", "robot.y_m", "where it is, y up"),
    word(Of::Robot, "yaw_rad", "robot.yaw_rad", "its heading, counter-clockwise"),
    word(Of::Robot, "targets", "robot.targets", "its targets, an array"),
    word(
        Of::Robot,
        "neighbours",
        "robot.neighbours(radius)",
        "robots closer than this, m, nearest first",
    ),
    word(
        Of::Robot,
        "ranges_m",
        "robot.ranges_m",
        "eight beams, counter-clockwise from straight ahead; 2 m when free",
    ),
    word(
        Of::Robot,
        "forward_m_per_s",
        "robot.forward_m_per_s",
        "its speed straight ahead",
    ),
    word(Of::Robot, "left_m_per_s", "robot.left_m_per_s", "its speed to the left"),
    word(
        Of::Robot,
        "yaw_rate_rad_per_s",
        "robot.yaw_rate_rad_per_s",
        "how fast it turns, counter-clockwise",
    ),
    word(Of::Robot, "radius_m", "robot.radius_m", "circle around its body"),
    word(
        Of::Robot,
        "turning_radius_m",
        "robot.turning_radius_m",
        "its smallest arc; 0 when it turns on the spot",
    ),
    word(
        Of::Robot,
        "drive",
        "robot.drive",
        "\"holonomic\", \"turn_in_place\" or \"steered\"",
    ),
    word(Of::Robot, "name", "robot.name", "its name"),
    word(Of::Robot, "online", "robot.online", "whether its link works"),
    word(
        Of::Robot,
        "age_s",
        "robot.age_s",
        "age of its pose; negative of one that is predicted",
    ),
    word(Of::Target, "x_m", "goal.x_m", "where the target is, x to the right"),
    word(Of::Target, "y_m", "goal.y_m", "where the target is, y up"),
    word(Of::Target, "yaw_rad", "goal.yaw_rad", "its heading; () when free"),
    word(Of::Collection, "len", "speeds.len()", "number of values"),
    word(Of::Collection, "is_empty", "speeds.is_empty()", "whether there is none"),
    word(Of::Collection, "push", "speeds.push(x)", "one more value at the end"),
    word(Of::Collection, "remove", "speeds.remove(0)", "takes a value out"),
    word(
        Of::Collection,
        "contains",
        "speeds.contains(x)",
        "whether a value is there",
    ),
    word(
        Of::Language,
        "fn",
        "fn step(now) { }",
        "a function; step is called in each tick",
    ),
    word(Of::Language, "let", "let k = x;", "a variable"),
    word(Of::Language, "const", "const K = 2;", "a value that stays"),
    word(Of::Language, "if", "if x < y { }", "carried out when it is so"),
    word(
        Of::Language,
        "else",
        "if x < y { } else { }",
        "carried out when it is not so",
    ),
    word(Of::Language, "for", "for k in 0..3 { }", "once for each value"),
    word(Of::Language, "in", "for one in speeds { }", "once for each value"),
    word(
        Of::Language,
        "while",
        "while x > y { x -= 1.0; }",
        "as long as it is so",
    ),
    word(Of::Language, "loop", "loop { break; }", "until break"),
    word(Of::Language, "break", "loop { break; }", "ends a loop"),
    word(
        Of::Language,
        "continue",
        "for k in 0..3 { continue; }",
        "on with the next value",
    ),
    word(
        Of::Language,
        "switch",
        "switch i { 0 => (), _ => () }",
        "one of several",
    ),
    word(Of::Language, "return", "if x > 1e9 { return; }", "ends a function"),
    word(Of::Language, "this", "this.memory = x;", "a map that lasts for the run"),
    word(Of::Language, "true", "let k = true;", "it is so"),
    word(Of::Language, "false", "let k = false;", "it is not so"),
];

/// Whether a word belongs to the language.
pub fn is_keyword(name: &str) -> bool {
    WORDS.iter().any(|word| word.of == Of::Language && word.name == name)
}

/// Whether a word is a function that scripts may call.
pub fn is_function(name: &str) -> bool {
    WORDS.iter().any(|word| word.of == Of::Function && word.name == name)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::rehearse_json;
    use crate::gallery::scenario_json;
    use crate::source::Source;

    /// A script that uses one form in its first tick.
    fn script(form: &str) -> String {
        let inside = if form.starts_with("fn step") { "" } else { form };
        format!(
            "fn step(now) {{
                let robot = now.robot(0); let goal = robot.targets[0];
                let i = 0; let x = 0.1; let y = 0.2; let c = 0.5; let yaw = 0.3; let steering = 0.0; let speeds = [0.0, 0.0, 0.0, 0.0];
                let forward = 0.1; let left = 0.0; let yaw_rate = 0.0; let name = \"k\"; let otherwise = 1; let value = 7;
                let x2 = 0.3; let y2 = 0.4; let colour = 3; let words = \"w\"; let low = 0; let high = 1; let radius = 1.0;
                {inside};
                for k in 0..now.count {{ stop(k); finished(k); }}
            }}"
        )
    }

    #[test]
    fn every_form_is_one_that_the_engine_knows() {
        for word in WORDS {
            // This one must be given by the experiment, and it is not.
            if word.form == "parameter(name)" {
                continue;
            }
            let scenario = scenario_json(&Source::Script(script(word.form)), 0.5);
            let outcome = rehearse_json(&scenario).unwrap_or_else(|problems| panic!("{}: {problems:#?}", word.form));
            let faults: Vec<_> = outcome
                .verdict
                .findings
                .iter()
                .filter(|f| f.code == "controller_fault")
                .collect();
            assert!(faults.is_empty(), "{}: {faults:?}", word.form);
        }
        let unknown = rehearse_json(&scenario_json(&Source::Script(script("no_such_word(x)")), 0.5));
        assert!(unknown.is_ok_and(|outcome| !outcome.verdict.accepted));
    }

    #[test]
    fn forms_hold_their_names_and_help_is_one_short_line() {
        for word in WORDS {
            assert!(word.form.contains(word.name), "{word:?}");
            assert!(
                word.help.len() <= 72 && !word.help.ends_with('.'),
                "{}: {}",
                word.name,
                word.help.len()
            );
        }
    }
}
