//! The pipeline: frames in, predictions out.

use credence_pipeline::{Config, ModelChoice, Pipeline, PipelineError, StageTime, map::ObjectId};
use numpy::{PyArray1, PyArray2, ToPyArray as _};
use pyo3::{prelude::*, types::PyMapping};

use crate::{
    arrays::{Array, rows},
    completion::PyCompletion,
    errors::to_python,
    frame::read_frame,
    map::{PyMappedObject, PyOccupancyMap, PyVoxels},
    predictions::PyPredictions,
    segmentation::read_detections,
    stages,
    training::PyTrainingSet,
};

/// Checks the JSON text of a pipeline configuration, whether a pipeline can be made of it, and
/// returns it with every default written out.
#[pyfunction]
pub(crate) fn check_pipeline_config(py: Python<'_>, text: &str) -> PyResult<String> {
    let read = || {
        let config = Config::from_json(text)?;
        Ok((config.to_json()?, config))
    };
    let (whole, config) = read().map_err(|err: PipelineError| to_python(&err))?;
    stages::pipeline(py, config)?;
    Ok(whole)
}

/// A (logits, directions) pair, (n,) and (n, 3).
type LogitsAndDirections<'py> = (Bound<'py, PyArray1<f64>>, Bound<'py, PyArray2<f64>>);

/// From frames to a semantic map to classified points.
#[pyclass(name = "Pipeline", module = "harness._native")]
pub(crate) struct PyPipeline(Pipeline);

#[pymethods]
impl PyPipeline {
    #[new]
    #[pyo3(signature = (config = "{}"))]
    fn new(py: Python<'_>, config: &str) -> PyResult<Self> {
        let config = Config::from_json(config).map_err(|err| to_python(&err))?;
        stages::pipeline(py, config).map(Self)
    }

    #[getter]
    fn segmenter(&self) -> String {
        self.0.config().segmenter.to_string()
    }

    #[getter]
    fn completer(&self) -> String {
        self.0.config().completer.to_string()
    }

    #[getter]
    fn models(&self) -> Vec<String> {
        let models = self.0.config().gp.models.iter();
        models.map(ToString::to_string).collect()
    }

    /// Inserts a frame; returns the ids of the objects seen, in the order of the instances.
    #[pyo3(signature = (
        *, rgb, depth_m, intrinsics, world_from_camera, instance_ids = None, categories = None,
        detections = None
    ))]
    #[expect(clippy::too_many_arguments, reason = "keyword arguments in Python")]
    fn add_frame(
        &mut self,
        py: Python<'_>,
        rgb: Array<'_, u8>,
        depth_m: Array<'_, f32>,
        intrinsics: &Bound<'_, PyAny>,
        world_from_camera: Array<'_, f64>,
        instance_ids: Option<Array<'_, u16>>,
        categories: Option<&Bound<'_, PyMapping>>,
        detections: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Vec<Option<u32>>> {
        let frame = read_frame(
            py,
            &rgb,
            &depth_m,
            intrinsics,
            &world_from_camera,
            instance_ids.as_ref(),
            categories,
        )?;
        let instances = detections
            .map(|detections| read_detections(detections, &frame))
            .transpose()?;
        py.detach(|| {
            let report = match &instances {
                None => self.0.add_frame(&frame),
                Some(instances) => self.0.add_segmented(&frame, instances),
            };
            let objects = report.map_err(|err| to_python(&err))?.objects;
            Ok(objects.iter().map(|id| id.map(|id| id.0)).collect())
        })
    }

    /// A pipeline that stands where this one does, under another configuration of the later stages.
    fn reconfigured(&self, py: Python<'_>, config: &str) -> PyResult<Self> {
        let config = Config::from_json(config).map_err(|err| to_python(&err))?;
        stages::reconfigured(py, &self.0, config).map(Self)
    }

    /// Indices of the frames that a reconfigured pipeline is to complete again.
    #[getter]
    fn frames_to_complete(&self) -> Vec<usize> {
        self.0.frames_to_complete().collect()
    }

    /// Completes the objects of the next of them.
    #[pyo3(signature = (
        index, *, rgb, depth_m, intrinsics, world_from_camera, instance_ids = None,
        categories = None, detections
    ))]
    #[expect(clippy::too_many_arguments, reason = "keyword arguments in Python")]
    fn complete_frame(
        &mut self,
        py: Python<'_>,
        index: usize,
        rgb: Array<'_, u8>,
        depth_m: Array<'_, f32>,
        intrinsics: &Bound<'_, PyAny>,
        world_from_camera: Array<'_, f64>,
        instance_ids: Option<Array<'_, u16>>,
        categories: Option<&Bound<'_, PyMapping>>,
        detections: &Bound<'_, PyAny>,
    ) -> PyResult<()> {
        let frame = read_frame(
            py,
            &rgb,
            &depth_m,
            intrinsics,
            &world_from_camera,
            instance_ids.as_ref(),
            categories,
        )?;
        let instances = read_detections(detections, &frame)?;
        py.detach(|| self.0.complete_frame(index, &frame, &instances))
            .map_err(|err| to_python(&err))
    }

    /// The tracked objects by rising id.
    fn objects(&self, py: Python<'_>) -> Vec<PyMappedObject> {
        let copy = || self.0.map().objects().cloned().map(PyMappedObject);
        py.detach(|| copy().collect())
    }

    /// The occupied voxels.
    fn voxels(&self, py: Python<'_>) -> PyVoxels {
        py.detach(|| PyVoxels {
            voxels: self.0.map().voxels().collect(),
            size_m: self.0.map().config().resolution_m,
        })
    }

    /// The completed shape of an object: what all views gave, together; None if none completed it.
    fn completion(&mut self, py: Python<'_>, object_id: u32) -> PyResult<Option<PyCompletion>> {
        py.detach(|| self.0.completion(ObjectId(object_id)))
            .map(|completion| completion.map(PyCompletion))
            .map_err(|err| to_python(&err))
    }

    /// What each view that completed an object gave of it.
    fn view_completions(&self, py: Python<'_>, object_id: u32) -> PyResult<Vec<PyCompletion>> {
        let copy = || {
            let views = self.0.view_completions(ObjectId(object_id))?;
            Ok(views.iter().cloned().map(PyCompletion).collect())
        };
        py.detach(copy)
            .map_err(|err: PipelineError| to_python(&err))
    }

    /// Why an object has no completion; None if it has one.
    fn uncompleted(&self, object_id: u32) -> PyResult<Option<String>> {
        let why = self.0.uncompleted(ObjectId(object_id));
        why.map_err(|err| to_python(&err))
    }

    #[pyo3(signature = (object_id, *, seed))]
    fn training_set(
        &mut self,
        py: Python<'_>,
        object_id: u32,
        seed: u64,
    ) -> PyResult<PyTrainingSet> {
        py.detach(|| self.0.training_set(ObjectId(object_id), seed))
            .map(PyTrainingSet)
            .map_err(|err| to_python(&err))
    }

    #[pyo3(signature = (
        object_id, training, test_points, *, model = "metric", completion_confidence = None
    ))]
    fn classify(
        &mut self,
        py: Python<'_>,
        object_id: u32,
        training: &PyTrainingSet,
        test_points: Array<'_, f64>,
        model: &str,
        completion_confidence: Option<Array<'_, f64>>,
    ) -> PyResult<PyPredictions> {
        let model: ModelChoice = model.parse().map_err(|err| to_python(&err))?;
        let points = test_points.points("test_points")?;
        let completion = completion_confidence
            .map(|values| values.values("completion_confidence", &[Some(points.len())]))
            .transpose()?;
        py.detach(|| {
            let id = ObjectId(object_id);
            self.0
                .classify(id, &training.0, &points, completion.as_deref(), model)
        })
        .map(PyPredictions)
        .map_err(|err| to_python(&err))
    }

    /// (logits, directions) of points by the query network, (n,) and (n, 3).
    fn query_embedding<'py>(
        &mut self,
        py: Python<'py>,
        object_id: u32,
        training: &PyTrainingSet,
        points: Array<'py, f64>,
    ) -> PyResult<LogitsAndDirections<'py>> {
        let points = points.points("points")?;
        let embedded = py
            .detach(|| {
                let id = ObjectId(object_id);
                self.0.query_embedding(id, &training.0, &points)
            })
            .map_err(|err| to_python(&err))?;
        let logits: Vec<f64> = embedded.iter().map(|query| query.logit).collect();
        let directions: Vec<[f64; 3]> = embedded.iter().map(|query| query.direction).collect();
        Ok((logits.to_pyarray(py), rows(&directions).to_pyarray(py)))
    }

    /// Writes the confidences of test points into the map; returns the number of voxels set.
    fn annotate(
        &mut self,
        py: Python<'_>,
        object_id: u32,
        test_points: Array<'_, f64>,
        predictions: &PyPredictions,
    ) -> PyResult<usize> {
        let points = test_points.points("test_points")?;
        py.detach(|| {
            self.0
                .annotate(ObjectId(object_id), &points, &predictions.0)
        })
        .map_err(|err| to_python(&err))
    }

    /// A copy of the map's octree.
    fn occupancy(&self, py: Python<'_>) -> PyOccupancyMap {
        py.detach(|| PyOccupancyMap(self.0.map().occupancy().clone()))
    }

    /// (stage, model, seconds) in order of first use.
    fn timings(&self) -> Vec<(&'static str, Option<String>, f64)> {
        let row = |time: &StageTime| {
            let model = time.model.map(|model| model.to_string());
            (time.stage, model, time.seconds)
        };
        self.0.times().iter().map(row).collect()
    }
}
