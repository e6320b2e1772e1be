//! What a policy's file says of itself: what it wants to see, what it commands, how often, and how much at most.

use serde::{Deserialize, Serialize};

use super::observation::Feature;

/// `format` of a manifest.
pub const FORMAT: &str = "robopheus.policy/1";
/// Its key in the file's `metadata_props`.
pub const KEY: &str = "robopheus.policy";
/// Most numbers of an observation.
pub const MAX_FEATURES: usize = 256;
/// A target counts as reached this close where the manifest says nothing.
const REACH_RADIUS_M: f64 = 0.05;

/// Numbers that a policy gives.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Command {
    /// Body twist: forward m/s, left m/s, yaw rate rad/s.
    Twist,
    /// Velocity in the world frame, m/s; the laboratory's driver finds what the chassis can do.
    Velocity,
}

impl Command {
    pub fn numbers(self) -> usize {
        match self {
            Command::Twist => 3,
            Command::Velocity => 2,
        }
    }
}

/// See the module.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Manifest {
    pub format: String,
    /// Names of the observation's numbers in their order, see [`Feature`].
    pub observation: Vec<String>,
    pub command: Command,
    /// How often the network is asked; between two answers the last one holds. A divisor of the control rate.
    pub rate_hz: u32,
    /// Largest absolute value of each number of the command; the network's answer is cut there.
    pub limits: Vec<f64>,
    #[serde(default = "reach_radius_m")]
    pub reach_radius_m: f64,
}

fn reach_radius_m() -> f64 {
    REACH_RADIUS_M
}

impl Manifest {
    /// Reads and checks a manifest.
    ///
    /// - Errors: what is wrong with it, with the limit and what to do.
    pub fn read(text: &str) -> Result<Manifest, String> {
        let manifest: Manifest =
            serde_json::from_str(text).map_err(|error| format!("its manifest (`{KEY}`) cannot be read: {error}"))?;
        manifest
            .check()
            .map_err(|reason| format!("its manifest (`{KEY}`): {reason}"))?;
        Ok(manifest)
    }

    fn check(&self) -> Result<(), String> {
        if self.format != FORMAT {
            return Err(format!("`format` is {:?}; `{FORMAT}` is known", self.format));
        }
        if self.observation.is_empty() || self.observation.len() > MAX_FEATURES {
            let count = self.observation.len();
            return Err(format!(
                "`observation` has {count} names; 1 to {MAX_FEATURES} are allowed"
            ));
        }
        if self.rate_hz == 0 || !control::TICK_RATE_HZ.is_multiple_of(self.rate_hz) {
            let (asked, rate) = (self.rate_hz, control::TICK_RATE_HZ);
            return Err(format!(
                "`rate_hz` is {asked}; it must divide the control rate of {rate} Hz"
            ));
        }
        let numbers = self.command.numbers();
        if self.limits.len() != numbers || self.limits.iter().any(|limit| !limit.is_finite() || *limit < 0.0) {
            return Err(format!(
                "`limits` must be {numbers} numbers, none negative, one for each of the command"
            ));
        }
        if !(0.001..=1.0).contains(&self.reach_radius_m) {
            return Err("`reach_radius_m` must be 0.001 to 1".to_owned());
        }
        Ok(())
    }

    /// What the names stand for.
    ///
    /// - `parameters`: names of the experiment's numbers.
    /// - Errors: a name that nobody knows.
    pub fn features(&self, parameters: &[(String, f64)]) -> Result<Vec<Feature>, String> {
        let known = |name: &String| {
            Feature::named(name, parameters).ok_or_else(|| {
                format!(
                    "its manifest asks for `{name}`, which is not among what a policy may see: {}",
                    Feature::list()
                )
            })
        };
        self.observation.iter().map(known).collect()
    }
}
