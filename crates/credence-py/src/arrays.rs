//! Numpy arrays to the crates' types and back; errors name the argument, what it is and what it
//! must be.

use std::{convert::Infallible, marker::PhantomData};

use credence_types::Point;
use numpy::{
    Element, PyReadonlyArrayDyn, PyUntypedArray, PyUntypedArrayMethods as _, dtype, ndarray::Array2,
};
use pyo3::{
    exceptions::{PyTypeError, PyValueError},
    prelude::*,
};

/// An argument that must be an array of `T`, not looked at yet: pyo3's own errors on arrays do not
/// say which argument is wrong.
pub(crate) struct Array<'py, T> {
    object: Bound<'py, PyAny>,
    element: PhantomData<T>,
}

impl<'py, T> FromPyObject<'_, 'py> for Array<'py, T> {
    type Error = Infallible;

    fn extract(object: Borrowed<'_, 'py, PyAny>) -> Result<Self, Self::Error> {
        Ok(Self {
            object: object.to_owned(),
            element: PhantomData,
        })
    }
}

impl<'py, T: Element + Copy> Array<'py, T> {
    /// Copies the values of a C-contiguous array of the given shape; `None` stands for any length.
    ///
    /// A copy, because other Python threads may write to the array while the GIL is released.
    pub(crate) fn values(&self, name: &str, shape: &[Option<usize>]) -> PyResult<Vec<T>> {
        let array = self.typed(name)?;
        let found = array.shape();
        let fits = found.len() == shape.len()
            && found
                .iter()
                .zip(shape)
                .all(|(f, s)| s.is_none_or(|s| s == *f));
        if !fits {
            let found: Vec<_> = found.iter().copied().map(Some).collect();
            return Err(PyValueError::new_err(format!(
                "{name} has shape {}; expected {}",
                tuple(&found),
                tuple(shape)
            )));
        }
        // rust-numpy hands out the memory of Fortran-ordered arrays too, as it lies.
        match array.as_slice() {
            Ok(values) if array.is_c_contiguous() => Ok(values.to_vec()),
            _ => Err(PyValueError::new_err(format!(
                "{name} is not C-contiguous or not aligned; pass numpy.ascontiguousarray({name})"
            ))),
        }
    }

    /// The (height, width) of an image.
    pub(crate) fn image_size(&self, name: &str) -> PyResult<[usize; 2]> {
        let array = self.typed(name)?;
        array.shape().try_into().map_err(|_err| {
            let found: Vec<_> = array.shape().iter().copied().map(Some).collect();
            PyValueError::new_err(format!(
                "{name} has shape {}; expected (height, width)",
                tuple(&found)
            ))
        })
    }

    fn typed(&self, name: &str) -> PyResult<PyReadonlyArrayDyn<'py, T>> {
        let expected = dtype::<T>(self.object.py());
        let Ok(array) = self.object.cast::<PyUntypedArray>() else {
            return Err(PyTypeError::new_err(format!(
                "{name} is of type {}; expected a numpy array of {expected}",
                self.object.get_type().name()?
            )));
        };
        self.object.extract().map_err(|_err| {
            PyTypeError::new_err(format!(
                "{name} has dtype {}; expected {expected}, as {name}.astype(numpy.{expected}) gives",
                array.dtype()
            ))
        })
    }
}

impl Array<'_, f64> {
    /// Points from an (n, 3) array; refuses coordinates that are not finite.
    pub(crate) fn points(&self, name: &str) -> PyResult<Vec<Point>> {
        let values = self.values(name, &[None, Some(3)])?;
        let points: Vec<Point> = values
            .chunks_exact(3)
            .map(|c| Point::new(c[0], c[1], c[2]))
            .collect();
        if let Some(i) = points.iter().position(|p| !p.iter().all(|c| c.is_finite())) {
            return Err(PyValueError::new_err(format!(
                "{name}[{i}] is not finite; remove such points first"
            )));
        }
        Ok(points)
    }

    /// A 4x4 row-major matrix.
    pub(crate) fn matrix4(&self, name: &str) -> PyResult<[[f64; 4]; 4]> {
        let values = self.values(name, &[Some(4), Some(4)])?;
        Ok(std::array::from_fn(|r| {
            std::array::from_fn(|c| values[4 * r + c])
        }))
    }
}

/// A shape as numpy writes it; `n` stands for any length.
fn tuple(shape: &[Option<usize>]) -> String {
    let sides: Vec<String> = shape
        .iter()
        .map(|side| side.map_or_else(|| "n".to_owned(), |side| side.to_string()))
        .collect();
    let comma = if sides.len() == 1 { "," } else { "" };
    format!("({}{comma})", sides.join(", "))
}

/// Points as an (n, 3) array.
pub(crate) fn from_points(points: &[Point]) -> Array2<f64> {
    Array2::from_shape_fn((points.len(), 3), |(row, axis)| points[row][axis])
}

/// Colours as an (n, 3) array.
pub(crate) fn from_colours(colours: &[[u8; 3]]) -> Array2<u8> {
    Array2::from_shape_fn((colours.len(), 3), |(row, channel)| colours[row][channel])
}

/// Vectors as an (n, 3) array.
pub(crate) fn rows(vectors: &[[f64; 3]]) -> Array2<f64> {
    Array2::from_shape_fn((vectors.len(), 3), |(row, axis)| vectors[row][axis])
}
