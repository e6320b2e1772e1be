//! Kinds of sets, and which effect is whose turn.

use crate::background::{CHASSIS, robot};
use crate::effects::applicable;
use crate::set::Wish;
use anyhow::{Result, anyhow};
use emulator::noise::Noise;
use serde::{Deserialize, Serialize};
use twin::effect::library::LIBRARY;

/// What a set tries.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum Kind {
    /// One effect of the library
    Single,
    /// Nothing changed
    None,
    /// Two effects
    Pair,
    /// Four to six effects at once, no references
    Many,
    /// An effect that the library does not have
    Unknown,
    /// One effect, driven so that it does not show
    Poor,
    /// One effect, nothing but a task in a closed loop
    Closed,
    /// One effect; references driven otherwise than the changed runs
    Shifted,
    /// One effect, two disjoint halves
    Halves,
    /// Two effects, three rounds of diagnose, accept, rerun
    Rounds,
}

/// Kinds of the whole bench, over and over.
const CYCLE: [Kind; 40] = [
    Kind::Single,
    Kind::None,
    Kind::Single,
    Kind::Pair,
    Kind::None,
    Kind::Single,
    Kind::Unknown,
    Kind::None,
    Kind::Single,
    Kind::Poor,
    Kind::Single,
    Kind::None,
    Kind::Many,
    Kind::Single,
    Kind::Closed,
    Kind::None,
    Kind::Single,
    Kind::Shifted,
    Kind::Halves,
    Kind::Rounds,
    Kind::Single,
    Kind::None,
    Kind::Single,
    Kind::Pair,
    Kind::None,
    Kind::Single,
    Kind::Unknown,
    Kind::None,
    Kind::Single,
    Kind::Poor,
    Kind::Single,
    Kind::None,
    Kind::Many,
    Kind::Single,
    Kind::Closed,
    Kind::None,
    Kind::Single,
    Kind::Shifted,
    Kind::Single,
    Kind::None,
];

/// Effects of an unexcited set, which driving slowly straight on hides.
const HIDDEN_WHEN_SLOW: [&str; 9] = [
    "wheel_speed_saturation",
    "body_speed_saturation",
    "acceleration_limit",
    "lateral_slip",
    "track_width",
    "gyro_scale",
    "steering_scale",
    "steering_lag",
    "floor_friction",
];

impl Kind {
    /// Kind of a number, and how many of this kind came before.
    pub(crate) fn of(wished: Option<Kind>, number: u64) -> (Kind, u64) {
        let length = CYCLE.len() as u64;
        let (cycle, place) = (number / length, (number % length) as usize);
        let kind = CYCLE[place];
        let count = |kinds: &[Kind]| kinds.iter().filter(|other| **other == kind).count() as u64;
        match wished {
            Some(kind) => (kind, number),
            None => (kind, cycle * count(&CYCLE) + count(&CYCLE[..place])),
        }
    }
}

/// The first effect of a set: every one in turn, in an order of the seed.
pub(crate) fn effect_name(kind: Kind, seed: u64, ordinal: u64, wish: &Wish) -> Result<Option<&'static str>> {
    if matches!(kind, Kind::None | Kind::Unknown) {
        return Ok(None);
    }
    if let Some(name) = &wish.effect {
        let entry = LIBRARY.iter().find(|entry| entry.name == name.as_str());
        return entry
            .map(|entry| Some(entry.name))
            .ok_or_else(|| anyhow!("effect {name:?} is not in the library; docs/effects.md lists its names"));
    }
    let mut names: Vec<&'static str> = match kind {
        Kind::Poor => HIDDEN_WHEN_SLOW.to_vec(),
        _ => LIBRARY.iter().map(|entry| entry.name).collect(),
    };
    let lap = ordinal / names.len() as u64;
    let mut noise = Noise::new(seed ^ (kind as u64) << 32, lap);
    for place in (1..names.len()).rev() {
        names.swap(place, (noise.uniform() * (place + 1) as f64) as usize);
    }
    Ok(Some(names[(ordinal % names.len() as u64) as usize]))
}

pub(crate) fn chassis(effect: Option<&str>, wish: &Wish, noise: &mut Noise) -> Result<String> {
    let possible = |chassis: &&str| {
        let robot = robot(chassis, false);
        effect.is_none_or(|name| applicable(&robot).iter().any(|entry| entry.name == name))
    };
    let wished = |chassis: &&str| wish.chassis.as_ref().is_none_or(|wished| wished == chassis);
    let choices: Vec<&str> = CHASSIS
        .into_iter()
        .filter(|chassis| possible(chassis) && wished(chassis))
        .collect();
    if choices.is_empty() {
        let what = wish.chassis.clone().unwrap_or_default();
        return Err(anyhow!(
            "no chassis {what:?} for effect {:?}; chassis are {}",
            effect.unwrap_or("none"),
            CHASSIS.join(", ")
        ));
    }
    let choice = (noise.uniform() * choices.len() as f64) as usize;
    Ok(choices[choice.min(choices.len() - 1)].to_owned())
}
