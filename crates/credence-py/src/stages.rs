//! Stages that a configuration names in Python.

use credence_pipeline::{
    CompleterChoice, Config, Foreign, Pipeline, SegmenterChoice, complete::Completer,
    segment::Segmenter,
};
use pyo3::prelude::*;

use crate::{completer::PythonCompleter, errors::to_python, segmenter::PythonSegmenter};

/// The pipeline of a configuration; functions that it names in Python are imported.
pub(crate) fn pipeline(py: Python<'_>, config: Config) -> PyResult<Pipeline> {
    let foreign = Foreign {
        segmenter: segmenter(py, &config)?,
        completer: completer(py, &config)?,
    };
    py.detach(|| Pipeline::with(config, foreign))
        .map_err(|err| to_python(&err))
}

/// A pipeline that stands where `pipeline` does, under another configuration of the later stages.
pub(crate) fn reconfigured(
    py: Python<'_>,
    pipeline: &Pipeline,
    config: Config,
) -> PyResult<Pipeline> {
    let foreign = Foreign {
        segmenter: None,
        completer: completer(py, &config)?,
    };
    py.detach(|| pipeline.reconfigured(config, foreign))
        .map_err(|err| to_python(&err))
}

/// The completer of a configuration, if it is a function in Python.
fn completer(py: Python<'_>, config: &Config) -> PyResult<Option<Box<dyn Completer>>> {
    match &config.completer {
        CompleterChoice::Python(named) => {
            let completer = PythonCompleter::import(py, named, config.completion.points)?;
            Ok(Some(Box::new(completer)))
        }
        CompleterChoice::None | CompleterChoice::Cloud | CompleterChoice::CenterSnap => Ok(None),
    }
}

/// The segmenter of a configuration, if it is a function in Python.
pub(crate) fn segmenter(py: Python<'_>, config: &Config) -> PyResult<Option<Box<dyn Segmenter>>> {
    match &config.segmenter {
        SegmenterChoice::Python(named) => Ok(Some(Box::new(PythonSegmenter::import(py, named)?))),
        SegmenterChoice::MaskRcnn | SegmenterChoice::MaskRcnnRgbd | SegmenterChoice::Oracle => {
            Ok(None)
        }
    }
}
