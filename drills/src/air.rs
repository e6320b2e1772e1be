//! One direction of the robot link: frames on their way.

use emulator::noise::Noise;

/// What the air does to frames.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AirSettings {
    /// Shortest and longest time on the way; uniform between.
    pub delay_us: [i64; 2],
    /// Share of frames lost outside bursts.
    pub loss: f64,
    /// Share of frames at which a burst begins.
    pub burst: f64,
    /// Length of a burst; all of its frames are lost.
    pub burst_us: i64,
    /// Share of frames that arrive twice.
    pub copies: f64,
}

impl Default for AirSettings {
    /// A quiet WiFi.
    fn default() -> Self {
        Self {
            delay_us: [1000, 5000],
            loss: 0.0,
            burst: 0.0,
            burst_us: 0,
            copies: 0.0,
        }
    }
}

#[derive(Debug, Clone)]
struct Frame {
    due_us: i64,
    robot: usize,
    bytes: Vec<u8>,
}

/// See the module. Frames may overtake each other.
#[derive(Debug, Clone)]
pub struct Air {
    pub settings: AirSettings,
    /// Nothing passes at all: an antenna that is off.
    pub cut: bool,
    /// Nothing passes to or from this robot.
    pub cut_for: Option<usize>,
    random: Noise,
    frames: Vec<Frame>,
    burst_until_us: i64,
    /// Frames that were sent and that arrived.
    pub sent: u64,
    pub arrived: u64,
    /// Every frame as it left, lost or not, with its robot, when somebody wants to know.
    pub overheard: Option<Vec<(usize, Vec<u8>)>>,
}

impl Air {
    /// - `seed`, `stream`: of its randomness.
    pub fn new(settings: AirSettings, seed: u64, stream: u64) -> Self {
        Self {
            settings,
            cut: false,
            cut_for: None,
            random: Noise::new(seed, stream),
            frames: Vec::new(),
            burst_until_us: i64::MIN,
            sent: 0,
            arrived: 0,
            overheard: None,
        }
    }

    /// Whether frames are noted as they leave.
    #[must_use]
    pub fn overheard(mut self, is_overheard: bool) -> Self {
        self.overheard = is_overheard.then(Vec::new);
        self
    }

    /// A frame leaves.
    pub fn send(&mut self, robot: usize, bytes: &[u8], now_us: i64) {
        self.sent += 1;
        if let Some(overheard) = &mut self.overheard {
            overheard.push((robot, bytes.to_vec()));
        }
        let AirSettings {
            delay_us: [least, most],
            loss,
            burst,
            burst_us,
            copies,
        } = self.settings;
        if burst > 0.0 && self.random.uniform() < burst {
            self.burst_until_us = now_us + burst_us;
        }
        let lost = self.random.uniform() < loss || now_us < self.burst_until_us;
        if lost || self.cut || self.cut_for == Some(robot) {
            return;
        }
        let count = 1 + usize::from(copies > 0.0 && self.random.uniform() < copies);
        for _ in 0..count {
            let due_us = now_us + least + (self.random.uniform() * (most - least) as f64) as i64;
            self.frames.push(Frame {
                due_us,
                robot,
                bytes: bytes.to_vec(),
            });
        }
    }

    /// Hands over what is due, in the order of arrival.
    pub fn deliver(&mut self, now_us: i64, mut take: impl FnMut(usize, &[u8])) {
        loop {
            let due = self
                .frames
                .iter()
                .enumerate()
                .filter(|(_, frame)| frame.due_us <= now_us);
            let Some((first, _)) = due.min_by_key(|(place, frame)| (frame.due_us, *place)) else {
                return;
            };
            let frame = self.frames.remove(first);
            self.arrived += 1;
            take(frame.robot, &frame.bytes);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_arrive_in_time_and_shares_hold() {
        let settings = AirSettings {
            delay_us: [2000, 9000],
            loss: 0.3,
            copies: 0.1,
            ..AirSettings::default()
        };
        let mut air = Air::new(settings, 1, 2);
        let mut arrived = 0;
        for k in 0..10_000_i64 {
            air.send(0, &k.to_le_bytes(), k * 1000);
            air.deliver(k * 1000, |_, bytes| {
                let sent_us = i64::from_le_bytes(bytes.try_into().expect("eight bytes")) * 1000;
                assert!((2000..=10_000).contains(&(k * 1000 - sent_us)));
                arrived += 1;
            });
        }
        assert!((7400..8000).contains(&arrived), "0.7 x 1.1 of 10 000: {arrived}");
    }

    #[test]
    fn bursts_take_everything_for_their_time() {
        let settings = AirSettings {
            delay_us: [0, 0],
            burst: 1.0,
            burst_us: 5000,
            ..AirSettings::default()
        };
        let mut air = Air::new(settings, 1, 2);
        air.send(0, b"x", 0);
        air.settings.burst = 0.0;
        air.send(0, b"y", 4999);
        air.send(0, b"z", 5000);
        let mut seen = Vec::new();
        air.deliver(10_000, |_, bytes| seen.push(bytes.to_vec()));
        assert_eq!(seen, [b"z".to_vec()]);
    }
}
