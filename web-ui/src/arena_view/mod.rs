//! The arena from above: floor, scale, paths, trails, targets and robots. The same picture on every page.

mod contents;
mod draw;
mod drawings;

use api::arena::{Arena, Contents};
use api::experiment::{Experiment, Target};
use api::note::Note;
use api::robot::RobotDescription;
use egui::{Color32, Painter, Pos2, Rect, Response, Sense, Ui, pos2, vec2};

pub use draw::{robot_extent_m, target};

/// Room around the floor for the scale, points.
const MARGIN: f32 = 34.0;

/// What is to be seen, from the floor up.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Scene {
    pub width_m: f64,
    pub height_m: f64,
    /// Obstacles, floor regions, geofence.
    pub contents: Contents,
    /// Paths with their band of +-75 mm.
    pub paths: Vec<Vec<[f64; 2]>>,
    pub trails: Vec<Trail>,
    pub targets: Vec<SceneTarget>,
    pub robots: Vec<SceneRobot>,
    /// Points, lines and words of the user's own controller.
    pub drawings: Vec<Note>,
}

#[derive(Debug, Clone, PartialEq)]
pub struct Trail {
    pub points: Vec<[f64; 2]>,
    pub ink: Ink,
    pub dashed: bool,
    /// Shown pale, as something that is about to be replaced.
    pub faint: bool,
}

#[derive(Debug, Clone, PartialEq)]
pub struct SceneTarget {
    pub x_m: f64,
    pub y_m: f64,
    pub ink: Ink,
    pub label: String,
}

#[derive(Debug, Clone, PartialEq)]
pub struct SceneRobot {
    pub name: String,
    pub pose: [f64; 3],
    pub shape: Shape,
    pub ink: Ink,
    /// Only the outline, dashed: a robot of the twin beside the real one, or a start pose.
    pub ghost: bool,
    pub show_name: bool,
    /// A word beside the robot, for example what the safety filter does.
    pub mark: Option<String>,
}

/// Which colour.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ink {
    /// By place in the experiment.
    Robot(usize),
    Twin,
    Neutral,
}

/// Outline of a chassis.
#[derive(Debug, Clone, PartialEq)]
pub struct Shape {
    pub half_length_m: f64,
    pub half_width_m: f64,
    pub wheels: Vec<WheelShape>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WheelShape {
    pub x_m: f64,
    pub y_m: f64,
    pub direction_rad: f64,
    pub radius_m: f64,
    pub driven: bool,
}

/// Body beyond the outermost wheel centre.
const OVERHANG_M: f64 = 0.055;
const CASTER_RADIUS_M: f64 = 0.02;

impl Shape {
    /// The outline follows from where the wheels are.
    pub fn of(description: Option<&RobotDescription>) -> Self {
        let wheels = description.map_or(&[][..], |d| &d.wheels[..]);
        let reach =
            |extent: &dyn Fn(&api::robot::Wheel) -> f64| wheels.iter().map(extent).fold(0.12, f64::max) + OVERHANG_M;
        Self {
            half_length_m: reach(&|w| w.x_m.abs()),
            half_width_m: reach(&|w| w.y_m.abs()),
            wheels: wheels
                .iter()
                .map(|w| WheelShape {
                    x_m: w.x_m,
                    y_m: w.y_m,
                    direction_rad: w.rolling_direction_rad,
                    radius_m: w.radius_m.unwrap_or(CASTER_RADIUS_M),
                    driven: w.driven,
                })
                .collect(),
        }
    }
}

impl Scene {
    pub fn of_arena(arena: &Arena) -> Self {
        Self {
            width_m: arena.width_m,
            height_m: arena.height_m,
            contents: arena.contents.clone().unwrap_or_default(),
            ..Self::default()
        }
    }

    /// Targets of an experiment: waypoints numbered in order (places visited twice carry both numbers), goals by robot.
    pub fn add_targets(&mut self, experiment: &Experiment) {
        let single = experiment.robots.len() == 1;
        for (index, target) in experiment.targets.iter().enumerate() {
            let robot = target_robot(experiment, target);
            let label = if single {
                shared_label(&experiment.targets, index)
            } else {
                format!("{}", robot + 1)
            };
            self.targets.push(SceneTarget {
                x_m: target.x_m,
                y_m: target.y_m,
                ink: Ink::Robot(robot),
                label,
            });
        }
    }
}

/// Place of the robot a target belongs to.
pub fn target_robot(experiment: &Experiment, target: &Target) -> usize {
    target
        .robot
        .as_ref()
        .and_then(|name| experiment.robots.iter().position(|r| r.name == *name))
        .unwrap_or(0)
}

/// `2, 4` at the first of several targets in one place, nothing at the others.
fn shared_label(targets: &[Target], index: usize) -> String {
    let here = |t: &Target| (t.x_m - targets[index].x_m).hypot(t.y_m - targets[index].y_m) < 1e-3;
    if targets[..index].iter().any(here) {
        return String::new();
    }
    let numbers: Vec<String> = targets
        .iter()
        .enumerate()
        .filter(|(_, t)| here(t))
        .map(|(i, _)| (i + 1).to_string())
        .collect();
    numbers.join(", ")
}

/// Between metres on the floor and points on the page.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Projection {
    pub center: Pos2,
    pub points_per_m: f32,
}

impl Projection {
    pub fn page_from_floor(&self, point: [f64; 2]) -> Pos2 {
        pos2(
            self.center.x + point[0] as f32 * self.points_per_m,
            self.center.y - point[1] as f32 * self.points_per_m,
        )
    }

    pub fn floor_from_page(&self, point: Pos2) -> [f64; 2] {
        [
            f64::from((point.x - self.center.x) / self.points_per_m),
            f64::from((self.center.y - point.y) / self.points_per_m),
        ]
    }

    pub fn length(&self, length_m: f64) -> f32 {
        length_m as f32 * self.points_per_m
    }
}

/// The drawn arena, for pages that add handles of their own.
pub struct ArenaResponse {
    pub response: Response,
    pub projection: Projection,
    pub painter: Painter,
    /// The floor inside the walls.
    pub floor: Rect,
}

/// Draws the scene as large as it fits into the available room.
pub fn show(ui: &mut Ui, scene: &Scene, height: f32) -> ArenaResponse {
    let room = vec2(ui.available_width(), height.max(160.0));
    let (response, painter) = ui.allocate_painter(room, Sense::hover());
    let scale_x = (response.rect.width() - 2.0 * MARGIN) / scene.width_m.max(0.1) as f32;
    let scale_y = (response.rect.height() - 2.0 * MARGIN) / scene.height_m.max(0.1) as f32;
    let projection = Projection {
        center: response.rect.center(),
        points_per_m: scale_x.min(scale_y).max(10.0),
    };
    let size = vec2(projection.length(scene.width_m), projection.length(scene.height_m));
    let floor = Rect::from_center_size(projection.center, size);
    let palette = crate::theme::palette(ui.visuals().dark_mode);
    draw::scene(&painter, scene, &projection, floor, &palette);
    ArenaResponse {
        response,
        projection,
        painter,
        floor,
    }
}

/// Colour of an ink.
pub fn colour(ink: Ink, palette: &crate::theme::Palette) -> Color32 {
    match ink {
        Ink::Robot(index) => palette.robot(index),
        Ink::Twin => palette.twin,
        Ink::Neutral => palette.faint_ink,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::state::Template;

    #[test]
    fn places_visited_twice_carry_both_numbers() {
        let mut scene = Scene::default();
        scene.add_targets(&Template::RectangleOmni4.experiment());
        let labels: Vec<&str> = scene.targets.iter().map(|t| t.label.as_str()).collect();
        assert_eq!(labels, ["1, 5", "2, 4", "3", "", ""]);
    }

    #[test]
    fn goals_carry_the_number_and_colour_of_their_robot() {
        let mut scene = Scene::default();
        scene.add_targets(&Template::SwapCorners.experiment());
        let marks: Vec<_> = scene.targets.iter().map(|t| (t.label.as_str(), t.ink)).collect();
        assert_eq!(
            marks,
            [
                ("1", Ink::Robot(0)),
                ("2", Ink::Robot(1)),
                ("3", Ink::Robot(2)),
                ("4", Ink::Robot(3))
            ]
        );
    }

    #[test]
    fn up_on_the_floor_is_up_on_the_page_and_back_again() {
        let projection = Projection {
            center: pos2(400.0, 300.0),
            points_per_m: 100.0,
        };
        let page = projection.page_from_floor([1.0, 0.5]);
        assert_eq!(page, pos2(500.0, 250.0));
        let floor = projection.floor_from_page(page);
        assert!((floor[0] - 1.0).abs() < 1e-6 && (floor[1] - 0.5).abs() < 1e-6);
    }
}
