//! Means of the stages from light to command, for the live picture.

use crate::record::Record;
use api::live::LiveStages;

/// A running mean.
#[derive(Debug, Clone, Copy, Default)]
struct Mean {
    sum_us: i64,
    count: u32,
}

impl Mean {
    fn add(&mut self, value_us: i64) {
        self.sum_us += value_us;
        self.count += 1;
    }

    fn take_ms(&mut self) -> f64 {
        let mean = if self.count == 0 {
            0.0
        } else {
            self.sum_us as f64 * 1e-3 / f64::from(self.count)
        };
        *self = Self::default();
        mean
    }
}

/// Collects records between two live frames.
#[derive(Debug, Clone, Default)]
pub(crate) struct StageMeans {
    camera: Mean,
    locate: Mean,
    fuse: Mean,
    wait: Mean,
    control: Mean,
    link: Mean,
    /// Exposure and arrival of the newest picture that no tick has used.
    waiting: Option<(i64, i64)>,
}

impl StageMeans {
    pub(crate) fn take(&mut self, record: &Record) {
        match record {
            Record::Picture(picture) => {
                self.camera.add(picture.received_us - picture.exposure_us);
                self.locate.add(picture.located_us - picture.received_us);
                self.fuse.add(picture.arrival_us - picture.located_us);
                self.waiting = Some((picture.exposure_us, picture.arrival_us));
            }
            Record::Tick(tick) => {
                self.control.add(tick.done_us - tick.woke_us);
                if let Some((_, arrival_us)) = self
                    .waiting
                    .take_if(|(exposure_us, _)| *exposure_us <= tick.exposure_us)
                {
                    self.wait.add((tick.woke_us - arrival_us).max(0));
                }
            }
            Record::Telemetry(telemetry) if telemetry.sample_bound_us < i64::MAX => {
                self.link.add(telemetry.arrival_us - telemetry.sample_us);
            }
            _ => {}
        }
    }

    /// The means, and a new start; `None` without pictures.
    pub(crate) fn finish(&mut self) -> Option<LiveStages> {
        let pictures = self.camera.count;
        let stages = LiveStages {
            camera_ms: self.camera.take_ms(),
            locate_ms: self.locate.take_ms(),
            fuse_ms: self.fuse.take_ms(),
            wait_ms: self.wait.take_ms(),
            control_ms: self.control.take_ms(),
            link_ms: self.link.take_ms(),
            pictures,
        };
        (pictures > 0).then_some(stages)
    }
}
