use credence_types::{CLASS_COUNT, FREE_CLASS, Point};

use crate::{ObjectId, VoxelKey, key::Grid, tracker::Sighting};

/// One voxel that the octree holds occupied, as the seed paper's Table I has it.
#[derive(Debug, Clone, PartialEq)]
pub struct SemanticVoxel {
    /// The voxel.
    pub key: VoxelKey,
    /// Its centre, metres.
    pub centre: Point,
    /// Mean colour of its pixels.
    pub rgb: [u8; 3],
    /// Votes per class index; 0 is background. A view casts one vote, of which every pixel has the
    /// same part, times the detection's score where one covers the pixel.
    pub histogram: [f64; CLASS_COUNT],
    /// The class with most votes, the first of equals: the histogram's mode.
    pub class: u8,
    /// Confidence, once a classifier has set it and as long as the object stays the same.
    pub confidence: Option<f64>,
    /// The object that most views put it on; `None` for background.
    pub object: Option<ObjectId>,
}

/// A pixel's part in a voxel.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sample {
    pub(super) rgb: [u8; 3],
    /// The object that covers the pixel; `None` for background.
    pub(super) label: Option<Label>,
}

/// A detection's vote.
#[derive(Debug, Clone, Copy)]
pub(super) struct Label {
    pub(super) id: ObjectId,
    /// Its score.
    pub(super) weight: f64,
    /// Its votes per class, which add up to the weight.
    pub(super) votes: [f64; CLASS_COUNT],
}

impl Label {
    /// Adds a part of a vote.
    fn add(&mut self, part: f64, vote: Self) {
        self.weight += part * vote.weight;
        for (sum, vote) in self.votes.iter_mut().zip(vote.votes) {
            *sum += part * vote;
        }
    }
}

/// The votes for an object.
#[derive(Debug, Clone, Copy)]
struct Votes {
    sum: Label,
    /// Scores of the views that put any pixel on the object, added up.
    views: f64,
    /// The last of them.
    last_view: u32,
}

/// The evidence that pixels have left in a voxel. It is kept whatever the octree holds of the
/// voxel, until a view looks through it; only occupied voxels are shown.
#[derive(Debug, Clone, Default)]
pub(super) struct Record {
    rgb_sum: [u64; 3],
    pixels: u64,
    /// The views that show the voxel, by rising index.
    views: Vec<u32>,
    background: f64,
    /// The votes for each object, by rising id. Class votes stand with the object that they came
    /// with, so that they can be withdrawn with it.
    labels: Vec<Votes>,
    /// The confidence and the object that it was computed for.
    confidence: Option<(ObjectId, f64)>,
}

impl Record {
    /// Adds one view's pixels, which together cast one vote. Views come by rising index.
    pub(super) fn add(&mut self, view: u32, samples: impl ExactSizeIterator<Item = Sample>) {
        self.views.push(view);
        let weight = 1.0 / samples.len() as f64;
        for Sample { rgb, label } in samples {
            for (sum, value) in self.rgb_sum.iter_mut().zip(rgb) {
                *sum += u64::from(value);
            }
            self.pixels += 1;
            match label {
                None => self.background += weight,
                Some(label) => self.votes_for(view, label).add(weight, label),
            }
        }
        self.drop_stale_confidence();
    }

    /// The votes for a label's object, among which this view counts.
    fn votes_for(&mut self, view: u32, label: Label) -> &mut Label {
        let at = match self.labels.binary_search_by_key(&label.id, |l| l.sum.id) {
            Ok(at) => at,
            Err(at) => {
                let none = Votes {
                    sum: Label {
                        weight: 0.0,
                        votes: [0.0; CLASS_COUNT],
                        ..label
                    },
                    views: 0.0,
                    last_view: view,
                };
                self.labels.insert(at, none);
                at
            }
        };
        let votes = &mut self.labels[at];
        if votes.views == 0.0 || votes.last_view != view {
            votes.views += label.weight;
            votes.last_view = view;
        }
        &mut votes.sum
    }

    /// What part of the views that show both the voxel and an object put the one on the other, each
    /// view by its detection's score.
    pub(super) fn share(&self, id: ObjectId, sightings: &[Sighting]) -> f64 {
        let Ok(at) = self.labels.binary_search_by_key(&id, |l| l.sum.id) else {
            return 0.0;
        };
        let shows_voxel = |s: &&Sighting| self.views.binary_search(&s.view).is_ok();
        let all: f64 = sightings.iter().filter(shows_voxel).map(|s| s.score).sum();
        // A detection of score 0 says as little for as against.
        if all > 0.0 {
            self.labels[at].views / all
        } else {
            1.0
        }
    }

    /// The object with most votes, the lowest id of equals; `None` if none has more than the
    /// background.
    pub(super) fn object(&self) -> Option<ObjectId> {
        let mut best = (None, self.background);
        for Votes { sum: label, .. } in &self.labels {
            if label.weight > best.1 {
                best = (Some(label.id), label.weight);
            }
        }
        best.0
    }

    /// Withdraws deleted objects' votes, for the object and for its classes.
    pub(super) fn forget(&mut self, deleted: &[ObjectId]) {
        self.labels.retain(|votes| !deleted.contains(&votes.sum.id));
        self.drop_stale_confidence();
    }

    /// Sets the confidence that the voxel has as a part of its object.
    pub(super) fn set_confidence(&mut self, confidence: Option<f64>) {
        self.confidence = self.object().zip(confidence);
    }

    /// A confidence was computed for one object and says nothing of another.
    fn drop_stale_confidence(&mut self) {
        if let Some((id, _)) = self.confidence
            && self.object() != Some(id)
        {
            self.confidence = None;
        }
    }

    fn histogram(&self) -> [f64; CLASS_COUNT] {
        let mut histogram = [0.0; CLASS_COUNT];
        histogram[usize::from(FREE_CLASS)] = self.background;
        for label in &self.labels {
            for (sum, votes) in histogram.iter_mut().zip(label.sum.votes) {
                *sum += votes;
            }
        }
        histogram
    }

    pub(super) fn voxel(&self, grid: &Grid, key: VoxelKey) -> SemanticVoxel {
        let pixels = self.pixels.max(1);
        let mean = |sum: u64| ((sum + pixels / 2) / pixels) as u8;
        let histogram = self.histogram();
        SemanticVoxel {
            key,
            centre: grid.centre_of(key, crate::key::DEPTH),
            rgb: self.rgb_sum.map(mean),
            histogram,
            class: mode(&histogram),
            confidence: self.confidence.map(|c| c.1),
            object: self.object(),
        }
    }
}

fn mode(histogram: &[f64; CLASS_COUNT]) -> u8 {
    let mut best = 0;
    for (class, votes) in histogram.iter().enumerate() {
        if *votes > histogram[best] {
            best = class;
        }
    }
    best as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample(value: u8, label: Option<(u32, u8)>) -> Sample {
        let one_hot =
            |class: u8| std::array::from_fn(|i| f64::from(u8::from(i == usize::from(class))));
        Sample {
            rgb: [value, 0, 255],
            label: label.map(|(id, class)| Label {
                id: ObjectId(id),
                weight: 1.0,
                votes: one_hot(class),
            }),
        }
    }

    #[test]
    fn a_view_casts_one_vote_however_many_pixels_it_has() {
        let mut record = Record::default();
        record.add(1, [sample(0, Some((1, 6))); 16].into_iter());
        record.add(2, [sample(10, Some((2, 2)))].into_iter());
        record.add(3, [sample(10, Some((2, 2))), sample(11, None)].into_iter());
        let grid = Grid::new(1.0).unwrap();
        let voxel = record.voxel(&grid, VoxelKey::from_axes([32768; 3]));
        assert_eq!(voxel.histogram, [0.5, 0.0, 1.5, 0.0, 0.0, 0.0, 1.0]);
        assert_eq!((voxel.class, voxel.object), (2, Some(ObjectId(2))));
        // 31 over 19 pixels.
        assert_eq!(voxel.rgb, [2, 0, 255]);
        assert_eq!(voxel.centre, Point::new(0.5, 0.5, 0.5));
    }

    #[test]
    fn background_keeps_a_tie() {
        let mut record = Record::default();
        record.add(1, [sample(0, Some((1, 6))), sample(0, None)].into_iter());
        assert_eq!((record.object(), mode(&record.histogram())), (None, 0));
        record.add(2, [sample(0, Some((1, 6)))].into_iter());
        assert_eq!(
            (record.object(), mode(&record.histogram())),
            (Some(ObjectId(1)), 6)
        );
    }

    #[test]
    fn a_forgotten_object_takes_its_votes_along() {
        let mut record = Record::default();
        record.add(1, [sample(0, Some((1, 6)))].into_iter());
        record.add(2, [sample(0, Some((1, 6)))].into_iter());
        record.add(3, [sample(0, Some((2, 2)))].into_iter());
        record.add(4, [sample(4, None), sample(4, Some((1, 6)))].into_iter());
        record.set_confidence(Some(0.75));
        record.forget(&[ObjectId(1)]);
        let grid = Grid::new(1.0).unwrap();
        let voxel = record.voxel(&grid, VoxelKey::from_axes([32768; 3]));
        assert_eq!(voxel.histogram, [0.5, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0]);
        assert_eq!((voxel.class, voxel.object), (2, Some(ObjectId(2))));
        // Colour is of the place, not of the object: 8 over 5 pixels.
        assert_eq!((voxel.rgb, voxel.confidence), ([2, 0, 255], None));
    }

    #[test]
    fn a_confidence_goes_with_its_object() {
        let mut record = Record::default();
        record.set_confidence(Some(0.5));
        assert_eq!(record.confidence, None);
        record.add(1, [sample(0, Some((1, 6)))].into_iter());
        record.set_confidence(Some(0.5));
        record.add(2, [sample(0, Some((2, 6)))].into_iter());
        assert_eq!(record.confidence, Some((ObjectId(1), 0.5)));
        record.add(3, [sample(0, Some((2, 6)))].into_iter());
        assert_eq!(
            (record.object(), record.confidence),
            (Some(ObjectId(2)), None)
        );
        record.add(4, [sample(0, Some((1, 6))); 3].into_iter());
        record.add(5, [sample(0, Some((1, 6)))].into_iter());
        assert_eq!(
            (record.object(), record.confidence),
            (Some(ObjectId(1)), None)
        );
    }
}
