//! Cameras and robots for the camera tests.

#![allow(dead_code, reason = "every test file uses its own part")]

use emulator::camera::exposure::instants_us;
use emulator::camera::floor::FloorTexture;
use emulator::camera::misalignment::Misalignment;
use emulator::camera::tag::Tag;
use emulator::camera::{Calibration, Camera, CameraSettings, RobotInView, RobotShape};
use emulator::plant::Pose;
use std::path::{Path, PathBuf};

pub const CAMERAS: [&str; 2] = [
    include_str!("../../../examples/lab/cameras/cam-0.json"),
    include_str!("../../../examples/lab/cameras/cam-1.json"),
];

pub fn calibration(index: usize) -> Calibration {
    Calibration::parse(CAMERAS[index]).expect("an example calibration")
}

/// No noise, no blur, even light, a black floor, and a camera exactly as its file says.
pub fn plain() -> CameraSettings {
    CameraSettings {
        read_noise_dn: 0.0,
        shot_variance_dn: 0.0,
        defocus_px: 0.0,
        vignetting: 0.0,
        light_gradient_per_m: [0.0; 2],
        black_dn: 0.0,
        floor: FloorTexture {
            reflectance: 0.0,
            ..FloorTexture::default()
        },
        misalignment: Misalignment::NONE,
        ..CameraSettings::default()
    }
}

pub fn camera(index: u16, settings: CameraSettings) -> Camera {
    Camera::new(&calibration(usize::from(index)), index, settings).expect("a camera")
}

pub fn pose(x_m: f64, y_m: f64, yaw_rad: f64) -> Pose {
    Pose { x_m, y_m, yaw_rad }
}

/// A body without a tag.
pub fn dot(radius_m: f64, height_m: f64) -> RobotShape {
    RobotShape {
        tag_height_m: height_m,
        body_height_m: height_m,
        body_radius_m: radius_m,
        body_reflectance: 1.0,
    }
}

pub fn robot(id: u16, poses: &[Pose]) -> RobotInView<'_> {
    RobotInView {
        tag: Tag::new(id),
        shape: RobotShape::default(),
        poses,
    }
}

/// Poses within an exposure of a robot that drives forward and turns.
pub fn moving(middle: Pose, speed_m_per_s: f64, yaw_rate_rad_per_s: f64, exposure_us: u32, count: usize) -> Vec<Pose> {
    instants_us(exposure_us, count)
        .map(|offset_us| {
            let (along_m, turned_rad) = (speed_m_per_s * offset_us * 1e-6, yaw_rate_rad_per_s * offset_us * 1e-6);
            let (sin, cos) = (middle.yaw_rad + 0.5 * turned_rad).sin_cos();
            pose(
                middle.x_m + along_m * cos,
                middle.y_m + along_m * sin,
                middle.yaw_rad + turned_rad,
            )
        })
        .collect()
}

/// Twelve robots spread over the half of the arena that camera 0 sees, driving at 0.6 m/s and turning.
pub fn twelve(exposure_us: u32) -> Vec<Vec<Pose>> {
    (0..12u32)
        .map(|number| {
            let (column, row) = (f64::from(number % 3), f64::from(number / 3));
            let middle = pose(-1.6 + 0.6 * column, -1.2 + 0.8 * row, f64::from(number) * 0.7 - 3.0);
            moving(middle, 0.6, 1.0, exposure_us, 4)
        })
        .collect()
}

/// First, second and central second moments of the brightness: sum, `[u, v]`, `[uu, uv, vv]`.
pub fn moments(pixels: &[u8], width: usize) -> (f64, [f64; 2], [f64; 3]) {
    let at = |index: usize| [(index % width) as f64, (index / width) as f64];
    let (mut sum, mut first) = (0.0, [0.0; 2]);
    for (index, value) in pixels.iter().enumerate() {
        let (weight, [u, v]) = (f64::from(*value), at(index));
        sum += weight;
        first = [first[0] + weight * u, first[1] + weight * v];
    }
    let mean = first.map(|moment| moment / sum);
    let mut second = [0.0; 3];
    for (index, value) in pixels.iter().enumerate().filter(|(_, value)| **value > 0) {
        let (weight, [u, v]) = (f64::from(*value) / sum, at(index));
        let (du, dv) = (u - mean[0], v - mean[1]);
        second = [
            second[0] + weight * du * du,
            second[1] + weight * du * dv,
            second[2] + weight * dv * dv,
        ];
    }
    (sum, mean, second)
}

/// Folder for pictures below the target folder.
pub fn pictures() -> PathBuf {
    let target = Path::new(env!("CARGO_TARGET_TMPDIR"))
        .parent()
        .expect("a target folder");
    let folder = target.join("pictures");
    std::fs::create_dir_all(&folder).expect("a folder");
    folder
}

/// Grey PNG without compression.
pub fn png(width: u32, height: u32, pixels: &[u8]) -> Vec<u8> {
    let mut lines = Vec::new();
    for line in pixels.chunks(width as usize) {
        lines.push(0);
        lines.extend_from_slice(line);
    }
    let (mut one, mut other) = (1u32, 0u32);
    for byte in &lines {
        one = (one + u32::from(*byte)) % 65_521;
        other = (other + one) % 65_521;
    }
    let mut stream = vec![0x78, 0x01];
    let blocks = lines.chunks(0xFFFF).count();
    for (index, block) in lines.chunks(0xFFFF).enumerate() {
        stream.push(u8::from(index + 1 == blocks));
        stream.extend_from_slice(&(block.len() as u16).to_le_bytes());
        stream.extend_from_slice(&(!(block.len() as u16)).to_le_bytes());
        stream.extend_from_slice(block);
    }
    stream.extend_from_slice(&(other << 16 | one).to_be_bytes());
    let mut header = Vec::new();
    header.extend_from_slice(&width.to_be_bytes());
    header.extend_from_slice(&height.to_be_bytes());
    header.extend_from_slice(&[8, 0, 0, 0, 0]);
    let mut file = b"\x89PNG\r\n\x1a\n".to_vec();
    for (name, body) in [(b"IHDR", &header), (b"IDAT", &stream), (b"IEND", &Vec::new())] {
        file.extend_from_slice(&(body.len() as u32).to_be_bytes());
        let chunk: Vec<u8> = name.iter().chain(body).copied().collect();
        file.extend_from_slice(&chunk);
        file.extend_from_slice(&crc32fast::hash(&chunk).to_be_bytes());
    }
    file
}
