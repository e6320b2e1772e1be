//! Rehearsals with model versions: the twin takes them, the laws do not, and nonsense is refused.

mod common;

use control::rehearsal::{Outcome, rehearse_json};
use serde_json::{Value, json};
use twin::effect::Effect;
use twin::model_document::ModelDocument;

fn document(scenario: &Value, effects: Vec<Effect>) -> ModelDocument {
    let robot = serde_json::from_value(scenario["robots"][0]["description"].clone()).expect("a description");
    ModelDocument::new(None, robot, "lab-floor", effects, Value::Null)
}

fn rehearsed(scenario: &Value) -> Outcome {
    rehearse_json(&scenario.to_string()).unwrap_or_else(|problems| panic!("{problems:#?}"))
}

#[test]
fn a_model_changes_the_digest_and_a_neutral_one_changes_no_bit() {
    let nominal = common::example("rectangle-omni4");
    let mut neutral = nominal.clone();
    neutral["models"] = json!({"omni-01": document(&nominal, Vec::new())});
    let mut slippery = nominal.clone();
    let effect = Effect::new("floor_friction", &[("scale", 0.2)]);
    slippery["models"] = json!({"omni-01": document(&nominal, vec![effect])});
    let digests = [&nominal, &neutral, &slippery, &slippery].map(|scenario| rehearsed(scenario).verdict.digest);
    assert_eq!(digests[0], digests[1]);
    assert_ne!(digests[0], digests[2]);
    assert_eq!(digests[2], digests[3]);
}

#[test]
fn a_model_of_another_chassis_is_refused_by_name() {
    let mut scenario = common::example("rectangle-omni4");
    let other = document(&common::example("rectangle-diff2"), Vec::new());
    scenario["models"] = json!({"omni-01": other});
    let Err(problems) = rehearse_json(&scenario.to_string()) else {
        panic!("rehearsed")
    };
    assert_eq!(problems[0].field, "models.omni-01");
    assert!(!problems[0].limit.is_empty() && !problems[0].remedy.is_empty());
}
