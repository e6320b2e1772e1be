//! A feed-forward network, evaluated node by node in f32. Sums are taken in f64 in the order of the inputs and rounded once;
//! curves are `libm`'s: the same bits on every machine, within 1e-5 of ONNX Runtime's.

use std::collections::HashMap;

use onnx::{Graph, Model, Node};

use super::graph::{self, Constant, INPUT, OUTPUT};
use crate::limits::{CURVE_OPERATIONS, POLICY_WIDTH};

/// Operators that are known.
pub const OPERATORS: [&str; 24] = [
    "Abs",
    "Add",
    "Clip",
    "Concat",
    "Constant",
    "Div",
    "Elu",
    "Exp",
    "Flatten",
    "Gemm",
    "Identity",
    "LeakyRelu",
    "MatMul",
    "Max",
    "Min",
    "Mul",
    "Neg",
    "Relu",
    "Sigmoid",
    "Softplus",
    "Softsign",
    "Sqrt",
    "Sub",
    "Tanh",
];

/// Place of a row of numbers.
type Slot = usize;

#[derive(Debug, Clone)]
enum Step {
    /// `to[j] = sum_i from[i] weights[i * width + j] + bias[j]`
    Linear {
        from: Slot,
        weights: Vec<f32>,
        bias: Vec<f32>,
        to: Slot,
    },
    /// A row and another, or one number for all.
    Two {
        with: fn(f32, f32) -> f32,
        left: Slot,
        right: Slot,
        to: Slot,
    },
    One {
        with: Curve,
        from: Slot,
        to: Slot,
    },
    Concat {
        from: Vec<Slot>,
        to: Slot,
    },
}

/// What is done to every number of a row.
#[derive(Debug, Clone, Copy)]
enum Curve {
    Plain(fn(f32) -> f32),
    LeakyRelu(f32),
    Elu(f32),
    Clip(f32, f32),
}

impl Curve {
    fn at(self, x: f32) -> f32 {
        match self {
            Curve::Plain(curve) => curve(x),
            Curve::LeakyRelu(slope) => {
                if x < 0.0 {
                    slope * x
                } else {
                    x
                }
            }
            Curve::Elu(alpha) => {
                if x < 0.0 {
                    alpha * libm::expm1f(x)
                } else {
                    x
                }
            }
            Curve::Clip(least, most) => -largest(-largest(x, least), -most),
        }
    }
}

/// Not those of the standard library: which zero they give, and what becomes of a NaN, is left to the machine there.
fn largest(a: f32, b: f32) -> f32 {
    if a < b { b } else { a }
}

fn positive(x: f32) -> f32 {
    if x < 0.0 { 0.0 } else { x }
}

/// See the module.
#[derive(Debug, Clone)]
pub struct Network {
    rows: Vec<Vec<f32>>,
    /// Of the linear part that is worked on.
    sums: Vec<f64>,
    steps: Vec<Step>,
    input: Slot,
    output: Slot,
    operations: u64,
}

impl Network {
    /// Reads a model's graph.
    ///
    /// - Errors: the first thing that is not known, in words.
    pub fn new(model: &Model) -> Result<Network, String> {
        let graph = graph::of(model)?;
        let width = graph::width_of_input(graph)?;
        graph::check_output(graph)?;
        let mut reader = Reader {
            constants: graph::constants(graph)?,
            slots: HashMap::new(),
            rows: Vec::new(),
            steps: Vec::new(),
            operations: 0,
        };
        let input = reader.row(INPUT, width)?;
        reader.read(graph)?;
        let output = reader
            .slots
            .get(OUTPUT)
            .copied()
            .ok_or_else(|| format!("no node gives `{OUTPUT}`"))?;
        Ok(Network {
            rows: reader.rows,
            sums: Vec::new(),
            steps: reader.steps,
            input,
            output,
            operations: reader.operations,
        })
    }

    /// Numbers that it takes.
    pub fn inputs(&self) -> usize {
        self.rows[self.input].len()
    }

    /// Numbers that it gives.
    pub fn outputs(&self) -> usize {
        self.rows[self.output].len()
    }

    /// Multiplications and additions of one evaluation.
    pub fn operations(&self) -> u64 {
        self.operations
    }

    /// Where an observation is written.
    pub fn input_mut(&mut self) -> &mut [f32] {
        &mut self.rows[self.input]
    }

    /// The command for the observation.
    pub fn evaluate(&mut self) -> &[f32] {
        for step in &self.steps {
            step.take(&mut self.rows, &mut self.sums);
        }
        &self.rows[self.output]
    }
}

impl Step {
    fn take(&self, rows: &mut [Vec<f32>], sums: &mut Vec<f64>) {
        // The row that is written is taken out meanwhile; nodes come after those that they read.
        let (Step::Linear { to, .. } | Step::Two { to, .. } | Step::One { to, .. } | Step::Concat { to, .. }) = self;
        let mut row = std::mem::take(&mut rows[*to]);
        match self {
            Step::Linear {
                from, weights, bias, ..
            } => {
                // As the weights lie in memory; every sum still takes the inputs in their order.
                sums.clear();
                sums.resize(row.len(), 0.0);
                for (given, weights) in rows[*from].iter().zip(weights.chunks_exact(row.len())) {
                    for (sum, weight) in sums.iter_mut().zip(weights) {
                        *sum += f64::from(*given) * f64::from(*weight);
                    }
                }
                for ((out, sum), bias) in row.iter_mut().zip(sums.iter()).zip(bias) {
                    *out = (sum + f64::from(*bias)) as f32;
                }
            }
            Step::Two { with, left, right, .. } => {
                let (left, right) = (&rows[*left], &rows[*right]);
                let at = |row: &[f32], k: usize| row[if row.len() == 1 { 0 } else { k }];
                for (k, out) in row.iter_mut().enumerate() {
                    *out = with(at(left, k), at(right, k));
                }
            }
            Step::One { with, from, .. } => {
                for (out, x) in row.iter_mut().zip(&rows[*from]) {
                    *out = with.at(*x);
                }
            }
            Step::Concat { from, .. } => {
                let parts = from.iter().flat_map(|slot| &rows[*slot]);
                for (out, x) in row.iter_mut().zip(parts) {
                    *out = *x;
                }
            }
        }
        rows[*to] = row;
    }
}

/// A graph on its way to a network.
struct Reader {
    constants: HashMap<String, Constant>,
    slots: HashMap<String, Slot>,
    rows: Vec<Vec<f32>>,
    steps: Vec<Step>,
    operations: u64,
}

impl Reader {
    /// A new row under a name.
    fn row(&mut self, name: &str, width: usize) -> Result<Slot, String> {
        if width == 0 || width > POLICY_WIDTH {
            return Err(format!(
                "`{name}` is {width} numbers wide; 1 to {POLICY_WIDTH} are allowed"
            ));
        }
        if name.is_empty() || self.slots.contains_key(name) || self.constants.contains_key(name) {
            return Err(format!("`{name}` is given twice, or has no name"));
        }
        self.rows.push(vec![0.0; width]);
        self.slots.insert(name.to_owned(), self.rows.len() - 1);
        Ok(self.rows.len() - 1)
    }

    /// The row of this name, one of a constant when it is one.
    fn given(&mut self, name: &str) -> Result<Slot, String> {
        if let Some(slot) = self.slots.get(name) {
            return Ok(*slot);
        }
        let constant = self
            .constants
            .get(name)
            .ok_or_else(|| format!("`{name}` is used and nobody gives it before"))?;
        let row = constant.row(name)?.to_vec();
        if row.is_empty() || row.len() > POLICY_WIDTH {
            return Err(format!(
                "`{name}` is {} numbers wide; 1 to {POLICY_WIDTH} are allowed",
                row.len()
            ));
        }
        self.rows.push(row);
        self.slots.insert(name.to_owned(), self.rows.len() - 1);
        Ok(self.rows.len() - 1)
    }

    fn read(&mut self, graph: &Graph) -> Result<(), String> {
        for node in graph.node.iter().filter(|node| node.op_type != "Constant") {
            let place = if node.name.is_empty() {
                node.output.first()
            } else {
                Some(&node.name)
            };
            let place = place.map_or("", String::as_str);
            self.node(node)
                .map_err(|reason| format!("in its node `{place}` ({}): {reason}", node.op_type))?;
        }
        Ok(())
    }

    fn node(&mut self, node: &Node) -> Result<(), String> {
        if !node.domain.is_empty() && node.domain != "ai.onnx" {
            return Err(format!("operators of `{}` are not known", node.domain));
        }
        let [output] = node.output.as_slice() else {
            return Err(format!("it gives {} values; one is known", node.output.len()));
        };
        let curve = match node.op_type.as_str() {
            "Gemm" => return self.gemm(node, output),
            "MatMul" => return self.mat_mul(node, output),
            "Concat" => return self.concat(node, output),
            "Add" => return self.two(node, output, |a, b| a + b),
            "Sub" => return self.two(node, output, |a, b| a - b),
            "Mul" => return self.two(node, output, |a, b| a * b),
            "Div" => return self.two(node, output, |a, b| a / b),
            "Max" => return self.two(node, output, largest),
            "Min" => return self.two(node, output, |a, b| -largest(-a, -b)),
            "Clip" => Curve::Clip(self.limit(node, 1, f32::MIN)?, self.limit(node, 2, f32::MAX)?),
            "Flatten" if graph::integer(node, "axis", 1) != 1 => return Err("only the axis 1 is known".to_owned()),
            "Identity" | "Flatten" => Curve::Plain(|x| x),
            "Abs" => Curve::Plain(f32::abs),
            "Neg" => Curve::Plain(|x| -x),
            "Relu" => Curve::Plain(positive),
            "Sqrt" => Curve::Plain(f32::sqrt),
            "Exp" => Curve::Plain(libm::expf),
            "Tanh" => Curve::Plain(libm::tanhf),
            "Sigmoid" => Curve::Plain(|x| 1.0 / (1.0 + libm::expf(-x))),
            "Softsign" => Curve::Plain(|x| x / (1.0 + x.abs())),
            "Softplus" => Curve::Plain(|x| positive(x) + libm::log1pf(libm::expf(-x.abs()))),
            "LeakyRelu" => Curve::LeakyRelu(graph::float(node, "alpha", 0.01)),
            "Elu" => Curve::Elu(graph::float(node, "alpha", 1.0)),
            other => {
                return Err(format!(
                    "the operator `{other}` is not among those that policies may use: {}",
                    OPERATORS.join(", ")
                ));
            }
        };
        self.curve(node, output, curve)
    }

    /// Name of an input; an error where there are not that many.
    fn input(node: &Node, at: usize) -> Result<&str, String> {
        let name = node.input.get(at).filter(|name| !name.is_empty());
        name.map(String::as_str)
            .ok_or_else(|| format!("its input {at} is missing"))
    }

    fn matrix(&self, name: &str) -> Result<(&Constant, [usize; 2]), String> {
        let constant = self
            .constants
            .get(name)
            .ok_or_else(|| format!("its weights `{name}` are no constant"))?;
        let [rows, columns] = constant.dims[..] else {
            return Err(format!(
                "its weights `{name}` have the shape {:?}; a matrix is needed",
                constant.dims
            ));
        };
        Ok((constant, [rows, columns]))
    }

    fn mat_mul(&mut self, node: &Node, output: &str) -> Result<(), String> {
        let (constant, dims) = self.matrix(Self::input(node, 1)?)?;
        let weights = constant.numbers.clone();
        self.linear(Self::input(node, 0)?, output, dims, weights, Vec::new())
    }

    fn gemm(&mut self, node: &Node, output: &str) -> Result<(), String> {
        if graph::integer(node, "transA", 0) != 0 {
            return Err("`transA` is not known".to_owned());
        }
        let (alpha, beta) = (graph::float(node, "alpha", 1.0), graph::float(node, "beta", 1.0));
        let (constant, [rows, columns]) = self.matrix(Self::input(node, 1)?)?;
        let is_turned = graph::integer(node, "transB", 0) != 0;
        let [inputs, width] = if is_turned { [columns, rows] } else { [rows, columns] };
        let at = |i: usize, j: usize| constant.numbers[if is_turned { j * columns + i } else { i * columns + j }];
        let weights = (0..inputs)
            .flat_map(|i| (0..width).map(move |j| (i, j)))
            .map(|(i, j)| alpha * at(i, j))
            .collect();
        let bias = match node.input.get(2).filter(|name| !name.is_empty()) {
            None => Vec::new(),
            Some(name) => {
                let bias = self
                    .constants
                    .get(name)
                    .ok_or_else(|| format!("its bias `{name}` is no constant"))?;
                let row = bias.row(name)?;
                match row.len() {
                    1 => vec![beta * row[0]; width],
                    _ => row.iter().map(|number| beta * number).collect(),
                }
            }
        };
        self.linear(Self::input(node, 0)?, output, [inputs, width], weights, bias)
    }

    fn linear(
        &mut self,
        input: &str,
        output: &str,
        [inputs, width]: [usize; 2],
        weights: Vec<f32>,
        mut bias: Vec<f32>,
    ) -> Result<(), String> {
        let from = self.given(input)?;
        let given = self.rows[from].len();
        if given != inputs {
            return Err(format!("its weights take {inputs} numbers, `{input}` has {given}"));
        }
        if bias.is_empty() {
            bias.resize(width, 0.0);
        }
        if bias.len() != width {
            return Err(format!("its bias has {} numbers, its weights give {width}", bias.len()));
        }
        let to = self.row(output, width)?;
        self.operations += 2 * (inputs * width + width) as u64;
        self.steps.push(Step::Linear {
            from,
            weights,
            bias,
            to,
        });
        Ok(())
    }

    fn two(&mut self, node: &Node, output: &str, with: fn(f32, f32) -> f32) -> Result<(), String> {
        if node.input.len() != 2 {
            return Err(format!("it has {} inputs; two are known", node.input.len()));
        }
        let (left, right) = (self.given(Self::input(node, 0)?)?, self.given(Self::input(node, 1)?)?);
        let (a, b) = (self.rows[left].len(), self.rows[right].len());
        if a != b && a != 1 && b != 1 {
            return Err(format!("its inputs are {a} and {b} numbers wide"));
        }
        let to = self.row(output, a.max(b))?;
        self.operations += a.max(b) as u64;
        self.steps.push(Step::Two { with, left, right, to });
        Ok(())
    }

    fn curve(&mut self, node: &Node, output: &str, with: Curve) -> Result<(), String> {
        let from = self.given(Self::input(node, 0)?)?;
        let width = self.rows[from].len();
        let to = self.row(output, width)?;
        self.operations += CURVE_OPERATIONS * width as u64;
        self.steps.push(Step::One { with, from, to });
        Ok(())
    }

    fn concat(&mut self, node: &Node, output: &str) -> Result<(), String> {
        if ![1, -1].contains(&graph::integer(node, "axis", 0)) {
            return Err("only the axis 1 is known".to_owned());
        }
        let from: Vec<Slot> = node
            .input
            .iter()
            .map(|name| self.given(name))
            .collect::<Result<_, _>>()?;
        let width = from.iter().map(|slot| self.rows[*slot].len()).sum();
        let to = self.row(output, width)?;
        self.operations += width as u64;
        self.steps.push(Step::Concat { from, to });
        Ok(())
    }

    /// A limit of `Clip`, a constant.
    fn limit(&self, node: &Node, at: usize, otherwise: f32) -> Result<f32, String> {
        match node.input.get(at).filter(|name| !name.is_empty()) {
            None => Ok(otherwise),
            Some(name) => {
                let constant = self
                    .constants
                    .get(name)
                    .ok_or_else(|| format!("its limit `{name}` is no constant"))?;
                constant.single(name)
            }
        }
    }
}
