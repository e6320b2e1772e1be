//! AprilTag 36h11 in grey frames: dark components, quadrilaterals, edges to a fraction of a pixel, code.

mod decode;
mod edge;
mod homography;
mod quad;
mod segment;

use serde::{Deserialize, Serialize};

use crate::frame::Frame;
use crate::lens::Lens;
use segment::Segmenter;

/// What the detector asks of a tag.
#[derive(Debug, Clone, PartialEq)]
pub struct DetectorSettings {
    /// Least difference of brightest and darkest grey in a neighbourhood of 12 px for it to be looked at.
    pub contrast_min: u8,
    /// Least length of a tag's side.
    pub edge_min_px: f64,
    /// Largest length of a tag's side.
    pub edge_max_px: f64,
    /// Bits that may be wrong; each must have been unclear as well.
    pub hamming_max: u32,
    /// Least mean distance of the bits from the threshold, 1 is the tag's own black or white.
    pub margin_min: f32,
    /// Largest root mean square distance of edge points from their straight edge.
    pub edge_rms_max_px: f64,
    /// Tag ids from this one on are foreign: counted, never reported.
    pub identities: u16,
}

impl Default for DetectorSettings {
    fn default() -> DetectorSettings {
        DetectorSettings {
            contrast_min: 30,
            edge_min_px: 14.0,
            edge_max_px: 160.0,
            hamming_max: 1,
            margin_min: 0.4,
            edge_rms_max_px: 0.5,
            identities: 64,
        }
    }
}

/// One tag in one frame.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TagDetection {
    pub id: u16,
    /// Bits that differ from the code.
    pub hamming: u32,
    /// Mean distance of the bits from the threshold, 1 is the tag's own black or white.
    pub margin: f32,
    /// White minus black, grey values.
    pub contrast: f32,
    /// Corners of the black border as seen through the lens: bottom left, bottom right, top right, top left of the upright tag.
    pub corners_px: [[f64; 2]; 4],
    /// The same corners as normalised directions, without distortion.
    pub corners: [[f64; 2]; 4],
    /// Root mean square distance of the edge points from their edges.
    pub edge_rms_px: f64,
}

impl TagDetection {
    pub fn centre_px(&self) -> [f64; 2] {
        let sum = |axis: usize| self.corners_px.iter().map(|corner| corner[axis]).sum::<f64>() / 4.0;
        [sum(0), sum(1)]
    }
}

/// A square of the picture to search in.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Region {
    pub centre_px: [f64; 2],
    pub half_px: f64,
}

/// How many candidates ended where.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Rejections {
    /// Four-sided dark components that were looked at.
    pub candidates: u32,
    /// Edges not found, not straight, or at the picture's border.
    pub edges: u32,
    /// Border not black, surroundings not white, or no contrast.
    pub border: u32,
    /// No code of the family, or bits too unclear.
    pub code: u32,
    /// A tag of the family that no robot carries.
    pub foreign: u32,
    /// 1 if the frame had more structure than the detector looks at; the rest was not searched.
    pub overflow: u32,
}

/// What was found in one frame.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Detections {
    /// Sorted by id; an id that stands in `duplicates` is here more than once.
    pub tags: Vec<TagDetection>,
    /// Ids seen at more than one place of this frame.
    pub duplicates: Vec<u16>,
    pub rejections: Rejections,
}

/// Finds tags; keeps its buffers from frame to frame, and nothing else.
#[derive(Debug)]
pub struct Detector {
    settings: DetectorSettings,
    segmenter: Segmenter,
}

impl Detector {
    pub fn new(settings: DetectorSettings) -> Detector {
        Detector {
            settings,
            segmenter: Segmenter::default(),
        }
    }

    pub fn settings(&self) -> &DetectorSettings {
        &self.settings
    }

    /// Searches the whole frame. Edges are straightened through `lens` before lines are fitted.
    pub fn search(&mut self, frame: &Frame<'_>, lens: &Lens) -> Detections {
        let mut found = Detections::default();
        self.search_rectangle(frame, lens, [0, 0, frame.width_px(), frame.height_px()], &mut found);
        sort_out(&mut found);
        found
    }

    /// Searches around predicted places only; regions may overlap each other and the picture's border.
    pub fn search_around(&mut self, frame: &Frame<'_>, lens: &Lens, regions: &[Region]) -> Detections {
        let mut found = Detections::default();
        for region in regions {
            if let Some(rectangle) = rectangle(frame, region) {
                self.search_rectangle(frame, lens, rectangle, &mut found);
            }
        }
        sort_out(&mut found);
        found
    }

    fn search_rectangle(&mut self, frame: &Frame<'_>, lens: &Lens, rectangle: [usize; 4], found: &mut Detections) {
        let Detector { settings, segmenter } = self;
        let count = &mut found.rejections;
        count.overflow |= u32::from(segmenter.run(frame, rectangle, settings));
        for quad in segmenter.quads() {
            count.candidates += 1;
            let Some(edges) = edge::refine(frame, lens, quad, settings) else {
                count.edges += 1;
                continue;
            };
            match decode::decode(frame, lens, &edges, settings) {
                Ok(tag) if tag.id < settings.identities => found.tags.push(tag),
                Ok(_) => count.foreign += 1,
                Err(decode::NoTag::Border) => count.border += 1,
                Err(decode::NoTag::Code) => count.code += 1,
            }
        }
    }
}

/// The region inside the frame, sides on multiples of 4 px so that it is cut into the same tiles as the whole frame.
fn rectangle(frame: &Frame<'_>, region: &Region) -> Option<[usize; 4]> {
    let sides = [frame.width_px(), frame.height_px()];
    let mut out = [0; 4];
    for axis in 0..2 {
        // A cast of a float saturates, and of a NaN gives 0: an empty region.
        let low = (region.centre_px[axis] - region.half_px).floor() as i64;
        let high = (region.centre_px[axis] + region.half_px).ceil() as i64;
        let from = low.clamp(0, sides[axis] as i64) as usize / 4 * 4;
        let to = (high.clamp(0, sides[axis] as i64) as usize).div_ceil(4) * 4;
        let to = to.min(sides[axis]);
        if to < from + 16 {
            return None;
        }
        (out[axis], out[axis + 2]) = (from, to - from);
    }
    Some(out)
}

/// The same tag found in overlapping regions once, the same id at two places as a duplicate.
fn sort_out(found: &mut Detections) {
    found
        .tags
        .sort_by(|a, b| a.id.cmp(&b.id).then(b.margin.total_cmp(&a.margin)));
    let mut kept: Vec<TagDetection> = Vec::with_capacity(found.tags.len());
    for tag in found.tags.drain(..) {
        let [u, v] = tag.centre_px();
        let same_place = |other: &TagDetection| {
            let [a, b] = other.centre_px();
            (a - u).hypot(b - v) < 4.0
        };
        let mut others = kept.iter().rev().take_while(|other| other.id == tag.id).peekable();
        let known = others.peek().is_some();
        if known && others.any(same_place) {
            continue;
        }
        if known && found.duplicates.last() != Some(&tag.id) {
            found.duplicates.push(tag.id);
        }
        kept.push(tag);
    }
    found.tags = kept;
}
