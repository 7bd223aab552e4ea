use crate::{InvalidInput, Point};

/// Share of the points, at each end of an axis, that the midrange leaves out as outliers.
const TRIM: f64 = 0.01;

/// The frame of an observed object: z up from the table, origin below the middle of the points,
/// x towards the viewpoint, unit 0.1 m.
///
/// The yaw is the azimuth from the points' mean to the viewpoint, and the midrange is taken along
/// the yawed axes, so that a turn of the scene about the vertical turns the frame with it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ObjectFrame {
    cos: f64,
    sin: f64,
    /// In the yawed axes, metres.
    origin: [f64; 3],
}

impl ObjectFrame {
    /// Metres per unit of the frame: a cup is about one unit wide.
    pub const UNIT_M: f64 = 0.1;

    /// The frame of an object's observed points.
    ///
    /// # Errors
    /// No points, or a coordinate, viewpoint or table height that is not finite.
    pub fn new(
        object_points_world: &[Point],
        viewpoint_world: Point,
        table_height_m: f64,
    ) -> Result<Self, InvalidInput> {
        all_finite("object", object_points_world)?;
        all_finite("viewpoint", &[viewpoint_world])?;
        if !table_height_m.is_finite() {
            return Err(InvalidInput::TableHeight {
                value: table_height_m,
            });
        }
        if object_points_world.is_empty() {
            return Err(InvalidInput::UnseenObject);
        }
        let count = object_points_world.len() as f64;
        // Each divided before the sum, which could overflow otherwise.
        let mean = |axis: usize| -> f64 {
            let shares = object_points_world.iter().map(|p| p[axis] / count);
            shares.sum()
        };
        let (x, y) = (viewpoint_world.x - mean(0), viewpoint_world.y - mean(1));
        let norm = x.hypot(y);
        // From straight above there is no azimuth; the world's x axis is as good as any.
        let (cos, sin) = if norm > 1e-9 && norm.is_finite() {
            (x / norm, y / norm)
        } else {
            (1.0, 0.0)
        };
        let midrange = |along: fn(f64, f64, &Point) -> f64| {
            let mut values: Vec<f64> = object_points_world
                .iter()
                .map(|p| along(cos, sin, p))
                .collect();
            values.sort_unstable_by(f64::total_cmp);
            let cut = (TRIM * (count - 1.0)).round() as usize;
            f64::midpoint(values[cut], values[values.len() - 1 - cut])
        };
        let origin = [midrange(yawed_x), midrange(yawed_y), table_height_m];
        Ok(Self { cos, sin, origin })
    }

    /// The frame's units to world metres.
    pub fn world_point(&self, at: [f64; 3]) -> Point {
        let [x, y, z] = [0, 1, 2].map(|axis| at[axis] * Self::UNIT_M + self.origin[axis]);
        Point::new(self.cos * x - self.sin * y, self.sin * x + self.cos * y, z)
    }

    /// World metres to the frame's units.
    pub fn locate(&self, point: &Point) -> [f64; 3] {
        [
            (yawed_x(self.cos, self.sin, point) - self.origin[0]) / Self::UNIT_M,
            (yawed_y(self.cos, self.sin, point) - self.origin[1]) / Self::UNIT_M,
            (point.z - self.origin[2]) / Self::UNIT_M,
        ]
    }
}

fn yawed_x(cos: f64, sin: f64, point: &Point) -> f64 {
    cos * point.x + sin * point.y
}

fn yawed_y(cos: f64, sin: f64, point: &Point) -> f64 {
    cos * point.y - sin * point.x
}

/// Refuses points with coordinates that are no numbers.
///
/// # Errors
/// Names the first such point.
pub fn all_finite(name: &'static str, points: &[Point]) -> Result<(), InvalidInput> {
    let bad = |point: &Point| point.iter().any(|c| !c.is_finite());
    match points.iter().position(bad) {
        Some(index) => Err(InvalidInput::NonFinitePoint { name, index }),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn points() -> Vec<Point> {
        vec![
            Point::new(0.5, 0.1, 0.02),
            Point::new(0.6, 0.1, 0.05),
            Point::new(0.55, 0.06, 0.1),
            Point::new(0.55, 0.14, 0.1),
        ]
    }

    #[test]
    fn stands_on_the_table_below_the_middle_and_looks_at_the_viewpoint() {
        // The mean is (.55, .1); the viewpoint lies along +y from there.
        let frame = ObjectFrame::new(&points(), Point::new(0.55, 1.1, 0.4), -0.01).unwrap();
        let at = frame.locate(&Point::new(0.55, 0.2, 0.09));
        let expected = [1.0, 0.0, 1.0];
        assert!(
            at.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-9),
            "{at:?}"
        );
        let left = frame.locate(&Point::new(0.45, 0.1, -0.01));
        assert!(
            (left[1] - 1.0).abs() < 1e-9 && left[2].abs() < 1e-9,
            "{left:?}"
        );
        let back = frame.world_point(left);
        assert!(
            (back - Point::new(0.45, 0.1, -0.01)).norm() < 1e-12,
            "{back}"
        );
    }

    #[test]
    fn turns_and_moves_with_the_scene() {
        let viewpoint = Point::new(0.2, 0.5, 0.4);
        let frame = ObjectFrame::new(&points(), viewpoint, 0.0).unwrap();
        let turn = nalgebra::Rotation3::from_axis_angle(&nalgebra::Vector3::z_axis(), 0.7);
        let moved = |p: &Point| turn * p + nalgebra::Vector3::new(3.0, -2.0, 0.0);
        let cloud: Vec<Point> = points().iter().map(moved).collect();
        let other = ObjectFrame::new(&cloud, moved(&viewpoint), 0.0).unwrap();
        for point in points() {
            let (a, b) = (frame.locate(&point), other.locate(&moved(&point)));
            assert!(
                a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-9),
                "{a:?} {b:?}"
            );
        }
    }

    #[test]
    fn a_viewpoint_straight_above_and_a_single_point_are_fine() {
        let one = [Point::new(1.0, 2.0, 0.05)];
        let frame = ObjectFrame::new(&one, Point::new(1.0, 2.0, 0.6), 0.0).unwrap();
        assert_eq!(frame.locate(&one[0]), [0.0, 0.0, 0.5]);
    }

    #[test]
    fn refuses_what_has_no_frame() {
        let message = |cloud: &[Point], viewpoint, table| {
            ObjectFrame::new(cloud, viewpoint, table)
                .unwrap_err()
                .to_string()
        };
        let (here, nan) = (Point::origin(), Point::new(0.0, f64::NAN, 0.0));
        assert!(message(&[], here, 0.0).contains("no object points"));
        assert!(message(&[here, nan], here, 0.0).starts_with("object[1] is not finite"));
        assert!(message(&[here], nan, 0.0).starts_with("viewpoint[0] is not finite"));
        assert!(message(&[here], here, f64::NAN).starts_with("table_height_m is NaN"));
    }
}
