//! The figures of the twin's benchmark against what is wanted.

use serde::{Deserialize, Serialize};

/// Robot-seconds per CPU-second that are wanted, by number of robots.
const TARGETS: [(usize, f64); 4] = [(1, 20_000.0), (10, 24_000.0), (100, 26_000.0), (1000, 26_000.0)];
/// Wanted speed in the browser over the native one.
const BROWSER_TARGET: f64 = 0.5;
/// Least share of physics steps above half friction for a figure to count.
const LEAST_SHARE: f64 = 0.2;
/// Most memory of one robot, bytes.
const MOST_BYTES: usize = 8 * 1024;

/// One row of the native program.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct NativeRow {
    pub chassis: String,
    pub robots: usize,
    pub effect: String,
    pub digest: bool,
    /// Robot-seconds per CPU-second, by repetition.
    pub rates: Vec<f64>,
    pub share_above_half_friction: f64,
    pub contact_ticks: u64,
    pub smallest_gap_m: f64,
    pub lap_digest: Option<String>,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Memory {
    pub chassis: String,
    pub effect: String,
    pub bytes_per_robot: usize,
    pub allocations_per_tick: f64,
}

/// What the native program says.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct NativeReport {
    pub twin_version: String,
    pub rows: Vec<NativeRow>,
    pub memory: Vec<Memory>,
}

/// One row of the browser.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct BrowserRow {
    pub chassis: String,
    pub robots: usize,
    pub effect: String,
    pub digest: bool,
    /// Robot-seconds per second that the page's thread was on a processor, by repetition.
    pub rates: Vec<f64>,
    /// The same by `performance.now`: what other programs took of the processor is in it.
    pub wall_rates: Vec<f64>,
    pub lap_digest: Option<String>,
}

/// Middle, least and most of several repetitions.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Spread {
    pub median: f64,
    pub least: f64,
    pub most: f64,
}

impl Spread {
    fn of(rates: &[f64]) -> Option<Spread> {
        let mut sorted = rates.to_vec();
        sorted.sort_by(f64::total_cmp);
        Some(Spread {
            median: *sorted.get(sorted.len() / 2)?,
            least: *sorted.first()?,
            most: *sorted.last()?,
        })
    }
}

#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Line {
    #[serde(flatten)]
    native: NativeRow,
    native_spread: Option<Spread>,
    target: f64,
    met: bool,
    browser: Option<BrowserRow>,
    browser_spread: Option<Spread>,
    /// Median in the browser over the native median.
    browser_ratio: Option<f64>,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Report {
    machine: String,
    twin_version: String,
    lines: Vec<Line>,
    memory: Vec<Memory>,
}

impl Report {
    pub fn new(native: NativeReport, browser: Option<Vec<BrowserRow>>) -> Report {
        let browser = browser.unwrap_or_default();
        let line = |row: NativeRow| {
            let same = |one: &&BrowserRow| {
                (&one.chassis, one.robots, &one.effect, one.digest)
                    == (&row.chassis, row.robots, &row.effect, row.digest)
            };
            let there = browser.iter().find(same).cloned();
            let native_spread = Spread::of(&row.rates);
            let browser_spread = there.as_ref().and_then(|row| Spread::of(&row.rates));
            let target = TARGETS
                .iter()
                .find(|(robots, _)| *robots == row.robots)
                .map_or(0.0, |(_, rate)| *rate);
            Line {
                met: native_spread.is_some_and(|spread| spread.median >= target),
                browser_ratio: native_spread
                    .zip(browser_spread)
                    .map(|(here, there)| there.median / here.median),
                native: row,
                native_spread,
                target,
                browser: there,
                browser_spread,
            }
        };
        Report {
            machine: machine(),
            twin_version: native.twin_version,
            lines: native.rows.into_iter().map(line).collect(),
            memory: native.memory,
        }
    }

    /// Why the figures do not count, or what takes too much memory. A missed speed is a figure, not a problem.
    pub fn problems(&self) -> Vec<String> {
        let mut problems = Vec::new();
        for line in &self.lines {
            let row = &line.native;
            let name = format!("{} N={} {}", row.chassis, row.robots, row.effect);
            if row.share_above_half_friction < LEAST_SHARE {
                problems.push(format!(
                    "{name}: only {:.3} of the steps above half friction",
                    row.share_above_half_friction
                ));
            }
            if row.contact_ticks > 0 {
                problems.push(format!("{name}: {} ticks with a contact", row.contact_ticks));
            }
            if line
                .browser
                .as_ref()
                .is_some_and(|there| there.lap_digest != row.lap_digest)
            {
                problems.push(format!("{name}: the browser's digest differs from the native one"));
            }
        }
        for one in self.memory.iter().filter(|one| one.bytes_per_robot > MOST_BYTES) {
            problems.push(format!(
                "{} {}: {} bytes a robot",
                one.chassis, one.effect, one.bytes_per_robot
            ));
        }
        problems
    }

    pub fn print(&self) {
        println!("\n{} on {}", self.twin_version, self.machine);
        println!(
            "robot-seconds per CPU-second, median (least - most); ratio: Chromium over native (!: below {BROWSER_TARGET}); >half: steps above half friction\n"
        );
        println!(
            "{:<7} {:>5} {:<19} {:<6} {:>7} {:>17} {:>7} {:<6} {:>8} {:>17} {:>6} {:>6} {:>8}",
            "chassis",
            "N",
            "effect",
            "digest",
            "native",
            "",
            "target",
            "",
            "Chromium",
            "",
            "ratio",
            ">half",
            "contacts"
        );
        for line in &self.lines {
            println!("{}", line.text());
        }
        println!();
        for one in &self.memory {
            println!(
                "{:<7} {:<19} {} bytes a robot (at most {MOST_BYTES}), {} allocations a tick",
                one.chassis, one.effect, one.bytes_per_robot, one.allocations_per_tick
            );
        }
    }
}

impl Line {
    fn text(&self) -> String {
        let range = |spread: &Option<Spread>| {
            spread.map_or(String::new(), |spread| {
                format!("({:.0} - {:.0})", spread.least, spread.most)
            })
        };
        let median = |spread: &Option<Spread>| spread.map_or(String::new(), |spread| format!("{:.0}", spread.median));
        let ratio = self.browser_ratio.map_or(String::new(), |ratio| {
            format!("{ratio:.2}{}", if ratio >= BROWSER_TARGET { "" } else { "!" })
        });
        let row = &self.native;
        format!(
            "{:<7} {:>5} {:<19} {:<6} {:>7} {:>17} {:>7.0} {:<6} {:>8} {:>17} {:>6} {:>5.1}% {:>8}",
            row.chassis,
            row.robots,
            row.effect,
            if row.digest { "on" } else { "off" },
            median(&self.native_spread),
            range(&self.native_spread),
            self.target,
            if self.met { "met" } else { "missed" },
            median(&self.browser_spread),
            range(&self.browser_spread),
            ratio,
            100.0 * row.share_above_half_friction,
            row.contact_ticks
        )
    }
}

/// Processor and number of cores.
fn machine() -> String {
    let text = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let model = text
        .lines()
        .find_map(|line| line.strip_prefix("model name")?.split_once(": "));
    let cores = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
    format!(
        "{}, {cores} cores",
        model.map_or("an unnamed processor", |(_, name)| name)
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(rates: &[f64], share: f64, contacts: u64) -> NativeRow {
        NativeRow {
            chassis: "omni4".into(),
            robots: 1,
            effect: "floor_friction".into(),
            digest: true,
            rates: rates.to_vec(),
            share_above_half_friction: share,
            contact_ticks: contacts,
            smallest_gap_m: 5.0,
            lap_digest: Some("a".into()),
        }
    }

    fn report(row: NativeRow, browser: &str) -> Report {
        let there = BrowserRow {
            chassis: row.chassis.clone(),
            robots: row.robots,
            effect: row.effect.clone(),
            digest: row.digest,
            rates: vec![8_000.0, 12_000.0, 11_000.0],
            wall_rates: vec![7_000.0],
            lap_digest: Some(browser.into()),
        };
        let memory = Memory {
            chassis: "omni4".into(),
            effect: "floor_friction".into(),
            bytes_per_robot: 9000,
            allocations_per_tick: 0.0,
        };
        let native = NativeReport {
            twin_version: "v".into(),
            rows: vec![row],
            memory: vec![memory],
        };
        Report::new(native, Some(vec![there]))
    }

    #[test]
    fn the_median_is_held_against_the_target_and_the_browser_against_it() {
        let report = report(row(&[21_000.0, 30_000.0, 22_000.0, 5_000.0, 23_000.0], 0.3, 0), "a");
        let line = &report.lines[0];
        assert_eq!(line.native_spread.unwrap().median, 22_000.0);
        assert!(line.met);
        assert_eq!(line.browser_ratio, Some(0.5));
        assert!(line.text().contains("met") && line.text().contains("30.0%"));
    }

    #[test]
    fn an_easy_drive_a_contact_other_bits_and_much_memory_are_problems() {
        assert_eq!(report(row(&[1.0], 0.3, 0), "a").problems().len(), 1, "memory alone");
        assert_eq!(report(row(&[1.0], 0.19, 1), "b").problems().len(), 4);
        assert!(!report(row(&[1.0], 0.3, 0), "a").lines[0].met);
    }
}
