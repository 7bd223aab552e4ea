//! What the network sees: any camera's frame as that of one camera, in rows.

use credence_nn::conv::Grid;
use credence_types::{Frame, Point};

use super::pose::Anchor;

/// The camera of the network: every second pixel of 640x480 at a focal length of 616 px.
pub(super) const WIDTH: usize = 320;
/// Rows of the network's camera.
pub(super) const HEIGHT: usize = 240;
/// Its focal length, pixels.
pub(super) const FOCAL_PX: f64 = 308.0;
/// Its principal point, pixels.
pub(super) const CENTRE: [f64; 2] = [159.75, 119.75];

/// Pixels of a side of the blocks that the stems take in as one row.
const BLOCK: usize = 4;
/// Pixels between the cells at which objects are told.
pub const STRIDE: usize = 8;
/// Cells across and down.
pub const CELLS: [usize; 2] = [WIDTH / STRIDE, HEIGHT / STRIDE];

/// Numbers of a block: three channels of colour, or of depth.
pub(super) const BLOCK_VALUES: usize = 3 * BLOCK * BLOCK;

/// Middle and spread of the depths that are common on a table, metres.
const DEPTH_M: [f32; 2] = [0.5, 0.2];
/// Side of the squares whose mean depth relief is measured from, and its unit, metres.
const RELIEF_PX: usize = 16;
const RELIEF_M: f32 = 0.02;
/// Relief beyond this many units is an edge, however deep.
const MOST_RELIEF: f32 = 3.0;

/// Colour of what the frame does not show.
const UNSEEN: [u8; 3] = [127; 3];

/// A picture by the network's camera, row-major.
#[derive(Debug, Clone, PartialEq)]
pub struct NetworkImage {
    /// Colour.
    pub rgb: Vec<[u8; 3]>,
    /// Depth, metres; NaN where nothing was measured.
    pub depth_m: Vec<f32>,
}

impl NetworkImage {
    /// A frame as the network's camera would show it, by the nearest pixel; what lies beyond the
    /// frame's border is unseen.
    pub fn of_frame(frame: &Frame) -> Self {
        let (rgb, depth_m) = sources(frame)
            .map(|source| match source {
                Some(pixel) => (frame.rgb()[pixel], frame.depth_m()[pixel]),
                None => (UNSEEN, f32::NAN),
            })
            .unzip();
        Self { rgb, depth_m }
    }

    /// Rows of the stem for colour, one for each block of 4x4 pixels.
    pub fn colour_rows(&self) -> Vec<f32> {
        blocks(|pixel| self.rgb[pixel].map(|c| f32::from(c) / 64.0 - 2.0))
    }

    /// Rows of the stem for depth: depth, whether there is one, and relief.
    pub fn depth_rows(&self) -> Vec<f32> {
        let means = self.mean_depths();
        blocks(|pixel| {
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

    /// The place of each cell, row by row: its middle, and the median depth of its pixels, or, if
    /// they have none, of the whole image.
    pub fn anchors(&self) -> Vec<Anchor> {
        let all = median(self.depth_m.clone()).unwrap_or(DEPTH_M[0]);
        let [across, down] = CELLS;
        let mut anchors = Vec::with_capacity(across * down);
        for cell in 0..across * down {
            let [left, top] = [cell % across * STRIDE, cell / across * STRIDE];
            let rows = (top..top + STRIDE).map(|row| row * WIDTH + left);
            let depths = rows.flat_map(|start| &self.depth_m[start..start + STRIDE]);
            let depth = median(depths.copied().collect()).unwrap_or(all);
            anchors.push(Anchor {
                pixel: [left, top].map(|first| first as f64 + (STRIDE - 1) as f64 / 2.0),
                depth_m: f64::from(depth),
            });
        }
        anchors
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

/// The frame's pixel that each pixel of the network's camera shows; `None` beyond the frame.
pub(super) fn sources(frame: &Frame) -> impl Iterator<Item = Option<usize>> + '_ {
    let camera = *frame.intrinsics();
    (0..WIDTH * HEIGHT).map(move |pixel| {
        let [x, y] = [
            ((pixel % WIDTH) as f64 - CENTRE[0]) / FOCAL_PX,
            ((pixel / WIDTH) as f64 - CENTRE[1]) / FOCAL_PX,
        ];
        let [u, v] = camera.project(&Point::new(x, y, 1.0))?.map(f64::round);
        let inside =
            (0.0..camera.width() as f64).contains(&u) && (0.0..camera.height() as f64).contains(&v);
        inside.then(|| v as usize * camera.width() + u as usize)
    })
}

/// The stems' grid for a number of images.
pub(super) const fn stem_grid(images: usize) -> Grid {
    Grid {
        images,
        height: HEIGHT / BLOCK,
        width: WIDTH / BLOCK,
    }
}

/// Blocks of 4x4 pixels, row by row; within each pixel by pixel.
fn blocks(values: impl Fn(usize) -> [f32; 3]) -> Vec<f32> {
    let mut rows = Vec::with_capacity(3 * WIDTH * HEIGHT);
    for top in (0..HEIGHT).step_by(BLOCK) {
        for left in (0..WIDTH).step_by(BLOCK) {
            for row in top..top + BLOCK {
                for column in left..left + BLOCK {
                    rows.extend(values(row * WIDTH + column));
                }
            }
        }
    }
    rows
}

/// The middle one of the numbers among these values, the lower of two.
fn median(mut values: Vec<f32>) -> Option<f32> {
    values.retain(|v| !v.is_nan());
    let middle = values.len().checked_sub(1)? / 2;
    let (_, median, _) = values.select_nth_unstable_by(middle, f32::total_cmp);
    Some(*median)
}

#[cfg(test)]
mod tests {
    use credence_types::{Intrinsics, Pose};

    use super::*;

    fn image(depth_m: f32) -> NetworkImage {
        NetworkImage {
            rgb: vec![[0, 64, 128]; WIDTH * HEIGHT],
            depth_m: vec![depth_m; WIDTH * HEIGHT],
        }
    }

    #[test]
    fn a_simulated_frame_gives_every_second_pixel() {
        let camera = Intrinsics::new([640, 480], [616.0; 2], [319.5, 239.5]).unwrap();
        let rgb = (0..640 * 480).map(|i| [(i % 640 % 251) as u8, (i / 640 % 251) as u8, 0]);
        let mut depth_m = vec![0.5; 640 * 480];
        depth_m[2] = f32::NAN;
        let frame = Frame::new(rgb.collect(), depth_m, camera, Pose::identity(), None).unwrap();
        let image = NetworkImage::of_frame(&frame);
        assert_eq!(image.rgb[0], [0, 0, 0]);
        assert_eq!(image.rgb[WIDTH + 3], [6, 2, 0]);
        assert_eq!(
            image.rgb[WIDTH * HEIGHT - 1],
            [(638 % 251) as u8, (478 % 251) as u8, 0]
        );
        assert!(image.depth_m[1].is_nan() && image.depth_m[0] == 0.5);
    }

    #[test]
    fn what_a_narrow_camera_does_not_show_is_unseen() {
        // Half the field of view: the quarter in the middle.
        let camera = Intrinsics::new([160, 120], [308.0; 2], [79.5, 59.5]).unwrap();
        let frame = Frame::new(
            vec![[9; 3]; 19_200],
            vec![0.5; 19_200],
            camera,
            Pose::identity(),
            None,
        );
        let image = NetworkImage::of_frame(&frame.unwrap());
        let seen = image.depth_m.iter().filter(|d| !d.is_nan()).count();
        assert_eq!(seen, 160 * 120);
        assert_eq!(image.rgb[0], UNSEEN);
        assert_eq!(image.rgb[120 * WIDTH + 160], [9; 3]);
    }

    #[test]
    fn rows_and_anchors_by_hand() {
        let mut image = image(0.7);
        // The second cell: half its pixels nearer, and one without depth.
        for row in 0..8 {
            image.depth_m[row * WIDTH + 8..row * WIDTH + 12].fill(0.5);
        }
        image.depth_m[12] = f32::NAN;
        let anchors = image.anchors();
        assert_eq!(anchors.len(), 40 * 30);
        assert_eq!(
            anchors[0],
            Anchor {
                pixel: [3.5, 3.5],
                depth_m: f64::from(0.7_f32)
            }
        );
        assert_eq!(anchors[41].pixel, [11.5, 11.5]);
        assert!((anchors[1].depth_m - 0.5).abs() < 1e-6);

        let colour = image.colour_rows();
        assert_eq!(
            (colour.len(), &colour[..3]),
            (4800 * 48, &[-2.0, -1.0, 0.0][..])
        );
        let depth = image.depth_rows();
        assert_eq!(depth.len(), 4800 * BLOCK_VALUES);
        // Pixel (12, 0) is the first of the fourth block; (8, 0) of the third, nearer than the mean.
        assert_eq!(depth[3 * 48..3 * 48 + 3], [0.0; 3]);
        assert!(depth[2 * 48] == 0.0 && depth[2 * 48 + 2] < -1.0);
        let flat = self::image(0.7).depth_rows();
        assert!((flat[0] - 1.0).abs() < 1e-6 && flat[1] == 1.0 && flat[2].abs() < 1e-3);
    }

    #[test]
    fn without_any_depth_the_places_are_at_a_common_one() {
        let image = image(f32::NAN);
        assert!(image.anchors().iter().all(|a| a.depth_m == 0.5));
        assert!(image.depth_rows().iter().all(|v| *v == 0.0));
    }
}
