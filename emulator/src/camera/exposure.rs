//! Instants within an exposure, for motion blur.

/// Offset in microseconds from the middle of an exposure to the middle of each of `count` equal parts of it.
///
/// Where a robot was at these instants is what [`super::RobotInView::poses`] wants.
pub fn instants_us(exposure_us: u32, count: usize) -> impl Iterator<Item = f64> {
    let (exposure_us, parts) = (f64::from(exposure_us), count as f64);
    (0..count).map(move |part| ((part as f64 + 0.5) / parts - 0.5) * exposure_us)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn instants_share_the_exposure_evenly_around_its_middle() {
        assert_eq!(
            instants_us(4000, 4).collect::<Vec<_>>(),
            [-1500.0, -500.0, 500.0, 1500.0]
        );
        assert_eq!(instants_us(3000, 1).collect::<Vec<_>>(), [0.0]);
    }
}
