//! Program `robopheus-controller`: runs one user's program, confined, over standard input and output.

use std::process::ExitCode;

/// Deep enough for whatever a program within its limits nests.
const STACK_BYTES: usize = 256 * 1024 * 1024;

fn main() -> ExitCode {
    let work = || {
        // Before the first byte of the user's is read.
        let confined = sandbox::confine::confine();
        sandbox::serve::serve(std::io::stdin(), std::io::stdout(), confined)
    };
    let thread = std::thread::Builder::new().stack_size(STACK_BYTES).spawn(work);
    match thread.map(std::thread::JoinHandle::join) {
        Ok(Ok(Ok(()))) => ExitCode::SUCCESS,
        _ => ExitCode::FAILURE,
    }
}
