//! Training points as arrays.

use credence_pipeline::{PipelineError, TrainingSet};
use credence_types::Point;
use numpy::{PyArray1, PyArray2, ToPyArray as _};
use pyo3::prelude::*;

use crate::{
    arrays::{self, Array},
    errors::to_python,
};

/// What a classifier learns about one object.
#[pyclass(name = "TrainingSet", module = "harness._native", frozen)]
pub(crate) struct PyTrainingSet(pub(crate) TrainingSet);

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
