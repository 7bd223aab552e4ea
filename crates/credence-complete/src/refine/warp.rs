use credence_types::Point;
use nalgebra::{Matrix2, Matrix3, SMatrix, SVector, Vector3};

/// Number of parameters.
const PARAMETERS: usize = 8;

pub(super) type Parameters = SVector<f64, PARAMETERS>;
pub(super) type Information = SMatrix<f64, PARAMETERS, PARAMETERS>;
/// How a point moves with the parameters.
pub(super) type Jacobian = SMatrix<f64, 3, PARAMETERS>;

/// Largest logarithm of a scale: ln 1.4.
const MOST_LOG_SCALE: f64 = 0.336;

/// How far each parameter is expected from 0 where the completion lies [`OFF_M`] beside what was
/// observed. Stretches that make what is round oval are the least likely, and the data say little
/// about them from one side.
const EXPECTED: [f64; PARAMETERS] = [0.03, 0.03, 0.03, 0.3, 0.15, 0.15, 0.05, 0.05];

/// Which parameter is the angle.
const ANGLE: usize = 3;

/// Mean distance of the observed points from a completion that is as wrong as [`EXPECTED`], metres.
const OFF_M: f64 = 0.004;

/// Least share of it that is expected: keeps the prior finite.
const LEAST_SHARE: f64 = 1e-3;

/// A motion that keeps what is upright upright: y = c + t + R S (x - c), coordinates with z up.
///
/// The parameters are t (3), the angle of the rotation R about the vertical, and the logarithms of
/// the scales S = (exp E, exp v), E = \[\[h + a, b\], \[b, h - a\]\]: v vertical, h of the horizontal area, a and
/// b of the horizontal stretch, whose axes are free.
#[derive(Debug, Clone, Copy)]
pub(super) struct Warp {
    pub(super) parameters: Parameters,
    centre: Vector3<f64>,
    /// Share of [`EXPECTED`] that the parameters are expected to reach, but for the angle: a wrong
    /// one shows in little more than a handle.
    share: f64,
}

impl Warp {
    /// The identity, with scales and rotation about `centre`, for a completion that lies
    /// `residual_m` beside what was observed: the better it fits, the less it is to be changed, for
    /// what noise there is would be fitted at the expense of the unseen.
    pub(super) fn identity(centre: Vector3<f64>, residual_m: f64) -> Self {
        Self {
            parameters: Parameters::zeros(),
            centre,
            share: (residual_m / OFF_M).clamp(LEAST_SHARE, 1.0),
        }
    }

    /// The parameters `step` away, within the bounds of the scales.
    pub(super) fn moved(&self, step: &Parameters) -> Self {
        let mut parameters = self.parameters + step;
        let limit = |value: f64, most: f64| value.clamp(-most, most);
        parameters[4] = limit(parameters[4], MOST_LOG_SCALE);
        let stretch = parameters[6].hypot(parameters[7]);
        if stretch > MOST_LOG_SCALE {
            parameters[6] *= MOST_LOG_SCALE / stretch;
            parameters[7] *= MOST_LOG_SCALE / stretch;
        }
        let left = (MOST_LOG_SCALE - stretch).max(0.0);
        parameters[5] = limit(parameters[5], left);
        Self {
            parameters,
            ..*self
        }
    }

    /// Precision of the prior, and its gradient at these parameters.
    pub(super) fn prior(&self) -> (Information, Parameters) {
        let share = |i: usize| if i == ANGLE { 1.0 } else { self.share };
        let precision = Parameters::from_fn(|i, _| (share(i) * EXPECTED[i]).powi(-2));
        let pull = precision.component_mul(&self.parameters);
        (Information::from_diagonal(&precision), pull)
    }

    fn translation(&self) -> Vector3<f64> {
        self.parameters.fixed_rows::<3>(0).into()
    }

    fn rotation(&self) -> Matrix3<f64> {
        let (sin, cos) = self.parameters[ANGLE].sin_cos();
        Matrix3::new(cos, -sin, 0.0, sin, cos, 0.0, 0.0, 0.0, 1.0)
    }

    /// S: the exponential of a symmetric 2 x 2 matrix is e^h (cosh m + sinh m / m (a, b; b, -a)),
    /// m = |(a, b)|.
    fn scale(&self) -> Matrix3<f64> {
        let [v, h, a, b] = [4, 5, 6, 7].map(|i| self.parameters[i]);
        let m = a.hypot(b);
        let ratio = if m > 1e-9 { m.sinh() / m } else { 1.0 };
        let plane = (Matrix2::identity() * m.cosh() + Matrix2::new(a, b, b, -a) * ratio) * h.exp();
        let mut scale = Matrix3::identity() * v.exp();
        scale.fixed_view_mut::<2, 2>(0, 0).copy_from(&plane);
        scale
    }

    /// R S, which maps offsets from the centre.
    pub(super) fn linear(&self) -> Matrix3<f64> {
        self.rotation() * self.scale()
    }

    pub(super) fn apply(&self, linear: &Matrix3<f64>, point: &Point) -> Point {
        (self.centre + self.translation() + linear * (point.coords - self.centre)).into()
    }

    /// What a Jacobian is made of, the same for all points.
    pub(super) fn tangents(&self) -> Tangents {
        let (rotation, scale) = (self.rotation(), self.scale());
        let generators = [
            Matrix3::from_diagonal(&Vector3::z()),
            Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, 0.0)),
            Matrix3::from_diagonal(&Vector3::new(1.0, -1.0, 0.0)),
            Matrix3::new(0.0, 1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0),
        ];
        Tangents {
            centre: self.centre,
            turn: Vector3::<f64>::z().cross_matrix() * rotation * scale,
            // The derivative of exp E along G, to first order in E.
            stretches: generators.map(|g| rotation * (g * scale + scale * g) / 2.0),
        }
    }
}

/// Derivatives of [`Warp::linear`] by the angle and the scales.
pub(super) struct Tangents {
    centre: Vector3<f64>,
    turn: Matrix3<f64>,
    stretches: [Matrix3<f64>; 4],
}

impl Tangents {
    /// How the image of `point` moves with the parameters.
    pub(super) fn at(&self, point: &Point) -> Jacobian {
        let offset = point.coords - self.centre;
        let mut jacobian = Jacobian::zeros();
        jacobian.fixed_view_mut::<3, 3>(0, 0).fill_with_identity();
        jacobian.set_column(ANGLE, &(self.turn * offset));
        for (column, stretch) in (4..).zip(&self.stretches) {
            jacobian.set_column(column, &(stretch * offset));
        }
        jacobian
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(parameters: [f64; PARAMETERS]) -> Warp {
        let identity = Warp::identity(Vector3::new(1.0, 2.0, 3.0), OFF_M);
        identity.moved(&Parameters::from(parameters))
    }

    fn image(warp: &Warp, point: [f64; 3]) -> Vector3<f64> {
        warp.apply(&warp.linear(), &Point::from(point)).coords
    }

    #[test]
    fn turns_and_stretches_about_the_centre() {
        let close = |warp, point, expected: [f64; 3]| {
            let image = image(&warp, point);
            assert!((image - Vector3::from(expected)).norm() < 1e-12, "{image}");
        };
        let quarter = std::f64::consts::FRAC_PI_2;
        close(at([0.0; 8]), [9.0, 8.0, 7.0], [9.0, 8.0, 7.0]);
        close(
            at([0.5, 0.0, -0.5, quarter, 0.0, 0.0, 0.0, 0.0]),
            [2.0, 2.0, 3.0],
            [1.5, 3.0, 2.5],
        );
        let (up, wide) = (1.1_f64.ln(), 1.2_f64.ln());
        close(
            at([0.0, 0.0, 0.0, 0.0, up, wide / 2.0, wide / 2.0, 0.0]),
            [2.0, 3.0, 4.0],
            [2.2, 3.0, 4.1],
        );
        // Stretched along the diagonal by 1.2 and across it not at all.
        close(
            at([0.0, 0.0, 0.0, 0.0, 0.0, wide / 2.0, 0.0, wide / 2.0]),
            [2.0, 3.0, 3.0],
            [2.2, 3.2, 3.0],
        );
    }

    #[test]
    fn scales_stay_within_their_bounds() {
        let most = MOST_LOG_SCALE.exp();
        for parameters in [
            [0.0, 0.0, 0.0, 0.0, 9.0, 9.0, 0.0, 0.0],
            [0.0, 0.0, 0.0, 0.0, -9.0, -9.0, 0.3, 0.0],
            [0.0, 0.0, 0.0, 0.0, 0.0, 0.1, 3.0, 4.0],
        ] {
            let scales = at(parameters).scale().symmetric_eigenvalues();
            for scale in &scales {
                let within = (1.0 / most - 1e-9..=most + 1e-9).contains(scale);
                assert!(within, "{scales}");
            }
        }
    }

    #[test]
    fn the_jacobian_is_that_of_finite_differences() {
        let parameters = [0.01, -0.02, 0.03, 0.4, 0.05, -0.04, 0.01, -0.02];
        let point = [1.3, 1.6, 3.4];
        let jacobian = at(parameters).tangents().at(&Point::from(point));
        for column in 0..PARAMETERS {
            let shifted = |by: f64| {
                let mut parameters = parameters;
                parameters[column] += by;
                image(&at(parameters), point)
            };
            let slope = (shifted(1e-6) - shifted(-1e-6)) / 2e-6;
            // First order in the stretch: its square, 5e-4, is left out.
            let apart = (slope - jacobian.column(column)).norm();
            assert!(apart < 1e-3, "{column}: {apart}");
        }
    }
}
