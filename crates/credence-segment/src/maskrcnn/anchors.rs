//! The boxes that proposals are told from (Ren et al. 2015), one set per level of the pyramid.

use credence_nn::{
    conv::Grid,
    rgbd::{HEIGHT, WIDTH},
};

use super::boxes::Edges;

/// Pixels between the cells of the pyramid's levels.
pub(super) const STRIDES: [usize; 4] = [4, 8, 16, 32];
/// First level that proposes: what it would find is smaller than anything on a table.
pub(super) const FIRST_PROPOSING: usize = 1;
/// Roots of the areas of each proposing level's anchors, pixels, and heights over widths.
const SIZES: [[f32; 2]; 3] = [[28.0, 40.0], [57.0, 80.0], [113.0, 160.0]];
const RATIOS: [f32; 3] = [0.5, 1.0, 2.0];
/// Anchors of a cell.
pub(super) const PER_CELL: usize = SIZES[0].len() * RATIOS.len();

/// The grid of a level for a number of images.
pub(super) fn level_grid(level: usize, images: usize) -> Grid {
    Grid {
        images,
        height: HEIGHT.div_ceil(STRIDES[level]),
        width: WIDTH.div_ceil(STRIDES[level]),
    }
}

/// A cell's centre along an axis, pixels: blocks of two pixels, of which each level keeps the first
/// of two.
fn centre(cell: usize, stride: usize) -> f32 {
    (cell * stride) as f32 + 0.5
}

/// The cell coordinate of a pixel coordinate, along either axis.
pub(super) fn to_cells(pixel: f32, level: usize) -> f32 {
    (pixel - 0.5) / STRIDES[level] as f32
}

/// The anchors of an image: level by level, cell by cell, row by row.
#[derive(Debug)]
pub struct Anchors {
    edges: Vec<Edges>,
    /// Number of them in each level.
    counts: [usize; SIZES.len()],
}

impl Anchors {
    /// Those of the network.
    pub fn new() -> Self {
        let mut edges = Vec::new();
        let mut counts = [0; SIZES.len()];
        for (number, sizes) in SIZES.into_iter().enumerate() {
            let level = FIRST_PROPOSING + number;
            let grid = level_grid(level, 1);
            let before = edges.len();
            for row in 0..grid.height {
                for column in 0..grid.width {
                    let middle = [column, row].map(|cell| centre(cell, STRIDES[level]));
                    for size in sizes {
                        edges.extend(RATIOS.map(|ratio| about(middle, size, ratio)));
                    }
                }
            }
            counts[number] = edges.len() - before;
        }
        Self { edges, counts }
    }

    /// All of an image's.
    pub fn edges(&self) -> &[Edges] {
        &self.edges
    }

    /// The places of each level's anchors among all.
    pub fn levels(&self) -> impl Iterator<Item = std::ops::Range<usize>> + '_ {
        let mut start = 0;
        self.counts.iter().map(move |count| {
            start += count;
            start - count..start
        })
    }

    /// Where the head's answers for a number of images, level by level and in each image by image,
    /// tell of an image's anchor.
    pub fn row(&self, anchor: usize, image: usize, images: usize) -> usize {
        let mut range = 0..0;
        for level in self.levels() {
            range = level;
            if anchor < range.end {
                break;
            }
        }
        images * range.start + image * range.len() + anchor - range.start
    }
}

impl Default for Anchors {
    fn default() -> Self {
        Self::new()
    }
}

fn about([x, y]: [f32; 2], size: f32, ratio: f32) -> Edges {
    let half = [size / ratio.sqrt() / 2.0, size * ratio.sqrt() / 2.0];
    [x - half[0], y - half[1], x + half[0], y + half[1]]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_cell_has_two_sizes_in_three_shapes_about_its_centre() {
        let anchors = Anchors::new();
        assert_eq!(anchors.edges().len(), (1200 + 300 + 80) * PER_CELL);
        // The second cell of the first level, its square of 28 pixels.
        assert_eq!(anchors.edges()[PER_CELL + 1], [-5.5, -13.5, 22.5, 14.5]);
        let areas = anchors.edges().iter().map(|[l, t, r, b]| (r - l) * (b - t));
        let found = areas.fold([f32::MAX, 0.0], |[a, b], area| [a.min(area), b.max(area)]);
        assert!((found[0] - 784.0).abs() < 0.1 && (found[1] - 25_600.0).abs() < 1.0);
    }

    #[test]
    fn a_cells_centre_is_the_cell_again() {
        for (level, stride) in STRIDES.into_iter().enumerate() {
            for cell in [0, 3, 7] {
                assert_eq!(to_cells(centre(cell, stride), level), cell as f32);
            }
        }
        // The second cell of stride 4 is the third of the stems' blocks: pixels 4 and 5.
        assert_eq!(centre(1, 4), 4.5);
    }

    #[test]
    fn rows_go_level_by_level_then_image_by_image() {
        let anchors = Anchors::new();
        let rows = |anchor| [0, 1].map(|image| anchors.row(anchor, image, 2));
        assert_eq!(rows(0), [0, 7200]);
        assert_eq!(rows(7199), [7199, 14_399]);
        assert_eq!(rows(7200), [14_400, 16_200]);
        assert_eq!(rows(9479), [18_000 + 479, 18_000 + 959]);
    }
}
