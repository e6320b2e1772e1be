//! The browser bundles: web-ui and sim-wasm compiled to WebAssembly, with JavaScript glue, in static/bundle.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Stdio;

use anyhow::{Context, Result, bail};
use wasm_bindgen_cli_support::Bindgen;

use crate::fingerprint::{Fingerprint, inputs_in_dep_info};
use crate::setup::{Needs, WasmToolchain, set_up};
use crate::{End, metadata, paths, run};

/// Packages with a bundle: name of the package and of its files.
const BUNDLES: [(&str, &str); 2] = [("web-ui", "web_ui"), ("sim-wasm", "sim_wasm")];
const PROFILE: &str = "wasm-release";
/// Cargo's folder for bundles; apart from the native one so that neither build invalidates the other.
const TARGET_FOLDER: &str = "target-wasm";
/// Changes when the steps below change what they make.
const RECIPE: &str = "bundle recipe 3";
/// Vector instructions of WebAssembly, which every browser has since 2023: the twin takes wheels two at a time. The bits are
/// those of single numbers; relaxed vector instructions would change them.
const VECTORS: &str = "target.wasm32-unknown-unknown.rustflags=[\"-Ctarget-feature=+simd128\"]";
/// Beside the bundles: what they were made from.
const FINGERPRINT_FILE: &str = ".inputs.json";

/// `cargo xtask wasm`.
pub fn wasm() -> Result<End> {
    let Some(found) = set_up(Needs {
        wasm: true,
        ..Needs::default()
    })?
    else {
        return Ok(End::Missing);
    };
    build(&found.wasm.context("no toolchain after setup")?)?;
    Ok(End::Good)
}

/// Folder the server serves as /bundle/.
pub fn folder() -> PathBuf {
    paths::root().join("static/bundle")
}

/// Builds both bundles unless they are up to date.
pub fn build(toolchain: &WasmToolchain) -> Result<()> {
    let mut tools = Optional::find();
    let mut before = Fingerprint::of(&sources()?, tools.description(toolchain))?;
    if is_up_to_date(&before) {
        println!("wasm: bundles are up to date");
        return Ok(());
    }
    println!("wasm: building the browser bundles with {}", toolchain.version());
    tools.say_what_is_absent();
    compile(toolchain)?;
    fs::create_dir_all(folder())?;
    remove_old()?;
    for (_, name) in BUNDLES {
        bind(name)?;
        tools.optimise(name)?;
        tools.compress(name)?;
        print_size(name)?;
    }
    for file in included_files() {
        // Files pulled in from elsewhere (include_str!); the packages' own were read before the build.
        if !before.files.contains_key(&file) {
            before.add(&file)?;
        }
    }
    before.store(&folder().join(FINGERPRINT_FILE))
}

/// Folders and files the bundles are made from: their packages, the lockfile, the profiles.
fn sources() -> Result<Vec<PathBuf>> {
    let members = metadata::members(metadata::WASM_TRIPLE)?;
    let mut sources = vec![paths::root().join("Cargo.toml"), paths::root().join("Cargo.lock")];
    for (name, member) in &members {
        let part = |(package, _): &(&str, &str)| {
            name == package || members.get(*package).is_some_and(|one| one.linked.contains(name))
        };
        if BUNDLES.iter().any(part) {
            sources.push(member.folder.join("src"));
            sources.push(member.folder.join("Cargo.toml"));
            sources.push(member.folder.join("build.rs"));
        }
    }
    Ok(sources)
}

fn is_up_to_date(now: &Fingerprint) -> bool {
    let Some(stored) = Fingerprint::stored(&folder().join(FINGERPRINT_FILE)) else {
        return false;
    };
    let mut now = now.clone();
    for file in stored.files.keys() {
        if !now.files.contains_key(file) && now.add(file).is_err() {
            return false;
        }
    }
    stored == now
        && BUNDLES
            .iter()
            .flat_map(|(_, name)| outputs(name))
            .all(|file| folder().join(file).is_file())
}

fn outputs(name: &str) -> [String; 2] {
    [format!("{name}.js"), format!("{name}_bg.wasm")]
}

fn compiled_folder() -> PathBuf {
    paths::root()
        .join(TARGET_FOLDER)
        .join(metadata::WASM_TRIPLE)
        .join(PROFILE)
}

fn compile(toolchain: &WasmToolchain) -> Result<()> {
    let mut command = toolchain.cargo_build();
    command.args(["--lib", "--profile", PROFILE, "--target-dir", TARGET_FOLDER]);
    // wasm-bindgen reads the list of used features from a section that stripping takes away; it strips the rest itself.
    command.args(["--config", "profile.wasm-release.strip=false", "--config", VECTORS]);
    for (package, _) in BUNDLES {
        command.args(["--package", package]);
    }
    run::succeed(&mut command)
}

/// Input files outside the packages' own folders, as the compiler reported them.
fn included_files() -> Vec<PathBuf> {
    let texts = BUNDLES
        .iter()
        .filter_map(|(_, name)| fs::read_to_string(compiled_folder().join(format!("{name}.d"))).ok());
    let root = paths::root();
    texts
        .flat_map(|text| inputs_in_dep_info(&text))
        .filter(|file| file.starts_with(&root))
        .collect()
}

fn remove_old() -> Result<()> {
    for entry in fs::read_dir(folder())? {
        let path = entry?.path();
        if path.is_file() {
            fs::remove_file(&path)?;
        }
    }
    Ok(())
}

/// JavaScript glue at exactly the lockfile's version of wasm-bindgen.
fn bind(name: &str) -> Result<()> {
    let input = compiled_folder().join(format!("{name}.wasm"));
    let mut bindgen = Bindgen::new();
    bindgen
        .input_path(&input)
        .web(true)?
        .typescript(false)
        .remove_name_section(true)
        .remove_producers_section(true);
    bindgen
        .generate(folder())
        .with_context(|| format!("wasm-bindgen on {}", input.display()))
}

/// Tools that make bundles smaller but are not needed.
struct Optional {
    wasm_opt: Option<PathBuf>,
    gzip: Option<PathBuf>,
    brotli: Option<PathBuf>,
}

impl Optional {
    fn find() -> Self {
        let near = paths::root().join("node_modules/.bin/wasm-opt");
        let wasm_opt = paths::on_path("wasm-opt").or_else(|| paths::is_executable(&near).then_some(near));
        Self {
            wasm_opt,
            gzip: paths::on_path("gzip"),
            brotli: paths::on_path("brotli"),
        }
    }

    fn description(&self, toolchain: &WasmToolchain) -> Vec<String> {
        let there =
            |name: &str, tool: &Option<PathBuf>| format!("{name}: {}", if tool.is_some() { "yes" } else { "no" });
        let tools = [
            there("wasm-opt", &self.wasm_opt),
            there("gzip", &self.gzip),
            there("brotli", &self.brotli),
        ];
        [RECIPE.to_owned(), toolchain.version()]
            .into_iter()
            .chain(tools)
            .collect()
    }

    fn say_what_is_absent(&self) {
        let tools = [
            ("wasm-opt", &self.wasm_opt),
            ("gzip", &self.gzip),
            ("brotli", &self.brotli),
        ];
        let absent: Vec<&str> = tools
            .into_iter()
            .filter(|(_, tool)| tool.is_none())
            .map(|(name, _)| name)
            .collect();
        if !absent.is_empty() {
            println!(
                "wasm: without {} (optional: only makes the bundles smaller)",
                absent.join(", ")
            );
        }
    }

    fn optimise(&mut self, name: &str) -> Result<()> {
        let Some(program) = &self.wasm_opt else { return Ok(()) };
        let file = folder().join(format!("{name}_bg.wasm"));
        let smaller = file.with_extension("smaller");
        let mut command = run::command(program);
        // Only features every browser of the last years has; never --fast-math, which changes the twin's bits.
        let features = [
            "bulk-memory",
            "nontrapping-float-to-int",
            "sign-ext",
            "mutable-globals",
            "reference-types",
            "multivalue",
            "simd",
        ];
        command
            .arg("-O2")
            .args(features.map(|feature| format!("--enable-{feature}")))
            .arg(&file)
            .arg("-o")
            .arg(&smaller);
        match run::read(&mut command) {
            Ok(_) => fs::rename(&smaller, &file).context("put the optimised bundle in place"),
            Err(error) => {
                // An old wasm-opt does not know all features; the bundle is right without it.
                println!("wasm: bundle {name} stays as it is, {error:#}");
                fs::remove_file(&smaller).ok();
                Ok(())
            }
        }
    }

    fn compress(&self, name: &str) -> Result<()> {
        for file in outputs(name).map(|file| folder().join(file)) {
            if let Some(gzip) = &self.gzip {
                run::succeed(
                    run::command(gzip)
                        .args(["-9", "--keep", "--force", "--no-name"])
                        .arg(&file),
                )?;
            }
            if let Some(brotli) = &self.brotli {
                run::succeed(
                    run::command(brotli)
                        .args(["--best", "--keep", "--force"])
                        .arg(&file)
                        .stdout(Stdio::null()),
                )?;
            }
        }
        Ok(())
    }
}

fn print_size(name: &str) -> Result<()> {
    let file = folder().join(format!("{name}_bg.wasm"));
    let size = |path: &Path| path.metadata().map(|meta| meta.len()).ok();
    let Some(plain) = size(&file) else {
        bail!("{} was not made", file.display())
    };
    let small = |ending: &str| size(&file.with_extension(format!("wasm.{ending}")));
    let mut line = format!("wasm: {name}_bg.wasm {}", megabytes(plain));
    for ending in ["gz", "br"] {
        if let Some(bytes) = small(ending) {
            line.push_str(&format!(", .{ending} {}", megabytes(bytes)));
        }
    }
    println!("{line}");
    Ok(())
}

fn megabytes(bytes: u64) -> String {
    format!("{:.2} MB", bytes as f64 / 1e6)
}
