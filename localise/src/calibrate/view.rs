//! Boards of tags and what a camera saw of them.

use super::CalibrationSettings;
use crate::detect::TagDetection;
use crate::problem::Problem;

/// One tag of a board.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BoardTag {
    pub id: u16,
    pub x_m: f64,
    pub y_m: f64,
    pub yaw_rad: f64,
    /// Side of the black border.
    pub edge_m: f64,
}

/// Tags in one plane; in the world view x, y are world places and `z_m` the height above the floor.
#[derive(Debug, Clone, PartialEq)]
pub struct Board {
    pub tags: Vec<BoardTag>,
    pub z_m: f64,
}

/// One picture: the board, and the tags found.
#[derive(Debug, Clone, PartialEq)]
pub struct BoardView {
    pub board: Board,
    pub detections: Vec<TagDetection>,
}

/// Corners of one view.
#[derive(Debug, Clone)]
pub(super) struct Points {
    pub(super) world: Vec<[f64; 3]>,
    pub(super) pixel: Vec<[f64; 2]>,
}

/// Tags that every view needs.
const TAGS_MIN: usize = 4;
/// Views and tags that are looked at.
const VIEWS_MAX: usize = 200;

/// Corners of all views with their places on the board.
pub(super) fn points(views: &[BoardView], settings: &CalibrationSettings) -> Result<Vec<Points>, Problem> {
    Problem::in_range(
        "views",
        views.len() as f64,
        [settings.views_min.max(1) as f64, VIEWS_MAX as f64],
        "pictures",
        "take pictures of the board at different tilts",
    )?;
    Problem::in_range(
        "world_view",
        settings.world_view as f64,
        [0.0, views.len() as f64 - 1.0],
        "",
        "name the picture in which the board's places are world places",
    )?;
    let mut out = Vec::with_capacity(views.len());
    for (index, view) in views.iter().enumerate() {
        out.push(view_points(view, index)?);
    }
    check_span(&out, settings)?;
    Ok(out)
}

fn view_points(view: &BoardView, index: usize) -> Result<Points, Problem> {
    let field = |name: &str| format!("views[{index}].{name}");
    let mut points = Points {
        world: Vec::new(),
        pixel: Vec::new(),
    };
    for (at, detection) in view.detections.iter().enumerate() {
        if view.detections[..at].iter().any(|other| other.id == detection.id) {
            return Err(Problem::new(
                field("detections"),
                format!("tag {} is there twice", detection.id),
                "each tag once",
                "cover the other copy of the tag",
            ));
        }
        // A tag that is not on the board may stand anywhere in the picture.
        let Some(tag) = view.board.tags.iter().find(|tag| tag.id == detection.id) else {
            continue;
        };
        let possible = [tag.x_m, tag.y_m, tag.yaw_rad, view.board.z_m]
            .iter()
            .all(|number| number.abs() < 1000.0);
        if !possible || tag.edge_m.is_nan() || tag.edge_m <= 0.001 || tag.edge_m > 10.0 {
            return Err(Problem::new(
                field("board"),
                format!("tag {} has no possible place or size", tag.id),
                "within 1000 m, edge 1 mm to 10 m",
                "measure the board",
            ));
        }
        let (sine, cosine) = tag.yaw_rad.sin_cos();
        let half = tag.edge_m / 2.0;
        for ([x, y], pixel) in [[-half, -half], [half, -half], [half, half], [-half, half]]
            .into_iter()
            .zip(detection.corners_px)
        {
            let place = [
                tag.x_m + cosine * x - sine * y,
                tag.y_m + sine * x + cosine * y,
                view.board.z_m,
            ];
            points.world.push(place);
            points.pixel.push(pixel);
        }
    }
    if points.world.len() < 4 * TAGS_MIN {
        return Err(Problem::new(
            field("detections"),
            format!("{} tags of the board", points.world.len() / 4),
            format!("at least {TAGS_MIN} tags"),
            "leave this picture out or take it again with more of the board in view",
        ));
    }
    if spread(&points) < 0.1 {
        return Err(Problem::new(
            field("detections"),
            "the tags stand nearly on a line",
            "at least a tenth as wide as long",
            "take the picture again with tags in two directions",
        ));
    }
    Ok(points)
}

/// Ratio of the smaller to the larger standard deviation of the places on the board.
fn spread(points: &Points) -> f64 {
    let count = points.world.len() as f64;
    let mean = [0, 1].map(|axis| points.world.iter().map(|p| p[axis]).sum::<f64>() / count);
    let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
    for place in &points.world {
        let (x, y) = (place[0] - mean[0], place[1] - mean[1]);
        xx += x * x;
        xy += x * y;
        yy += y * y;
    }
    let middle = (xx + yy) / 2.0;
    let half = ((xx - yy) / 2.0).hypot(xy);
    ((middle - half).max(0.0) / (middle + half)).sqrt()
}

/// The corners of all views together must reach over the picture, else the distortion is a guess at its border.
fn check_span(points: &[Points], settings: &CalibrationSettings) -> Result<(), Problem> {
    for (axis, (name, side)) in [("width", settings.width_px), ("height", settings.height_px)]
        .into_iter()
        .enumerate()
    {
        let places = || {
            points
                .iter()
                .flat_map(|view| view.pixel.iter().map(|pixel| pixel[axis]))
        };
        let low = places().fold(f64::INFINITY, f64::min);
        let high = places().fold(f64::NEG_INFINITY, f64::max);
        Problem::in_range(
            &format!("span of the picture's {name}"),
            (high - low) / side as f64,
            [settings.span_min, 1.0],
            "",
            "take pictures with the board near all four borders",
        )?;
    }
    Ok(())
}
