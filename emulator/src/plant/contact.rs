//! Contact of one wheel: lumped bristles (LuGre) with the rolling term of the average lumped tyre model.
//!
//! dz/dt = s - (s_0 |s| / g(|s|) + kappa R |W| / L) z,   F / N = s_0 z + s_1(|s|) dz/dt
//! g(v) = mu (mu_k + (1 - mu_k) / (1 + (v / v_s)^2))        [Canudas de Wit et al. 1995; 1999 for the rolling term]
//!
//! At rest the bristles are springs, so a robot stays where it is. Rolling carries deflected bristles out of the patch: a
//! driven wheel creeps in proportion to its force, which the digital twin's contact does not.

/// Stiffness of the bristles over load.
const STIFFNESS_PER_M: f64 = 800.0;
/// Damping over load at rest; it fades with slip so that the model stays passive.
const DAMPING_S_PER_M: f64 = 2.5;
const DAMPING_FADE_M_PER_S: f64 = 0.05;
/// Sliding over breakaway friction, and the slip at which it is half way there.
const KINETIC_SHARE: f64 = 0.88;
const STRIBECK_M_PER_S: f64 = 0.06;
/// kappa / L: bristles that leave the patch per metre rolled.
const RENEWAL_PER_M: f64 = 1.3 / 0.025;

/// Deflection of the bristles, along and across the rolling direction.
#[derive(Debug, Clone, Copy, Default)]
pub struct Bristles {
    deflection_m: [f64; 2],
}

/// What drives the bristles in a step.
#[derive(Debug, Clone, Copy)]
pub struct Slip {
    /// Velocity of the tread over the floor along and across; an omni wheel does not slip across.
    pub velocity_m_per_s: [f64; 2],
    /// |R W|.
    pub rolling_m_per_s: f64,
    pub friction: f64,
    pub load_n: f64,
    /// Friction across over that along; 1 for a round tread.
    pub side_scale: f64,
    /// Times [`RENEWAL_PER_M`].
    pub creep_scale: f64,
    /// Bristles that leave the patch along the rolling direction per metre, beyond [`RENEWAL_PER_M`]: a softer tread.
    pub more_renewal_per_m: f64,
}

/// Renewal that makes a wheel under all the force that friction allows slip by a further ratio: dz/dt = 0 at
/// s = ratio R W gives ratio = renewal mu / s_0.
pub fn renewal_per_m(slip_ratio: f64, friction: f64) -> f64 {
    slip_ratio * STIFFNESS_PER_M / friction.max(1e-6)
}

impl Bristles {
    /// Moves the bristles by a step and returns the force on the robot along and across.
    pub fn step(&mut self, slip: &Slip, dt_s: f64) -> [f64; 2] {
        const PER_STRIBECK_2: f64 = 1.0 / (STRIBECK_M_PER_S * STRIBECK_M_PER_S);
        const PER_FADE_2: f64 = 1.0 / (DAMPING_FADE_M_PER_S * DAMPING_FADE_M_PER_S);
        let [along, across] = slip.velocity_m_per_s;
        let speed_2 = along * along + across * across;
        let speed = speed_2.sqrt();
        // Divisions are what a step of the plant spends most of its time on: these two share one.
        let (stribeck, fade) = (1.0 + PER_STRIBECK_2 * speed_2, 1.0 + PER_FADE_2 * speed_2);
        let inverse = 1.0 / (stribeck * fade);
        let limit = slip.friction * (KINETIC_SHARE + (1.0 - KINETIC_SHARE) * (fade * inverse));
        let damping_per_load = DAMPING_S_PER_M * (stribeck * inverse) / dt_s;
        let own_per_m = slip.creep_scale * RENEWAL_PER_M;
        let renewal_per_m = [own_per_m + slip.more_renewal_per_m, own_per_m];
        let along_per_s = STIFFNESS_PER_M * speed / limit.max(1e-6);
        let across_per_s = if slip.side_scale == 1.0 {
            along_per_s
        } else {
            STIFFNESS_PER_M * speed / (limit * slip.side_scale).max(1e-6)
        };
        let sliding_per_s = [along_per_s, across_per_s];
        let mut force_n = [0.0; 2];
        for (axis, ((force, deflection), velocity)) in force_n
            .iter_mut()
            .zip(&mut self.deflection_m)
            .zip(slip.velocity_m_per_s)
            .enumerate()
        {
            let decay_per_s = sliding_per_s[axis] + renewal_per_m[axis] * slip.rolling_m_per_s;
            let before = *deflection;
            *deflection = (before + dt_s * velocity) / (1.0 + dt_s * decay_per_s);
            *force = slip.load_n * (STIFFNESS_PER_M * *deflection + damping_per_load * (*deflection - before));
        }
        force_n
    }

    /// Elastic energy under a load.
    pub fn energy_j(&self, load_n: f64) -> f64 {
        let [along, across] = self.deflection_m;
        0.5 * load_n * STIFFNESS_PER_M * (along * along + across * across)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DT_S: f64 = 1.0 / 7680.0;

    fn settle(velocity: [f64; 2], rolling_m_per_s: f64) -> [f64; 2] {
        let mut bristles = Bristles::default();
        let slip = Slip {
            velocity_m_per_s: velocity,
            rolling_m_per_s,
            friction: 0.8,
            load_n: 30.0,
            side_scale: 1.0,
            creep_scale: 1.0,
            more_renewal_per_m: 0.0,
        };
        (0..7680).fold([0.0; 2], |_, _| bristles.step(&slip, DT_S))
    }

    #[test]
    fn sliding_force_opposes_slip_within_the_friction_circle() {
        for velocity in [[1.0, 0.0], [0.0, -2.0], [0.6, 0.8], [-3.0, 0.1]] {
            let [along, across] = settle(velocity, 0.0);
            let size = along.hypot(across);
            assert!((size - 24.0 * KINETIC_SHARE).abs() < 0.1, "{size}");
            assert!(
                (along * velocity[1] - across * velocity[0]).abs() < 1e-6
                    && along * velocity[0] + across * velocity[1] > 0.0
            );
        }
    }

    #[test]
    fn a_rolling_wheel_creeps_in_proportion() {
        let (one, two) = (settle([0.001, 0.0], 1.0)[0], settle([0.002, 0.0], 1.0)[0]);
        assert!(one > 0.2 && (two / one - 2.0).abs() < 0.1, "{one} {two}");
    }

    /// Without renewal the bristles carry all that friction allows, however slow the slip.
    #[test]
    fn a_hard_tread_does_not_creep() {
        let force = |creep_scale: f64| {
            let mut bristles = Bristles::default();
            let slip = Slip {
                velocity_m_per_s: [0.002, 0.0],
                rolling_m_per_s: 1.0,
                friction: 0.8,
                load_n: 30.0,
                side_scale: 1.0,
                creep_scale,
                more_renewal_per_m: 0.0,
            };
            (0..7680).fold(0.0, |_, _| bristles.step(&slip, DT_S)[0])
        };
        let (rubber, half, hard) = (force(1.0), force(0.5), force(0.0));
        assert!((half / rubber - 2.0).abs() < 0.1, "{half} {rubber}");
        assert!(hard > 0.6 * 24.0, "{hard}");
    }

    #[test]
    fn a_soft_tread_creeps_by_the_ratio_more_and_an_oval_one_holds_less_across() {
        let (friction, load_n, ratio) = (0.8, 30.0, 0.05);
        let creep = |more_renewal_per_m: f64| {
            let mut bristles = Bristles::default();
            let slip = Slip {
                velocity_m_per_s: [0.001, 0.0],
                rolling_m_per_s: 1.0,
                friction,
                load_n,
                side_scale: 1.0,
                creep_scale: 1.0,
                more_renewal_per_m,
            };
            (0..7680).fold(0.0, |_, _| bristles.step(&slip, DT_S)[0])
        };
        // Slip per rolling over force, scaled to the force friction allows; both treads at the same slip.
        let at_full_force = |force: f64| 0.001 * friction * load_n / force;
        let more = at_full_force(creep(renewal_per_m(ratio, friction))) - at_full_force(creep(0.0));
        assert!((more - ratio).abs() < 0.001, "{more}");
        let mut bristles = Bristles::default();
        let across = Slip {
            velocity_m_per_s: [0.0, 2.0],
            rolling_m_per_s: 0.0,
            friction,
            load_n,
            side_scale: 0.5,
            creep_scale: 1.0,
            more_renewal_per_m: 0.0,
        };
        let held = (0..7680).fold(0.0, |_, _| bristles.step(&across, DT_S)[1]);
        assert!((held - 12.0 * KINETIC_SHARE).abs() < 0.1, "{held}");
    }

    #[test]
    fn a_small_push_is_held_by_the_bristles() {
        let mut bristles = Bristles::default();
        let slip = |velocity| Slip {
            velocity_m_per_s: [velocity, 0.0],
            rolling_m_per_s: 0.0,
            friction: 0.8,
            load_n: 30.0,
            side_scale: 1.0,
            creep_scale: 1.0,
            more_renewal_per_m: 0.0,
        };
        for _ in 0..10 {
            bristles.step(&slip(0.01), DT_S);
        }
        let held = (0..7680).fold(0.0, |_, _| bristles.step(&slip(0.0), DT_S)[0]);
        assert!(held > 0.2, "{held}");
    }
}
