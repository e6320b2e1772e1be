//! A program that has broken out of its interpreter: confined, it tries one thing and says `done` if it could.
//! `attacker NAME`; without a name it lists what it can try.

#![allow(unsafe_code, reason = "tries what a confined process must not be able to do")]

use std::process::ExitCode;

type Attempt = (&'static str, fn() -> bool);

const PATH: *const libc::c_char = c"/etc/passwd".as_ptr();
const OUT: *const libc::c_char = c"/tmp/robopheus-attacker".as_ptr();

fn call(number: libc::c_long, a: libc::c_long, b: libc::c_long, c: libc::c_long) -> bool {
    // SAFETY: nothing of this process is touched by these calls before it ends.
    unsafe { libc::syscall(number, a, b, c, 0, 0, 0) >= 0 }
}

const ATTEMPTS: [Attempt; 30] = [
    ("open", || {
        call(libc::SYS_openat, libc::AT_FDCWD.into(), PATH as libc::c_long, 0)
    }),
    ("create", || {
        call(libc::SYS_openat, libc::AT_FDCWD.into(), OUT as libc::c_long, 0o101)
    }),
    ("unlink", || {
        call(libc::SYS_unlinkat, libc::AT_FDCWD.into(), OUT as libc::c_long, 0)
    }),
    ("mkdir", || {
        call(libc::SYS_mkdirat, libc::AT_FDCWD.into(), OUT as libc::c_long, 0o777)
    }),
    ("chdir", || {
        call(libc::SYS_chdir, c"/tmp".as_ptr() as libc::c_long, 0, 0)
    }),
    ("chroot", || call(libc::SYS_chroot, c"/".as_ptr() as libc::c_long, 0, 0)),
    ("internet", || {
        call(libc::SYS_socket, libc::AF_INET.into(), libc::SOCK_STREAM.into(), 0)
    }),
    ("datagram", || {
        call(libc::SYS_socket, libc::AF_INET.into(), libc::SOCK_DGRAM.into(), 0)
    }),
    ("unix socket", || {
        call(libc::SYS_socket, libc::AF_UNIX.into(), libc::SOCK_STREAM.into(), 0)
    }),
    ("netlink", || {
        call(libc::SYS_socket, libc::AF_NETLINK.into(), libc::SOCK_RAW.into(), 0)
    }),
    ("fork", || call(libc::SYS_clone, libc::SIGCHLD.into(), 0, 0)),
    ("clone3", || call(libc::SYS_clone3, 0, 64, 0)),
    ("execve", || {
        call(libc::SYS_execve, c"/bin/true".as_ptr() as libc::c_long, 0, 0)
    }),
    ("kill", || call(libc::SYS_kill, unsafe { libc::getppid() }.into(), 0, 0)),
    ("trace", || call(libc::SYS_ptrace, libc::PTRACE_TRACEME.into(), 0, 0)),
    ("foreign memory", || call(libc::SYS_process_vm_readv, 1, 0, 0)),
    ("setuid", || call(libc::SYS_setuid, 0, 0, 0)),
    ("raise limit", || {
        call(libc::SYS_prlimit64, 0, libc::RLIMIT_NOFILE as libc::c_long, 0)
    }),
    ("namespace", || {
        call(libc::SYS_unshare, libc::CLONE_NEWUSER.into(), 0, 0)
    }),
    ("mount", || call(libc::SYS_mount, 0, OUT as libc::c_long, 0)),
    ("module", || call(libc::SYS_finit_module, 0, 0, 0)),
    ("bpf", || call(libc::SYS_bpf, 0, 0, 0)),
    ("keys", || call(libc::SYS_keyctl, 0, 0, 0)),
    ("io_uring", || call(libc::SYS_io_uring_setup, 1, 0, 0)),
    ("userfault", || call(libc::SYS_userfaultfd, 0, 0, 0)),
    ("memory file", || {
        call(libc::SYS_memfd_create, c"m".as_ptr() as libc::c_long, 0, 0)
    }),
    ("duplicate", || call(libc::SYS_dup, 0, 0, 0)),
    ("pipe", || call(libc::SYS_pipe2, &raw const PIPE as libc::c_long, 0, 0)),
    ("prctl", || call(libc::SYS_prctl, libc::PR_GET_DUMPABLE.into(), 0, 0)),
    ("two gigabytes", || {
        // SAFETY: a mapping of its own.
        let place = unsafe {
            libc::mmap(
                std::ptr::null_mut(),
                2 << 30,
                libc::PROT_WRITE,
                libc::MAP_PRIVATE | libc::MAP_ANONYMOUS,
                -1,
                0,
            )
        };
        place != libc::MAP_FAILED
    }),
];

static PIPE: [i32; 2] = [0; 2];

fn main() -> ExitCode {
    let Some(name) = std::env::args().nth(1) else {
        let names = ATTEMPTS.map(|(name, _)| name).join("\n");
        println!("{names}");
        return ExitCode::SUCCESS;
    };
    let Some((_, attempt)) = ATTEMPTS.into_iter().find(|(known, _)| *known == name) else {
        return ExitCode::FAILURE;
    };
    if std::env::args().nth(2).is_none() {
        let layers = sandbox::confine::confine();
        println!("confined: {}", layers.join(", "));
    }
    if attempt() {
        println!("done");
    }
    ExitCode::SUCCESS
}
