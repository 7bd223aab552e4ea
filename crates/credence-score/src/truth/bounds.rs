use nalgebra::{Matrix3, SymmetricEigen, Vector3};
use parry3d_f64::{math::Vector, shape::Triangle};

/// Share of the mesh's scale by which boxes are enlarged, and of a squared distance by which it is
/// reduced: far above rounding (1e-16), far below any distance of interest.
const ROUNDING: f64 = 1e-13;

/// A box that follows the principal axes of the faces it holds.
///
/// On a smooth patch of size s and curvature k such a box is about k s^2 / 8 thick, where an
/// axis-aligned one sticks out by the order of s. A search for the nearest face therefore visits a
/// number of oriented boxes per level that does not depend on the level, but a number of
/// axis-aligned ones that grows with sqrt(faces).
#[derive(Debug, Clone, Copy)]
pub(super) struct OrientedBox {
    centre: Vector,
    axes: [Vector; 3],
    half: [f64; 3],
}

impl OrientedBox {
    /// Fits a box to faces with area. `scale` is the largest coordinate of the mesh.
    pub(super) fn fit(faces: &[Triangle], scale: f64) -> Self {
        let (mean, axes) = principal_axes(faces);
        let mut low = [f64::INFINITY; 3];
        let mut high = [f64::NEG_INFINITY; 3];
        for corner in faces.iter().flat_map(Triangle::vertices) {
            for (k, axis) in axes.iter().enumerate() {
                let along = axis.dot(*corner - mean);
                low[k] = low[k].min(along);
                high[k] = high[k].max(along);
            }
        }
        let mut centre = mean;
        let mut half = [0.0; 3];
        for k in 0..3 {
            centre += axes[k] * (0.5 * (low[k] + high[k]));
            half[k] = 0.5 * (high[k] - low[k]) + ROUNDING * scale;
        }
        Self { centre, axes, half }
    }

    /// The axis along which the box is longest.
    pub(super) fn long_axis(&self) -> Vector {
        let [a, b, c] = self.half;
        self.axes[if a >= b && a >= c {
            0
        } else if b >= c {
            1
        } else {
            2
        }]
    }

    /// A lower bound of the squared distance from a point to whatever the box holds.
    #[inline]
    pub(super) fn squared_distance(&self, point: Vector) -> f64 {
        let offset = point - self.centre;
        let mut sum = 0.0;
        for k in 0..3 {
            let excess = (self.axes[k].dot(offset).abs() - self.half[k]).max(0.0);
            sum += excess * excess;
        }
        sum * (1.0 - ROUNDING)
    }
}

/// Mean and principal axes of the corners, each weighted by the area of its face.
fn principal_axes(faces: &[Triangle]) -> (Vector, [Vector; 3]) {
    let area = |face: &Triangle| (face.b - face.a).cross(face.c - face.a).length();
    let mut weight = 0.0;
    let mut sum = Vector::ZERO;
    for face in faces {
        let area = area(face);
        weight += 3.0 * area;
        sum += (face.a + face.b + face.c) * area;
    }
    let mean = sum / weight;
    let mut covariance = Matrix3::zeros();
    for face in faces {
        let area = area(face) / weight;
        for corner in face.vertices() {
            let offset = Vector3::from((*corner - mean).to_array());
            covariance += offset * offset.transpose() * area;
        }
    }
    let eigenvectors = SymmetricEigen::new(covariance).eigenvectors;
    let axis = |k: usize| {
        let column = eigenvectors.column(k);
        Vector::new(column[0], column[1], column[2])
    };
    (mean, [axis(0), axis(1), axis(2)])
}
