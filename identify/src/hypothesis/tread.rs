//! Knobs of the tyres' tread: how wheels creep and slide on this floor.

use twin::tread::Tread;

use super::Hypothesis;

/// One number of the tread.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TreadKnob {
    /// Halves the slip scale for a knob at 1.
    SlipScale,
    Creep,
    Tail,
    Sliding,
}

/// What a knob at 1 changes.
const CREEP: f64 = 0.02;
const TAIL: f64 = 0.25;
const SLIDING: f64 = 0.05;
/// What the twin accepts and a wheel can have.
const SLIP_SCALES_M_PER_S: (f64, f64) = (0.0007, 0.08);
const LARGEST_CREEP: f64 = 0.25;
const LEAST_SLIDING: f64 = 0.6;

impl TreadKnob {
    pub const ALL: [TreadKnob; 4] = [
        TreadKnob::SlipScale,
        TreadKnob::Creep,
        TreadKnob::Tail,
        TreadKnob::Sliding,
    ];

    /// Values from a nominal tread within what a wheel can have.
    pub(super) fn possible(self, value: f64) -> f64 {
        match self {
            TreadKnob::SlipScale => value.clamp(-2.0, 4.8),
            TreadKnob::Creep => value.clamp(0.0, LARGEST_CREEP / CREEP),
            TreadKnob::Tail => value.clamp(0.0, 1.0 / TAIL),
            TreadKnob::Sliding => value.clamp(0.0, (1.0 - LEAST_SLIDING) / SLIDING),
        }
    }

    pub(super) fn apply(self, hypothesis: &mut Hypothesis, value: f64) {
        let tread = hypothesis.description.tread.get_or_insert(Tread::NOMINAL);
        match self {
            TreadKnob::SlipScale => {
                let (least, most) = SLIP_SCALES_M_PER_S;
                tread.slip_scale_m_per_s = (tread.slip_scale_m_per_s * libm::exp2(-value)).clamp(least, most);
            }
            TreadKnob::Creep => tread.creep = (tread.creep + CREEP * value).clamp(0.0, LARGEST_CREEP),
            TreadKnob::Tail => tread.tail = (tread.tail + TAIL * value).clamp(0.0, 1.0),
            TreadKnob::Sliding => tread.sliding = (tread.sliding - SLIDING * value).clamp(LEAST_SLIDING, 1.0),
        }
    }

    pub(super) fn label(self) -> &'static str {
        match self {
            TreadKnob::SlipScale => "tread.slip_scale_m_per_s",
            TreadKnob::Creep => "tread.creep",
            TreadKnob::Tail => "tread.tail",
            TreadKnob::Sliding => "tread.sliding",
        }
    }
}
