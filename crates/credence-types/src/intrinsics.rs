use nalgebra::Vector3;

use crate::{InvalidInput, Point};

/// Pinhole camera without distortion.
///
/// A camera-frame point (x, y, z) falls on pixel (u, v) = (fx x/z + cx, fy y/z + cy), where (0, 0)
/// is the *centre* of the first pixel: a symmetric camera has cx = (width - 1) / 2.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Intrinsics {
    width: usize,
    height: usize,
    fx: f64,
    fy: f64,
    cx: f64,
    cy: f64,
}

impl Intrinsics {
    /// A camera of `[width, height]` pixels, focal lengths `[fx, fy]` and principal point
    /// `[cx, cy]`, all in pixels.
    ///
    /// # Errors
    /// An image without pixels, a focal length that is not positive, a value that is not finite.
    pub fn new(
        [width, height]: [usize; 2],
        [fx, fy]: [f64; 2],
        [cx, cy]: [f64; 2],
    ) -> Result<Self, InvalidInput> {
        if width == 0 || height == 0 {
            return Err(InvalidInput::EmptyImage { width, height });
        }
        if !([fx, fy, cx, cy].iter().all(|v| v.is_finite()) && fx > 0.0 && fy > 0.0) {
            return Err(InvalidInput::Intrinsics { fx, fy, cx, cy });
        }
        Ok(Self {
            width,
            height,
            fx,
            fy,
            cx,
            cy,
        })
    }

    /// Columns.
    pub const fn width(&self) -> usize {
        self.width
    }

    /// Rows.
    pub const fn height(&self) -> usize {
        self.height
    }

    /// Number of pixels.
    pub const fn pixels(&self) -> usize {
        self.width * self.height
    }

    /// Focal lengths \[fx, fy\], pixels.
    pub const fn focal_px(&self) -> [f64; 2] {
        [self.fx, self.fy]
    }

    /// Principal point \[cx, cy\], pixels.
    pub const fn centre_px(&self) -> [f64; 2] {
        [self.cx, self.cy]
    }

    /// Pixel (u, v) on which a camera-frame point falls; `None` behind the camera.
    pub fn project(&self, point_camera: &Point) -> Option<[f64; 2]> {
        let Point { coords } = point_camera;
        (coords.z > 0.0).then(|| {
            [
                self.fx * coords.x / coords.z + self.cx,
                self.fy * coords.y / coords.z + self.cy,
            ]
        })
    }

    /// Direction through pixel (u, v) in the camera frame, scaled to z = 1: multiplied by a depth
    /// it is the point seen there.
    pub fn ray(&self, u: f64, v: f64) -> Vector3<f64> {
        Vector3::new((u - self.cx) / self.fx, (v - self.cy) / self.fy, 1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixel_centres_are_integers() {
        // A 4-pixel row at focal length 2: the optical axis passes between pixels 1 and 2.
        let camera = Intrinsics::new([4, 4], [2.0, 2.0], [1.5, 1.5]).unwrap();
        assert_eq!(camera.project(&Point::new(0.0, 0.0, 1.0)), Some([1.5, 1.5]));
        assert_eq!(camera.ray(1.0, 2.0), Vector3::new(-0.25, 0.25, 1.0));
        assert_eq!(camera.project(&Point::new(0.0, 0.0, -1.0)), None);
        assert_eq!(
            (camera.focal_px(), camera.centre_px()),
            ([2.0; 2], [1.5; 2])
        );
    }

    #[test]
    fn refuses_what_is_no_camera() {
        assert_eq!(
            Intrinsics::new([0, 4], [1.0, 1.0], [0.0, 0.0]),
            Err(InvalidInput::EmptyImage {
                width: 0,
                height: 4
            })
        );
        for focal in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            let error = Intrinsics::new([4, 4], [focal, 1.0], [0.0, 0.0]).unwrap_err();
            assert!(error.to_string().contains("must be positive"), "{error}");
        }
    }
}
