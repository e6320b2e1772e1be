//! Screening: which effects could explain a disagreement, by score tests on secant sensitivities.

mod score;
mod sensitivity;

pub use score::{Score, scores, thresholds};
pub use sensitivity::{Change, all_residuals, columns};
