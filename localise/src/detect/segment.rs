//! Dark connected components with the outline of a quadrilateral.

use super::DetectorSettings;
use super::quad::{Quad, outline, quad_of_hull};
use crate::frame::Frame;

/// Side of a tile, px; thresholds come from a tile and its eight neighbours (12 px).
const TILE: usize = 4;
/// Runs of dark pixels in one search.
const RUNS_MAX: usize = 60_000;

/// Dark pixels `[from, to)` of a row of the rectangle.
#[derive(Debug, Clone, Copy)]
struct Run {
    row: u32,
    from: u32,
    to: u32,
}

#[derive(Debug, Clone, Copy)]
struct Blob {
    left: u32,
    right: u32,
    top: u32,
    bottom: u32,
    area: u32,
    /// Where its rows begin in `extremes`, if it is worth a look.
    slot: u32,
}

const NO_SLOT: u32 = u32::MAX;

/// Buffers of the search.
#[derive(Debug, Default)]
pub(super) struct Segmenter {
    low: Vec<u8>,
    high: Vec<u8>,
    threshold: Vec<u8>,
    line: [Vec<u8>; 2],
    runs: Vec<Run>,
    parent: Vec<u32>,
    blobs: Vec<Blob>,
    extremes: Vec<[u32; 2]>,
    hull: Vec<[f64; 2]>,
    quads: Vec<Quad>,
}

impl Segmenter {
    /// Quadrilaterals of the last run, in pixels of the frame.
    pub(super) fn quads(&self) -> &[Quad] {
        &self.quads
    }

    /// - `rectangle`: left, top, width, height.
    /// - Returns true if there were more runs than the limit.
    pub(super) fn run(&mut self, frame: &Frame<'_>, rectangle: [usize; 4], settings: &DetectorSettings) -> bool {
        let [left, top, width, height] = rectangle;
        let (across, down) = (width / TILE, height / TILE);
        self.quads.clear();
        self.tiles(frame, [left, top], [across, down]);
        self.thresholds([across, down], settings.contrast_min.max(1));
        let overflow = self.label(frame, [left, top], [across, down]);
        self.outlines(settings, [left, top], [across * TILE, down * TILE], frame);
        overflow
    }

    /// Darkest and brightest pixel per tile.
    fn tiles(&mut self, frame: &Frame<'_>, [left, top]: [usize; 2], [across, down]: [usize; 2]) {
        self.low.clear();
        self.high.clear();
        let width = across * TILE;
        for tile_row in 0..down {
            let [low, high] = &mut self.line;
            let first = frame.row(top + tile_row * TILE, left, width);
            low.clear();
            low.extend_from_slice(first);
            high.clear();
            high.extend_from_slice(first);
            for row in 1..TILE {
                let pixels = frame.row(top + tile_row * TILE + row, left, width);
                for ((low, high), &pixel) in low.iter_mut().zip(high.iter_mut()).zip(pixels) {
                    *low = (*low).min(pixel);
                    *high = (*high).max(pixel);
                }
            }
            self.low.extend(
                low.as_chunks::<TILE>()
                    .0
                    .iter()
                    .map(|t| t[0].min(t[1]).min(t[2].min(t[3]))),
            );
            self.high.extend(
                high.as_chunks::<TILE>()
                    .0
                    .iter()
                    .map(|t| t[0].max(t[1]).max(t[2].max(t[3]))),
            );
        }
    }

    /// Threshold per tile: below it a pixel is dark; 0 where the contrast is too small for a tag.
    fn thresholds(&mut self, [across, down]: [usize; 2], contrast_min: u8) {
        self.threshold.clear();
        self.threshold.resize(across * down, 0);
        for row in 0..down {
            let [low, high] = &mut self.line;
            low.clear();
            low.resize(across + 2, u8::MAX);
            high.clear();
            high.resize(across + 2, 0);
            for neighbour in row.saturating_sub(1)..(row + 2).min(down) {
                let range = neighbour * across..(neighbour + 1) * across;
                for (out, &value) in low[1..].iter_mut().zip(&self.low[range.clone()]) {
                    *out = (*out).min(value);
                }
                for (out, &value) in high[1..].iter_mut().zip(&self.high[range]) {
                    *out = (*out).max(value);
                }
            }
            for (column, out) in self.threshold[row * across..(row + 1) * across].iter_mut().enumerate() {
                let dark = low[column].min(low[column + 1]).min(low[column + 2]);
                let bright = high[column].max(high[column + 1]).max(high[column + 2]);
                if bright - dark >= contrast_min {
                    *out = dark + (bright - dark).div_ceil(2);
                }
            }
        }
    }

    /// Runs of dark pixels, joined with those they touch in the row above (corners count).
    fn label(&mut self, frame: &Frame<'_>, [left, top]: [usize; 2], [across, down]: [usize; 2]) -> bool {
        self.runs.clear();
        self.parent.clear();
        let mut above = 0..0;
        for row in 0..down * TILE {
            let begin = self.runs.len();
            let pixels = frame.row(top + row, left, across * TILE);
            let thresholds = &self.threshold[row / TILE * across..][..across];
            let mut open: Option<u32> = None;
            for (tile, (&threshold, pixels)) in thresholds.iter().zip(pixels.as_chunks::<TILE>().0).enumerate() {
                if threshold == 0 && open.is_none() {
                    continue;
                }
                for (offset, &pixel) in pixels.iter().enumerate() {
                    let column = (tile * TILE + offset) as u32;
                    match (pixel < threshold, open) {
                        (true, None) => open = Some(column),
                        (false, Some(from)) => {
                            self.runs.push(Run {
                                row: row as u32,
                                from,
                                to: column,
                            });
                            open = None;
                        }
                        _ => {}
                    }
                }
            }
            if let Some(from) = open {
                self.runs.push(Run {
                    row: row as u32,
                    from,
                    to: (across * TILE) as u32,
                });
            }
            if self.runs.len() > RUNS_MAX {
                self.runs.truncate(begin);
                return true;
            }
            self.join(above, begin);
            above = begin..self.runs.len();
        }
        false
    }

    fn join(&mut self, above: std::ops::Range<usize>, begin: usize) {
        let mut first = above.start;
        for current in begin..self.runs.len() {
            self.parent.push(current as u32);
            let run = self.runs[current];
            while first < above.end && self.runs[first].to < run.from {
                first += 1;
            }
            let mut other = first;
            while other < above.end && self.runs[other].from <= run.to {
                let (a, b) = (self.root(current as u32), self.root(other as u32));
                self.parent[a.max(b) as usize] = a.min(b);
                other += 1;
            }
        }
    }

    fn root(&mut self, mut of: u32) -> u32 {
        while self.parent[of as usize] != of {
            let next = self.parent[self.parent[of as usize] as usize];
            self.parent[of as usize] = next;
            of = next;
        }
        of
    }

    fn outlines(&mut self, settings: &DetectorSettings, corner: [usize; 2], sides: [usize; 2], frame: &Frame<'_>) {
        self.measure();
        let fits = |blob: &Blob| {
            let (across, down) = (f64::from(blob.right - blob.left), f64::from(blob.bottom - blob.top));
            let (small, large) = (across.min(down), across.max(down));
            let inside = blob.left > 0 || corner[0] == 0;
            let inside = inside && (blob.top > 0 || corner[1] == 0);
            let inside = inside && (blob.right < sides[0] as u32 || corner[0] + sides[0] + TILE > frame.width_px());
            let inside = inside && (blob.bottom < sides[1] as u32 || corner[1] + sides[1] + TILE > frame.height_px());
            // A square ring is at least a fifth of the box around it, however it is turned.
            inside
                && small >= settings.edge_min_px
                && large <= 1.5 * settings.edge_max_px
                && large <= 2.5 * small
                && f64::from(blob.area) >= 0.15 * across * down
        };
        self.extremes.clear();
        for blob in &mut self.blobs {
            if blob.area > 0 && fits(blob) {
                blob.slot = self.extremes.len() as u32;
                self.extremes.extend((blob.top..blob.bottom).map(|_| [u32::MAX, 0]));
            }
        }
        for (index, run) in self.runs.iter().enumerate() {
            let blob = &self.blobs[self.parent[index] as usize];
            if blob.slot != NO_SLOT {
                let [from, to] = &mut self.extremes[(blob.slot + run.row - blob.top) as usize];
                *from = (*from).min(run.from);
                *to = (*to).max(run.to);
            }
        }
        for blob in self.blobs.iter().filter(|blob| blob.slot != NO_SLOT) {
            let rows = &self.extremes[blob.slot as usize..][..(blob.bottom - blob.top) as usize];
            outline(rows, blob.top, &mut self.hull);
            if let Some(mut quad) = quad_of_hull(&self.hull, settings) {
                for point in &mut quad {
                    point[0] += corner[0] as f64;
                    point[1] += corner[1] as f64;
                }
                self.quads.push(quad);
            }
        }
    }

    /// Box and area per component, at the index of its root; `parent` becomes the root of every run.
    fn measure(&mut self) {
        self.blobs.clear();
        for index in 0..self.runs.len() {
            let run = self.runs[index];
            let root = self.root(index as u32) as usize;
            self.parent[index] = root as u32;
            self.blobs.push(Blob {
                left: run.from,
                right: run.to,
                top: run.row,
                bottom: run.row + 1,
                area: 0,
                slot: NO_SLOT,
            });
            let blob = &mut self.blobs[root];
            blob.left = blob.left.min(run.from);
            blob.right = blob.right.max(run.to);
            blob.bottom = run.row + 1;
            blob.area += run.to - run.from;
        }
    }
}
