//! Robots that hold each other: seen within 5 s, sent round each other, and given up with a reason where there is no room.

mod common;

use common::{chassis_robot, parsed, team};
use control::TICK_S;
use control::law::RobotObservation;
use control::rehearsal::Rehearsal;
use control::safety::{Cause, FilterBody, Filtered, Geofence, Limits, SafetyFilter};
use serde_json::json;
use twin::pose::Pose;
use twin::robot::Robot;
use twin::twist::BodyTwist;

const RADIUS_M: f64 = 0.25;
/// S9: a deadlock is seen within this.
const SEEN_S: f64 = 5.0;

/// Two robots in a corridor of this width that want to pass through each other, for `time_s`.
struct Corridor {
    chassis: [&'static str; 2],
    filter: SafetyFilter,
    robots: [RobotObservation; 2],
    stalled_s: f64,
    /// Longest time without motion before anything was said.
    silent_s: f64,
    gap_m: f64,
    detours: u32,
    seen: bool,
}

fn body(chassis: &str) -> FilterBody {
    let description = chassis_robot(chassis, "r")["description"].clone();
    FilterBody {
        robot: Robot::new(serde_json::from_value(description).expect("description")).expect("robot"),
        bounding_radius_m: RADIUS_M,
    }
}

impl Corridor {
    fn new(chassis: [&'static str; 2], width_m: f64) -> Corridor {
        let bodies = chassis.map(body);
        let fence = Geofence::rectangle([-1.9, -0.5 * width_m], [1.9, 0.5 * width_m]).expect("fence");
        let seen = |x_m: f64, yaw_rad: f64| RobotObservation {
            pose: Pose { x_m, y_m: 0.0, yaw_rad },
            pose_age_s: 0.0,
            twist: BodyTwist::default(),
            online: true,
        };
        Corridor {
            chassis,
            filter: SafetyFilter::new(Limits::default(), [4.0, 3.0], bodies.to_vec()).with_geofence(fence),
            robots: [seen(-0.8, 0.0), seen(0.8, core::f64::consts::PI)],
            stalled_s: 0.0,
            silent_s: 0.0,
            gap_m: f64::INFINITY,
            detours: 0,
            seen: false,
        }
    }

    /// Towards the other end; robots that turn in place point there first, steered ones just drive on.
    fn wish(&self, i: usize) -> BodyTwist {
        let pose = self.robots[i].pose;
        let (dx, dy) = ([1.5, -1.5][i] - pose.x_m, -pose.y_m);
        let size = (dx * dx + dy * dy).sqrt().max(1e-9);
        let (s, c) = (libm::sin(pose.yaw_rad), libm::cos(pose.yaw_rad));
        let (forward, left) = ((c * dx + s * dy) / size, (c * dy - s * dx) / size);
        let error = libm::atan2(left, forward);
        let [forward, left, turn] = match self.chassis[i] {
            "omni4" => [forward, left, 0.0],
            "diff2" | "diff4" => [(1.0 - error.abs() / 0.5).max(0.0), 0.0, 4.0 * error],
            _ => [1.0, 0.0, 0.0],
        };
        BodyTwist {
            forward_m_per_s: 0.4 * forward,
            left_m_per_s: 0.4 * left,
            yaw_rate_rad_per_s: turn.clamp(-1.8, 1.8),
        }
    }

    /// Moves the robots as they are told; the largest speed, m/s.
    fn follow(&mut self, filtered: &[Filtered]) -> f64 {
        let mut fastest = 0.0_f64;
        for (robot, filtered) in self.robots.iter_mut().zip(filtered) {
            let twist = filtered.command.twist();
            let (s, c) = (libm::sin(robot.pose.yaw_rad), libm::cos(robot.pose.yaw_rad));
            robot.pose.x_m += (c * twist.forward_m_per_s - s * twist.left_m_per_s) * TICK_S;
            robot.pose.y_m += (s * twist.forward_m_per_s + c * twist.left_m_per_s) * TICK_S;
            robot.pose.yaw_rad += twist.yaw_rate_rad_per_s * TICK_S;
            robot.twist = twist;
            fastest = fastest.max(twist.speed_m_per_s());
            self.detours += u32::from(filtered.intervention.is_some_and(|one| one.cause == Cause::Deadlock));
        }
        fastest
    }

    fn run(&mut self, time_s: f64) {
        for _ in 0..(time_s / TICK_S) as usize {
            let wishes = [self.wish(0), self.wish(1)];
            let filtered = self.filter.apply(&self.robots, &wishes).to_vec();
            let fastest = self.follow(&filtered);
            let silent = self.filter.deadlocks().next().is_none();
            self.seen |= !silent;
            self.stalled_s = if fastest < 0.02 && silent {
                self.stalled_s + TICK_S
            } else {
                0.0
            };
            self.silent_s = self.silent_s.max(self.stalled_s);
            let gap_m = self.robots[0].pose.distance_m(&self.robots[1].pose) - 2.0 * RADIUS_M;
            self.gap_m = self.gap_m.min(gap_m);
        }
    }
}

/// Every chassis, in a corridor that two robots cannot pass each other in.
#[test]
fn a_deadlock_is_seen_within_five_seconds() {
    for chassis in [["omni4", "omni4"], ["diff2", "diff4"], ["fwd", "rwd"], ["awd", "omni4"]] {
        let mut corridor = Corridor::new(chassis, 0.7);
        corridor.run(30.0);
        println!(
            "{chassis:?}: silent for {:.2} s, gap {:.4} m",
            corridor.silent_s, corridor.gap_m
        );
        assert!(corridor.seen && corridor.detours > 0, "{chassis:?}");
        assert!(corridor.silent_s <= SEEN_S, "{chassis:?} {}", corridor.silent_s);
        assert!(
            corridor.gap_m > Limits::default().robot_margin_m,
            "{chassis:?} {}",
            corridor.gap_m
        );
    }
}

#[test]
fn a_deadlock_is_given_up_where_there_is_no_room_and_resolved_where_there_is() {
    for chassis in [["omni4", "omni4"], ["diff2", "diff4"]] {
        let mut narrow = Corridor::new(chassis, 0.7);
        narrow.run(180.0);
        let left: Vec<_> = narrow.filter.deadlocks().collect();
        println!(
            "{chassis:?}: gap {:.4} m, {} ticks of detour, {left:?}",
            narrow.gap_m, narrow.detours
        );
        assert!(left.iter().any(|one| one.given_up), "{chassis:?} {left:?}");
        assert!(
            narrow.gap_m > Limits::default().robot_margin_m,
            "{chassis:?} {}",
            narrow.gap_m
        );
        let mut wide = Corridor::new(chassis, 2.6);
        wide.run(60.0);
        assert!(
            wide.seen && wide.gap_m > Limits::default().robot_margin_m,
            "{chassis:?} {}",
            wide.gap_m
        );
        assert!(
            wide.robots[0].pose.x_m > 1.0 && wide.robots[1].pose.x_m < -1.0,
            "{chassis:?} {:?}",
            wide.robots
        );
    }
}

/// A robot that cannot move sideways and wants past a parked one on the side of a wall presses against the wall alone; it is
/// sent the other way.
#[test]
fn a_wall_beside_a_robot_in_the_way_holds_as_well() {
    for chassis in ["diff2", "diff4"] {
        let mut corridor = Corridor::new([chassis, "omni4"], 3.0);
        corridor.filter = SafetyFilter::new(Limits::default(), [4.0, 3.0], [chassis, "omni4"].map(body).to_vec());
        let pose = |x_m: f64, y_m: f64, yaw_rad: f64| Pose { x_m, y_m, yaw_rad };
        // Up and to the left, past the upper side of the parked robot, where there is no room.
        let [left, up] = [-0.8, 0.6];
        corridor.robots[0].pose = pose(0.62, 1.18, libm::atan2(up, left));
        corridor.robots[1].pose = pose(0.0, 1.05, 0.0);
        let mut seen_after_s = None;
        let (mut lowest_m, mut nearest_m) = (f64::INFINITY, f64::INFINITY);
        for tick in 0..(20.0 / TICK_S) as usize {
            let wishes = [
                BodyTwist {
                    forward_m_per_s: 0.4,
                    ..BodyTwist::default()
                },
                BodyTwist::default(),
            ];
            let filtered = corridor.filter.apply(&corridor.robots, &wishes).to_vec();
            corridor.follow(&filtered);
            if corridor.filter.deadlocks().next().is_some() {
                seen_after_s.get_or_insert(tick as f64 * TICK_S);
            }
            lowest_m = corridor.robots[0].pose.y_m.min(lowest_m);
            nearest_m = corridor.robots[0]
                .pose
                .distance_m(&corridor.robots[1].pose)
                .min(nearest_m);
        }
        assert!(
            seen_after_s.is_some_and(|after_s| after_s <= SEEN_S),
            "{chassis}: {seen_after_s:?}"
        );
        assert!(
            lowest_m < 1.0,
            "{chassis}: sent away from the wall, down to {lowest_m} m"
        );
        assert!(
            nearest_m - 2.0 * RADIUS_M > Limits::default().robot_margin_m,
            "{chassis}: {nearest_m}"
        );
    }
}

/// A rehearsal ends with the reason, long before its time is over.
#[test]
fn a_rehearsal_ends_at_a_deadlock_that_was_given_up() {
    let robots = [("omni4", [-0.8, 0.0, 0.0]), ("omni4", [0.8, 0.0, 0.0])];
    let targets = json!([
        {"robot": "r0", "x_m": 0.8, "y_m": 0.0, "yaw_rad": null},
        {"robot": "r1", "x_m": -0.8, "y_m": 0.0, "yaw_rad": null}
    ]);
    let document = team("go_to_point", json!({}), &robots, targets, 600.0, [4.0, 0.8]);
    let mut rehearsal = Rehearsal::new(&parsed(&document)).expect("set up");
    while rehearsal.step() {}
    let (ticks, most) = rehearsal.progress();
    let verdict = rehearsal.finish().verdict;
    let found = verdict.findings.iter().find(|finding| finding.code == "deadlock");
    let found = found.unwrap_or_else(|| panic!("{:#?}", verdict.findings));
    assert_eq!(found.robots, ["r0", "r1"]);
    assert!(found.message.contains("10 attempts"), "{}", found.message);
    assert!(ticks < most / 2, "{ticks} of {most}");
    assert!(verdict.smallest_separation_m.expect("two robots") > 0.0);
}
