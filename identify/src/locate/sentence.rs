//! The findings of the location in a sentence.

use super::Located;
use crate::record::CHANNELS;
use crate::report::schema::Region;

/// Contrast between the loudest and the mean bin from which a variable is worth telling.
const CONTRAST: f64 = 1.8;

pub(super) fn sentence(located: &Located, runs: usize) -> String {
    let Some((class, share)) = located.channels.first().filter(|(_, share)| *share > 0.0) else {
        return "No gap above the floor.".to_owned();
    };
    let mut parts = vec![format!("{:.0} % of the gap is in {}", 100.0 * share, CHANNELS[*class])];
    let sharpest = located
        .regions
        .iter()
        .map(|region| (contrast(region), region))
        .filter(|(contrast, _)| contrast.0 > CONTRAST)
        .max_by(|a, b| a.0.0.total_cmp(&b.0.0));
    if let Some(((_, bin), region)) = sharpest {
        let (low, high) = (region.edges[bin], region.edges[bin + 1]);
        let of_other = if region.channel == CHANNELS[*class] {
            String::new()
        } else {
            format!(" of {}", region.channel)
        };
        parts.push(format!(
            "most{of_other} at {} {low:.2} to {high:.2} {}",
            region.variable, region.unit
        ));
    } else {
        parts.push("alike over all states".to_owned());
    }
    parts.push(on_the_floor(located));
    let mut with: Vec<&str> = located.segments.iter().map(|segment| segment.run.as_str()).collect();
    with.dedup();
    parts.push(if with.len() >= runs {
        "in all runs".to_owned()
    } else {
        format!("in {} of {runs} runs", with.len())
    });
    let mut text = parts.join(", ");
    text.push('.');
    text
}

/// Largest energy over the mean, and its bin.
fn contrast(region: &Region) -> (f64, usize) {
    let mean = region.energy.iter().sum::<f64>() / region.energy.len() as f64;
    let mut best = (0.0, 0);
    for (bin, energy) in region.energy.iter().enumerate() {
        if *energy > best.0 {
            best = (*energy, bin);
        }
    }
    (best.0 / mean.max(1e-9), best.1)
}

/// Everywhere, or around a place.
fn on_the_floor(located: &Located) -> String {
    let map = &located.floor_map;
    let total: f64 = map.energy.iter().map(|energy| (energy - 1.0).max(0.0)).sum();
    let (mut x, mut y) = (0.0, 0.0);
    for (k, energy) in map.energy.iter().enumerate() {
        let share = (energy - 1.0).max(0.0) / total.max(1e-9);
        x += share * map.x_m[k];
        y += share * map.y_m[k];
    }
    let near = |k: usize| {
        let (dx, dy) = (map.x_m[k] - x, map.y_m[k] - y);
        dx * dx + dy * dy < 0.5 * 0.5
    };
    let inside: f64 = (0..map.energy.len())
        .filter(|k| near(*k))
        .map(|k| (map.energy[k] - 1.0).max(0.0))
        .sum();
    let cells = (0..map.energy.len()).filter(|k| near(*k)).count() as f64 / map.energy.len().max(1) as f64;
    if total > 0.0 && inside / total > 0.6 && cells < 0.3 {
        format!("within 0.5 m of ({x:.1}, {y:.1})")
    } else {
        "everywhere on the floor".to_owned()
    }
}
