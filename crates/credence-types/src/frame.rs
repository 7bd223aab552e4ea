use std::collections::BTreeMap;

use crate::{Category, Intrinsics, InvalidInput, Point, Pose};

/// What a simulator or an annotator knows of a frame. Only the oracle segmenter reads it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FrameTruth {
    /// Instance id per pixel, row-major; 0 is background.
    pub instance_ids: Vec<u16>,
    /// Category of each instance id.
    pub categories: BTreeMap<u16, Category>,
}

/// One RGB-D view with a known camera pose. Colour and depth share one pixel grid.
#[derive(Debug, Clone, PartialEq)]
pub struct Frame {
    rgb: Vec<[u8; 3]>,
    depth_m: Vec<f32>,
    intrinsics: Intrinsics,
    world_from_camera: Pose,
    truth: Option<FrameTruth>,
}

impl Frame {
    /// A frame of row-major images.
    ///
    /// `depth_m` is the distance along the optical axis in metres, NaN where nothing was measured.
    ///
    /// # Errors
    /// A buffer whose length does not fit the intrinsics, a depth that is zero, negative or
    /// infinite, a depth image without one measurement, an instance id without a category.
    pub fn new(
        rgb: Vec<[u8; 3]>,
        depth_m: Vec<f32>,
        intrinsics: Intrinsics,
        world_from_camera: Pose,
        truth: Option<FrameTruth>,
    ) -> Result<Self, InvalidInput> {
        let fits = |name, found| {
            if found == intrinsics.pixels() {
                return Ok(());
            }
            Err(InvalidInput::BufferLength {
                name,
                found,
                expected: intrinsics.pixels(),
                width: intrinsics.width(),
                height: intrinsics.height(),
            })
        };
        fits("rgb", rgb.len())?;
        fits("depth_m", depth_m.len())?;
        let bad = |d: &f32| !(d.is_nan() || (d.is_finite() && *d > 0.0));
        if let Some(i) = depth_m.iter().position(bad) {
            return Err(InvalidInput::Depth {
                value: depth_m[i],
                column: i % intrinsics.width(),
                row: i / intrinsics.width(),
            });
        }
        if depth_m.iter().all(|d| d.is_nan()) {
            return Err(InvalidInput::NoDepth);
        }
        if let Some(truth) = &truth {
            fits("instance_ids", truth.instance_ids.len())?;
            let unknown = |id: &&u16| **id != 0 && !truth.categories.contains_key(id);
            if let Some(&id) = truth.instance_ids.iter().find(unknown) {
                return Err(InvalidInput::UnknownInstance { id });
            }
        }
        Ok(Self {
            rgb,
            depth_m,
            intrinsics,
            world_from_camera,
            truth,
        })
    }

    /// Colour per pixel.
    pub fn rgb(&self) -> &[[u8; 3]] {
        &self.rgb
    }

    /// Depth per pixel in metres; NaN where nothing was measured.
    pub fn depth_m(&self) -> &[f32] {
        &self.depth_m
    }

    /// The camera.
    pub const fn intrinsics(&self) -> &Intrinsics {
        &self.intrinsics
    }

    /// The camera's pose.
    pub const fn world_from_camera(&self) -> &Pose {
        &self.world_from_camera
    }

    /// True masks, where they are known.
    pub const fn truth(&self) -> Option<&FrameTruth> {
        self.truth.as_ref()
    }

    /// The world point seen at pixel `index` (row-major); `None` without a measurement.
    pub fn world_point(&self, index: usize) -> Option<Point> {
        let point = self.camera_point(index)?;
        Some(self.world_from_camera.transform_point(&point))
    }

    /// The same point in the camera frame.
    pub fn camera_point(&self, index: usize) -> Option<Point> {
        let depth_m = f64::from(self.depth_m[index]);
        if depth_m.is_nan() {
            return None;
        }
        let width = self.intrinsics.width();
        let ray = self
            .intrinsics
            .ray((index % width) as f64, (index / width) as f64);
        Some((ray * depth_m).into())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(depth_m: Vec<f32>, ids: Option<Vec<u16>>) -> Result<Frame, InvalidInput> {
        let intrinsics = Intrinsics::new([2, 1], [1.0, 1.0], [0.5, 0.0]).unwrap();
        let truth = ids.map(|instance_ids| FrameTruth {
            instance_ids,
            categories: BTreeMap::from([(1, Category::Mug)]),
        });
        Frame::new(
            vec![[0; 3]; 2],
            depth_m,
            intrinsics,
            Pose::identity(),
            truth,
        )
    }

    #[test]
    fn deprojects_pixel_centres() {
        let frame = frame(vec![2.0, f32::NAN], None).unwrap();
        assert_eq!(frame.world_point(0), Some(Point::new(-1.0, 0.0, 2.0)));
        assert_eq!(frame.world_point(1), None);
    }

    #[test]
    fn refuses_bad_images() {
        let message = |depth, ids| frame(depth, ids).unwrap_err().to_string();
        assert!(message(vec![1.0], None).contains("depth_m holds 1 values; a 2 x 1 image needs 2"));
        assert!(message(vec![1.0, 0.0], None).contains("depth_m is 0 at pixel (1, 0)"));
        assert!(message(vec![1.0, f32::INFINITY], None).contains("inf at pixel (1, 0)"));
        assert!(message(vec![f32::NAN; 2], None).contains("no valid pixel"));
        assert!(message(vec![1.0; 2], Some(vec![1, 9])).contains("instance id 9"));
        assert!(message(vec![1.0; 2], Some(vec![1])).contains("instance_ids holds 1"));
    }
}
