//! Every developer command of the project. `cargo xtask --help` lists them.

mod arch;
mod bench;
mod blind;
mod builds;
mod bundle;
mod check;
mod cluster;
mod demo;
mod fingerprint;
mod metadata;
mod page;
mod paths;
mod run;
mod setup;
mod soak;
mod stages;
mod sys;
mod test;
mod tidy;
mod up;

use std::process::ExitCode;

use clap::{Parser, Subcommand};

/// Ends of a command; the number is the process's exit code.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum End {
    Good = 0,
    Failed = 1,
    /// Something this machine lacks; it has been listed.
    Missing = 3,
}

#[derive(Parser)]
#[command(name = "cargo xtask", about = "Every developer command of the project", version)]
struct Arguments {
    #[command(subcommand)]
    verb: Verb,
}

#[derive(Subcommand)]
enum Verb {
    /// Build and set up what is missing, start everything, print the address
    Up(up::UpArguments),
    /// The whole test suite: unit, integration on a real PostgreSQL, wasm, whole system, real browser
    Test(test::TestArguments),
    /// Quick look before a commit: format, clippy, architecture, tidiness
    Check,
    /// Check which package may depend on which
    Arch,
    /// Check that documents and code agree and that no file is too long
    Tidy,
    /// Build the browser bundles into static/bundle
    Wasm,
    /// Start everything, run one experiment from submission to archive
    Smoke,
    /// Rows of the reliability goals at full count; without a row also what `test` does, on real logs (ROBOPHEUS_REAL_LOGS)
    Soak(soak::SoakArguments),
    /// Benchmarks: speed and memory of the twin
    Bench(bench::BenchArguments),
    /// What the product does, shown on the emulated laboratory: `demo gap`
    Demo(demo::DemoArguments),
    /// One page with what each chassis and each effect does, in target/gallery.html
    Gallery,
    /// Blind identification bench; its options: `cargo xtask blind -- --help`
    Blind(blind::BlindArguments),
}

fn main() -> ExitCode {
    let verb = Arguments::parse().verb;
    let end = match verb {
        Verb::Up(arguments) => up::up(&arguments),
        Verb::Test(arguments) => test::test(&arguments),
        Verb::Check => check::check(),
        Verb::Arch => arch::arch(),
        Verb::Tidy => tidy::tidy(),
        Verb::Wasm => bundle::wasm(),
        Verb::Smoke => test::smoke(),
        Verb::Soak(arguments) => soak::soak(&arguments),
        Verb::Bench(arguments) => bench::bench(&arguments),
        Verb::Demo(arguments) => demo::demo(&arguments),
        Verb::Gallery => gallery(),
        Verb::Blind(arguments) => blind::blind(&arguments),
    };
    match end {
        Ok(end) => ExitCode::from(end as u8),
        Err(error) => {
            eprintln!("xtask: {error:#}");
            ExitCode::from(End::Failed as u8)
        }
    }
}

/// Draws the twin's page.
fn gallery() -> anyhow::Result<End> {
    let page = paths::root().join("target/gallery.html");
    let mut draw = run::cargo(["run", "--quiet", "--locked", "--example", "gallery", "--"]);
    run::succeed(draw.arg(&page))?;
    Ok(End::Good)
}
