//! Arenas with things in them.
#![allow(dead_code)]

use twin::command::WheelCommand;
use twin::pose::Pose;
use twin::robot::Robot;
use twin::twist::BodyTwist;
use twin::world::{Arena, Contents, FixedObstacle, FloorRegion, PushableObstacle, RobotState, Shape, World};

pub const RADIUS_M: f64 = 0.25;

pub fn at(x_m: f64, y_m: f64, yaw_rad: f64) -> Pose {
    Pose { x_m, y_m, yaw_rad }
}

pub fn circle(radius_m: f64) -> Shape {
    Shape::Circle { radius_m }
}

pub fn rectangle(length_m: f64, width_m: f64) -> Shape {
    Shape::Rectangle { length_m, width_m }
}

pub fn fixed(shape: Shape, pose: Pose) -> FixedObstacle {
    FixedObstacle {
        name: "pillar".to_owned(),
        shape,
        pose,
    }
}

pub fn pushable(shape: Shape, pose: Pose, mass_kg: f64, floor_friction: f64) -> PushableObstacle {
    PushableObstacle {
        name: "crate".to_owned(),
        shape,
        pose,
        mass_kg,
        floor_friction,
    }
}

pub fn region(shape: Shape, pose: Pose, friction_scale: f64) -> FloorRegion {
    FloorRegion {
        shape,
        pose,
        friction_scale,
    }
}

pub fn pushables(pushable: Vec<PushableObstacle>) -> Contents {
    Contents {
        pushable,
        ..Contents::default()
    }
}

#[track_caller]
pub fn furnished(width_m: f64, height_m: f64, contents: Contents, robots: Vec<(Robot, Pose)>) -> World {
    let robots = robots
        .into_iter()
        .map(|(robot, pose)| (robot, pose, RADIUS_M))
        .collect();
    match World::furnished(Arena { width_m, height_m }, contents, robots) {
        Ok(world) => world,
        Err(error) => panic!("{error}"),
    }
}

#[track_caller]
pub fn step(world: &mut World, commands: &[WheelCommand]) {
    if let Err(error) = world.step(commands) {
        panic!("{error}");
    }
}

pub fn forward(robot: &Robot, speed_m_per_s: f64) -> WheelCommand {
    robot.wheel_speeds(BodyTwist {
        forward_m_per_s: speed_m_per_s,
        ..BodyTwist::default()
    })
}

/// Velocity of a robot in the world, m/s.
pub fn velocity(state: &RobotState) -> (f64, f64) {
    in_world(state.pose, state.twist)
}

/// A twist's velocity in the world, m/s.
pub fn in_world(pose: Pose, twist: BodyTwist) -> (f64, f64) {
    let (sin, cos) = libm::sincos(pose.yaw_rad);
    let (u, v) = (twist.forward_m_per_s, twist.left_m_per_s);
    (u * cos - v * sin, u * sin + v * cos)
}
