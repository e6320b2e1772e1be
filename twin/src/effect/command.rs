//! Effects between the set-point as sent and the speed loop: stages in list order, sampled at 480 Hz.

use super::Effect;
use crate::command::WheelCommand;
use crate::kinematics;
use crate::model::Model;
use crate::twist::BodyTwist;
use crate::{MAX_WHEELS, PHYSICS_PERIOD_S, PHYSICS_RATE_HZ, SUBSTEPS};

/// Numbers of one set-point in a stage's memory.
const COMMAND_WORDS: usize = MAX_WHEELS + 1;

/// One stage with the place of its memory.
#[derive(Debug, Clone)]
pub(crate) struct CommandStage {
    law: Law,
    at: usize,
}

#[derive(Debug, Clone)]
enum Law {
    DeadBand {
        width_rad_per_s: f64,
    },
    WheelLimit {
        limit_rad_per_s: f64,
    },
    BodyLimit {
        forward_m_per_s: f64,
        left_m_per_s: f64,
        yaw_rate_rad_per_s: f64,
    },
    Slew {
        rim_m_per_s2: f64,
    },
    Lag {
        share: f64,
    },
    SteeringFilter {
        share: f64,
    },
    /// Ring of the last `length` set-points; the delay in samples, with its fraction.
    Delay {
        samples: f64,
        length: usize,
    },
    Hold {
        loss_rate: f64,
        window: u64,
    },
}

impl CommandStage {
    /// The stage of an effect, if it is one of commands; its memory starts at `at`.
    pub(crate) fn new(effect: &Effect, at: usize) -> Option<CommandStage> {
        let law = match effect.name.as_str() {
            "command_dead_band" => Law::DeadBand {
                width_rad_per_s: effect.value("width"),
            },
            "wheel_speed_saturation" => Law::WheelLimit {
                limit_rad_per_s: effect.value("limit"),
            },
            "body_speed_saturation" => Law::BodyLimit {
                forward_m_per_s: effect.value("forward"),
                left_m_per_s: effect.value("left"),
                yaw_rate_rad_per_s: effect.value("yaw_rate"),
            },
            "acceleration_limit" => Law::Slew {
                rim_m_per_s2: effect.value("limit"),
            },
            "motor_lag" => Law::Lag {
                share: 1.0 - libm::exp(-PHYSICS_PERIOD_S / effect.value("time_constant")),
            },
            "command_delay" => {
                let samples = effect.value("delay") * f64::from(PHYSICS_RATE_HZ);
                Law::Delay {
                    samples,
                    length: samples as usize + 2,
                }
            }
            "command_hold" => Law::Hold {
                loss_rate: effect.value("loss_rate"),
                // At least one control tick: set-points come at that rate.
                window: ((effect.value("burst") * f64::from(PHYSICS_RATE_HZ)) as u64).max(u64::from(SUBSTEPS)),
            },
            _ => return None,
        };
        Some(CommandStage { law, at })
    }

    /// The steering's own filter, behind all others; `None` without one.
    pub(crate) fn steering_filter(time_constant_s: f64, at: usize) -> Option<CommandStage> {
        let law = Law::SteeringFilter {
            share: 1.0 - libm::exp(-PHYSICS_PERIOD_S / time_constant_s),
        };
        (time_constant_s > 0.0).then_some(CommandStage { law, at })
    }

    /// Numbers that the stage remembers.
    pub(crate) fn words(&self) -> usize {
        match &self.law {
            Law::DeadBand { .. } | Law::WheelLimit { .. } | Law::BodyLimit { .. } => 0,
            Law::Slew { .. } | Law::Lag { .. } | Law::SteeringFilter { .. } | Law::Hold { .. } => COMMAND_WORDS,
            Law::Delay { length, .. } => length * COMMAND_WORDS,
        }
    }

    /// Fills the memory as if this set-point had been in force for long.
    pub(crate) fn prime(&self, command: &WheelCommand, memory: &mut [f64]) {
        for words in memory[self.at..self.at + self.words()].chunks_exact_mut(COMMAND_WORDS) {
            store(words, command);
        }
    }

    /// Turns the set-point `to_go` physics steps before the first one into what leaves the stage: the memory fills as it would have.
    pub(crate) fn remember(&self, command: &mut WheelCommand, nominal: &Model, memory: &mut [f64], to_go: u64) {
        // A step that stands in the ring where the first one will find it.
        let step = match &self.law {
            Law::Delay { length, .. } => {
                let length = *length as u64;
                (length - to_go % length) % length
            }
            _ => 0,
        };
        self.apply(command, nominal, memory, step);
    }

    /// Turns the set-point of physics step `step` into what leaves the stage. `nominal` has the geometry the robot works with.
    #[inline]
    pub(crate) fn apply(&self, out: &mut WheelCommand, nominal: &Model, memory: &mut [f64], step: u64) {
        let memory = &mut memory[self.at..self.at + self.words()];
        match &self.law {
            Law::DeadBand { width_rad_per_s } => {
                for speed in &mut out.wheel_rad_per_s {
                    if speed.abs() < *width_rad_per_s {
                        *speed = 0.0;
                    }
                }
            }
            Law::WheelLimit { limit_rad_per_s } => {
                for speed in &mut out.wheel_rad_per_s {
                    *speed = speed.min(*limit_rad_per_s).max(-limit_rad_per_s);
                }
            }
            Law::BodyLimit {
                forward_m_per_s,
                left_m_per_s,
                yaw_rate_rad_per_s,
            } => {
                let twist = kinematics::twist_of_wheels(nominal, out);
                let clipped = |value: f64, limit: f64| value.min(limit).max(-limit);
                let limited = BodyTwist {
                    forward_m_per_s: clipped(twist.forward_m_per_s, *forward_m_per_s),
                    left_m_per_s: clipped(twist.left_m_per_s, *left_m_per_s),
                    yaw_rate_rad_per_s: clipped(twist.yaw_rate_rad_per_s, *yaw_rate_rad_per_s),
                };
                if limited != twist {
                    *out = kinematics::wheel_speeds(nominal, limited, out.steering_rad);
                }
            }
            Law::Slew { rim_m_per_s2 } => {
                for lane in (0..nominal.lanes).filter(|lane| nominal.driven[*lane]) {
                    let wheel = nominal.wheel_of_lane[lane];
                    let most = rim_m_per_s2 * PHYSICS_PERIOD_S / nominal.radius_m[lane];
                    let change = (out.wheel_rad_per_s[wheel] - memory[wheel]).min(most).max(-most);
                    memory[wheel] += change;
                    out.wheel_rad_per_s[wheel] = memory[wheel];
                }
            }
            Law::Lag { share } => {
                for (speed, filtered) in out.wheel_rad_per_s.iter_mut().zip(memory.iter_mut()) {
                    *filtered += share * (*speed - *filtered);
                    *speed = *filtered;
                }
            }
            Law::SteeringFilter { share } => {
                let filtered = &mut memory[MAX_WHEELS];
                *filtered += share * (out.steering_rad - *filtered);
                out.steering_rad = *filtered;
            }
            Law::Delay { samples, length } => {
                let at = step as usize % length;
                let slot = |back: usize| (if back > at { at + length - back } else { at - back }) * COMMAND_WORDS;
                let now = slot(0);
                store(&mut memory[now..now + COMMAND_WORDS], out);
                let whole = *samples as usize;
                let part = samples - whole as f64;
                let (newer, older) = (slot(whole), slot(whole + 1));
                let mix = |word: usize| memory[newer + word] + part * (memory[older + word] - memory[newer + word]);
                for (word, speed) in out.wheel_rad_per_s.iter_mut().enumerate() {
                    *speed = mix(word);
                }
                out.steering_rad = mix(MAX_WHEELS);
            }
            Law::Hold { loss_rate, window } => {
                if uniform(step / window) < *loss_rate {
                    *out = load(memory);
                } else {
                    store(memory, out);
                }
            }
        }
    }
}

fn store(words: &mut [f64], command: &WheelCommand) {
    words[..MAX_WHEELS].copy_from_slice(&command.wheel_rad_per_s);
    words[MAX_WHEELS] = command.steering_rad;
}

fn load(words: &[f64]) -> WheelCommand {
    let mut command = WheelCommand::default();
    command.wheel_rad_per_s.copy_from_slice(&words[..MAX_WHEELS]);
    command.steering_rad = words[MAX_WHEELS];
    command
}

/// A number in 0..1 that belongs to a burst: splitmix64 of its count (Steele, Lea, Flood 2014).
fn uniform(burst: u64) -> f64 {
    let mut z = (burst + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^= z >> 31;
    (z >> 11) as f64 * (1.0 / 9_007_199_254_740_992.0)
}
