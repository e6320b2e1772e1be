//! Obstacles as the sweep and the solver need them.

use crate::world::Contents;
use crate::world::obstacle::Obstacle;
use crate::world::shape::Placed;

/// Constants of all obstacles of a world.
#[derive(Debug, Clone, Default)]
pub(crate) struct Furniture {
    pub(crate) fixed: Vec<Placed>,
    pub(crate) pushable: Vec<Obstacle>,
    pub(crate) largest_pushable_m: f64,
    /// Fixed obstacles by the x of their centre, then by index.
    fixed_by_x: Vec<u32>,
    /// Their largest bounding radius.
    largest_fixed_m: f64,
}

impl Furniture {
    pub(crate) fn new(contents: &Contents) -> Furniture {
        let fixed: Vec<Placed> = contents
            .fixed
            .iter()
            .map(|one| Placed::new(one.shape, one.pose))
            .collect();
        let tilt_rad = [contents.tilt_x_rad, contents.tilt_y_rad];
        let pushable: Vec<Obstacle> = contents
            .pushable
            .iter()
            .map(|one| Obstacle::new(one, tilt_rad))
            .collect();
        let mut fixed_by_x: Vec<u32> = (0..fixed.len() as u32).collect();
        fixed_by_x.sort_by(|a, b| fixed[*a as usize].x_m.total_cmp(&fixed[*b as usize].x_m).then(a.cmp(b)));
        let largest = |radii: &mut dyn Iterator<Item = f64>| radii.fold(0.0_f64, f64::max);
        Furniture {
            largest_pushable_m: largest(&mut pushable.iter().map(|one| one.radius_m)),
            largest_fixed_m: largest(&mut fixed.iter().map(|one| one.shape.bounding_radius_m())),
            fixed,
            pushable,
            fixed_by_x,
        }
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.fixed.is_empty() && self.pushable.is_empty()
    }

    /// Adds the fixed obstacles nearer than `reach_m` to a point.
    pub(crate) fn fixed_within(&self, x_m: f64, y_m: f64, reach_m: f64, found: &mut Vec<u32>) {
        found.extend(self.near(x_m, y_m, reach_m));
    }

    pub(crate) fn has_fixed_within(&self, x_m: f64, y_m: f64, reach_m: f64) -> bool {
        self.near(x_m, y_m, reach_m).next().is_some()
    }

    fn near(&self, x_m: f64, y_m: f64, reach_m: f64) -> impl Iterator<Item = u32> + '_ {
        let widest_m = reach_m + self.largest_fixed_m;
        let x_of = |fixed: &u32| self.fixed[*fixed as usize].x_m;
        let first = self.fixed_by_x.partition_point(|fixed| x_of(fixed) < x_m - widest_m);
        self.fixed_by_x[first..]
            .iter()
            .take_while(move |fixed| x_of(fixed) <= x_m + widest_m)
            .filter(move |fixed| self.fixed[**fixed as usize].distance_m(x_m, y_m) < reach_m)
            .copied()
    }
}
