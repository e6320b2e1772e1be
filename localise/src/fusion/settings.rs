//! Numbers of the fusion.

use crate::problem::Problem;

/// What the fusion believes of robots and cameras.
#[derive(Debug, Clone, PartialEq)]
pub struct FusionSettings {
    /// Cameras are numbered from 0.
    pub cameras: u16,
    /// Robots are numbered from 0; observations of others are invalid.
    pub robots: u16,
    /// Fastest any robot can move.
    pub speed_max_m_per_s: f64,
    /// Fastest any robot can turn.
    pub yaw_rate_max_rad_per_s: f64,
    /// Spectral density of the accelerations that the constant-velocity model does not know, m^2/s^3; velocities lag by
    /// about 15 ms at the default.
    pub acceleration_density_m2_per_s3: f64,
    /// The same for yaw, rad^2/s^3.
    pub yaw_acceleration_density_rad2_per_s3: f64,
    /// Largest squared Mahalanobis distance of a measurement that agrees (two degrees of freedom; yaw separately).
    pub gate: f64,
    /// Sightings that agree with each other before a robot has a pose.
    pub hits_to_start: u32,
    /// A track without measurements for longer is lost.
    pub lost_after_us: i64,
    /// Oldest exposure that is used, at arrival; also how far measurements of two cameras may be out of order.
    pub measurement_age_max_us: i64,
    /// A camera without a new frame for longer has stalled.
    pub stalled_after_us: i64,
    /// Sensor noise makes two frames differ always, so the same picture again is a frozen camera. If false, the same
    /// picture is frozen only once a robot in it is known to move.
    pub frames_have_noise: bool,
    /// Speed below which a robot counts as standing.
    pub rest_m_per_s: f64,
}

impl Default for FusionSettings {
    fn default() -> FusionSettings {
        FusionSettings {
            cameras: 2,
            robots: 64,
            speed_max_m_per_s: 3.0,
            yaw_rate_max_rad_per_s: 20.0,
            acceleration_density_m2_per_s3: 0.05,
            yaw_acceleration_density_rad2_per_s3: 2.0,
            gate: 25.0,
            hits_to_start: 3,
            lost_after_us: 500_000,
            measurement_age_max_us: 100_000,
            stalled_after_us: 50_000,
            frames_have_noise: true,
            rest_m_per_s: 0.05,
        }
    }
}

impl FusionSettings {
    pub(super) fn check(&self) -> Result<(), Problem> {
        let rows = [
            ("cameras", f64::from(self.cameras), [1.0, 64.0], ""),
            ("robots", f64::from(self.robots), [1.0, 587.0], ""),
            ("speed_max_m_per_s", self.speed_max_m_per_s, [0.01, 50.0], "m/s"),
            (
                "yaw_rate_max_rad_per_s",
                self.yaw_rate_max_rad_per_s,
                [0.01, 200.0],
                "rad/s",
            ),
            (
                "acceleration_density_m2_per_s3",
                self.acceleration_density_m2_per_s3,
                [1e-4, 1e3],
                "m^2/s^3",
            ),
            (
                "yaw_acceleration_density_rad2_per_s3",
                self.yaw_acceleration_density_rad2_per_s3,
                [1e-4, 1e4],
                "rad^2/s^3",
            ),
            ("gate", self.gate, [4.0, 100.0], ""),
            ("hits_to_start", f64::from(self.hits_to_start), [1.0, 100.0], ""),
            ("lost_after_us", self.lost_after_us as f64, [1e4, 1e7], "us"),
            (
                "measurement_age_max_us",
                self.measurement_age_max_us as f64,
                [1e3, 1e6],
                "us",
            ),
            ("stalled_after_us", self.stalled_after_us as f64, [1e3, 1e7], "us"),
            ("rest_m_per_s", self.rest_m_per_s, [1e-3, 10.0], "m/s"),
        ];
        rows.into_iter().try_for_each(|(field, value, limits, unit)| {
            Problem::in_range(
                field,
                value,
                limits,
                unit,
                "use the default unless the laboratory is known to differ",
            )
        })
    }
}
