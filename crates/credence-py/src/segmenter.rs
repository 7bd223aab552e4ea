//! Segmenters that are Python callables.

use credence_pipeline::{
    PythonFunction,
    segment::{SegmentError, Segmenter},
};
use credence_types::{Category, Frame, Instance, Intrinsics};
use pyo3::{
    exceptions::{PyTypeError, PyValueError},
    prelude::*,
    types::PyMapping,
};

use crate::{
    arrays::Array,
    frame::frame_arguments,
    function::{ImportedFunction, type_name},
};

/// A callable `f(*, rgb, depth_m, intrinsics, world_from_camera)`.
pub(crate) struct PythonSegmenter(ImportedFunction);

impl PythonSegmenter {
    pub(crate) fn import(py: Python<'_>, named: &PythonFunction) -> PyResult<Self> {
        ImportedFunction::import(py, "segmenter", named).map(Self)
    }

    /// What a call returns; `Err` holds what it raised, also while its answer was read.
    fn call<'py>(
        &self,
        py: Python<'py>,
        frame: &Frame,
    ) -> PyResult<Result<Vec<Bound<'py, PyAny>>, PyErr>> {
        let arguments = frame_arguments(py, frame)?;
        let answer = self.0.bind(py).call((), Some(&arguments))?;
        let Ok(entries) = answer.try_iter() else {
            return Ok(Err(PyTypeError::new_err(format!(
                "it is of type {}; return a list of detections, empty where nothing is in view",
                type_name(&answer)
            ))));
        };
        entries.collect::<PyResult<_>>().map(Ok)
    }

    fn failed(&self, why: String, cause: PyErr) -> SegmentError {
        SegmentError::Foreign {
            name: self.0.name.clone(),
            why,
            source: Some(Box::new(cause)),
        }
    }
}

impl Segmenter for PythonSegmenter {
    fn segment(&self, frame: &Frame) -> Result<Vec<Instance>, SegmentError> {
        Python::attach(|py| {
            let answer = self.call(py, frame).map_err(|cause| {
                let why = format!("raised {cause}; mend it, or choose another segmenter");
                self.failed(why, cause)
            })?;
            let read = |entries: Vec<Bound<'_, PyAny>>| {
                let entries = entries.iter().enumerate();
                entries
                    .map(|(index, entry)| detection(entry, index, frame.intrinsics()))
                    .collect()
            };
            answer.and_then(read).map_err(|cause| {
                let why = format!("returned what are no detections: {}", cause.value(py));
                self.failed(why, cause)
            })
        })
    }
}

/// A detection: a mapping or an object with `mask`, `category` or `class_scores`, and `score`.
fn detection(entry: &Bound<'_, PyAny>, index: usize, camera: &Intrinsics) -> PyResult<Instance> {
    let field = |key: &str| -> PyResult<Option<Bound<'_, PyAny>>> {
        let value = match entry.cast::<PyMapping>() {
            Ok(mapping) if mapping.contains(key)? => Some(mapping.get_item(key)?),
            Ok(_) => None,
            Err(_) => entry.getattr_opt(key)?,
        };
        Ok(value.filter(|value| !value.is_none()))
    };
    let mask = field("mask")?.ok_or_else(|| {
        PyTypeError::new_err(format!(
            "entry {index}, of type {}, has no mask; make it a mapping or an object with mask, \
             category or class_scores, and score",
            type_name(entry)
        ))
    })?;
    let mask: Array<'_, bool> = mask.extract()?;
    let size = [Some(camera.height()), Some(camera.width())];
    let mask = mask.values(&format!("mask of entry {index}"), &size)?;
    let score = field("score")?
        .map(|score| score_of(&score, index))
        .transpose()?;
    let (class_scores, score) = match (field("category")?, field("class_scores")?) {
        (None, None) => {
            return Err(PyValueError::new_err(format!(
                "entry {index} has neither category nor class_scores; give one of them"
            )));
        }
        (Some(_), Some(_)) => {
            return Err(PyValueError::new_err(format!(
                "entry {index} has both category and class_scores; give one of them"
            )));
        }
        (Some(name), None) => {
            let category = category(&name, index)?;
            let score = score.ok_or_else(|| {
                PyValueError::new_err(format!(
                    "entry {index} has no score; give how probable it is that the {category} is \
                     there, from 0 to 1"
                ))
            })?;
            let of = |c: Category| if c == category { score } else { 0.0 };
            (Category::ALL.map(of), score)
        }
        (None, Some(scores)) => {
            let scores: Array<'_, f64> = scores.extract()?;
            let name = format!("class_scores of entry {index}");
            let scores = scores.values(&name, &[Some(Category::ALL.len())])?;
            let best = scores.iter().copied().fold(0.0, f64::max);
            (std::array::from_fn(|i| scores[i]), score.unwrap_or(best))
        }
    };
    Instance::new(index, mask, class_scores, score)
        .map_err(|err| PyValueError::new_err(format!("entry {index}: {err}")))
}

fn category(name: &Bound<'_, PyAny>, index: usize) -> PyResult<Category> {
    let text: String = name.extract().map_err(|_err| {
        PyTypeError::new_err(format!(
            "category of entry {index} is {name}; expected a category's name, such as 'mug'"
        ))
    })?;
    text.parse()
        .map_err(|err| PyValueError::new_err(format!("category of entry {index}: {err}")))
}

fn score_of(value: &Bound<'_, PyAny>, index: usize) -> PyResult<f64> {
    let score: f64 = value.extract().map_err(|_err| {
        PyTypeError::new_err(format!(
            "score of entry {index} is of type {}; expected a number",
            type_name(value)
        ))
    })?;
    if (0.0..=1.0).contains(&score) {
        return Ok(score);
    }
    Err(PyValueError::new_err(format!(
        "score of entry {index} is {score}; it must lie in [0, 1]"
    )))
}
