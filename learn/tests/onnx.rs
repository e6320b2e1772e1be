//! The exported file: its shape, and its values in ONNX Runtime.

#[path = "support/logs.rs"]
#[allow(dead_code)]
mod logs;

use learn::onnx::{OPSET, export, input_name, parse};
use learn::runtime::{Runtime, RuntimeError, check};
use logs::{description, truth};
use twin::golden::{reference_residual, reference_robot};
use twin::model_document::ModelDocument;
use twin::residual::ResidualDocument;

fn model(residual: ResidualDocument) -> ModelDocument {
    let provenance = serde_json::json!({"data": [{"path": "a", "sha256": "00"}]});
    ModelDocument::new(None, description(), "hall", Vec::new(), provenance).with_residual(residual)
}

/// All inputs, activations and outputs of an omni robot.
fn everything() -> ModelDocument {
    let robot = reference_robot("omni4");
    let residual = reference_residual(&robot);
    ModelDocument::new(None, robot, "hall", Vec::new(), serde_json::Value::Null).with_residual(residual)
}

#[test]
fn operators_are_standard_and_the_metadata_say_what_is_what() {
    let everything = everything();
    let bytes = export(&everything).unwrap();
    let file = parse(&bytes).unwrap();
    assert_eq!((file.opset_import.len(), file.opset_import[0].version), (1, OPSET));
    assert_eq!(file.opset_import[0].domain, "");
    let graph = file.graph.as_ref().unwrap();
    let standard = [
        "Max",
        "Min",
        "Sub",
        "Div",
        "Gemm",
        "Tanh",
        "Softsign",
        "Mul",
        "Relu",
        "ReduceProd",
    ];
    assert!(graph.node.iter().all(|node| standard.contains(&node.op_type.as_str())));
    assert_eq!(
        (graph.input[0].name.as_str(), graph.output[0].name.as_str()),
        ("state", "acceleration")
    );
    let get = |key: &str| {
        file.metadata_props
            .iter()
            .find(|entry| entry.key == key)
            .map(|entry| entry.value.as_str())
    };
    assert_eq!(get("robot"), Some(everything.robot.name.as_str()));
    assert_eq!(get("model_id"), Some(everything.id.as_str()));
    let inputs: Vec<serde_json::Value> = serde_json::from_str(get("inputs").unwrap()).unwrap();
    assert_eq!(inputs.len(), everything.residual.as_ref().unwrap().inputs.len());
    assert_eq!(inputs[0]["unit"], "m");
    assert!(get("sample_time_s").unwrap().parse::<f64>().unwrap() == 1.0 / 120.0);
    assert!(parse(b"not a model").is_err());
}

#[test]
fn wheels_are_named_as_in_run_bundles() {
    let input = twin::residual::Input::new("command_wheel_rad_per_s", -1.0, 1.0)
        .at(2)
        .ago(6);
    assert_eq!(input_name(&input), "command_wheel_2_rad_per_s_6_ticks_ago");
}

/// Shapes stand as one varint after the other, each with its tag: proto2, not packed.
#[test]
fn shapes_are_not_packed() {
    let tensor = learn::onnx::proto::Tensor {
        dims: vec![3, 300],
        ..Default::default()
    };
    let bytes = prost::Message::encode_to_vec(&tensor);
    assert_eq!(bytes, [0x08, 3, 0x08, 0xac, 0x02]);
}

#[test]
fn a_model_without_a_residual_has_no_file() {
    let model = ModelDocument::new(None, description(), "hall", Vec::new(), serde_json::Value::Null);
    assert!(export(&model).is_err());
}

#[test]
fn an_absent_library_is_an_error_and_no_panic() {
    let folder = std::env::temp_dir();
    let absent = folder.join("no-such-libonnxruntime.so");
    assert!(matches!(Runtime::load_from(&absent), Err(RuntimeError::Library { .. })));
}

#[test]
fn onnx_runtime_gives_the_values_of_the_twin() {
    let runtime = match Runtime::load() {
        Ok(runtime) => runtime,
        Err(problem @ RuntimeError::Absent { .. }) => {
            println!("skipped: {problem}");
            return;
        }
        Err(problem) => panic!("{problem}"),
    };
    for model in [everything(), model(truth(-2.0, 1.5))] {
        let bytes = export(&model).unwrap();
        let found = check(&runtime, &model, &bytes).unwrap();
        assert!(found.agrees, "{found:?}");
        // Another model's file does not agree.
        let mut other = model.residual.clone().unwrap();
        other.outputs[0].scale *= 1.001;
        let other = ModelDocument::with_residual(model.clone(), other);
        let found = check(&runtime, &other, &bytes).unwrap();
        assert!(!found.agrees, "{found:?}");
    }
    assert!(runtime.session(b"nonsense").is_err());
}
