use credence_types::Point;
use kiddo::{ImmutableKdTree, SquaredEuclidean};
use rayon::prelude::*;

use crate::{ScoreError, truth::finite_points};

/// The distance from each point to the nearest observed point, metres.
///
/// Its negative, taken as the confidence in a decision of either kind, is the baseline that a
/// learnt confidence must beat: what lies close to the data is easy. The benchmark hands in all
/// training points, of the object and of free space, since a decision may rest on either.
///
/// # Errors
/// No observed point, a point that is not finite or beyond
/// [`MAX_COORDINATE_M`](crate::MAX_COORDINATE_M).
pub fn nearest_observation(points: &[Point], observed: &[Point]) -> Result<Vec<f64>, ScoreError> {
    let points = finite_points("points", points)?;
    let observed: Vec<[f64; 3]> = finite_points("observed", observed)?
        .into_iter()
        .map(|point| point.to_array())
        .collect();
    if observed.is_empty() {
        return Err(ScoreError::NoObservation);
    }
    let tree = ImmutableKdTree::new_from_slice(&observed).map_err(|error| {
        ScoreError::ObservationIndex {
            why: error.to_string(),
        }
    })?;
    Ok(points
        .par_iter()
        .with_min_len(512)
        .map(|point| {
            tree.query(&point.to_array())
                .nearest_one::<SquaredEuclidean<f64>>()
                .execute()
                .distance
                .sqrt()
        })
        .collect())
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn measures_to_the_closest_observation() {
        let observed = [Point::new(0.0, 0.0, 0.0), Point::new(1.0, 0.0, 0.0)];
        let points = [Point::new(0.0, 3.0, 4.0), Point::new(1.5, 0.0, 0.0)];
        assert_eq!(nearest_observation(&points, &observed), Ok(vec![5.0, 0.5]));
        assert_eq!(nearest_observation(&[], &observed), Ok(vec![]));
    }

    #[test]
    fn refuses_nothing_observed_and_broken_points() {
        let point = Point::origin();
        let message = |points: &[Point], observed: &[Point]| {
            nearest_observation(points, observed)
                .unwrap_err()
                .to_string()
        };
        assert!(message(&[point], &[]).contains("observed holds no point"));
        let nan = Point::new(0.0, f64::NAN, 0.0);
        assert!(message(&[point, nan], &[point]).contains("points[1]"));
        assert!(message(&[point], &[nan]).contains("observed[0]"));
    }

    proptest! {
        // A coarse grid gives many equal coordinates and duplicates, as depth images do.
        #[test]
        fn agrees_with_every_pair(
            observed in prop::collection::vec(prop::array::uniform3(-4_i32..4), 1..400),
            points in prop::collection::vec(prop::array::uniform3(-5.0..5.0_f64), 1..20),
        ) {
            let observed: Vec<Point> = observed
                .into_iter()
                .map(|cell| Point::from(cell.map(f64::from)))
                .collect();
            let points: Vec<Point> = points.into_iter().map(Point::from).collect();
            let found = nearest_observation(&points, &observed).unwrap();
            for (point, found) in points.iter().zip(found) {
                let expected = observed
                    .iter()
                    .map(|o| (o - point).norm())
                    .fold(f64::INFINITY, f64::min);
                prop_assert!((found - expected).abs() <= 1e-12);
            }
        }
    }
}
