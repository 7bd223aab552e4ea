use std::fmt;

use credence_types::{CLASS_COUNT, Category, FREE_CLASS, Instance, Point, PointCloud};

use crate::VoxelKey;

/// Names a tracked object; never used twice in one map.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ObjectId(pub u32);

impl fmt::Display for ObjectId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

/// What one view shows of one object.
#[derive(Debug, Clone)]
pub(crate) struct Observation {
    /// Position of the instance in the caller's list.
    pub(crate) instance: usize,
    /// Row-major index of each pixel, rising.
    pub(crate) pixels: Vec<usize>,
    /// World point of each pixel.
    pub(crate) cloud: PointCloud,
    /// Voxel of each point.
    pub(crate) keys: Vec<VoxelKey>,
    /// Distinct voxels, sorted.
    pub(crate) voxels: Vec<VoxelKey>,
}

/// An object and all that was seen of it.
#[derive(Debug, Clone)]
pub struct TrackedObject {
    id: ObjectId,
    histogram: [f64; CLASS_COUNT],
    score_sum: f64,
    views: u32,
    cloud: PointCloud,
    keys: Vec<VoxelKey>,
    voxels: Vec<VoxelKey>,
}

impl TrackedObject {
    pub(super) const fn new(id: ObjectId) -> Self {
        Self {
            id,
            histogram: [0.0; CLASS_COUNT],
            score_sum: 0.0,
            views: 0,
            cloud: PointCloud {
                points_world: Vec::new(),
                rgb: Vec::new(),
            },
            keys: Vec::new(),
            voxels: Vec::new(),
        }
    }

    /// The object's id.
    pub const fn id(&self) -> ObjectId {
        self.id
    }

    /// Votes per class index, one view one vote: the detections' class scores times their score, as
    /// in the voxels; 0 gets what class scores leave of 1. Pixels of one view err together, so they
    /// do not vote one by one.
    pub const fn class_histogram(&self) -> &[f64; CLASS_COUNT] {
        &self.histogram
    }

    /// The category with most votes; the first of equals.
    pub fn category(&self) -> Category {
        let votes = |c: &Category| self.histogram[usize::from(c.class())];
        let mut best = Category::ALL[0];
        for category in &Category::ALL {
            if votes(category) > votes(&best) {
                best = *category;
            }
        }
        best
    }

    /// Mean score of the detections in \[0, 1\].
    pub fn score(&self) -> f64 {
        self.score_sum / f64::from(self.views)
    }

    /// Number of views in which the object was detected.
    pub const fn views(&self) -> u32 {
        self.views
    }

    /// All observed points, at the depth images' full resolution.
    pub const fn cloud(&self) -> &PointCloud {
        &self.cloud
    }

    /// Distinct voxels of the observed points, sorted.
    pub fn voxels(&self) -> &[VoxelKey] {
        &self.voxels
    }

    /// Mean of the observed points.
    pub fn centroid(&self) -> Point {
        mean(&self.cloud.points_world)
    }

    pub(super) fn append(&mut self, instance: &Instance, observation: &Observation) {
        for (sum, votes) in self.histogram.iter_mut().zip(class_votes(instance)) {
            *sum += votes;
        }
        self.score_sum += instance.score();
        self.views += 1;
        self.cloud.extend(&observation.cloud);
        self.keys.extend(&observation.keys);
        self.voxels.extend(&observation.voxels);
        self.voxels.sort_unstable();
        self.voxels.dedup();
    }

    pub(super) fn retain_voxels(&mut self, stays: impl Fn(&VoxelKey) -> bool) {
        let count = self.voxels.len();
        self.voxels.retain(stays);
        if self.voxels.len() == count {
            return;
        }
        let mut cloud = PointCloud::default();
        let mut keys = Vec::new();
        for (i, key) in self.keys.iter().enumerate() {
            if self.voxels.binary_search(key).is_ok() {
                cloud.push(self.cloud.points_world[i], self.cloud.rgb[i]);
                keys.push(*key);
            }
        }
        self.cloud = cloud;
        self.keys = keys;
    }
}

/// A detection's vote per class index: its class scores, and what they leave of 1 for the
/// background, times its score.
pub(crate) fn class_votes(instance: &Instance) -> [f64; CLASS_COUNT] {
    let mut votes = [0.0; CLASS_COUNT];
    for (category, score) in Category::ALL.iter().zip(instance.class_scores()) {
        votes[usize::from(category.class())] = *score;
    }
    votes[usize::from(FREE_CLASS)] = (1.0 - votes.iter().sum::<f64>()).max(0.0);
    votes.map(|vote| vote * instance.score())
}

/// The points' mean; the origin if there is none.
pub(super) fn mean(points: &[Point]) -> Point {
    let sum: nalgebra::Vector3<f64> = points.iter().map(|p| p.coords).sum();
    (sum / points.len().max(1) as f64).into()
}
