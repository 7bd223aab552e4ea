//! Searches for the nearest of some points.

use std::{cmp::Ordering, num::NonZeroUsize};

use credence_types::Point;
use kiddo::{ImmutableKdTree, SquaredEuclidean};

use crate::CompleteError;

/// A search tree over points, at least one.
pub(crate) fn tree(points: &[Point]) -> Result<ImmutableKdTree<f64, 3>, CompleteError> {
    let rows: Vec<[f64; 3]> = points.iter().map(|p| (*p).into()).collect();
    ImmutableKdTree::new_from_slice(&rows).map_err(|_overflow| CompleteError::TooManyPoints {
        count: points.len(),
    })
}

/// Indices of the points, of equal ones the first: a search tree of equal ones would be deep.
pub(crate) fn distinct(points: &[Point]) -> Vec<usize> {
    let by_place = |a: &usize, b: &usize| {
        let axes = points[*a].iter().zip(points[*b].iter());
        axes.fold(Ordering::Equal, |order, (a, b)| order.then(a.total_cmp(b)))
    };
    let mut indices: Vec<usize> = (0..points.len()).collect();
    indices.sort_by(by_place);
    indices.dedup_by(|a, b| by_place(a, b).is_eq());
    indices.sort_unstable();
    indices
}

/// Points, perhaps none, that answer how far the nearest of them is.
pub(crate) struct Nearest(Option<ImmutableKdTree<f64, 3>>);

impl Nearest {
    pub(crate) fn new(points: &[Point]) -> Result<Self, CompleteError> {
        let tree = (!points.is_empty()).then(|| tree(points)).transpose();
        tree.map(Self)
    }

    /// Whether a point is at most so far away.
    pub(crate) fn reaches(&self, point: &Point, distance_m: f64) -> bool {
        self.0.as_ref().is_some_and(|tree| {
            let at: [f64; 3] = (*point).into();
            let nearest = tree.query(&at).nearest_one::<SquaredEuclidean<f64>>();
            nearest.execute().distance <= distance_m.powi(2)
        })
    }

    /// Median distance of its points, distinct ones, to the nearest other one, metres; 0 of fewer
    /// than two.
    pub(crate) fn spacing_m(&self, points: &[Point]) -> f64 {
        let Some(tree) = &self.0 else {
            return 0.0;
        };
        let gap = |point: &Point| {
            let at: [f64; 3] = (*point).into();
            let search = tree.query(&at);
            let pair = search.nearest_n::<SquaredEuclidean<f64>>(ITSELF_AND_ANOTHER);
            let pair = pair.execute();
            pair.get(1).map_or(0.0, |other| other.distance.sqrt())
        };
        median(points.iter().map(gap).collect())
    }
}

/// How many points the nearest other one is found among.
const ITSELF_AND_ANOTHER: NonZeroUsize = NonZeroUsize::MIN.saturating_add(1);

/// The middle value, the upper of two; 0 of none.
pub(crate) fn median(mut values: Vec<f64>) -> f64 {
    values.sort_unstable_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(places: &[f64]) -> Vec<Point> {
        places.iter().map(|x| Point::new(*x, 0.0, 0.0)).collect()
    }

    #[test]
    fn of_equal_points_the_first_stays() {
        assert_eq!(distinct(&row(&[2.0, 1.0, 2.0, 3.0, 1.0])), [0, 1, 3]);
        assert!(distinct(&[]).is_empty());
    }

    #[test]
    fn spacing_is_the_median_gap_to_the_nearest_other_point() {
        let spacing_m = |points: &[Point]| Nearest::new(points).unwrap().spacing_m(points);
        // Gaps of 1, 1, 2 and 5.
        assert_eq!(spacing_m(&row(&[0.0, 1.0, 3.0, 8.0])), 2.0);
        assert_eq!(spacing_m(&row(&[4.0])), 0.0);
        assert_eq!(spacing_m(&[]), 0.0);
    }

    #[test]
    fn a_point_is_reached_from_the_distance_on_and_none_from_nothing() {
        let points = Nearest::new(&row(&[0.0, 4.0])).unwrap();
        let at = Point::new(4.0, 3.0, 0.0);
        assert!(points.reaches(&at, 3.0));
        assert!(!points.reaches(&at, 2.9));
        assert!(!Nearest::new(&[]).unwrap().reaches(&at, f64::INFINITY));
    }
}
