//! What classifiers say, as arrays.

use std::collections::BTreeMap;

use credence_pipeline::{Classification, NetworkView, gp::Hyperparameters};
use credence_types::{Category, Prediction};
use numpy::{PyArray1, PyArray2, ToPyArray as _, ndarray::Array2};
use pyo3::prelude::*;

use crate::arrays::rows;

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
pub(crate) struct PyPredictions(pub(crate) Classification);

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
