//! Functions in Python that take a stage's place.

use credence_pipeline::PythonFunction;
use pyo3::{exceptions::PyValueError, prelude::*};

use crate::errors::caused_by;

/// A function that a configuration names, imported.
pub(crate) struct ImportedFunction {
    /// As the configuration spells it.
    pub(crate) name: String,
    function: Py<PyAny>,
}

impl ImportedFunction {
    /// Imports the function that the configuration's `key` names.
    pub(crate) fn import(py: Python<'_>, key: &str, named: &PythonFunction) -> PyResult<Self> {
        let name = named.to_string();
        let PythonFunction { module, function } = named;
        let imported = py.import(module.as_str()).map_err(|cause| {
            let message = format!(
                "{key} = \"{name}\": cannot import {module}: {cause}; install it, or put the \
                 folder that holds it on PYTHONPATH"
            );
            caused_by(py, PyValueError::new_err(message), cause)
        })?;
        let found = imported.getattr(function.as_str()).map_err(|cause| {
            let message = format!(
                "{key} = \"{name}\": the module {module} has no {function}; name a function that \
                 it defines"
            );
            caused_by(py, PyValueError::new_err(message), cause)
        })?;
        if !found.is_callable() {
            return Err(PyValueError::new_err(format!(
                "{key} = \"{name}\": {module}.{function} is of type {}; name a function",
                found.get_type().name()?
            )));
        }
        Ok(Self {
            name,
            function: found.unbind(),
        })
    }

    pub(crate) fn bind<'py>(&self, py: Python<'py>) -> &Bound<'py, PyAny> {
        self.function.bind(py)
    }
}

/// Name of an object's type.
pub(crate) fn type_name(object: &Bound<'_, PyAny>) -> String {
    let name = object.get_type().name();
    name.map_or_else(|_err| "unknown".to_owned(), |name| name.to_string())
}
