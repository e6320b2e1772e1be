//! Model versions as documents.

mod support;

use support::{diff2, omni4};
use twin::effect::Effect;
use twin::model_document::{FORMAT, ModelDocument, ModelError};

fn document() -> ModelDocument {
    let effects = vec![
        Effect::new("floor_friction", &[("scale", 0.45)]),
        Effect::new("wheel_radius_one", &[("relative", 0.01)]).at(2),
        Effect::new("body_speed_saturation", &[("forward", 0.6)]),
    ];
    let provenance = serde_json::json!({"data": [], "split": {}, "library_version": "test"});
    ModelDocument::new(None, omni4(), "lab-floor", effects, provenance)
}

#[test]
fn a_document_comes_back_as_it_was() {
    let written = serde_json::to_string_pretty(&document()).expect("JSON");
    let read = ModelDocument::parse(&written).expect("a model");
    assert_eq!(read, document());
    assert_eq!(read.id.len(), 64);
    assert_eq!(read.robot().expect("a robot").effects().len(), 3);
}

#[test]
fn the_order_of_keys_and_white_space_do_not_count() {
    let text = serde_json::to_string(&document()).expect("JSON");
    let value: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    let object = value.as_object().expect("an object");
    let turned: Vec<String> = object
        .iter()
        .rev()
        .map(|(key, value)| format!("{key:?} :  {value}"))
        .collect();
    let turned = format!("{{ {} }}", turned.join(" , "));
    assert_eq!(ModelDocument::parse(&turned).expect("a model").id, document().id);
}

#[test]
fn a_changed_document_is_refused() {
    let mut changed = document();
    changed.floor = "another".to_owned();
    let text = serde_json::to_string(&changed).expect("JSON");
    assert!(matches!(ModelDocument::parse(&text), Err(ModelError::Id { .. })));
    changed.id = String::new();
    let draft = serde_json::to_string(&changed).expect("JSON");
    assert_eq!(ModelDocument::parse(&draft).expect("a draft").id, changed.expected_id());
}

#[test]
fn a_document_says_what_is_wrong_with_it() {
    assert!(matches!(ModelDocument::parse("{}"), Err(ModelError::Json(_))));
    let mut other = document();
    other.format = "robopheus.model/2".to_owned();
    let text = serde_json::to_string(&other).expect("JSON");
    let error = ModelDocument::parse(&text).expect_err("another format").to_string();
    assert!(error.contains("robopheus.model/2") && error.contains(FORMAT), "{error}");
    let drag = vec![Effect::new("roller_drag", &[("per_wheel", 1.0)])];
    let wrong = ModelDocument::new(None, diff2(), "lab-floor", drag, serde_json::Value::Null);
    let text = serde_json::to_string(&wrong).expect("JSON");
    let error = ModelDocument::parse(&text).expect_err("no omni wheel").to_string();
    assert!(error.starts_with("effects[0].name"), "{error}");
}

fn page() -> String {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/model-document.md");
    std::fs::read_to_string(path).expect("docs/model-document.md")
}

#[test]
fn the_example_of_the_document_is_a_model() {
    let page = page();
    let (_, rest) = page.split_once("```json\n").expect("an example");
    let (example, _) = rest.split_once("```").expect("its end");
    let model = ModelDocument::parse(example).expect("a model");
    assert_eq!(model.id, model.expected_id());
    let robot = model.robot().expect("a robot");
    let residual = robot.residual().expect("a residual");
    assert!(!residual.document().is_neutral());
    // Every field of the formats is explained.
    let value = serde_json::to_value(&model).expect("JSON");
    let explained = |field: &str| page.contains(&format!("`{field}`"));
    for field in value.as_object().expect("an object").keys() {
        assert!(explained(field), "{field}");
    }
    for list in ["inputs", "layers", "outputs"] {
        for field in value["residual"][list][0].as_object().expect("an object").keys() {
            assert!(
                explained(field) || explained(&format!("{list}[].{field}")),
                "{list}[].{field}"
            );
        }
    }
}

#[test]
fn the_document_lists_the_inputs_and_limits_of_the_code() {
    use twin::residual::{AXES, INPUTS, MAX_LAYERS, MAX_TICKS_AGO, MAX_UNITS, OUTPUTS, SHIFTS};
    let page = page();
    for entry in INPUTS {
        let row = page
            .lines()
            .find(|line| line.starts_with(&format!("| `{}` | {} |", entry.name, entry.unit)));
        assert!(
            row.is_some_and(|row| row.ends_with(&format!("| {} |", entry.meaning))),
            "{}",
            entry.name
        );
    }
    for (name, unit, largest) in OUTPUTS.into_iter().chain(SHIFTS) {
        assert!(
            page.contains(&format!("`{name}`")) && page.contains(&format!("{largest} {unit}")),
            "{name}"
        );
    }
    let most_weights = (MAX_LAYERS - 1) * MAX_UNITS * MAX_UNITS + AXES * MAX_UNITS;
    assert_eq!(most_weights, 12_672);
    assert!(page.contains("12 672 weights"));
    assert!(page.contains(&format!("1 to {MAX_LAYERS} layers of 1 to {MAX_UNITS} units")));
    assert!(page.contains(&format!("0 to {MAX_TICKS_AGO} |")));
}
