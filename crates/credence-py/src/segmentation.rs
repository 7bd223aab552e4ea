//! Segmentation by itself: frames in, detections out.

use credence_pipeline::{ChosenSegmenter, Config, PipelineError, outer_box};
use credence_types::{Instance, Intrinsics};
use numpy::{PyArray1, PyArray2, ToPyArray as _, ndarray::Array2};
use pyo3::{prelude::*, types::PyMapping};

use crate::{arrays::Array, errors::to_python, frame::read_frame, stages};

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
                camera: *frame.intrinsics(),
            };
            Ok(instances.into_iter().map(detection).collect())
        })
    }
}

/// One object in one frame.
#[pyclass(name = "Detection", module = "harness._native", frozen)]
pub(crate) struct PyDetection {
    instance: Instance,
    camera: Intrinsics,
}

#[pymethods]
impl PyDetection {
    /// Which pixels belong to it, (h, w).
    #[getter]
    fn mask<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<bool>> {
        let (height, width) = (self.camera.height(), self.camera.width());
        let mask = self.instance.mask();
        Array2::from_shape_fn((height, width), |(row, column)| mask[row * width + column])
            .to_pyarray(py)
    }

    /// Left, top, right and bottom of the mask: its pixels' outer edges, (4,).
    #[getter]
    fn r#box<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        outer_box(self.instance.mask(), &self.camera).to_pyarray(py)
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
