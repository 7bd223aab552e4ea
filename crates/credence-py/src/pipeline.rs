//! The pipeline: frames in, predictions out.

use std::collections::BTreeMap;

use credence_pipeline::{
    Classification, Config, ModelChoice, Pipeline, StageTime, TrainingSet,
    gp::Hyperparameters,
    map::ObjectId,
};
use credence_types::{Category, Frame, FrameTruth, Intrinsics, Pose, Prediction};
use numpy::{
    PyArray1, PyArray2, PyReadonlyArrayDyn, PyUntypedArrayMethods as _, ToPyArray as _,
    ndarray::Array2,
};
use pyo3::{exceptions::PyValueError, prelude::*, types::PyDict};

use crate::{
    arrays,
    errors::to_python,
    map::{PyMappedObject, PyOccupancyMap, PyVoxels},
};

/// Checks the JSON text of a pipeline configuration.
#[pyfunction]
pub(crate) fn check_pipeline_config(text: &str) -> PyResult<()> {
    Config::from_json(text)
        .map(|_| ())
        .map_err(|err| to_python(&err))
}

/// What a classifier learns about one object.
#[pyclass(name = "TrainingSet", module = "harness._native", frozen)]
pub(crate) struct PyTrainingSet(TrainingSet);

#[pymethods]
impl PyTrainingSet {
    #[new]
    fn new(
        points_world: PyReadonlyArrayDyn<'_, f64>,
        classes: PyReadonlyArrayDyn<'_, u8>,
    ) -> PyResult<Self> {
        let points_world = arrays::points("points_world", &points_world)?;
        let classes = arrays::slice("classes", &classes, &[Some(points_world.len())])?.to_vec();
        Ok(Self(TrainingSet {
            points_world,
            classes,
        }))
    }

    #[getter]
    fn points_world<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        arrays::from_points(&self.0.points_world).to_pyarray(py)
    }

    #[getter]
    fn classes<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<u8>> {
        self.0.classes.to_pyarray(py)
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

    #[getter]
    const fn jitter(&self) -> f64 {
        self.0.predictions.jitter
    }

    #[getter]
    fn hyperparameters(&self) -> BTreeMap<&'static str, PyHyperparameters> {
        let values = self.0.hyperparameters.iter().copied();
        self.names().zip(values.map(PyHyperparameters)).collect()
    }
}

/// From frames to a semantic map to classified points.
#[pyclass(name = "Pipeline", module = "harness._native")]
pub(crate) struct PyPipeline(Pipeline);

#[pymethods]
impl PyPipeline {
    #[new]
    #[pyo3(signature = (config = "{}"))]
    fn new(config: &str) -> PyResult<Self> {
        Config::from_json(config)
            .and_then(Pipeline::new)
            .map(Self)
            .map_err(|err| to_python(&err))
    }

    #[getter]
    fn segmenter(&self) -> String {
        self.0.config().segmenter.to_string()
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
        rgb: PyReadonlyArrayDyn<'_, u8>,
        depth_m: PyReadonlyArrayDyn<'_, f32>,
        intrinsics: [f64; 4],
        world_from_camera: PyReadonlyArrayDyn<'_, f64>,
        instance_ids: Option<PyReadonlyArrayDyn<'_, u16>>,
        categories: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Vec<Option<u32>>> {
        let &[height, width] = depth_m.shape() else {
            return Err(PyValueError::new_err(format!(
                "depth_m has shape {:?}; expected (height, width)",
                depth_m.shape()
            )));
        };
        let image = [Some(height), Some(width)];
        let [fx, fy, cx, cy] = intrinsics;
        let camera = Intrinsics::new([width, height], [fx, fy], [cx, cy])
            .map_err(|err| to_python(&err))?;
        let pose = arrays::matrix4("world_from_camera", &world_from_camera)?;
        let pose =
            Pose::from_matrix("world_from_camera", &pose).map_err(|err| to_python(&err))?;
        let rgb: Vec<[u8; 3]> = arrays::slice("rgb", &rgb, &[image[0], image[1], Some(3)])?
            .chunks_exact(3)
            .map(|c| [c[0], c[1], c[2]])
            .collect();
        let depth_m = arrays::slice("depth_m", &depth_m, &image)?.to_vec();
        let truth = match &instance_ids {
            None => None,
            Some(ids) => Some(FrameTruth {
                instance_ids: arrays::slice("instance_ids", ids, &image)?.to_vec(),
                categories: named_categories(categories)?,
            }),
        };
        py.detach(|| {
            let frame = Frame::new(rgb, depth_m, camera, pose, truth)
                .map_err(|err| to_python(&err))?;
            let report = self.0.add_frame(&frame).map_err(|err| to_python(&err))?;
            Ok(report.objects.iter().map(|id| id.map(|id| id.0)).collect())
        })
    }

    /// The tracked objects by rising id.
    fn objects(&self) -> Vec<PyMappedObject> {
        let objects = self.0.map().objects();
        objects.cloned().map(PyMappedObject).collect()
    }

    /// The occupied voxels.
    fn voxels(&self) -> PyVoxels {
        PyVoxels {
            voxels: self.0.map().voxels().collect(),
            size_m: self.0.map().config().resolution_m,
        }
    }

    #[pyo3(signature = (object_id, *, seed))]
    fn training_set(&mut self, py: Python<'_>, object_id: u32, seed: u64) -> PyResult<PyTrainingSet> {
        py.detach(|| self.0.training_set(ObjectId(object_id), seed))
            .map(PyTrainingSet)
            .map_err(|err| to_python(&err))
    }

    #[pyo3(signature = (object_id, training, test_points, *, model = "classic"))]
    fn classify(
        &mut self,
        py: Python<'_>,
        object_id: u32,
        training: &PyTrainingSet,
        test_points: PyReadonlyArrayDyn<'_, f64>,
        model: &str,
    ) -> PyResult<PyPredictions> {
        let model: ModelChoice = model.parse().map_err(|err| to_python(&err))?;
        let points = arrays::points("test_points", &test_points)?;
        py.detach(|| {
            self.0
                .classify(ObjectId(object_id), &training.0, &points, model)
        })
        .map(PyPredictions)
        .map_err(|err| to_python(&err))
    }

    /// A copy of the map's octree.
    fn occupancy(&self) -> PyOccupancyMap {
        PyOccupancyMap(self.0.map().occupancy().clone())
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

fn named_categories(categories: Option<&Bound<'_, PyDict>>) -> PyResult<BTreeMap<u16, Category>> {
    let mut named = BTreeMap::new();
    for (id, name) in categories.into_iter().flatten() {
        let category: Category = name
            .extract::<String>()?
            .parse()
            .map_err(|err| to_python(&err))?;
        named.insert(id.extract()?, category);
    }
    Ok(named)
}
