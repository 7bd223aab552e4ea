use std::path::Path;

use burn::tensor::Device;
use credence_nn::{nms, read, rgbd::RgbdImage, weights};
use credence_types::{Frame, Instance};
use rayon::prelude::*;

use super::{
    anchors::Anchors,
    boxes::{Edges, clip, decode, sides},
    detection::{Detection, best, without_doubles},
    letterbox::Letterbox,
    network::{
        CLASSES, ImageBatch, ImageRows, MASK_SIDE, MaskRcnnNetwork, Pyramid, Region, in_order,
        mask_row,
    },
    proposals::proposals,
};
use crate::{SegmentError, Segmenter};

/// The weights that come with the crate.
const WEIGHTS: &[u8] = include_bytes!("../../../../assets/weights/maskrcnn.safetensors");

/// Units of what the head of boxes tells of regions (as in torchvision: weights 10 and 5).
pub const REGION_UNIT: [f32; 2] = [0.1, 0.2];
/// Score below which nothing is ever told.
pub const LEAST_TOLD: f64 = 0.05;
/// Regions that are looked at.
const REGIONS: usize = 60;
/// Boxes that overlap a better one by more are dropped; masks decide about the others.
const OVERLAP: f32 = 0.7;
/// Least side of a box, pixels.
const LEAST_SIDE: f32 = 1.0;
/// Most detections of an image.
const MOST_DETECTIONS: usize = 20;

/// What the network looks at.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Input {
    /// Colour alone, as in the seed paper.
    Colour,
    /// Colour and depth.
    ColourAndDepth,
}

/// The trained network, ready to look at frames.
#[derive(Debug)]
pub struct MaskRcnn {
    network: MaskRcnnNetwork,
    anchors: Anchors,
    input: Input,
    least_score: f64,
    temperature: f64,
    device: Device,
}

impl MaskRcnn {
    /// A network at hand, which records no gradients; it keeps every detection with a score of at
    /// least [`LEAST_TOLD`].
    pub fn new(network: MaskRcnnNetwork, input: Input) -> Self {
        let [colour, both] = network.temperatures();
        Self {
            network,
            anchors: Anchors::new(),
            input,
            least_score: 0.0,
            temperature: f64::from(match input {
                Input::Colour => colour,
                Input::ColourAndDepth => both,
            }),
            device: Device::flex(),
        }
    }

    /// The network that comes with the crate.
    ///
    /// # Errors
    /// None, unless the crate was built with weights of another network.
    pub fn embedded(input: Input) -> Result<Self, SegmentError> {
        let network = MaskRcnnNetwork::new(&Device::flex());
        let name = "the built-in maskrcnn.safetensors";
        let network = weights::from_bytes(network, WEIGHTS.to_vec(), name)?;
        Self::checked(network, input, name)
    }

    /// The network whose weights are in a file.
    ///
    /// # Errors
    /// A file that is missing, damaged, or holds another network's weights.
    pub fn from_file(path: &Path, input: Input) -> Result<Self, SegmentError> {
        let network = weights::load(MaskRcnnNetwork::new(&Device::flex()), path)?;
        Self::checked(network, input, &path.display().to_string())
    }

    fn checked(network: MaskRcnnNetwork, input: Input, name: &str) -> Result<Self, SegmentError> {
        match network.temperatures().into_iter().find(|t| *t <= 0.0) {
            None => Ok(Self::new(network, input)),
            Some(value) => Err(SegmentError::Temperature {
                name: name.to_owned(),
                value,
            }),
        }
    }

    /// The same, silent about detections with a lower score than this, or than [`LEAST_TOLD`].
    #[must_use]
    pub const fn with_least_score(mut self, score: f64) -> Self {
        self.least_score = score;
        self
    }

    /// The same with the scores as the network gives them.
    #[must_use]
    pub const fn uncalibrated(mut self) -> Self {
        self.temperature = 1.0;
        self
    }

    /// What the logits of the classes are divided by.
    pub const fn temperature(&self) -> f64 {
        self.temperature
    }

    /// The objects in an image, the surest first, each once.
    ///
    /// # Errors
    /// None that a CPU gives.
    pub fn look(&self, image: &RgbdImage) -> Result<Vec<Detection>, SegmentError> {
        let rows = ImageRows::new(image, self.input == Input::ColourAndDepth);
        let batch = ImageBatch::new(vec![rows], &self.device);
        let pyramid = self.network.features(&batch);
        let found = self.found(&pyramid)?;
        if found.is_empty() {
            return Ok(Vec::new());
        }
        Ok(without_doubles(self.with_masks(&pyramid, found)?))
    }

    /// Boxes and classes of what is in an image, the surest first.
    fn found(&self, pyramid: &Pyramid) -> Result<Vec<(Edges, [f64; CLASSES])>, SegmentError> {
        let (objectness, boxes) = self.network.propose(pyramid);
        let (objectness, boxes) = (read(objectness)?, read(boxes)?);
        let boxes = boxes.as_chunks::<4>().0.iter().copied();
        let told: Vec<(f32, [f32; 4])> = objectness.into_iter().zip(boxes).collect();
        let regions = proposals(&self.anchors, &told, REGIONS);
        let mut regions: Vec<Region> = regions
            .into_iter()
            .map(|edges| Region { image: 0, edges })
            .collect();
        if regions.is_empty() {
            return Ok(Vec::new());
        }
        in_order(&mut regions);
        let regarded = self.network.regard(pyramid, &regions);
        let (classes, boxes) = (read(regarded.classes)?, read(regarded.boxes)?);
        let least = self.least_score.max(LEAST_TOLD);
        let (edges, found): (Vec<Edges>, Vec<_>) = regions
            .iter()
            .zip(classes.as_chunks::<CLASSES>().0)
            .zip(boxes.as_chunks::<4>().0)
            .map(|((region, logits), told)| {
                let edges = clip(decode(region.edges, *told, REGION_UNIT));
                (edges, softmax(logits, self.temperature))
            })
            .filter(|(edges, classes)| {
                best(classes).1 >= least && sides(*edges).iter().all(|side| *side >= LEAST_SIDE)
            })
            .unzip();
        let scores: Vec<f32> = found.iter().map(|classes| best(classes).1 as f32).collect();
        let kept = nms::nms(&edges, &scores, OVERLAP).into_iter();
        Ok(kept
            .take(MOST_DETECTIONS)
            .map(|index| (edges[index], found[index]))
            .collect())
    }

    /// Adds the masks, in the order of the boxes.
    fn with_masks(
        &self,
        pyramid: &Pyramid,
        found: Vec<(Edges, [f64; CLASSES])>,
    ) -> Result<Vec<Detection>, SegmentError> {
        // Those of one level together, as the head takes them.
        let region = |place: &usize| Region {
            image: 0,
            edges: found[*place].0,
        };
        let mut order: Vec<usize> = (0..found.len()).collect();
        order.sort_by_key(|place| region(place).level());
        let regions: Vec<Region> = order.iter().map(region).collect();
        let logits = read(self.network.masks(pyramid, &regions))?;
        let values = logits.len() / regions.len();
        let mut of_each: Vec<&[f32]> = vec![&[]; found.len()];
        for (place, logits) in order.iter().zip(logits.chunks_exact(values)) {
            of_each[*place] = logits;
        }
        let detections = found
            .into_iter()
            .zip(of_each)
            .map(|((edges, classes), logits)| {
                let (category, _) = best(&classes);
                let channel = usize::from(category.class()) - 1;
                let mask = (0..MASK_SIDE * MASK_SIDE).map(|at| {
                    let row = mask_row(at / MASK_SIDE, at % MASK_SIDE);
                    let logit = logits[row * (CLASSES - 1) + channel];
                    1.0 / (1.0 + (-logit).exp())
                });
                Detection {
                    edges,
                    classes,
                    mask: mask.collect(),
                }
            });
        Ok(detections.collect())
    }
}

impl Segmenter for MaskRcnn {
    fn segment(&self, frame: &Frame) -> Result<Vec<Instance>, SegmentError> {
        let letterbox = Letterbox::of(frame);
        let detections = self.look(&letterbox.image(frame))?;
        let paste = |detection: Detection| {
            let mask = detection.paste(&letterbox);
            // A frame smaller than the network's image may have no pixel of it.
            mask.contains(&true).then_some((detection, mask))
        };
        let pasted: Vec<_> = detections.into_par_iter().filter_map(paste).collect();
        pasted
            .into_iter()
            .enumerate()
            .map(|(index, (detection, mask))| {
                let (_, score) = detection.best();
                let [_, scores @ ..] = detection.classes;
                Ok(Instance::new(index, mask, scores, score)?)
            })
            .collect()
    }
}

/// Probabilities by logits that are divided by a temperature (Guo et al. 2017, "On Calibration of
/// Modern Neural Networks").
pub fn softmax(logits: &[f32; CLASSES], temperature: f64) -> [f64; CLASSES] {
    let most = logits.iter().copied().fold(f32::NEG_INFINITY, f32::max);
    let weights = logits.map(|logit| (f64::from(logit - most) / temperature).exp());
    let sum: f64 = weights.iter().sum();
    weights.map(|weight| weight / sum)
}

#[cfg(test)]
mod tests {
    use credence_nn::seed_parameters;
    use credence_types::{Intrinsics, Pose, stream};

    use super::*;

    #[test]
    fn a_temperature_flattens_or_sharpens() {
        let mut logits = [0.0; CLASSES];
        logits[3] = 4.0_f32.ln();
        assert!((softmax(&logits, 1.0)[3] - 0.4).abs() < 1e-6);
        assert!((softmax(&logits, 2.0)[3] - 0.25).abs() < 1e-6);
        assert!((softmax(&logits, 0.5)[3] - 16.0 / 22.0).abs() < 1e-6);
        assert!((softmax(&[1e30; CLASSES], 1.0).iter().sum::<f64>() - 1.0).abs() < 1e-12);
    }

    /// A network that has learned nothing.
    fn untrained() -> MaskRcnnNetwork {
        let network = MaskRcnnNetwork::new(&Device::flex());
        seed_parameters(network, &mut stream(1, "test/maskrcnn"))
    }

    fn frame(depth_m: f32) -> Frame {
        let camera = Intrinsics::new([640, 480], [616.0; 2], [319.5, 239.5]).unwrap();
        let rgb = (0..640 * 480).map(|i| [(i % 255) as u8, (i / 640 % 255) as u8, 30]);
        let mut depth = vec![depth_m; 640 * 480];
        // A frame without any depth is none; the network does not see this pixel.
        depth[1] = 0.5;
        Frame::new(rgb.collect(), depth, camera, Pose::identity(), None).unwrap()
    }

    #[test]
    fn instances_are_sound_sorted_and_the_same_whenever_asked() {
        let segmenter = MaskRcnn::new(untrained(), Input::ColourAndDepth);
        let instances = segmenter.segment(&frame(0.5)).unwrap();
        assert!(
            !instances.is_empty(),
            "a network that knows nothing sees things"
        );
        assert!(instances.is_sorted_by(|a, b| a.score() >= b.score()));
        assert!(instances.iter().all(|i| i.mask().len() == 640 * 480));
        assert_eq!(segmenter.segment(&frame(0.5)).unwrap(), instances);
        let silent = MaskRcnn::new(untrained(), Input::ColourAndDepth).with_least_score(1.0);
        assert_eq!(silent.segment(&frame(0.5)).unwrap(), []);
    }

    #[test]
    fn colour_alone_does_not_hear_of_depth() {
        let look = |input, depth_m| {
            let segmenter = MaskRcnn::new(untrained(), input);
            segmenter.segment(&frame(depth_m)).unwrap()
        };
        assert_eq!(look(Input::Colour, 0.5), look(Input::Colour, f32::NAN));
        let both = Input::ColourAndDepth;
        assert_ne!(look(both, 0.5), look(both, f32::NAN));
        // Depth that was not measured is depth that is withheld.
        assert_eq!(look(Input::Colour, 0.5), look(both, f32::NAN));
    }

    #[test]
    fn the_temperature_is_that_of_the_input_until_it_is_waived() {
        let network = untrained().with_temperatures([1.5, 2.0], &Device::flex());
        let of = |input| MaskRcnn::new(network.clone(), input);
        assert_eq!(of(Input::Colour).temperature(), 1.5);
        assert_eq!(of(Input::ColourAndDepth).temperature(), 2.0);
        assert_eq!(of(Input::Colour).uncalibrated().temperature(), 1.0);
    }

    #[test]
    fn weights_that_are_missing_or_of_another_network_are_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("maskrcnn.safetensors");
        let message = |input| MaskRcnn::from_file(&path, input).unwrap_err().to_string();
        assert!(message(Input::Colour).contains("maskrcnn.safetensors"));
        let linear = burn::nn::LinearConfig::new(2, 2).init(&Device::flex());
        weights::save::<burn::nn::Linear>(&linear, &path).unwrap();
        assert!(
            message(Input::Colour).contains("it has no tensor"),
            "{}",
            message(Input::Colour)
        );
        let cold = untrained().with_temperatures([0.0, 1.0], &Device::flex());
        weights::save(&cold, &path).unwrap();
        assert!(
            message(Input::Colour).contains("a temperature of 0"),
            "{}",
            message(Input::Colour)
        );
        std::fs::write(&path, b"no weights").unwrap();
        assert!(message(Input::ColourAndDepth).contains("maskrcnn.safetensors"));
    }

    #[test]
    fn frames_of_any_size_are_looked_at() {
        let segmenter = MaskRcnn::new(untrained(), Input::ColourAndDepth);
        for [width, height] in [[16, 16], [240, 320], [1000, 1000], [1280, 720]] {
            let camera = Intrinsics::new([width, height], [300.0; 2], [8.0; 2]).unwrap();
            let rgb = (0..width * height).map(|i| [(i % 255) as u8, (i / width % 255) as u8, 30]);
            let depth = vec![0.5; width * height];
            let frame = Frame::new(rgb.collect(), depth, camera, Pose::identity(), None).unwrap();
            for instance in segmenter.segment(&frame).unwrap() {
                assert_eq!(instance.mask().len(), width * height);
            }
        }
    }
}
