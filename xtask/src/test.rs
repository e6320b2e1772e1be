//! `cargo xtask test`: every test there is, and one table at the end.

use std::process::Command;
use std::time::Duration;

use anyhow::{Context, Result, bail};
use clap::Args;

use crate::builds::Extent;
use crate::cluster::DisposableServer;
use crate::setup::{Found, Needs, onnx_runtime, set_up};
use crate::stages::Stages;
use crate::{End, builds, bundle, check, paths, run};

/// Longest smoke run; it drives one short experiment.
const SMOKE_LIMIT: Duration = Duration::from_secs(10 * 60);
/// Packages of the browser's side.
const BROWSER_PACKAGES: [&str; 2] = ["web-ui", "sim-wasm"];
/// A Cortex-M3, as on the paper's drive boards (SAM3X).
const FIRMWARE_TRIPLE: &str = "thumbv7m-none-eabi";
const SYSTEM_PACKAGE: &str = "system-tests";

#[derive(Args)]
pub struct TestArguments {
    /// Run only these stages (names as in the table)
    #[arg(long, value_name = "STAGE")]
    pub only: Vec<String>,
}

/// Everything, in the order of what fails fastest.
pub fn test(arguments: &TestArguments) -> Result<End> {
    let Some(found) = set_up(Needs {
        wasm: true,
        postgres: true,
        browser: true,
        python: true,
    })?
    else {
        return Ok(End::Missing);
    };
    let mut stages = Stages::new(&arguments.only);
    check::add_rules(&mut stages);
    check::add_licences(&mut stages);
    let built = stages.run("build", build);
    let bundled = stages.run("wasm", || build_bundles(&found));
    add_firmware(&mut stages, &found);
    stages.run("clippy", check::clippy);
    stages.run_if(built, "the build failed", "tests", || {
        with_database(&found, |url| package_tests(url, &onnx_variable()))
    });
    stages.run_if(built, "the build failed", "doc-tests", || {
        run::succeed(&mut run::cargo(["test", "--quiet", "--locked", "--doc"]))
    });
    stages.run("browser-side", browser_side_tests);
    let extent = if arguments.only.is_empty() {
        Extent::Shipped
    } else {
        Extent::All
    };
    stages.run_if(bundled, "the bundles are not built", "builds", || {
        compare_builds(&found, extent)
    });
    let ready = built && bundled;
    stages.run_if(ready, "the programs or bundles are not built", "smoke", run_smoke);
    stages.run_if(ready, "the programs or bundles are not built", "system", || {
        with_database(&found, |url| system_tests(&found, url))
    });
    Ok(stages.finish())
}

/// `cargo xtask smoke`.
pub fn smoke() -> Result<End> {
    let Some(found) = set_up(Needs {
        wasm: true,
        postgres: true,
        browser: false,
        python: false,
    })?
    else {
        return Ok(End::Missing);
    };
    build()?;
    build_bundles(&found)?;
    run_smoke()?;
    Ok(End::Good)
}

/// The programs. Here, in `up` and in tests no packages are selected: with other features most would be built twice.
pub fn build() -> Result<()> {
    run::succeed(&mut run::cargo(["build", "--locked", "--bins"]))
}

pub fn build_bundles(found: &Found) -> Result<()> {
    bundle::build(found.wasm.as_ref().context("no wasm toolchain after setup")?)
}

/// The robots' software for a microcontroller without operating system and heap.
fn add_firmware(stages: &mut Stages, found: &Found) {
    let toolchain = found
        .wasm
        .as_ref()
        .filter(|toolchain| toolchain.has_core_of(FIRMWARE_TRIPLE));
    let Some(toolchain) = toolchain else {
        stages.leave_out(
            "firmware",
            "no core library for it (`rustup target add thumbv7m-none-eabi`)",
        );
        return;
    };
    stages.run("firmware", || {
        let folder = paths::program_folder()?.join("firmware");
        let mut command = toolchain.cargo_build_for(FIRMWARE_TRIPLE, "core");
        command.args(["--quiet", "--release", "--package", "robot", "--target-dir"]);
        run::succeed(command.arg(folder))
    });
}

/// The twin's bits in builds of several kinds, WebAssembly among them.
pub fn compare_builds(found: &Found, extent: Extent) -> Result<()> {
    // With `--only builds` nobody has made the bundle of these sources yet.
    build_bundles(found)?;
    let browser = found.browser.as_ref().context("no browser after setup")?;
    builds::give_equal_bits(&browser.chromium, extent)
}

/// Runs tests against a server of their own; an address given by the user is not touched.
pub fn with_database(found: &Found, tests: impl FnOnce(&str) -> Result<()>) -> Result<()> {
    let server = DisposableServer::start(found.postgres.as_ref().context("no PostgreSQL after setup")?)?;
    tests(&server.url())
}

/// Every package but the whole-system tests and the browser's side, with further variables set.
pub fn package_tests(database_url: &str, variables: &[(&str, String)]) -> Result<()> {
    let mut command = if has_nextest() {
        let [page, simulation] = BROWSER_PACKAGES;
        let everything_else =
            format!("not package({SYSTEM_PACKAGE}) and not package({page}) and not package({simulation})");
        run::cargo(["nextest", "run", "--locked", "--filterset", &everything_else])
    } else {
        let mut command = run::cargo(["test", "--locked", "--workspace", "--lib", "--bins", "--tests"]);
        for other in BROWSER_PACKAGES.iter().chain(&[SYSTEM_PACKAGE]) {
            command.args(["--exclude", other]);
        }
        command
    };
    command.envs(variables.iter().map(|(name, value)| (name, value)));
    run::succeed(command.env("TEST_DATABASE_URL", database_url))
}

/// Where the tests of exported networks find ONNX Runtime; without it they skip with a line.
fn onnx_variable() -> Vec<(&'static str, String)> {
    let library = onnx_runtime().map(|path| path.display().to_string());
    library.map(|path| ("ORT_DYLIB_PATH", path)).into_iter().collect()
}

fn browser_side_tests() -> Result<()> {
    let [page, simulation] = BROWSER_PACKAGES;
    if has_nextest() {
        let own = format!("package({page}) or package({simulation})");
        return run::succeed(&mut run::cargo(["nextest", "run", "--locked", "--filterset", &own]));
    }
    run::succeed(&mut run::cargo([
        "test",
        "--locked",
        "--package",
        page,
        "--package",
        simulation,
    ]))
}

/// One experiment from submission to archive on a system of its own.
pub fn run_smoke() -> Result<()> {
    let mut command = run::command(paths::program_folder()?.join("robopheus-smoke"));
    export_own_program(&mut command)?;
    match run::within(&mut command, SMOKE_LIMIT)? {
        Some(status) if status.success() => Ok(()),
        Some(status) => bail!("smoke failed ({status})"),
        None => bail!("smoke took longer than {} min", SMOKE_LIMIT.as_secs() / 60),
    }
}

fn system_tests(found: &Found, database_url: &str) -> Result<()> {
    let mut command = if has_nextest() {
        let own = format!("package({SYSTEM_PACKAGE})");
        run::cargo(["nextest", "run", "--locked", "--filterset", &own])
    } else {
        run::cargo([
            "test",
            "--locked",
            "--package",
            SYSTEM_PACKAGE,
            "--",
            "--test-threads=1",
        ])
    };
    export_own_program(&mut command)?;
    if let Some(browser) = &found.browser {
        browser.export(&mut command);
    }
    run::succeed(command.env("TEST_DATABASE_URL", database_url))
}

/// Whole-system tests start the system by the program that runs them.
pub fn export_own_program(command: &mut Command) -> Result<()> {
    command
        .env("ROBOPHEUS_UP", paths::own_program()?)
        .env_remove("DATABASE_URL");
    Ok(())
}

pub fn has_nextest() -> bool {
    paths::on_path("cargo-nextest").is_some()
}
