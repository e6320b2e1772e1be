//! What the safety filter changed, in the words of the record.

use crate::pilot::parts;
use crate::record::{Intervention, Pressure, SafetyKind};
use control::safety::{self, Cause};
use std::borrow::Cow;

/// - `numbers`: of the robots, in the order of the experiment.
/// - `robot`: whose command was changed.
pub(crate) fn record(
    intervention: &safety::Intervention,
    numbers: &[u8],
    robot: u8,
    tick: i64,
    at_us: i64,
) -> Intervention {
    let (kind, cause, other) = explain(&intervention.cause, numbers);
    let pressure = |pressure: &safety::Pressure| {
        let (_, cause, other) = explain(&pressure.cause, numbers);
        Pressure {
            cause: Cow::Borrowed(cause),
            other,
            push_m_per_s: pressure.push_m_per_s,
        }
    };
    Intervention {
        tick,
        at_us,
        robot,
        kind,
        cause: Cow::Borrowed(cause),
        other,
        change_m_per_s: intervention.change_m_per_s,
        change_rad_per_s: intervention.change_rad_per_s,
        requested: parts(intervention.requested),
        pressures: intervention.pressures.iter().flatten().map(pressure).collect(),
    }
}

/// Kind, cause and the other robot of an intervention.
///
/// - `numbers`: of the robots, in the order of the experiment.
fn explain(cause: &Cause, numbers: &[u8]) -> (SafetyKind, &'static str, Option<u8>) {
    use control::safety::WallSide;
    match cause {
        Cause::Robot { other } => {
            let other = numbers.get(*other as usize).copied();
            (SafetyKind::Robot, "robot", other)
        }
        Cause::Wall { side: WallSide::Left } => (SafetyKind::Wall, "wall_left", None),
        Cause::Wall { side: WallSide::Right } => (SafetyKind::Wall, "wall_right", None),
        Cause::Wall { side: WallSide::Bottom } => (SafetyKind::Wall, "wall_bottom", None),
        Cause::Wall { side: WallSide::Top } => (SafetyKind::Wall, "wall_top", None),
        Cause::Geofence { .. } => (SafetyKind::Wall, "geofence", None),
        Cause::FixedObstacle { .. } => (SafetyKind::Wall, "fixed_obstacle", None),
        Cause::PushableObstacle { .. } => (SafetyKind::Wall, "pushable_obstacle", None),
        Cause::MovingObstacle { .. } => (SafetyKind::Wall, "moving_obstacle", None),
        Cause::Deadlock => (SafetyKind::Robot, "deadlock", None),
        Cause::Speed => (SafetyKind::Speed, "speed", None),
        Cause::Steering => (SafetyKind::Speed, "steering", None),
        Cause::Turn => (SafetyKind::Speed, "turn", None),
        Cause::WheelSpeed => (SafetyKind::Speed, "wheel_speed", None),
        Cause::PoseAge => (SafetyKind::Stop, "pose_age", None),
        Cause::Latency => (SafetyKind::Stop, "latency", None),
        Cause::Offline => (SafetyKind::Stop, "offline", None),
        Cause::NotFinite => (SafetyKind::Stop, "not_finite", None),
        Cause::Infeasible => (SafetyKind::Stop, "infeasible", None),
        Cause::NotConverged => (SafetyKind::Stop, "not_converged", None),
        Cause::Late => (SafetyKind::Stop, "late", None),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use twin::twist::BodyTwist;

    #[test]
    fn a_record_has_what_was_asked_for_and_what_pushed_by_the_robots_numbers() {
        let robot = Cause::Robot { other: 1 };
        let push = |cause, push_m_per_s| Some(safety::Pressure { cause, push_m_per_s });
        let intervention = safety::Intervention {
            cause: robot,
            change_m_per_s: 0.4,
            change_rad_per_s: 0.1,
            requested: BodyTwist {
                forward_m_per_s: 0.5,
                left_m_per_s: -0.25,
                yaw_rate_rad_per_s: 1.5,
            },
            pressures: [push(robot, 0.3), push(Cause::Speed, 0.1), None],
        };
        let record = record(&intervention, &[4, 9], 4, 17, 1000);
        assert_eq!((record.robot, record.other, record.tick), (4, Some(9), 17));
        assert_eq!(record.requested, [0.5, -0.25, 1.5]);
        let pushed: Vec<_> = record
            .pressures
            .iter()
            .map(|pressure| (&*pressure.cause, pressure.other, pressure.push_m_per_s))
            .collect();
        assert_eq!(pushed, [("robot", Some(9), 0.3), ("speed", None, 0.1)]);
        // Records of before read as they did.
        let mut document = serde_json::to_value(&record).expect("JSON");
        for field in ["requested", "pressures"] {
            document.as_object_mut().expect("an object").remove(field);
        }
        let old: Intervention = serde_json::from_value(document).expect("an old record");
        assert_eq!((old.requested, old.pressures.len()), ([0.0; 3], 0));
    }
}
