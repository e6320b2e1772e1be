//! Programs that all differ, made from their numbers alone: what the gallery's few programs do not use is compared between
//! the builds, too.

mod code;
mod module;
mod script;

pub use module::module;
pub use script::script;

/// Scripts, and as many modules.
pub const COUNT: u64 = 100;
/// They differ from the first tick on, and the slowest build carries out all of them.
pub const DURATION_S: f64 = 1.0;

/// Numbers that look random and are the same on every machine [Steele, Lea, Flood 2014, SplitMix].
#[derive(Debug, Clone)]
pub struct Draw(u64);

impl Draw {
    pub fn new(seed: u64) -> Draw {
        Draw(seed)
    }

    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// 0 to `count` - 1.
    pub fn below(&mut self, count: u64) -> u64 {
        self.bits() % count
    }

    /// Hundredths from `low` up to, not including, `high`, both in hundredths.
    pub fn hundredths(&mut self, low: i64, high: i64) -> f64 {
        (low + self.below((high - low) as u64) as i64) as f64 / 100.0
    }

    pub fn pick<'a, T>(&mut self, from: &'a [T]) -> &'a T {
        &from[self.below(from.len() as u64) as usize]
    }

    pub fn chance(&mut self, percent: u64) -> bool {
        self.below(100) < percent
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_numbers_are_those_of_the_paper() {
        let mut draw = Draw::new(1_234_567);
        assert_eq!(
            [draw.bits(), draw.bits()],
            [6_457_827_717_110_365_317, 3_203_168_211_198_807_973]
        );
        let mut draw = Draw::new(1);
        assert!((0..1000).all(|_| (-0.3..0.5).contains(&draw.hundredths(-30, 50))));
    }
}
