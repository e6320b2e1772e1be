//! How much light of each pixel's piece of the world reaches the sensor.

use super::faults::DirtSpot;
use super::optics::Optics;
use super::settings::CameraSettings;

/// Relative width of the soft rim of a spot of dirt.
const DIRT_RIM: f64 = 0.3;

/// Signal in DN above black of reflectance 1, for every pixel, row by row: vignetting and the uneven light of the hall.
pub fn light_dn(optics: &Optics, slopes: &[[f32; 2]], settings: &CameraSettings) -> Vec<f32> {
    let white_dn = settings.white_dn();
    let [cx, cy] = optics.centre_px;
    let (width, height) = (f64::from(optics.width_px), f64::from(optics.height_px));
    let farthest2 = cx.max(width - 1.0 - cx).powi(2) + cy.max(height - 1.0 - cy).powi(2);
    let [gx, gy] = settings.light_gradient_per_m;
    let mut light = Vec::with_capacity(slopes.len());
    for (index, slope) in slopes.iter().enumerate() {
        let (u, v) = (
            (index % optics.width_px as usize) as f64,
            (index / optics.width_px as usize) as f64,
        );
        let from_axis2 = ((u - cx).powi(2) + (v - cy).powi(2)) / farthest2;
        let [x_m, y_m] = [0, 1].map(|axis| optics.position_m[axis] + optics.position_m[2] * f64::from(slope[axis]));
        let hall = (1.0 + gx * x_m + gy * y_m).max(0.0);
        light.push((white_dn * hall * (1.0 - settings.vignetting * from_axis2)) as f32);
    }
    light
}

/// Darkens the light where dirt lies on the lens.
pub fn shade(light_dn: &mut [f32], width_px: u16, spot: &DirtSpot) {
    for (index, light) in light_dn.iter_mut().enumerate() {
        let (u, v) = (
            (index % usize::from(width_px)) as f64,
            (index / usize::from(width_px)) as f64,
        );
        let distance = ((u - spot.u_px).powi(2) + (v - spot.v_px).powi(2)).sqrt() / spot.radius_px;
        let cover = ((1.0 + DIRT_RIM - distance) / DIRT_RIM).clamp(0.0, 1.0);
        *light *= (1.0 - cover * (1.0 - spot.transmission)) as f32;
    }
}
