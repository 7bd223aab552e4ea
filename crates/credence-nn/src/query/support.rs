use crate::{NnError, knn::Neighbours};

/// Object points of the subset that the global code is made from.
pub const SUBSET_OBJECT: usize = 512;

/// Free points of that subset.
pub const SUBSET_FREE: usize = 256;

/// Observed object points next to a query that the network looks at.
pub(super) const NEAR_OBJECT: usize = 8;

/// Free points next to a query that the network looks at.
pub(super) const NEAR_FREE: usize = 4;

/// Units of the frame that coordinates are held within: 1 m from the origin.
pub const REACH: f32 = 10.0;

/// An observation's points in the object's frame, ready to be searched.
pub struct Support {
    object: Vec<[f32; 3]>,
    free: Vec<[f32; 3]>,
    near_object: Neighbours,
    near_free: Neighbours,
}

impl Support {
    /// Takes points in the object's frame, in random order: a prefix is the random subset.
    ///
    /// Points beyond 1 m are drawn in to it. Fewer points than the neighbours that the network
    /// looks at are repeated.
    ///
    /// # Errors
    /// No object points, no free points, or a coordinate that is not finite.
    pub fn new(object: Vec<[f32; 3]>, free: Vec<[f32; 3]>) -> Result<Self, NnError> {
        if object.is_empty() {
            return Err(NnError::NoPoints {
                name: "object",
                remedy: "ask about an object only once it has been seen",
            });
        }
        if free.is_empty() {
            return Err(NnError::NoPoints {
                name: "free",
                remedy: "sample them where the camera's rays passed around the object",
            });
        }
        let object = at_least(NEAR_OBJECT, object);
        let free = at_least(NEAR_FREE, free);
        Ok(Self {
            near_object: Neighbours::new(&object)?,
            near_free: Neighbours::new(&free)?,
            object,
            free,
        })
    }

    /// Points in all, the object's first.
    pub(super) fn len(&self) -> usize {
        self.object.len() + self.free.len()
    }

    /// Rows for the network: coordinates and 1 for an object point, 0 for a free one.
    pub(super) fn rows(&self) -> impl Iterator<Item = [f32; 4]> {
        let flagged = |flag: f32| move |&[x, y, z]: &[f32; 3]| [x, y, z, flag];
        let object = self.object.iter().map(flagged(1.0));
        object.chain(self.free.iter().map(flagged(0.0)))
    }

    /// Rows of the object's part of the subset, over again where there are fewer points.
    pub(super) fn object_subset(&self) -> impl Iterator<Item = usize> {
        (0..self.object.len()).cycle().take(SUBSET_OBJECT)
    }

    /// Rows of the free points' part of the subset.
    pub(super) fn free_subset(&self) -> impl Iterator<Item = usize> {
        (self.object.len()..self.len()).cycle().take(SUBSET_FREE)
    }

    /// The nearest object and free points of each query.
    pub(super) fn near(&self, queries: &[[f32; 3]]) -> Result<[Near<'_>; 2], NnError> {
        Ok([
            Near {
                points: &self.object,
                first_row: 0,
                count: NEAR_OBJECT,
                indices: self.near_object.nearest(queries, NEAR_OBJECT)?,
            },
            Near {
                points: &self.free,
                first_row: self.object.len(),
                count: NEAR_FREE,
                indices: self.near_free.nearest(queries, NEAR_FREE)?,
            },
        ])
    }
}

/// The nearest points of one kind.
pub(super) struct Near<'a> {
    /// All points of the kind.
    pub(super) points: &'a [[f32; 3]],
    /// Row of the first of them among the support's rows.
    pub(super) first_row: usize,
    /// Neighbours of a query.
    pub(super) count: usize,
    /// `count` indices into `points` for each query.
    pub(super) indices: Vec<u32>,
}

/// The points within reach, repeated until there are `count`.
fn at_least(count: usize, points: Vec<[f32; 3]>) -> Vec<[f32; 3]> {
    let total = points.len().max(count);
    let near = points.into_iter().map(within_reach).collect::<Vec<_>>();
    near.iter().copied().cycle().take(total).collect()
}

/// The point itself, or the one in its direction at the reach.
pub(super) fn within_reach(point: [f32; 3]) -> [f32; 3] {
    let norm = point
        .iter()
        .map(|c| f64::from(*c).powi(2))
        .sum::<f64>()
        .sqrt();
    if norm > f64::from(REACH) {
        point.map(|c| (f64::from(c) * f64::from(REACH) / norm) as f32)
    } else {
        point
    }
}
