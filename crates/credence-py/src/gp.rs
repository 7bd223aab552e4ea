//! The exact Gaussian process by itself, for comparisons with other implementations.

use credence_pipeline::{
    SmoothnessChoice,
    gp::{Covariance, DirichletGp, Hyperparameters, Points, TrainingSet},
};
use numpy::{PyArray1, PyArray2, ToPyArray as _, ndarray::Array2};
use pyo3::prelude::*;

use crate::{arrays::Array, errors::to_python};

/// One model of the given hyperparameters, one value per class.
struct Problem {
    gp: DirichletGp,
    training: TrainingSet,
    hyperparameters: Vec<Hyperparameters>,
}

fn coordinates(name: &'static str, array: &Array<'_, f64>) -> PyResult<Points> {
    let rows = array.values(name, &[None, Some(3)])?;
    Points::from_rows(name, &rows, 3).map_err(|err| to_python(&err))
}

fn problem(
    points: &Array<'_, f64>,
    labels: &Array<'_, u8>,
    [lengthscales, outputscales, means]: [&Array<'_, f64>; 3],
    smoothness: &str,
) -> PyResult<Problem> {
    let smoothness: SmoothnessChoice = smoothness.parse().map_err(|err| to_python(&err))?;
    let labels: Vec<usize> = labels
        .values("labels", &[None])?
        .into_iter()
        .map(usize::from)
        .collect();
    let lengthscales = lengthscales.values("lengthscales", &[None])?;
    let classes = lengthscales.len();
    let outputscales = outputscales.values("outputscales", &[Some(classes)])?;
    let means = means.values("means", &[Some(classes)])?;
    let training = TrainingSet::new(coordinates("points", points)?, &labels, classes)
        .map_err(|err| to_python(&err))?;
    Ok(Problem {
        gp: DirichletGp {
            smoothness: smoothness.into(),
            ..DirichletGp::default()
        },
        training,
        hyperparameters: (0..classes)
            .map(|class| Hyperparameters {
                lengthscale: lengthscales[class],
                outputscale: outputscales[class],
                mean: means[class],
            })
            .collect(),
    })
}

/// A (values, gradients) pair: (C,) and (C, 3).
type Likelihoods<'py> = (Bound<'py, PyArray1<f64>>, Bound<'py, PyArray2<f64>>);

#[pyfunction]
#[pyo3(signature = (*, points, labels, lengthscales, outputscales, means, smoothness = "5/2"))]
pub(crate) fn gp_log_likelihood<'py>(
    py: Python<'py>,
    points: Array<'py, f64>,
    labels: Array<'py, u8>,
    lengthscales: Array<'py, f64>,
    outputscales: Array<'py, f64>,
    means: Array<'py, f64>,
    smoothness: &str,
) -> PyResult<Likelihoods<'py>> {
    let hyperparameters = [&lengthscales, &outputscales, &means];
    let problem = problem(&points, &labels, hyperparameters, smoothness)?;
    let likelihoods = py
        .detach(|| {
            problem.gp.likelihood(
                &problem.training,
                &Covariance::Classic,
                &problem.hyperparameters,
            )
        })
        .map_err(|err| to_python(&err))?;
    let values: Vec<f64> = likelihoods.iter().map(|l| l.per_datum).collect();
    let gradients = Array2::from_shape_fn((likelihoods.len(), 3), |(class, parameter)| {
        let gradient = &likelihoods[class].gradient;
        [gradient.lengthscale, gradient.outputscale, gradient.mean][parameter]
    });
    Ok((values.to_pyarray(py), gradients.to_pyarray(py)))
}

/// A (means, variances) pair, each (C, M).
type MeansAndVariances<'py> = (Bound<'py, PyArray2<f64>>, Bound<'py, PyArray2<f64>>);

#[pyfunction]
#[pyo3(signature = (
    *, points, labels, test_points, lengthscales, outputscales, means, smoothness = "5/2"
))]
#[expect(clippy::too_many_arguments, reason = "keyword arguments in Python")]
pub(crate) fn gp_posterior<'py>(
    py: Python<'py>,
    points: Array<'py, f64>,
    labels: Array<'py, u8>,
    test_points: Array<'py, f64>,
    lengthscales: Array<'py, f64>,
    outputscales: Array<'py, f64>,
    means: Array<'py, f64>,
    smoothness: &str,
) -> PyResult<MeansAndVariances<'py>> {
    let hyperparameters = [&lengthscales, &outputscales, &means];
    let problem = problem(&points, &labels, hyperparameters, smoothness)?;
    let test = coordinates("test_points", &test_points)?;
    let posterior = py
        .detach(|| {
            problem.gp.posterior(
                &problem.training,
                &Covariance::Classic,
                &problem.hyperparameters,
                &test,
            )
        })
        .map_err(|err| to_python(&err))?;
    let array = |rows: &[Vec<f64>]| {
        Array2::from_shape_fn((posterior.classes(), posterior.points()), |(c, p)| {
            rows[c][p]
        })
        .to_pyarray(py)
    };
    Ok((array(posterior.mean()), array(posterior.variance())))
}
