use credence_types::{CLASS_COUNT, FREE_CLASS, Point};

use crate::{ObjectId, VoxelKey, key::Grid};

/// One occupied voxel as the seed paper's Table I has it.
#[derive(Debug, Clone, PartialEq)]
pub struct SemanticVoxel {
    /// The voxel.
    pub key: VoxelKey,
    /// Its centre, metres.
    pub centre: Point,
    /// Mean colour of its pixels.
    pub rgb: [u8; 3],
    /// Votes per class index, one view one vote; 0 is background.
    pub histogram: [f64; CLASS_COUNT],
    /// The class with most votes, the first of equals: the histogram's mode.
    pub class: u8,
    /// Confidence, once a classifier has set it.
    pub confidence: Option<f64>,
    /// The object that most views put it on; `None` for background.
    pub object: Option<ObjectId>,
}

/// A pixel's part in a voxel.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sample {
    pub(super) rgb: [u8; 3],
    /// Object and class scores of the detection that covers the pixel; `None` for background.
    pub(super) label: Option<(ObjectId, [f64; CLASS_COUNT])>,
}

/// What is accumulated for a voxel.
#[derive(Debug, Clone, Default)]
pub(super) struct Record {
    rgb_sum: [u64; 3],
    pixels: u64,
    histogram: [f64; CLASS_COUNT],
    background: f64,
    /// Votes per object, by rising id.
    owners: Vec<(ObjectId, f64)>,
    pub(super) confidence: Option<f64>,
}

impl Record {
    /// Adds one view's pixels, which together cast one vote.
    pub(super) fn add(&mut self, samples: impl ExactSizeIterator<Item = Sample>) {
        let weight = 1.0 / samples.len() as f64;
        for Sample { rgb, label } in samples {
            for (sum, value) in self.rgb_sum.iter_mut().zip(rgb) {
                *sum += u64::from(value);
            }
            self.pixels += 1;
            let Some((id, scores)) = label else {
                self.histogram[usize::from(FREE_CLASS)] += weight;
                self.background += weight;
                continue;
            };
            for (votes, score) in self.histogram.iter_mut().zip(scores) {
                *votes += weight * score;
            }
            match self.owners.binary_search_by_key(&id, |o| o.0) {
                Ok(i) => self.owners[i].1 += weight,
                Err(i) => self.owners.insert(i, (id, weight)),
            }
        }
    }

    /// The object with most votes, the lowest id of equals; `None` if none has more than the
    /// background.
    pub(super) fn object(&self) -> Option<ObjectId> {
        let mut best = (None, self.background);
        for (id, votes) in &self.owners {
            if *votes > best.1 {
                best = (Some(*id), *votes);
            }
        }
        best.0
    }

    /// Withdraws an object's votes.
    pub(super) fn forget(&mut self, deleted: &[ObjectId]) {
        self.owners.retain(|(id, _)| !deleted.contains(id));
    }

    pub(super) fn voxel(&self, grid: &Grid, key: VoxelKey) -> SemanticVoxel {
        let pixels = self.pixels.max(1);
        let mean = |sum: u64| ((sum + pixels / 2) / pixels) as u8;
        SemanticVoxel {
            key,
            centre: grid.centre_of(key, crate::key::DEPTH),
            rgb: self.rgb_sum.map(mean),
            histogram: self.histogram,
            class: mode(&self.histogram),
            confidence: self.confidence,
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
            label: label.map(|(id, class)| (ObjectId(id), one_hot(class))),
        }
    }

    #[test]
    fn a_view_casts_one_vote_however_many_pixels_it_has() {
        let mut record = Record::default();
        record.add([sample(0, Some((1, 6))); 16].into_iter());
        record.add([sample(10, Some((2, 2)))].into_iter());
        record.add([sample(10, Some((2, 2))), sample(11, None)].into_iter());
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
        record.add([sample(0, Some((1, 6))), sample(0, None)].into_iter());
        assert_eq!((record.object(), mode(&record.histogram)), (None, 0));
        record.add([sample(0, Some((1, 6)))].into_iter());
        assert_eq!(
            (record.object(), mode(&record.histogram)),
            (Some(ObjectId(1)), 6)
        );
        record.forget(&[ObjectId(1)]);
        assert_eq!(record.object(), None);
    }
}
