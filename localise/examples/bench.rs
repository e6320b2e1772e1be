//! Milliseconds per frame on one core for full and tracked search: `cargo run --release -p localise --example bench`.

#[path = "../tests/support/mod.rs"]
mod support;

use std::time::Instant;

use localise::{CameraLocaliser, DetectorSettings, Expected, FloorSettings, Frame};
use support::{Random, Renderer, Style, camera_over_half, spread_out};

const FRAMES: u64 = 500;
/// Times the same frame is searched; the median counts, so that other processes on the machine do not.
const REPEATS: usize = 7;

fn main() {
    let mut renderer = Renderer::new(camera_over_half(false));
    let floor = renderer.truth.floor(0.1);
    let mut localiser = CameraLocaliser::new(
        renderer.truth.camera(),
        DetectorSettings::default(),
        FloorSettings::default(),
    );
    let mut random = Random(1);
    let (mut full_ms, mut tracked_ms) = (Vec::new(), Vec::new());
    let mut found = [0; 2];
    let mut cpu = [0u64; 2];
    for sequence in 0..FRAMES {
        let places = spread_out(&mut random, false, 0, 12);
        renderer.render(&floor, &places, &Style::default(), &mut random);
        let frame = Frame::new(640, 480, &renderer.pixels).expect("640 x 480");
        let expected: Vec<Expected> = places
            .iter()
            .map(|place| Expected {
                x_m: place.x_m + random.between(-0.015, 0.015),
                y_m: place.y_m + random.between(-0.015, 0.015),
                reach_m: 0.03,
            })
            .collect();
        for (index, (expected, out)) in [(None, &mut full_ms), (Some(&expected[..]), &mut tracked_ms)]
            .into_iter()
            .enumerate()
        {
            let mut times_ms = [0.0; REPEATS];
            let mut poses = 0;
            let begin = cpu_ns();
            for time_ms in &mut times_ms {
                let begin = Instant::now();
                let seen = localiser.locate(&frame, sequence, 0, expected).expect("640 x 480");
                *time_ms = begin.elapsed().as_secs_f64() * 1e3;
                poses = seen.poses.len();
            }
            cpu[index] += cpu_ns() - begin;
            times_ms.sort_by(f64::total_cmp);
            out.push(times_ms[REPEATS / 2]);
            found[index] += poses;
        }
    }
    for (name, times, found, cpu) in [
        ("full", &mut full_ms, found[0], cpu[0]),
        ("tracked", &mut tracked_ms, found[1], cpu[1]),
    ] {
        times.sort_by(f64::total_cmp);
        let at = |share: f64| times[(share * times.len() as f64) as usize];
        println!(
            "{name:8} p50 {:.3} ms  p95 {:.3} ms  max {:.3} ms per frame (CPU mean {:.3} ms), 12 tags, {found} of {} found",
            at(0.5),
            at(0.95),
            times[times.len() - 1],
            cpu as f64 * 1e-6 / (FRAMES as f64 * REPEATS as f64),
            FRAMES * 12,
        );
    }
}

/// CPU time of this thread; the kernel counts it in ticks of some milliseconds, so only sums mean anything.
fn cpu_ns() -> u64 {
    let stat = std::fs::read_to_string("/proc/thread-self/schedstat").expect("Linux");
    stat.split(' ')
        .next()
        .and_then(|field| field.parse().ok())
        .expect("nanoseconds come first")
}
