//! What a script sees: `now`, its robots, and their targets.

use std::sync::Arc;

use rhai::{Array, Dynamic, Engine, EvalAltResult};

use crate::view::{Chassis, Member, Place, Seen, Setup, View};

/// `now` of a script.
#[derive(Debug, Clone)]
pub(super) struct Now {
    setup: Arc<Setup>,
    view: Arc<View>,
}

/// A robot of a script.
#[derive(Debug, Clone)]
pub(super) struct Robot {
    now: Now,
    place: usize,
}

impl Now {
    pub(super) fn new(setup: &Arc<Setup>, view: &View) -> Now {
        Now {
            setup: setup.clone(),
            view: Arc::new(view.clone()),
        }
    }

    pub(super) fn tick(&self) -> u64 {
        self.view.tick
    }

    fn count(&self) -> usize {
        self.view.robots.len().min(self.setup.robots.len())
    }

    fn robot(&self, place: usize) -> Robot {
        Robot {
            now: self.clone(),
            place,
        }
    }

    fn robots(&self) -> Array {
        (0..self.count())
            .map(|place| Dynamic::from(self.robot(place)))
            .collect()
    }
}

impl Robot {
    fn seen(&self) -> &Seen {
        &self.now.view.robots[self.place]
    }

    fn member(&self) -> &Member {
        &self.now.setup.robots[self.place]
    }

    /// The other robots whose origins are closer than `radius_m`, nearest first.
    fn neighbours(&self, radius_m: f64) -> Array {
        let own = self.seen();
        let mut near: Vec<(f64, usize)> = (0..self.now.count())
            .filter(|other| *other != self.place)
            .map(|other| {
                let seen = &self.now.view.robots[other];
                (libm::hypot(seen.x_m - own.x_m, seen.y_m - own.y_m), other)
            })
            // False also of what is not a number.
            .filter(|(distance_m, _)| *distance_m < radius_m)
            .collect();
        near.sort_by(|a, b| a.0.total_cmp(&b.0));
        near.into_iter()
            .map(|(_, other)| Dynamic::from(self.now.robot(other)))
            .collect()
    }
}

fn chassis(drive: Chassis) -> &'static str {
    match drive {
        Chassis::Holonomic => "holonomic",
        Chassis::TurnInPlace => "turn_in_place",
        Chassis::Steered => "steered",
    }
}

pub(super) fn register(engine: &mut Engine) {
    engine
        .register_type_with_name::<Now>("Now")
        .register_get("tick", |now: &mut Now| now.view.tick as i64)
        .register_get("time_s", |now: &mut Now| now.view.time_s)
        .register_get("period_s", |now: &mut Now| 1.0 / f64::from(now.setup.rate_hz))
        .register_get("arena_width_m", |now: &mut Now| now.setup.arena_m[0])
        .register_get("arena_height_m", |now: &mut Now| now.setup.arena_m[1])
        .register_get("count", |now: &mut Now| now.count() as i64)
        .register_get("robots", |now: &mut Now| now.robots())
        .register_fn("robot", |now: &mut Now, place: i64| {
            let known = usize::try_from(place).ok().filter(|place| *place < now.count());
            let none = || -> Box<EvalAltResult> { format!("there is no robot {place}").into() };
            known.map(|place| now.robot(place)).ok_or_else(none)
        });
    engine
        .register_type_with_name::<Robot>("Robot")
        .register_get("index", |robot: &mut Robot| robot.place as i64)
        .register_get("name", |robot: &mut Robot| robot.member().name.clone())
        .register_get("drive", |robot: &mut Robot| chassis(robot.member().drive))
        .register_get("radius_m", |robot: &mut Robot| robot.member().radius_m)
        .register_get("turning_radius_m", |robot: &mut Robot| robot.member().turning_radius_m)
        .register_get("x_m", |robot: &mut Robot| robot.seen().x_m)
        .register_get("y_m", |robot: &mut Robot| robot.seen().y_m)
        .register_get("yaw_rad", |robot: &mut Robot| robot.seen().yaw_rad)
        .register_get("age_s", |robot: &mut Robot| robot.seen().age_s)
        .register_get("forward_m_per_s", |robot: &mut Robot| robot.seen().forward_m_per_s)
        .register_get("left_m_per_s", |robot: &mut Robot| robot.seen().left_m_per_s)
        .register_get("yaw_rate_rad_per_s", |robot: &mut Robot| {
            robot.seen().yaw_rate_rad_per_s
        })
        .register_get("online", |robot: &mut Robot| robot.seen().online)
        .register_get("ranges_m", |robot: &mut Robot| -> Array {
            robot.seen().ranges_m.iter().map(|range_m| (*range_m).into()).collect()
        })
        .register_get("targets", |robot: &mut Robot| -> Array {
            robot
                .member()
                .targets
                .iter()
                .map(|place| Dynamic::from(*place))
                .collect()
        })
        .register_fn("neighbours", |robot: &mut Robot, radius_m: f64| {
            robot.neighbours(radius_m)
        });
    engine
        .register_type_with_name::<Place>("Target")
        .register_get("x_m", |place: &mut Place| place.x_m)
        .register_get("y_m", |place: &mut Place| place.y_m)
        .register_get("yaw_rad", |place: &mut Place| {
            place.yaw_rad.map_or(Dynamic::UNIT, Dynamic::from)
        });
}
