//! The scorer.

use credence_score::{self, BinaryMetrics, MeshTruth};
use credence_types::TriMesh;
use nalgebra::Vector3;
use numpy::{IntoPyArray as _, PyArray1};
use pyo3::{prelude::*, types::PyDict};

use crate::{arrays::Array, errors::to_python};

/// A true mesh, ready to be measured against.
#[pyclass(name = "MeshTruth", module = "harness._native", frozen)]
pub(crate) struct PyMeshTruth(MeshTruth);

#[pymethods]
impl PyMeshTruth {
    #[new]
    fn new(py: Python<'_>, vertices: Array<'_, f64>, faces: Array<'_, u32>) -> PyResult<Self> {
        let vertices = vertices.points("vertices")?;
        let faces = faces
            .values("faces", &[None, Some(3)])?
            .chunks_exact(3)
            .map(|f| [f[0], f[1], f[2]])
            .collect();
        py.detach(|| {
            let mesh = TriMesh::new(vertices, faces).map_err(|err| to_python(&err))?;
            MeshTruth::new(&mesh)
                .map(Self)
                .map_err(|err| to_python(&err))
        })
    }

    /// Number of faces left out because they have no area.
    #[getter]
    fn degenerate_faces(&self) -> usize {
        self.0.degenerate_faces()
    }

    fn distances<'py>(
        &self,
        py: Python<'py>,
        points: Array<'py, f64>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let points = points.points("points")?;
        let distances = py
            .detach(|| self.0.distances(&points))
            .map_err(|err| to_python(&err))?;
        Ok(distances.into_pyarray(py))
    }

    fn ray_depths<'py>(
        &self,
        py: Python<'py>,
        origins: Array<'py, f64>,
        directions: Array<'py, f64>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let origins = origins.points("origins")?;
        let directions: Vec<Vector3<f64>> = directions
            .points("directions")?
            .into_iter()
            .map(|direction| direction.coords)
            .collect();
        let depths = py
            .detach(|| self.0.ray_depths(&origins, &directions))
            .map_err(|err| to_python(&err))?;
        Ok(depths.into_pyarray(py))
    }
}

#[pyfunction]
#[pyo3(signature = (*, points, observed))]
pub(crate) fn nearest_observation<'py>(
    py: Python<'py>,
    points: Array<'py, f64>,
    observed: Array<'py, f64>,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let points = points.points("points")?;
    let observed = observed.points("observed")?;
    let distances = py
        .detach(|| credence_score::nearest_observation(&points, &observed))
        .map_err(|err| to_python(&err))?;
    Ok(distances.into_pyarray(py))
}

#[pyfunction]
#[pyo3(signature = (*, predicted, truth, probability = None, decision_confidence = None))]
pub(crate) fn binary_metrics<'py>(
    py: Python<'py>,
    predicted: Array<'py, bool>,
    truth: Array<'py, bool>,
    probability: Option<Array<'py, f64>>,
    decision_confidence: Option<Array<'py, f64>>,
) -> PyResult<Bound<'py, PyDict>> {
    let predicted = predicted.values("predicted", &[None])?;
    let truth = truth.values("truth", &[None])?;
    let optional = |name, array: Option<Array<'py, f64>>| {
        array.map(|array| array.values(name, &[None])).transpose()
    };
    let probability = optional("probability", probability)?;
    let confidence = optional("decision_confidence", decision_confidence)?;
    let metrics = py
        .detach(|| {
            BinaryMetrics::evaluate(
                &predicted,
                &truth,
                probability.as_deref(),
                confidence.as_deref(),
            )
        })
        .map_err(|err| to_python(&err))?;
    let counts = metrics.confusion;
    let result = PyDict::new(py);
    for (name, count) in [
        ("tp", counts.true_positives),
        ("tn", counts.true_negatives),
        ("fp", counts.false_positives),
        ("fn", counts.false_negatives),
    ] {
        result.set_item(name, count)?;
    }
    for (name, value) in [
        ("precision", counts.precision()),
        ("recall", counts.recall()),
        ("f1", counts.f1()),
        ("accuracy", counts.accuracy()),
        ("mcc", counts.mcc()),
        ("auroc", metrics.auroc),
        ("average_precision", metrics.average_precision),
        ("ece", metrics.ece),
        ("ece_equal_mass", metrics.ece_equal_mass),
        ("brier", metrics.brier),
        ("nll", metrics.nll),
        ("aurc", metrics.aurc),
        ("excess_aurc", metrics.excess_aurc),
        ("random_aurc", metrics.random_aurc),
        ("risk_at_50", metrics.risk_at_50),
        ("risk_at_80", metrics.risk_at_80),
        ("precision_at_50", metrics.precision_at_50),
        ("precision_at_80", metrics.precision_at_80),
    ] {
        result.set_item(name, value)?;
    }
    Ok(result)
}
