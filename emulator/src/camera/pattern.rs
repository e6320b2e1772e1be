//! Where a pixel is looked at, for smooth edges and motion blur.

/// Points within a pixel for one of `count` instants, in px from its centre. All instants together have evenly spread columns
/// and rows, none twice, so that a straight edge is measured to 1 / (number of points) of a pixel.
pub fn pattern(instant: usize, count: usize) -> impl Iterator<Item = [f64; 2]> {
    const ROWS_4: &[u8] = &[1, 3, 0, 2];
    const ROWS_8: &[u8] = &[2, 5, 0, 7, 4, 1, 6, 3];
    const ROWS_16: &[u8] = &[5, 11, 1, 14, 8, 3, 12, 6, 9, 15, 0, 10, 4, 13, 2, 7];
    let rows = match count {
        1 => ROWS_16,
        2 => ROWS_8,
        _ => ROWS_4,
    };
    let shift = |step: f64| (((instant * stride(count, step)) % count) as f64 + 0.5) / count as f64;
    let (shift_u, shift_v) = (shift(0.62), shift(0.3));
    let points = rows.len() as f64;
    rows.iter().enumerate().map(move |(column, row)| {
        [
            (column as f64 + shift_u) / points - 0.5,
            (f64::from(*row) + shift_v) / points - 0.5,
        ]
    })
}

/// A number without a common divisor with `count`, near `share` of it.
fn stride(count: usize, share: f64) -> usize {
    let divisor = |mut a: usize, mut b: usize| {
        while b != 0 {
            (a, b) = (b, a % b);
        }
        a
    };
    let wanted = ((count as f64 * share) as usize).max(1);
    (wanted..wanted + count)
        .find(|step| divisor(*step, count) == 1)
        .unwrap_or(1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_of_all_instants_are_evenly_spread_in_columns_and_rows() {
        for count in 1..=16 {
            let points: Vec<[f64; 2]> = (0..count).flat_map(|instant| pattern(instant, count)).collect();
            let total = points.len();
            for axis in 0..2 {
                let mut values: Vec<f64> = points.iter().map(|point| point[axis]).collect();
                values.sort_by(f64::total_cmp);
                for (index, value) in values.iter().enumerate() {
                    let expected = (index as f64 + 0.5) / total as f64 - 0.5;
                    assert!(
                        (value - expected).abs() < 1e-12,
                        "{count} instants, axis {axis}: {value} {expected}"
                    );
                }
            }
        }
    }
}
