use std::num::NonZeroUsize;

use credence_types::Point;
use kiddo::{ImmutableKdTree, SquaredEuclidean};
use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;

use super::{visible::visible, warp::Warp};
use crate::{CompleteError, search::tree};

/// Neighbours that a point's normal is fitted to, itself included.
const NEIGHBOURS: NonZeroUsize = NonZeroUsize::MIN.saturating_add(9);

/// Which neighbour's distance measures the spacing of points: in an even cloud one of the first
/// ring of six.
const RING: usize = 4;

/// Radius of a point's disc in spacings: discs that cover a hexagonal grid have 1 / sqrt 3.
const DISC: f64 = 0.58;

/// Queries that one task answers, at least.
const TASK: usize = 128;

/// What a point of a cloud stands for.
#[derive(Debug, Clone, Copy)]
pub(super) struct Disc {
    pub(super) centre: Point,
    /// Unit normal, either way round.
    pub(super) normal: Vector3<f64>,
    pub(super) radius_m: f64,
}

/// A cloud as a surface of discs.
#[derive(Debug, Clone)]
pub(super) struct Surface {
    pub(super) discs: Vec<Disc>,
}

/// A point's nearest place on a surface.
pub(super) struct Foot {
    /// Which disc.
    pub(super) index: usize,
    /// Unit vector along which the point is off: the normal above a disc.
    pub(super) direction: Vector3<f64>,
    /// How far it is off along that, metres, either sign.
    pub(super) offset_m: f64,
}

impl Surface {
    pub(super) fn new(points: &[Point]) -> Result<Self, CompleteError> {
        let tree = tree(points)?;
        let disc = |point: &Point| disc(&tree, points, point);
        Ok(Self {
            discs: points.par_iter().with_min_len(TASK).map(disc).collect(),
        })
    }

    /// The surface moved.
    pub(super) fn moved(&self, warp: &Warp) -> Self {
        let linear = warp.linear();
        // Normals go with the inverse transpose.
        let turned = linear.try_inverse().unwrap_or_else(Matrix3::identity);
        let discs = self.discs.iter().map(|disc| Disc {
            centre: warp.apply(&linear, &disc.centre),
            normal: turned.tr_mul(&disc.normal).normalize(),
            radius_m: disc.radius_m,
        });
        Self {
            discs: discs.collect(),
        }
    }

    /// All discs.
    pub(super) fn all(&self) -> Vec<usize> {
        (0..self.discs.len()).collect()
    }

    /// The discs that a camera at the origin sees; all if they are in such disorder that each is
    /// hidden.
    pub(super) fn seen(&self) -> Vec<usize> {
        let is_seen = visible(&self.discs);
        let seen: Vec<usize> = (0..self.discs.len()).filter(|i| is_seen[*i]).collect();
        if seen.is_empty() { self.all() } else { seen }
    }

    /// The nearest place of each query on some of the discs.
    pub(super) fn feet(
        &self,
        queries: &[Point],
        among: &[usize],
    ) -> Result<Vec<Foot>, CompleteError> {
        let centres: Vec<Point> = among
            .iter()
            .map(|index| self.discs[*index].centre)
            .collect();
        let tree = tree(&centres)?;
        let foot = |query: &Point| {
            let at: [f64; 3] = (*query).into();
            let nearest = tree.query(&at).nearest_one::<SquaredEuclidean<f64>>();
            let index = among[nearest.execute().item as usize];
            self.discs[index].foot(index, query)
        };
        Ok(queries.par_iter().with_min_len(TASK).map(foot).collect())
    }
}

impl Disc {
    fn foot(&self, index: usize, query: &Point) -> Foot {
        let offset = query - self.centre;
        let above_m = self.normal.dot(&offset);
        let within = offset - self.normal * above_m;
        let beside_m = within.norm() - self.radius_m;
        if beside_m <= 0.0 {
            return Foot {
                index,
                direction: self.normal,
                offset_m: above_m,
            };
        }
        let apart = self.normal * above_m + within.normalize() * beside_m;
        let offset_m = apart.norm();
        Foot {
            index,
            direction: apart / offset_m,
            offset_m,
        }
    }
}

/// The disc of a point, from its nearest neighbours.
fn disc(tree: &ImmutableKdTree<f64, 3>, points: &[Point], point: &Point) -> Disc {
    let at: [f64; 3] = (*point).into();
    let search = tree.query(&at);
    let near = search
        .nearest_n::<SquaredEuclidean<f64>>(NEIGHBOURS)
        .execute();
    let around: Vec<Vector3<f64>> = near
        .iter()
        .map(|other| points[other.item as usize] - point)
        .collect();
    let mean: Vector3<f64> = around.iter().sum::<Vector3<f64>>() / around.len() as f64;
    let spread = around.iter().map(|offset| {
        let apart = offset - mean;
        apart * apart.transpose()
    });
    let eigen = spread.sum::<Matrix3<f64>>().symmetric_eigen();
    let ring_m = near.get(RING).map_or(0.0, |other| other.distance.sqrt());
    Disc {
        centre: *point,
        normal: eigen.eigenvectors.column(eigen.eigenvalues.imin()).into(),
        radius_m: DISC * ring_m,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_foot_lies_on_the_disc_or_on_its_edge() {
        let disc = Disc {
            centre: Point::new(1.0, 0.0, 0.0),
            normal: Vector3::z(),
            radius_m: 2.0,
        };
        let above = disc.foot(7, &Point::new(2.0, 1.0, -3.0));
        assert_eq!(
            (above.index, above.direction, above.offset_m),
            (7, Vector3::z(), -3.0)
        );
        let beside = disc.foot(0, &Point::new(6.0, 0.0, 4.0));
        assert_eq!(beside.offset_m, 5.0);
        assert_eq!(beside.direction, Vector3::new(0.6, 0.0, 0.8));
    }

    #[test]
    fn discs_of_a_grid_lie_in_its_plane_and_cover_it() {
        let lattice = (0..100).map(|i| Point::new(f64::from(i % 10), f64::from(i / 10), 5.0));
        let surface = Surface::new(&lattice.collect::<Vec<_>>()).unwrap();
        let inner = surface.discs[44];
        assert!((inner.normal.z.abs() - 1.0).abs() < 1e-12);
        assert!((inner.radius_m - DISC).abs() < 1e-12);
        let middle = Point::new(3.5, 4.0, 5.25);
        let foot = surface.feet(&[middle], &surface.all()).unwrap();
        assert!((foot[0].offset_m.abs() - 0.25).abs() < 1e-12);
    }
}
