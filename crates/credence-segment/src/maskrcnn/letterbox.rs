use std::ops::Range;

use credence_nn::rgbd::{HEIGHT, RgbdImage, WIDTH};
use credence_types::Frame;

/// How a frame lies in the network's image: its upper left corner in the image's, shrunk or enlarged
/// until all of it fits.
#[derive(Debug, Clone, Copy)]
pub(super) struct Letterbox {
    width: usize,
    height: usize,
    /// Pixels of the frame per pixel of the image.
    scale: f64,
}

impl Letterbox {
    pub(super) fn of(frame: &Frame) -> Self {
        let [width, height] = [frame.intrinsics().width(), frame.intrinsics().height()];
        let scale = (width as f64 / WIDTH as f64).max(height as f64 / HEIGHT as f64);
        Self::new([width, height], scale)
    }

    pub(super) const fn new([width, height]: [usize; 2], scale: f64) -> Self {
        Self {
            width,
            height,
            scale,
        }
    }

    /// The frame as the network sees it, by its nearest pixels: of 640x480 every second one, the
    /// first among them.
    pub(super) fn image(&self, frame: &Frame) -> RgbdImage {
        let nearest = |cell: usize, size: usize| {
            let at = cell as f64 * self.scale;
            (at < size as f64).then(|| (at.round() as usize).min(size - 1))
        };
        let places = (0..WIDTH * HEIGHT).map(|pixel| {
            let column = nearest(pixel % WIDTH, self.width)?;
            Some(nearest(pixel / WIDTH, self.height)? * self.width + column)
        });
        RgbdImage::of_pixels(frame.rgb(), frame.depth_m(), places)
    }

    /// Pixels of the frame.
    pub(super) const fn size(&self) -> [usize; 2] {
        [self.width, self.height]
    }

    /// Where a pixel of the frame lies in the image, along either axis.
    pub(super) fn to_image(self, pixel: usize) -> f32 {
        (pixel as f64 / self.scale) as f32
    }

    /// The frame's pixels beyond one place in the image up to another, along an axis of `size`
    /// pixels. A place at the image's own edge, or beyond what the frame fills of it, is the frame's
    /// edge.
    pub(super) fn span(&self, from: f32, to: f32, size: usize) -> Range<usize> {
        let beyond = |place: f32| {
            let at = (f64::from(place) * self.scale).floor() + 1.0;
            (at.max(0.0) as usize).min(size)
        };
        let filled = size as f64 / self.scale;
        let end = if f64::from(to) >= filled - 0.5 {
            size
        } else {
            beyond(to)
        };
        beyond(from).min(end)..end
    }
}

#[cfg(test)]
mod tests {
    use credence_types::{Intrinsics, Pose};

    use super::*;

    fn frame(width: usize, height: usize) -> Frame {
        let camera = Intrinsics::new([width, height], [300.0; 2], [9.0; 2]).unwrap();
        let rgb =
            (0..width * height).map(|i| [(i % width % 251) as u8, (i / width % 251) as u8, 1]);
        let depth = vec![0.5; width * height];
        Frame::new(rgb.collect(), depth, camera, Pose::identity(), None).unwrap()
    }

    #[test]
    fn a_simulated_frame_gives_every_second_pixel() {
        let frame = frame(640, 480);
        let letterbox = Letterbox::of(&frame);
        let image = letterbox.image(&frame);
        assert_eq!(image.rgb[0], [0, 0, 1]);
        assert_eq!(image.rgb[WIDTH + 3], [6, 2, 1]);
        assert_eq!(
            image.rgb[WIDTH * HEIGHT - 1],
            [(638 % 251) as u8, (478 % 251) as u8, 1]
        );
        assert_eq!(letterbox.to_image(7), 3.5);
        assert_eq!(letterbox.span(-0.5, 1.2, 640), 0..3);
        assert_eq!(letterbox.span(310.2, 319.5, 640), 621..640);
        assert_eq!(letterbox.span(-9.0, -1.0, 640), 0..0);
        // Ten pixels of the image are twenty of the frame.
        assert_eq!(letterbox.span(9.5, 19.5, 640), 20..40);
    }

    #[test]
    fn a_frame_of_another_shape_fits_and_the_rest_is_unseen() {
        let frame = frame(100, 240);
        let image = Letterbox::of(&frame).image(&frame);
        let seen = image.depth_m.iter().filter(|depth| !depth.is_nan());
        assert_eq!(seen.count(), 100 * 240);
        assert_eq!(image.rgb[99], [99, 0, 1]);
        assert!(image.depth_m[100].is_nan());
    }

    #[test]
    fn the_frames_last_pixels_can_be_reached_and_none_beyond() {
        for [width, height] in [
            [1280, 720],
            [1920, 1080],
            [4096, 4096],
            [16, 16],
            [100, 240],
        ] {
            let letterbox = Letterbox::of(&frame(width, height));
            let [right, bottom] = [WIDTH as f32 - 0.5, HEIGHT as f32 - 0.5];
            assert_eq!(letterbox.span(-0.5, right, width), 0..width);
            assert_eq!(letterbox.span(-0.5, bottom, height), 0..height);
            let filled = (width as f64 / letterbox.scale) as f32;
            assert_eq!(
                letterbox.span(filled + 1.0, filled + 20.0, width),
                width..width
            );
        }
    }

    #[test]
    fn every_pixel_of_the_image_is_the_nearest_of_the_frame() {
        for [width, height] in [[424, 240], [16, 12]] {
            let frame = frame(width, height);
            let letterbox = Letterbox::of(&frame);
            let image = letterbox.image(&frame);
            let scale = letterbox.scale;
            for column in 0..WIDTH {
                let at = column as f64 * scale;
                let seen = f64::from(image.rgb[column][0]);
                let wrapped = (at.round() as usize).min(width - 1) % 251;
                assert_eq!(seen, wrapped as f64, "column {column} of {width}x{height}");
            }
        }
    }
}
