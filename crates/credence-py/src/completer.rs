//! Completers that are Python callables.

use credence_pipeline::{
    PythonFunction,
    complete::{CompleteError, Completer, Uncompleted, even_order},
};
use credence_types::{Completion, Frame, Instance};
use numpy::{ToPyArray as _, ndarray::Array3};
use pyo3::{
    exceptions::{PyTypeError, PyValueError},
    prelude::*,
    types::{PySequence, PyTuple},
};

use crate::{
    arrays::Array,
    frame::frame_arguments,
    function::{ImportedFunction, type_name},
};

/// A callable `f(*, rgb, depth_m, intrinsics, world_from_camera, masks, categories)`.
pub(crate) struct PythonCompleter {
    function: ImportedFunction,
    /// Points of a completion, at most.
    points: usize,
}

impl PythonCompleter {
    pub(crate) fn import(py: Python<'_>, named: &PythonFunction, points: usize) -> PyResult<Self> {
        let function = ImportedFunction::import(py, "completer", named)?;
        Ok(Self { function, points })
    }

    fn call<'py>(
        &self,
        py: Python<'py>,
        frame: &Frame,
        instances: &[Instance],
    ) -> PyResult<Bound<'py, PyAny>> {
        let arguments = frame_arguments(py, frame)?;
        let camera = frame.intrinsics();
        let (height, width) = (camera.height(), camera.width());
        let shape = (instances.len(), height, width);
        let masks = Array3::from_shape_fn(shape, |(instance, row, column)| {
            instances[instance].mask()[row * width + column]
        });
        let names: Vec<&str> = instances.iter().map(|i| i.category().name()).collect();
        arguments.set_item("masks", masks.to_pyarray(py))?;
        arguments.set_item("categories", names)?;
        self.function.bind(py).call((), Some(&arguments))
    }

    /// The answers of a call, one per instance.
    fn read(
        &self,
        answers: &Bound<'_, PyAny>,
        instances: &[Instance],
    ) -> PyResult<Vec<Result<Completion, Uncompleted>>> {
        let listed = answers.cast::<PySequence>().map_err(|_err| {
            PyTypeError::new_err(format!(
                "it is of type {}; return a list with one entry per instance",
                type_name(answers)
            ))
        })?;
        if listed.len()? != instances.len() {
            return Err(PyValueError::new_err(format!(
                "it has {} entries; {} instances need one each, None for those that it does not \
                 complete",
                listed.len()?,
                instances.len()
            )));
        }
        let entries = instances.iter().enumerate();
        entries
            .map(|(index, instance)| self.entry(&listed.get_item(index)?, index, instance))
            .collect()
    }

    fn entry(
        &self,
        entry: &Bound<'_, PyAny>,
        index: usize,
        instance: &Instance,
    ) -> PyResult<Result<Completion, Uncompleted>> {
        if entry.is_none() {
            let why = format!("{} returned None for it", self.function.name);
            return Ok(Err(Uncompleted::Declined(why)));
        }
        let pair = entry.cast::<PyTuple>().ok().filter(|pair| pair.len() == 2);
        let Some(pair) = pair else {
            return Err(PyTypeError::new_err(format!(
                "entry {index} is of type {}; make it None or a tuple (points_camera, spread_m)",
                type_name(entry)
            )));
        };
        let points: Array<'_, f64> = pair.get_item(0)?.extract()?;
        let name = format!("points_camera of entry {index}");
        let points = points.points(&name)?;
        if points.is_empty() {
            return Err(PyValueError::new_err(format!(
                "{name} holds no point; return None for an object that is not completed"
            )));
        }
        let spread = pair.get_item(1)?;
        let spread_m = if spread.is_none() {
            vec![0.0; points.len()]
        } else {
            let spread: Array<'_, f64> = spread.extract()?;
            let name = format!("spread_m of entry {index}");
            let spread_m = spread.values(&name, &[Some(points.len())])?;
            let is_bad = |value: &&f64| !(value.is_finite() && **value >= 0.0);
            if let Some(value) = spread_m.iter().find(is_bad) {
                return Err(PyValueError::new_err(format!(
                    "{name} holds {value}; spreads are metres, finite and not negative"
                )));
            }
            spread_m
        };
        let order = even_order(&points, self.points);
        Ok(Ok(Completion {
            category: instance.category(),
            score: instance.score(),
            points_camera: order.iter().map(|at| points[*at]).collect(),
            spread_m: order.iter().map(|at| spread_m[*at]).collect(),
        }))
    }
}

impl Completer for PythonCompleter {
    fn complete(
        &self,
        frame: &Frame,
        instances: &[Instance],
    ) -> Result<Vec<Result<Completion, Uncompleted>>, CompleteError> {
        Python::attach(|py| {
            let answers = self.call(py, frame, instances).map_err(|cause| {
                let why = format!("raised {cause}; mend it, or choose another completer");
                self.failed(why, cause)
            })?;
            self.read(&answers, instances).map_err(|cause| {
                let why = format!("returned what is no completion: {}", cause.value(py));
                self.failed(why, cause)
            })
        })
    }
}

impl PythonCompleter {
    fn failed(&self, why: String, cause: PyErr) -> CompleteError {
        CompleteError::Foreign {
            name: self.function.name.clone(),
            why,
            source: Some(Box::new(cause)),
        }
    }
}
