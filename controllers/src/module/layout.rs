//! Views and commands as 64-bit floating words, little-endian. The table for authors is in `docs/controllers.md`.

use crate::answer::{Motion, Order, Say, WHEELS};
use crate::maths::{NOT_A_NUMBER, canonical};
use crate::ranges::BEAMS;
use crate::view::{Chassis, Setup, View};

/// Version of this layout, first word of every view.
const VERSION: f64 = 1.0;
const HEADER_WORDS: usize = 16;
/// Words of one robot in a view.
const ROBOT_WORDS: usize = 24;
const TARGET_WORDS: usize = 3;
/// Words of one robot in a module's answer.
pub(super) const ORDER_WORDS: usize = 16;

/// Words of every view of a run.
pub(super) fn view_words(setup: &Setup) -> usize {
    let targets: usize = setup.robots.iter().map(|robot| robot.targets.len()).sum();
    HEADER_WORDS + setup.parameters.len() + setup.robots.len() * ROBOT_WORDS + targets * TARGET_WORDS
}

/// Writes a view; its length is always that of [`view_words`].
pub(super) fn write(view: &View, setup: &Setup, bytes: &mut Vec<u8>) {
    bytes.clear();
    let robots_at = HEADER_WORDS + setup.parameters.len();
    let targets_at = robots_at + setup.robots.len() * ROBOT_WORDS;
    let header = [
        VERSION,
        view.tick as f64,
        view.time_s,
        setup.robots.len() as f64,
        setup.arena_m[0],
        setup.arena_m[1],
        setup.parameters.len() as f64,
        BEAMS as f64,
        robots_at as f64,
        ROBOT_WORDS as f64,
        targets_at as f64,
        f64::from(setup.rate_hz),
    ];
    put(bytes, &header, HEADER_WORDS);
    for (_, value) in &setup.parameters {
        put(bytes, &[*value], 1);
    }
    let mut target = 0;
    for (place, member) in setup.robots.iter().enumerate() {
        let seen = view.robots.get(place);
        let part = |value: fn(&crate::view::Seen) -> f64| seen.map_or(NOT_A_NUMBER, value);
        let drive = match member.drive {
            Chassis::Holonomic => 0.0,
            Chassis::TurnInPlace => 1.0,
            Chassis::Steered => 2.0,
        };
        let mut words = [0.0; ROBOT_WORDS];
        words[..13].copy_from_slice(&[
            part(|seen| seen.x_m),
            part(|seen| seen.y_m),
            part(|seen| seen.yaw_rad),
            part(|seen| seen.age_s),
            part(|seen| seen.forward_m_per_s),
            part(|seen| seen.left_m_per_s),
            part(|seen| seen.yaw_rate_rad_per_s),
            part(|seen| f64::from(u8::from(seen.online))),
            drive,
            member.radius_m,
            member.turning_radius_m,
            member.targets.len() as f64,
            target as f64,
        ]);
        if let Some(seen) = seen {
            words[16..].copy_from_slice(&seen.ranges_m);
        }
        target += member.targets.len();
        put(bytes, &words, ROBOT_WORDS);
    }
    for place in setup.robots.iter().flat_map(|robot| &robot.targets) {
        put(
            bytes,
            &[place.x_m, place.y_m, place.yaw_rad.unwrap_or(NOT_A_NUMBER)],
            TARGET_WORDS,
        );
    }
}

fn put(bytes: &mut Vec<u8>, words: &[f64], count: usize) {
    for at in 0..count {
        let word = words.get(at).copied().unwrap_or(0.0);
        bytes.extend_from_slice(&canonical(word).to_le_bytes());
    }
}

/// Reads what a module says about one robot.
///
/// - Errors: a kind of command that there is not, in words. Numbers are checked with the law's other commands.
pub(super) fn read(bytes: &[u8], robot: usize) -> Result<Say, String> {
    let mut words = [0.0; ORDER_WORDS];
    for (word, bytes) in words.iter_mut().zip(bytes.as_chunks::<8>().0) {
        *word = f64::from_le_bytes(*bytes);
    }
    let yaw_rad = Some(words[3]).filter(|yaw_rad| !yaw_rad.is_nan());
    let order = |motion, yaw_rad, steering_rad| Order {
        motion,
        yaw_rad,
        steering_rad,
    };
    let order = match words[0] {
        0.0 => None,
        1.0 => Some(Order::twist([words[1], words[2], words[3]])),
        2.0 => Some(order(Motion::Velocity([words[1], words[2]]), yaw_rad, None)),
        3.0 => {
            let mut wheels = [0.0; WHEELS];
            wheels.copy_from_slice(&words[1..=WHEELS]);
            Some(order(Motion::Wheels(wheels), None, Some(words[9])))
        }
        kind => {
            return Err(format!(
                "the command for robot {robot} is of the kind {kind}; there are 0 to 3"
            ));
        }
    };
    let place = [words[12], words[13]];
    let shown = words[11] == 1.0 && place.iter().all(|value| value.is_finite());
    Ok(Say {
        order,
        target_m: shown.then_some(place),
        finished: words[10] == 1.0,
    })
}
