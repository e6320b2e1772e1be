//! Pictures of tags on the floor as a distorting, blurring, noisy camera would take them.
//!
//! Written from the published formulas, not with the code under test: lens, projection and tag pattern are its own.
#![allow(dead_code, unused_imports, reason = "each test uses its part")]

mod random;
mod scene;

pub use random::Random;
pub use scene::{CODES_PUBLISHED, Place, Plane, Shader, Style, Truth, camera_over_half, spread_out};

/// Sub-samples along a pixel's side.
const FINE: usize = 3;

/// Directions of all sub-samples of a camera, and a stock of noise.
pub struct Renderer {
    pub truth: Truth,
    directions: Vec<[f32; 2]>,
    plane: Option<Plane>,
    places: Vec<[f32; 2]>,
    noise: Vec<f32>,
    picture: Vec<f32>,
    pub pixels: Vec<u8>,
}

impl Renderer {
    pub fn new(truth: Truth) -> Renderer {
        let (width, height) = (truth.size[0], truth.size[1]);
        let mut directions = Vec::with_capacity(width * height * FINE * FINE);
        for v in 0..height {
            for u in 0..width {
                for sub in 0..FINE * FINE {
                    let offset = |index: usize| (index as f64 + 0.5) / FINE as f64 - 0.5;
                    let pixel = [u as f64 + offset(sub % FINE), v as f64 + offset(sub / FINE)];
                    directions.push(truth.direction(pixel).map(|value| value as f32));
                }
            }
        }
        let mut random = Random(7);
        let noise = (0..1 << 20).map(|_| random.normal() as f32).collect();
        Renderer {
            truth,
            directions,
            plane: None,
            places: Vec::new(),
            noise,
            picture: vec![0.0; width * height],
            pixels: vec![0; width * height],
        }
    }

    /// Places of all sub-samples in a plane; kept while the plane stays.
    fn look_at(&mut self, plane: &Plane) {
        if self.plane == Some(*plane) {
            return;
        }
        self.plane = Some(*plane);
        self.places.clear();
        let directions = self.directions.iter();
        self.places
            .extend(directions.map(|&[x, y]| plane.meet([f64::from(x), f64::from(y)]).map(|value| value as f32)));
    }

    /// Floor, then each tag with its robot's body, light, blur, noise.
    pub fn render(&mut self, plane: &Plane, places: &[Place], style: &Style, random: &mut Random) {
        self.look_at(plane);
        self.picture.fill(style.floor);
        for place in places {
            self.draw(plane, place, style);
        }
        self.finish(style, random);
    }

    fn draw(&mut self, plane: &Plane, place: &Place, style: &Style) {
        let [width, height] = self.truth.size;
        // Box around the body in the picture.
        let (mut low, mut high) = ([f64::MAX; 2], [f64::MIN; 2]);
        for step in 0..16 {
            let angle = f64::from(step) * std::f64::consts::TAU / 16.0;
            let reach = style.body_m.max(place.edge_m) * 1.1;
            let at = [place.x_m + reach * angle.cos(), place.y_m + reach * angle.sin()];
            let Some(pixel) = self.truth.pixel(plane.camera_from_plane([at[0], at[1], 0.0])) else {
                return;
            };
            for axis in 0..2 {
                low[axis] = low[axis].min(pixel[axis]);
                high[axis] = high[axis].max(pixel[axis]);
            }
        }
        let range = |axis: usize, size: usize| {
            let from = (low[axis] - 4.0).max(0.0) as usize;
            from.min(size)..((high[axis] + 5.0).max(0.0) as usize).min(size)
        };
        let (columns, rows) = (range(0, width), range(1, height));
        if columns.is_empty() || rows.is_empty() {
            return;
        }
        let across = columns.len();
        let mut patch = Vec::with_capacity(across * rows.len());
        // Each sub-sample is lit at its own moment of the exposure, in a mixed order.
        let moments: [Shader; FINE * FINE] = std::array::from_fn(|sub| {
            let moment = ((sub * 4 % (FINE * FINE)) as f64 + 0.5) / (FINE * FINE) as f64 - 0.5;
            place.shader(moment * style.exposure_s, style)
        });
        for v in rows.clone() {
            let first = (v * width + columns.start) * FINE * FINE;
            for pixel in self.places[first..first + across * FINE * FINE]
                .as_chunks::<{ FINE * FINE }>()
                .0
            {
                let sum: f32 = pixel.iter().zip(&moments).map(|(at, shader)| shader.shade(*at)).sum();
                patch.push(sum / (FINE * FINE) as f32);
            }
        }
        blur(&mut patch, across, style.blur_px);
        for (row, v) in rows.enumerate() {
            let line = &patch[row * across..(row + 1) * across];
            for (offset, &value) in line.iter().enumerate() {
                let middle = (v * width + columns.start + offset) * FINE * FINE + FINE * FINE / 2;
                if moments[FINE * FINE / 2].covers(self.places[middle]) {
                    self.picture[v * width + columns.start + offset] = value;
                }
            }
        }
    }

    fn finish(&mut self, style: &Style, random: &mut Random) {
        let [width, height] = self.truth.size;
        let mut at = random.below(1 << 20);
        for v in 0..height {
            if v % 16 == 0 {
                at = random.below((1 << 20) - 16 * width);
            }
            let y = (v as f32 / height as f32 - 0.5) * 2.0;
            let line = &self.picture[v * width..(v + 1) * width];
            let noise = &self.noise[at..at + width];
            at += width;
            let out = &mut self.pixels[v * width..(v + 1) * width];
            for (u, ((out, &value), &noise)) in out.iter_mut().zip(line).zip(noise).enumerate() {
                let x = (u as f32 / width as f32 - 0.5) * 2.0;
                let light = 1.0 - style.uneven * (0.25 * (x * x + y * y) + 0.25 * (1.0 - x));
                *out = (value * light + style.noise * noise + 0.5).clamp(0.0, 255.0) as u8;
            }
        }
    }
}

/// Gaussian, 7 taps, the patch's border repeated.
fn blur(patch: &mut [f32], across: usize, sigma: f32) {
    if sigma <= 0.0 || patch.is_empty() {
        return;
    }
    let raw: [f32; 7] = std::array::from_fn(|tap| (-(tap as f32 - 3.0).powi(2) / (2.0 * sigma * sigma)).exp());
    let weights = raw.map(|weight| weight / raw.iter().sum::<f32>());
    let mut padded = vec![0.0; across + 6];
    for line in patch.chunks_exact_mut(across) {
        padded[..3].fill(line[0]);
        padded[3..across + 3].copy_from_slice(line);
        padded[across + 3..].fill(line[across - 1]);
        for (out, window) in line.iter_mut().zip(padded.windows(7)) {
            *out = weights.iter().zip(window).map(|(weight, value)| weight * value).sum();
        }
    }
    let source = patch.to_vec();
    let down = patch.len() / across;
    for (row, line) in patch.chunks_exact_mut(across).enumerate() {
        line.fill(0.0);
        for (tap, weight) in weights.iter().enumerate() {
            let from = (row + tap).saturating_sub(3).min(down - 1) * across;
            for (out, value) in line.iter_mut().zip(&source[from..from + across]) {
                *out += weight * value;
            }
        }
    }
}
