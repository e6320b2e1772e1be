//! A grey picture.

use crate::problem::Problem;

/// A borrowed grey frame, row by row from the top left; pixel (0, 0) is the centre of the top left pixel.
#[derive(Debug, Clone, Copy)]
pub struct Frame<'a> {
    width_px: usize,
    height_px: usize,
    pixels: &'a [u8],
}

/// Side limits of a frame.
pub(crate) const SIDE_PX: [f64; 2] = [16.0, 4096.0];

impl<'a> Frame<'a> {
    /// - Errors: sides outside 16 to 4096, or a number of pixels that is not width times height.
    pub fn new(width_px: usize, height_px: usize, pixels: &'a [u8]) -> Result<Frame<'a>, Problem> {
        let remedy = "send frames of the size of the camera's calibration";
        Problem::in_range("width_px", width_px as f64, SIDE_PX, "px", remedy)?;
        Problem::in_range("height_px", height_px as f64, SIDE_PX, "px", remedy)?;
        if pixels.len() != width_px * height_px {
            return Err(Problem::new(
                "pixels",
                format!("{} bytes", pixels.len()),
                format!("{width_px} x {height_px} = {} bytes", width_px * height_px),
                remedy,
            ));
        }
        Ok(Frame {
            width_px,
            height_px,
            pixels,
        })
    }

    pub fn width_px(&self) -> usize {
        self.width_px
    }

    pub fn height_px(&self) -> usize {
        self.height_px
    }

    /// Pixels `[from, from + length)` of a row.
    pub(crate) fn row(&self, row: usize, from: usize, length: usize) -> &'a [u8] {
        let start = row * self.width_px + from;
        &self.pixels[start..start + length]
    }

    /// Grey value between pixels, bilinear; positions outside take the nearest pixel.
    pub(crate) fn sample(&self, at: [f64; 2]) -> f32 {
        let u = at[0].clamp(0.0, (self.width_px - 1) as f64 - 1e-6);
        let v = at[1].clamp(0.0, (self.height_px - 1) as f64 - 1e-6);
        let (column, row) = (u as usize, v as usize);
        let (fu, fv) = ((u - column as f64) as f32, (v - row as f64) as f32);
        let start = row * self.width_px + column;
        let (top, bottom) = (
            &self.pixels[start..start + 2],
            &self.pixels[start + self.width_px..][..2],
        );
        let upper = f32::from(top[0]) + fu * (f32::from(top[1]) - f32::from(top[0]));
        let lower = f32::from(bottom[0]) + fu * (f32::from(bottom[1]) - f32::from(bottom[0]));
        upper + fv * (lower - upper)
    }

    /// Number that tells frames apart: the same for the same bytes, else different but for one in 2^64.
    pub fn digest(&self) -> u64 {
        let mut lanes = [
            0x9e37_79b9_7f4a_7c15u64,
            0xbf58_476d_1ce4_e5b9,
            0x94d0_49bb_1331_11eb,
            1,
        ];
        let mut mix = |lane: usize, word: u64| {
            lanes[lane] = (lanes[lane] ^ word).wrapping_mul(0xff51_afd7_ed55_8ccd).rotate_left(29);
        };
        let (words, rest) = self.pixels.as_chunks::<8>();
        for (index, word) in words.iter().enumerate() {
            mix(index % 4, u64::from_le_bytes(*word));
        }
        for &byte in rest {
            mix(0, u64::from(byte));
        }
        lanes.iter().fold(self.width_px as u64, |digest, lane| {
            let mixed = (digest ^ lane).wrapping_mul(0xc4ce_b9fe_1a85_ec53);
            mixed ^ (mixed >> 33)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_of_the_wrong_size_are_refused() {
        let pixels = [0u8; 16 * 16];
        assert!(Frame::new(16, 16, &pixels).is_ok());
        assert_eq!(Frame::new(16, 17, &pixels).expect_err("a byte too few").field, "pixels");
        assert_eq!(Frame::new(0, 16, &[]).expect_err("no width").field, "width_px");
    }

    #[test]
    fn samples_between_pixels_are_linear_and_a_changed_pixel_changes_the_digest() {
        let mut pixels: Vec<u8> = (0..16 * 16).map(|index| (index % 16 * 10 + index / 16) as u8).collect();
        let frame = Frame::new(16, 16, &pixels).expect("size fits");
        assert!((frame.sample([3.25, 7.5]) - (32.5 + 7.5)).abs() < 1e-4);
        assert!((frame.sample([-5.0, 99.0]) - 15.0).abs() < 1e-3);
        let before = frame.digest();
        pixels[255] ^= 1;
        assert_ne!(Frame::new(16, 16, &pixels).expect("size fits").digest(), before);
    }
}
