//! A compiler for the browser: rustup's wasm32 target, or Debian's compiler with its library source.

use std::env;
use std::net::{TcpStream, ToSocketAddrs};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::mpsc;
use std::time::Duration;

use super::Missing;
use crate::metadata::WASM_TRIPLE;
use crate::{paths, run, sys};

/// Where rustup downloads from unless told otherwise.
const RUSTUP_HOST: &str = "static.rust-lang.org:443";
/// Longest wait to learn that there is no network.
const PROBE_LIMIT: Duration = Duration::from_millis(1500);
/// Longest download of the target once the network answers.
const DOWNLOAD_LIMIT: Duration = Duration::from_secs(120);
/// Longest try through a proxy, of which the network test says nothing.
const PROXY_LIMIT: Duration = Duration::from_millis(2500);
/// Set to `debian` to use Debian's compiler although rustup's target is there.
const CHOICE: &str = "ROBOPHEUS_WASM_TOOLCHAIN";

/// How the browser bundles are compiled.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum WasmToolchain {
    /// The running toolchain with the target installed.
    Rustup,
    /// Debian's rustc-web, cargo-web and rust-web-src: the standard library is built from source.
    Debian {
        cargo: PathBuf,
        rustc: PathBuf,
        linker: PathBuf,
    },
}

impl WasmToolchain {
    /// The compiler's version; part of what decides whether a bundle is up to date.
    pub fn version(&self) -> String {
        let rustc = match self {
            Self::Rustup => PathBuf::from("rustc"),
            Self::Debian { rustc, .. } => rustc.clone(),
        };
        run::read(foreign(&mut run::command(rustc)).arg("--version"))
            .unwrap_or_default()
            .trim()
            .to_owned()
    }

    /// `cargo build --target wasm32-unknown-unknown` with nothing of the native build's settings.
    pub fn cargo_build(&self) -> Command {
        self.cargo_build_for(WASM_TRIPLE, "std,panic_abort")
    }

    /// Whether [`Self::cargo_build_for`] has, or makes, the core library of a target.
    pub fn has_core_of(&self, triple: &str) -> bool {
        match self {
            Self::Rustup => library_is_there(triple, "libcore-"),
            Self::Debian { .. } => true,
        }
    }

    /// `cargo build` for another target, with nothing of the native build's settings.
    ///
    /// - `libraries`: of Rust itself, made from source where the toolchain has none for the target.
    pub fn cargo_build_for(&self, triple: &str, libraries: &str) -> Command {
        let mut command = match self {
            Self::Rustup => run::cargo(["build"]),
            Self::Debian { cargo, rustc, linker } => {
                let mut command = run::command(cargo);
                foreign(&mut command);
                command.arg("build").arg(format!("-Zbuild-std={libraries}"));
                // Only these builds may use unstable switches.
                command.env("RUSTC_BOOTSTRAP", "1").env("RUSTC", rustc);
                command.env("CARGO_TARGET_WASM32_UNKNOWN_UNKNOWN_LINKER", linker);
                command
            }
        };
        command.args(["--locked", "--target", triple]);
        without_native_flags(&mut command);
        command
    }
}

/// A compiler that is not the one that runs us must not load our libraries or obey our rustup.
fn foreign(command: &mut Command) -> &mut Command {
    for name in [
        "LD_LIBRARY_PATH",
        "RUSTUP_TOOLCHAIN",
        "CARGO",
        "RUSTC",
        "RUSTC_WRAPPER",
        "RUSTC_WORKSPACE_WRAPPER",
        "RUSTDOC",
    ] {
        command.env_remove(name);
    }
    command
}

/// Flags meant for the native build (a linker, a CPU) break or change the bundle.
fn without_native_flags(command: &mut Command) {
    for name in [
        "RUSTFLAGS",
        "CARGO_ENCODED_RUSTFLAGS",
        "CARGO_BUILD_RUSTFLAGS",
        "CARGO_BUILD_TARGET",
        "CARGO_TARGET_DIR",
    ] {
        command.env_remove(name);
    }
}

/// Rustup's target when installed, else Debian's compiler when complete, else rustup is asked to install it.
pub fn find() -> Result<WasmToolchain, Missing> {
    if env::var(CHOICE).is_ok_and(|choice| choice == "debian") {
        return debian().ok_or_else(lack);
    }
    if library_is_there(WASM_TRIPLE, "libstd-") {
        return Ok(WasmToolchain::Rustup);
    }
    if let Some(found) = debian() {
        return Ok(found);
    }
    if rustup_adds_target() && library_is_there(WASM_TRIPLE, "libstd-") {
        return Ok(WasmToolchain::Rustup);
    }
    Err(lack())
}

fn lack() -> Missing {
    Missing {
        what: "a compiler for wasm32-unknown-unknown",
        remedy: "`rustup target add wasm32-unknown-unknown`, or on Debian the packages rustc-web, cargo-web and rust-web-src",
        packages: &["rustc-web", "cargo-web", "rust-web-src"],
    }
}

/// Whether the running toolchain has a library (`libstd-`, `libcore-`) of a target.
fn library_is_there(triple: &str, library: &str) -> bool {
    let folder = run::read(run::command("rustc").args(["--print", "target-libdir", "--target", triple]));
    folder.is_ok_and(|folder| holds(Path::new(folder.trim()), library))
}

fn holds(folder: &Path, library: &str) -> bool {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    entries
        .into_iter()
        .any(|entry| entry.file_name().to_string_lossy().starts_with(library))
}

fn debian() -> Option<WasmToolchain> {
    let (cargo, rustc) = (PathBuf::from("/usr/bin/cargo"), PathBuf::from("/usr/bin/rustc"));
    if !paths::is_executable(&cargo) || !paths::is_executable(&rustc) {
        return None;
    }
    let sysroot = sysroot_of(&rustc)?;
    if !sysroot.join("lib/rustlib/src/rust/library/std/Cargo.toml").is_file() {
        return None;
    }
    let linker = rust_lld().or_else(debian_lld)?;
    Some(WasmToolchain::Debian { cargo, rustc, linker })
}

fn sysroot_of(rustc: &Path) -> Option<PathBuf> {
    let text = run::read(foreign(&mut run::command(rustc)).args(["--print", "sysroot"])).ok()?;
    Some(PathBuf::from(text.trim()))
}

/// The linker that comes with rustup's toolchain.
fn rust_lld() -> Option<PathBuf> {
    let text = run::read(run::command("rustc").args(["--print", "sysroot"])).ok()?;
    let linker = Path::new(text.trim())
        .join("lib/rustlib")
        .join(crate::metadata::HOST_TRIPLE)
        .join("bin/rust-lld");
    paths::is_executable(&linker).then_some(linker)
}

fn debian_lld() -> Option<PathBuf> {
    ["wasm-ld", "wasm-ld-22", "wasm-ld-19", "wasm-ld-16"]
        .into_iter()
        .find_map(paths::on_path)
}

fn rustup_adds_target() -> bool {
    let Some(rustup) = paths::on_path("rustup") else {
        return false;
    };
    let limit = if network_answers() {
        DOWNLOAD_LIMIT
    } else if has_proxy() {
        PROXY_LIMIT
    } else {
        return false;
    };
    println!("setup: rustup target add {WASM_TRIPLE}");
    let mut command = run::command(rustup);
    command.args(["target", "add", WASM_TRIPLE]);
    if !sys::is_root() || limit == PROXY_LIMIT {
        // The list of what is missing says it better.
        command.stderr(Stdio::null());
    }
    run::within(&mut command, limit).is_ok_and(|end| end.is_some_and(|status| status.success()))
}

fn has_proxy() -> bool {
    ["https_proxy", "HTTPS_PROXY", "all_proxy", "ALL_PROXY"]
        .iter()
        .any(|name| env::var_os(name).is_some_and(|value| !value.is_empty()))
}

/// Asks in a thread of its own: looking up a name may take long without a network, and the thread may be left behind.
fn network_answers() -> bool {
    let (tell, answer) = mpsc::sync_channel(1);
    std::thread::spawn(move || {
        let address = RUSTUP_HOST.to_socket_addrs().ok().and_then(|mut found| found.next());
        let connected = address.is_some_and(|address| TcpStream::connect_timeout(&address, PROBE_LIMIT).is_ok());
        tell.try_send(connected).ok();
    });
    answer.recv_timeout(PROBE_LIMIT).unwrap_or(false)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn removed(command: &Command, name: &str) -> bool {
        command.get_envs().any(|(key, value)| key == name && value.is_none())
    }

    #[test]
    fn the_unstable_switch_is_set_for_the_debian_build_only() {
        let debian = WasmToolchain::Debian {
            cargo: "/usr/bin/cargo".into(),
            rustc: "/usr/bin/rustc".into(),
            linker: "/l".into(),
        };
        assert!(debian.cargo_build().get_envs().any(|(key, _)| key == "RUSTC_BOOTSTRAP"));
        assert!(
            !WasmToolchain::Rustup
                .cargo_build()
                .get_envs()
                .any(|(key, _)| key == "RUSTC_BOOTSTRAP")
        );
    }

    #[test]
    fn native_flags_do_not_reach_the_bundle() {
        assert!(removed(&WasmToolchain::Rustup.cargo_build(), "RUSTFLAGS"));
        assert!(removed(&WasmToolchain::Rustup.cargo_build(), "CARGO_ENCODED_RUSTFLAGS"));
    }

    #[test]
    fn a_folder_without_a_standard_library_is_no_target() {
        assert!(!holds(Path::new("/nonexistent"), "libstd-"));
        assert!(!holds(Path::new("/etc"), "libstd-"));
    }
}
