//! Where the gap is: channels, times, states, places.

mod sentence;
mod state;

pub use state::{VARIABLES, Variable, states};

use crate::floor::Floor;
use crate::record::{CHANNELS, CLASSES, Place, Record};
use crate::report::schema::{FloorMap, Region, Segment};

/// What was found.
#[derive(Debug, Clone, Default)]
pub struct Located {
    pub sentence: String,
    /// Channels with their share of the excess, largest first.
    pub channels: Vec<(usize, f64)>,
    pub segments: Vec<Segment>,
    pub regions: Vec<Region>,
    pub floor_map: FloorMap,
}

/// Places on the floor that are worth a start.
const PLACES: usize = 3;
/// Distance within which cells belong to a place, m.
const NEAR_M: f64 = 0.5;

impl Located {
    /// Takes over what is known better of the channels, largest share first.
    pub fn rank(&mut self, channels: Vec<(usize, f64)>, runs: usize) {
        self.channels = channels;
        self.sentence = sentence::sentence(self, runs);
    }

    /// Centres of the loudest parts of the floor.
    pub fn loud_places(&self) -> Vec<(f64, f64)> {
        let map = &self.floor_map;
        let mut left: Vec<f64> = map.energy.iter().map(|energy| (energy - 1.0).max(0.0)).collect();
        let mut places = Vec::new();
        while places.len() < PLACES {
            let near = |a: usize, b: usize| {
                let (dx, dy) = (map.x_m[a] - map.x_m[b], map.y_m[a] - map.y_m[b]);
                dx * dx + dy * dy < NEAR_M * NEAR_M
            };
            let mass = |k: usize| {
                (0..left.len())
                    .filter(|other| near(k, *other))
                    .map(|other| left[other])
                    .sum::<f64>()
            };
            let Some(best) = (0..left.len()).max_by(|a, b| mass(*a).total_cmp(&mass(*b))) else {
                break;
            };
            let total = mass(best);
            if total <= 0.0 {
                break;
            }
            let own: Vec<usize> = (0..left.len()).filter(|other| near(best, *other)).collect();
            let mean = |values: &[f64]| own.iter().map(|k| left[*k] * values[*k]).sum::<f64>() / total;
            places.push((mean(&map.x_m), mean(&map.y_m)));
            own.iter().for_each(|k| left[*k] = 0.0);
        }
        places
    }
}

/// Bins of a state variable.
const BINS: usize = 8;
/// Side of a floor cell, m.
const MAP_CELL_M: f64 = 0.2;
/// Windows with this many times the floor's energy are segments of the gap.
const LOUD: f64 = 3.0;

/// One residual with its energy over the floor's and its state.
struct Entry {
    place: Place,
    run: usize,
    energy: f64,
    residual: f64,
    state: [f64; VARIABLES.len()],
}

/// Finds where residuals exceed the floor.
pub fn locate(floor: &Floor, records: &[Record], residuals: &[Vec<f64>]) -> Located {
    let entries = entries(floor, records, residuals);
    let mut located = Located {
        channels: channels(&entries),
        segments: segments(records, &entries),
        floor_map: floor_map(&entries),
        ..Located::default()
    };
    if let Some((class, _)) = located.channels.first() {
        located.regions = VARIABLES
            .iter()
            .enumerate()
            .filter_map(|(variable, _)| region(&entries, *class, variable))
            .collect();
    }
    located.sentence = sentence::sentence(&located, records.len());
    located
}

fn entries(floor: &Floor, records: &[Record], residuals: &[Vec<f64>]) -> Vec<Entry> {
    let Some(robot) = floor.model.robot() else {
        return Vec::new();
    };
    let mut entries = Vec::new();
    for (run, (record, residual)) in records.iter().zip(residuals).enumerate() {
        let states = states(&robot, record);
        let weights = floor.noise.weights(record);
        let places = record.places().into_iter().zip(states);
        for (((place, state), value), weight) in places.zip(residual).zip(weights) {
            let Some(quantity) = place.quantity else { continue };
            entries.push(Entry {
                energy: weight * floor.noise.classes[quantity.class()].correlation * value * value,
                residual: *value,
                run,
                state,
                place,
            });
        }
    }
    entries
}

fn class_of(entry: &Entry) -> usize {
    entry.place.quantity.map_or(0, |quantity| quantity.class())
}

fn channels(entries: &[Entry]) -> Vec<(usize, f64)> {
    let mut excess = [0.0; CLASSES];
    let mut seen = [false; CLASSES];
    for entry in entries {
        excess[class_of(entry)] += entry.energy - 1.0;
        seen[class_of(entry)] = true;
    }
    let total: f64 = excess.iter().map(|e: &f64| e.max(0.0)).sum();
    let mut shares: Vec<(usize, f64)> = (0..CLASSES)
        .filter(|class| seen[*class])
        .map(|class| (class, excess[class].max(0.0) / total.max(1e-9)))
        .collect();
    shares.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
    shares
}

fn segments(records: &[Record], entries: &[Entry]) -> Vec<Segment> {
    let mut found: Vec<Segment> = Vec::new();
    for (run, record) in records.iter().enumerate() {
        let mut sums = vec![(0.0, 0.0); record.windows.len()];
        for entry in entries.iter().filter(|entry| entry.run == run) {
            let (sum, count) = &mut sums[entry.place.window];
            *sum += entry.energy;
            *count += 1.0;
        }
        for (window, (sum, count)) in record.windows.iter().zip(sums) {
            if count == 0.0 || sum / count < LOUD {
                continue;
            }
            match found.last_mut() {
                Some(last) if last.run == record.name && window.from_s - last.to_s < 0.6 => last.to_s = window.to_s,
                _ => found.push(Segment {
                    run: record.name.clone(),
                    from_s: window.from_s,
                    to_s: window.to_s,
                }),
            }
        }
    }
    found
}

/// Energy of a channel over a variable; `None` when the variable hardly moves.
fn region(entries: &[Entry], class: usize, variable: usize) -> Option<Region> {
    let own: Vec<&Entry> = entries.iter().filter(|entry| class_of(entry) == class).collect();
    let values = || own.iter().map(|entry| entry.state[variable]);
    let low = values().fold(f64::INFINITY, f64::min);
    let high = values().fold(f64::NEG_INFINITY, f64::max);
    if own.len() < 10 * BINS || high - low < 0.02 {
        return None;
    }
    let width = (high - low) / BINS as f64;
    let mut bins = [(0.0, 0.0, 0.0); BINS];
    for entry in &own {
        let bin = (((entry.state[variable] - low) / width) as usize).min(BINS - 1);
        bins[bin].0 += entry.energy;
        bins[bin].1 += entry.residual;
        bins[bin].2 += 1.0;
    }
    let (_, words, unit) = VARIABLES[variable];
    let mean = |bin: &(f64, f64, f64), value: f64| if bin.2 > 0.0 { value / bin.2 } else { 0.0 };
    Some(Region {
        variable: words.to_owned(),
        unit: unit.to_owned(),
        channel: CHANNELS[class].to_owned(),
        edges: (0..=BINS).map(|k| low + k as f64 * width).collect(),
        energy: bins.iter().map(|bin| mean(bin, bin.0)).collect(),
        mean: bins.iter().map(|bin| mean(bin, bin.1)).collect(),
    })
}

fn floor_map(entries: &[Entry]) -> FloorMap {
    let mut cells: std::collections::BTreeMap<(i64, i64), (f64, f64)> = std::collections::BTreeMap::new();
    for entry in entries {
        let key = |value: f64| libm::floor(value / MAP_CELL_M) as i64;
        let cell = cells
            .entry((key(entry.place.x_m), key(entry.place.y_m)))
            .or_insert((0.0, 0.0));
        cell.0 += entry.energy;
        cell.1 += 1.0;
    }
    let centre = |key: i64| (key as f64 + 0.5) * MAP_CELL_M;
    FloorMap {
        cell_m: MAP_CELL_M,
        x_m: cells.keys().map(|key| centre(key.0)).collect(),
        y_m: cells.keys().map(|key| centre(key.1)).collect(),
        energy: cells.values().map(|(sum, count)| sum / count).collect(),
    }
}
