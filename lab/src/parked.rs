//! Robots that stand on the floor and are in nobody's run: fixed obstacles for those who drive.
//!
//! A robot stays at its dock during a run only if the twin drives the experiment alike with and without it: what a user
//! rehearsed is what is driven, whoever is parked. Others are strangers, and the hand takes strangers away.

use crate::carry_out::scenario;
use crate::lab::Lab;
use api::arena::{FixedObstacle, Shape};
use api::experiment::Pose;
use api::lab::Assignment;
use std::sync::Arc;
use tokio::task::spawn_blocking;

/// Largest distance between the robots of the two rehearsals that counts as none.
const ALIKE_M: f64 = 0.001;

/// One of them.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct ParkedRobot {
    pub number: u8,
    pub name: String,
    /// As it is seen.
    pub pose: Pose,
    pub radius_m: f64,
}

/// See the module.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Parked(pub Vec<ParkedRobot>);

impl Parked {
    /// Robots at their docks that may stay there during this run.
    pub(crate) async fn beside(lab: &Arc<Lab>, assignment: &Assignment) -> Self {
        let numbers: Vec<u8> = assignment.robots.iter().map(|robot| robot.number).collect();
        let docked = Self::standing(lab, |number| !numbers.contains(&number) && lab.is_docked(number));
        if docked.0.is_empty() {
            return docked;
        }
        let assignment = assignment.clone();
        // Seconds of one core at most, while all robots stand.
        spawn_blocking(move || docked.in_nobodys_way(&assignment))
            .await
            .unwrap_or_default()
    }

    /// Robots that are seen on the floor, as far as `counts` says so.
    pub(crate) fn standing(lab: &Lab, counts: impl Fn(u8) -> bool) -> Self {
        let seen = lab.description.robots.iter().filter_map(|robot| {
            let pose = lab.seen(robot.number).filter(|_| counts(robot.number))?;
            Some(ParkedRobot {
                number: robot.number,
                name: robot.description.name.clone(),
                pose: Pose {
                    x_m: pose.x_m,
                    y_m: pose.y_m,
                    yaw_rad: pose.yaw_rad,
                },
                radius_m: robot.bounding_radius_m,
            })
        });
        Self(seen.collect())
    }

    pub(crate) fn numbers(&self) -> Vec<u8> {
        self.0.iter().map(|robot| robot.number).collect()
    }

    /// The assignment in an arena with these robots as fixed obstacles.
    pub(crate) fn with(&self, assignment: &Assignment) -> Assignment {
        let mut assignment = assignment.clone();
        if !self.0.is_empty() {
            let contents = assignment.arena.contents.get_or_insert_default();
            contents.fixed.extend(self.0.iter().map(ParkedRobot::obstacle));
        }
        assignment
    }

    /// All of them, if they may stay together; else one after the other as long as nobody is disturbed.
    fn in_nobodys_way(self, assignment: &Assignment) -> Self {
        if is_undisturbed(assignment, &self) {
            return self;
        }
        let mut staying = Self::default();
        for robot in self.0 {
            staying.0.push(robot);
            if !is_undisturbed(assignment, &staying) {
                staying.0.pop();
            }
        }
        staying
    }
}

impl ParkedRobot {
    fn obstacle(&self) -> FixedObstacle {
        FixedObstacle {
            name: self.name.clone(),
            shape: Shape::Circle {
                radius_m: self.radius_m,
            },
            pose: self.pose,
        }
    }
}

/// The twin drives the experiment alike, tick for tick, whether they stand there or not.
fn is_undisturbed(assignment: &Assignment, parked: &Parked) -> bool {
    let twin = |assignment: &Assignment| scenario(assignment).and_then(|scenario| sandbox::start::rehearsal(&scenario));
    // An experiment that breaks a rule with them, for example by a start where one of them stands, does so here.
    let (Ok(mut alone), Ok(mut beside)) = (twin(assignment), twin(&parked.with(assignment))) else {
        return false;
    };
    loop {
        let (more, more_beside) = (alone.step(), beside.step());
        let apart = (0..assignment.robots.len()).any(|place| {
            let (one, other) = (alone.state(place).pose, beside.state(place).pose);
            f64::hypot(one.x_m - other.x_m, one.y_m - other.y_m) > ALIKE_M
        });
        if apart || more != more_beside {
            return false;
        }
        if !more {
            return true;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::{Value, json};

    /// The rectangle of `omni-01`, whose bounding circle stays within 1.25 m x 0.75 m of the middle.
    fn rectangle() -> Assignment {
        let read = |text: &str| serde_json::from_str::<Value>(text).expect("an example");
        let lab = read(include_str!("../../examples/lab/reference.json"));
        let experiment = read(include_str!("../../examples/experiments/rectangle-omni4.json"));
        serde_json::from_value(json!({
            "run_id": uuid::Uuid::nil(),
            "epoch": 1,
            "experiment": experiment,
            "arena": lab["arena"],
            "robots": [lab["robots"][0]],
            "verdict": {},
            "lease_s": 15.0,
        }))
        .expect("an assignment")
    }

    fn robot(number: u8, x_m: f64, y_m: f64) -> ParkedRobot {
        ParkedRobot {
            number,
            name: format!("parked-{number}"),
            pose: Pose { x_m, y_m, yaw_rad: 0.0 },
            radius_m: 0.25,
        }
    }

    #[test]
    fn who_stands_aside_may_stay_and_who_stands_on_the_way_or_on_a_start_may_not() {
        let assignment = rectangle();
        // In the corner; on the first leg of the path, (-1, -0.5) to (-1, 0.5); on the start.
        let [aside, on_the_way, on_the_start] = [robot(2, -1.7, 1.2), robot(3, -1.0, 0.4), robot(4, -1.0, -0.5)];
        let parked = Parked(vec![on_the_way.clone(), aside.clone(), on_the_start]);
        assert_eq!(parked.in_nobodys_way(&assignment), Parked(vec![aside.clone()]));
        assert!(is_undisturbed(&assignment, &Parked(vec![aside])));
        assert!(!is_undisturbed(&assignment, &Parked(vec![on_the_way])));
    }

    #[test]
    fn parked_robots_are_obstacles_where_they_are_seen() {
        let assignment = rectangle();
        assert_eq!(Parked::default().with(&assignment), assignment);
        let with = Parked(vec![robot(2, -1.7, 1.2)]).with(&assignment);
        let fixed = with.arena.contents.expect("contents").fixed;
        assert_eq!(fixed.len(), 1);
        assert_eq!(fixed[0].shape, Shape::Circle { radius_m: 0.25 });
        assert_eq!((fixed[0].pose.x_m, fixed[0].pose.y_m), (-1.7, 1.2));
    }
}
