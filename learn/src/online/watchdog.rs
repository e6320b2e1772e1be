//! Whether what is being learned predicts worse than what it began with.

/// Weight of the newest prediction in the means.
const NEWEST: f64 = 0.1;
/// Predictions before a judgement.
const LEAST: u32 = 8;
/// Worse by this factor, and by this much beside it, is thrown away, m.
const FACTOR: f64 = 1.5;
const SLACK_M: f64 = 0.003;

/// Running means of squared place errors of both predictors.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Watchdog {
    parent_m2: f64,
    learnt_m2: f64,
    seen: u32,
}

impl Watchdog {
    /// Takes the place errors of one prediction, m.
    ///
    /// - Returns `true` when the learnt one is to be thrown away: clearly worse, or not a number.
    pub fn take(&mut self, parent_m: f64, learnt_m: f64) -> bool {
        if !learnt_m.is_finite() {
            return true;
        }
        self.seen += 1;
        let share = NEWEST.max(1.0 / f64::from(self.seen));
        self.parent_m2 += share * (parent_m * parent_m - self.parent_m2);
        self.learnt_m2 += share * (learnt_m * learnt_m - self.learnt_m2);
        let allowed_m = FACTOR * self.parent_m2.sqrt() + SLACK_M;
        self.seen >= LEAST && self.learnt_m2.sqrt() > allowed_m
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn worse_for_a_second_is_noticed_and_a_single_bad_prediction_is_not() {
        let mut watchdog = Watchdog::default();
        for number in 0..100 {
            let learnt_m = if number == 50 { 0.03 } else { 0.008 };
            assert!(!watchdog.take(0.010, learnt_m), "{number}");
        }
        let noticed = (0..20).position(|_| watchdog.take(0.010, 0.04));
        assert!(noticed.is_some_and(|after| after < 10), "{noticed:?}");
        assert!(Watchdog::default().take(0.01, f64::NAN));
    }
}
