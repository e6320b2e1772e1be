//! The shared library of ONNX Runtime, for the check of exported networks.

use std::env;
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail, ensure};
use sha2::{Digest, Sha256};

use crate::{paths, run};

/// Version and digest of the wheel on PyPI that carries the library; `ort` asks for 1.24 or newer.
const VERSION: &str = "1.24.4";
const WHEEL_SHA256: &str = "e54ad52e61d2d4618dcff8fa1480ac66b24ee2eab73331322db1049f11ccf330";
/// Folder under the user's cache; `robopheus-learn` looks there as well.
const CACHE: &str = "robopheus/onnxruntime";
const STEM: &str = "libonnxruntime.so";
/// Where the library lies in the wheel.
const INSIDE: &str = "onnxruntime/capi";

/// `$ORT_DYLIB_PATH`, then the cache, then PyPI. `None`: a line says why, and that its tests skip.
pub fn find() -> Option<PathBuf> {
    if let Some(given) = env::var_os("ORT_DYLIB_PATH") {
        return Some(PathBuf::from(given));
    }
    let folder = cache()?;
    if let Some(library) = library_in(&folder) {
        return Some(library);
    }
    match fetch(&folder) {
        Ok(library) => Some(library),
        Err(error) => {
            eprintln!(
                "setup: no ONNX Runtime ({error:#}): its tests skip; ORT_DYLIB_PATH names a libonnxruntime.so of 1.24 or newer"
            );
            None
        }
    }
}

fn cache() -> Option<PathBuf> {
    let base = env::var_os("XDG_CACHE_HOME").map(PathBuf::from);
    let base = base.or_else(|| Some(PathBuf::from(env::var_os("HOME")?).join(".cache")))?;
    Some(base.join(CACHE))
}

fn library_in(folder: &Path) -> Option<PathBuf> {
    let names = fs::read_dir(folder).ok()?.flatten();
    names.map(|entry| entry.path()).find(|path| {
        path.file_name()
            .is_some_and(|name| name.to_string_lossy().starts_with(STEM))
    })
}

/// The wheel by pip into a folder of our own, its digest checked, the library moved into the cache.
fn fetch(folder: &Path) -> Result<PathBuf> {
    ensure!(
        cfg!(all(target_os = "linux", target_arch = "x86_64")),
        "the pinned wheel is for Linux on x86-64"
    );
    let python = paths::on_path("python3").context("python3 is not on PATH")?;
    let work = folder.with_extension(format!("part-{}", std::process::id()));
    fs::create_dir_all(&work).with_context(|| format!("cannot make {}", work.display()))?;
    println!("setup: fetching ONNX Runtime {VERSION} from PyPI");
    let moved = unpack(&python, &work, folder);
    let cleared = fs::remove_dir_all(&work);
    let library = moved?;
    cleared.with_context(|| format!("cannot remove {}", work.display()))?;
    Ok(library)
}

fn unpack(python: &Path, work: &Path, folder: &Path) -> Result<PathBuf> {
    let mut pip = run::command(python);
    pip.args([
        "-m",
        "pip",
        "download",
        "--quiet",
        "--disable-pip-version-check",
        "--no-deps",
    ]);
    pip.args([
        "--only-binary=:all:",
        "--implementation",
        "cp",
        "--python-version",
        "3.11",
        "--abi",
        "cp311",
    ]);
    pip.args([
        "--platform",
        "manylinux_2_27_x86_64",
        "--platform",
        "manylinux_2_28_x86_64",
        "--dest",
    ]);
    run::read(pip.arg(work).arg(format!("onnxruntime=={VERSION}"))).context("pip download")?;
    let wheel = fs::read_dir(work)?
        .flatten()
        .map(|entry| entry.path())
        .find(|path| path.extension().is_some_and(|extension| extension == "whl"))
        .context("pip left no wheel")?;
    check_digest(&fs::read(&wheel)?)?;
    let out = work.join("wheel");
    run::read(run::command(python).args(["-m", "zipfile", "-e"]).arg(&wheel).arg(&out)).context("unpacking")?;
    let found = library_in(&out.join(INSIDE)).context("the wheel holds no libonnxruntime.so")?;
    let name = found.file_name().context("the library has no name")?;
    fs::create_dir_all(folder)?;
    let library = folder.join(name);
    fs::rename(&found, &library)?;
    Ok(library)
}

fn check_digest(bytes: &[u8]) -> Result<()> {
    let digest = Sha256::digest(bytes);
    let found: String = digest.iter().map(|byte| format!("{byte:02x}")).collect();
    if found != WHEEL_SHA256 {
        bail!("the wheel's SHA-256 is {found}, not {WHEEL_SHA256}");
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn another_wheel_is_refused() {
        let problem = check_digest(b"another wheel").unwrap_err().to_string();
        assert!(problem.contains(WHEEL_SHA256), "{problem}");
    }

    #[test]
    fn the_library_is_found_by_its_stem() {
        let folder = env::temp_dir().join(format!("xtask-ort-{}", std::process::id()));
        fs::create_dir_all(&folder).unwrap();
        assert_eq!(library_in(&folder), None);
        fs::write(folder.join("libonnxruntime_providers_shared.so"), "").unwrap();
        assert_eq!(library_in(&folder), None);
        fs::write(folder.join("libonnxruntime.so.1.24.4"), "").unwrap();
        assert_eq!(library_in(&folder), Some(folder.join("libonnxruntime.so.1.24.4")));
        fs::remove_dir_all(&folder).unwrap();
    }
}
