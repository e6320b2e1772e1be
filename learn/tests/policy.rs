//! Policies: the evaluation of browser and laboratory against ONNX Runtime's, on random networks of every operator.

use controllers::policy::Network;
use learn::runtime::{LIMIT, Runtime};
use onnx::{Message, Model, Sequence};
use rand_pcg::Pcg64Mcg;
use rand_pcg::rand_core::{Rng, SeedableRng};

const NETWORKS: usize = 200;
const ROWS: usize = 50;
const INPUTS: usize = 5;

struct Dice(Pcg64Mcg);

impl Dice {
    fn number(&mut self, least: f32, most: f32) -> f32 {
        least + (most - least) * (self.0.next_u32() as f32 / u32::MAX as f32)
    }

    fn numbers(&mut self, count: usize, size: f32) -> Vec<f32> {
        (0..count).map(|_| self.number(-size, size)).collect()
    }

    fn of(&mut self, most: usize) -> usize {
        self.0.next_u32() as usize % most
    }
}

/// Two to five layers, each a linear part and something of what else is known.
fn network(dice: &mut Dice) -> Model {
    let mut sequence = Sequence::new("observation", INPUTS);
    let mut width = INPUTS;
    let layers = 2 + dice.of(4);
    for layer in 0..layers {
        let next = if layer + 1 == layers { 3 } else { 1 + dice.of(24) };
        let weights = dice.numbers(width * next, 1.2 / (width as f32).sqrt());
        let bias = dice.numbers(next, 0.5);
        let name = |what: &str| format!("{what}_{layer}");
        sequence = if dice.of(2) == 0 {
            sequence.linear(&weights, &bias)
        } else {
            sequence
                .constant(&name("matrix"), &[width, next], &weights)
                .node("MatMul", &[&name("matrix")], &[])
                .constant(&name("add"), &[next], &bias)
                .node("Add", &[&name("add")], &[])
        };
        let (row, one, away) = (name("side"), name("one"), name("away"));
        sequence = sequence
            .constant(&row, &[1, next], &dice.numbers(next, 1.0))
            .constant(&one, &[], &[dice.number(0.2, 0.9)])
            .constant(&away, &[1], &[dice.number(1.5, 3.0)]);
        sequence = match dice.of(20) {
            0 => sequence.node("Relu", &[], &[]),
            1 => sequence.node("Tanh", &[], &[]),
            2 => sequence.node("Sigmoid", &[], &[]),
            3 => sequence.node("Softsign", &[], &[]),
            4 => sequence.node("Softplus", &[], &[]),
            5 => sequence.node("LeakyRelu", &[], &[("alpha", 0.2)]),
            6 => sequence.node("LeakyRelu", &[], &[]),
            7 => sequence.node("Elu", &[], &[("alpha", 0.7)]),
            8 => sequence.node("Abs", &[], &[]).node("Sqrt", &[], &[]),
            9 => sequence.node("Neg", &[], &[]).node("Identity", &[], &[]),
            10 => sequence.node("Max", &[&row], &[]),
            11 => sequence.node("Min", &[&row], &[]),
            12 => sequence.node("Sub", &[&row], &[]),
            13 => sequence.node("Mul", &[&row], &[]),
            14 => sequence.node("Div", &[&away], &[]),
            15 => sequence.node("Clip", &["", &one], &[]),
            16 => sequence.node("Clip", &[&one, &away], &[]),
            17 => sequence.node("Tanh", &[], &[]).node("Exp", &[], &[]),
            18 => sequence.node("Flatten", &[], &[]),
            _ => sequence.node("Mul", &[&one], &[]),
        };
        width = next;
    }
    sequence.model("command", 3, &[])
}

#[test]
fn onnx_runtime_gives_the_values_of_the_laboratory() {
    let runtime = match Runtime::load() {
        Ok(runtime) => runtime,
        Err(problem) => {
            println!("skipped: {problem}");
            return;
        }
    };
    let mut dice = Dice(Pcg64Mcg::seed_from_u64(5));
    let (mut largest, mut operators) = (0.0_f64, std::collections::BTreeSet::new());
    for number in 0..NETWORKS {
        let model = network(&mut dice);
        operators.extend(
            model
                .graph
                .iter()
                .flat_map(|graph| &graph.node)
                .map(|node| node.op_type.clone()),
        );
        let mut own = Network::new(&model).unwrap_or_else(|reason| panic!("{number}: {reason}"));
        let mut theirs = runtime.session(&model.encode_to_vec()).expect("a session");
        for _ in 0..ROWS {
            let row = dice.numbers(INPUTS, 2.0);
            own.input_mut().copy_from_slice(&row);
            let expected = theirs
                .run_named(["observation", "command"], 1, INPUTS, &row)
                .expect("an answer");
            let found = own.evaluate();
            assert_eq!(found.len(), expected.len());
            for (found, expected) in found.iter().zip(expected) {
                let difference = f64::from((found - expected).abs()) / f64::from(expected.abs()).max(1.0);
                assert!(difference <= LIMIT, "{number}: {found} {expected}");
                largest = largest.max(difference);
            }
        }
    }
    println!("{NETWORKS} networks, {ROWS} rows each, largest difference {largest:.1e}, operators {operators:?}");
    assert!(operators.len() >= 20, "{operators:?}");
}
