//! Windows that are far louder than anything references showed count less.
//!
//! A wheel that slides or sticks for a moment leaves hundreds of times what is expected, in references and runs alike: no law is right there. Taken at its
//! weight one such window outvotes all others, and whatever turns it best is named, or taken for what the references have as well. So a window
//! counts at most as [`LOUDEST`] times what is expected of it, under the present model (the idea of Huber 1964, window by window);
//! one that a name explains is trusted again with the name in the model.

use super::Floor;
use crate::record::Record;

/// A window counts at most as if it were so many times as loud as is expected.
pub const LOUDEST: f64 = 3.0;

impl Floor {
    /// Sets how far the windows of records are trusted. Without references nothing tells how loud is too loud, and all are.
    ///
    /// - `residuals`: of the records under the present model.
    pub fn doubt(&self, records: &mut [Record], residuals: &[Vec<f64>]) {
        if self.references.is_empty() {
            return;
        }
        self.set_trust(records, residuals);
    }

    /// The same of the references, as if each had not been calibrated on.
    pub fn doubt_references(&mut self) {
        let mut references = core::mem::take(&mut self.references);
        self.set_trust(&mut references, &self.left_out);
        self.references = references;
    }

    /// Weighted energy that is expected of every window of a record, trusted or not.
    pub fn expected_of_windows(&self, record: &Record) -> Vec<f64> {
        let mut expected = vec![0.0; record.windows.len()];
        for place in record.places() {
            if let Some(quantity) = place.quantity {
                expected[place.window] += 1.0 / self.noise.classes[quantity.class()].correlation;
            }
        }
        expected
    }

    fn set_trust(&self, records: &mut [Record], residuals: &[Vec<f64>]) {
        for (record, residual) in records.iter_mut().zip(residuals) {
            let mut energies = vec![0.0; record.windows.len()];
            let places = record.places();
            for ((place, weight), value) in places.iter().zip(self.noise.weights(record)).zip(residual) {
                if place.quantity.is_some() {
                    energies[place.window] += weight * value * value;
                }
            }
            let expected = self.expected_of_windows(record);
            for ((window, energy), expected) in record.windows.iter_mut().zip(energies).zip(expected) {
                window.trust = (LOUDEST * expected / f64::max(energy, 1e-300)).min(1.0);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hypothesis::Hypothesis;
    use crate::record::Quantity;
    use crate::record::made::{record, series};

    #[test]
    fn a_loud_window_counts_as_three_times_what_is_expected() {
        let given = Hypothesis::nominal(&twin::golden::reference_robot("diff2"));
        let mut floor = Floor::stated(given, Vec::new());
        let windows = || series(Quantity::Wheel(0), 200).windows;
        let mut runs = [record([windows(), windows()].concat())];
        let sigma = floor.noise.classes[0].level.sqrt();
        let residuals = [[vec![sigma; 200], vec![10.0 * sigma; 200]].concat()];
        floor.doubt(&mut runs, &residuals);
        assert!(
            runs[0].windows.iter().all(|window| window.trust == 1.0),
            "nothing is known of it"
        );
        let expected: f64 = floor.noise.weighting(&runs[0]).expected.iter().sum();
        assert_eq!(floor.expected_of_windows(&runs[0]).iter().sum::<f64>(), expected);
        floor.references = vec![series(Quantity::Wheel(0), 1)];
        floor.doubt(&mut runs, &residuals);
        let energy = |residual: &[f64]| -> f64 {
            let weights = floor.noise.weighting(&runs[0]).weights;
            weights.iter().zip(residual).map(|(w, r)| w * r * r).sum()
        };
        // Half of what both expect, and three times that.
        assert!((energy(&residuals[0]) / (0.5 * expected) - 4.0).abs() < 1e-9);
        assert_eq!(runs[0].windows[0].trust, 1.0);
        // What is expected of it shrinks alike.
        let trust = runs[0].windows[1].trust;
        let shrunk: f64 = floor.noise.weighting(&runs[0]).expected.iter().sum();
        assert!((trust - 0.03).abs() < 1e-12 && (shrunk / expected - 0.5 * (1.0 + trust)).abs() < 1e-12);
    }
}
