//! The one map from Rust errors to Python exceptions.

use std::{error::Error, io};

use pyo3::{
    PyErr,
    exceptions::{PyOSError, PyValueError},
};

/// Bad input is a `ValueError`, a failing file an `OSError`; causes follow the message.
pub(crate) fn to_python(error: &(dyn Error + 'static)) -> PyErr {
    let mut message = error.to_string();
    let mut is_io = error.is::<io::Error>();
    let mut cause = error.source();
    while let Some(inner) = cause {
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
