use credence_types::{InvalidInput, Point, stream};
use nalgebra::Vector3;
use rand::RngExt as _;

use crate::{Aabb, Leaf, MapError, OccupancyMap, nearest::Nearest};

/// Draws per sample after which a region counts as having no free space.
const DRAWS_PER_SAMPLE: usize = 1000;

/// Where and how many free-space points are drawn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FreeSampling {
    /// The box that the points lie in.
    pub within: Aabb,
    /// Number of points.
    pub count: usize,
    /// Least distance from every point to avoid, metres; the seed paper's 0.01.
    pub min_distance_m: f64,
    /// Seed of the random stream.
    pub seed: u64,
}

impl OccupancyMap {
    /// Points drawn uniformly, by volume, from the part of the box through which rays have passed
    /// (log-odds below 0) and which keeps the distance from the points to `avoid`.
    ///
    /// A function of its arguments alone: the same seed gives the same points.
    ///
    /// # Errors
    /// No or too little such space in the box, a distance that is not positive, a point to avoid that is not
    /// finite.
    pub fn sample_free(
        &self,
        sampling: &FreeSampling,
        avoid: &[Point],
    ) -> Result<Vec<Point>, MapError> {
        let &FreeSampling {
            within,
            count,
            min_distance_m,
            seed,
        } = sampling;
        if !(min_distance_m.is_finite() && min_distance_m > 0.0) {
            let name = "min_distance_m";
            let value = min_distance_m;
            return Err(MapError::NotPositive { name, value });
        }
        if let Some(index) = avoid.iter().position(|p| !p.iter().all(|c| c.is_finite())) {
            return Err(InvalidInput::NonFinitePoint {
                name: "avoid",
                index,
            }
            .into());
        }
        let avoid = Nearest::new(avoid)?;
        let mut pieces = Vec::new();
        let mut volumes = Vec::new();
        let mut total = 0.0;
        for leaf in self.leaves_within(within).filter(Leaf::is_free) {
            let piece = leaf.aabb().intersection(&within);
            // A piece that lies wholly too near would only cost draws.
            let centre = nalgebra::center(piece.min(), piece.max());
            if avoid.distance_m(&centre) + piece.edges().norm() / 2.0 < min_distance_m {
                continue;
            }
            total += piece.volume();
            pieces.push(piece);
            volumes.push(total);
        }

        let mut rng = stream(seed, "map/free-space");
        let mut points = Vec::new();
        let draws = if pieces.is_empty() {
            0
        } else {
            count.saturating_mul(DRAWS_PER_SAMPLE)
        };
        for _ in 0..draws {
            if points.len() == count {
                break;
            }
            let at = rng.random::<f64>() * total;
            let piece = pieces[volumes.partition_point(|v| *v <= at).min(pieces.len() - 1)];
            let shares = Vector3::from_fn(|_, _| rng.random::<f64>());
            let point = piece.min() + piece.edges().component_mul(&shares);
            if avoid.distance_m(&point) >= min_distance_m {
                points.push(point);
            }
        }
        if points.len() < count {
            return Err(MapError::NoFreeSpace {
                found: points.len(),
                count,
                min: (*within.min()).into(),
                max: (*within.max()).into(),
                min_distance_m,
            });
        }
        Ok(points)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Occupancy;

    /// At resolution 1, the voxels from x = 0 to x = 4 are free and the one at x = 5 is occupied.
    fn corridor() -> OccupancyMap {
        let mut map = OccupancyMap::new(1.0).unwrap();
        let sensor = Point::new(0.5, 0.5, 0.5);
        map.insert_scan(&sensor, &[Point::new(5.5, 0.5, 0.5)], None)
            .unwrap();
        map
    }

    fn sampling(min: [f64; 3], max: [f64; 3]) -> FreeSampling {
        FreeSampling {
            within: Aabb::new(min.into(), max.into()).unwrap(),
            count: 4000,
            min_distance_m: 0.25,
            seed: 7,
        }
    }

    #[test]
    fn samples_lie_in_free_voxels_of_the_box_and_keep_away() {
        let map = corridor();
        let sampling = sampling([1.5, -3.0, 0.25], [9.0, 9.0, 9.0]);
        let avoid = [Point::new(2.5, 0.5, 0.5), Point::new(4.0, 0.0, 1.0)];
        let points = map.sample_free(&sampling, &avoid).unwrap();
        assert_eq!(points.len(), 4000);
        for point in &points {
            assert_eq!(map.occupancy(point), Occupancy::Free);
            assert!(sampling.within.contains(point));
            assert!(avoid.iter().all(|a| (a - point).norm() >= 0.25));
        }
    }

    #[test]
    fn samples_are_uniform_by_volume() {
        // Of the free corridor, half a voxel and three whole ones lie in the box.
        let points = corridor()
            .sample_free(&sampling([1.5, 0.0, 0.0], [9.0, 1.0, 1.0]), &[])
            .unwrap();
        let share = |from: f64, to: f64| {
            points.iter().filter(|p| (from..to).contains(&p.x)).count() as f64 / 4000.0
        };
        assert!((share(1.5, 2.0) - 1.0 / 7.0).abs() < 0.02);
        assert!((share(2.0, 3.0) - 2.0 / 7.0).abs() < 0.03);
        assert!((share(4.0, 4.5) - 1.0 / 7.0).abs() < 0.02);
    }

    #[test]
    fn a_seed_fixes_the_points() {
        let with = |seed| {
            let sampling = FreeSampling {
                seed,
                count: 5,
                ..sampling([0.0; 3], [9.0; 3])
            };
            corridor().sample_free(&sampling, &[]).unwrap()
        };
        assert_eq!(with(1), with(1));
        assert_ne!(with(1), with(2));
    }

    #[test]
    fn says_when_there_is_no_free_space() {
        let map = corridor();
        let message = |sampling: FreeSampling, avoid: &[Point]| {
            map.sample_free(&sampling, avoid).unwrap_err().to_string()
        };
        let elsewhere = sampling([0.0, 5.0, 0.0], [9.0, 6.0, 1.0]);
        assert!(message(elsewhere, &[]).contains("insert views that look through the box"));
        let behind = sampling([5.0, 0.0, 0.0], [9.0, 1.0, 1.0]);
        assert!(message(behind, &[]).contains("found 0 of 4000 free points"));
        let near = FreeSampling {
            min_distance_m: 20.0,
            ..sampling([0.0; 3], [9.0; 3])
        };
        assert!(
            message(near, &[Point::origin()]).contains("found 0 of 4000 free points 20 m away")
        );
        // The corner that is farthest from the origin, 5.196 m, holds one draw in 2000.
        let corner = FreeSampling {
            count: 100,
            min_distance_m: 5.15,
            ..near
        };
        let error = map.sample_free(&corner, &[Point::origin()]).unwrap_err();
        assert!(
            matches!(
                error,
                MapError::NoFreeSpace {
                    found: 1..100,
                    count: 100,
                    ..
                }
            ),
            "{error}"
        );
        let zero = FreeSampling {
            min_distance_m: 0.0,
            ..near
        };
        assert!(message(zero, &[]).contains("min_distance_m is 0"));
        let nan = Point::new(0.0, f64::NAN, 0.0);
        assert!(message(near, &[nan]).contains("avoid[0] is not finite"));
        let none = FreeSampling {
            count: 0,
            ..elsewhere
        };
        assert_eq!(map.sample_free(&none, &[]), Ok(vec![]));
    }
}
