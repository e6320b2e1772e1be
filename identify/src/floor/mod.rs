//! The floor: how far twin and measurement are apart where nothing has changed.

mod alike;
mod calibrate;
mod description;
mod doubt;
mod metric;
mod modes;
mod noise;
mod otherwise;
mod start;
mod variation;

pub use alike::Named;
pub use calibrate::{Floor, knob_changes};
pub use description::{Estimate, Said};
pub use doubt::LOUDEST;
pub use metric::{Metric, dot};
pub use noise::{ClassNoise, NoiseModel, sensor_sigmas};
pub use otherwise::HARDER_AND_CHANGED;
