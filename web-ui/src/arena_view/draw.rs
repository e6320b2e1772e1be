//! Painting of the scene, from the floor up.

use super::{Projection, Scene, SceneRobot, Shape, Trail, colour, contents, drawings};
use crate::error_measure::BAND_M;
use crate::theme::Palette;
use egui::epaint::PathStroke;
use egui::{Align2, Color32, FontId, Painter, Pos2, Rect, Stroke, StrokeKind, pos2, vec2};

const GRID_M: f64 = 0.5;
const DASH: f32 = 6.0;
const NAME_SIZE: f32 = 12.5;
const SCALE_SIZE: f32 = 11.5;

pub fn scene(painter: &Painter, scene: &Scene, projection: &Projection, floor: Rect, palette: &Palette) {
    painter.rect_filled(floor, 0.0, palette.floor);
    // A corner of the geofence may lie outside the walls.
    let painter_inside = painter.with_clip_rect(floor.intersect(painter.clip_rect()));
    contents::regions(&painter_inside, &scene.contents, projection, palette);
    grid(painter, scene, projection, floor, palette);
    for path in &scene.paths {
        band(painter, path, projection, palette);
    }
    contents::things(&painter_inside, &scene.contents, projection, palette);
    painter.rect_stroke(floor, 0.0, Stroke::new(2.0, palette.wall), StrokeKind::Outside);
    for item in &scene.trails {
        trail(painter, item, projection, palette);
    }
    for item in &scene.targets {
        target(
            painter,
            projection.page_from_floor([item.x_m, item.y_m]),
            colour(item.ink, palette),
            &item.label,
            palette,
        );
    }
    // What a program draws may be anywhere, but is seen on the floor only.
    drawings::below(&painter_inside, &scene.drawings, projection, palette);
    for item in scene
        .robots
        .iter()
        .filter(|r| r.ghost)
        .chain(scene.robots.iter().filter(|r| !r.ghost))
    {
        robot(painter, item, projection, palette);
    }
    drawings::above(&painter_inside, &scene.drawings, projection, palette);
}

fn grid(painter: &Painter, scene: &Scene, projection: &Projection, floor: Rect, palette: &Palette) {
    let font = FontId::proportional(SCALE_SIZE);
    for (half_m, horizontal) in [(scene.width_m / 2.0, true), (scene.height_m / 2.0, false)] {
        let steps = (half_m / GRID_M + 1e-6).floor() as i32;
        for step in -steps..=steps {
            let at_m = f64::from(step) * GRID_M;
            let whole = step % 2 == 0;
            let stroke = Stroke::new(1.0, if whole { palette.grid_strong } else { palette.grid });
            let label = if at_m < 0.0 {
                format!("\u{2212}{}", -at_m)
            } else {
                format!("{at_m}")
            };
            if horizontal {
                let x = projection.page_from_floor([at_m, 0.0]).x;
                painter.vline(x, floor.y_range(), stroke);
                if whole {
                    painter.text(
                        pos2(x, floor.max.y + 7.0),
                        Align2::CENTER_TOP,
                        label,
                        font.clone(),
                        palette.faint_ink,
                    );
                }
            } else {
                let y = projection.page_from_floor([0.0, at_m]).y;
                painter.hline(floor.x_range(), y, stroke);
                if whole {
                    painter.text(
                        pos2(floor.min.x - 8.0, y),
                        Align2::RIGHT_CENTER,
                        label,
                        font.clone(),
                        palette.faint_ink,
                    );
                }
            }
        }
    }
    painter.text(
        floor.right_bottom() + vec2(8.0, 7.0),
        Align2::LEFT_TOP,
        "x/m",
        font.clone(),
        palette.faint_ink,
    );
    painter.text(
        floor.left_top() + vec2(-8.0, -6.0),
        Align2::RIGHT_BOTTOM,
        "y/m",
        font,
        palette.faint_ink,
    );
}

fn band(painter: &Painter, path: &[[f64; 2]], projection: &Projection, palette: &Palette) {
    let width = projection.length(2.0 * BAND_M);
    let points: Vec<Pos2> = path.iter().map(|p| projection.page_from_floor(*p)).collect();
    // The colour is opaque, so that ways lying on each other do not add up.
    for leg in points.windows(2) {
        painter.line_segment([leg[0], leg[1]], Stroke::new(width, palette.band));
    }
    for point in &points {
        painter.circle_filled(*point, width / 2.0, palette.band);
    }
    for leg in points.windows(2) {
        painter.line_segment([leg[0], leg[1]], Stroke::new(1.0, palette.good.gamma_multiply(0.55)));
    }
}

fn trail(painter: &Painter, trail: &Trail, projection: &Projection, palette: &Palette) {
    let ink = colour(trail.ink, palette);
    let ink = if trail.faint { ink.gamma_multiply(0.35) } else { ink };
    let points: Vec<Pos2> = trail.points.iter().map(|p| projection.page_from_floor(*p)).collect();
    if points.len() < 2 {
        return;
    }
    if trail.dashed {
        painter.extend(egui::Shape::dashed_line(
            &points,
            Stroke::new(1.8, ink),
            DASH,
            DASH * 0.7,
        ));
    } else {
        painter.line(points, PathStroke::new(2.0, ink));
    }
}

/// A flag-like cross with its number.
pub fn target(painter: &Painter, at: Pos2, ink: Color32, label: &str, palette: &Palette) {
    let stroke = Stroke::new(2.0, ink);
    painter.circle_stroke(at, 7.0, stroke);
    painter.circle_filled(at, 2.2, ink);
    if !label.is_empty() {
        let font = FontId::proportional(NAME_SIZE);
        let galley = painter.layout_no_wrap(label.to_owned(), font, ink);
        let rect = Align2::LEFT_BOTTOM.anchor_size(at + vec2(8.0, -7.0), galley.size());
        painter.rect_filled(rect.expand2(vec2(3.0, 0.0)), 3.0, palette.floor.gamma_multiply(0.85));
        painter.galley(rect.min, galley, ink);
    }
}

/// A frame fixed to the robot, in page points.
struct Body<'a> {
    pose: [f64; 3],
    projection: &'a Projection,
}

impl Body<'_> {
    fn page(&self, x_m: f64, y_m: f64) -> Pos2 {
        let (sin, cos) = self.pose[2].sin_cos();
        self.projection.page_from_floor([
            self.pose[0] + cos * x_m - sin * y_m,
            self.pose[1] + sin * x_m + cos * y_m,
        ])
    }

    /// A box around a point of the body, turned by an angle of its own.
    fn page_box(&self, center_m: [f64; 2], turn_rad: f64, half_m: [f64; 2]) -> Vec<Pos2> {
        let (sin, cos) = turn_rad.sin_cos();
        [[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]]
            .into_iter()
            .map(|[a, b]| {
                let (l, w) = (a * half_m[0], b * half_m[1]);
                self.page(center_m[0] + cos * l - sin * w, center_m[1] + sin * l + cos * w)
            })
            .collect()
    }
}

fn robot(painter: &Painter, robot: &SceneRobot, projection: &Projection, palette: &Palette) {
    let ink = colour(robot.ink, palette);
    let body = Body {
        pose: robot.pose,
        projection,
    };
    let outline = chamfered(&body, &robot.shape);
    if robot.ghost {
        let mut closed = outline.clone();
        closed.push(outline[0]);
        painter.extend(egui::Shape::dashed_line(
            &closed,
            Stroke::new(1.6, ink),
            DASH * 0.8,
            DASH * 0.6,
        ));
    } else {
        painter.add(egui::Shape::convex_polygon(
            outline,
            palette.floor.lerp_to_gamma(ink, 0.22),
            Stroke::new(2.0, ink),
        ));
        for wheel in &robot.shape.wheels {
            let half_m = if wheel.driven {
                [wheel.radius_m * 0.8, 0.014]
            } else {
                [wheel.radius_m * 0.7; 2]
            };
            let points = body.page_box([wheel.x_m, wheel.y_m], wheel.direction_rad, half_m);
            painter.add(egui::Shape::convex_polygon(
                points,
                ink.gamma_multiply(0.75),
                Stroke::NONE,
            ));
        }
    }
    heading(painter, &body, &robot.shape, ink);
    if robot.show_name {
        let below = projection.page_from_floor([robot.pose[0], robot.pose[1]])
            + vec2(0.0, projection.length(robot_extent_m(&robot.shape)) + 3.0);
        painter.text(
            below,
            Align2::CENTER_TOP,
            &robot.name,
            FontId::proportional(NAME_SIZE),
            palette.ink,
        );
    }
    if let Some(mark) = &robot.mark {
        safety_mark(painter, &body, robot, mark, palette);
    }
}

fn safety_mark(painter: &Painter, body: &Body<'_>, robot: &SceneRobot, mark: &str, palette: &Palette) {
    let center = body.page(0.0, 0.0);
    let radius = body.projection.length(robot_extent_m(&robot.shape)) + 4.0;
    painter.circle_stroke(center, radius, Stroke::new(2.5, palette.warning));
    let font = FontId::proportional(NAME_SIZE);
    painter.text(
        center - vec2(0.0, radius + 3.0),
        Align2::CENTER_BOTTOM,
        mark,
        font,
        palette.warning,
    );
}

/// Farthest point of the body from its origin.
pub fn robot_extent_m(shape: &Shape) -> f64 {
    shape.half_length_m.hypot(shape.half_width_m) * 0.86
}

/// Rectangle with cut corners.
fn chamfered(body: &Body<'_>, shape: &Shape) -> Vec<Pos2> {
    let (l, w) = (shape.half_length_m, shape.half_width_m);
    let cut = 0.22 * l.min(w);
    [
        [l, w - cut],
        [l - cut, w],
        [cut - l, w],
        [-l, w - cut],
        [-l, cut - w],
        [cut - l, -w],
        [l - cut, -w],
        [l, cut - w],
    ]
    .into_iter()
    .map(|[x, y]| body.page(x, y))
    .collect()
}

fn heading(painter: &Painter, body: &Body<'_>, shape: &Shape, ink: Color32) {
    let tip = shape.half_length_m * 0.92;
    let base = shape.half_length_m * 0.45;
    let half = shape.half_width_m * 0.3;
    let points = vec![body.page(tip, 0.0), body.page(base, half), body.page(base, -half)];
    painter.add(egui::Shape::convex_polygon(points, ink, Stroke::NONE));
}
