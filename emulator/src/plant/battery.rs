//! Battery: open-circuit voltage over charge, inner resistance, and a slow recovery (one RC pair).

use super::Step;

/// Share of the inner resistance that shows with the recovery time.
const SLOW_SHARE: f64 = 0.5;
const RECOVERY_S: f64 = 8.0;
/// Electronics of the robot.
const IDLE_A: f64 = 0.35;
/// Charge a second on the rack, from empty to full in 15 minutes: a fast charger, so that nobody waits for long.
pub const RACK_CHARGE_PER_S: f64 = 1.0 / 900.0;

#[derive(Debug, Clone, Copy)]
pub struct Battery {
    pub nominal_v: f64,
    pub resistance_ohm: f64,
    pub capacity_ah: f64,
    /// 0 to 1.
    pub charge: f64,
    slow_v: f64,
    load_a: f64,
}

impl Battery {
    pub fn new(nominal_v: f64, resistance_ohm: f64, capacity_ah: f64, charge: f64) -> Self {
        Self {
            nominal_v,
            resistance_ohm,
            capacity_ah,
            charge: charge.clamp(0.0, 1.0),
            slow_v: 0.0,
            load_a: IDLE_A,
        }
    }

    /// Lithium cells: flat in the middle, steep at the end.
    fn open_circuit_v(&self) -> f64 {
        self.nominal_v * (0.98 + 0.1 * (self.charge - 0.5) - 0.25 * (0.12 - self.charge).max(0.0) / 0.12)
    }

    /// Voltage at the terminals under the last load.
    pub fn bus_v(&self) -> f64 {
        let fast_ohm = self.resistance_ohm * (1.0 - SLOW_SHARE);
        (self.open_circuit_v() - self.slow_v - fast_ohm * self.load_a).max(0.0)
    }

    /// Draws the power of the motors for a step; negative power flows back.
    pub fn step(&mut self, motor_power_w: f64, step: Step) {
        self.load_a = IDLE_A + motor_power_w / self.bus_v().max(1.0);
        self.slow_v += step.dt_s / RECOVERY_S * (self.load_a * self.resistance_ohm * SLOW_SHARE - self.slow_v);
        self.charge = (self.charge - step.dt_s * self.load_a / (3600.0 * self.capacity_ah)).clamp(0.0, 1.0);
    }

    /// A step on a charger that also feeds the electronics; it stops at `full`, and takes nothing from a fuller battery.
    pub fn charge(&mut self, full: f64, step: Step) {
        self.load_a = 0.0;
        self.slow_v -= step.dt_s / RECOVERY_S * self.slow_v;
        self.charge = (self.charge + step.dt_s * RACK_CHARGE_PER_S).min(full.max(self.charge));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn charges_at_the_stated_rate_and_stops_when_full() {
        let mut battery = Battery::new(24.0, 0.1, 10.0, 0.1);
        for _ in 0..900 {
            battery.charge(0.8, Step { dt_s: 0.1 });
        }
        assert!((battery.charge - 0.2).abs() < 1e-9, "a tenth in 90 s: {battery:?}");
        for _ in 0..6000 {
            battery.charge(0.8, Step { dt_s: 0.1 });
        }
        assert_eq!(battery.charge, 0.8);
        let mut fuller = Battery::new(24.0, 0.1, 10.0, 0.9);
        fuller.charge(0.8, Step { dt_s: 0.1 });
        assert_eq!(fuller.charge, 0.9);
    }

    #[test]
    fn sags_under_load_recovers_and_runs_down() {
        let mut battery = Battery::new(24.0, 0.1, 1.0, 0.8);
        let rest_v = battery.bus_v();
        for _ in 0..600 {
            battery.step(240.0, Step { dt_s: 0.1 });
        }
        assert!(battery.bus_v() < rest_v - 0.9 && battery.charge < 0.66, "{battery:?}");
        let loaded_v = battery.bus_v();
        for _ in 0..600 {
            battery.step(0.0, Step { dt_s: 0.1 });
        }
        assert!(battery.bus_v() > loaded_v + 0.5);
        for _ in 0..12_000 {
            battery.step(240.0, Step { dt_s: 0.1 });
        }
        assert!(battery.charge == 0.0 && battery.bus_v() < 0.75 * rest_v, "{battery:?}");
    }
}
