//! The exported file in ONNX Runtime against the training side and the twin.

use rand_pcg::Pcg64Mcg;
use rand_pcg::rand_core::SeedableRng;
use twin::model_document::ModelDocument;
use twin::residual::{Activation, OUTPUTS, Residual, ResidualDocument, SHIFTS};

use super::{Runtime, RuntimeError};
use crate::network::uniform;
use crate::onnx;
use crate::report::OnnxCheck;

/// Largest difference that is agreement, m/s^2 and rad/s^2.
pub const LIMIT: f64 = 1e-5;
/// Rows that are compared.
const ROWS: usize = 512;
/// How far beyond the validity ranges rows go, in ranges: through the fade and out of it.
const BEYOND: f64 = 0.3;
/// Every which row goes beyond them, in one input; the fade is a product over all.
const OUTSIDE: usize = 4;
const SEED: u64 = 17;

/// Runs an exported file on rows inside and outside of the validity region.
///
/// - `bytes`: the ONNX file of `model`.
/// - Errors: no library, a model without a residual, a file that ONNX Runtime refuses.
pub fn check(runtime: &Runtime, model: &ModelDocument, bytes: &[u8]) -> Result<OnnxCheck, RuntimeError> {
    let wrong = |message: String| RuntimeError::Runtime(message);
    let document = model
        .residual
        .as_ref()
        .ok_or_else(|| wrong(onnx::OnnxError::NoResidual.to_string()))?;
    let twin = Residual::new(&model.robot, document).map_err(|problem| wrong(problem.to_string()))?;
    let width = document.inputs.len();
    let inputs = rows(document);
    let mut session = runtime.session(bytes)?;
    let outputs = session.run(ROWS, width, &inputs)?;
    let count = document.outputs.len();
    if outputs.len() != ROWS * count {
        return Err(wrong(format!("{} outputs for {ROWS} rows of {count}", outputs.len())));
    }
    let (mut of_twin, mut of_training) = (0.0_f64, 0.0_f64);
    for (row, found) in inputs.chunks_exact(width).zip(outputs.chunks_exact(count)) {
        let row: Vec<f64> = row.iter().map(|value| f64::from(*value)).collect();
        let expected = twin.outputs(&row);
        let trained = evaluated(document, &row);
        for (position, (found, trained)) in found.iter().zip(trained).enumerate() {
            let name = &document.outputs[position].name;
            let place = OUTPUTS
                .iter()
                .chain(&SHIFTS)
                .position(|(other, ..)| other == name)
                .unwrap_or(0);
            // A difference that is no number counts as the largest.
            let difference = |other: f64| {
                let size = (f64::from(*found) - other).abs();
                if size.is_nan() { f64::INFINITY } else { size }
            };
            of_twin = of_twin.max(difference(expected[place]));
            of_training = of_training.max(difference(trained));
        }
    }
    Ok(OnnxCheck {
        runtime: runtime
            .path
            .file_name()
            .map_or_else(String::new, |name| name.to_string_lossy().into_owned()),
        rows: ROWS,
        max_difference_twin: of_twin,
        max_difference_training: of_training,
        limit: LIMIT,
        agrees: of_twin <= LIMIT && of_training <= LIMIT,
    })
}

/// As f32, so that rounding of the inputs is on both sides.
fn rows(document: &ResidualDocument) -> Vec<f32> {
    let mut random = Pcg64Mcg::seed_from_u64(SEED);
    let mut rows = Vec::with_capacity(ROWS * document.inputs.len());
    for row in 0..ROWS {
        let outside = (row % OUTSIDE == 0).then(|| (row / OUTSIDE) % document.inputs.len());
        for (position, input) in document.inputs.iter().enumerate() {
            let range = input.high - input.low;
            let beyond = if outside == Some(position) { BEYOND } else { 0.0 };
            let share = uniform(&mut random) * (1.0 + 2.0 * beyond) - beyond;
            rows.push((input.low + share * range) as f32);
        }
    }
    rows
}

/// The formulas of the document with the training's sums: layer by layer, tanh of `libm`.
fn evaluated(document: &ResidualDocument, row: &[f64]) -> Vec<f64> {
    let mut fade = 1.0;
    let mut units: Vec<f64> = Vec::with_capacity(row.len());
    for (input, value) in document.inputs.iter().zip(row) {
        let beyond = (input.low - value).max(value - input.high).max(0.0);
        let e = (beyond / (document.fade * (input.high - input.low))).min(1.0);
        fade *= 1.0 - e * e * (3.0 - 2.0 * e);
        units.push((value.max(input.low).min(input.high) - input.mean) / input.scale);
    }
    for layer in &document.layers {
        let rows = layer.weights.chunks_exact(units.len()).zip(&layer.bias);
        units = rows
            .map(|(row, bias)| {
                let sum = row.iter().zip(&units).fold(*bias, |sum, (w, x)| sum + w * x);
                match layer.activation {
                    Activation::Linear => sum,
                    Activation::Tanh => libm::tanh(sum),
                    Activation::Softsign => sum / (1.0 + sum.abs()),
                }
            })
            .collect();
    }
    let outputs = document.outputs.iter().zip(&units);
    outputs
        .map(|(output, unit)| fade * (output.scale * unit).max(-output.limit).min(output.limit))
        .collect()
}
