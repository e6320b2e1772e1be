//! A free place for one more robot or target.

use super::ScenarioArena;
use crate::safety::Geofence;
use crate::vector::{length, sub};

/// Places that are tried stand this far apart, m.
const GRID_M: f64 = 0.05;
/// Left around a robot that is put somewhere, m.
const SPACE_M: f64 = 0.05;

/// The place with the most room around it for a robot with a bounding circle of `radius_m`, m; `None` when there is none.
///
/// - `taken`: middle and radius of everything that stands there already, m.
pub fn free_place(arena: &ScenarioArena, taken: &[([f64; 2], f64)], radius_m: f64) -> Option<[f64; 2]> {
    let fence = Geofence::of(&arena.contents).ok().flatten();
    let half_m = [0.5 * arena.width_m, 0.5 * arena.height_m];
    let wide_m = radius_m + SPACE_M;
    let steps = half_m.map(|half_m| ((half_m - wide_m) / GRID_M).floor());
    if !steps.iter().all(|steps| (0.0..1e4).contains(steps)) {
        return None;
    }
    let [columns, rows] = steps.map(|steps| steps as i32);
    let mut best: Option<(f64, [f64; 2])> = None;
    for row in -rows..=rows {
        for column in -columns..=columns {
            let place = [GRID_M * f64::from(column), GRID_M * f64::from(row)];
            let stands = |at: &([f64; 2], f64)| length(sub(at.0, place)) - at.1 - wide_m;
            let robots_m = taken.iter().map(stands).fold(f64::INFINITY, f64::min);
            let walls_m = (half_m[0] - place[0].abs()).min(half_m[1] - place[1].abs()) - wide_m;
            // A wall may be twice as close: nobody drives out of it.
            let room_m = robots_m.min(2.0 * walls_m);
            let better = best.is_none_or(|(most_m, _)| room_m > most_m + 1e-9);
            let inside = |fence: &Geofence| fence.depth_m(place) >= wide_m;
            let [x_m, y_m] = place;
            if robots_m >= 0.0
                && better
                && arena.contents.fixed_overlap_m(x_m, y_m, wide_m).is_none()
                && arena.contents.pushable_overlap_m(x_m, y_m, wide_m).is_none()
                && fence.as_ref().is_none_or(inside)
            {
                best = Some((room_m, place));
            }
        }
    }
    best.map(|(_, place)| place)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn arena(contents: serde_json::Value) -> ScenarioArena {
        let text =
            serde_json::json!({"name": "a", "width_m": 4.0, "height_m": 3.0, "floor": "f", "contents": contents});
        serde_json::from_value(text).expect("an arena")
    }

    #[test]
    fn robots_are_put_apart_until_the_floor_is_full() {
        let empty = arena(serde_json::json!({}));
        let mut taken = Vec::new();
        while let Some(place) = free_place(&empty, &taken, 0.25) {
            for (other, _) in &taken {
                assert!(length(sub(*other, place)) >= 0.55 - 1e-9, "{place:?} {other:?}");
            }
            assert!(
                place[0].abs() <= 1.7 + 1e-9 && place[1].abs() <= 1.2 + 1e-9,
                "{place:?}"
            );
            taken.push((place, 0.25));
        }
        assert_eq!(taken[0].0[1], 0.0, "the first one between the walls");
        assert!(taken.len() >= 13, "{}", taken.len());
        assert_eq!(free_place(&empty, &[], 1.6), None);
        assert_eq!(free_place(&empty, &[], f64::NAN), None);
    }

    #[test]
    fn obstacles_and_geofence_are_kept_off() {
        let pose = serde_json::json!({"x_m": 0.0, "y_m": 0.0, "yaw_rad": 0.0});
        let furnished = arena(serde_json::json!({
            "fixed": [{"name": "box", "shape": {"rectangle": {"length_m": 1.0, "width_m": 3.0}}, "pose": pose}],
            "geofence": [[-2.0, -1.5], [0.5, -1.5], [0.5, 1.5], [-2.0, 1.5]]
        }));
        let mut taken = Vec::new();
        while let Some(place) = free_place(&furnished, &taken, 0.25) {
            assert!(place[0] <= -0.8 + 1e-9, "{place:?}");
            taken.push((place, 0.25));
        }
        assert!(taken.len() >= 4, "{taken:?}");
    }
}
