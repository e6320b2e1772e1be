//! Blur of an imperfect focus: a small separable kernel.

/// Widest kernel on one side.
pub const MAX_RADIUS: usize = 3;

/// A rectangle of pixels, ends excluded.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Region {
    pub left: usize,
    pub top: usize,
    pub right: usize,
    pub bottom: usize,
}

impl Region {
    /// This region with a rim of `rim` pixels, within a picture.
    pub fn grown(self, rim: usize, width: usize, height: usize) -> Self {
        Self {
            left: self.left.saturating_sub(rim),
            top: self.top.saturating_sub(rim),
            right: (self.right + rim).min(width),
            bottom: (self.bottom + rim).min(height),
        }
    }
}

/// A normalised Gaussian, integrated over pixels by sampling it at nine points each.
#[derive(Debug, Clone)]
pub struct Blur {
    /// One side: `taps[0]` is the middle. One entry: no blur.
    taps: Vec<f32>,
    scratch: Vec<f32>,
}

impl Blur {
    pub fn new(deviation_px: f64) -> Self {
        let radius = if deviation_px < 0.05 {
            0
        } else {
            ((2.5 * deviation_px).ceil() as usize).min(MAX_RADIUS)
        };
        let weight = |tap: usize| -> f64 {
            (-4..=4)
                .map(|part| (tap as f64 + f64::from(part) / 9.0) / deviation_px.max(0.05))
                .map(|z| (-0.5 * z * z).exp())
                .sum()
        };
        let sum = weight(0) + 2.0 * (1..=radius).map(weight).sum::<f64>();
        Self {
            taps: if radius == 0 {
                vec![1.0]
            } else {
                (0..=radius).map(|tap| (weight(tap) / sum) as f32).collect()
            },
            scratch: Vec::new(),
        }
    }

    pub fn radius(&self) -> usize {
        self.taps.len() - 1
    }

    /// Variance of the kernel along one axis, px^2.
    #[cfg(test)]
    pub fn variance_px2(&self) -> f64 {
        let one_side: f64 = self
            .taps
            .iter()
            .enumerate()
            .map(|(tap, weight)| (tap * tap) as f64 * f64::from(*weight))
            .sum();
        2.0 * one_side
    }

    /// Blurs one region of `sharp` into `blurred`; both are whole pictures of `width` pixels a row. At the picture's rim the
    /// outermost pixel goes on.
    pub fn apply(&mut self, sharp: &[f32], blurred: &mut [f32], width: usize, region: Region) {
        let height = sharp.len() / width;
        let (radius, columns) = (self.radius(), region.right.saturating_sub(region.left));
        if columns == 0 || region.bottom <= region.top {
            return;
        }
        let (top, bottom) = (region.top.saturating_sub(radius), (region.bottom + radius).min(height));
        self.scratch.resize(columns * (bottom - top), 0.0);
        for (row, out) in (top..bottom).zip(self.scratch.chunks_exact_mut(columns)) {
            along_row(&sharp[row * width..(row + 1) * width], region.left, &self.taps, out);
        }
        for row in region.top..region.bottom {
            let out = &mut blurred[row * width + region.left..row * width + region.right];
            let line = |at: usize| &self.scratch[(at - top) * columns..(at - top + 1) * columns];
            for (value, middle) in out.iter_mut().zip(line(row)) {
                *value = self.taps[0] * middle;
            }
            for (tap, weight) in self.taps.iter().enumerate().skip(1) {
                let (above, below) = (line(row.saturating_sub(tap)), line((row + tap).min(height - 1)));
                for ((value, one), other) in out.iter_mut().zip(above).zip(below) {
                    *value += weight * (one + other);
                }
            }
        }
    }
}

/// The kernel along one row, for `out.len()` pixels from `left` on.
fn along_row(row: &[f32], left: usize, taps: &[f32], out: &mut [f32]) {
    let (radius, last) = (taps.len() - 1, row.len() - 1);
    if left >= radius && left + out.len() + radius <= row.len() {
        for (value, middle) in out.iter_mut().zip(&row[left..]) {
            *value = taps[0] * middle;
        }
        for (tap, weight) in taps.iter().enumerate().skip(1) {
            for ((value, one), other) in out.iter_mut().zip(&row[left - tap..]).zip(&row[left + tap..]) {
                *value += weight * (one + other);
            }
        }
        return;
    }
    for (index, value) in out.iter_mut().enumerate() {
        let at = left + index;
        *value = taps[0] * row[at];
        for (tap, weight) in taps.iter().enumerate().skip(1) {
            *value += weight * (row[at.saturating_sub(tap)] + row[(at + tap).min(last)]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const WIDTH: usize = 20;
    const ALL: Region = Region {
        left: 0,
        top: 0,
        right: WIDTH,
        bottom: 15,
    };

    fn blurred(sharp: &[f32], deviation_px: f64) -> Vec<f32> {
        let mut out = vec![0.0; sharp.len()];
        Blur::new(deviation_px).apply(sharp, &mut out, WIDTH, ALL);
        out
    }

    #[test]
    fn a_point_spreads_by_the_deviation_and_keeps_its_sum() {
        let mut sharp = vec![0.0f32; WIDTH * 15];
        sharp[7 * WIDTH + 9] = 100.0;
        for deviation_px in [0.5, 0.8, 1.1] {
            let out = blurred(&sharp, deviation_px);
            let moment = |power: i32| -> f64 {
                out.iter()
                    .enumerate()
                    .map(|(i, v)| ((i % WIDTH) as f64 - 9.0).powi(power) * f64::from(*v))
                    .sum()
            };
            assert!((moment(0) - 100.0).abs() < 1e-3 && moment(1).abs() < 1e-3);
            let variance = moment(2) / moment(0);
            assert!((variance - Blur::new(deviation_px).variance_px2()).abs() < 1e-4);
            // the pixel's own width adds 1/12; whole pixels and the cut-off take up to a twentieth
            let expected = deviation_px * deviation_px + 1.0 / 12.0;
            assert!(
                (variance / expected - 1.0).abs() < 0.12,
                "{deviation_px}: {variance} {expected}"
            );
        }
    }

    #[test]
    fn an_even_picture_stays_even_up_to_the_rim_and_no_blur_changes_nothing() {
        assert!(
            blurred(&[7.0; WIDTH * 15], 1.0)
                .iter()
                .all(|value| (value - 7.0).abs() < 1e-5)
        );
        let picture: Vec<f32> = (0..WIDTH * 15).map(|i| (i * 37 % 101) as f32).collect();
        assert_eq!(blurred(&picture, 0.0), picture);
    }

    #[test]
    fn a_region_gets_what_the_whole_picture_would_give_it() {
        let picture: Vec<f32> = (0..WIDTH * 15).map(|i| (i * 37 % 101) as f32).collect();
        let whole = blurred(&picture, 0.7);
        for region in [
            Region {
                left: 5,
                top: 4,
                right: 11,
                bottom: 9,
            },
            Region {
                left: 0,
                top: 0,
                right: 4,
                bottom: 3,
            },
            Region {
                left: 15,
                top: 10,
                right: 20,
                bottom: 15,
            },
        ] {
            let mut part = vec![-1.0; picture.len()];
            Blur::new(0.7).apply(&picture, &mut part, WIDTH, region);
            for (index, value) in part.iter().enumerate() {
                let (u, v) = (index % WIDTH, index / WIDTH);
                let inside = u >= region.left && u < region.right && v >= region.top && v < region.bottom;
                assert!(if inside {
                    (*value - whole[index]).abs() < 1e-4
                } else {
                    *value == -1.0
                });
            }
        }
    }
}
