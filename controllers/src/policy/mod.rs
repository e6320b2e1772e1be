//! Trained networks as controllers: an ONNX file with a manifest inside, evaluated by this library so that browser and
//! laboratory compute the same bits (ADR 0011 says why not by ONNX Runtime; a test holds the values against it).
//!
//! Every robot is asked by itself: its observation in, its command out. Its targets are gone to one after the other.

mod graph;
mod manifest;
mod network;
mod observation;

pub use manifest::{Command, FORMAT, KEY, MAX_FEATURES, Manifest};
pub use network::Network;
pub use observation::Feature;

use control::law::{Fault, FaultKind};
use onnx::{Message, Model};

use crate::answer::{Answer, Motion, Order, Say};
use crate::limits::POLICY_OPERATIONS;
use crate::program::{Program, Reply};
use crate::source::refused;
use crate::view::{Place, Seen, Setup, View};

/// A policy and its manifest, checked.
#[derive(Debug)]
pub struct Policy {
    pub manifest: Manifest,
    pub network: Network,
}

impl Policy {
    /// Reads an ONNX file.
    ///
    /// - Errors: what is wrong with it, in words for whoever exported it.
    pub fn read(bytes: &[u8]) -> Result<Policy, String> {
        let model = Model::decode(bytes).map_err(|error| format!("it is no ONNX file: {error}"))?;
        let entry = model.metadata_props.iter().find(|entry| entry.key == KEY);
        let text = entry.map(|entry| entry.value.as_str()).ok_or_else(|| {
            format!("it has no manifest: put one under `{KEY}` into the file's `metadata_props` (docs/controllers.md, Policies)")
        })?;
        let manifest = Manifest::read(text)?;
        let network = Network::new(&model)?;
        let (inputs, outputs) = (manifest.observation.len(), manifest.command.numbers());
        if network.inputs() != inputs {
            let takes = network.inputs();
            return Err(format!(
                "its network takes {takes} numbers, its manifest names {inputs} of an observation"
            ));
        }
        if network.outputs() != outputs {
            let gives = network.outputs();
            return Err(format!(
                "its network gives {gives} numbers, the command of its manifest has {outputs}"
            ));
        }
        Ok(Policy { manifest, network })
    }
}

/// See the module.
#[derive(Debug)]
pub(crate) struct PolicyProgram {
    policy: Policy,
    features: Vec<Feature>,
    robots: Vec<Pilot>,
    ticks_per_answer: u64,
}

/// What is known of one robot.
#[derive(Debug, Clone)]
struct Pilot {
    targets: Vec<Place>,
    /// Number of the target it goes to.
    at: usize,
    say: Say,
}

impl PolicyProgram {
    /// Checks a policy against what the experiment gives it.
    pub(crate) fn new(bytes: &[u8], setup: &Setup) -> Result<PolicyProgram, Fault> {
        let because = |reason: String| refused(format!("the policy is refused: {reason}"));
        let policy = Policy::read(bytes).map_err(because)?;
        let features = policy.manifest.features(&setup.parameters).map_err(because)?;
        // Counted at the rate of control: all robots are asked in the same tick.
        let operations = policy.network.operations() * setup.robots.len() as u64;
        if operations > POLICY_OPERATIONS {
            return Err(because(format!(
                "its network takes {operations} operations for {} robots in a tick; {POLICY_OPERATIONS} are allowed: make it smaller",
                setup.robots.len()
            )));
        }
        let robots = setup.robots.iter().map(|member| Pilot {
            targets: member.targets.clone(),
            at: 0,
            say: Say::default(),
        });
        Ok(PolicyProgram {
            ticks_per_answer: u64::from(setup.rate_hz / policy.manifest.rate_hz).max(1),
            robots: robots.collect(),
            policy,
            features,
        })
    }
}

impl Program for PolicyProgram {
    fn step(&mut self, view: &View, answer: &mut Answer) -> Result<Reply, Fault> {
        let is_asked = view.tick.is_multiple_of(self.ticks_per_answer);
        let Policy { manifest, network } = &mut self.policy;
        for (robot, ((seen, pilot), say)) in view
            .robots
            .iter()
            .zip(&mut self.robots)
            .zip(&mut answer.robots)
            .enumerate()
        {
            if is_asked && seen.x_m.is_finite() {
                pilot.advance(seen, manifest.reach_radius_m);
                let target = pilot.target().copied();
                for (feature, number) in self.features.iter().zip(network.input_mut()) {
                    *number = feature.value(view, robot, seen, target.as_ref()) as f32;
                }
                let order = order(manifest, network.evaluate()).map_err(|reason| {
                    Fault::new(
                        FaultKind::BadCommand,
                        Some(view.tick),
                        format!("the policy's answer for robot {robot} {reason}"),
                    )
                })?;
                pilot.say = Say {
                    order: Some(order),
                    target_m: target.map(|place| [place.x_m, place.y_m]),
                    finished: !pilot.targets.is_empty() && pilot.at >= pilot.targets.len(),
                };
            }
            *say = pilot.say;
        }
        Ok(Reply::InTime)
    }
}

impl Pilot {
    /// The last target stays the target.
    fn target(&self) -> Option<&Place> {
        self.targets.get(self.at).or_else(|| self.targets.last())
    }

    fn advance(&mut self, seen: &Seen, reach_m: f64) {
        while let Some(place) = self.targets.get(self.at) {
            let (dx, dy) = (place.x_m - seen.x_m, place.y_m - seen.y_m);
            if dx * dx + dy * dy > reach_m * reach_m {
                break;
            }
            self.at += 1;
        }
    }
}

/// The command that an answer of the network stands for.
fn order(manifest: &Manifest, numbers: &[f32]) -> Result<Order, String> {
    let mut cut = [0.0; 3];
    for ((to, number), limit) in cut.iter_mut().zip(numbers).zip(&manifest.limits) {
        if !number.is_finite() {
            return Err(format!("holds {number}, which is no possible number"));
        }
        *to = f64::from(*number).clamp(-limit, *limit);
    }
    Ok(match manifest.command {
        Command::Twist => Order::twist(cut),
        Command::Velocity => Order {
            motion: Motion::Velocity([cut[0], cut[1]]),
            yaw_rad: None,
            steering_rad: None,
        },
    })
}
