//! What a policy may see of its robot: single numbers with names.

use crate::ranges::{BEAMS, FURTHEST_M};
use crate::view::{Place, Seen, View};

/// One number of an observation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Feature {
    /// From the robot to its present target, in its own frame; 0 without a target.
    GoalForward,
    GoalLeft,
    GoalDistance,
    /// Direction of the target against the robot's heading; 0 and 1 without one.
    GoalBearingSin,
    GoalBearingCos,
    /// Yaw at the target against the robot's yaw; 0 and 1 where it is free.
    GoalYawSin,
    GoalYawCos,
    /// In the world.
    X,
    Y,
    YawSin,
    YawCos,
    Forward,
    Left,
    YawRate,
    PoseAge,
    Time,
    /// [`crate::ranges`].
    Range(usize),
    /// From the robot to the nearest other one, in its own frame; [`FURTHEST_M`] ahead when there is none nearer.
    NearestForward,
    NearestLeft,
    /// A number of the experiment.
    Parameter(f64),
}

const NAMES: [(&str, Feature); 18] = [
    ("goal_forward_m", Feature::GoalForward),
    ("goal_left_m", Feature::GoalLeft),
    ("goal_distance_m", Feature::GoalDistance),
    ("goal_bearing_sin", Feature::GoalBearingSin),
    ("goal_bearing_cos", Feature::GoalBearingCos),
    ("goal_yaw_sin", Feature::GoalYawSin),
    ("goal_yaw_cos", Feature::GoalYawCos),
    ("x_m", Feature::X),
    ("y_m", Feature::Y),
    ("yaw_sin", Feature::YawSin),
    ("yaw_cos", Feature::YawCos),
    ("forward_m_per_s", Feature::Forward),
    ("left_m_per_s", Feature::Left),
    ("yaw_rate_rad_per_s", Feature::YawRate),
    ("pose_age_s", Feature::PoseAge),
    ("time_s", Feature::Time),
    ("nearest_forward_m", Feature::NearestForward),
    ("nearest_left_m", Feature::NearestLeft),
];

impl Feature {
    /// - `parameters`: the experiment's numbers, seen as `parameter_NAME`.
    pub fn named(name: &str, parameters: &[(String, f64)]) -> Option<Feature> {
        if let Some((_, feature)) = NAMES.iter().find(|(known, _)| *known == name) {
            return Some(*feature);
        }
        let beam = name
            .strip_prefix("range_")
            .and_then(|rest| rest.strip_suffix("_m")?.parse().ok());
        if let Some(beam) = beam.filter(|beam| *beam < BEAMS) {
            return Some(Feature::Range(beam));
        }
        let wanted = name.strip_prefix("parameter_")?;
        let given = parameters.iter().find(|(known, _)| known == wanted);
        given.map(|(_, value)| Feature::Parameter(*value))
    }

    /// All names, for a sentence.
    pub fn list() -> String {
        let names: Vec<&str> = NAMES.iter().map(|(name, _)| *name).collect();
        format!(
            "{}, range_0_m to range_{}_m, and parameter_NAME for numbers of the experiment",
            names.join(", "),
            BEAMS - 1
        )
    }

    /// Its value for a robot.
    ///
    /// - `target`: where the robot is to go now.
    pub fn value(self, view: &View, robot: usize, seen: &Seen, target: Option<&Place>) -> f64 {
        let turned = |dx: f64, dy: f64| {
            let (sin, cos) = (libm::sin(seen.yaw_rad), libm::cos(seen.yaw_rad));
            [cos * dx + sin * dy, cos * dy - sin * dx]
        };
        let goal = || target.map_or([0.0; 2], |place| turned(place.x_m - seen.x_m, place.y_m - seen.y_m));
        let bearing = || {
            let [forward, left] = goal();
            let way_m = libm::sqrt(forward * forward + left * left);
            if way_m < 1e-9 {
                [0.0, 1.0]
            } else {
                [left / way_m, forward / way_m]
            }
        };
        let yaw_off = || {
            target
                .and_then(|place| place.yaw_rad)
                .map_or(0.0, |yaw_rad| yaw_rad - seen.yaw_rad)
        };
        let nearest = || {
            let others = view
                .robots
                .iter()
                .enumerate()
                .filter(|(other, there)| *other != robot && there.x_m.is_finite());
            let ways = others.map(|(_, there)| turned(there.x_m - seen.x_m, there.y_m - seen.y_m));
            let square = |[forward, left]: &[f64; 2]| forward * forward + left * left;
            ways.filter(|way| square(way) < FURTHEST_M * FURTHEST_M)
                .min_by(|a, b| square(a).total_cmp(&square(b)))
                .unwrap_or([FURTHEST_M, 0.0])
        };
        match self {
            Feature::GoalForward => goal()[0],
            Feature::GoalLeft => goal()[1],
            Feature::GoalDistance => libm::sqrt(goal().iter().map(|along| along * along).sum()),
            Feature::GoalBearingSin => bearing()[0],
            Feature::GoalBearingCos => bearing()[1],
            Feature::GoalYawSin => libm::sin(yaw_off()),
            Feature::GoalYawCos => libm::cos(yaw_off()),
            Feature::X => seen.x_m,
            Feature::Y => seen.y_m,
            Feature::YawSin => libm::sin(seen.yaw_rad),
            Feature::YawCos => libm::cos(seen.yaw_rad),
            Feature::Forward => seen.forward_m_per_s,
            Feature::Left => seen.left_m_per_s,
            Feature::YawRate => seen.yaw_rate_rad_per_s,
            Feature::PoseAge => seen.age_s,
            Feature::Time => view.time_s,
            Feature::Range(beam) => seen.ranges_m.get(beam).copied().unwrap_or(FURTHEST_M),
            Feature::NearestForward => nearest()[0],
            Feature::NearestLeft => nearest()[1],
            Feature::Parameter(value) => value,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_name_is_known_and_others_are_not() {
        let parameters = [("gain".to_owned(), 2.5)];
        for (name, feature) in NAMES {
            assert_eq!(Feature::named(name, &parameters), Some(feature));
            assert!(Feature::list().contains(name));
        }
        assert_eq!(Feature::named("range_7_m", &parameters), Some(Feature::Range(7)));
        assert_eq!(
            Feature::named("parameter_gain", &parameters),
            Some(Feature::Parameter(2.5))
        );
        for bad in ["range_8_m", "range_-1_m", "range__m", "parameter_other", "goal", ""] {
            assert_eq!(Feature::named(bad, &parameters), None, "{bad}");
        }
    }

    #[test]
    fn a_target_to_the_left_is_seen_to_the_left() {
        let seen = |x_m: f64, y_m: f64, yaw_rad: f64| Seen {
            x_m,
            y_m,
            yaw_rad,
            age_s: 0.01,
            forward_m_per_s: 0.1,
            left_m_per_s: 0.0,
            yaw_rate_rad_per_s: -0.2,
            online: true,
            ranges_m: [1.5; BEAMS],
        };
        let view = View {
            tick: 240,
            time_s: 2.0,
            robots: vec![seen(1.0, 1.0, core::f64::consts::FRAC_PI_2), seen(1.0, 1.5, 0.0)],
        };
        let target = Place {
            x_m: 0.0,
            y_m: 1.0,
            yaw_rad: Some(core::f64::consts::PI),
        };
        let value = |feature: Feature| feature.value(&view, 0, &view.robots[0], Some(&target));
        let near = |a: f64, b: f64| (a - b).abs() < 1e-12;
        assert!(near(value(Feature::GoalForward), 0.0) && near(value(Feature::GoalLeft), 1.0));
        assert!(near(value(Feature::GoalBearingSin), 1.0) && near(value(Feature::GoalYawSin), 1.0));
        assert!(near(value(Feature::NearestForward), 0.5) && near(value(Feature::NearestLeft), 0.0));
        let free = Feature::GoalYawCos.value(&view, 0, &view.robots[0], None);
        assert!(near(free, 1.0) && near(Feature::GoalDistance.value(&view, 0, &view.robots[0], None), 0.0));
    }
}
