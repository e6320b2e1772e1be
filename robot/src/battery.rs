//! Battery monitor: voltage without its load, and a ladder of levels with hysteresis.
//!
//! ```text
//! V_rest = low-pass(V_bus + R I; tau),  I = sum V_k i_k / V_bus + I_idle
//! good -> low -> critical -> empty     when V_rest stays below the level's threshold for `dwell_s`
//! empty -> critical -> low -> good     when V_rest stays above the threshold of the level it leaves + hysteresis for `dwell_s`
//! ```

/// How much is left. `low`: no new run; `critical`: to the dock; `empty`: the robot stops by itself.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum Level {
    #[default]
    Good,
    Low,
    Critical,
    Empty,
}

impl Level {
    /// As on the link.
    pub fn to_byte(self) -> u8 {
        match self {
            Self::Good => 0,
            Self::Low => 1,
            Self::Critical => 2,
            Self::Empty => 3,
        }
    }

    /// `None` for bytes that mean nothing.
    pub fn from_byte(byte: u8) -> Option<Self> {
        [Self::Good, Self::Low, Self::Critical, Self::Empty]
            .get(usize::from(byte))
            .copied()
    }

    fn worse(self) -> Self {
        match self {
            Self::Good => Self::Low,
            Self::Low => Self::Critical,
            Self::Critical | Self::Empty => Self::Empty,
        }
    }

    fn better(self) -> Self {
        match self {
            Self::Good | Self::Low => Self::Good,
            Self::Critical => Self::Low,
            Self::Empty => Self::Critical,
        }
    }
}

/// Thresholds of the rest voltage, in descending order, and times.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BatterySettings {
    pub low_v: f64,
    pub critical_v: f64,
    pub empty_v: f64,
    /// Above a threshold by which a level is left again.
    pub hysteresis_v: f64,
    /// Inner resistance that the load compensation takes off.
    pub resistance_ohm: f64,
    /// Current of the electronics.
    pub idle_a: f64,
    /// Time constant of the low-pass filter.
    pub filter_s: f64,
    /// How long a voltage must stay beyond a threshold.
    pub dwell_s: f64,
}

impl BatterySettings {
    /// Thresholds for lithium cells as shares of the supply's nominal voltage: 0.945, 0.90 and 0.80.
    pub fn for_supply(supply_v: f64) -> Self {
        Self {
            low_v: 0.945 * supply_v,
            critical_v: 0.90 * supply_v,
            empty_v: 0.80 * supply_v,
            hysteresis_v: 0.015 * supply_v,
            resistance_ohm: 0.1,
            idle_a: 0.35,
            filter_s: 0.5,
            dwell_s: 1.0,
        }
    }

    fn threshold_v(&self, level: Level) -> f64 {
        match level {
            Level::Good => f64::INFINITY,
            Level::Low => self.low_v,
            Level::Critical => self.critical_v,
            Level::Empty => self.empty_v,
        }
    }
}

/// Pure state machine; its steps are `step_s` apart.
#[derive(Debug, Clone, Copy)]
pub struct BatteryMonitor {
    settings: BatterySettings,
    step_s: f64,
    rest_v: Option<f64>,
    level: Level,
    /// How long the voltage has asked for a worse level, and for a better one.
    worse_s: f64,
    better_s: f64,
}

impl BatteryMonitor {
    pub fn new(settings: BatterySettings, step_s: f64) -> Self {
        Self {
            settings,
            step_s,
            rest_v: None,
            level: Level::Good,
            worse_s: 0.0,
            better_s: 0.0,
        }
    }

    pub fn level(&self) -> Level {
        self.level
    }

    /// Filtered voltage without the load; 0 before the first sample.
    pub fn rest_v(&self) -> f64 {
        self.rest_v.unwrap_or(0.0)
    }

    /// Takes a sample of the bus voltage and of the electrical power that the motors draw.
    ///
    /// - Values that are not finite are left out.
    pub fn step(&mut self, bus_v: f64, motor_power_w: f64) -> Level {
        let settings = &self.settings;
        let load_a = motor_power_w / bus_v.max(1.0) + settings.idle_a;
        let compensated_v = bus_v + settings.resistance_ohm * load_a;
        if !compensated_v.is_finite() {
            return self.level;
        }
        let share = self.step_s / (settings.filter_s + self.step_s);
        let rest_v = self
            .rest_v
            .map_or(compensated_v, |before_v| before_v + share * (compensated_v - before_v));
        self.rest_v = Some(rest_v);
        let asks_worse = self.level != Level::Empty && rest_v < settings.threshold_v(self.level.worse());
        let asks_better =
            self.level != Level::Good && rest_v > settings.threshold_v(self.level) + settings.hysteresis_v;
        self.worse_s = if asks_worse { self.worse_s + self.step_s } else { 0.0 };
        self.better_s = if asks_better { self.better_s + self.step_s } else { 0.0 };
        if self.worse_s >= settings.dwell_s {
            self.level = self.level.worse();
            self.worse_s = 0.0;
        } else if self.better_s >= settings.dwell_s {
            self.level = self.level.better();
            self.better_s = 0.0;
        }
        self.level
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const STEP_S: f64 = 0.01;

    fn monitor() -> BatteryMonitor {
        BatteryMonitor::new(BatterySettings::for_supply(24.0), STEP_S)
    }

    /// Rest voltage of exactly this much under a load.
    fn sample(monitor: &mut BatteryMonitor, rest_v: f64, load_a: f64) -> Level {
        let bus_v = rest_v - 0.1 * (load_a + 0.35);
        monitor.step(bus_v, load_a * bus_v)
    }

    #[test]
    fn the_load_is_compensated() {
        let mut monitor = monitor();
        for k in 0..1000 {
            // 40 A at 0.1 ohm sag 4 V, well below every threshold.
            assert_eq!(
                sample(&mut monitor, 24.0, if k % 2 == 0 { 40.0 } else { 0.0 }),
                Level::Good
            );
        }
        assert!((monitor.rest_v() - 24.0).abs() < 1e-9, "{}", monitor.rest_v());
    }

    #[test]
    fn the_filter_is_first_order() {
        let mut monitor = monitor();
        sample(&mut monitor, 24.0, 0.0);
        for _ in 0..50 {
            sample(&mut monitor, 23.0, 0.0);
        }
        // Backward Euler: the gap shrinks by tau / (tau + h) a step.
        let mut gap_v = 1.0;
        for _ in 0..50 {
            gap_v *= 0.5 / (0.5 + STEP_S);
        }
        assert!((monitor.rest_v() - 23.0 - gap_v).abs() < 1e-9);
    }

    #[test]
    fn levels_come_one_after_the_other_and_go_with_hysteresis() {
        let mut monitor = monitor();
        let mut settle = |rest_v: f64| (0..1000).fold(Level::Good, |_, _| sample(&mut monitor, rest_v, 5.0));
        assert_eq!(settle(22.69), Level::Good);
        assert_eq!(settle(22.67), Level::Low);
        assert_eq!(settle(22.68 + 0.35), Level::Low, "within the hysteresis");
        assert_eq!(settle(22.68 + 0.37), Level::Good);
        assert_eq!(settle(21.5), Level::Critical);
        assert_eq!(settle(19.1), Level::Empty);
        assert_eq!(settle(19.2 + 0.35), Level::Empty);
        assert_eq!(settle(19.2 + 0.37), Level::Critical);
        assert_eq!(settle(24.0), Level::Good);
    }

    #[test]
    fn a_dip_shorter_than_the_dwell_changes_nothing() {
        let mut monitor = monitor();
        sample(&mut monitor, 24.0, 0.0);
        for _ in 0..10 {
            // 0.1 s at 10 V pull the filter down by 2.5 V; it is back above the threshold 0.35 s later.
            assert_eq!(sample(&mut monitor, 10.0, 0.0), Level::Good);
        }
        for _ in 0..1000 {
            assert_eq!(sample(&mut monitor, 24.0, 0.0), Level::Good);
        }
    }

    #[test]
    fn nonsense_is_left_out() {
        let mut monitor = monitor();
        sample(&mut monitor, 24.0, 0.0);
        for bad in [f64::NAN, f64::INFINITY] {
            assert_eq!(monitor.step(bad, 0.0), Level::Good);
            assert_eq!(monitor.step(20.0, bad), Level::Good);
        }
        assert!((monitor.rest_v() - 24.0).abs() < 1e-9);
    }
}
