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

    /// The frame as the network sees it, by its pixels: of 640x480 every second one, the first
    /// among them.
    pub(super) fn image(&self, frame: &Frame) -> RgbdImage {
        let places = (0..WIDTH * HEIGHT).map(|pixel| {
            let at = |cell: usize| (cell as f64 * self.scale) as usize;
            let [column, row] = [at(pixel % WIDTH), at(pixel / WIDTH)];
            (column < self.width && row < self.height).then_some(row * self.width + column)
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

    /// The pixels of the frame from one place in the image to another, along an axis of `size`
    /// pixels.
    pub(super) fn span(&self, from: f32, to: f32, size: usize) -> std::ops::Range<usize> {
        let start = (f64::from(from) * self.scale).ceil().max(0.0) as usize;
        let end = (f64::from(to) * self.scale).floor();
        let end = if end < 0.0 { 0 } else { end as usize + 1 };
        start..end.min(size)
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
}
