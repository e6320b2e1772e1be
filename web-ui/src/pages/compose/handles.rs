//! What can be grabbed on the floor: start poses, their headings, targets.

use crate::arena_view::{ArenaResponse, Projection, Shape, robot_extent_m, target_robot};
use crate::command::Command;
use crate::output::Output;
use crate::state::State;
use crate::theme::{self, Palette};
use egui::{CursorIcon, Id, Pos2, Rect, Response, Sense, Stroke, Ui, Vec2, vec2};

const YAW_RADIUS: f32 = 7.0;
const TARGET_RADIUS: f32 = 11.0;
/// Distance of the heading handle beyond the body.
const YAW_BEYOND: f32 = 14.0;

/// Later handles lie above earlier ones: a target under a robot is reached after moving the robot.
pub fn show(ui: &mut Ui, state: &State, output: &mut Output, palette: &Palette, arena: &ArenaResponse) {
    targets(ui, state, output, palette, arena);
    for index in 0..state.compose.experiment.robots.len() {
        body(ui, state, output, palette, arena, index);
    }
    for index in 0..state.compose.experiment.robots.len() {
        yaw(ui, state, output, palette, arena, index);
    }
}

fn targets(ui: &mut Ui, state: &State, output: &mut Output, palette: &Palette, arena: &ArenaResponse) {
    let experiment = &state.compose.experiment;
    // The first of several in one place lies on top; moving it moves them all.
    for (index, target) in experiment.targets.iter().enumerate().rev() {
        let center = arena.projection.page_from_floor([target.x_m, target.y_m]);
        let rect = Rect::from_center_size(center, Vec2::splat(2.0 * TARGET_RADIUS));
        let id = Id::unique(("compose target", index));
        let response = ui
            .interact(rect, id, Sense::drag())
            .on_hover_and_drag_cursor(CursorIcon::Grab);
        output.mark(format!("compose.target.{index}"), &response);
        let robot = &experiment
            .robots
            .get(target_robot(experiment, target))
            .map(|r| r.name.as_str())
            .unwrap_or_default();
        highlight(&response, arena, center, TARGET_RADIUS, palette);
        if let Some([x_m, y_m]) = dragged_to(ui, &response, center, &arena.projection) {
            output.send(Command::MoveTarget {
                target: index,
                x_m,
                y_m,
            });
        }
        let place = format!(
            "Target of {robot}: x {}, y {}. Drag to move.",
            theme::metres(target.x_m),
            theme::metres(target.y_m)
        );
        if !response.dragged() {
            response.on_hover_text(place);
        }
    }
}

fn shape(state: &State, index: usize) -> Shape {
    let name = state
        .compose
        .experiment
        .robots
        .get(index)
        .map(|r| r.name.as_str())
        .unwrap_or_default();
    Shape::of(state.lab.robot(name).map(|r| &r.description))
}

fn body(ui: &mut Ui, state: &State, output: &mut Output, palette: &Palette, arena: &ArenaResponse, index: usize) {
    let Some(robot) = state.compose.experiment.robots.get(index) else {
        return;
    };
    let center = arena.projection.page_from_floor([robot.start.x_m, robot.start.y_m]);
    let radius = arena
        .projection
        .length(robot_extent_m(&shape(state, index)) * 0.8)
        .max(12.0);
    let rect = Rect::from_center_size(center, Vec2::splat(2.0 * radius));
    let response = ui
        .interact(rect, Id::unique(("compose robot", index)), Sense::drag())
        .on_hover_and_drag_cursor(CursorIcon::Grab);
    output.mark(format!("compose.robot.{index}"), &response);
    highlight(&response, arena, center, radius * 1.3, palette);
    if let Some([x_m, y_m]) = dragged_to(ui, &response, center, &arena.projection) {
        output.send(Command::MoveStart { robot: index, x_m, y_m });
    }
    if !response.dragged() {
        let start = &robot.start;
        let place = format!(
            "Start of {}: x {}, y {}, heading {}. Drag to move.",
            robot.name,
            theme::metres(start.x_m),
            theme::metres(start.y_m),
            theme::degrees(start.yaw_rad)
        );
        response.on_hover_text(place);
    }
}

fn yaw(ui: &mut Ui, state: &State, output: &mut Output, palette: &Palette, arena: &ArenaResponse, index: usize) {
    let Some(robot) = state.compose.experiment.robots.get(index) else {
        return;
    };
    let center = arena.projection.page_from_floor([robot.start.x_m, robot.start.y_m]);
    let away = arena.projection.length(shape(state, index).half_length_m) + YAW_BEYOND;
    let (sin, cos) = (robot.start.yaw_rad as f32).sin_cos();
    let direction = vec2(cos, -sin);
    let handle = center + direction * away;
    let rect = Rect::from_center_size(handle, Vec2::splat(2.0 * YAW_RADIUS + 6.0));
    let response = ui
        .interact(rect, Id::unique(("compose yaw", index)), Sense::drag())
        .on_hover_and_drag_cursor(CursorIcon::Alias);
    output.mark(format!("compose.robot.{index}.yaw"), &response);
    let ink = if response.hovered() || response.dragged() {
        palette.accent
    } else {
        palette.robot(index)
    };
    arena.painter.line_segment(
        [handle - direction * (YAW_BEYOND - 1.0), handle - direction * YAW_RADIUS],
        Stroke::new(1.5, ink),
    );
    arena
        .painter
        .circle(handle, YAW_RADIUS - 1.0, palette.floor, Stroke::new(2.0, ink));
    if let (true, Some(pointer)) = (response.dragged(), response.interact_pointer_pos()) {
        let to = pointer - center;
        if to.length() > 4.0 {
            output.send(Command::TurnStart {
                robot: index,
                yaw_rad: f64::from((-to.y).atan2(to.x)),
            });
        }
    }
    if !response.dragged() {
        response.on_hover_text(format!(
            "Heading of {}: {}. Drag to turn.",
            robot.name,
            theme::degrees(robot.start.yaw_rad)
        ));
    }
}

fn highlight(response: &Response, arena: &ArenaResponse, center: Pos2, radius: f32, palette: &Palette) {
    if response.hovered() || response.dragged() {
        arena
            .painter
            .circle_stroke(center, radius, Stroke::new(1.5, palette.accent));
    }
}

/// Where the thing goes that hangs on the pointer; it keeps the distance at which it was grabbed.
fn dragged_to(ui: &Ui, response: &Response, center: Pos2, projection: &Projection) -> Option<[f64; 2]> {
    let pointer = response.interact_pointer_pos()?;
    if response.drag_started() {
        let origin = ui.input(|i| i.pointer.press_origin()).unwrap_or(pointer);
        ui.data_mut(|data| data.insert_temp(response.id, center - origin));
    }
    if !response.dragged() {
        return None;
    }
    let offset: Vec2 = ui.data(|data| data.get_temp(response.id)).unwrap_or_default();
    Some(projection.floor_from_page(pointer + offset))
}
