//! The findings of the location in a sentence.

use super::Located;
use crate::record::CHANNELS;
use crate::report::schema::Region;

/// Contrast between the loudest and the mean bin from which a variable is worth telling.
const CONTRAST: f64 = 1.8;

/// - `runs`: how many were searched; those kept for checking are not located.
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
        "in all runs searched".to_owned()
    } else {
        format!("in {} of {runs} runs searched", with.len())
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

/// Most of it is on a part of the floor, and twice what that part would have by its size.
///
/// - `share`, `cells`: of the gap and of the cells that lie there.
fn is_concentrated(share: f64, cells: f64) -> bool {
    share > 0.6 && share > 2.0 * cells
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
    if total > 0.0 && is_concentrated(inside / total, cells) {
        format!("within 0.5 m of ({x:.1}, {y:.1})")
    } else {
        "everywhere on the floor".to_owned()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_place_has_most_of_the_gap_and_twice_its_part_of_the_floor() {
        assert!(
            is_concentrated(0.88, 0.33),
            "a slippery spot on a third of what little was driven on"
        );
        assert!(is_concentrated(0.61, 0.29));
        assert!(!is_concentrated(0.61, 0.31), "hardly more than elsewhere");
        assert!(!is_concentrated(0.5, 0.1), "half of it is elsewhere");
        assert!(!is_concentrated(1.0, 0.6), "the robot was hardly anywhere else");
    }
}
