use credence_nn::rgbd::{HEIGHT, WIDTH};
use credence_segment::maskrcnn::{Edges, MASK_SIDE, sides};
use credence_types::Category;

use super::pictures::LabelledPicture;

/// Objects that fewer pixels show, a thousandth of the image, are neither learned nor missed.
pub(super) const LEAST_PIXELS: usize = WIDTH * HEIGHT / 1000;

/// An object as an image shows it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Truth {
    /// Its number among the picture's owners.
    pub(super) number: u8,
    pub(super) category: Category,
    /// Edges of the pixels that show it.
    pub(super) edges: Edges,
    /// How many they are.
    pub(super) pixels: usize,
}

/// Every object that a pixel shows, by number.
pub(super) fn truths(picture: &LabelledPicture) -> Vec<Truth> {
    let nothing = (0, [f32::MAX, f32::MAX, f32::MIN, f32::MIN]);
    let mut found = vec![nothing; picture.categories.len()];
    for (pixel, owner) in picture.owners.iter().enumerate() {
        let Some(number) = usize::from(*owner).checked_sub(1) else {
            continue;
        };
        let (column, row) = ((pixel % WIDTH) as f32, (pixel / WIDTH) as f32);
        let (count, edges) = &mut found[number];
        *count += 1;
        *edges = [
            edges[0].min(column - 0.5),
            edges[1].min(row - 0.5),
            edges[2].max(column + 0.5),
            edges[3].max(row + 0.5),
        ];
    }
    let all = (1..).zip(&picture.categories).zip(found);
    all.filter(|(_, (pixels, _))| *pixels > 0)
        .filter_map(|((number, category), (pixels, edges))| {
            Some(Truth {
                number,
                category: (*category)?,
                edges,
                pixels,
            })
        })
        .collect()
}

/// Which values of a region's mask show an object, row by row: those whose nearest pixel does.
pub(super) fn region_mask(owners: &[u8], number: u8, edges: Edges) -> Vec<bool> {
    let [width, height] = sides(edges);
    let place = |value: usize, from: f32, side: f32, size: usize| {
        let at = from + (value as f32 + 0.5) / MASK_SIDE as f32 * side;
        at.round().clamp(0.0, (size - 1) as f32) as usize
    };
    let values = (0..MASK_SIDE * MASK_SIDE).map(|value| {
        let row = place(value / MASK_SIDE, edges[1], height, HEIGHT);
        let column = place(value % MASK_SIDE, edges[0], width, WIDTH);
        owners[row * WIDTH + column] == number
    });
    values.collect()
}

#[cfg(test)]
mod tests {
    use credence_nn::rgbd::RgbdImage;

    use super::*;

    /// A bowl of 28x14 pixels from (10, 20) on, a mug's single pixel, and a number without a category.
    fn picture() -> LabelledPicture {
        let mut owners = vec![0; WIDTH * HEIGHT];
        for row in 20..34 {
            owners[row * WIDTH + 10..row * WIDTH + 38].fill(2);
        }
        owners[0] = 4;
        owners[5] = 3;
        let mut categories = vec![None; 16];
        categories[1] = Some(Category::Bowl);
        categories[3] = Some(Category::Mug);
        LabelledPicture {
            image: RgbdImage {
                rgb: vec![[0; 3]; WIDTH * HEIGHT],
                depth_m: vec![0.5; WIDTH * HEIGHT],
            },
            owners,
            categories,
        }
    }

    #[test]
    fn objects_have_the_edges_of_their_pixels() {
        let found = truths(&picture());
        let bowl = Truth {
            number: 2,
            category: Category::Bowl,
            edges: [9.5, 19.5, 37.5, 33.5],
            pixels: 28 * 14,
        };
        assert_eq!(found[0], bowl);
        assert_eq!((found[1].number, found[1].pixels), (4, 1));
        assert_eq!(found[1].edges, [-0.5, -0.5, 0.5, 0.5]);
        assert_eq!(found.len(), 2);
    }

    #[test]
    fn a_region_shows_as_much_of_an_object_as_it_covers() {
        let picture = picture();
        let whole = region_mask(&picture.owners, 2, [9.5, 19.5, 37.5, 33.5]);
        assert!(whole.iter().all(|inside| *inside));
        // Twice as wide: the object is the left half.
        let half = region_mask(&picture.owners, 2, [9.5, 19.5, 65.5, 33.5]);
        assert!((0..half.len()).all(|at| half[at] == (at % MASK_SIDE < MASK_SIDE / 2)));
        assert!(!region_mask(&picture.owners, 4, [9.5, 19.5, 37.5, 33.5]).contains(&true));
    }
}
