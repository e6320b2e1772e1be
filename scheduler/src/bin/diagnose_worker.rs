//! Program `robopheus-diagnose-worker`.

use clap::Parser;
use scheduler::diagnose::{Config, run};
use scheduler::program;

fn main() -> anyhow::Result<()> {
    let config = Config::parse();
    program::carry_on(1, |stop| run(config, stop))
}
