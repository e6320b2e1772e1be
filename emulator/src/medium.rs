//! The medium between the robots' sockets and their firmware, both ways: rate, delay, loss, bursts, copies.
//!
//! One channel that all robots share carries one frame at a time (`robot::medium` has its rate). After its time on air a frame takes a
//! random time more; losses come singly and in bursts (Gilbert-Elliott). Time is an argument and the random numbers are seeded, so
//! the same frames at the same times have the same fate.

use crate::noise::Noise;
use robot::medium::{MediumKind, MediumProfile};
use std::collections::{BTreeMap, BinaryHeap};

/// A frame that would have to wait longer for the channel is dropped, as by a full buffer.
const MAX_WAIT_US: f64 = 100_000.0;
/// Frames on their way; more are dropped.
const MAX_ON_THEIR_WAY: usize = 4096;
/// How much later a copy arrives.
const COPY_AFTER_US: f64 = 1500.0;
/// How much later a frame arrives that others overtake.
const OVERTAKEN_US: f64 = 12_000.0;

/// Which way a frame goes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Way {
    /// Laboratory to robot.
    Down,
    /// Robot to laboratory.
    Up,
}

/// Random part of a medium: after its time on air a frame takes `least_us` and an exponential time more, cut off.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Behaviour {
    least_us: f64,
    mean_more_us: f64,
    most_us: f64,
    loss: f64,
    copies: f64,
    overtaken: f64,
    /// One bit of the frame is flipped.
    damage: f64,
    bursts: Option<Bursts>,
}

/// Interference that comes and goes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bursts {
    /// Mean length of a burst.
    pub mean_ms: f64,
    /// Share of the time.
    pub share: f64,
    /// Loss within a burst.
    pub loss: f64,
    /// Mean delay that comes on top within a burst.
    pub delay_ms: f64,
}

/// What a robot's faults add to the medium.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Impairment {
    pub delay_ms: f64,
    pub copies: f64,
    pub overtaken: f64,
    pub bursts: Option<Bursts>,
}

/// Whom a frame is for or from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hop {
    /// Position of the robot in the laboratory.
    pub robot: usize,
    pub way: Way,
    pub impairment: Impairment,
}

/// A frame at its arrival.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Arrival<P> {
    pub at_us: i64,
    pub robot: usize,
    pub way: Way,
    pub characters: Vec<u8>,
    pub peer: P,
}

/// What the medium has done.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Tally {
    pub sent: u64,
    pub delivered: u64,
    pub lost: u64,
    pub copied: u64,
    /// No room on the channel.
    pub crowded_out: u64,
    /// Time on air.
    pub busy_us: u64,
}

/// The medium with everything that is on its way.
#[derive(Debug)]
pub struct Medium<P> {
    profile: &'static MediumProfile,
    behaviour: Behaviour,
    random: Noise,
    channel_free_us: f64,
    air: Option<Burst>,
    /// By robot, for faults.
    own_bursts: BTreeMap<usize, Burst>,
    /// Newest arrival by robot and way: frames do not overtake one another by themselves.
    newest_us: BTreeMap<(usize, Way), f64>,
    on_their_way: BinaryHeap<Waiting<P>>,
    order: u64,
    tally: Tally,
}

#[derive(Debug)]
struct Waiting<P> {
    order: u64,
    arrival: Arrival<P>,
}

impl<P> Ord for Waiting<P> {
    /// The earliest is the greatest.
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        (other.arrival.at_us, other.order).cmp(&(self.arrival.at_us, self.order))
    }
}

impl<P> PartialOrd for Waiting<P> {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl<P> PartialEq for Waiting<P> {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl<P> Eq for Waiting<P> {}

/// A two-state process in time.
#[derive(Debug, Clone, Copy)]
struct Burst {
    settings: Bursts,
    on: bool,
    until_us: f64,
}

impl Burst {
    fn new(settings: Bursts, now_us: f64, random: &mut Noise) -> Self {
        let mut burst = Self {
            settings,
            on: random.uniform() < settings.share,
            until_us: now_us,
        };
        burst.until_us += burst.stay_us(random);
        burst
    }

    fn stay_us(&self, random: &mut Noise) -> f64 {
        let Bursts { mean_ms, share, .. } = self.settings;
        let mean_ms = if self.on {
            mean_ms
        } else {
            mean_ms * (1.0 - share) / share.max(1e-9)
        };
        1000.0 * mean_ms.max(0.1) * exponential(random)
    }

    fn is_on(&mut self, now_us: f64, random: &mut Noise) -> bool {
        while self.until_us < now_us {
            self.on = !self.on;
            self.until_us += self.stay_us(random);
        }
        self.on
    }
}

/// Mean 1.
fn exponential(random: &mut Noise) -> f64 {
    -(1.0 - random.uniform()).ln()
}

fn behaviour(kind: MediumKind) -> Behaviour {
    let ideal = Behaviour {
        least_us: 0.0,
        mean_more_us: 0.0,
        most_us: 0.0,
        loss: 0.0,
        copies: 0.0,
        overtaken: 0.0,
        damage: 0.0,
        bursts: None,
    };
    // Median 1.0 + 1.45 ln 2 = 2.0 ms, 99th percentile 1.0 + 1.45 ln 100 = 7.7 ms, then time on air and waiting.
    let wifi = Behaviour {
        least_us: 1_000.0,
        mean_more_us: 1_450.0,
        most_us: 10_000.0,
        loss: 0.003,
        copies: 0.0002,
        overtaken: 0.0002,
        damage: 0.0,
        bursts: None,
    };
    match kind {
        MediumKind::Ideal => ideal,
        MediumKind::Wifi => wifi,
        // 2.4 % of all frames: 0.8 in 2.65 % of the time, and 0.3 % otherwise.
        MediumKind::WifiBursty => Behaviour {
            bursts: Some(Bursts {
                mean_ms: 42.0,
                share: 0.0265,
                loss: 0.8,
                delay_ms: 8.0,
            }),
            ..wifi
        },
        MediumKind::Digimesh => Behaviour {
            least_us: 4_000.0,
            mean_more_us: 3_000.0,
            most_us: 40_000.0,
            loss: 0.01,
            copies: 0.001,
            ..ideal
        },
        MediumKind::Serial => Behaviour {
            least_us: 200.0,
            mean_more_us: 50.0,
            most_us: 1_000.0,
            damage: 0.0002,
            ..ideal
        },
    }
}

impl<P: Clone> Medium<P> {
    pub fn new(kind: MediumKind, seed: u64) -> Self {
        Self {
            profile: MediumProfile::of(kind),
            behaviour: behaviour(kind),
            random: Noise::new(seed, u64::MAX - 2),
            channel_free_us: 0.0,
            air: None,
            own_bursts: BTreeMap::new(),
            newest_us: BTreeMap::new(),
            on_their_way: BinaryHeap::new(),
            order: 0,
            tally: Tally::default(),
        }
    }

    pub fn profile(&self) -> &'static MediumProfile {
        self.profile
    }

    pub fn tally(&self) -> &Tally {
        &self.tally
    }

    /// Puts one frame on the air; every hop has its own fate. A broadcast is one frame with many hops.
    pub fn send(&mut self, now_us: i64, characters: &[u8], peer: &P, hops: &[Hop]) {
        let now_us = now_us as f64;
        self.tally.sent += 1;
        let begin_us = self.channel_free_us.max(now_us);
        let too_long = characters.len() > self.profile.max_frame_characters;
        if begin_us - now_us > MAX_WAIT_US || self.on_their_way.len() >= MAX_ON_THEIR_WAY || too_long {
            self.tally.crowded_out += 1;
            return;
        }
        let on_air_us = 1e6 * self.profile.frame_s(characters.len());
        self.channel_free_us = begin_us + on_air_us;
        self.tally.busy_us += on_air_us as u64;
        for hop in hops {
            self.carry(begin_us + on_air_us, characters, peer, hop);
        }
    }

    fn carry(&mut self, sent_us: f64, characters: &[u8], peer: &P, hop: &Hop) {
        let behaviour = self.behaviour;
        let (mut loss, mut delay_us) = (behaviour.loss, 1000.0 * hop.impairment.delay_ms.max(0.0));
        if let Some(settings) = behaviour.bursts {
            let air = self
                .air
                .get_or_insert_with(|| Burst::new(settings, sent_us, &mut self.random));
            if air.is_on(sent_us, &mut self.random) {
                loss = settings.loss;
                delay_us += 1000.0 * settings.delay_ms * exponential(&mut self.random);
            }
        }
        if let Some(settings) = hop.impairment.bursts {
            let own = self
                .own_bursts
                .entry(hop.robot)
                .or_insert_with(|| Burst::new(settings, sent_us, &mut self.random));
            own.settings = settings;
            if own.is_on(sent_us, &mut self.random) {
                loss = loss.max(settings.loss);
                delay_us += 1000.0 * settings.delay_ms * exponential(&mut self.random);
            }
        }
        if self.happens(loss) {
            self.tally.lost += 1;
            return;
        }
        let random_us = behaviour.least_us + behaviour.mean_more_us * exponential(&mut self.random);
        let mut at_us = sent_us + delay_us + random_us.min(behaviour.most_us);
        if self.happens(behaviour.overtaken.max(hop.impairment.overtaken)) {
            at_us += OVERTAKEN_US;
        } else {
            let newest_us = self.newest_us.entry((hop.robot, hop.way)).or_insert(at_us);
            at_us = at_us.max(*newest_us);
            *newest_us = at_us;
        }
        let mut characters = characters.to_vec();
        if self.happens(behaviour.damage) {
            let bit = (self.random.uniform() * 8.0 * characters.len() as f64) as usize;
            if let Some(byte) = characters.get_mut(bit / 8) {
                *byte ^= 1 << (bit % 8);
            }
        }
        if self.happens(behaviour.copies.max(hop.impairment.copies)) {
            self.tally.copied += 1;
            let after_us = COPY_AFTER_US * (0.2 + self.random.uniform());
            self.push(at_us + after_us, characters.clone(), peer, hop);
        }
        self.push(at_us, characters, peer, hop);
    }

    fn push(&mut self, at_us: f64, characters: Vec<u8>, peer: &P, hop: &Hop) {
        self.order += 1;
        self.on_their_way.push(Waiting {
            order: self.order,
            arrival: Arrival {
                at_us: at_us as i64,
                robot: hop.robot,
                way: hop.way,
                characters,
                peer: peer.clone(),
            },
        });
    }

    fn happens(&mut self, probability: f64) -> bool {
        probability > 0.0 && self.random.uniform() < probability
    }

    /// When the next frame arrives.
    pub fn next_us(&self) -> Option<i64> {
        self.on_their_way.peek().map(|waiting| waiting.arrival.at_us)
    }

    /// The next frame that has arrived by now, in the order of arrival.
    pub fn arrived(&mut self, now_us: i64) -> Option<Arrival<P>> {
        if self.next_us()? > now_us {
            return None;
        }
        self.tally.delivered += 1;
        self.on_their_way.pop().map(|waiting| waiting.arrival)
    }
}
