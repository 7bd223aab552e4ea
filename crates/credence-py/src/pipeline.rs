//! The pipeline: frames in, predictions out.

use std::collections::BTreeMap;

use credence_pipeline::{
    Classification, Config, ModelChoice, NetworkView, Pipeline, PipelineError, StageTime,
    TrainingSet, gp::Hyperparameters, map::ObjectId,
};
use credence_types::{Category, Point, Prediction};
use numpy::{PyArray1, PyArray2, ToPyArray as _, ndarray::Array2};
use pyo3::{prelude::*, types::PyMapping};

use crate::{
    arrays::{self, Array},
    completion::PyCompletion,
    errors::to_python,
    frame::read_frame,
    map::{PyMappedObject, PyOccupancyMap, PyVoxels},
    stages,
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

/// What a classifier learns about one object.
#[pyclass(name = "TrainingSet", module = "harness._native", frozen)]
pub(crate) struct PyTrainingSet(TrainingSet);

#[pymethods]
impl PyTrainingSet {
    #[new]
    #[pyo3(signature = (points_world, classes, *, viewpoint_world = None))]
    fn new(
        points_world: Array<'_, f64>,
        classes: Array<'_, u8>,
        viewpoint_world: Option<Array<'_, f64>>,
    ) -> PyResult<Self> {
        let points_world = points_world.points("points_world")?;
        let classes = classes.values("classes", &[Some(points_world.len())])?;
        let viewpoint = viewpoint_world
            .map(|viewpoint| viewpoint.values("viewpoint_world", &[Some(3)]))
            .transpose()?;
        let made = || {
            let set = TrainingSet::new(points_world, classes)?;
            match viewpoint {
                None => Ok(set),
                Some(v) => set.with_viewpoint(Point::new(v[0], v[1], v[2])),
            }
        };
        made()
            .map(Self)
            .map_err(|err: PipelineError| to_python(&err))
    }

    /// Mean camera centre of the views of the object, (3,), if it is known.
    #[getter]
    fn viewpoint_world<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray1<f64>>> {
        let viewpoint = self.0.viewpoint_world()?;
        Some(viewpoint.coords.as_slice().to_pyarray(py))
    }

    #[getter]
    fn points_world<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        arrays::from_points(self.0.points_world()).to_pyarray(py)
    }

    #[getter]
    fn classes<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<u8>> {
        self.0.classes().to_pyarray(py)
    }
}

/// Fitted hyperparameters of one class's process.
#[pyclass(name = "Hyperparameters", module = "harness._native", frozen)]
pub(crate) struct PyHyperparameters(Hyperparameters);

#[pymethods]
impl PyHyperparameters {
    #[getter]
    const fn lengthscale_m(&self) -> f64 {
        self.0.lengthscale
    }

    #[getter]
    const fn outputscale(&self) -> f64 {
        self.0.outputscale
    }

    #[getter]
    const fn mean(&self) -> f64 {
        self.0.mean
    }
}

/// What a classifier says of test points.
#[pyclass(name = "Predictions", module = "harness._native", frozen)]
pub(crate) struct PyPredictions(Classification);

impl PyPredictions {
    fn column<'py, T: numpy::Element>(
        &self,
        py: Python<'py>,
        value: impl Fn(&Prediction) -> T,
    ) -> Bound<'py, PyArray1<T>> {
        let values: Vec<T> = self.0.predictions.points.iter().map(value).collect();
        values.to_pyarray(py)
    }

    fn names(&self) -> impl Iterator<Item = &'static str> {
        let classes = self.0.predictions.classes.iter();
        classes.map(|class| Category::from_class(*class).map_or("free", Category::name))
    }
}

#[pymethods]
impl PyPredictions {
    /// Names of the classes that the classifier chose from, in the order of the probabilities.
    #[getter]
    fn class_names(&self) -> Vec<&'static str> {
        self.names().collect()
    }

    #[getter]
    fn classes<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<u8>> {
        self.column(py, |point| point.class)
    }

    #[getter]
    fn probabilities<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        let predictions = &self.0.predictions;
        let classes = predictions.classes.len();
        Array2::from_shape_fn((predictions.points.len(), classes), |(point, class)| {
            predictions.probabilities[point * classes + class]
        })
        .to_pyarray(py)
    }

    #[getter]
    fn variance<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.column(py, |point| point.variance)
    }

    #[getter]
    fn score<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.column(py, |point| point.score)
    }

    #[getter]
    fn confidence<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.column(py, |point| point.confidence)
    }

    #[getter]
    const fn clamped_share(&self) -> f64 {
        self.0.predictions.clamped_share
    }

    /// Whether each point's variance was below zero and clamped.
    #[getter]
    fn clamped<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<bool>> {
        self.0.clamped.to_pyarray(py)
    }

    #[getter]
    const fn jitter(&self) -> f64 {
        self.0.predictions.jitter
    }

    #[getter]
    fn hyperparameters(&self) -> BTreeMap<&'static str, PyHyperparameters> {
        let values = self.0.hyperparameters.iter().copied();
        self.names().zip(values.map(PyHyperparameters)).collect()
    }

    /// Variance of the latent difference between the object's category and free space.
    #[getter]
    fn difference_variance<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray1<f64>>> {
        let variance = self.0.difference_variance.as_ref()?;
        Some(variance.to_pyarray(py))
    }

    /// Weight of the model against its fallback; 1 without one.
    #[getter]
    const fn gate(&self) -> f64 {
        self.0.gate
    }

    /// The query network's own probability of the object's category.
    #[getter]
    fn prior_probability<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray1<f64>>> {
        let network = self.0.network.as_ref()?;
        Some(network.probability.to_pyarray(py))
    }

    /// Place of each point in the unit ball.
    #[getter]
    fn embedding<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray2<f64>>> {
        let network = self.0.network.as_ref()?;
        Some(rows(&network.embedding).to_pyarray(py))
    }

    /// Mean negative log likelihood of the training points under the query network.
    #[getter]
    fn ood(&self) -> Option<f64> {
        self.0
            .network
            .as_ref()
            .map(|network: &NetworkView| network.ood)
    }

    /// Number of classes whose fit did not end by its tolerances.
    #[getter]
    fn fits_unconverged(&self) -> usize {
        self.0.fits.iter().filter(|fit| !fit.converged).count()
    }

    /// Number of classes whose hyperparameters ended at the edge of the range searched.
    #[getter]
    fn fits_at_bound(&self) -> usize {
        self.0.fits.iter().filter(|fit| fit.at_bound).count()
    }
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
        *, rgb, depth_m, intrinsics, world_from_camera, instance_ids = None, categories = None
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
        py.detach(|| {
            let report = self.0.add_frame(&frame).map_err(|err| to_python(&err))?;
            Ok(report.objects.iter().map(|id| id.map(|id| id.0)).collect())
        })
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

fn rows(vectors: &[[f64; 3]]) -> Array2<f64> {
    Array2::from_shape_fn((vectors.len(), 3), |(row, axis)| vectors[row][axis])
}
