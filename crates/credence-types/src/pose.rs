use nalgebra::{IsometryMatrix3, Matrix3, Rotation3, Translation3, Vector3};

use crate::{InvalidInput, Point};

/// Largest deviation of a rotation's entries from orthonormality that still counts as rounding.
const RIGID_TOLERANCE: f64 = 1e-5;

/// A rigid transform, named `target_from_source`: it maps source coordinates to target ones.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose(IsometryMatrix3<f64>);

impl Pose {
    /// Reads the 4x4 row-major matrix called `name`.
    ///
    /// # Errors
    /// A matrix that is not finite, not orthonormal to 1e-5, mirrored, or whose last row is not
    /// (0, 0, 0, 1).
    pub fn from_matrix(name: &str, rows: &[[f64; 4]; 4]) -> Result<Self, InvalidInput> {
        let refuse = |why: String| InvalidInput::Pose {
            name: name.to_owned(),
            why,
        };
        if let Some(value) = rows.iter().flatten().find(|v| !v.is_finite()) {
            return Err(refuse(format!("it holds {value}")));
        }
        if rows[3] != [0.0, 0.0, 0.0, 1.0] {
            return Err(refuse(format!("its last row is {:?}", rows[3])));
        }
        let rotation = Matrix3::from_fn(|r, c| rows[r][c]);
        let deviation = (rotation.transpose() * rotation - Matrix3::identity()).amax();
        if deviation > RIGID_TOLERANCE {
            return Err(refuse(format!(
                "its rotation is off orthonormal by {deviation:.2e}"
            )));
        }
        if rotation.determinant() < 0.0 {
            return Err(refuse("its rotation mirrors (determinant -1)".to_owned()));
        }
        Ok(Self(IsometryMatrix3::from_parts(
            Translation3::new(rows[0][3], rows[1][3], rows[2][3]),
            Rotation3::from_matrix_unchecked(rotation),
        )))
    }

    /// The transform that changes nothing.
    pub fn identity() -> Self {
        Self(IsometryMatrix3::identity())
    }

    /// The 4x4 row-major matrix.
    pub fn to_matrix(self) -> [[f64; 4]; 4] {
        let matrix = self.0.to_homogeneous();
        std::array::from_fn(|row| std::array::from_fn(|column| matrix[(row, column)]))
    }

    /// `source_from_target`.
    pub fn inverse(&self) -> Self {
        Self(self.0.inverse())
    }

    /// Where the source's origin lies in the target frame.
    pub fn origin(&self) -> Point {
        self.0.translation.vector.into()
    }

    /// Maps a point.
    pub fn transform_point(&self, point_source: &Point) -> Point {
        self.0.transform_point(point_source)
    }

    /// Rotates a direction.
    pub fn transform_vector(&self, vector_source: &Vector3<f64>) -> Vector3<f64> {
        self.0.rotation * vector_source
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const QUARTER_TURN_ABOUT_Z: [[f64; 4]; 4] = [
        [0.0, -1.0, 0.0, 1.0],
        [1.0, 0.0, 0.0, 2.0],
        [0.0, 0.0, 1.0, 3.0],
        [0.0, 0.0, 0.0, 1.0],
    ];

    #[test]
    fn maps_source_to_target() {
        let pose = Pose::from_matrix("world_from_camera", &QUARTER_TURN_ABOUT_Z).unwrap();
        let mapped = pose.transform_point(&Point::new(1.0, 0.0, 0.0));
        assert_eq!(mapped, Point::new(1.0, 3.0, 3.0));
        assert_eq!(
            pose.inverse().transform_point(&mapped),
            Point::new(1.0, 0.0, 0.0)
        );
        assert_eq!(pose.origin(), Point::new(1.0, 2.0, 3.0));
        assert_eq!(pose.to_matrix(), QUARTER_TURN_ABOUT_Z);
    }

    #[test]
    fn refuses_what_is_not_rigid() {
        let change = |row: usize, column: usize, value: f64| {
            let mut rows = QUARTER_TURN_ABOUT_Z;
            rows[row][column] = value;
            Pose::from_matrix("world_from_camera", &rows)
                .unwrap_err()
                .to_string()
        };
        assert!(change(0, 1, -1.1).contains("world_from_camera"));
        assert!(change(0, 1, -1.1).contains("orthonormal"));
        assert!(change(2, 2, -1.0).contains("mirrors"));
        assert!(change(0, 3, f64::NAN).contains("NaN"));
        assert!(change(3, 0, 0.5).contains("last row"));
    }
}
