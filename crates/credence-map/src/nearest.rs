use credence_types::Point;
use kiddo::{ImmutableKdTree, SquaredEuclidean};

use crate::MapError;

/// Points that answer how far the nearest of them is.
pub(crate) struct Nearest(Option<ImmutableKdTree<f64, 3>>);

impl Nearest {
    pub(crate) fn new(points: &[Point]) -> Result<Self, MapError> {
        if points.is_empty() {
            return Ok(Self(None));
        }
        let rows: Vec<[f64; 3]> = points.iter().map(|p| (*p).into()).collect();
        let tree = ImmutableKdTree::new_from_slice(&rows);
        tree.map(|tree| Self(Some(tree)))
            .map_err(|_overflow| MapError::TooManyPoints {
                count: points.len(),
            })
    }

    /// Distance to the nearest point, metres; infinite if there is none.
    pub(crate) fn distance_m(&self, query: &Point) -> f64 {
        self.0.as_ref().map_or(f64::INFINITY, |tree| {
            let query: [f64; 3] = (*query).into();
            let nearest = tree.query(&query).nearest_one::<SquaredEuclidean<f64>>();
            nearest.execute().distance.sqrt()
        })
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn nothing_is_near_without_points() {
        let nearest = Nearest::new(&[]).unwrap();
        assert_eq!(nearest.distance_m(&Point::origin()), f64::INFINITY);
    }

    proptest! {
        /// Coordinates on a coarse lattice, so that many coincide, as those of a voxel grid do.
        #[test]
        fn agrees_with_a_search_of_all(
            points in prop::collection::vec([0..4_i32, 0..4, 0..2], 1..300),
            query: [i8; 3],
        ) {
            let points: Vec<Point> =
                points.into_iter().map(|p| Point::from(p.map(f64::from))).collect();
            let query = Point::from(query.map(|c| f64::from(c) / 20.0));
            let expected = points.iter().map(|p| (p - query).norm()).fold(f64::INFINITY, f64::min);
            let distance_m = Nearest::new(&points).unwrap().distance_m(&query);
            prop_assert!((distance_m - expected).abs() < 1e-12);
        }
    }
}
