//! What the depth sensor makes of exact depth, as `sim_scenes.sensor` with its defaults.

use std::f64::consts::TAU;

/// Product f B of the infrared pair, px m: 90 degrees over 640 px, baseline 5 cm.
const DISPARITY_SCALE: f64 = 320.0 * 0.05;
/// Standard deviation and quantum of the disparity, px.
const SUBPIXEL_PX: f64 = 0.1;
const DISPARITY_STEP_PX: f64 = 1.0 / 32.0;
/// A pixel lies at an edge when depth changes by more than this share; half of these are lost.
const EDGE_JUMP: f64 = 0.02;
const EDGE_LOSS: f64 = 0.5;
/// Angles between normal and ray at which loss begins and is complete.
const GRAZING_DEG: [f64; 2] = [70.0, 85.0];
/// Nearer surfaces are lost.
const MIN_RANGE_M: f64 = 0.2;
/// Unit of the 16-bit output.
const DEPTH_UNIT_M: f64 = 1e-4;

/// One view's noise: a function of the pixel, so that pixels may be asked in any order.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sensor {
    pub(super) key: u64,
}

/// What loss depends on.
#[derive(Debug, Clone, Copy)]
pub(super) struct Surroundings {
    /// Least and greatest depth among the pixel and its neighbours.
    pub(super) depth_range_m: [f64; 2],
    /// Cosine of the angle between normal and ray.
    pub(super) cosine: f64,
}

impl Sensor {
    /// Reported depth of a surface whose measurement is not lost.
    pub(super) fn depth(self, pixel: usize, depth_m: f64) -> f64 {
        // Box and Muller's transform.
        let radius = (-2.0 * (1.0 - self.uniform(pixel, 0)).ln()).sqrt();
        let normal = radius * (TAU * self.uniform(pixel, 1)).cos();
        let disparity = DISPARITY_SCALE / depth_m + SUBPIXEL_PX * normal;
        let disparity = (disparity / DISPARITY_STEP_PX).round() * DISPARITY_STEP_PX;
        (DISPARITY_SCALE / disparity / DEPTH_UNIT_M).round() * DEPTH_UNIT_M
    }

    /// Whether the stereo matcher loses a pixel.
    pub(super) fn loses(self, pixel: usize, depth_m: f64, at: Surroundings) -> bool {
        let [nearest, farthest] = at.depth_range_m;
        let is_edge =
            farthest - depth_m > EDGE_JUMP * depth_m || depth_m - nearest > EDGE_JUMP * nearest;
        let [begin, end] = GRAZING_DEG;
        let angle = at.cosine.abs().min(1.0).acos().to_degrees();
        depth_m < MIN_RANGE_M
            || (is_edge && self.uniform(pixel, 2) < EDGE_LOSS)
            || self.uniform(pixel, 3) < (angle - begin) / (end - begin)
    }

    /// A number in [0, 1) by the pixel and the purpose: `SplitMix64`'s finaliser (Steele et al. 2014).
    fn uniform(self, pixel: usize, purpose: u64) -> f64 {
        const STEP: u64 = 0x9e37_79b9_7f4a_7c15;
        let mut z = self
            .key
            .wrapping_add((4 * pixel as u64 + purpose + 1).wrapping_mul(STEP));
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^= z >> 31;
        (z >> 11) as f64 / (1_u64 << 53) as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SENSOR: Sensor = Sensor { key: 5 };
    const DRAWS: usize = 20_000;

    fn lost(depth_m: f64, depth_range_m: [f64; 2], angle_deg: f64) -> f64 {
        let at = Surroundings {
            depth_range_m,
            cosine: -angle_deg.to_radians().cos(),
        };
        let lost = (0..DRAWS).filter(|pixel| SENSOR.loses(*pixel, depth_m, at));
        lost.count() as f64 / DRAWS as f64
    }

    #[test]
    fn noise_grows_with_the_square_of_depth() {
        for depth in [0.3, 0.5] {
            let errors: Vec<f64> = (0..DRAWS).map(|p| SENSOR.depth(p, depth) - depth).collect();
            let mean = errors.iter().sum::<f64>() / DRAWS as f64;
            let variance = errors.iter().map(|e| e * e).sum::<f64>() / DRAWS as f64;
            // z^2 s / (f B); the disparity's quantum adds a twelfth of its square.
            let expected = depth * depth * (0.01_f64 + 1.0 / 1024.0 / 12.0).sqrt() / 16.0;
            assert!(
                (variance.sqrt() / expected - 1.0).abs() < 0.03,
                "{variance}"
            );
            assert!(mean.abs() < 0.05 * expected, "{mean}");
        }
    }

    #[test]
    fn loses_edges_grazing_surfaces_and_what_is_too_near() {
        assert_eq!(lost(0.5, [0.495, 0.505], 60.0), 0.0);
        assert_eq!(lost(0.5, [0.5, 0.5], 69.9), 0.0);
        assert_eq!(lost(0.5, [0.5, 0.5], 85.1), 1.0);
        assert!((lost(0.5, [0.5, 0.5], 77.5) - 0.5).abs() < 0.02);
        assert!((lost(0.5, [0.48, 0.5], 0.0) - 0.5).abs() < 0.02);
        assert!((lost(0.5, [0.5, f64::INFINITY], 0.0) - 0.5).abs() < 0.02);
        assert_eq!(lost(0.199, [0.199, 0.199], 0.0), 1.0);
    }

    #[test]
    fn a_pixels_noise_depends_on_nothing_else() {
        let depths: Vec<f64> = (0..9).map(|pixel| SENSOR.depth(pixel, 0.4)).collect();
        let again: Vec<f64> = (0..9).rev().map(|pixel| SENSOR.depth(pixel, 0.4)).collect();
        assert!(depths.iter().eq(again.iter().rev()));
        assert!(depths.iter().any(|depth| *depth != depths[0]));
        assert_ne!(Sensor { key: 6 }.uniform(3, 0), SENSOR.uniform(3, 0));
    }
}
