//! Localisation on rendered video: the emulator's cameras, the laboratory's camera process, and the truth beside them.

use anyhow::{Context, Result};
use emulator::camera::exposure::instants_us;
use emulator::camera::tag::Tag;
use emulator::camera::{Calibration, Camera, CameraSettings, RobotInView, RobotShape};
use emulator::noise::Noise;
use emulator::plant::Pose;
use lab::camera::eye::Eye;
use lab::camera::frame_stream::FrameHeader;
use localise::Observation;
use std::time::Instant;

/// Robots in the picture.
pub const ROBOTS: usize = 12;
/// Frames per second of the video.
const HZ: f64 = 120.0;
/// Poses within one exposure.
const INSTANTS: usize = 4;
/// A sighting further from its robot than this is one of somebody else.
const IDENTITY_M: f64 = 0.1;
/// Calls of which the fastest counts: other processes of the machine are not the question.
const REPEATS: usize = 3;

/// What came of it.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Sight {
    pub frames: u64,
    /// Tags that were wholly in the picture, and that were found.
    pub tags: u64,
    pub found: u64,
    /// Sightings of a robot where it is not.
    pub false_identities: u64,
    /// Root mean square of the distance and of the yaw error.
    pub position_rms_m: f64,
    pub yaw_rms_rad: f64,
    pub position_worst_m: f64,
    /// Time to find the tags, sorted; the fastest of three calls for every timed frame.
    pub locate_ms: Vec<f64>,
}

impl Sight {
    /// The smallest time that `share` of the frames do not exceed.
    pub fn quantile_ms(&self, share: f64) -> f64 {
        let rank = (share * self.locate_ms.len() as f64).ceil() as usize;
        self.locate_ms.get(rank.saturating_sub(1)).copied().unwrap_or(f64::NAN)
    }
}

/// One robot's way: around the middle of a cell of its own, at up to 0.8 m/s and 2 rad/s.
#[derive(Debug, Clone, Copy)]
struct Way {
    middle_m: [f64; 2],
    reach_m: f64,
    rate_rad_per_s: [f64; 2],
    phase_rad: [f64; 2],
    yaw_rad: f64,
    yaw_rate_rad_per_s: f64,
}

impl Way {
    fn at(&self, time_s: f64) -> Pose {
        let [u, v] = self.rate_rad_per_s;
        let [a, b] = self.phase_rad;
        Pose {
            x_m: self.middle_m[0] + self.reach_m * (u * time_s + a).sin(),
            y_m: self.middle_m[1] + self.reach_m * (v * time_s + b).cos(),
            yaw_rad: self.yaw_rad + self.yaw_rate_rad_per_s * time_s,
        }
    }
}

/// Three columns of four cells over the half of the arena that the first reference camera sees.
fn ways(random: &mut Noise) -> Vec<Way> {
    let mut between = |least: f64, most: f64| least + (most - least) * random.uniform();
    (0..ROBOTS)
        .map(|place| Way {
            middle_m: [-1.6 + 0.6 * (place % 3) as f64, -1.05 + 0.7 * (place / 3) as f64],
            reach_m: 0.11,
            rate_rad_per_s: [between(2.0, 5.0), between(2.0, 5.0)],
            phase_rad: [between(0.0, std::f64::consts::TAU), between(0.0, std::f64::consts::TAU)],
            yaw_rad: between(-3.1, 3.1),
            yaw_rate_rad_per_s: between(-2.0, 2.0),
        })
        .collect()
}

/// Renders and finds.
///
/// - `timed`: every how many frames the search is timed.
/// - `watch`: called now and then with the number of frames done.
pub fn run(frames: u64, timed: u64, settings: CameraSettings, watch: &mut dyn FnMut(u64)) -> Result<Sight> {
    let text = include_str!("../../examples/lab/cameras/cam-0.json");
    let calibration: Calibration = serde_json::from_str(text).context("the reference camera")?;
    let mut camera = Camera::new(&calibration, 0, settings.clone())?;
    let known = localise::CameraDocument::from_json(text)?.check()?;
    let mut eye = Eye::new(known.clone(), RobotShape::default().tag_height_m, 256)?;
    // Sees every timed frame as a whole, on its own.
    let mut stopwatch = Eye::new(known, RobotShape::default().tag_height_m, 256)?;
    let mut random = Noise::new(settings.seed, 0x0516_4700);
    let ways = ways(&mut random);
    let mut out = Sight::default();
    let (mut square_m2, mut square_rad2) = (0.0, 0.0);
    for frame in 0..frames {
        let time_s = frame as f64 / HZ;
        let poses: Vec<[Pose; INSTANTS]> = ways
            .iter()
            .map(|way| {
                let mut poses = [Pose::default(); INSTANTS];
                for (pose, offset_us) in poses.iter_mut().zip(instants_us(settings.exposure_us, INSTANTS)) {
                    *pose = way.at(time_s + offset_us * 1e-6);
                }
                poses
            })
            .collect();
        let views: Vec<RobotInView<'_>> = poses
            .iter()
            .enumerate()
            .map(|(place, poses)| RobotInView {
                tag: Tag::new(place as u16 + 1),
                shape: RobotShape::default(),
                poses,
            })
            .collect();
        let picture = camera
            .expose((time_s * 1e6) as i64, &views)
            .context("the camera drops frames")?;
        let header = FrameHeader {
            camera: picture.header.camera,
            sequence: picture.header.sequence,
            mid_exposure_us: picture.header.mid_exposure_us,
            exposure_us: picture.header.exposure_us,
            width_px: picture.header.width_px,
            height_px: picture.header.height_px,
        };
        let seen = eye.look(&header, picture.pixels)?;
        if frame % timed == 0 {
            out.locate_ms.push(fastest_ms(&mut stopwatch, &header, picture.pixels)?);
        }
        out.frames += 1;
        out.tags += ROBOTS as u64;
        judge(&mut out, &seen, &ways, time_s, &mut square_m2, &mut square_rad2);
        if frame % 1000 == 999 {
            watch(frame + 1);
        }
    }
    out.position_rms_m = (square_m2 / out.found.max(1) as f64).sqrt();
    out.yaw_rms_rad = (square_rad2 / out.found.max(1) as f64).sqrt();
    out.locate_ms.sort_by(f64::total_cmp);
    Ok(out)
}

fn judge(out: &mut Sight, seen: &Observation, ways: &[Way], time_s: f64, square_m2: &mut f64, square_rad2: &mut f64) {
    for pose in &seen.poses {
        let way = usize::from(pose.robot).checked_sub(1).and_then(|place| ways.get(place));
        let truth = way.map(|way| way.at(time_s));
        let off_m = truth.map_or(f64::INFINITY, |truth| {
            (truth.x_m - pose.x_m).hypot(truth.y_m - pose.y_m)
        });
        let Some(truth) = truth.filter(|_| off_m < IDENTITY_M) else {
            out.false_identities += 1;
            continue;
        };
        out.found += 1;
        out.position_worst_m = out.position_worst_m.max(off_m);
        *square_m2 += off_m * off_m;
        *square_rad2 += localise::wrap_rad(truth.yaw_rad - pose.yaw_rad).powi(2);
    }
}

fn fastest_ms(eye: &mut Eye, header: &FrameHeader, pixels: &[u8]) -> Result<f64> {
    let mut fastest = f64::INFINITY;
    for _ in 0..REPEATS {
        let begin = Instant::now();
        eye.look(header, pixels)?;
        fastest = fastest.min(begin.elapsed().as_secs_f64() * 1e3);
    }
    Ok(fastest)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rendered_robots_are_found_where_they_are() {
        let sight = run(600, 20, CameraSettings::default(), &mut |_| {}).expect("a video");
        println!(
            "{} of {} tags, {:.2} mm, {:.3} deg, p95 {:.2} ms",
            sight.found,
            sight.tags,
            sight.position_rms_m * 1e3,
            sight.yaw_rms_rad.to_degrees(),
            sight.quantile_ms(0.95)
        );
        assert_eq!(sight.false_identities, 0);
        assert!(sight.found as f64 >= 0.995 * sight.tags as f64);
        assert!(sight.position_rms_m <= 0.002 && sight.yaw_rms_rad.to_degrees() <= 0.5);
    }
}
