//! The occupancy octree by itself, and the semantic map's contents as arrays.

use std::path::PathBuf;

use credence_pipeline::map::{OccupancyMap, SemanticVoxel, TrackedObject};
use credence_types::Point;
use numpy::{PyArray1, PyArray2, ToPyArray as _, ndarray::Array2};
use pyo3::prelude::*;

use crate::{
    arrays::{self, Array},
    errors::to_python,
};

/// Centres (n, 3), edges (n,) and log-odds (n,) of leaves.
type LeafArrays<'py> = (
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray1<f32>>,
);

/// `OctoMap`'s occupancy octree.
#[pyclass(name = "OccupancyMap", module = "harness._native")]
pub(crate) struct PyOccupancyMap(pub(crate) OccupancyMap);

#[pymethods]
impl PyOccupancyMap {
    #[new]
    #[pyo3(signature = (resolution_m = 0.005))]
    fn new(resolution_m: f64) -> PyResult<Self> {
        OccupancyMap::new(resolution_m)
            .map(Self)
            .map_err(|err| to_python(&err))
    }

    /// Reads a `.bt` or `.ot` file.
    #[staticmethod]
    fn read(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        py.detach(|| {
            let tree = credence_io::read_octomap(&path).map_err(|err| to_python(&err))?;
            OccupancyMap::from_tree(&tree)
                .map(Self)
                .map_err(|err| to_python(&err))
        })
    }

    #[getter]
    fn resolution_m(&self) -> f64 {
        self.0.resolution_m()
    }

    #[pyo3(signature = (origin_world, points_world, max_range_m = None))]
    fn insert_scan(
        &mut self,
        py: Python<'_>,
        origin_world: Array<'_, f64>,
        points_world: Array<'_, f64>,
        max_range_m: Option<f64>,
    ) -> PyResult<()> {
        let origin = origin_world.values("origin_world", &[Some(3)])?;
        let origin = Point::new(origin[0], origin[1], origin[2]);
        let points = points_world.points("points_world")?;
        py.detach(|| self.0.insert_scan(&origin, &points, max_range_m))
            .map(|_| ())
            .map_err(|err| to_python(&err))
    }

    fn leaves<'py>(&self, py: Python<'py>) -> LeafArrays<'py> {
        let (centres, sizes, log_odds) = py.detach(|| {
            let (mut centres, mut sizes, mut log_odds) = (Vec::new(), Vec::new(), Vec::new());
            for leaf in self.0.leaves() {
                centres.push(leaf.centre);
                sizes.push(leaf.size_m);
                log_odds.push(leaf.log_odds);
            }
            (centres, sizes, log_odds)
        });
        (
            arrays::from_points(&centres).to_pyarray(py),
            sizes.to_pyarray(py),
            log_odds.to_pyarray(py),
        )
    }

    fn write_bt(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        py.detach(|| credence_io::write_bt(&self.0.to_tree(), &path))
            .map_err(|err| to_python(&err))
    }

    fn write_ot(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        py.detach(|| credence_io::write_ot(&self.0.to_tree(), &path))
            .map_err(|err| to_python(&err))
    }
}

/// A tracked object and what was seen of it.
#[pyclass(name = "MappedObject", module = "harness._native", frozen)]
pub(crate) struct PyMappedObject(pub(crate) TrackedObject);

#[pymethods]
impl PyMappedObject {
    #[getter]
    fn id(&self) -> u32 {
        self.0.id().0
    }

    #[getter]
    fn category(&self) -> &'static str {
        self.0.category().name()
    }

    #[getter]
    fn score(&self) -> f64 {
        self.0.score()
    }

    #[getter]
    fn views(&self) -> u32 {
        self.0.views()
    }

    #[getter]
    fn centroid_world<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        let centroid: [f64; 3] = self.0.centroid().into();
        centroid.to_pyarray(py)
    }

    #[getter]
    fn points_world<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        arrays::from_points(&self.0.cloud().points_world).to_pyarray(py)
    }

    #[getter]
    fn rgb<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<u8>> {
        arrays::from_colours(&self.0.cloud().rgb).to_pyarray(py)
    }

    /// Writes the observed points with their colours as PLY.
    fn write_ply(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        py.detach(|| credence_io::write_point_cloud(self.0.cloud(), &path))
            .map_err(|err| to_python(&err))
    }
}

/// Occupied voxels of the semantic map, one row each.
#[pyclass(name = "Voxels", module = "harness._native", frozen)]
pub(crate) struct PyVoxels {
    pub(crate) voxels: Vec<SemanticVoxel>,
    pub(crate) size_m: f64,
}

#[pymethods]
impl PyVoxels {
    /// Edge of a voxel, metres.
    #[getter]
    const fn size_m(&self) -> f64 {
        self.size_m
    }

    #[getter]
    fn centres_world<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        let centres: Vec<Point> = self.voxels.iter().map(|voxel| voxel.centre).collect();
        arrays::from_points(&centres).to_pyarray(py)
    }

    #[getter]
    fn rgb<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<u8>> {
        let colours: Vec<[u8; 3]> = self.voxels.iter().map(|voxel| voxel.rgb).collect();
        arrays::from_colours(&colours).to_pyarray(py)
    }

    #[getter]
    fn histograms<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        let rows: Vec<_> = self.voxels.iter().map(|voxel| voxel.histogram).collect();
        Array2::from(rows).to_pyarray(py)
    }

    #[getter]
    fn classes<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<u8>> {
        let classes: Vec<u8> = self.voxels.iter().map(|voxel| voxel.class).collect();
        classes.to_pyarray(py)
    }

    /// Id of the object each voxel belongs to, 0 for none.
    #[getter]
    fn object_ids<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<u32>> {
        let ids: Vec<u32> = self
            .voxels
            .iter()
            .map(|voxel| voxel.object.map_or(0, |id| id.0))
            .collect();
        ids.to_pyarray(py)
    }

    /// Confidence of each voxel, NaN where none is set.
    #[getter]
    fn confidence<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        let confidence: Vec<f64> = self
            .voxels
            .iter()
            .map(|voxel| voxel.confidence.unwrap_or(f64::NAN))
            .collect();
        confidence.to_pyarray(py)
    }
}
