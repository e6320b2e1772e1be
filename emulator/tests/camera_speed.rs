//! What a frame costs. Measured on request: `cargo test --release -p emulator --test camera_speed -- --ignored --nocapture`.

mod rig;

use emulator::camera::frame::encode;
use emulator::camera::{CameraSettings, RobotInView};
use rig::{camera, robot};
use std::time::Instant;

const FRAMES: usize = 300;

#[test]
#[ignore = "measures, does not judge"]
fn milliseconds_per_frame_at_twelve_tags() {
    let begin = Instant::now();
    let mut camera = camera(0, CameraSettings::default());
    println!("tables of one camera: {:.0} ms", begin.elapsed().as_secs_f64() * 1e3);
    let scene = rig::twelve(3000);
    let views: Vec<RobotInView<'_>> = scene
        .iter()
        .enumerate()
        .map(|(id, poses)| robot(id as u16, poses))
        .collect();
    for (what, count) in [("no robot", 0), ("6 robots", 6), ("12 robots", 12)] {
        let mut times_ms: Vec<f64> = (0..FRAMES)
            .map(|frame| {
                let begin = Instant::now();
                let picture = camera.expose(frame as i64, &views[..count]).expect("a picture");
                assert_eq!(picture.pixels.len(), 307_200);
                begin.elapsed().as_secs_f64() * 1e3
            })
            .collect();
        times_ms.sort_by(f64::total_cmp);
        println!(
            "{what}: median {:.2} ms, p95 {:.2} ms",
            times_ms[FRAMES / 2],
            times_ms[FRAMES * 95 / 100]
        );
    }
    let picture = camera.expose(0, &views).expect("a picture");
    let mut bytes = Vec::new();
    let begin = Instant::now();
    for _ in 0..FRAMES {
        encode(&picture.header, picture.pixels, &mut bytes).expect("a frame");
    }
    println!(
        "encoding with CRC: {:.3} ms",
        begin.elapsed().as_secs_f64() * 1e3 / FRAMES as f64
    );
}
