//! Nearest neighbours by a k-d tree, in an order that no rounding or thread count can change.

use std::num::NonZeroUsize;

use kiddo::{ImmutableKdTree, QueryResultItem, SquaredEuclidean};
use rayon::prelude::*;

use crate::NnError;

/// Queries that one task answers.
const CHUNK: usize = 128;

/// The `k` points nearest to each query, nearest first, ties in the order of the indices.
///
/// Row i of the result, `[i * k..(i + 1) * k]`, belongs to `queries[i]`. Points may coincide.
///
/// # Errors
/// `k` is zero or more than there are points; a coordinate is not finite.
pub fn nearest(points: &[[f32; 3]], queries: &[[f32; 3]], k: usize) -> Result<Vec<u32>, NnError> {
    Neighbours::new(points)?.nearest(queries, k)
}

/// Points that answer which of them are nearest.
pub struct Neighbours {
    /// Distinct places.
    tree: ImmutableKdTree<f64, 3>,
    /// Indices of the points, those of one place together and in order.
    indices: Vec<u32>,
    /// Where each place's indices begin; one more entry than there are places.
    starts: Vec<u32>,
}

impl Neighbours {
    /// Builds the tree over the distinct places: a tree of many equal points would be deep, and
    /// a search for the nearest of them arbitrary.
    ///
    /// # Errors
    /// No points, too many of them, or a coordinate that is not finite.
    pub fn new(points: &[[f32; 3]]) -> Result<Self, NnError> {
        finite("points", points)?;
        if points.is_empty() {
            return Err(NnError::TooFewPoints { k: 1, points: 0 });
        }
        let too_many = || NnError::TooManyPoints {
            points: points.len(),
        };
        let count = u32::try_from(points.len()).map_err(|_overflow| too_many())?;
        let mut indices: Vec<u32> = (0..count).collect();
        let place = |index: u32| points[index as usize].map(|c| f64::from(c) + 0.0);
        let order = |a: &u32, b: &u32| {
            let (p, q) = (place(*a), place(*b));
            let by_axis = (0..3).map(|axis| p[axis].total_cmp(&q[axis]));
            by_axis.fold(std::cmp::Ordering::Equal, std::cmp::Ordering::then)
        };
        indices.par_sort_unstable_by(|a, b| order(a, b).then(a.cmp(b)));
        let mut places: Vec<[f64; 3]> = Vec::with_capacity(points.len());
        let mut starts = Vec::with_capacity(points.len() + 1);
        for (rank, &index) in (0..).zip(&indices) {
            if places.last() != Some(&place(index)) {
                places.push(place(index));
                starts.push(rank);
            }
        }
        starts.push(count);
        let tree = ImmutableKdTree::new_from_slice(&places).map_err(|_overflow| too_many())?;
        Ok(Self {
            tree,
            indices,
            starts,
        })
    }

    /// Number of points.
    pub const fn len(&self) -> usize {
        self.indices.len()
    }

    /// Whether there is no point; never, since a tree of none cannot be built.
    pub const fn is_empty(&self) -> bool {
        self.indices.is_empty()
    }

    /// As the free function [`nearest`].
    ///
    /// # Errors
    /// `k` is zero or more than there are points; a query is not finite.
    pub fn nearest(&self, queries: &[[f32; 3]], k: usize) -> Result<Vec<u32>, NnError> {
        finite("queries", queries)?;
        let wanted = NonZeroUsize::new(k).ok_or(NnError::NoNeighbours)?;
        if k > self.len() {
            return Err(NnError::TooFewPoints {
                k,
                points: self.len(),
            });
        }
        let mut result = vec![0; queries.len() * k];
        result
            .par_chunks_mut(CHUNK * k)
            .zip(queries.par_chunks(CHUNK))
            .for_each(|(rows, queries)| {
                for (row, query) in rows.chunks_exact_mut(k).zip(queries) {
                    self.fill(row, query.map(f64::from), wanted);
                }
            });
        Ok(result)
    }

    /// Writes the indices nearest to one query.
    fn fill(&self, row: &mut [u32], query: [f64; 3], k: NonZeroUsize) {
        // One place more than can be needed shows whether the last one has equals at its distance.
        let search = self.tree.query(&query);
        let places = search.nearest_n::<SquaredEuclidean<f64>>(k.saturating_add(1));
        let mut places = places.execute();
        let cut = places.len() > k.get() && {
            let last = places[places.len() - 1].distance;
            places[k.get() - 1].distance == last
        };
        if cut {
            // `within` leaves out nothing at a distance below its radius.
            let radius = places[k.get() - 1].distance.next_up();
            let search = self.tree.query(&query);
            places = search.within::<SquaredEuclidean<f64>>(radius).execute();
        }
        places.sort_unstable_by(|a, b| {
            let by_distance = a.distance.total_cmp(&b.distance);
            by_distance.then(a.item.cmp(&b.item))
        });
        let mut filled = 0;
        for tied in places.chunk_by(|a, b| a.distance == b.distance) {
            let room = row.len() - filled;
            if let [place] = tied {
                let indices = self.at(place);
                let count = indices.len().min(room);
                row[filled..filled + count].copy_from_slice(&indices[..count]);
                filled += count;
            } else {
                // The first `room` of each place are enough to find the first of all.
                let firsts = tied.iter().flat_map(|place| {
                    let indices = self.at(place);
                    &indices[..indices.len().min(room)]
                });
                let mut firsts: Vec<u32> = firsts.copied().collect();
                firsts.sort_unstable();
                firsts.truncate(room);
                row[filled..filled + firsts.len()].copy_from_slice(&firsts);
                filled += firsts.len();
            }
            if filled == row.len() {
                return;
            }
        }
    }

    /// Indices of the points at a place.
    fn at(&self, place: &QueryResultItem<(), u32, f64>) -> &[u32] {
        let item = place.item as usize;
        &self.indices[self.starts[item] as usize..self.starts[item + 1] as usize]
    }
}

fn finite(name: &'static str, points: &[[f32; 3]]) -> Result<(), NnError> {
    let bad = |point: &[f32; 3]| point.iter().any(|c| !c.is_finite());
    match points.iter().position(bad) {
        Some(index) => Err(NnError::NonFinitePoint { name, index }),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn by_search_of_all(points: &[[f32; 3]], query: [f32; 3], k: usize) -> Vec<u32> {
        let distance = |p: &[f32; 3]| -> f64 {
            let square = |axis: usize| (f64::from(p[axis]) - f64::from(query[axis])).powi(2);
            square(0) + square(1) + square(2)
        };
        let mut order: Vec<(f64, u32)> = points.iter().map(distance).zip(0..).collect();
        order.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        order.into_iter().take(k).map(|(_, index)| index).collect()
    }

    #[test]
    fn sorts_by_distance_then_index() {
        let points = [[1., 0., 0.], [-1., 0., 0.], [0., 0., 0.], [1., 0., 0.]];
        let found = nearest(&points, &[[0., 0., 0.], [2., 0., 0.]], 3).unwrap();
        assert_eq!(found, [2, 0, 1, 0, 3, 2]);
    }

    #[test]
    fn equal_points_in_any_number_are_fine() {
        let points = vec![[0.25, -0.0, 0.0]; 100_000];
        let found = nearest(&points, &[[0., 0., 0.]; 1000], 8).unwrap();
        assert_eq!(found[..8], [0, 1, 2, 3, 4, 5, 6, 7]);
        assert!(found.chunks(8).all(|row| row == &found[..8]));
    }

    #[test]
    fn refuses_what_has_no_answer() {
        let message = |points: &[[f32; 3]], queries: &[[f32; 3]], k| {
            nearest(points, queries, k).unwrap_err().to_string()
        };
        let one = [[0.; 3]];
        assert_eq!(
            message(&one, &one, 2),
            "2 nearest of 1 points were asked for; pass at least 2 points"
        );
        assert!(message(&[], &one, 1).contains("1 nearest of 0 points"));
        assert!(message(&one, &one, 0).contains("k must be at least 1"));
        let nan = [[0.; 3], [0., f32::NAN, 0.]];
        assert!(message(&nan, &one, 1).starts_with("points[1] is not finite"));
        assert!(message(&one, &nan, 1).starts_with("queries[1] is not finite"));
    }

    proptest! {
        /// Coordinates on a coarse lattice, so that many points and many distances coincide.
        #[test]
        fn agrees_with_a_search_of_all(
            points in prop::collection::vec([0..5_i8, 0..5, 0..3], 1..300),
            queries in prop::collection::vec([-2..8_i8, -2..8, -2..8], 1..20),
            k in 1..20_usize,
        ) {
            let points: Vec<[f32; 3]> = points.iter().map(|p| p.map(f32::from)).collect();
            let queries: Vec<[f32; 3]> = queries.iter().map(|q| q.map(|c| f32::from(c) / 2.)).collect();
            let k = k.min(points.len());
            let found = nearest(&points, &queries, k).unwrap();
            for (row, query) in found.chunks(k).zip(&queries) {
                prop_assert_eq!(row, by_search_of_all(&points, *query, k));
            }
        }
    }
}
