use credence_types::{Frame, Instance, Point};

use crate::CompleteError;

/// The points that a frame measured on an instance, row by row, camera frame, metres: pixels of
/// its mask that have a depth.
///
/// # Errors
/// A mask that does not fit the frame.
pub fn observed_points(frame: &Frame, instance: &Instance) -> Result<Vec<Point>, CompleteError> {
    instance.check_fits(frame.intrinsics())?;
    let pixels = instance.mask().iter().enumerate();
    let points =
        pixels.filter_map(|(pixel, inside)| inside.then(|| frame.camera_point(pixel)).flatten());
    Ok(points.collect())
}

#[cfg(test)]
mod tests {
    use credence_types::{Category, Intrinsics, Pose};

    use super::*;

    /// 3 x 2 pixels, focal length 2, the optical axis through pixel (1, 0), seen from elsewhere.
    fn frame(depth_m: [f32; 6]) -> Frame {
        let intrinsics = Intrinsics::new([3, 2], [2.0, 2.0], [1.0, 0.0]).unwrap();
        let mut pose = [[0.0; 4]; 4];
        for (axis, row) in pose.iter_mut().enumerate() {
            row[axis] = 1.0;
        }
        pose[0][3] = 5.0;
        let pose = Pose::from_matrix("world_from_camera", &pose).unwrap();
        Frame::new(vec![[0; 3]; 6], depth_m.to_vec(), intrinsics, pose, None).unwrap()
    }

    fn instance(mask: Vec<bool>) -> Instance {
        Instance::certain(0, mask, Category::Mug).unwrap()
    }

    #[test]
    fn the_masks_measured_pixels_in_the_camera_frame() {
        const NONE: f32 = f32::NAN;
        let frame = frame([1.0, 2.0, NONE, NONE, 4.0, 2.0]);
        let points = observed_points(&frame, &instance(vec![true, false, true, true, true, true]));
        let expected = [[-0.5, 0.0, 1.0], [0.0, 2.0, 4.0], [1.0, 1.0, 2.0]];
        assert_eq!(points.unwrap(), expected.map(Point::from));
        let blind = instance(vec![false, false, true, true, false, false]);
        assert_eq!(observed_points(&frame, &blind).unwrap(), []);
    }

    #[test]
    fn a_mask_of_another_size_is_refused() {
        let refused = observed_points(&frame([1.0; 6]), &instance(vec![true; 4])).unwrap_err();
        assert_eq!(
            refused.to_string(),
            "mask holds 4 values; a 3 x 2 image needs 6"
        );
    }
}
