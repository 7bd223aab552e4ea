//! Which detection belongs to which object.
//!
//! 1. Every detection is compared with every object ([`Association`]).
//! 2. Detections and objects are paired one to one at the least total cost; pairs beyond the gate
//!    are not allowed.
//! 3. A paired detection is appended to its object, another one becomes a new object.
//! 4. Points of an object that its other views say are none of it are left out.
//! 5. An object without a detection is deleted once the view looks through its place: occlusion
//!    and a turned camera delete nothing, nor does a detection too small to append.

mod assignment;
mod object;

use std::collections::{BTreeMap, BTreeSet};

use credence_types::{Instance, Point};
pub use object::{ObjectId, TrackedObject};
pub(crate) use object::{Observation, Sighting, class_votes};

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
    /// `Surface` within 36 mm.
    ///
    /// Measured on balls of 8 cm, each alone in its views: opposite sides of one are 35 mm apart
    /// from a camera 20 degrees above the table and 24 mm from 35 degrees; the sides of two that
    /// face each other are at least 38 mm apart where 1 cm lies between them, 43 mm where 2 cm do.
    /// Below 20 degrees the two cases overlap (38 mm both at 5 degrees): there opposite sides of
    /// one object, without a view between them, become two.
    fn default() -> Self {
        Self::Surface { gate_m: 0.036 }
    }
}

impl Association {
    /// Largest distance of a pair, metres.
    pub const fn gate_m(self) -> f64 {
        match self {
            Self::Centroid { gate_m } | Self::Surface { gate_m } => gate_m,
        }
    }
}

/// How objects are tracked.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TrackerConfig {
    /// How far a detection is from an object. Default: the surface distance within 36 mm.
    pub association: Association,
    /// Fewest points that make a detection. Default 10: fewer hold no shape, and only tell that an
    /// object within the gate is still there.
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
        let seen: Vec<&[VoxelKey]> = observations.iter().map(|o| &*o.voxels).collect();
        let costs = self.costs(grid, &seen)?;
        let gate_m = self.config.association.gate_m();
        let assigned = assignment::assign(&costs, ids.len(), gate_m);
        Ok(assigned.into_iter().map(|i| i.map(|i| ids[i])).collect())
    }

    /// The objects within the gate of any of the detections that are too small to append, given
    /// by their voxels.
    pub(crate) fn glimpsed(
        &self,
        grid: &Grid,
        glimpses: &[Vec<VoxelKey>],
    ) -> Result<Vec<ObjectId>, MapError> {
        if glimpses.is_empty() {
            return Ok(Vec::new());
        }
        let seen: Vec<&[VoxelKey]> = glimpses.iter().map(Vec::as_slice).collect();
        let costs = self.costs(grid, &seen)?;
        let gate_m = self.config.association.gate_m();
        let near = |(column, id): (usize, &ObjectId)| {
            costs.iter().any(|row| row[column] <= gate_m).then_some(*id)
        };
        Ok(self.objects.keys().enumerate().filter_map(near).collect())
    }

    /// How far each detection's voxels are from each object, by rising id.
    fn costs(&self, grid: &Grid, seen: &[&[VoxelKey]]) -> Result<Vec<Vec<f64>>, MapError> {
        let seen: Vec<Vec<Point>> = seen.iter().map(|voxels| centres(grid, voxels)).collect();
        let mut costs = vec![Vec::with_capacity(self.objects.len()); seen.len()];
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
        Ok(costs)
    }

    /// Deletes the objects that the view does not show and looks through; returns their ids.
    pub(crate) fn delete_absent(
        &mut self,
        cells: &ScanCells,
        shown: &BTreeSet<ObjectId>,
    ) -> Vec<ObjectId> {
        let absent = |object: &TrackedObject| {
            let free = object
                .voxels()
                .iter()
                .filter(|k| cells.is_free(**k))
                .count();
            !shown.contains(&object.id())
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

    /// Adds what a view observed to its object, or to a new one.
    pub(crate) fn append(
        &mut self,
        id: Option<ObjectId>,
        view: u32,
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
            .append(view, instance, observation);
        id
    }

    /// Leaves outvoted points out of the objects; `share` is what part of the votes on a voxel are
    /// for an object with these sightings.
    pub(crate) fn settle(&mut self, share: impl Fn(ObjectId, &[Sighting], &VoxelKey) -> f64) {
        for (id, object) in &mut self.objects {
            object.settle(|sightings, key| share(*id, sightings, key));
        }
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
