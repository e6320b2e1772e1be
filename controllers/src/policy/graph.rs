//! The graph of an ONNX file, read: constants, nodes with their attributes, shapes that are known.

use std::collections::HashMap;

use onnx::{EXTERNAL, FLOAT, Graph, INT64, Model, Node, Tensor, ValueInfo};

use crate::limits::POLICY_NODES;

/// Names of the network's input and output.
pub const INPUT: &str = "observation";
pub const OUTPUT: &str = "command";
/// Versions of the operators whose meaning is the one here.
const OPSETS: std::ops::RangeInclusive<i64> = 13..=23;

/// A tensor of numbers.
#[derive(Debug, Clone, PartialEq)]
pub struct Constant {
    pub dims: Vec<usize>,
    pub numbers: Vec<f32>,
}

impl Constant {
    /// Its numbers when it is a row: at most its last dimension is more than one.
    pub fn row(&self, name: &str) -> Result<&[f32], String> {
        let leading = self.dims.split_last().map_or(&[][..], |(_, leading)| leading);
        if leading.iter().any(|dim| *dim != 1) {
            return Err(format!(
                "`{name}` has the shape {:?}, where a row of numbers is needed",
                self.dims
            ));
        }
        Ok(&self.numbers)
    }

    /// Its only number.
    pub fn single(&self, name: &str) -> Result<f32, String> {
        match self.numbers.as_slice() {
            [number] => Ok(*number),
            _ => Err(format!(
                "`{name}` has the shape {:?}, where one number is needed",
                self.dims
            )),
        }
    }
}

/// Checks the frame of a model and returns its graph.
pub fn of(model: &Model) -> Result<&Graph, String> {
    let graph = model.graph.as_ref().ok_or("it has no graph")?;
    for set in &model.opset_import {
        let (domain, version) = (&set.domain, set.version);
        if !domain.is_empty() && domain != "ai.onnx" {
            return Err(format!(
                "it needs operators of `{domain}`; those of standard ONNX are known"
            ));
        }
        if !OPSETS.contains(&version) {
            let (least, most) = (OPSETS.start(), OPSETS.end());
            return Err(format!(
                "it has opset {version}; export it with one from {least} to {most}"
            ));
        }
    }
    if graph.node.len() > POLICY_NODES {
        return Err(format!(
            "its graph has {} nodes; {POLICY_NODES} are allowed",
            graph.node.len()
        ));
    }
    Ok(graph)
}

/// Width of the input: `[1, n]`, the name as it must be.
pub fn width_of_input(graph: &Graph) -> Result<usize, String> {
    // Older exporters list constants among the inputs.
    let constants: Vec<&str> = graph.initializer.iter().map(|tensor| tensor.name.as_str()).collect();
    let inputs: Vec<&ValueInfo> = graph
        .input
        .iter()
        .filter(|input| !constants.contains(&input.name.as_str()))
        .collect();
    let [input] = inputs.as_slice() else {
        return Err(format!("it has {} inputs; one, `{INPUT}`, is known", inputs.len()));
    };
    named(input, INPUT, "input")?;
    let tensor = input.kind.as_ref().and_then(|kind| kind.tensor_type.as_ref());
    let tensor = tensor.ok_or("its input is no tensor")?;
    if tensor.elem_type != FLOAT {
        return Err(format!(
            "its input has the element type {}; float32 is known",
            tensor.elem_type
        ));
    }
    let dims = tensor.shape.as_ref().map_or(&[][..], |shape| shape.dim.as_slice());
    let [batch, width] = dims else {
        return Err(format!(
            "its input has {} dimensions; `[1, numbers]` is known",
            dims.len()
        ));
    };
    // A batch may have any size: one is asked for.
    if batch.dim_value > 1 {
        return Err(format!(
            "its input takes {} observations at once; export it for one",
            batch.dim_value
        ));
    }
    if width.dim_value < 1 {
        return Err("how many numbers its input takes is left open; export it with a fixed width".to_owned());
    }
    usize::try_from(width.dim_value).map_err(|_| "its input is too wide".to_owned())
}

/// The output's name as it must be.
pub fn check_output(graph: &Graph) -> Result<(), String> {
    let [output] = graph.output.as_slice() else {
        return Err(format!(
            "it has {} outputs; one, `{OUTPUT}`, is known",
            graph.output.len()
        ));
    };
    named(output, OUTPUT, "output")
}

fn named(value: &ValueInfo, wanted: &str, what: &str) -> Result<(), String> {
    if value.name == wanted {
        return Ok(());
    }
    Err(format!("its {what} is called `{}`; it must be `{wanted}`", value.name))
}

/// Constants by name: initialisers, and those that nodes give.
pub fn constants(graph: &Graph) -> Result<HashMap<String, Constant>, String> {
    let mut all = HashMap::new();
    for tensor in &graph.initializer {
        all.insert(tensor.name.clone(), constant(tensor, &tensor.name)?);
    }
    for node in graph.node.iter().filter(|node| node.op_type == "Constant") {
        let name = node.output.first().cloned().unwrap_or_default();
        let tensor = node.attribute.iter().find(|attribute| attribute.name == "value");
        let tensor = tensor.and_then(|attribute| attribute.t.as_ref());
        let tensor = tensor.ok_or_else(|| format!("the constant `{name}` is no tensor"))?;
        let read = constant(tensor, &name)?;
        all.insert(name, read);
    }
    Ok(all)
}

fn constant(tensor: &Tensor, name: &str) -> Result<Constant, String> {
    if tensor.data_location == EXTERNAL {
        return Err(format!(
            "the numbers of `{name}` stand in another file; save them inside"
        ));
    }
    let dims = tensor.dims.iter().map(|dim| usize::try_from(*dim).ok());
    let dims: Vec<usize> = dims
        .collect::<Option<_>>()
        .ok_or_else(|| format!("`{name}` has a negative dimension"))?;
    if dims.contains(&0) {
        return Err(format!("`{name}` has the shape {dims:?}, which holds nothing"));
    }
    let numbers: Vec<f32> = match tensor.data_type {
        FLOAT if !tensor.raw_data.is_empty() => {
            let words = tensor.raw_data.as_chunks::<4>().0;
            words.iter().map(|word| f32::from_le_bytes(*word)).collect()
        }
        FLOAT => tensor.float_data.clone(),
        INT64 if !tensor.raw_data.is_empty() => {
            let words = tensor.raw_data.as_chunks::<8>().0;
            words.iter().map(|word| i64::from_le_bytes(*word) as f32).collect()
        }
        INT64 => tensor.int64_data.iter().map(|number| *number as f32).collect(),
        other => return Err(format!("`{name}` has the element type {other}; float32 is known")),
    };
    let wanted = dims.iter().try_fold(1_usize, |product, dim| product.checked_mul(*dim));
    if wanted != Some(numbers.len()) {
        return Err(format!(
            "`{name}` has {} numbers, its shape {dims:?} asks for others",
            numbers.len()
        ));
    }
    if numbers.iter().any(|number| !number.is_finite()) {
        return Err(format!("`{name}` holds a number that is not finite"));
    }
    Ok(Constant { dims, numbers })
}

/// A number among a node's attributes.
pub fn float(node: &Node, name: &str, otherwise: f32) -> f32 {
    let found = node.attribute.iter().find(|attribute| attribute.name == name);
    found.map_or(otherwise, |attribute| attribute.f)
}

/// A whole number among a node's attributes.
pub fn integer(node: &Node, name: &str, otherwise: i64) -> i64 {
    let found = node.attribute.iter().find(|attribute| attribute.name == name);
    found.map_or(otherwise, |attribute| attribute.i)
}
