//! A robot's health in the database: columns side by side, null as one.

use api::health::{BatteryLevel, LinkQuality, RobotActivity, RobotHealth};
use api::lab::RobotStatus;

/// The columns of `robot_status`.
#[derive(Debug, sqlx::FromRow)]
pub(crate) struct HealthRow {
    battery: Option<String>,
    rest_v: Option<f64>,
    stalled: Option<bool>,
    sensor_fault: Option<bool>,
    bounded_estimate: Option<bool>,
    loss_share: Option<f64>,
    delay_p50_ms: Option<f64>,
    delay_p95_ms: Option<f64>,
    jitter_ms: Option<f64>,
    activity: Option<String>,
}

impl HealthRow {
    pub(crate) fn health(&self) -> Option<RobotHealth> {
        Some(RobotHealth {
            battery: battery_of(self.battery.as_deref()?)?,
            rest_v: self.rest_v?,
            stalled: self.stalled?,
            sensor_fault: self.sensor_fault?,
            bounded_estimate: self.bounded_estimate?,
        })
    }

    pub(crate) fn link(&self) -> Option<LinkQuality> {
        Some(LinkQuality {
            loss_share: self.loss_share?,
            delay_p50_ms: self.delay_p50_ms?,
            delay_p95_ms: self.delay_p95_ms?,
            jitter_ms: self.jitter_ms?,
        })
    }

    pub(crate) fn activity(&self) -> Option<RobotActivity> {
        let text = self.activity.as_deref()?;
        let all = [RobotActivity::DrivingHome, RobotActivity::Charging];
        all.into_iter().find(|activity| activity.as_str() == text)
    }
}

fn battery_of(text: &str) -> Option<BatteryLevel> {
    let levels = [
        BatteryLevel::Good,
        BatteryLevel::Low,
        BatteryLevel::Critical,
        BatteryLevel::Empty,
    ];
    levels.into_iter().find(|level| level.as_str() == text)
}

/// The columns of a whole report, each as one array.
#[derive(Debug, Default)]
pub(crate) struct HealthColumns {
    pub(crate) battery: Vec<Option<&'static str>>,
    pub(crate) rest_v: Vec<Option<f64>>,
    pub(crate) stalled: Vec<Option<bool>>,
    pub(crate) sensor_fault: Vec<Option<bool>>,
    pub(crate) bounded_estimate: Vec<Option<bool>>,
    pub(crate) loss_share: Vec<Option<f64>>,
    pub(crate) delay_p50_ms: Vec<Option<f64>>,
    pub(crate) delay_p95_ms: Vec<Option<f64>>,
    pub(crate) jitter_ms: Vec<Option<f64>>,
    pub(crate) activity: Vec<Option<&'static str>>,
}

impl HealthColumns {
    /// In the order of `robots`.
    pub(crate) fn of(robots: &[RobotStatus]) -> Self {
        let mut columns = Self::default();
        for RobotStatus {
            health, link, activity, ..
        } in robots
        {
            columns.battery.push(health.map(|health| health.battery.as_str()));
            columns.rest_v.push(health.map(|health| health.rest_v));
            columns.stalled.push(health.map(|health| health.stalled));
            columns.sensor_fault.push(health.map(|health| health.sensor_fault));
            columns
                .bounded_estimate
                .push(health.map(|health| health.bounded_estimate));
            columns.loss_share.push(link.map(|link| link.loss_share));
            columns.delay_p50_ms.push(link.map(|link| link.delay_p50_ms));
            columns.delay_p95_ms.push(link.map(|link| link.delay_p95_ms));
            columns.jitter_ms.push(link.map(|link| link.jitter_ms));
            columns.activity.push(activity.map(RobotActivity::as_str));
        }
        columns
    }
}
