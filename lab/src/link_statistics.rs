//! How well one robot's frames come through: measured, not configured.

/// Delays that quantiles are taken over: about one second of telemetry.
const DELAYS: usize = 128;

/// Collects; see [`LinkStatistics`].
#[derive(Debug, Clone)]
pub struct LinkMeter {
    received: u64,
    lost: u64,
    late: u64,
    refused: u64,
    replayed: u64,
    delays_us: [i64; DELAYS],
    next: usize,
}

/// Since the process started, delays over the last second.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct LinkStatistics {
    /// Frames used.
    pub received: u64,
    /// Sequence numbers that never came, or came too late to count.
    pub lost: u64,
    /// Copies, and frames overtaken by newer ones.
    pub late: u64,
    /// Damaged, forged or of no known type.
    pub refused: u64,
    /// Authentic, but of an older epoch, or older than they may be.
    pub replayed: u64,
    /// One way, robot to laboratory, by the estimated clock offset.
    pub delay_p50_ms: f64,
    pub delay_p95_ms: f64,
    /// Half of the range between the 5 % and the 95 % quantile.
    pub jitter_ms: f64,
}

impl LinkStatistics {
    /// Share of the robot's frames that did not come through.
    pub fn loss(&self) -> f64 {
        self.lost as f64 / (self.received + self.lost).max(1) as f64
    }
}

impl Default for LinkMeter {
    fn default() -> Self {
        Self {
            received: 0,
            lost: 0,
            late: 0,
            refused: 0,
            replayed: 0,
            delays_us: [i64::MAX; DELAYS],
            next: 0,
        }
    }
}

impl LinkMeter {
    /// A frame was used.
    ///
    /// - `step`: sequence numbers since the one before; a restart counts as 1.
    /// - `delay_us`: `None` while the clock offset is unknown.
    pub fn received(&mut self, step: i64, delay_us: Option<i64>) {
        self.received += 1;
        self.lost += u64::try_from(step - 1).unwrap_or(0);
        if let (Some(delay_us), Some(place)) = (delay_us, self.delays_us.get_mut(self.next)) {
            *place = delay_us;
            self.next = (self.next + 1) % DELAYS;
        }
    }

    /// A copy, or overtaken.
    pub fn late(&mut self) {
        self.late += 1;
    }

    /// Not a frame of this robot.
    pub fn refused(&mut self) {
        self.refused += 1;
    }

    /// Authentic and old.
    pub fn replayed(&mut self) {
        self.replayed += 1;
    }

    /// The figures now.
    pub fn statistics(&self) -> LinkStatistics {
        let mut known: Vec<i64> = self
            .delays_us
            .iter()
            .copied()
            .filter(|delay_us| *delay_us < i64::MAX)
            .collect();
        known.sort_unstable();
        let quantile_ms = |share: f64| {
            let rank = (share * known.len() as f64).ceil() as usize;
            known.get(rank.saturating_sub(1)).map_or(0.0, |us| *us as f64 * 1e-3)
        };
        let (p5_ms, delay_p95_ms) = (quantile_ms(0.05), quantile_ms(0.95));
        LinkStatistics {
            received: self.received,
            lost: self.lost,
            late: self.late,
            refused: self.refused,
            replayed: self.replayed,
            delay_p50_ms: quantile_ms(0.5),
            delay_p95_ms,
            jitter_ms: 0.5 * (delay_p95_ms - p5_ms),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gaps_are_losses_and_quantiles_cover_the_last_second() {
        let mut meter = LinkMeter::default();
        for _ in 0..500 {
            meter.received(1, Some(50_000));
        }
        for k in 0..DELAYS as i64 {
            meter.received(if k % 8 == 0 { 2 } else { 1 }, Some(1000 * (k % 16)));
        }
        meter.late();
        let seen = meter.statistics();
        assert_eq!((seen.received, seen.lost, seen.late), (628, 16, 1));
        assert!((seen.loss() - 16.0 / 644.0).abs() < 1e-12);
        assert_eq!((seen.delay_p50_ms, seen.delay_p95_ms), (7.0, 15.0));
        assert_eq!(seen.jitter_ms, 7.5);
    }

    #[test]
    fn nothing_heard_is_nothing() {
        assert_eq!(LinkMeter::default().statistics(), LinkStatistics::default());
    }
}
