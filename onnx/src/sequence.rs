//! A chain of nodes as a file: `[1, n]` in, one node after the other, one row out.

use crate::{
    ATTRIBUTE_FLOAT, Attribute, Dimension, Entry, FLOAT, Graph, Message, Model, Node, OperatorSet, Shape, Tensor,
    TensorType, Type, ValueInfo,
};

/// Operators' version, and the `ir_version` that goes with it.
const OPSET: i64 = 17;
const IR_VERSION: i64 = 8;

/// A file in the making.
#[derive(Debug, Clone)]
pub struct Sequence {
    graph: Graph,
    /// Name of what the last node gives.
    last: String,
}

impl Sequence {
    /// - `input`: its name; `width`: its numbers.
    pub fn new(input: &str, width: usize) -> Sequence {
        let graph = Graph {
            name: "sequence".to_owned(),
            input: vec![row(input, width)],
            ..Graph::default()
        };
        Sequence {
            graph,
            last: input.to_owned(),
        }
    }

    /// A constant of this shape.
    #[must_use]
    pub fn constant(mut self, name: &str, dims: &[usize], numbers: &[f32]) -> Sequence {
        self.graph.initializer.push(Tensor {
            dims: dims.iter().map(|dim| *dim as i64).collect(),
            data_type: FLOAT,
            name: name.to_owned(),
            raw_data: numbers.iter().flat_map(|number| number.to_le_bytes()).collect(),
            ..Tensor::default()
        });
        self
    }

    /// A node that takes what came last, and these after it.
    #[must_use]
    pub fn node(mut self, operator: &str, further: &[&str], floats: &[(&str, f32)]) -> Sequence {
        let output = format!("row_{}", self.graph.node.len());
        let input = std::iter::once(self.last.clone()).chain(further.iter().map(|name| (*name).to_owned()));
        let attribute = floats.iter().map(|(name, f)| Attribute {
            name: (*name).to_owned(),
            f: *f,
            kind: ATTRIBUTE_FLOAT,
            ..Attribute::default()
        });
        self.graph.node.push(Node {
            input: input.collect(),
            output: vec![output.clone()],
            op_type: operator.to_owned(),
            attribute: attribute.collect(),
            ..Node::default()
        });
        self.last = output;
        self
    }

    /// `Gemm` with weights `[inputs, width]`, row by row, and a bias.
    #[must_use]
    pub fn linear(self, weights: &[f32], bias: &[f32]) -> Sequence {
        let (number, width) = (self.graph.node.len(), bias.len().max(1));
        let (weight_name, bias_name) = (format!("weights_{number}"), format!("bias_{number}"));
        self.constant(&weight_name, &[weights.len() / width, width], weights)
            .constant(&bias_name, &[width], bias)
            .node("Gemm", &[&weight_name, &bias_name], &[])
    }

    /// The whole, for changes of its parts.
    ///
    /// - `width`: numbers of the output; `metadata`: key and text.
    pub fn model(mut self, output: &str, width: usize, metadata: &[(&str, &str)]) -> Model {
        if let Some(name) = self.graph.node.last_mut().and_then(|node| node.output.first_mut()) {
            output.clone_into(name);
        }
        self.graph.output = vec![row(output, width)];
        let entry = |(key, value): &(&str, &str)| Entry {
            key: (*key).to_owned(),
            value: (*value).to_owned(),
        };
        Model {
            ir_version: IR_VERSION,
            producer_name: "robopheus".to_owned(),
            graph: Some(self.graph),
            opset_import: vec![OperatorSet {
                domain: String::new(),
                version: OPSET,
            }],
            metadata_props: metadata.iter().map(entry).collect(),
            ..Model::default()
        }
    }

    /// [`Self::model`] as bytes.
    pub fn file(self, output: &str, width: usize, metadata: &[(&str, &str)]) -> Vec<u8> {
        self.model(output, width, metadata).encode_to_vec()
    }
}

/// `[1, width]` of f32.
fn row(name: &str, width: usize) -> ValueInfo {
    let dimension = |size: usize| Dimension {
        dim_value: size as i64,
        ..Dimension::default()
    };
    let tensor_type = TensorType {
        elem_type: FLOAT,
        shape: Some(Shape {
            dim: vec![dimension(1), dimension(width)],
        }),
    };
    ValueInfo {
        name: name.to_owned(),
        kind: Some(Type {
            tensor_type: Some(tensor_type),
        }),
        doc_string: String::new(),
    }
}
