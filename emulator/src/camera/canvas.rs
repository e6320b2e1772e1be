//! The picture before the chip: light on every pixel, only what changed drawn anew.

use super::blur::{Blur, Region};
use super::faults::CameraFaults;
use super::light::{light_dn, shade};
use super::optics::Optics;
use super::problem::CameraProblem;
use super::robot_view::RobotInView;
use super::settings::CameraSettings;
use super::stroke::Stroke;
use super::tag::Tag;

/// Share of light that is left when the hall's light is off.
const NIGHT: f32 = 0.004;

/// All pictures here are row by row, one number a pixel; signals in DN above black.
#[derive(Debug, Clone)]
pub struct Canvas {
    optics: Optics,
    slopes: Vec<[f32; 2]>,
    /// Reflectance of the empty floor.
    floor: Vec<f32>,
    clean_light_dn: Vec<f32>,
    /// With dirt, and the light on or off.
    light_dn: Vec<f32>,
    /// The empty arena, before and after the blur.
    still: Vec<f32>,
    still_blurred: Vec<f32>,
    sharp: Vec<f32>,
    blurred: Vec<f32>,
    blur: Blur,
    /// Where the last frame differs from the empty arena.
    changed: Vec<Region>,
}

impl Canvas {
    /// Makes all tables of a camera; some tens of milliseconds.
    pub fn new(optics: Optics, settings: &CameraSettings) -> Result<Self, CameraProblem> {
        let slopes = optics.slopes()?;
        let floor: Vec<f32> = slopes
            .iter()
            .map(|slope| [0, 1].map(|axis| optics.position_m[axis] + optics.position_m[2] * f64::from(slope[axis])))
            .map(|point_m| settings.floor.reflectance_at(point_m) as f32)
            .collect();
        let light = light_dn(&optics, &slopes, settings);
        let mut canvas = Self {
            still: vec![0.0; floor.len()],
            still_blurred: vec![0.0; floor.len()],
            sharp: vec![0.0; floor.len()],
            blurred: vec![0.0; floor.len()],
            light_dn: light.clone(),
            clean_light_dn: light,
            blur: Blur::new(settings.defocus_px),
            changed: Vec::new(),
            optics,
            slopes,
            floor,
        };
        canvas.relight(&CameraFaults::default());
        Ok(canvas)
    }

    pub fn optics(&self) -> &Optics {
        &self.optics
    }

    /// The light or the dirt changed: the empty arena is drawn anew.
    pub fn relight(&mut self, faults: &CameraFaults) {
        self.light_dn.clone_from(&self.clean_light_dn);
        for spot in &faults.dirt {
            shade(&mut self.light_dn, self.optics.width_px, spot);
        }
        if faults.light_off {
            self.light_dn.iter_mut().for_each(|light| *light *= NIGHT);
        }
        for ((still, reflectance), light) in self.still.iter_mut().zip(&self.floor).zip(&self.light_dn) {
            *still = reflectance * light;
        }
        let (width, height) = self.size();
        let all = Region {
            left: 0,
            top: 0,
            right: width,
            bottom: height,
        };
        self.blur.apply(&self.still, &mut self.still_blurred, width, all);
        self.sharp.clone_from(&self.still);
        self.blurred.clone_from(&self.still_blurred);
        self.changed.clear();
    }

    /// Draws the robots; what the last frame changed becomes the empty arena again first.
    pub fn draw(&mut self, robots: &[RobotInView<'_>], faults: &CameraFaults) {
        let (width, height) = self.size();
        for region in self.changed.drain(..) {
            for row in region.top..region.bottom {
                let line = row * width + region.left..row * width + region.right;
                self.sharp[line.clone()].copy_from_slice(&self.still[line.clone()]);
                self.blurred[line.clone()].copy_from_slice(&self.still_blurred[line]);
            }
        }
        for robot in robots {
            let tag = robot.tag.and_then(|tag| Tag::new(faults.seen_tag(tag.id())));
            let poses = robot.instants();
            if let Some(stroke) = Stroke::new(&self.optics, &self.slopes, tag, &robot.shape, &poses) {
                stroke.paint(&self.slopes, &self.light_dn, &mut self.sharp, width);
                self.changed
                    .push(stroke.region.grown(self.blur.radius(), width, height));
            }
        }
        for region in &self.changed {
            self.blur.apply(&self.sharp, &mut self.blurred, width, *region);
        }
    }

    /// What falls on the chip.
    pub fn signal_dn(&self) -> &[f32] {
        &self.blurred
    }

    fn size(&self) -> (usize, usize) {
        (usize::from(self.optics.width_px), usize::from(self.optics.height_px))
    }
}
