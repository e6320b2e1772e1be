//! Milliseconds of CPU per frame for full and tracked search: `cargo run --release -p localise --example bench`.

#[path = "../tests/support/mod.rs"]
mod support;

use localise::{CameraLocaliser, DetectorSettings, Expected, FloorSettings, Frame};
use support::{Random, Renderer, Style, camera_over_half, spread_out};

const FRAMES: u64 = 1000;

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
            let begin = cpu_ns();
            let seen = localiser.locate(&frame, sequence, 0, expected).expect("640 x 480");
            out.push((cpu_ns() - begin) as f64 * 1e-6);
            found[index] += seen.poses.len();
        }
    }
    for (name, times, found) in [("full", &mut full_ms, found[0]), ("tracked", &mut tracked_ms, found[1])] {
        times.sort_by(f64::total_cmp);
        let at = |share: f64| times[(share * times.len() as f64) as usize];
        println!(
            "{name:8} p50 {:.3} ms  p95 {:.3} ms  max {:.3} ms CPU per frame, 12 tags, {found} of {} found",
            at(0.5),
            at(0.95),
            times[times.len() - 1],
            FRAMES * 12,
        );
    }
}

/// CPU time of this thread: other processes on the machine do not count.
fn cpu_ns() -> u64 {
    let stat = std::fs::read_to_string("/proc/thread-self/schedstat").expect("Linux");
    stat.split(' ')
        .next()
        .and_then(|field| field.parse().ok())
        .expect("nanoseconds come first")
}
