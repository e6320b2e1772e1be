//! Forces on the body from outside: carpets, cables, and some that no library knows.

use emulator::plant::Pose;
use emulator::plant::body::{Body, Push};

#[derive(Debug, Clone, Default)]
pub struct Forces {
    /// Drag along a world direction: size and direction.
    pub grain: Option<(f64, f64)>,
    pub cable: Option<Cable>,
    pub hill: Option<Hill>,
    /// Amplitude and frequency of a moment in time.
    pub throb: Option<(f64, f64)>,
    /// Against the velocity, per square of it.
    pub air_n_s2_per_m2: f64,
    /// To the left, per forward velocity.
    pub sideways_n_s_per_m: f64,
}

#[derive(Debug, Clone, Copy)]
pub struct Cable {
    pub stiffness_n_per_m: f64,
    pub anchor_m: [f64; 2],
    pub slack_m: f64,
}

/// A bump in the floor: away from its middle, largest at its width.
#[derive(Debug, Clone, Copy)]
pub struct Hill {
    pub force_n: f64,
    pub at_m: [f64; 2],
    pub width_m: f64,
}

/// Velocity at which the drag of a carpet has half its size.
const GRAIN_HALF_M_PER_S: f64 = 0.01;

impl Forces {
    /// What pushes the robot now.
    pub fn push(&self, body: &Body, time_s: f64) -> Push {
        let mut push = Push::default();
        let Pose { x_m, y_m, yaw_rad } = body.pose();
        let [vx, vy] = body.velocity_m_per_s();
        if let Some((force_n, direction_rad)) = self.grain {
            let (sin, cos) = direction_rad.sin_cos();
            let speed = vx * cos + vy * sin;
            let drag = -force_n * speed / (speed.abs() + GRAIN_HALF_M_PER_S);
            push.force_n[0] += drag * cos;
            push.force_n[1] += drag * sin;
        }
        if let Some(cable) = self.cable {
            let [dx, dy] = [cable.anchor_m[0] - x_m, cable.anchor_m[1] - y_m];
            let distance_m = dx.hypot(dy);
            let pull_n = cable.stiffness_n_per_m * (distance_m - cable.slack_m).max(0.0) / distance_m.max(1e-9);
            let force_n = [pull_n * dx, pull_n * dy];
            // Fastened at the body origin, beside the centre of mass.
            let [lx, ly] = body.lever_m();
            push.moment_n_m += lx * force_n[1] - ly * force_n[0];
            push.force_n[0] += force_n[0];
            push.force_n[1] += force_n[1];
        }
        if let Some(hill) = self.hill {
            let [dx, dy] = [(x_m - hill.at_m[0]) / hill.width_m, (y_m - hill.at_m[1]) / hill.width_m];
            let size_n = hill.force_n * (0.5 - 0.5 * (dx * dx + dy * dy)).exp();
            push.force_n[0] += size_n * dx;
            push.force_n[1] += size_n * dy;
        }
        if let Some((moment_n_m, frequency_hz)) = self.throb {
            push.moment_n_m += moment_n_m * (std::f64::consts::TAU * frequency_hz * time_s).sin();
        }
        let (sin, cos) = yaw_rad.sin_cos();
        let air = -self.air_n_s2_per_m2 * vx.hypot(vy);
        let sideways = self.sideways_n_s_per_m * (cos * vx + sin * vy);
        push.force_n[0] += air * vx - sin * sideways;
        push.force_n[1] += air * vy + cos * sideways;
        push
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use emulator::hidden::{HiddenRobot, RunVariation};
    use emulator::noise::Noise;

    #[test]
    fn forces_by_hand() {
        let text = serde_json::to_value(crate::background::robot("diff2", false)).expect("json");
        let robot = serde_json::from_value(text).expect("a description");
        let still = RunVariation {
            friction: 0.0,
            mass: 0.0,
            torque_constant: 0.0,
            battery_charge: 0.0,
        };
        let hidden = HiddenRobot {
            com_x_m: 0.02,
            ..HiddenRobot::default()
        };
        let mut body = Body::new(&robot, 0.25, &hidden, &still, &mut Noise::new(1, 1)).expect("a body");
        body.place(Pose {
            x_m: 0.5,
            y_m: 0.0,
            yaw_rad: std::f64::consts::FRAC_PI_2,
        });
        body.push([0.0, 0.8], 0.0);
        let close = |push: &Push, force: [f64; 2], moment: f64| {
            let [x, y] = push.force_n;
            let same =
                (x - force[0]).abs() < 1e-9 && (y - force[1]).abs() < 1e-9 && (push.moment_n_m - moment).abs() < 1e-9;
            assert!(same, "{push:?}");
        };
        let none = Forces::default();
        close(&none.push(&body, 0.0), [0.0, 0.0], 0.0);
        // 1 m from the anchor, 0.4 m of them slack, fastened 20 mm behind the centre of mass (below it on the page).
        let cable = Cable {
            stiffness_n_per_m: 2.0,
            anchor_m: [1.5, 0.0],
            slack_m: 0.4,
        };
        close(
            &Forces {
                cable: Some(cable),
                ..none.clone()
            }
            .push(&body, 0.0),
            [1.2, 0.0],
            0.024,
        );
        let hill = Hill {
            force_n: 3.0,
            at_m: [0.2, 0.0],
            width_m: 0.3,
        };
        close(
            &Forces {
                hill: Some(hill),
                ..none.clone()
            }
            .push(&body, 0.0),
            [3.0, 0.0],
            0.0,
        );
        close(
            &Forces {
                air_n_s2_per_m2: 2.0,
                ..none.clone()
            }
            .push(&body, 0.0),
            [0.0, -2.0 * 0.64],
            0.0,
        );
        close(
            &Forces {
                sideways_n_s_per_m: 5.0,
                ..none.clone()
            }
            .push(&body, 0.0),
            [-4.0, 0.0],
            0.0,
        );
        close(
            &Forces {
                throb: Some((0.7, 0.5)),
                ..none
            }
            .push(&body, 0.5),
            [0.0, 0.0],
            0.7,
        );
    }
}
