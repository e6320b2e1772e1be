//! The few calls into libc that std does not offer; each with its reason.

use std::os::unix::process::CommandExt;
use std::process::Command;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::Duration;

/// Signals asked to end this process so far (Ctrl-C, SIGTERM, SIGHUP).
static ENDS_ASKED: AtomicU32 = AtomicU32::new(0);

/// Number of times the user asked this process to end.
pub fn ends_asked() -> u32 {
    ENDS_ASKED.load(Ordering::SeqCst)
}

extern "C" fn count_end(_signal: libc::c_int) {
    ENDS_ASKED.fetch_add(1, Ordering::SeqCst);
}

/// From now on Ctrl-C, SIGTERM and SIGHUP are counted instead of killing this process.
pub fn catch_end_signals() {
    for signal in [libc::SIGINT, libc::SIGTERM, libc::SIGHUP] {
        // The handler only touches an atomic, which is allowed inside a signal handler.
        #[allow(unsafe_code)]
        unsafe {
            libc::signal(signal, count_end as *const () as libc::sighandler_t);
        }
    }
}

/// Makes the child get `signal` when this process dies, however it dies: no orphan stays behind.
///
/// The kernel watches the *thread* that spawned the child, so spawn from the main thread.
pub fn die_with_parent(command: &mut Command, signal: libc::c_int) {
    let parent = std::process::id();
    // Between fork and exec only async-signal-safe calls are allowed: prctl, getppid and _exit are.
    #[allow(unsafe_code)]
    unsafe {
        command.pre_exec(move || {
            libc::prctl(libc::PR_SET_PDEATHSIG, signal as libc::c_ulong, 0, 0, 0);
            if libc::getppid() as u32 != parent {
                libc::_exit(1);
            }
            Ok(())
        });
    }
}

/// Sends a signal to one process. `false` when there is no such process.
pub fn signal_process(pid: u32, signal: libc::c_int) -> bool {
    // A plain system call on integers.
    #[allow(unsafe_code)]
    unsafe {
        libc::kill(pid as libc::pid_t, signal) == 0
    }
}

/// Sends a signal to every process of a group. `false` when the group is empty.
pub fn signal_group(leader: u32, signal: libc::c_int) -> bool {
    // A plain system call on integers.
    #[allow(unsafe_code)]
    unsafe {
        libc::killpg(leader as libc::pid_t, signal) == 0
    }
}

/// Effective user id of this process.
pub fn effective_uid() -> u32 {
    // A plain system call without arguments; it cannot fail.
    #[allow(unsafe_code)]
    unsafe {
        libc::geteuid()
    }
}

/// True when this process may install packages and change owners.
pub fn is_root() -> bool {
    effective_uid() == 0
}

/// Sleeps, but returns early once the user asked to end.
pub fn doze(time: Duration) {
    let started = std::time::Instant::now();
    let asked = ends_asked();
    while started.elapsed() < time && ends_asked() == asked {
        std::thread::sleep(Duration::from_millis(20).min(time));
    }
}
