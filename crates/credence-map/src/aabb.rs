use credence_types::{InvalidInput, Point};
use nalgebra::Vector3;

use crate::MapError;

/// An axis-aligned box in the world with a volume above zero.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Aabb {
    min: Point,
    max: Point,
}

impl Aabb {
    /// The box between two corners, metres.
    ///
    /// # Errors
    /// A corner that is not finite, a lower corner that is not below the upper one on every axis.
    pub fn new(min: Point, max: Point) -> Result<Self, MapError> {
        for (name, corner) in [("box_min", &min), ("box_max", &max)] {
            if !corner.iter().all(|c| c.is_finite()) {
                return Err(InvalidInput::NonFinitePoint { name, index: 0 }.into());
            }
        }
        if (0..3).any(|axis| min[axis] >= max[axis]) {
            return Err(MapError::EmptyBox {
                min: min.into(),
                max: max.into(),
            });
        }
        Ok(Self { min, max })
    }

    pub(crate) fn around(centre: Point, half: Vector3<f64>) -> Self {
        Self {
            min: centre - half,
            max: centre + half,
        }
    }

    /// Lower corner, metres.
    pub const fn min(&self) -> &Point {
        &self.min
    }

    /// Upper corner, metres.
    pub const fn max(&self) -> &Point {
        &self.max
    }

    /// Whether a point lies in the box or on its surface.
    pub fn contains(&self, point: &Point) -> bool {
        (0..3).all(|axis| (self.min[axis]..=self.max[axis]).contains(&point[axis]))
    }

    /// Whether the boxes share volume; touching does not count.
    pub fn overlaps(&self, other: &Self) -> bool {
        (0..3).all(|axis| self.min[axis] < other.max[axis] && other.min[axis] < self.max[axis])
    }

    /// The shared part of two overlapping boxes.
    pub(crate) fn intersection(&self, other: &Self) -> Self {
        Self {
            min: self.min.sup(&other.min),
            max: self.max.inf(&other.max),
        }
    }

    pub(crate) fn edges(&self) -> Vector3<f64> {
        self.max - self.min
    }

    pub(crate) fn volume(&self) -> f64 {
        self.edges().product()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cube(min: f64, max: f64) -> Aabb {
        Aabb::new(Point::new(min, min, min), Point::new(max, max, max)).unwrap()
    }

    #[test]
    fn touching_boxes_share_no_volume() {
        assert!(!cube(0.0, 1.0).overlaps(&cube(1.0, 2.0)));
        assert!(cube(0.0, 1.0).overlaps(&cube(0.5, 2.0)));
        assert_eq!(cube(0.0, 1.0).intersection(&cube(0.5, 2.0)), cube(0.5, 1.0));
        assert!(cube(0.0, 1.0).contains(&Point::new(1.0, 0.0, 0.5)));
        assert_eq!(cube(-1.0, 1.0).volume(), 8.0);
    }

    #[test]
    fn refuses_boxes_without_volume() {
        let corner = Point::new(0.0, 1.0, 0.0);
        let error = Aabb::new(corner, Point::new(1.0, 1.0, 1.0)).unwrap_err();
        assert!(error.to_string().contains("has no volume"), "{error}");
        let error = Aabb::new(corner, Point::new(1.0, f64::NAN, 1.0)).unwrap_err();
        assert!(
            error.to_string().contains("box_max[0] is not finite"),
            "{error}"
        );
    }
}
