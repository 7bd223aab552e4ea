//! What the network sees: any camera's frame as that of one camera.

use credence_nn::{
    conv::Grid,
    rgbd::{HEIGHT, RgbdImage, WIDTH},
};
use credence_types::{Frame, Point};

use super::pose::Anchor;

/// Focal length of the network's camera, pixels: every second pixel of 640x480 at one of 616 px.
pub(super) const FOCAL_PX: f64 = 308.0;
/// Its principal point, pixels.
pub(super) const CENTRE: [f64; 2] = [159.75, 119.75];

/// Pixels of a side of the blocks that the stems take in as one row.
pub const BLOCK: usize = 4;
/// Pixels between the cells at which objects are told.
pub const STRIDE: usize = 8;
/// Cells across and down.
pub const CELLS: [usize; 2] = [WIDTH / STRIDE, HEIGHT / STRIDE];

/// Numbers of a block: three channels of colour, or of depth.
pub(super) const BLOCK_VALUES: usize = 3 * BLOCK * BLOCK;

/// Depth of an image without any, metres.
const COMMON_DEPTH_M: f32 = 0.5;

/// A frame as the network's camera would show it, by the nearest pixel; what lies beyond the
/// frame's border is unseen.
pub(super) fn of_frame(frame: &Frame) -> RgbdImage {
    RgbdImage::of_pixels(frame.rgb(), frame.depth_m(), sources(frame))
}

/// The place of each cell of an image, row by row: its middle, and the median depth of its pixels,
/// or, if they have none, of the whole image.
pub fn anchors(image: &RgbdImage) -> Vec<Anchor> {
    let all = median(image.depth_m.clone()).unwrap_or(COMMON_DEPTH_M);
    let [across, down] = CELLS;
    let mut anchors = Vec::with_capacity(across * down);
    for cell in 0..across * down {
        let [left, top] = [cell % across * STRIDE, cell / across * STRIDE];
        let rows = (top..top + STRIDE).map(|row| row * WIDTH + left);
        let depths = rows.flat_map(|start| &image.depth_m[start..start + STRIDE]);
        let depth = median(depths.copied().collect()).unwrap_or(all);
        anchors.push(Anchor {
            pixel: [left, top].map(|first| first as f64 + (STRIDE - 1) as f64 / 2.0),
            depth_m: f64::from(depth),
        });
    }
    anchors
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

    fn image(depth_m: f32) -> RgbdImage {
        RgbdImage {
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
        let image = of_frame(&frame);
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
        let image = of_frame(&frame.unwrap());
        let seen = image.depth_m.iter().filter(|d| !d.is_nan()).count();
        assert_eq!(seen, 160 * 120);
        assert_eq!(image.rgb[0], [127; 3]);
        assert_eq!(image.rgb[120 * WIDTH + 160], [9; 3]);
    }

    #[test]
    fn anchors_by_hand() {
        let mut image = image(0.7);
        // The second cell: half its pixels nearer, and one without depth.
        for row in 0..8 {
            image.depth_m[row * WIDTH + 8..row * WIDTH + 12].fill(0.5);
        }
        image.depth_m[12] = f32::NAN;
        let anchors = anchors(&image);
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
    }

    #[test]
    fn without_any_depth_the_places_are_at_a_common_one() {
        let image = image(f32::NAN);
        assert!(anchors(&image).iter().all(|a| a.depth_m == 0.5));
    }
}
