//! Windows that an effect cannot touch: their residuals are those without it.

use super::Window;
use crate::hypothesis::Hypothesis;
use twin::effect::Effect;

/// How far beside its measured places a robot may be in a window, and in a twin of it, m.
const ASIDE_M: f64 = 0.1;

/// Effects that a model has beyond another one; none: the two differ in something that acts everywhere.
#[derive(Debug, Clone, Copy)]
pub struct Added<'a> {
    effects: &'a [Effect],
    /// [`Hypothesis::reach_m`]
    reach_m: f64,
}

impl<'a> Added<'a> {
    /// The last `count` effects of a model.
    pub fn last(model: &'a Hypothesis, count: usize) -> Added<'a> {
        Added {
            effects: &model.effects[model.effects.len() - count..],
            reach_m: model.reach_m(),
        }
    }

    /// Whether they may change anything in a window: a patch does under wheels that were near it.
    pub fn may_touch(&self, window: &Window) -> bool {
        let may_touch = |effect: &Effect| match effect.name.as_str() {
            "low_friction_patch" => {
                let centre_m = [effect.value("x"), effect.value("y")];
                window.came_near(centre_m, effect.value("radius") + self.reach_m + ASIDE_M)
            }
            _ => true,
        };
        self.effects.is_empty() || self.effects.iter().any(may_touch)
    }
}

impl Window {
    /// A measured place lies within a distance; true when none was measured.
    fn came_near(&self, centre_m: [f64; 2], distance_m: f64) -> bool {
        let poses = self
            .drive
            .poses
            .iter()
            .chain(self.rolling.iter().flat_map(|chain| &chain.poses));
        let mut places = poses.map(|pose| [pose.x_m, pose.y_m]).peekable();
        let is_near = |[x_m, y_m]: [f64; 2]| libm::hypot(x_m - centre_m[0], y_m - centre_m[1]) <= distance_m;
        places.peek().is_none() || is_near([self.start.pose.x_m, self.start.pose.y_m]) || places.any(is_near)
    }
}

#[cfg(test)]
mod tests {
    use super::super::made::{pose, window};
    use super::*;

    fn model(effects: &[Effect]) -> Hypothesis {
        let mut model = Hypothesis::nominal(&twin::golden::reference_robot("diff2"));
        model.effects.extend_from_slice(effects);
        model
    }

    fn patch(x_m: f64, radius_m: f64) -> Effect {
        let values = [("x", x_m), ("y", 0.0), ("radius", radius_m), ("scale", 0.3)];
        Effect::new("low_friction_patch", &values)
    }

    #[test]
    fn a_patch_touches_the_windows_in_which_wheels_were_near_it() {
        let here = window(Vec::new(), Vec::new(), vec![pose(0.6), pose(0.7)]);
        let blind = window(Vec::new(), Vec::new(), Vec::new());
        let near = model(&[patch(0.4, 0.2)]);
        let far = model(&[patch(1.0, 0.2)]);
        assert!(Added::last(&near, 1).may_touch(&here));
        assert!(!Added::last(&far, 1).may_touch(&here));
        assert!(Added::last(&far, 1).may_touch(&blind), "nobody knows where it was");
        let large = model(&[patch(1.0, 0.9)]);
        assert!(Added::last(&large, 1).may_touch(&here));
    }

    #[test]
    fn what_acts_everywhere_touches_all_windows_alone_and_beside_a_patch() {
        let here = window(Vec::new(), Vec::new(), vec![pose(0.6)]);
        let far = patch(1.0, 0.2);
        let both = model(&[Effect::new("floor_friction", &[("scale", 0.5)]), far.clone()]);
        assert!(Added::last(&both, 2).may_touch(&here));
        assert!(!Added::last(&both, 1).may_touch(&here), "the base has the friction");
        assert!(
            Added::last(&both, 0).may_touch(&here),
            "the two differ in something else"
        );
        let two = model(&[far.clone(), patch(-1.0, 0.1)]);
        assert!(!Added::last(&two, 2).may_touch(&here));
    }
}
