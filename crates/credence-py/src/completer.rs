//! Completers that are Python callables.

use credence_pipeline::{
    CompleterChoice, Config, Pipeline, PipelineError, PythonFunction,
    complete::{CompleteError, Completer, Uncompleted, even_order},
};
use credence_types::{Completion, Frame, Instance};
use numpy::{
    ToPyArray as _,
    ndarray::{Array2, Array3},
};
use pyo3::{
    exceptions::{PyTypeError, PyValueError},
    prelude::*,
    types::{PyDict, PySequence, PyTuple},
};

use crate::{
    arrays::Array,
    errors::{caused_by, to_python},
};

/// The pipeline of a configuration; a completer that it names in Python is imported.
pub(crate) fn pipeline(py: Python<'_>, config: Config) -> PyResult<Pipeline> {
    let made = match &config.completer {
        CompleterChoice::Python(function) => {
            let completer = PythonCompleter::import(py, function, config.completion.points)?;
            py.detach(|| Pipeline::with_completer(config, Box::new(completer)))
        }
        CompleterChoice::None | CompleterChoice::Cloud | CompleterChoice::CenterSnap => {
            py.detach(|| Pipeline::new(config))
        }
    };
    made.map_err(|err: PipelineError| to_python(&err))
}

/// A callable `f(*, rgb, depth_m, intrinsics, world_from_camera, masks, categories)`.
struct PythonCompleter {
    name: String,
    function: Py<PyAny>,
    /// Points of a completion, at most.
    points: usize,
}

impl PythonCompleter {
    fn import(py: Python<'_>, choice: &PythonFunction, points: usize) -> PyResult<Self> {
        let name = CompleterChoice::Python(choice.clone()).to_string();
        let PythonFunction { module, function } = choice;
        let imported = py.import(module.as_str()).map_err(|cause| {
            let message = format!(
                "completer = \"{name}\": cannot import {module}: {cause}; install it, or put the \
                 folder that holds it on PYTHONPATH"
            );
            caused_by(py, PyValueError::new_err(message), cause)
        })?;
        let found = imported.getattr(function.as_str()).map_err(|cause| {
            let message = format!(
                "completer = \"{name}\": the module {module} has no {function}; name a function \
                 that it defines"
            );
            caused_by(py, PyValueError::new_err(message), cause)
        })?;
        if !found.is_callable() {
            return Err(PyValueError::new_err(format!(
                "completer = \"{name}\": {module}.{function} is of type {}; name a function",
                found.get_type().name()?
            )));
        }
        Ok(Self {
            name,
            function: found.unbind(),
            points,
        })
    }

    fn call<'py>(
        &self,
        py: Python<'py>,
        frame: &Frame,
        instances: &[Instance],
    ) -> PyResult<Bound<'py, PyAny>> {
        let camera = frame.intrinsics();
        let (height, width) = (camera.height(), camera.width());
        let rgb = Array3::from_shape_fn((height, width, 3), |(row, column, channel)| {
            frame.rgb()[row * width + column][channel]
        });
        let depth_m = Array2::from_shape_fn((height, width), |(row, column)| {
            frame.depth_m()[row * width + column]
        });
        let shape = (instances.len(), height, width);
        let masks = Array3::from_shape_fn(shape, |(instance, row, column)| {
            instances[instance].mask()[row * width + column]
        });
        let ([fx, fy], [cx, cy]) = (camera.focal_px(), camera.centre_px());
        let pose = frame.world_from_camera().to_matrix().to_vec();
        let names: Vec<&str> = instances.iter().map(|i| i.category().name()).collect();
        let arguments = PyDict::new(py);
        arguments.set_item("rgb", rgb.to_pyarray(py))?;
        arguments.set_item("depth_m", depth_m.to_pyarray(py))?;
        arguments.set_item("intrinsics", (fx, fy, cx, cy))?;
        let pose = Array2::from(pose).to_pyarray(py);
        arguments.set_item("world_from_camera", pose)?;
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
            let why = format!("{} returned None for it", self.name);
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
            name: self.name.clone(),
            why,
            source: Some(Box::new(cause)),
        }
    }
}

fn type_name(object: &Bound<'_, PyAny>) -> String {
    let name = object.get_type().name();
    name.map_or_else(|_err| "unknown".to_owned(), |name| name.to_string())
}
