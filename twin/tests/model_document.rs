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
