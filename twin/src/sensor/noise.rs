//! Seeded noise streams, passed into the sensors by the caller.

use serde::{Deserialize, Serialize};

/// Sensors with a stream of their own. The number is part of the stream and never changes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Sensor {
    Encoder = 1,
    Current = 2,
    BusVoltage = 3,
    Steering = 4,
    Gyro = 5,
    Accelerometer = 6,
    Magnetometer = 7,
    Range = 8,
    TrackedPose = 9,
}

/// Random numbers of one sensor of one robot: draw `n` is Philox4x32-10 of key `seed` and counter `(n, robot, sensor)`.
///
/// - Philox is a bijection of the counter, so no two streams of a seed share a block [Salmon et al. 2011, SC11].
/// - The position is all there is to save: a stream read back continues with the same bits.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NoiseStream {
    seed: u64,
    robot: u32,
    sensor: Sensor,
    /// Draws taken.
    position: u64,
}

impl NoiseStream {
    /// The stream of a sensor at its beginning; `robot` is the position of the robot in the world.
    pub fn new(seed: u64, robot: u32, sensor: Sensor) -> NoiseStream {
        NoiseStream {
            seed,
            robot,
            sensor,
            position: 0,
        }
    }

    /// Draws taken so far.
    pub fn position(&self) -> u64 {
        self.position
    }

    /// Uniform on [0, 1) with 53 bits.
    pub fn uniform(&mut self) -> f64 {
        let [word, _] = self.draw();
        (word >> 11) as f64 * UNIT
    }

    /// Standard normal (Box-Muller, one of the pair): sqrt(-2 ln u1) cos(2 pi u2), u1 in (0, 1]; at most 8.6 in magnitude.
    pub fn normal(&mut self) -> f64 {
        let [first, second] = self.draw();
        let u1 = ((first >> 11) + 1) as f64 * UNIT;
        let u2 = (second >> 11) as f64 * UNIT;
        (-2.0 * libm::log(u1)).sqrt() * libm::cos(core::f64::consts::TAU * u2)
    }

    /// A normal error to be added to a reading; nothing is drawn for a standard deviation of 0.
    pub fn error(&mut self, standard_deviation: f64) -> f64 {
        if standard_deviation > 0.0 {
            standard_deviation * self.normal()
        } else {
            // x + -0.0 has the bits of x, for x = -0.0 too.
            -0.0
        }
    }

    fn draw(&mut self) -> [u64; 2] {
        let low_high = |word: u64| [word as u32, (word >> 32) as u32];
        let [n_low, n_high] = low_high(self.position);
        self.position = self.position.wrapping_add(1);
        let [a, b, c, d] = philox(low_high(self.seed), [n_low, n_high, self.robot, self.sensor as u32]);
        [u64::from(b) << 32 | u64::from(a), u64::from(d) << 32 | u64::from(c)]
    }
}

/// 2^-53.
const UNIT: f64 = 1.0 / 9_007_199_254_740_992.0;

/// Philox4x32 with ten rounds.
fn philox(mut key: [u32; 2], mut counter: [u32; 4]) -> [u32; 4] {
    for round in 0..10 {
        if round > 0 {
            key = [key[0].wrapping_add(0x9E37_79B9), key[1].wrapping_add(0xBB67_AE85)];
        }
        let first = u64::from(counter[0]) * 0xD251_1F53;
        let second = u64::from(counter[2]) * 0xCD9E_8D57;
        counter = [
            (second >> 32) as u32 ^ counter[1] ^ key[0],
            second as u32,
            (first >> 32) as u32 ^ counter[3] ^ key[1],
            first as u32,
        ];
    }
    counter
}

/// One stream for every sensor of a robot.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NoiseStreams {
    pub encoder: NoiseStream,
    pub current: NoiseStream,
    pub bus_voltage: NoiseStream,
    pub steering: NoiseStream,
    pub gyro: NoiseStream,
    pub accelerometer: NoiseStream,
    pub magnetometer: NoiseStream,
    pub range: NoiseStream,
    pub tracked_pose: NoiseStream,
}

impl NoiseStreams {
    /// All streams of a robot at their beginning.
    pub fn new(seed: u64, robot: u32) -> NoiseStreams {
        let stream = |sensor| NoiseStream::new(seed, robot, sensor);
        NoiseStreams {
            encoder: stream(Sensor::Encoder),
            current: stream(Sensor::Current),
            bus_voltage: stream(Sensor::BusVoltage),
            steering: stream(Sensor::Steering),
            gyro: stream(Sensor::Gyro),
            accelerometer: stream(Sensor::Accelerometer),
            magnetometer: stream(Sensor::Magnetometer),
            range: stream(Sensor::Range),
            tracked_pose: stream(Sensor::TrackedPose),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Known answers of the Random123 distribution.
    #[test]
    fn philox_gives_the_published_answers() {
        assert_eq!(
            philox([0; 2], [0; 4]),
            [0x6627_e8d5, 0xe169_c58d, 0xbc57_ac4c, 0x9b00_dbd8]
        );
        assert_eq!(
            philox([u32::MAX; 2], [u32::MAX; 4]),
            [0x408f_276d, 0x41c8_3b0e, 0xa20b_c7c6, 0x6d54_51fd]
        );
        assert_eq!(
            philox(
                [0xa409_3822, 0x299f_31d0],
                [0x243f_6a88, 0x85a3_08d3, 0x1319_8a2e, 0x0370_7344]
            ),
            [0xd16c_fe09, 0x94fd_cceb, 0x5001_e420, 0x2412_6ea1]
        );
    }

    #[test]
    fn an_error_without_deviation_draws_nothing_and_keeps_every_bit() {
        let mut stream = NoiseStream::new(1, 0, Sensor::Gyro);
        for truth in [0.0, -0.0, 1.5, -2.5e-300] {
            assert_eq!((truth + stream.error(0.0)).to_bits(), f64::to_bits(truth));
        }
        assert_eq!(stream.position(), 0);
    }
}
