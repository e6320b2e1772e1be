//! The code inside four edges.

use super::edge::Edges;
use super::homography::{apply, square_to_quad};
use super::{DetectorSettings, TagDetection};
use crate::family::{self, MODULES_ACROSS};
use crate::frame::Frame;
use crate::lens::Lens;

/// Why a quadrilateral is no tag.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum NoTag {
    Border,
    Code,
}

/// Modules across with the white rim around the border.
const ACROSS: usize = MODULES_ACROSS + 2;
/// Part of the neighbours' difference that is added to a module against blur.
const SHARPEN: f32 = 0.15;
/// Modules of the border that may look white, and of the rim that may look black.
const WRONG_BORDER_MAX: usize = 1;
const WRONG_RIM_MAX: usize = 6;
/// A wrong bit must have been closer to the threshold than this.
const UNCLEAR: f32 = 0.5;

/// Grey values per module, row by row from the top left of the reading.
type Grid = [[f32; ACROSS]; ACROSS];

pub(super) fn decode(
    frame: &Frame<'_>,
    lens: &Lens,
    edges: &Edges,
    settings: &DetectorSettings,
) -> Result<TagDetection, NoTag> {
    let grid = sample(frame, lens, edges)?;
    let (grid, contrast) = against_border(&grid, f32::from(settings.contrast_min) * 0.6)?;
    let (mut bits, mut sum) = (0u64, 0.0);
    let mut clear = [0.0f32; 36];
    for row in 0..6 {
        for column in 0..6 {
            let (r, c) = (row + 2, column + 2);
            let around = grid[r - 1][c] + grid[r + 1][c] + grid[r][c - 1] + grid[r][c + 1];
            let value = grid[r][c] + SHARPEN * (4.0 * grid[r][c] - around);
            bits = bits << 1 | u64::from(value > 0.0);
            clear[row * 6 + column] = value.abs();
            sum += value.abs().min(1.0);
        }
    }
    let margin = sum / 36.0;
    let found = family::find(bits, settings.hamming_max.min(5)).ok_or(NoTag::Code)?;
    // Back from the upright reading to the grid: `wrong` is turned until four turns are full.
    let wrong = (found.turns..4).fold(found.wrong, |bits, _| family::turned(bits));
    let wrong_is_unclear = clear
        .iter()
        .enumerate()
        .all(|(at, &clear)| wrong >> (35 - at) & 1 == 0 || clear < UNCLEAR);
    if margin < settings.margin_min || !wrong_is_unclear {
        return Err(NoTag::Code);
    }
    let upright = |corners: &[[f64; 2]; 4]| [0, 1, 2, 3].map(|index| corners[(index + found.turns) % 4]);
    Ok(TagDetection {
        id: found.id,
        hamming: found.wrong.count_ones(),
        margin,
        contrast,
        corners_px: upright(&edges.corners_px),
        corners: upright(&edges.corners),
        edge_rms_px: edges.rms_px,
    })
}

/// Mean of four points per module, half a module apart.
fn sample(frame: &Frame<'_>, lens: &Lens, edges: &Edges) -> Result<Grid, NoTag> {
    let map = square_to_quad(&edges.corners).ok_or(NoTag::Border)?;
    let module = 2.0 / MODULES_ACROSS as f64;
    let mut grid = Grid::default();
    for (row, line) in grid.iter_mut().enumerate() {
        for (column, value) in line.iter_mut().enumerate() {
            let x = -1.0 + (column as f64 - 0.5) * module;
            let y = 1.0 - (row as f64 - 0.5) * module;
            for (right, up) in [(-0.25, -0.25), (0.25, -0.25), (0.25, 0.25), (-0.25, 0.25)] {
                let at = apply(&map, [x + right * module, y + up * module]);
                *value += 0.25 * frame.sample(lens.distort(at));
            }
        }
    }
    Ok(grid)
}

/// The grid with black at -1 and white at +1, each a plane through the border's and the rim's modules (uneven light).
fn against_border(grid: &Grid, contrast_min: f32) -> Result<(Grid, f32), NoTag> {
    let ring = |row: usize, column: usize| row.min(column).min(ACROSS - 1 - row).min(ACROSS - 1 - column);
    let centre = (ACROSS - 1) as f32 / 2.0;
    // Both rings are symmetric, so mean and slopes of the plane are three separate sums.
    let plane = |wanted: usize| {
        let (mut count, mut mean, mut squares) = (0.0, 0.0, 0.0);
        let mut slope = [0.0; 2];
        for (row, line) in grid.iter().enumerate() {
            for (column, value) in line
                .iter()
                .enumerate()
                .filter(|&(column, _)| ring(row, column) == wanted)
            {
                let (x, y) = (column as f32 - centre, row as f32 - centre);
                count += 1.0;
                mean += value;
                squares += x * x;
                slope[0] += x * value;
                slope[1] += y * value;
            }
        }
        [mean / count, slope[0] / squares, slope[1] / squares]
    };
    let (white, black) = (plane(0), plane(1));
    let mut out = *grid;
    let (mut wrong_rim, mut wrong_border) = (0, 0);
    for (row, line) in out.iter_mut().enumerate() {
        for (column, value) in line.iter_mut().enumerate() {
            let at =
                |plane: &[f32; 3]| plane[0] + plane[1] * (column as f32 - centre) + plane[2] * (row as f32 - centre);
            let (white, black) = (at(&white), at(&black));
            if white - black < contrast_min {
                return Err(NoTag::Border);
            }
            *value = (2.0 * *value - white - black) / (white - black);
            wrong_rim += usize::from(ring(row, column) == 0 && *value < 0.0);
            wrong_border += usize::from(ring(row, column) == 1 && *value > 0.0);
        }
    }
    if wrong_rim > WRONG_RIM_MAX || wrong_border > WRONG_BORDER_MAX {
        return Err(NoTag::Border);
    }
    Ok((out, white[0] - black[0]))
}
