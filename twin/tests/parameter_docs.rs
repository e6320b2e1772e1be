//! `docs/parameters.md` is what the table says. `UPDATE_DOCS=1` writes it anew.

mod support;

use serde_json::{Value, json};
use std::fmt::Write as _;
use std::path::Path;
use support::{car, robot};
use twin::motor_control::MotorController;
use twin::parameter::{Parameter, Practical, Source, TABLE, WhenAbsent, find};
use twin::robot::RobotDescription;

const HEAD: &str = "# Parameters of a robot description

Every number of `run.json` `robot` and of the laboratory's file: what it is called in the equations
([notation.md](notation.md)), where it stands, what is not refused. Written from the table in
`twin/src/parameter/table.rs`, which validation uses too. The reference is the four-wheel-drive reference robot with
the reference cascade. **Bench** is what an identification on a bench typically moves a number by, the size of a
slider's useful travel. **Source** says where the reference value comes from: *design* was chosen, *estimate* is of the size
that such robots have and was not measured; none of them comes from a paper or a data sheet.

| symbol | field | unit | range | when absent | reference | bench | source | meaning |
|---|---|---|---|---|---|---|---|---|
";

const TAIL: &str = "
## Together
Numbers that are each in range are refused together when no robot can have them:
* more than 6 wheels, or a wheel table that does not make the chassis;
* two contact points less than 1 mm apart, unless both are casters;
* a yaw inertia above `m (2 r_b)^2`, all mass on a ring of twice the wheels' bounding radius `r_b`, or below
  `2 m^2 / (9 pi rho h)`, the paraboloid of the densest matter (22 600 kg/m^3) with its centre of mass at the height `h`
  (at least `r_b`);
* a sample rate that neither divides 480 Hz nor is a multiple of it; a window without an encoder or an encoder without
  one; gains of a cascade in a `speed_pi` or missing in a `cascade`; a wanted current above the driver's limit.

## Motor control
`motor.controller` is optional. Without it the wheels have a speed PI at 480 Hz on the exact speed, with the gains in `motor`.
`{\"kind\": \"speed_pi\", ...}` runs that loop at another rate, with delay, encoder and window;
`{\"kind\": \"cascade\", ...}` puts it around a PI on the measured current and does not use the gains in `motor`:
```json
";

fn number(value: f64) -> String {
    if value == 0.0 || (1e-3..1e5).contains(&value.abs()) {
        format!("{value}")
    } else {
        format!("{value:e}")
    }
}

fn row(parameter: &Parameter) -> String {
    let absent = match parameter.when_absent {
        WhenAbsent::Nothing => "none".to_owned(),
        WhenAbsent::Required => "refused".to_owned(),
        WhenAbsent::CasterOnly => "casters only".to_owned(),
        WhenAbsent::Unlimited => "no limit".to_owned(),
        WhenAbsent::NoSensor => "no sensor".to_owned(),
        WhenAbsent::NoEncoder => "exact speed".to_owned(),
        WhenAbsent::With(other) => format!("goes with `{other}`"),
        WhenAbsent::Same(other) => format!("`{other}`"),
    };
    let bench = match parameter.practical {
        Practical::Relative(share) => format!("{} %", number(100.0 * share)),
        Practical::Absolute(size) if parameter.whole => number(size),
        Practical::Absolute(size) => format!("{} {}", number(size), parameter.unit),
        Practical::Exact => "exact".to_owned(),
    };
    let source = match (parameter.reference, parameter.source) {
        (None, _) => "",
        (_, Source::Design) => "design",
        (_, Source::Estimate) => "estimate",
    };
    let symbol = if parameter.symbol.is_empty() {
        String::new()
    } else {
        format!("`{}`", parameter.symbol)
    };
    format!(
        "| {symbol} | `{}` | {} | {} .. {}{} | {absent} | {} | {} | {source} | {} |",
        parameter.path,
        parameter.unit,
        number(parameter.low),
        number(parameter.high),
        if parameter.whole { ", whole" } else { "" },
        parameter.reference.map_or(String::new(), number),
        bench.trim_end(),
        parameter.meaning,
    )
}

fn page() -> String {
    let mut page = HEAD.to_owned();
    for parameter in TABLE {
        let _ = writeln!(page, "{}", row(parameter));
    }
    page.push_str(TAIL);
    page + &serde_json::to_string_pretty(&MotorController::reference_cascade()).expect("JSON") + "\n```\n"
}

#[test]
fn the_page_is_the_table() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/parameters.md");
    if std::env::var_os("UPDATE_DOCS").is_some() {
        std::fs::write(&path, page()).expect("docs/parameters.md");
    }
    let written = std::fs::read_to_string(&path).unwrap_or_default();
    assert!(
        written == page(),
        "docs/parameters.md is not what the table says: run with UPDATE_DOCS=1"
    );
}

/// The robot that the reference column speaks of, with every field it has.
fn reference() -> Value {
    let mut description = twin::golden::reference_robot("awd");
    if let Some(motor) = &mut description.motor {
        motor.controller = Some(MotorController::reference_cascade());
    }
    let file = include_str!("../../examples/robots/awd-sam3x.json");
    let file: Value = serde_json::from_str(file).expect("example");
    let mut value = serde_json::to_value(&description).expect("JSON");
    value["noise"] = file["robot"]["noise"].clone();
    value
}

fn pointer(parameter: &Parameter) -> String {
    format!("/{}", parameter.path.replace("[]", "/0").replace('.', "/"))
}

#[test]
fn the_reference_column_is_the_reference_robot() {
    let reference = reference();
    for parameter in TABLE {
        let value = reference.pointer(&pointer(parameter)).and_then(Value::as_f64);
        assert_eq!(value, parameter.reference, "{}", parameter.path);
    }
}

#[test]
fn every_number_of_a_description_is_in_the_table() {
    fn walk(value: &Value, path: &str, fields: &mut Vec<String>) {
        match value {
            Value::Object(map) => {
                for (key, value) in map {
                    let path = if path.is_empty() {
                        key.clone()
                    } else {
                        format!("{path}.{key}")
                    };
                    walk(value, &path, fields);
                }
            }
            Value::Array(list) => {
                for (i, value) in list.iter().enumerate() {
                    walk(value, &format!("{path}[{i}]"), fields);
                }
            }
            Value::Number(_) => fields.push(path.to_owned()),
            _ => {}
        }
    }
    let mut fields = Vec::new();
    walk(&reference(), "", &mut fields);
    assert!(fields.len() > 40);
    for field in &fields {
        assert!(find(field).is_some(), "{field} has no entry");
    }
    assert_eq!(find("wheels[x].x_m"), None);
    assert_eq!(find("wheels.x_m"), None);
}

fn problems(value: &Value) -> Vec<twin::robot::ParameterError> {
    let description: RobotDescription = serde_json::from_value(value.clone()).expect("description");
    description.check()
}

/// Validation reads its limits from the table: one step beyond is refused by that field, the limit itself is not.
#[test]
fn every_limit_of_the_table_is_enforced() {
    assert!(problems(&reference()).is_empty());
    for parameter in TABLE {
        let step = if parameter.whole {
            1.0
        } else {
            0.01 * (parameter.high - parameter.low)
        };
        for (limit, beyond) in [
            (parameter.low, parameter.low - step),
            (parameter.high, parameter.high + step),
        ] {
            // A count below zero is no document.
            if parameter.whole && beyond < 0.0 {
                continue;
            }
            let set = |number: f64| {
                let mut value = reference();
                if parameter.path.starts_with("tread.") {
                    value["tread"] = serde_json::to_value(twin::tread::Tread::NOMINAL).expect("JSON");
                }
                let number = if parameter.whole {
                    json!(number as i64)
                } else {
                    json!(number)
                };
                // What the reference leaves out.
                match parameter.path {
                    "steering.filter_s" => value["steering"]["filter_s"] = json!(0.0),
                    "accelerometer_lag_s" => value["accelerometer_lag_s"] = json!(0.0),
                    _ => {}
                }
                let place = pointer(parameter);
                match value.pointer_mut(&place) {
                    Some(place) => *place = number,
                    // The wanted current, which the reference leaves out.
                    None => value["motor"]["controller"]["current_limit_a"] = number,
                }
                value
            };
            let field = parameter.path.replace("[]", "[0]");
            let found = problems(&set(beyond));
            let named = found.iter().find(|problem| problem.field == field);
            let Some(problem) = named else {
                panic!("{field} = {beyond}: {found:?}")
            };
            assert_eq!(
                (problem.limit.as_str(), problem.remedy.as_str()),
                (parameter.limit().as_str(), parameter.remedy)
            );
            let at_limit = problems(&set(limit));
            assert!(
                at_limit.iter().all(|problem| problem.limit != parameter.limit()),
                "{field} = {limit}: {at_limit:?}"
            );
        }
    }
}

#[test]
fn entries_are_complete_and_unlike() {
    for (position, parameter) in TABLE.iter().enumerate() {
        assert!(
            TABLE[..position].iter().all(|before| before.path != parameter.path),
            "{}",
            parameter.path
        );
        assert!(!parameter.meaning.is_empty() && !parameter.remedy.is_empty() && parameter.low < parameter.high);
        if let Some(reference) = parameter.reference {
            assert!(parameter.allows(reference), "{}", parameter.path);
            let size = parameter.practical_size(reference);
            assert!(
                size >= 0.0 && size < parameter.high - parameter.low,
                "{}",
                parameter.path
            );
            assert_eq!(
                size == 0.0,
                parameter.practical == Practical::Exact,
                "{}",
                parameter.path
            );
        }
    }
    // The reference robot itself can be made.
    robot(car("awd"));
}
