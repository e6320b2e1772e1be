//! `docs/effects.md` is what the library says. `UPDATE_DOCS=1` writes it anew.

use std::fmt::Write as _;
use std::path::Path;
use twin::effect::library::{EffectEntry, Hook, LIBRARY, Needs, ParameterEntry};
use twin::effect::size::Size;

const HEAD: &str = "# Effects

What a model version may add to the nominal equations: names, parameters, laws and sizes. The table is written from the
library in `twin/src/effect/library.rs`. `index` is the position of a wheel in the robot's `wheels`, from 0. A parameter that
is left out is neutral; an infinite limit is `null` in a document. The practical size is what is worth naming.

";

fn number(value: f64) -> String {
    if value.is_infinite() {
        "inf".to_owned()
    } else if value == 0.0 || (1e-3..1e4).contains(&value.abs()) {
        format!("{}", (value * 1e4).round() / 1e4)
    } else {
        format!("{value:e}")
    }
}

fn size(parameter: &ParameterEntry) -> String {
    let percent = |a: f64, b: f64, of: &str| format!("{} .. {} % of {of}", number(100.0 * a), number(100.0 * b));
    if !parameter.carries_size {
        return "place or shape".to_owned();
    }
    match parameter.size {
        Size::Absolute(a, b) if a == b => "with the others".to_owned(),
        Size::Absolute(a, b) => format!("{} .. {}", number(a), number(b)),
        Size::StallTorque(a, b) => percent(a, b, "stall torque"),
        Size::StallViscous(a, b) => percent(a, b, "stall torque at no-load speed"),
        Size::FullSpeed(a, b) => percent(a, b, "no-load wheel speed"),
        Size::SagResistance(a, b) => percent(a, b, "the supply at full load"),
        Size::Droop(a, b) => percent(a, b, "the supply in 20 s"),
        Size::Mass(a, b) => percent(a, b, "the mass"),
        Size::PerKilogram(a, b) => format!("{} .. {} per kg", number(a), number(b)),
        Size::SideFriction(a, b) => percent(a, b, "the floor's friction"),
    }
}

fn of(entry: &EffectEntry) -> &'static str {
    match (entry.indexed, entry.needs) {
        (true, Needs::Motor) => "one driven wheel",
        (true, _) => "one wheel",
        (false, Needs::Nothing) => "any robot",
        (false, Needs::Motor) => "robots with motors",
        (false, Needs::Steering) => "robots with steering",
        (false, Needs::OmniWheel) => "robots with omni wheels",
        (false, Needs::StandardWheel) => "robots with standard wheels",
        (false, Needs::Caster) => "robots with casters",
    }
}

fn page() -> String {
    let mut page = HEAD.to_owned();
    for (hook, title) in [
        (Hook::Command, "Commands"),
        (Hook::Actuator, "Actuators"),
        (Hook::Contact, "Wheel and floor"),
        (Hook::Body, "Body"),
        (Hook::Sensor, "Sensors"),
    ] {
        let _ = writeln!(
            page,
            "## {title}\n\n| effect | of | parameter (unit) | neutral | range | practical .. large | law | shown by |\n|---|---|---|---|---|---|---|---|"
        );
        for entry in LIBRARY.iter().filter(|entry| entry.hook == hook) {
            for (row, parameter) in entry.parameters.iter().enumerate() {
                let first = row == 0;
                let _ = writeln!(
                    page,
                    "| {} | {} | `{}` ({}) | {} | {} .. {} | {} | {} | {} |",
                    if first {
                        format!("`{}`", entry.name)
                    } else {
                        String::new()
                    },
                    if first { of(entry) } else { "" },
                    parameter.name,
                    parameter.unit,
                    number(parameter.neutral),
                    number(parameter.low),
                    number(parameter.high),
                    size(parameter),
                    if first {
                        entry.law.replace('|', "\\|")
                    } else {
                        String::new()
                    },
                    if first { entry.excitation } else { "" },
                );
            }
        }
        page.push('\n');
    }
    page.trim_end().to_owned() + "\n"
}

#[test]
fn the_page_is_the_table() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/effects.md");
    if std::env::var_os("UPDATE_DOCS").is_some() {
        std::fs::write(&path, page()).expect("docs/effects.md");
    }
    let written = std::fs::read_to_string(&path).unwrap_or_default();
    assert!(
        written == page(),
        "docs/effects.md is not what the library says: run with UPDATE_DOCS=1"
    );
}

#[test]
fn names_are_unique_and_neutral_values_allowed() {
    for (position, entry) in LIBRARY.iter().enumerate() {
        assert!(
            LIBRARY[..position].iter().all(|before| before.name != entry.name),
            "{}",
            entry.name
        );
        assert!(
            entry.parameters.iter().any(|parameter| parameter.carries_size),
            "{}",
            entry.name
        );
        for parameter in entry.parameters {
            assert!(
                (parameter.low..=parameter.high).contains(&parameter.neutral),
                "{} {}",
                entry.name,
                parameter.name
            );
            assert!(parameter.name != "index");
        }
    }
}
