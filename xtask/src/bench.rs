//! Benchmarks. What they mean is in `docs/speed.md`.

mod controllers;
mod identify;
mod interaction;
mod lab;
mod twin;

use anyhow::Result;
use clap::{Args, Subcommand};

use crate::End;

#[derive(Args)]
pub struct BenchArguments {
    /// All that exist without it
    #[command(subcommand)]
    subject: Option<Subject>,
}

#[derive(Subcommand)]
enum Subject {
    /// Robot-seconds per CPU-second of the twin, natively and in Chromium; memory per robot
    Twin(twin::TwinArguments),
    /// From light to robot: each stage of the laboratory beside the paper's times
    Lab(lab::LabArguments),
    /// CPU seconds of a diagnosis of ten minutes of logs on one core, by stage
    Identify(identify::IdentifyArguments),
    /// Time of a tick of own controllers, scripts and modules, with 1, 10 and 50 robots and at their limits
    Controllers(controllers::ControllersArguments),
    /// A whole control tick with ten robots that their models correct
    Interaction,
}

/// `cargo xtask bench`.
pub fn bench(arguments: &BenchArguments) -> Result<End> {
    match &arguments.subject {
        Some(Subject::Twin(arguments)) => twin::bench(arguments),
        Some(Subject::Lab(arguments)) => lab::bench(arguments),
        Some(Subject::Identify(arguments)) => identify::bench(arguments),
        Some(Subject::Controllers(arguments)) => controllers::bench(arguments),
        Some(Subject::Interaction) => interaction::bench(),
        None => {
            let end = twin::bench(&twin::TwinArguments::default())?;
            if end != End::Good {
                return Ok(end);
            }
            let end = lab::bench(&lab::LabArguments::default())?;
            if end != End::Good {
                return Ok(end);
            }
            let end = identify::bench(&identify::IdentifyArguments::default())?;
            if end != End::Good {
                return Ok(end);
            }
            let end = interaction::bench()?;
            if end != End::Good {
                return Ok(end);
            }
            controllers::bench(&controllers::ControllersArguments::default())
        }
    }
}
