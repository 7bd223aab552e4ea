use std::sync::OnceLock;

use credence_segment::{
    SegmentError, Segmenter,
    maskrcnn::{Input, MaskRcnn},
    trimmed,
};
use credence_types::{Frame, Instance};

use crate::{Config, PipelineError, SegmentationConfig, SegmenterChoice};

/// What finds the objects in frames: the segmenter that a configuration names, loaded when it is
/// first needed, or one from outside.
pub struct ChosenSegmenter {
    choice: SegmenterChoice,
    segmentation: SegmentationConfig,
    loaded: OnceLock<Loaded>,
}

enum Loaded {
    MaskRcnn(Box<MaskRcnn>),
    Other(Box<dyn Segmenter>),
}

impl Loaded {
    fn segmenter(&self) -> &dyn Segmenter {
        match self {
            Self::MaskRcnn(network) => network.as_ref(),
            Self::Other(segmenter) => segmenter.as_ref(),
        }
    }
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
            segmentation: config.segmentation.clone(),
            loaded: foreign.map_or_else(OnceLock::new, |s| Loaded::Other(s).into()),
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
        let loaded = self.get()?;
        let mut instances = loaded.segmenter().segment(frame)?;
        if self.segmentation.trim && matches!(loaded, Loaded::MaskRcnn(_)) {
            for instance in &mut instances {
                *instance = trimmed(frame, instance)?;
            }
        }
        Ok(instances)
    }

    /// What the segmenter's logits are divided by to make its scores probabilities; `None` if it is
    /// no network of ours.
    ///
    /// # Errors
    /// Weights that cannot be read.
    pub fn temperature(&self) -> Result<Option<f64>, PipelineError> {
        Ok(match self.get()? {
            Loaded::MaskRcnn(network) => Some(network.temperature()),
            Loaded::Other(_) => None,
        })
    }

    fn get(&self) -> Result<&Loaded, PipelineError> {
        if let Some(loaded) = self.loaded.get() {
            return Ok(loaded);
        }
        let loaded = self.load()?;
        // Of two threads that load it at once, one is in time.
        Ok(self.loaded.get_or_init(|| loaded))
    }

    fn load(&self) -> Result<Loaded, PipelineError> {
        Ok(match &self.choice {
            SegmenterChoice::MaskRcnn => self.network(Input::Colour)?,
            SegmenterChoice::MaskRcnnRgbd => self.network(Input::ColourAndDepth)?,
            SegmenterChoice::Oracle => Loaded::Other(Box::new(Oracle)),
            SegmenterChoice::Python(function) => {
                return Err(PipelineError::Config(format!(
                    "segmenter = \"{function}\" needs Python; make the pipeline there, or pass a \
                     segmenter"
                )));
            }
        })
    }

    fn network(&self, input: Input) -> Result<Loaded, PipelineError> {
        let SegmentationConfig {
            weights,
            least_score,
            calibrated,
            trim: _,
        } = &self.segmentation;
        let network = match weights.file() {
            None => MaskRcnn::embedded(input)?,
            Some(path) => MaskRcnn::from_file(path, input)?,
        };
        let network = network.with_least_score(*least_score);
        let network = if *calibrated {
            network
        } else {
            network.uncalibrated()
        };
        Ok(Loaded::MaskRcnn(Box::new(network)))
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

/// Left, top, right and bottom of a mask (row-major, of an image so many pixels wide) in pixels: the
/// outer edges of its pixels, half a pixel beyond their centres. All NaN for a mask without pixels.
pub fn outer_box(mask: &[bool], width: usize) -> [f64; 4] {
    let mut bounds = None;
    for (index, _) in mask.iter().enumerate().filter(|(_, covered)| **covered) {
        let (column, row) = (index % width, index / width);
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

    use credence_types::{Category, FrameTruth, Intrinsics, Pose};
    use serde_json::json;

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

    fn chosen(config: &serde_json::Value) -> Result<ChosenSegmenter, PipelineError> {
        ChosenSegmenter::new(&Config::from_json(&config.to_string()).unwrap(), None)
    }

    #[test]
    fn networks_have_a_temperature_and_keep_to_the_least_score() {
        let temperature = |config| chosen(&config).unwrap().temperature().unwrap();
        for name in ["maskrcnn", "maskrcnn_rgbd"] {
            assert!(temperature(json!({"segmenter": name})).unwrap() > 0.0);
            let plain = json!({"segmenter": name, "segmentation": {"calibrated": false}});
            assert_eq!(temperature(plain), Some(1.0));
            let silent = json!({"segmenter": name, "segmentation": {"least_score": 1}});
            let silent = chosen(&silent).unwrap();
            assert_eq!(silent.segment(&frame(None)).unwrap(), []);
        }
        assert_eq!(temperature(json!({"segmenter": "oracle"})), None);
    }

    #[test]
    fn weights_that_are_not_there_are_found_before_any_work() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("maskrcnn.safetensors");
        let message = |name: &str| {
            let config = json!({"segmenter": name, "segmentation": {"weights": path}});
            chosen(&config).map(|_| ()).map_err(|err| err.to_string())
        };
        for damaged in [false, true] {
            for name in ["maskrcnn", "maskrcnn_rgbd"] {
                let refused = message(name).unwrap_err();
                assert!(refused.contains("maskrcnn.safetensors"), "{refused}");
            }
            assert_eq!(message("oracle"), Ok(()), "which has no weights, {damaged}");
            std::fs::write(&path, b"no weights").unwrap();
        }
    }

    #[test]
    fn a_box_has_the_outer_edges_of_a_masks_pixels() {
        let mut mask = vec![false; 12];
        assert!(outer_box(&mask, 4).iter().all(|edge| edge.is_nan()));
        mask[4 + 3] = true;
        assert_eq!(outer_box(&mask, 4), [2.5, 0.5, 3.5, 1.5]);
        mask[2 * 4] = true;
        assert_eq!(outer_box(&mask, 4), [-0.5, 0.5, 3.5, 2.5]);
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
