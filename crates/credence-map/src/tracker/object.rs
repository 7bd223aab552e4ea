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
///
/// Masks err: they spill onto what stands behind, or take in a neighbour. A voxel is the object's as
/// long as the views that show both mostly agree on it; those that miss the object say nothing. Each
/// counts by the score of its detection. Points and voxels that are outvoted are left out, until
/// further views say otherwise.
#[derive(Debug, Clone)]
pub struct TrackedObject {
    id: ObjectId,
    histogram: [f64; CLASS_COUNT],
    /// The views that show the object, by rising index.
    sightings: Vec<Sighting>,
    seen: Seen,
    /// What is not outvoted, where that is not all.
    agreed: Option<Seen>,
    is_settled: bool,
}

/// A view that shows an object.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Sighting {
    /// Which view of the map's.
    pub(crate) view: u32,
    /// The detection's score.
    pub(crate) score: f64,
}

/// Points and where they lie.
#[derive(Debug, Clone, Default)]
struct Seen {
    cloud: PointCloud,
    /// Voxel of each point.
    keys: Vec<VoxelKey>,
    /// Distinct voxels, sorted.
    voxels: Vec<VoxelKey>,
}

impl Seen {
    fn append(&mut self, observation: &Observation) {
        self.cloud.extend(&observation.cloud);
        self.keys.extend(&observation.keys);
        self.voxels.extend(&observation.voxels);
        self.voxels.sort_unstable();
        self.voxels.dedup();
    }

    /// Those in some of the voxels.
    fn within(&self, voxels: Vec<VoxelKey>) -> Self {
        let mut within = Self {
            voxels,
            ..Self::default()
        };
        for (i, key) in self.keys.iter().enumerate() {
            if within.voxels.binary_search(key).is_ok() {
                within
                    .cloud
                    .push(self.cloud.points_world[i], self.cloud.rgb[i]);
                within.keys.push(*key);
            }
        }
        within
    }
}

impl TrackedObject {
    pub(super) fn new(id: ObjectId) -> Self {
        Self {
            id,
            histogram: [0.0; CLASS_COUNT],
            sightings: Vec::new(),
            seen: Seen::default(),
            agreed: None,
            is_settled: true,
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
        let scores = self.sightings.iter().map(|sighting| sighting.score);
        scores.sum::<f64>() / self.sightings.len() as f64
    }

    /// Number of views in which the object was detected.
    pub fn views(&self) -> u32 {
        self.sightings.len() as u32
    }

    /// All observed points but those outvoted, at the depth images' full resolution.
    pub const fn cloud(&self) -> &PointCloud {
        &self.agreed().cloud
    }

    /// Distinct voxels of the observed points, sorted.
    pub fn voxels(&self) -> &[VoxelKey] {
        &self.agreed().voxels
    }

    /// Mean of the observed points.
    pub fn centroid(&self) -> Point {
        mean(&self.cloud().points_world)
    }

    /// Distinct voxels of all points, the outvoted among them, sorted.
    pub(crate) fn seen_voxels(&self) -> &[VoxelKey] {
        &self.seen.voxels
    }

    const fn agreed(&self) -> &Seen {
        match &self.agreed {
            Some(agreed) => agreed,
            None => &self.seen,
        }
    }

    pub(super) fn append(&mut self, view: u32, instance: &Instance, observation: &Observation) {
        for (sum, votes) in self.histogram.iter_mut().zip(class_votes(instance)) {
            *sum += votes;
        }
        let score = instance.score();
        self.sightings.push(Sighting { view, score });
        self.seen.append(observation);
        self.is_settled = false;
    }

    pub(super) fn retain_voxels(&mut self, stays: impl Fn(&VoxelKey) -> bool) {
        let mut voxels = self.seen.voxels.clone();
        voxels.retain(stays);
        if voxels.len() < self.seen.voxels.len() {
            self.seen = self.seen.within(voxels);
            self.agreed = None;
            self.is_settled = false;
        }
    }

    /// Leaves out what is outvoted, given the share of the votes that a voxel has for the object.
    /// At least half must be for it, or as many as in its best voxel: where all are in doubt, all
    /// that is known is what the doubt is about.
    pub(super) fn settle(&mut self, share: impl Fn(&[Sighting], &VoxelKey) -> f64) {
        if self.is_settled {
            return;
        }
        self.is_settled = true;
        let voxels = self.seen.voxels.iter();
        let shares: Vec<f64> = voxels.map(|key| share(&self.sightings, key)).collect();
        let least = shares.iter().copied().fold(0.0, f64::max).min(0.5);
        self.agreed = shares.iter().any(|share| *share < least).then(|| {
            let voxels = self.seen.voxels.iter().zip(&shares);
            let agreed = voxels.filter(|(_, share)| **share >= least);
            self.seen.within(agreed.map(|(key, _)| *key).collect())
        });
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
