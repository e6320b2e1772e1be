//! A process gives up what a program of a user has no need of: memory and time without bound, files, other processes, the
//! network, its user, and nearly all system calls. Nothing of it can be had back.

#![allow(
    unsafe_code,
    reason = "the operating system's calls; each is plain and checked by its result"
)]

/// Layers without which nothing of a user's is run.
pub const ESSENTIAL: [&str; 2] = ["limits", "system calls"];

/// Address space, stacks included.
const ADDRESS_BYTES: u64 = 1024 * 1024 * 1024;
/// Processor time of a whole run.
const PROCESSOR_S: u64 = 900;
/// Who is nobody.
const NOBODY: u32 = 65_534;

/// Gives up everything; returns the layers that are in force.
pub fn confine() -> Vec<String> {
    type Layer = (&'static str, fn() -> bool);
    let layers: [Layer; 4] = [
        ("network", leave_network),
        ("user", become_nobody),
        ("limits", limit),
        ("system calls", filter_calls),
    ];
    let done = layers.into_iter().filter(|(_, layer)| layer());
    done.map(|(name, _)| name.to_owned()).collect()
}

/// A network of its own without any interface; needs to be root or allowed to have user namespaces.
fn leave_network() -> bool {
    // SAFETY: plain numbers. A process with a second thread may not make a user namespace: then this fails and is not told.
    unsafe { libc::unshare(libc::CLONE_NEWNET | libc::CLONE_NEWIPC) == 0 }
}

fn become_nobody() -> bool {
    // SAFETY: plain numbers; an empty list of groups has no address.
    unsafe {
        libc::geteuid() == 0
            && libc::setgroups(0, std::ptr::null()) == 0
            && libc::setresgid(NOBODY, NOBODY, NOBODY) == 0
            && libc::setresuid(NOBODY, NOBODY, NOBODY) == 0
    }
}

fn limit() -> bool {
    let set = |resource, value: u64| {
        let limit = libc::rlimit {
            rlim_cur: value,
            rlim_max: value,
        };
        // SAFETY: the limit outlives the call.
        unsafe { libc::setrlimit(resource, &limit) == 0 }
    };
    // Descriptors: those that are open stay, none can be added.
    set(libc::RLIMIT_AS, ADDRESS_BYTES)
        && set(libc::RLIMIT_CPU, PROCESSOR_S)
        && set(libc::RLIMIT_NOFILE, 0)
        && set(libc::RLIMIT_NPROC, 0)
        && set(libc::RLIMIT_FSIZE, 0)
        && set(libc::RLIMIT_CORE, 0)
}

/// What computing and two pipes need.
const CALLS: [libc::c_long; 24] = [
    libc::SYS_read,
    libc::SYS_write,
    libc::SYS_writev,
    libc::SYS_readv,
    libc::SYS_mmap,
    libc::SYS_munmap,
    libc::SYS_mremap,
    libc::SYS_madvise,
    libc::SYS_mprotect,
    libc::SYS_brk,
    libc::SYS_futex,
    libc::SYS_exit,
    libc::SYS_exit_group,
    libc::SYS_rt_sigreturn,
    libc::SYS_rt_sigaction,
    libc::SYS_rt_sigprocmask,
    libc::SYS_sigaltstack,
    libc::SYS_sched_yield,
    libc::SYS_clock_gettime,
    libc::SYS_getrandom,
    libc::SYS_gettid,
    libc::SYS_getpid,
    libc::SYS_rseq,
    libc::SYS_restart_syscall,
];

#[cfg(target_arch = "x86_64")]
const ARCHITECTURE: u32 = 0xc000_003e;
#[cfg(target_arch = "aarch64")]
const ARCHITECTURE: u32 = 0xc000_00b7;

/// Kills the process at any other system call, in all its threads.
fn filter_calls() -> bool {
    const LOAD: u16 = (libc::BPF_LD | libc::BPF_W | libc::BPF_ABS) as u16;
    const IS: u16 = (libc::BPF_JMP | libc::BPF_JEQ | libc::BPF_K) as u16;
    const RETURN: u16 = (libc::BPF_RET | libc::BPF_K) as u16;
    let line = |code: u16, k: u32, jt: u8, jf: u8| libc::sock_filter { code, jt, jf, k };
    // Offsets in `seccomp_data`: the number at 0, the architecture at 4.
    let mut filter = vec![
        line(LOAD, 4, 0, 0),
        line(IS, ARCHITECTURE, 1, 0),
        line(RETURN, libc::SECCOMP_RET_KILL_PROCESS, 0, 0),
        line(LOAD, 0, 0, 0),
    ];
    for (at, call) in CALLS.iter().enumerate() {
        // To the last line, which allows; the one before it kills.
        filter.push(line(IS, *call as u32, (CALLS.len() - at) as u8, 0));
    }
    filter.push(line(RETURN, libc::SECCOMP_RET_KILL_PROCESS, 0, 0));
    filter.push(line(RETURN, libc::SECCOMP_RET_ALLOW, 0, 0));
    let program = libc::sock_fprog {
        len: filter.len() as u16,
        filter: filter.as_mut_ptr(),
    };
    // SAFETY: the program and its lines outlive the calls.
    unsafe {
        libc::prctl(libc::PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) == 0
            && libc::syscall(
                libc::SYS_seccomp,
                libc::SECCOMP_SET_MODE_FILTER,
                libc::SECCOMP_FILTER_FLAG_TSYNC,
                &program,
            ) == 0
    }
}
