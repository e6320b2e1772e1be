//! The twin gives the same bits in every build: unoptimised with overflow checks, optimised, for this processor and for the
//! oldest (fused multiply-add may be there and must not be used), and in the browser's engine.

use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command;
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail};

use crate::metadata::HOST_TRIPLE;
use crate::{page, paths, run};

/// Digest by the name of its trace.
type Digests = BTreeMap<String, String>;

/// The program that prints them.
const RUN: [&str; 5] = ["run", "--quiet", "--locked", "--bin", "robopheus-digests"];
/// For builds that nothing else is built with: only the features that it needs.
const OWN_PACKAGE: [&str; 2] = ["--package", "controllers"];
/// Fewer traces than this are not the gallery.
const LEAST_TRACES: usize = 500;
/// Longest run of all traces in the browser; a few seconds are usual.
const BROWSER_LIMIT: Duration = Duration::from_secs(180);
/// As many differing traces are told by name.
const NAMED_DIFFERENCES: usize = 12;
/// SSE2 and nothing newer, where all else is built for this processor (`.cargo/config.toml`).
const NARROW_FLAGS: &str = "-Ctarget-cpu=x86-64";

/// Which builds are compared with the one for development.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Extent {
    /// Release and WebAssembly, what runs in laboratories.
    Shipped,
    /// The unoptimised one and SSE2 as well: eight minutes more on two cores.
    All,
}

/// Compares the digests of all gallery scenarios, effects, residuals and own controllers between the builds.
pub fn give_equal_bits(chromium: &Path, extent: Extent) -> Result<()> {
    let reference = timed("dev", || native(&[]))?;
    if reference.len() < LEAST_TRACES || reference.values().any(String::is_empty) {
        bail!("only {} traces, or one without a digest", reference.len());
    }
    if extent == Extent::Shipped {
        let others = vec![
            ("release", timed("release", release)?),
            ("WebAssembly", timed("WebAssembly", || in_browser(chromium))?),
        ];
        println!("unoptimised, SSE2: left out (`cargo xtask test --only builds` and `cargo xtask soak` compare them)");
        return all_equal(&reference, &others);
    }
    let others = std::thread::scope(|scope| -> Result<Vec<(&str, Digests)>> {
        // Minutes on one core, for interpreters are unoptimised as well; the compilation of the others has the other core.
        let unoptimised = [&["--profile", "unoptimised"], &OWN_PACKAGE[..]].concat();
        let slow = scope.spawn(move || timed("unoptimised", || native(&unoptimised)));
        let mut others = vec![("release", timed("release", release)?)];
        if cfg!(target_arch = "x86_64") {
            others.push(("SSE2", timed("SSE2", narrow)?));
        } else {
            println!("SSE2: left out, this processor has none");
        }
        others.push(("WebAssembly", timed("WebAssembly", || in_browser(chromium))?));
        let slow = slow
            .join()
            .map_err(|_| anyhow::anyhow!("the unoptimised build's thread broke"))?;
        others.push(("unoptimised", slow?));
        Ok(others)
    })?;
    all_equal(&reference, &others)
}

fn all_equal(reference: &Digests, others: &[(&str, Digests)]) -> Result<()> {
    let differences: Vec<String> = others
        .iter()
        .flat_map(|(build, digests)| differing(build, reference, digests))
        .collect();
    if !differences.is_empty() {
        bail!("{}", told(&differences));
    }
    println!(
        "{} traces in {} builds, all digests equal",
        reference.len(),
        others.len() + 1
    );
    Ok(())
}

/// How many differ, and the first of them.
fn told(differences: &[String]) -> String {
    let named = &differences[..differences.len().min(NAMED_DIFFERENCES)];
    let rest = match differences.len() - named.len() {
        0 => String::new(),
        more => format!(" and {more} more"),
    };
    format!("{} digests differ: {}{rest}", differences.len(), named.join(", "))
}

fn timed(build: &str, digests: impl FnOnce() -> Result<Digests>) -> Result<Digests> {
    let begun = Instant::now();
    let got = digests().with_context(|| format!("build {build}"))?;
    println!(
        "{build}: {} traces, {:.0} s with its compilation",
        got.len(),
        begun.elapsed().as_secs_f64()
    );
    Ok(got)
}

fn release() -> Result<Digests> {
    native(&[&["--release"], &OWN_PACKAGE[..]].concat())
}

fn native(arguments: &[&str]) -> Result<Digests> {
    read(run::cargo(RUN).args(arguments))
}

fn read(command: &mut Command) -> Result<Digests> {
    serde_json::from_str(&run::read(command)?).context("digests as JSON")
}

/// In a folder of its own: other flags would throw away what the usual build has made.
fn narrow() -> Result<Digests> {
    let program_folder = paths::program_folder()?;
    let folder = program_folder.parent().context("no target folder")?.join("sse2");
    let mut command = run::cargo(RUN);
    command.args(OWN_PACKAGE);
    command.args(["--target", HOST_TRIPLE, "--target-dir"]);
    read(
        command
            .arg(folder)
            .env_remove("RUSTFLAGS")
            .env("CARGO_ENCODED_RUSTFLAGS", NARROW_FLAGS),
    )
}

fn in_browser(chromium: &Path) -> Result<Digests> {
    let text = page::evaluate(chromium, "return sim.gallery_digests();", BROWSER_LIMIT)?;
    serde_json::from_str(&text).context("digests as JSON")
}

/// Names whose digests differ or that one side lacks.
fn differing(build: &str, reference: &Digests, other: &Digests) -> Vec<String> {
    let names = reference
        .keys()
        .chain(other.keys().filter(|name| !reference.contains_key(*name)));
    names
        .filter(|name| reference.get(*name) != other.get(*name))
        .map(|name| format!("{name} ({build})"))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_changed_a_missing_and_a_further_trace_are_differences() {
        let digests = |rows: &[(&str, &str)]| -> Digests {
            rows.iter()
                .map(|(name, digest)| ((*name).to_owned(), (*digest).to_owned()))
                .collect()
        };
        let reference = digests(&[("a", "1"), ("b", "2"), ("c", "3")]);
        assert!(differing("x", &reference, &reference).is_empty());
        let other = digests(&[("a", "1"), ("b", "9"), ("d", "4")]);
        assert_eq!(differing("x", &reference, &other), ["b (x)", "c (x)", "d (x)"]);
    }

    #[test]
    fn a_few_differences_are_named_and_many_are_counted() {
        let names = |count: usize| -> Vec<String> { (0..count).map(|k| format!("t{k}")).collect() };
        assert_eq!(told(&names(2)), "2 digests differ: t0, t1");
        let many = told(&names(253));
        assert!(many.starts_with("253 digests differ: t0, t1, "), "{many}");
        assert!(many.ends_with("t11 and 241 more"), "{many}");
    }
}
