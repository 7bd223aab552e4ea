//! Segmentation by itself: frames in, detections out.

use credence_pipeline::{ChosenSegmenter, Config, PipelineError, outer_box};
use credence_types::{Category, Frame, Instance};
use numpy::{PyArray1, PyArray2, ToPyArray as _, ndarray::Array2};
use pyo3::{
    exceptions::{PyTypeError, PyValueError},
    prelude::*,
    types::{PyMapping, PySequence},
};

use crate::{arrays::Array, errors::to_python, frame::read_frame, function::type_name, stages};

/// The segmenter that a pipeline's configuration names.
#[pyclass(name = "Segmenter", module = "harness._native", frozen)]
pub(crate) struct PySegmenter(ChosenSegmenter);

#[pymethods]
impl PySegmenter {
    #[new]
    #[pyo3(signature = (config = "{}"))]
    fn new(py: Python<'_>, config: &str) -> PyResult<Self> {
        let config = Config::from_json(config).map_err(|err| to_python(&err))?;
        let foreign = stages::segmenter(py, &config)?;
        py.detach(|| ChosenSegmenter::new(&config, foreign))
            .map(Self)
            .map_err(|err: PipelineError| to_python(&err))
    }

    #[getter]
    fn name(&self) -> String {
        self.0.choice().to_string()
    }

    /// What a network's logits are divided by to make its scores probabilities; None of others.
    #[getter]
    fn temperature(&self, py: Python<'_>) -> PyResult<Option<f64>> {
        py.detach(|| self.0.temperature())
            .map_err(|err| to_python(&err))
    }

    /// Finds the objects in a frame.
    #[pyo3(signature = (
        *, rgb, depth_m, intrinsics, world_from_camera, instance_ids = None, categories = None
    ))]
    #[expect(clippy::too_many_arguments, reason = "keyword arguments in Python")]
    fn segment(
        &self,
        py: Python<'_>,
        rgb: Array<'_, u8>,
        depth_m: Array<'_, f32>,
        intrinsics: &Bound<'_, PyAny>,
        world_from_camera: Array<'_, f64>,
        instance_ids: Option<Array<'_, u16>>,
        categories: Option<&Bound<'_, PyMapping>>,
    ) -> PyResult<Vec<PyDetection>> {
        let frame = read_frame(
            py,
            &rgb,
            &depth_m,
            intrinsics,
            &world_from_camera,
            instance_ids.as_ref(),
            categories,
        )?;
        py.detach(|| {
            let instances = self.0.segment(&frame).map_err(|err| to_python(&err))?;
            let detection = |instance| PyDetection {
                instance,
                size: size(&frame),
            };
            Ok(instances.into_iter().map(detection).collect())
        })
    }
}

/// One object in one frame.
#[pyclass(name = "Detection", module = "harness._native", frozen)]
pub(crate) struct PyDetection {
    instance: Instance,
    /// Height and width of the mask.
    size: [usize; 2],
}

#[pymethods]
impl PyDetection {
    #[new]
    #[pyo3(signature = (*, mask, class_scores, score))]
    fn new(mask: Array<'_, bool>, class_scores: Array<'_, f64>, score: f64) -> PyResult<Self> {
        let size = mask.image_size("mask")?;
        let mask = mask.values("mask", &size.map(Some))?;
        if !mask.contains(&true) {
            return Err(PyValueError::new_err(
                "mask is empty; leave out what covers no pixel",
            ));
        }
        let scores = class_scores.values("class_scores", &[Some(Category::ALL.len())])?;
        let scores = std::array::from_fn(|category| scores[category]);
        let instance = Instance::new(0, mask, scores, score).map_err(|err| to_python(&err))?;
        Ok(Self { instance, size })
    }

    /// Which pixels belong to it, (h, w).
    #[getter]
    fn mask<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<bool>> {
        let [height, width] = self.size;
        let mask = self.instance.mask();
        Array2::from_shape_fn((height, width), |(row, column)| mask[row * width + column])
            .to_pyarray(py)
    }

    /// Left, top, right and bottom of the mask: its pixels' outer edges, (4,).
    #[getter]
    fn r#box<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        outer_box(self.instance.mask(), self.size[1]).to_pyarray(py)
    }

    #[getter]
    fn category(&self) -> &'static str {
        self.instance.category().name()
    }

    #[getter]
    const fn score(&self) -> f64 {
        self.instance.score()
    }

    /// Probability of each category, (6,).
    #[getter]
    fn class_scores<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.instance.class_scores().to_pyarray(py)
    }
}

/// The instances of a list of detections in a frame.
pub(crate) fn read_detections(
    detections: &Bound<'_, PyAny>,
    frame: &Frame,
) -> PyResult<Vec<Instance>> {
    let listed = detections.cast::<PySequence>().map_err(|_err| {
        PyTypeError::new_err(format!(
            "detections is of type {}; expected a list of detections, as Segmenter.segment gives",
            type_name(detections)
        ))
    })?;
    let read = |index: usize| {
        let entry = listed.get_item(index)?;
        let detection = entry.cast::<PyDetection>().map_err(|_err| {
            PyTypeError::new_err(format!(
                "detections[{index}] is of type {}; expected a Detection",
                type_name(&entry)
            ))
        })?;
        let PyDetection {
            instance,
            size: found,
        } = detection.get();
        let expected = size(frame);
        if *found != expected {
            return Err(PyValueError::new_err(format!(
                "the mask of detections[{index}] has shape {}; the frame's images have {}",
                shape(*found),
                shape(expected)
            )));
        }
        Ok(instance.clone())
    };
    (0..listed.len()?).map(read).collect()
}

/// Height and width of a frame's images.
fn size(frame: &Frame) -> [usize; 2] {
    let camera = frame.intrinsics();
    [camera.height(), camera.width()]
}

/// As numpy writes it.
fn shape([height, width]: [usize; 2]) -> String {
    format!("({height}, {width})")
}
