//! Program `robopheus-scheduler`.

use clap::Parser;
use scheduler::{Config, program, run};

fn main() -> anyhow::Result<()> {
    let config = Config::parse();
    program::carry_on(2, |stop| run(config, stop))
}
