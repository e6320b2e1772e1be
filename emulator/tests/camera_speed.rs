//! What a frame costs in CPU time of its thread. Measured on request: `cargo test --release -p emulator --test camera_speed -- --ignored --nocapture`.

mod rig;

use emulator::camera::frame::encode;
use emulator::camera::{CameraSettings, RobotInView};
use rig::{camera, robot};

const FRAMES: usize = 300;

/// CPU time of this thread so far; the kernel counts it in steps of some milliseconds.
fn cpu_ms() -> f64 {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").expect("the kernel's count");
    text.split_whitespace()
        .next()
        .and_then(|ns| ns.parse::<f64>().ok())
        .expect("nanoseconds")
        * 1e-6
}

#[test]
#[ignore = "measures, does not judge"]
fn milliseconds_per_frame_at_twelve_tags() {
    let begin = cpu_ms();
    let mut camera = camera(0, CameraSettings::default());
    println!("tables of one camera: {:.0} ms", cpu_ms() - begin);
    let scene = rig::twelve(3000);
    let views: Vec<RobotInView<'_>> = scene
        .iter()
        .enumerate()
        .map(|(id, poses)| robot(id as u16, poses))
        .collect();
    for (what, count) in [("no robot", 0), ("6 robots", 6), ("12 robots", 12)] {
        let begin = cpu_ms();
        for frame in 0..FRAMES {
            let picture = camera.expose(frame as i64, &views[..count]).expect("a picture");
            assert_eq!(picture.pixels.len(), 307_200);
        }
        println!("{what}: {:.2} ms a frame", (cpu_ms() - begin) / FRAMES as f64);
    }
    let picture = camera.expose(0, &views).expect("a picture");
    let mut bytes = Vec::new();
    let begin = cpu_ms();
    for _ in 0..FRAMES {
        encode(&picture.header, picture.pixels, &mut bytes).expect("a frame");
    }
    println!("encoding with CRC: {:.3} ms", (cpu_ms() - begin) / FRAMES as f64);
}
