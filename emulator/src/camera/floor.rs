//! Texture of the floor: low contrast, from a seed.

use serde::{Deserialize, Serialize};

/// Octaves of the texture; each is half as large and half as strong as the one before.
const OCTAVES: u32 = 3;

/// Smooth random spots around a mean reflectance.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct FloorTexture {
    pub seed: u64,
    /// Mean reflectance, 0 to 1.
    pub reflectance: f64,
    /// Largest deviation from it, relative.
    pub contrast: f64,
    /// Size of the largest spots.
    pub grain_m: f64,
}

impl Default for FloorTexture {
    fn default() -> Self {
        Self {
            seed: 1,
            reflectance: 0.42,
            contrast: 0.1,
            grain_m: 0.12,
        }
    }
}

impl FloorTexture {
    /// Reflectance of the floor at `[x, y]` in metres.
    pub fn reflectance_at(&self, [x_m, y_m]: [f64; 2]) -> f64 {
        let (mut sum, mut weights) = (0.0, 0.0);
        for octave in 0..OCTAVES {
            let scale = f64::from(1u32 << octave);
            sum += self.spots(x_m / self.grain_m * scale, y_m / self.grain_m * scale, octave) / scale;
            weights += 1.0 / scale;
        }
        self.reflectance * (1.0 + self.contrast * sum / weights)
    }

    /// Values -1 to 1 at whole numbers, smooth between them.
    fn spots(&self, x: f64, y: f64, octave: u32) -> f64 {
        let smooth = |t: f64| t * t * (3.0 - 2.0 * t);
        let (column, row) = (x.floor(), y.floor());
        let (tx, ty) = (smooth(x - column), smooth(y - row));
        let at = |dx: i64, dy: i64| self.lattice(column as i64 + dx, row as i64 + dy, octave);
        let top = at(0, 0) * (1.0 - tx) + at(1, 0) * tx;
        let bottom = at(0, 1) * (1.0 - tx) + at(1, 1) * tx;
        top * (1.0 - ty) + bottom * ty
    }

    /// Uniform from -1 to 1 (the mixing function of splitmix64).
    fn lattice(&self, column: i64, row: i64, octave: u32) -> f64 {
        let mut bits = self.seed.wrapping_mul(0x9E37_79B9_7F4A_7C15);
        for part in [column as u64, row as u64, u64::from(octave)] {
            bits = (bits ^ part).wrapping_add(0x9E37_79B9_7F4A_7C15);
            bits = (bits ^ (bits >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
            bits = (bits ^ (bits >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
            bits ^= bits >> 31;
        }
        (bits >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_texture_keeps_its_mean_and_contrast_and_follows_its_seed() {
        let floor = FloorTexture::default();
        let points: Vec<[f64; 2]> = (0..10_000)
            .map(|i| [f64::from(i % 100) * 0.04 - 2.0, f64::from(i / 100) * 0.03 - 1.5])
            .collect();
        let values: Vec<f64> = points.iter().map(|point| floor.reflectance_at(*point)).collect();
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        assert!((mean - floor.reflectance).abs() < 0.01 * floor.reflectance, "{mean}");
        let limit = floor.reflectance * floor.contrast + 1e-12;
        assert!(values.iter().all(|value| (value - floor.reflectance).abs() <= limit));
        assert!(
            values
                .iter()
                .any(|value| (value - floor.reflectance).abs() > 0.5 * limit)
        );
        let other = FloorTexture { seed: 2, ..floor };
        assert!(
            points
                .iter()
                .zip(&values)
                .any(|(point, value)| other.reflectance_at(*point) != *value)
        );
    }
}
