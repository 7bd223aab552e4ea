//! Which detection belongs to which object.
//!
//! 1. Every detection is compared with every object ([`Association`]).
//! 2. Detections and objects are paired one to one at the least total cost; pairs beyond the gate
//!    are not allowed.
//! 3. A paired detection is appended to its object, another one becomes a new object.
//! 4. An object without a detection is deleted once the view looks through its place: occlusion
//!    and a turned camera delete nothing.

mod assignment;
mod object;

use std::collections::BTreeMap;

use credence_types::{Instance, Point};
pub(crate) use object::Observation;
pub use object::{ObjectId, TrackedObject};

use crate::{MapError, VoxelKey, key::Grid, nearest::Nearest, scan::ScanCells};

/// How far a detection is from an object.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Association {
    /// Between the centroids of their voxels, as in the seed paper.
    ///
    /// A view shows one side of an object, so its centroid is off towards the camera: up to 5 cm
    /// for a mug seen from opposite sides or half of a 20 cm plate, while two mugs side by side
    /// are 9 to 12 cm apart.
    Centroid {
        /// Largest distance of a pair, metres.
        gate_m: f64,
    },
    /// The median distance from the detection's voxels to the object's nearest voxel.
    ///
    /// Parts that both have seen count as 0, so that it stays near 0 where a centroid shifts; the
    /// median ignores the few voxels in which two objects touch.
    Surface {
        /// Largest distance of a pair, metres.
        gate_m: f64,
    },
}

impl Default for Association {
    /// `Surface` within 4 cm: opposite halves of a mug of 8 cm are 3 cm apart, the facing halves
    /// of two mugs 12 cm apart 6 cm.
    fn default() -> Self {
        Self::Surface { gate_m: 0.04 }
    }
}

impl Association {
    const fn gate_m(self) -> f64 {
        match self {
            Self::Centroid { gate_m } | Self::Surface { gate_m } => gate_m,
        }
    }
}

/// How objects are tracked.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TrackerConfig {
    /// How far a detection is from an object. Default: the surface distance within 4 cm.
    pub association: Association,
    /// Fewest points that make a detection. Default 10: fewer hold no shape.
    pub min_points: usize,
    /// An object that a view does not show is deleted if more than this share of its voxels is
    /// free in that view: seen through. Default 0.5.
    pub delete_free_share: f64,
}

impl Default for TrackerConfig {
    fn default() -> Self {
        Self {
            association: Association::default(),
            min_points: 10,
            delete_free_share: 0.5,
        }
    }
}

impl TrackerConfig {
    pub(crate) fn check(&self) -> Result<(), MapError> {
        let value = self.association.gate_m();
        if !(value.is_finite() && value > 0.0) {
            let name = "association.gate_m";
            return Err(MapError::NotPositive { name, value });
        }
        let value = self.delete_free_share;
        if !(0.0..=1.0).contains(&value) {
            let name = "delete_free_share";
            return Err(MapError::Share { name, value });
        }
        Ok(())
    }
}

/// All objects of a map.
#[derive(Debug, Clone)]
pub(crate) struct Tracker {
    config: TrackerConfig,
    objects: BTreeMap<ObjectId, TrackedObject>,
    next_id: u32,
}

impl Tracker {
    pub(crate) const fn new(config: TrackerConfig) -> Self {
        Self {
            config,
            objects: BTreeMap::new(),
            next_id: 1,
        }
    }

    pub(crate) const fn objects(&self) -> &BTreeMap<ObjectId, TrackedObject> {
        &self.objects
    }

    /// The object of each observation; `None` where a new one must be made.
    pub(crate) fn associate(
        &self,
        grid: &Grid,
        observations: &[Observation],
    ) -> Result<Vec<Option<ObjectId>>, MapError> {
        let ids: Vec<ObjectId> = self.objects.keys().copied().collect();
        let seen: Vec<Vec<Point>> = observations
            .iter()
            .map(|o| centres(grid, &o.voxels))
            .collect();
        let mut costs = vec![Vec::with_capacity(ids.len()); observations.len()];
        for object in self.objects.values() {
            let known = centres(grid, object.voxels());
            match self.config.association {
                Association::Centroid { .. } => {
                    let centroid = object::mean(&known);
                    for (row, seen) in costs.iter_mut().zip(&seen) {
                        row.push((object::mean(seen) - centroid).norm());
                    }
                }
                Association::Surface { .. } => {
                    let nearest = Nearest::new(&known)?;
                    for (row, seen) in costs.iter_mut().zip(&seen) {
                        row.push(median(seen.iter().map(|p| nearest.distance_m(p))));
                    }
                }
            }
        }
        let gate_m = self.config.association.gate_m();
        let assigned = assignment::assign(&costs, ids.len(), gate_m);
        Ok(assigned.into_iter().map(|i| i.map(|i| ids[i])).collect())
    }

    /// Deletes the objects that the view does not show and looks through; returns their ids.
    pub(crate) fn delete_absent(
        &mut self,
        cells: &ScanCells,
        shown: &[Option<ObjectId>],
    ) -> Vec<ObjectId> {
        let absent = |object: &TrackedObject| {
            let free = object
                .voxels()
                .iter()
                .filter(|k| cells.is_free(**k))
                .count();
            !shown.contains(&Some(object.id()))
                && free as f64 > self.config.delete_free_share * object.voxels().len() as f64
        };
        let deleted: Vec<ObjectId> = self
            .objects
            .values()
            .filter(|o| absent(o))
            .map(TrackedObject::id)
            .collect();
        self.objects.retain(|id, _| !deleted.contains(id));
        deleted
    }

    /// Takes the voxels that do not stay, and their points, from all objects. An object may be
    /// left without points until its detection is appended.
    pub(crate) fn retain_voxels(&mut self, stays: impl Fn(&VoxelKey) -> bool) {
        for object in self.objects.values_mut() {
            object.retain_voxels(&stays);
        }
    }

    /// Adds an observation to its object, or to a new one.
    pub(crate) fn append(
        &mut self,
        id: Option<ObjectId>,
        instance: &Instance,
        observation: &Observation,
    ) -> ObjectId {
        let id = id.unwrap_or_else(|| {
            self.next_id += 1;
            ObjectId(self.next_id - 1)
        });
        self.objects
            .entry(id)
            .or_insert_with(|| TrackedObject::new(id))
            .append(instance, observation);
        id
    }

    /// Deletes objects of which nothing is left; returns their ids.
    pub(crate) fn delete_empty(&mut self) -> Vec<ObjectId> {
        let empty = |o: &&TrackedObject| o.voxels().is_empty();
        let deleted: Vec<ObjectId> = self
            .objects
            .values()
            .filter(empty)
            .map(TrackedObject::id)
            .collect();
        self.objects.retain(|id, _| !deleted.contains(id));
        deleted
    }
}

fn centres(grid: &Grid, voxels: &[VoxelKey]) -> Vec<Point> {
    let centre = |key: &VoxelKey| grid.centre_of(*key, crate::key::DEPTH);
    voxels.iter().map(centre).collect()
}

/// The upper median; infinite if there is no value.
fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.collect();
    values.sort_unstable_by(f64::total_cmp);
    values
        .get(values.len() / 2)
        .copied()
        .unwrap_or(f64::INFINITY)
}
