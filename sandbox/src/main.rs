//! Program `robopheus-controller`: runs one user's program, confined, over standard input and output.

use std::process::ExitCode;

/// Deep enough for whatever a program within its limits nests.
const STACK_BYTES: usize = 256 * 1024 * 1024;

/// One heap for all threads. The C library's heaps of further threads open a file before they give memory back, and the filter
/// of system calls would end the process for it.
fn share_heap() {
    #[cfg(target_env = "gnu")]
    #[allow(unsafe_code, reason = "the C library's own setting")]
    // SAFETY: plain numbers, before there is a second thread. Where it is refused, memory that is given back ends the process.
    unsafe {
        libc::mallopt(libc::M_ARENA_MAX, 1);
    }
}

fn main() -> ExitCode {
    share_heap();
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
