//! A residual as ONNX: one graph with normalisation, network, limits and fade inside.
//!
//! Opset 17, f32, operators of the default domain only: Max, Min, Sub, Div, Gemm, Tanh, Softsign, Mul, Relu, ReduceProd.
//! Input `state` `[batch, inputs]`: the document's inputs in their order and units. Output `acceleration` `[batch,
//! outputs]`: m/s^2 and rad/s^2 in the document's order. Names, units, validity and where the numbers came from stand in
//! `metadata_props`.

pub use onnx as proto;

use prost::Message;
use serde_json::{Value, json};
use twin::model_document::ModelDocument;
use twin::residual::{Activation, INPUTS, Input, OUTPUTS, ResidualDocument, SHIFTS};

use onnx::{
    Attribute, Dimension, Entry, FLOAT, Graph, INT, INTS, Model, Node, OperatorSet, Shape, Tensor, TensorType, Type,
    ValueInfo,
};

/// Version of the operators.
pub const OPSET: i64 = 17;
/// `ir_version` that goes with it.
const IR_VERSION: i64 = 8;
/// Names of the graph's input and output.
pub const INPUT: &str = "state";
pub const OUTPUT: &str = "acceleration";

/// Why there is no ONNX file.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum OnnxError {
    #[error("the model carries no learned residual")]
    NoResidual,
    #[error("not an ONNX file of this program: {0}")]
    Unreadable(String),
}

/// Bytes of the ONNX file of a model's residual.
///
/// - Errors: a model without one.
pub fn export(model: &ModelDocument) -> Result<Vec<u8>, OnnxError> {
    let residual = model.residual.as_ref().ok_or(OnnxError::NoResidual)?;
    let file = Model {
        ir_version: IR_VERSION,
        producer_name: "robopheus-learn".to_owned(),
        producer_version: env!("CARGO_PKG_VERSION").to_owned(),
        doc_string: "Residual accelerations of the robot's body, to be added to those of its physical model."
            .to_owned(),
        graph: Some(graph(residual)),
        opset_import: vec![OperatorSet {
            domain: String::new(),
            version: OPSET,
        }],
        metadata_props: metadata(model, residual),
    };
    Ok(file.encode_to_vec())
}

/// The file's parts, for checks.
///
/// - Errors: bytes that are no ONNX model.
pub fn parse(bytes: &[u8]) -> Result<Model, OnnxError> {
    Model::decode(bytes).map_err(|error| OnnxError::Unreadable(error.to_string()))
}

/// Name of an input with wheel and look back, as in `metadata_props`.
pub fn input_name(input: &Input) -> String {
    let mut name = input.name.clone();
    if let Some(wheel) = input.wheel {
        // As the columns of run bundles are named: wheel_0_rad_per_s, command_wheel_0_rad_per_s.
        name = match name.find("wheel_") {
            Some(at) => format!("{}wheel_{wheel}_{}", &name[..at], &name[at + 6..]),
            None => format!("{name}_{wheel}"),
        };
    }
    if input.ticks_ago > 0 {
        name.push_str(&format!("_{}_ticks_ago", input.ticks_ago));
    }
    name
}

fn unit_of(input: &Input) -> &'static str {
    INPUTS
        .iter()
        .find(|entry| entry.name == input.name)
        .map_or("", |entry| entry.unit)
}

fn metadata(model: &ModelDocument, residual: &ResidualDocument) -> Vec<Entry> {
    let inputs: Vec<Value> = residual
        .inputs
        .iter()
        .map(|input| {
            json!({"name": input_name(input), "unit": unit_of(input), "ticks_ago": input.ticks_ago,
                   "low": input.low, "high": input.high})
        })
        .collect();
    let outputs: Vec<Value> = residual
        .outputs
        .iter()
        .map(|output| {
            let unit = OUTPUTS
                .iter()
                .chain(&SHIFTS)
                .find(|(name, ..)| *name == output.name)
                .map_or("", |(_, unit, _)| *unit);
            json!({"name": output.name, "unit": unit, "limit": output.limit})
        })
        .collect();
    let rows = [
        ("format", "robopheus.residual-onnx/1".to_owned()),
        ("model_id", model.id.clone()),
        ("robot", model.robot.name.clone()),
        ("chassis", model.robot.chassis.clone()),
        ("floor", model.floor.clone()),
        ("inputs", Value::from(inputs).to_string()),
        ("outputs", Value::from(outputs).to_string()),
        ("validity_fade", residual.fade.to_string()),
        ("sample_time_s", (1.0 / f64::from(twin::CONTROL_RATE_HZ)).to_string()),
        ("opset", OPSET.to_string()),
        ("library_version", env!("CARGO_PKG_VERSION").to_owned()),
        ("data", model.provenance.get("data").unwrap_or(&Value::Null).to_string()),
    ];
    rows.into_iter()
        .map(|(key, value)| Entry {
            key: key.to_owned(),
            value,
        })
        .collect()
}

#[derive(Default)]
struct Builder {
    nodes: Vec<Node>,
    constants: Vec<Tensor>,
}

impl Builder {
    fn constant(&mut self, name: &str, dims: &[usize], values: impl Iterator<Item = f64>) -> String {
        self.constants.push(Tensor {
            dims: dims.iter().map(|size| *size as i64).collect(),
            data_type: FLOAT,
            name: name.to_owned(),
            raw_data: values.flat_map(|value| (value as f32).to_le_bytes()).collect(),
            ..Tensor::default()
        });
        name.to_owned()
    }

    /// One node with one output, whose name it returns.
    fn node(&mut self, operator: &str, inputs: &[&str], output: &str, attribute: Vec<Attribute>) -> String {
        self.nodes.push(Node {
            input: inputs.iter().map(|name| (*name).to_owned()).collect(),
            output: vec![output.to_owned()],
            name: output.to_owned(),
            op_type: operator.to_owned(),
            attribute,
            ..Node::default()
        });
        output.to_owned()
    }
}

fn graph(residual: &ResidualDocument) -> Graph {
    let mut b = Builder::default();
    let inputs = &residual.inputs;
    let row = [1, inputs.len()];
    let low = b.constant("low", &row, inputs.iter().map(|input| input.low));
    let high = b.constant("high", &row, inputs.iter().map(|input| input.high));
    let mean = b.constant("mean", &row, inputs.iter().map(|input| input.mean));
    let scale = b.constant("scale", &row, inputs.iter().map(|input| input.scale));
    let above = b.node("Max", &[INPUT, &low], "above_low", Vec::new());
    let inside = b.node("Min", &[&above, &high], "inside", Vec::new());
    let centred = b.node("Sub", &[&inside, &mean], "centred", Vec::new());
    let mut units = b.node("Div", &[&centred, &scale], "normalised", Vec::new());
    let mut width = inputs.len();
    for (number, layer) in residual.layers.iter().enumerate() {
        let count = layer.bias.len();
        let weights = b.constant(
            &format!("weights_{number}"),
            &[count, width],
            layer.weights.iter().copied(),
        );
        let bias = b.constant(&format!("bias_{number}"), &[count], layer.bias.iter().copied());
        let transposed = Attribute {
            name: "transB".to_owned(),
            i: 1,
            kind: INT,
            ..Attribute::default()
        };
        units = b.node(
            "Gemm",
            &[&units, &weights, &bias],
            &format!("sum_{number}"),
            vec![transposed],
        );
        let activation = match layer.activation {
            Activation::Linear => None,
            Activation::Tanh => Some("Tanh"),
            Activation::Softsign => Some("Softsign"),
        };
        if let Some(operator) = activation {
            units = b.node(operator, &[&units], &format!("layer_{number}"), Vec::new());
        }
        width = count;
    }
    let outputs = &residual.outputs;
    let row = [1, outputs.len()];
    let gain = b.constant("output_scale", &row, outputs.iter().map(|output| output.scale));
    let least = b.constant("output_low", &row, outputs.iter().map(|output| -output.limit));
    let most = b.constant("output_high", &row, outputs.iter().map(|output| output.limit));
    let scaled = b.node("Mul", &[&units, &gain], "scaled", Vec::new());
    let bounded = b.node("Max", &[&scaled, &least], "bounded_below", Vec::new());
    let bounded = b.node("Min", &[&bounded, &most], "bounded", Vec::new());
    let fade = fade(&mut b, residual, &low, &high);
    b.node("Mul", &[&bounded, &fade], OUTPUT, Vec::new());
    let columns: Vec<String> = inputs
        .iter()
        .map(|input| format!("{} ({})", input_name(input), unit_of(input)))
        .collect();
    let names: Vec<String> = outputs.iter().map(|output| output.name.clone()).collect();
    Graph {
        node: b.nodes,
        name: "residual".to_owned(),
        initializer: b.constants,
        doc_string: String::new(),
        input: vec![value(INPUT, inputs.len(), columns.join(", "))],
        output: vec![value(OUTPUT, outputs.len(), names.join(", "))],
    }
}

/// Product over the inputs of 1 - e^2 (3 - 2 e), e = min(1, distance from the range / its fade).
fn fade(b: &mut Builder, residual: &ResidualDocument, low: &str, high: &str) -> String {
    let inputs = &residual.inputs;
    let widths = inputs.iter().map(|input| residual.fade * (input.high - input.low));
    let width = b.constant("fade_width", &[1, inputs.len()], widths);
    let one = b.constant("one", &[1, 1], [1.0].into_iter());
    let two = b.constant("two", &[1, 1], [2.0].into_iter());
    let three = b.constant("three", &[1, 1], [3.0].into_iter());
    let below = b.node("Sub", &[low, INPUT], "below_low", Vec::new());
    let beyond = b.node("Sub", &[INPUT, high], "beyond_high", Vec::new());
    let outside = b.node("Max", &[&below, &beyond], "signed_distance", Vec::new());
    let outside = b.node("Relu", &[&outside], "distance", Vec::new());
    let share = b.node("Div", &[&outside, &width], "distance_share", Vec::new());
    let share = b.node("Min", &[&share, &one], "e", Vec::new());
    let double = b.node("Mul", &[&share, &two], "e_twice", Vec::new());
    let rest = b.node("Sub", &[&three, &double], "three_less_e_twice", Vec::new());
    let square = b.node("Mul", &[&share, &share], "e_square", Vec::new());
    let lost = b.node("Mul", &[&square, &rest], "lost", Vec::new());
    let kept = b.node("Sub", &[&one, &lost], "kept", Vec::new());
    let axes = Attribute {
        name: "axes".to_owned(),
        ints: vec![1],
        kind: INTS,
        ..Attribute::default()
    };
    let keep = Attribute {
        name: "keepdims".to_owned(),
        i: 1,
        kind: INT,
        ..Attribute::default()
    };
    b.node("ReduceProd", &[&kept], "fade", vec![axes, keep])
}

fn value(name: &str, width: usize, doc_string: String) -> ValueInfo {
    let batch = Dimension {
        dim_param: "batch".to_owned(),
        ..Dimension::default()
    };
    let columns = Dimension {
        dim_value: width as i64,
        ..Dimension::default()
    };
    ValueInfo {
        name: name.to_owned(),
        kind: Some(Type {
            tensor_type: Some(TensorType {
                elem_type: FLOAT,
                shape: Some(Shape {
                    dim: vec![batch, columns],
                }),
            }),
        }),
        doc_string,
    }
}
