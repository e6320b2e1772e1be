//! References say how their tyres creep and slide.

mod plant;

use plant::replayed::calibration;
use twin::tread::Tread;

fn calibrated_tread(tread: Option<Tread>) -> Option<Tread> {
    calibration("diff2", 800, |own| own.tread = tread).description.tread
}

#[test]
fn the_tread_of_references_is_found() {
    let truth = Tread {
        slip_scale_m_per_s: 0.006,
        creep: 0.06,
        tail: 0.4,
        sliding: 0.9,
    };
    let found = calibrated_tread(Some(truth)).expect("a tread");
    // Numbers stand in for each other a little; the force is what was measured.
    for rolling_m_per_s in [0.4, 1.0] {
        for slip_m_per_s in [0.003, 0.01, 0.03, 0.1, 0.3] {
            let [is, was] = [found, truth].map(|tread| share(&tread, slip_m_per_s, rolling_m_per_s));
            let nominal = share(&Tread::NOMINAL, slip_m_per_s, rolling_m_per_s);
            let off = (is - was).abs();
            assert!(
                off < (0.5 * (nominal - was).abs()).max(0.04),
                "{found:?} {slip_m_per_s} {rolling_m_per_s}: {is} {was}"
            );
        }
    }
}

/// Force over friction times load.
fn share(tread: &Tread, slip_m_per_s: f64, rolling_m_per_s: f64) -> f64 {
    let q = slip_m_per_s / (tread.slip_scale_m_per_s + tread.creep * rolling_m_per_s);
    let grip = (1.0 - tread.tail) * libm::tanh(q) + tread.tail * q / (1.0 + q);
    grip * (tread.sliding + (1.0 - tread.sliding) / (1.0 + (slip_m_per_s / 0.06) * (slip_m_per_s / 0.06)))
}

#[test]
fn tyres_of_the_nominal_contact_stay_what_they_are() {
    let found = calibrated_tread(None).unwrap_or(Tread::NOMINAL);
    assert!(found.creep < 0.004, "{found:?}");
    let scale = found.slip_scale_m_per_s / Tread::NOMINAL.slip_scale_m_per_s;
    assert!((0.87..1.15).contains(&scale), "{found:?}");
    assert!(found.sliding > 0.97 && found.tail < 0.15, "{found:?}");
}

/// Sliding wheels tell their friction, and hardly whether the floor has so little of it or the tyres lose so much. From the described friction alone slopes
/// led to tyres that lose a third (friction 0.91 of the described one instead of 0.7).
#[test]
fn the_friction_of_a_slippery_floor_is_found_on_sliding_tyres() {
    let truth = Tread {
        slip_scale_m_per_s: 0.005,
        creep: 0.02,
        tail: 0.3,
        sliding: 0.85,
    };
    let scale = 0.7;
    let found = calibration("omni4", 830, |own| {
        own.floor_friction *= scale;
        own.tread = Some(truth);
    });
    let friction = found.description.floor_friction / plant::robot("omni4").floor_friction;
    let sliding = found.description.tread.unwrap_or(Tread::NOMINAL).sliding;
    println!("friction {friction}, sliding {sliding}");
    assert!((friction * sliding - scale * truth.sliding).abs() < 0.02);
    assert!((friction - scale).abs() < 0.15, "{friction}");
}
