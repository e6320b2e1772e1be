//! Three robots that never move: what every program of the rows is shown.

use controllers::ranges::BEAMS;
use controllers::view::{Chassis, Member, Place, Seen, Setup, View};

pub const ROBOTS: usize = 3;

pub fn setup() -> Setup {
    let drives = [Chassis::Holonomic, Chassis::TurnInPlace, Chassis::Steered];
    let member = |robot: usize| Member {
        name: format!("robot-{robot}"),
        drive: drives[robot],
        turning_radius_m: 0.3,
        radius_m: 0.2,
        targets: vec![Place {
            x_m: 1.0,
            y_m: 0.5,
            yaw_rad: None,
        }],
    };
    Setup {
        rate_hz: control::TICK_RATE_HZ,
        arena_m: [4.0, 3.0],
        robots: (0..ROBOTS).map(member).collect(),
        parameters: vec![("speed_m_per_s".into(), 0.3)],
    }
}

pub fn view(tick: u64) -> View {
    let seen = |robot: usize| Seen {
        x_m: robot as f64 - 1.0,
        y_m: 0.25,
        yaw_rad: 0.3,
        age_s: 0.02,
        forward_m_per_s: 0.0,
        left_m_per_s: 0.0,
        yaw_rate_rad_per_s: 0.0,
        online: true,
        ranges_m: [1.0; BEAMS],
    };
    View {
        tick,
        time_s: tick as f64 / f64::from(control::TICK_RATE_HZ),
        robots: (0..ROBOTS).map(seen).collect(),
    }
}
