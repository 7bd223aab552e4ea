use credence_types::{Category, Point};
use nalgebra::{Matrix3, Rotation3, Vector3};

use super::image::{CENTRE, FOCAL_PX};

/// Numbers that a pose is described by: rotation 9, translation 3, scale 1.
pub const POSE: usize = 13;

/// Units of the 13 numbers, so that each varies by about 1: pixels, metres, and the logarithm of
/// the scale about [`SCALE_M`].
const OFFSET_PX: f64 = 16.0;
const DEPTH_M: f64 = 0.05;
const LOG_SCALE: f64 = 0.5;
const SCALE_M: f64 = 0.2;

/// Nothing nearer to the camera than this is an object.
const NEAREST_M: f64 = 0.05;

/// Logarithms of scales beyond this, metres to millimetres, are no household objects.
const MOST_LOG_SCALE: f64 = 4.0;

/// Whether the azimuth of a category's objects can be seen.
///
/// Bottles, bowls and cans have none, or as good as none: their frame is turned towards the camera,
/// and what remains of an azimuth, as of a square bottle's, belongs to the shape.
pub const fn has_front(category: Category) -> bool {
    matches!(
        category,
        Category::Camera | Category::Laptop | Category::Mug
    )
}

/// Where an object is and how large: it takes points from the normalised object frame, where the
/// diagonal of the object's box is 1, to the camera's.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ObjectPose {
    /// A rotation, `camera_from_object`.
    pub rotation: Matrix3<f64>,
    /// Middle of the object's box in the camera frame, metres.
    pub centre_m: Vector3<f64>,
    /// Diagonal of the object's box, metres.
    pub scale_m: f64,
}

impl ObjectPose {
    /// Column and row of the projected centre in the network's camera.
    pub fn pixel(&self) -> [f64; 2] {
        let centre = self.centre_m;
        [0, 1].map(|axis| FOCAL_PX * centre[axis] / centre.z + CENTRE[axis])
    }

    /// Length of the diagonal in the image of the network's camera, pixels.
    pub fn diagonal_px(&self) -> f64 {
        FOCAL_PX * self.scale_m / self.centre_m.z
    }

    /// A point of the normalised frame, in the camera's.
    pub fn place(&self, normalised: [f32; 3]) -> Point {
        let point = Vector3::from(normalised.map(f64::from));
        (self.rotation * point * self.scale_m + self.centre_m).into()
    }
}

/// The rotation of an object without a front: up as it is, the x axis towards the camera.
pub fn facing(up: Vector3<f64>, centre_m: Vector3<f64>) -> Matrix3<f64> {
    let level = |direction: Vector3<f64>| direction - up * up.dot(&direction);
    let towards = level(-centre_m);
    // From straight above every azimuth is alike: the lower edge of the image is as good as any.
    let x = if towards.norm() > 1e-3 * centre_m.norm() {
        towards.normalize()
    } else {
        level(Vector3::y()).normalize()
    };
    Matrix3::from_columns(&[x, up.cross(&x), up])
}

/// The place in the image that a pose is told from.
///
/// The 13 numbers are not those of the camera frame but what differs from place to place least,
/// because a convolution answers alike wherever the same is seen: the rotation as it looks from
/// the place's ray, the offset of the projected centre in pixels, and the depth of the centre
/// behind the surface that is seen at the place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Anchor {
    /// Column and row in the network's camera.
    pub pixel: [f64; 2],
    /// Depth of what is seen there.
    pub depth_m: f64,
}

impl Anchor {
    /// The 13 numbers of a pose in front of the camera.
    pub fn encode(&self, pose: &ObjectPose) -> [f32; POSE] {
        let mut values = [0.0; POSE];
        let seen = self.view().transpose() * pose.rotation;
        for (slot, value) in values.iter_mut().zip(seen.iter()) {
            *slot = *value;
        }
        for (axis, pixel) in pose.pixel().into_iter().enumerate() {
            values[9 + axis] = (pixel - self.pixel[axis]) / OFFSET_PX;
        }
        values[11] = (pose.centre_m.z - self.depth_m) / DEPTH_M;
        values[12] = (pose.scale_m / SCALE_M).ln() / LOG_SCALE;
        values.map(|v| v as f32)
    }

    /// The pose of 13 numbers; the nine of the rotation are brought to the nearest rotation. `None`
    /// where they are not finite or tell of none.
    pub fn decode(&self, values: [f32; POSE]) -> Option<ObjectPose> {
        let values = values.map(f64::from);
        if !values.iter().all(|v| v.is_finite()) {
            return None;
        }
        let seen = nearest_rotation(Matrix3::from_column_slice(&values[..9]))?;
        let depth_m = (self.depth_m + DEPTH_M * values[11]).max(NEAREST_M);
        let across = |axis: usize| {
            let pixel = self.pixel[axis] + OFFSET_PX * values[9 + axis];
            (pixel - CENTRE[axis]) / FOCAL_PX * depth_m
        };
        let log_scale = (LOG_SCALE * values[12]).clamp(-MOST_LOG_SCALE, MOST_LOG_SCALE);
        Some(ObjectPose {
            rotation: self.view() * seen,
            centre_m: Vector3::new(across(0), across(1), depth_m),
            scale_m: SCALE_M * log_scale.exp(),
        })
    }

    /// The rotation that turns the optical axis into the ray of the place.
    fn view(&self) -> Matrix3<f64> {
        let [u, v] = self.pixel;
        let ray = Vector3::new((u - CENTRE[0]) / FOCAL_PX, (v - CENTRE[1]) / FOCAL_PX, 1.0);
        Rotation3::rotation_between(&Vector3::z(), &ray)
            .map_or_else(Matrix3::identity, Rotation3::into_inner)
    }
}

/// The rotation nearest to a matrix by the sum of squares: U diag(1, 1, det UV') V' of its singular
/// vectors (Arun, Huang and Blostein 1987).
fn nearest_rotation(matrix: Matrix3<f64>) -> Option<Matrix3<f64>> {
    let svd = matrix.try_svd(true, true, f64::EPSILON, 100)?;
    let (u, v_t) = (svd.u?, svd.v_t?);
    let mut signs = Vector3::repeat(1.0);
    signs[2] = (u * v_t).determinant().signum();
    Some(u * Matrix3::from_diagonal(&signs) * v_t)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn an_object_straight_ahead_by_hand() {
        let anchor = Anchor {
            pixel: CENTRE,
            depth_m: 0.5,
        };
        let pose = ObjectPose {
            rotation: Matrix3::identity(),
            centre_m: Vector3::new(0.0, 0.0, 0.55),
            scale_m: 0.2,
        };
        let mut expected = [0.0; POSE];
        (expected[0], expected[4], expected[8], expected[11]) = (1.0, 1.0, 1.0, 1.0);
        let found = anchor.encode(&pose);
        assert!(
            found
                .iter()
                .zip(expected)
                .all(|(a, b): (&f32, f32)| (a - b).abs() < 1e-6),
            "{found:?}"
        );
        let point = pose.place([0.5, 0.0, -0.25]);
        assert!((point - Point::new(0.1, 0.0, 0.5)).norm() < 1e-9);
    }

    #[test]
    fn an_object_without_a_front_faces_the_camera() {
        // The camera looks down at 45 degrees: up is (0, -1, -1) / sqrt 2 in its axes.
        let half = std::f64::consts::FRAC_1_SQRT_2;
        let up = Vector3::new(0.0, -half, -half);
        let rotation = facing(up, Vector3::new(0.0, 0.0, 1.0));
        let x = rotation.column(0);
        assert!((x - Vector3::new(0.0, half, -half)).norm() < 1e-9, "{x}");
        assert!((rotation.determinant() - 1.0).abs() < 1e-9);
        let above = facing(-Vector3::z(), Vector3::new(0.0, 0.0, 1.0));
        assert!((above.column(0) - Vector3::y()).norm() < 1e-9);
    }

    #[test]
    fn numbers_that_are_none_have_no_pose() {
        let anchor = Anchor {
            pixel: [0.0; 2],
            depth_m: 0.5,
        };
        assert_eq!(anchor.decode([f32::NAN; POSE]), None);
        let far = anchor.decode([1e30; POSE]).unwrap();
        assert!(far.scale_m < 20.0 && far.centre_m.iter().all(|c| c.is_finite()));
        // A mirror is no rotation.
        let mut mirror = [0.0; POSE];
        (mirror[0], mirror[4], mirror[8]) = (1.0, 1.0, -1.0);
        let pose = anchor.decode(mirror).unwrap();
        assert!((pose.rotation.determinant() - 1.0).abs() < 1e-9);
    }

    proptest! {
        #[test]
        fn what_is_encoded_comes_back(
            angles in [-3.0..3.0_f64, -1.5..1.5, -3.0..3.0],
            centre in [-0.3..0.3_f64, -0.3..0.3, 0.2..1.5],
            scale_m in 0.03..0.6_f64,
            pixel in [0.0..320.0_f64, 0.0..240.0],
            depth_m in 0.2..1.5_f64,
        ) {
            let pose = ObjectPose {
                rotation: Rotation3::from_euler_angles(angles[0], angles[1], angles[2]).into_inner(),
                centre_m: Vector3::from(centre),
                scale_m,
            };
            let anchor = Anchor { pixel, depth_m };
            let back = anchor.decode(anchor.encode(&pose)).unwrap();
            prop_assert!((back.rotation - pose.rotation).amax() < 1e-5);
            prop_assert!((back.centre_m - pose.centre_m).amax() < 1e-5);
            prop_assert!((back.scale_m - scale_m).abs() < 1e-5);
        }
    }
}
