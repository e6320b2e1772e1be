//! How a tyre creeps and slides, beyond the nominal contact.

use serde::{Deserialize, Serialize};

use crate::SLIP_SCALE_M_PER_S;

/// Force over friction times load at a slip |s| of a wheel with rim speed R W, at q = |s| / (s0 + c |R W|):
///
/// F = ((1 - t) tanh q + t q / (1 + q)) (k + (1 - k) / (1 + (|s| / s_k)^2)), s_k = 0.06 m/s
///
/// The nominal contact is c = 0, t = 0, k = 1 and s0 = 0.02 m/s. Rolling tread creeps in proportion to its speed (brush and
/// bristle models), approaches sliding more slowly than tanh, and slides with less than its grip (Stribeck).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Tread {
    /// s0
    pub slip_scale_m_per_s: f64,
    /// c
    pub creep: f64,
    /// t
    pub tail: f64,
    /// k
    pub sliding: f64,
}

impl Tread {
    /// The contact of the nominal equations.
    pub const NOMINAL: Tread = Tread {
        slip_scale_m_per_s: SLIP_SCALE_M_PER_S,
        creep: 0.0,
        tail: 0.0,
        sliding: 1.0,
    };
}
