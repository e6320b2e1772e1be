//! `robopheus-learn`: from run bundles to a model with a learned residual, its ONNX file and a report.
#![forbid(unsafe_code)]

mod program;

fn main() -> std::process::ExitCode {
    program::main()
}
