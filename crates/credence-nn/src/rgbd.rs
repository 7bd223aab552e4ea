//! Pictures in colour and depth as the networks that look at images take them in.

/// Pixels across and down.
pub const WIDTH: usize = 320;
/// See [`WIDTH`].
pub const HEIGHT: usize = 240;

/// Middle and spread of the depths that are common on a table, metres.
const DEPTH_M: [f32; 2] = [0.5, 0.2];
/// Side of the squares whose mean depth relief is measured from, and its unit, metres.
const RELIEF_PX: usize = 16;
const RELIEF_M: f32 = 0.02;
/// Relief beyond this many units is an edge, however deep.
const MOST_RELIEF: f32 = 3.0;

/// Colour of what is not shown.
const UNSEEN: [u8; 3] = [127; 3];

/// A picture of 320x240 pixels, row-major.
#[derive(Debug, Clone, PartialEq)]
pub struct RgbdImage {
    /// Colour.
    pub rgb: Vec<[u8; 3]>,
    /// Depth, metres; NaN where nothing was measured.
    pub depth_m: Vec<f32>,
}

impl RgbdImage {
    /// The picture whose pixels are those of another, by their place there; `None` is unseen.
    ///
    /// # Panics
    /// When a place is beyond the other picture, or there are not 320x240 of them.
    pub fn of_pixels(
        rgb: &[[u8; 3]],
        depth_m: &[f32],
        places: impl Iterator<Item = Option<usize>>,
    ) -> Self {
        let (rgb, depth_m): (Vec<_>, Vec<_>) = places
            .map(|place| place.map_or((UNSEEN, f32::NAN), |at| (rgb[at], depth_m[at])))
            .unzip();
        assert_eq!(rgb.len(), WIDTH * HEIGHT, "a place for each pixel");
        Self { rgb, depth_m }
    }

    /// Rows of colour, one for each block of `block`x`block` pixels, row by row: three values of
    /// each of its pixels.
    pub fn colour_rows(&self, block: usize) -> Vec<f32> {
        blocks(block, |pixel| {
            self.rgb[pixel].map(|c| f32::from(c) / 64.0 - 2.0)
        })
    }

    /// Rows of depth in the same way: depth, whether there is one, and relief.
    pub fn depth_rows(&self, block: usize) -> Vec<f32> {
        let means = self.mean_depths();
        blocks(block, |pixel| {
            let depth = self.depth_m[pixel];
            if depth.is_nan() {
                return [0.0; 3];
            }
            let (column, row) = (pixel % WIDTH, pixel / WIDTH);
            let mean = means[row / RELIEF_PX * WIDTH.div_ceil(RELIEF_PX) + column / RELIEF_PX];
            let relief = (depth - mean) / RELIEF_M;
            // A frame may hold any positive depth.
            let depth = ((depth - DEPTH_M[0]) / DEPTH_M[1]).clamp(-5.0, 20.0);
            [depth, 1.0, relief.clamp(-MOST_RELIEF, MOST_RELIEF)]
        })
    }

    /// Mean depth of each square of 16x16 pixels; 0 without any.
    fn mean_depths(&self) -> Vec<f32> {
        let across = WIDTH.div_ceil(RELIEF_PX);
        let mut sums = vec![(0.0_f32, 0.0_f32); across * HEIGHT.div_ceil(RELIEF_PX)];
        for (row, depths) in self.depth_m.chunks_exact(WIDTH).enumerate() {
            for (column, depth) in depths.iter().enumerate().filter(|(_, d)| !d.is_nan()) {
                let (sum, count) = &mut sums[row / RELIEF_PX * across + column / RELIEF_PX];
                *sum += depth;
                *count += 1.0;
            }
        }
        sums.iter()
            .map(|(sum, count)| sum / count.max(1.0))
            .collect()
    }
}

/// Blocks row by row; within each pixel by pixel.
fn blocks(block: usize, values: impl Fn(usize) -> [f32; 3]) -> Vec<f32> {
    let mut rows = Vec::with_capacity(3 * WIDTH * HEIGHT);
    for top in (0..HEIGHT).step_by(block) {
        for left in (0..WIDTH).step_by(block) {
            for row in top..top + block {
                for column in left..left + block {
                    rows.extend(values(row * WIDTH + column));
                }
            }
        }
    }
    rows
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image(depth_m: f32) -> RgbdImage {
        RgbdImage {
            rgb: vec![[0, 64, 128]; WIDTH * HEIGHT],
            depth_m: vec![depth_m; WIDTH * HEIGHT],
        }
    }

    #[test]
    fn rows_by_hand() {
        let mut image = image(0.7);
        image.depth_m[8..12].fill(0.5);
        image.depth_m[12] = f32::NAN;
        let colour = image.colour_rows(4);
        let expected = &[-2.0, -1.0, 0.0][..];
        assert_eq!((colour.len(), &colour[..3]), (4800 * 48, expected));
        let depth = image.depth_rows(4);
        assert_eq!(depth.len(), 4800 * 48);
        // Pixel (12, 0) is the first of the fourth block; (8, 0) of the third, nearer than the mean.
        assert_eq!(depth[3 * 48..3 * 48 + 3], [0.0; 3]);
        assert!(depth[2 * 48] == 0.0 && depth[2 * 48 + 2] < -1.0);
        let flat = self::image(0.7).depth_rows(2);
        assert!((flat[0] - 1.0).abs() < 1e-6 && flat[1] == 1.0 && flat[2].abs() < 1e-3);
        assert!(
            self::image(f32::NAN)
                .depth_rows(2)
                .iter()
                .all(|v| *v == 0.0)
        );
    }

    #[test]
    fn places_that_are_not_shown_are_grey_and_unmeasured() {
        let places = (0..WIDTH * HEIGHT).map(|pixel| (pixel == 1).then_some(2));
        let image = RgbdImage::of_pixels(&[[1; 3], [2; 3], [3; 3]], &[0.1, 0.2, 0.3], places);
        assert_eq!(image.rgb[..3], [UNSEEN, [3; 3], UNSEEN]);
        assert!(image.depth_m[0].is_nan() && image.depth_m[1] == 0.3);
    }
}
