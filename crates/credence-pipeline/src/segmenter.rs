use std::sync::OnceLock;

use credence_segment::{SegmentError, Segmenter};
use credence_types::{Frame, Instance, Intrinsics};

use crate::{Config, PipelineError, SegmenterChoice};

/// What finds the objects in frames: the segmenter that a configuration names, loaded when it is
/// first needed, or one from outside.
pub struct ChosenSegmenter {
    choice: SegmenterChoice,
    loaded: OnceLock<Box<dyn Segmenter>>,
}

impl ChosenSegmenter {
    /// The configuration's choice, or `foreign` in its place. Files of weights are read at once, so
    /// that a wrong one is found before any work is done.
    ///
    /// # Errors
    /// A setting outside its range, a file of weights that cannot be read, a function in Python
    /// without a segmenter that calls it.
    pub fn new(
        config: &Config,
        foreign: Option<Box<dyn Segmenter>>,
    ) -> Result<Self, PipelineError> {
        config.check()?;
        let chosen = Self {
            choice: config.segmenter.clone(),
            loaded: foreign.map_or_else(OnceLock::new, OnceLock::from),
        };
        let is_python = matches!(chosen.choice, SegmenterChoice::Python(_));
        if is_python || config.segmentation.weights.file().is_some() {
            chosen.get()?;
        }
        Ok(chosen)
    }

    /// The segmenter's name.
    pub const fn choice(&self) -> &SegmenterChoice {
        &self.choice
    }

    /// Instances in a fixed order; none where nothing is in view.
    ///
    /// # Errors
    /// A frame that the segmenter refuses.
    pub fn segment(&self, frame: &Frame) -> Result<Vec<Instance>, PipelineError> {
        Ok(self.get()?.segment(frame)?)
    }

    fn get(&self) -> Result<&dyn Segmenter, PipelineError> {
        if let Some(loaded) = self.loaded.get() {
            return Ok(loaded.as_ref());
        }
        let loaded = self.load()?;
        // Of two threads that load it at once, one is in time.
        Ok(self.loaded.get_or_init(|| loaded).as_ref())
    }

    fn load(&self) -> Result<Box<dyn Segmenter>, PipelineError> {
        match &self.choice {
            SegmenterChoice::Oracle => Ok(Box::new(Oracle)),
            SegmenterChoice::Python(function) => Err(PipelineError::Config(format!(
                "segmenter = \"{function}\" needs Python; make the pipeline there, or pass a \
                 segmenter"
            ))),
        }
    }
}

/// The true masks, each with score 1: the ablation that takes segmentation out of the question.
#[derive(Debug, Clone, Copy)]
pub struct Oracle;

impl Segmenter for Oracle {
    fn segment(&self, frame: &Frame) -> Result<Vec<Instance>, SegmentError> {
        let truth = frame.truth().ok_or(SegmentError::NoTrueMasks)?;
        let mut instances = Vec::new();
        for (id, category) in &truth.categories {
            let mask: Vec<bool> = truth.instance_ids.iter().map(|i| i == id).collect();
            if mask.contains(&true) {
                instances.push(Instance::certain(instances.len(), mask, *category)?);
            }
        }
        Ok(instances)
    }
}

/// Left, top, right and bottom of a mask (row-major) in pixels: the outer edges of its pixels, half
/// a pixel beyond their centres. All NaN for a mask without pixels.
pub fn outer_box(mask: &[bool], camera: &Intrinsics) -> [f64; 4] {
    let mut bounds = None;
    for (index, _) in mask.iter().enumerate().filter(|(_, covered)| **covered) {
        let (column, row) = (index % camera.width(), index / camera.width());
        let [left, top, right, bottom] = bounds.unwrap_or([column, row, column, row]);
        bounds = Some([
            left.min(column),
            top.min(row),
            right.max(column),
            bottom.max(row),
        ]);
    }
    bounds.map_or([f64::NAN; 4], |[left, top, right, bottom]| {
        [
            left as f64 - 0.5,
            top as f64 - 0.5,
            right as f64 + 0.5,
            bottom as f64 + 0.5,
        ]
    })
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use credence_types::{Category, FrameTruth, Pose};

    use super::*;

    fn frame(truth: Option<FrameTruth>) -> Frame {
        let intrinsics = Intrinsics::new([3, 1], [1.0, 1.0], [1.0, 0.0]).unwrap();
        Frame::new(
            vec![[0; 3]; 3],
            vec![1.0; 3],
            intrinsics,
            Pose::identity(),
            truth,
        )
        .unwrap()
    }

    #[test]
    fn the_oracle_returns_the_true_masks_of_what_is_in_view() {
        let truth = FrameTruth {
            instance_ids: vec![2, 0, 2],
            categories: BTreeMap::from([(1, Category::Bowl), (2, Category::Mug)]),
        };
        let instances = Oracle.segment(&frame(Some(truth))).unwrap();
        assert_eq!(
            instances,
            [Instance::certain(0, vec![true, false, true], Category::Mug).unwrap()]
        );
    }

    #[test]
    fn a_box_has_the_outer_edges_of_a_masks_pixels() {
        let camera = Intrinsics::new([4, 3], [1.0, 1.0], [1.5, 1.0]).unwrap();
        let mut mask = vec![false; 12];
        assert!(outer_box(&mask, &camera).iter().all(|edge| edge.is_nan()));
        mask[4 + 3] = true;
        assert_eq!(outer_box(&mask, &camera), [2.5, 0.5, 3.5, 1.5]);
        mask[2 * 4] = true;
        assert_eq!(outer_box(&mask, &camera), [-0.5, 0.5, 3.5, 2.5]);
    }

    #[test]
    fn the_oracle_needs_true_masks() {
        let message = Oracle.segment(&frame(None)).unwrap_err().to_string();
        assert!(message.contains("segmenter = \"oracle\" needs true masks"));
    }

    #[test]
    fn a_function_in_python_needs_one_who_calls_it() {
        let config = Config::from_json(r#"{"segmenter": "python:tools.masks.find"}"#).unwrap();
        let message = ChosenSegmenter::new(&config, None)
            .err()
            .unwrap()
            .to_string();
        assert!(
            message.contains("segmenter = \"python:tools.masks.find\" needs Python"),
            "{message}"
        );
        let chosen = ChosenSegmenter::new(&config, Some(Box::new(Oracle))).unwrap();
        assert_eq!(chosen.choice(), &config.segmenter);
        let truth = FrameTruth {
            instance_ids: vec![1; 3],
            categories: BTreeMap::from([(1, Category::Can)]),
        };
        assert_eq!(chosen.segment(&frame(Some(truth))).unwrap().len(), 1);
    }
}
