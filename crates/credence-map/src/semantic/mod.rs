//! The semantic map: what is where, what it is, and how sure that is.

mod observe;
#[cfg(test)]
mod tests;
mod voxel;

use std::collections::BTreeMap;

use credence_types::{Frame, Instance, InvalidInput, Point};
pub use observe::SupportConfig;
use observe::{Hit, observe};
use rayon::prelude::*;
pub use voxel::SemanticVoxel;
use voxel::{Label, Record, Sample};

use crate::{
    Aabb, FreeSampling, MapError, ObjectId, Occupancy, OccupancyMap, ScanUpdate, TrackedObject,
    TrackerConfig, VoxelKey,
    scan::{ScanCells, end_key},
    tracker::{Observation, Tracker, class_votes},
};

/// How a scene is mapped.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SemanticMapConfig {
    /// Edge of the smallest voxels, metres. Default 0.005.
    pub resolution_m: f64,
    /// Pixels farther away only clear the way up to this distance. Default 2 m: a wrist camera's
    /// workspace, where a D435's depth noise stays about as small as four voxels.
    pub max_range_m: Option<f64>,
    /// When a point of a mask counts as lying on the object.
    pub support: SupportConfig,
    /// How objects are tracked.
    pub tracker: TrackerConfig,
}

impl Default for SemanticMapConfig {
    fn default() -> Self {
        Self {
            resolution_m: 0.005,
            max_range_m: Some(2.0),
            support: SupportConfig::default(),
            tracker: TrackerConfig::default(),
        }
    }
}

/// What one frame changed.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct InsertReport {
    /// Voxels touched.
    pub scan: ScanUpdate,
    /// The object of each instance; `None` where too few of its pixels have a trusted depth.
    pub objects: Vec<Option<ObjectId>>,
    /// Objects that left the map because the view looks through their place.
    pub deleted: Vec<ObjectId>,
}

/// The points that free-space samples keep away from.
#[derive(Debug, Clone, Copy)]
pub enum KeepAway<'a> {
    /// One object's observed points.
    Object(ObjectId),
    /// All objects' observed points.
    Objects,
    /// These points.
    Points(&'a [Point]),
}

/// An occupancy octree, the semantics of its occupied voxels, and the objects they belong to.
///
/// The octree alone says which voxels are occupied: all of these, and no others, have a
/// [`SemanticVoxel`]. What pixels tell of a voxel is kept while the octree still holds it free, for
/// one view does not outweigh many that looked through it. Everything is a function of the frames and instances in their order, not of
/// the order of instances within a frame or of the number of threads.
#[derive(Debug, Clone)]
pub struct SemanticMap {
    config: SemanticMapConfig,
    occupancy: OccupancyMap,
    records: BTreeMap<VoxelKey, Record>,
    tracker: Tracker,
    /// Number of views inserted.
    views: u32,
}

impl SemanticMap {
    /// An empty map.
    ///
    /// # Errors
    /// A setting outside its range.
    pub fn new(config: SemanticMapConfig) -> Result<Self, MapError> {
        if let Some(value) = config.max_range_m.filter(|r| !(r.is_finite() && *r > 0.0)) {
            let name = "max_range_m";
            return Err(MapError::NotPositive { name, value });
        }
        config.tracker.check()?;
        Ok(Self {
            config,
            occupancy: OccupancyMap::new(config.resolution_m)?,
            records: BTreeMap::new(),
            tracker: Tracker::new(config.tracker),
            views: 0,
        })
    }

    /// The settings.
    pub const fn config(&self) -> &SemanticMapConfig {
        &self.config
    }

    /// The octree.
    pub const fn occupancy(&self) -> &OccupancyMap {
        &self.occupancy
    }

    /// Inserts a frame and what a segmenter found in it.
    ///
    /// 1. All pixels with a depth are cast into the octree.
    /// 2. Detections become observations, and these are paired with the known objects.
    /// 3. Objects that the view looks through are deleted, and their votes withdrawn; voxels that
    ///    the view passes and the octree holds free lose what was seen there.
    /// 4. Observations are appended to their objects, and every pixel votes in its voxel.
    /// 5. Points of objects that are outvoted are left out of them: see [`TrackedObject`].
    ///
    /// # Errors
    /// A mask that does not fit the frame, a camera outside the map's volume, a view that crosses
    /// more space than a scan may. The map is unchanged then.
    pub fn insert(
        &mut self,
        frame: &Frame,
        instances: &[Instance],
    ) -> Result<InsertReport, MapError> {
        let SemanticMapConfig {
            max_range_m,
            support,
            tracker,
            ..
        } = self.config;
        let grid = *self.occupancy.grid();
        let origin = frame.world_from_camera().origin();
        let pixels = frame.intrinsics().pixels();
        let points: Vec<Option<Point>> = (0..pixels)
            .into_par_iter()
            .map(|i| frame.world_point(i))
            .collect();
        let hits: Vec<Option<Hit>> = points
            .par_iter()
            .map(|point| {
                let point = (*point)?;
                Some((point, end_key(&grid, &origin, &point, max_range_m)?))
            })
            .collect();
        let (observations, glimpses) =
            observe(frame, instances, &hits, support, tracker.min_points)?;
        let ids = self.tracker.associate(&grid, &observations)?;
        let glimpsed = self.tracker.glimpsed(&grid, &glimpses)?;
        let points: Vec<Point> = points.into_iter().flatten().collect();
        let cells = ScanCells::trace(&grid, &origin, &points, max_range_m)?;

        self.occupancy.apply(&cells);
        let shown = ids.iter().flatten().chain(&glimpsed).copied().collect();
        let mut deleted = self.tracker.delete_absent(&cells, &shown);
        self.forget(&deleted);
        self.clear_freed(&cells);
        let mut objects = vec![None; instances.len()];
        for (id, observation) in ids.iter().zip(&observations) {
            let instance = &instances[observation.instance];
            let id = self.tracker.append(*id, self.views, instance, observation);
            objects[observation.instance] = Some(id);
        }
        let emptied = self.tracker.delete_empty();
        self.forget(&emptied);
        deleted.extend(emptied);
        self.vote(frame, instances, &hits, &observations, &objects);
        let records = &self.records;
        self.tracker.settle(|id, sightings, key| {
            let record = records.get(key);
            record.map_or(0.0, |record| record.share(id, sightings))
        });
        self.views += 1;
        Ok(InsertReport {
            scan: cells.update(),
            objects,
            deleted,
        })
    }

    /// Withdraws deleted objects' votes. The voxels stay as occupied as the octree holds them.
    fn forget(&mut self, deleted: &[ObjectId]) {
        if deleted.is_empty() {
            return;
        }
        for record in self.records.values_mut() {
            record.forget(deleted);
        }
    }

    /// Removes the records, and the objects' points, in voxels that this scan passes and that are
    /// free now.
    fn clear_freed(&mut self, cells: &ScanCells) {
        let occupancy = &self.occupancy;
        let stays = |key: &VoxelKey| {
            !cells.is_free(*key) || occupancy.occupancy_at(*key) == Occupancy::Occupied
        };
        self.records.retain(|key, _| stays(key));
        self.tracker.retain_voxels(stays);
    }

    /// Every pixel votes in its voxel; pixels that no observation kept vote for the background.
    fn vote(
        &mut self,
        frame: &Frame,
        instances: &[Instance],
        hits: &[Option<Hit>],
        observations: &[Observation],
        objects: &[Option<ObjectId>],
    ) {
        let mut labels = vec![None; hits.len()];
        for observation in observations {
            let instance = &instances[observation.instance];
            let label = objects[observation.instance].map(|id| Label {
                id,
                weight: instance.score(),
                votes: class_votes(instance),
            });
            for pixel in &observation.pixels {
                labels[*pixel] = label;
            }
        }
        let mut order: Vec<(VoxelKey, usize)> = hits
            .iter()
            .enumerate()
            .filter_map(|(pixel, hit)| hit.map(|(_, key)| (key, pixel)))
            .collect();
        order.par_sort_unstable();
        for group in order.chunk_by(|a, b| a.0 == b.0) {
            let samples = group.iter().map(|(_, pixel)| Sample {
                rgb: frame.rgb()[*pixel],
                label: labels[*pixel],
            });
            let record = self.records.entry(group[0].0).or_default();
            record.add(self.views, samples);
        }
    }

    /// The voxel at a point; `None` where none is occupied.
    pub fn voxel_at(&self, point_world: &Point) -> Option<SemanticVoxel> {
        let key = self.occupancy.grid().key_of(point_world)?;
        self.voxel(key, self.records.get(&key)?)
    }

    /// What is known of a voxel; `None` unless the octree holds it occupied.
    fn voxel(&self, key: VoxelKey, record: &Record) -> Option<SemanticVoxel> {
        let is_occupied = self.occupancy.occupancy_at(key) == Occupancy::Occupied;
        is_occupied.then(|| record.voxel(self.occupancy.grid(), key))
    }

    /// All occupied voxels by rising key.
    pub fn voxels(&self) -> impl Iterator<Item = SemanticVoxel> {
        let records = self.records.iter();
        records.filter_map(|(key, record)| self.voxel(*key, record))
    }

    /// The occupied voxels whose centre lies in a box.
    pub fn voxels_within(&self, within: &Aabb) -> impl Iterator<Item = SemanticVoxel> {
        self.voxels().filter(|v| within.contains(&v.centre))
    }

    /// The tracked objects by rising id.
    pub fn objects(&self) -> impl Iterator<Item = &TrackedObject> {
        self.tracker.objects().values()
    }

    /// A tracked object: its category, votes and observed points.
    ///
    /// # Errors
    /// An id that is not tracked.
    pub fn object(&self, id: ObjectId) -> Result<&TrackedObject, MapError> {
        let object = self.tracker.objects().get(&id);
        object.ok_or(MapError::UnknownObject { id: id.0 })
    }

    /// The occupied voxels that belong to an object, by rising key. Few or none as long as the
    /// octree holds more evidence of free space there; the object's points are not affected.
    ///
    /// # Errors
    /// An id that is not tracked.
    pub fn object_voxels(&self, id: ObjectId) -> Result<Vec<SemanticVoxel>, MapError> {
        let record = |key: &VoxelKey| Some((*key, self.records.get(key)?));
        let keys = self.object(id)?.seen_voxels();
        let owned = keys.iter().filter_map(record);
        let owned = owned.filter(|(_, record)| record.object() == Some(id));
        let voxels = owned.filter_map(|(key, record)| self.voxel(key, record));
        Ok(voxels.collect())
    }

    /// Mean confidence of an object's voxels; `None` as long as none is set.
    ///
    /// # Errors
    /// An id that is not tracked.
    pub fn object_confidence(&self, id: ObjectId) -> Result<Option<f64>, MapError> {
        let voxels = self.object_voxels(id)?;
        let set: Vec<f64> = voxels.iter().filter_map(|v| v.confidence).collect();
        Ok((!set.is_empty()).then(|| set.iter().sum::<f64>() / set.len() as f64))
    }

    /// Sets the confidences of an object's occupied voxels: of each that holds any of the points,
    /// their mean; the others lose theirs, so that all come from one call. Points elsewhere change
    /// nothing. Returns the number of voxels set.
    ///
    /// # Errors
    /// An id that is not tracked, lists of different lengths, a confidence outside \[0, 1\].
    pub fn set_confidences(
        &mut self,
        id: ObjectId,
        points_world: &[Point],
        confidences: &[f64],
    ) -> Result<usize, MapError> {
        self.object(id)?;
        if points_world.len() != confidences.len() {
            return Err(MapError::Length {
                name: "confidences",
                found: confidences.len(),
                expected: points_world.len(),
            });
        }
        if let Some(&value) = confidences.iter().find(|c| !(0.0..=1.0).contains(*c)) {
            let name = "confidences";
            return Err(InvalidInput::Score { name, value }.into());
        }
        let grid = *self.occupancy.grid();
        let mut means: BTreeMap<VoxelKey, (f64, u32)> = BTreeMap::new();
        for (point, confidence) in points_world.iter().zip(confidences) {
            if let Some(key) = grid.key_of(point) {
                let (sum, count) = means.entry(key).or_default();
                *sum += confidence;
                *count += 1;
            }
        }
        let mut set = 0;
        let object = self.tracker.objects().get(&id);
        for key in object.into_iter().flat_map(TrackedObject::seen_voxels) {
            let Some(record) = self.records.get_mut(key) else {
                continue;
            };
            if record.object() != Some(id) {
                continue;
            }
            let is_occupied = self.occupancy.occupancy_at(*key) == Occupancy::Occupied;
            let mean = means.get(key).filter(|_| is_occupied);
            record.set_confidence(mean.map(|(sum, count)| sum / f64::from(*count)));
            set += usize::from(mean.is_some());
        }
        Ok(set)
    }

    /// Draws free-space points; see [`OccupancyMap::sample_free`].
    ///
    /// # Errors
    /// Those of [`OccupancyMap::sample_free`], and an object that is not tracked.
    pub fn sample_free(
        &self,
        sampling: &FreeSampling,
        keep_away: KeepAway<'_>,
    ) -> Result<Vec<Point>, MapError> {
        match keep_away {
            KeepAway::Object(id) => {
                let points = &self.object(id)?.cloud().points_world;
                self.occupancy.sample_free(sampling, points)
            }
            KeepAway::Objects => {
                let clouds = self.objects().map(|o| o.cloud().points_world.as_slice());
                self.occupancy
                    .sample_free(sampling, &clouds.collect::<Vec<_>>().concat())
            }
            KeepAway::Points(points) => self.occupancy.sample_free(sampling, points),
        }
    }
}
