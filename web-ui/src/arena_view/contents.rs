//! What stands in an arena and what its floor is like: regions, obstacles, geofence.

use super::Projection;
use crate::theme::Palette;
use api::arena::{Contents, Shape};
use api::experiment::Pose;
use egui::epaint::PathStroke;
use egui::{Align2, Color32, FontId, Painter, Pos2, Stroke};

/// Corners of a drawn circle.
const ROUND: usize = 48;
const TEXT_SIZE: f32 = 11.5;
const DASH: f32 = 9.0;
/// Room around a word inside an outline, points.
const WORD_MARGIN: f32 = 4.0;

/// Floor regions: below everything that is drawn on the floor.
pub fn regions(painter: &Painter, contents: &Contents, projection: &Projection, palette: &Palette) {
    for region in &contents.regions {
        let corners = outline(&region.shape, &region.pose, projection);
        let ink = if region.friction_scale < 1.0 {
            palette.warning
        } else {
            palette.faint_ink
        };
        fill(painter, corners.clone(), ink.gamma_multiply(0.13));
        painter.extend(egui::Shape::dashed_line(
            &closed(corners),
            Stroke::new(1.0, ink.gamma_multiply(0.6)),
            3.0,
            3.0,
        ));
    }
}

/// Words of regions, obstacles and the geofence: above paths, below robots.
pub fn things(painter: &Painter, contents: &Contents, projection: &Projection, palette: &Palette) {
    for region in &contents.regions {
        let corners = outline(&region.shape, &region.pose, projection);
        let text = format!("friction \u{d7} {}", region.friction_scale);
        word(painter, &corners, text, palette.faint_ink);
    }
    for one in &contents.fixed {
        let corners = outline(&one.shape, &one.pose, projection);
        fill(painter, corners.clone(), palette.wall);
        word(painter, &corners, one.name.clone(), palette.floor);
    }
    for one in &contents.pushable {
        let corners = outline(&one.shape, &one.pose, projection);
        fill(painter, corners.clone(), palette.wall.gamma_multiply(0.25));
        painter.line(closed(corners.clone()), PathStroke::new(1.5, palette.wall));
        word(painter, &corners, one.name.clone(), palette.ink);
    }
    if contents.geofence.len() > 2 {
        let corners: Vec<Pos2> = contents
            .geofence
            .iter()
            .map(|at| projection.page_from_floor(*at))
            .collect();
        painter.extend(egui::Shape::dashed_line(
            &closed(corners),
            Stroke::new(1.8, palette.error),
            DASH,
            DASH * 0.6,
        ));
    }
}

/// Filled outline of a circle or a rectangle; both are convex.
fn fill(painter: &Painter, corners: Vec<Pos2>, colour: Color32) {
    painter.add(egui::Shape::convex_polygon(corners, colour, Stroke::NONE));
}

fn closed(mut corners: Vec<Pos2>) -> Vec<Pos2> {
    corners.extend(corners.first().copied());
    corners
}

/// A word in the middle of an outline, where it fits.
fn word(painter: &Painter, corners: &[Pos2], text: String, ink: Color32) {
    let room = egui::Rect::from_points(corners);
    let galley = painter.layout_no_wrap(text, FontId::proportional(TEXT_SIZE), ink);
    if galley.size().x + WORD_MARGIN <= room.width() && galley.size().y <= room.height() {
        let place = Align2::CENTER_CENTER.anchor_size(room.center(), galley.size());
        painter.galley(place.min, galley, ink);
    }
}

fn outline(shape: &Shape, pose: &Pose, projection: &Projection) -> Vec<Pos2> {
    let corners: Vec<[f64; 2]> = match shape {
        Shape::Circle { radius_m } => (0..ROUND)
            .map(|k| std::f64::consts::TAU * k as f64 / ROUND as f64)
            .map(|angle_rad| [radius_m * angle_rad.cos(), radius_m * angle_rad.sin()])
            .collect(),
        Shape::Rectangle { length_m, width_m } => [(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)]
            .map(|(x, y)| [0.5 * length_m * x, 0.5 * width_m * y])
            .to_vec(),
    };
    let (sin, cos) = pose.yaw_rad.sin_cos();
    corners
        .iter()
        .map(|[x, y]| projection.page_from_floor([pose.x_m + cos * x - sin * y, pose.y_m + sin * x + cos * y]))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use egui::pos2;

    #[test]
    fn outlines_stand_where_their_poses_say() {
        let projection = Projection {
            center: pos2(100.0, 100.0),
            points_per_m: 10.0,
        };
        let pose = Pose {
            x_m: 1.0,
            y_m: 2.0,
            yaw_rad: std::f64::consts::FRAC_PI_2,
        };
        let shape = Shape::Rectangle {
            length_m: 4.0,
            width_m: 2.0,
        };
        let room = egui::Rect::from_points(&outline(&shape, &pose, &projection));
        // Turned by a quarter: its length stands upright.
        assert!((room.center() - pos2(110.0, 80.0)).length() < 1e-3, "{room:?}");
        assert!((room.width() - 20.0).abs() < 1e-3 && (room.height() - 40.0).abs() < 1e-3);
        let round = outline(&Shape::Circle { radius_m: 0.5 }, &pose, &projection);
        assert!(
            round
                .iter()
                .all(|at| ((*at - pos2(110.0, 80.0)).length() - 5.0).abs() < 1e-3)
        );
    }
}
