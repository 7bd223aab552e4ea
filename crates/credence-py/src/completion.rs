//! Completed shapes as arrays.

use std::path::PathBuf;

use credence_pipeline::ObjectCompletion;
use numpy::{PyArray1, PyArray2, ToPyArray as _};
use pyo3::prelude::*;

use crate::{arrays, errors::to_python};

/// An object's completed shape in the world.
#[pyclass(name = "Completion", module = "harness._native", frozen)]
pub(crate) struct PyCompletion(pub(crate) ObjectCompletion);

#[pymethods]
impl PyCompletion {
    /// What the completer takes the object for.
    #[getter]
    fn category(&self) -> &'static str {
        self.0.category.name()
    }

    /// How sure it is of the object, in [0, 1].
    #[getter]
    const fn score(&self) -> f64 {
        self.0.score
    }

    /// Points on the surface, (n, 3), metres; every prefix is spread evenly.
    #[getter]
    fn points_world<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        arrays::from_points(&self.0.points_world).to_pyarray(py)
    }

    /// Expected distance of each from the true surface, (n,), metres.
    #[getter]
    fn spread_m<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.0.spread_m.to_pyarray(py)
    }

    /// Probability that each lies within 5 mm of the true surface, (n,).
    #[getter]
    fn confidence<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.0.confidence().to_pyarray(py)
    }

    /// Mean distance of the observed points from the completed surface before its registration,
    /// metres; None without one.
    #[getter]
    fn residual_before_m(&self) -> Option<f64> {
        let registration = self.0.registration?;
        Some(registration.residual_before_m)
    }

    /// The same after: never more.
    #[getter]
    fn residual_after_m(&self) -> Option<f64> {
        let registration = self.0.registration?;
        Some(registration.residual_after_m)
    }

    /// Writes points and spreads as PLY.
    fn write_ply(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        let ObjectCompletion {
            points_world,
            spread_m,
            ..
        } = &self.0;
        py.detach(|| credence_io::write_spread_cloud(points_world, spread_m, &path))
            .map_err(|err| to_python(&err))
    }
}
