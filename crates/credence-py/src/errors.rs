//! The one map from Rust errors to Python exceptions.

use std::{error::Error, io};

use pyo3::{
    PyErr, Python,
    exceptions::{PyException, PyOSError, PyValueError},
};

/// Bad input is a `ValueError`, a failing file an `OSError`; causes follow the message. An exception among
/// the causes becomes the exception's own cause, or comes through as it is if it is none that
/// programs handle, such as an interrupt.
pub(crate) fn to_python(error: &(dyn Error + 'static)) -> PyErr {
    let mut message = error.to_string();
    let mut is_io = error.is::<io::Error>();
    let mut cause = error.source();
    while let Some(inner) = cause {
        if let Some(raised) = inner.downcast_ref::<PyErr>() {
            return Python::attach(|py| {
                let raised = raised.clone_ref(py);
                if raised.is_instance_of::<PyException>(py) {
                    caused_by(py, PyValueError::new_err(message), raised)
                } else {
                    raised
                }
            });
        }
        is_io |= inner.is::<io::Error>();
        let text = inner.to_string();
        if !message.contains(&text) {
            message = format!("{message}: {text}");
        }
        cause = inner.source();
    }
    if is_io {
        PyOSError::new_err(message)
    } else {
        PyValueError::new_err(message)
    }
}

/// An exception raised from another.
pub(crate) fn caused_by(py: Python<'_>, error: PyErr, cause: PyErr) -> PyErr {
    error.set_cause(py, Some(cause));
    error
}
