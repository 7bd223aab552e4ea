//! Numpy arrays to the crates' types and back; shape errors name the argument.

use credence_types::Point;
use numpy::{Element, PyReadonlyArrayDyn, PyUntypedArrayMethods as _, ndarray::Array2};
use pyo3::{PyResult, exceptions::PyValueError};

/// The values of a C-contiguous array of the given shape; `None` stands for any length.
pub(crate) fn slice<'a, T: Element>(
    name: &str,
    array: &'a PyReadonlyArrayDyn<'_, T>,
    shape: &[Option<usize>],
) -> PyResult<&'a [T]> {
    let found = array.shape();
    let fits = found.len() == shape.len()
        && found
            .iter()
            .zip(shape)
            .all(|(f, s)| s.is_none_or(|s| s == *f));
    if !fits {
        let expected: Vec<String> = shape
            .iter()
            .map(|s| s.map_or_else(|| "n".to_owned(), |s| s.to_string()))
            .collect();
        return Err(PyValueError::new_err(format!(
            "{name} has shape {found:?}; expected ({})",
            expected.join(", ")
        )));
    }
    array.as_slice().map_err(|err| {
        PyValueError::new_err(format!(
            "{name}: {err}; pass numpy.ascontiguousarray({name})"
        ))
    })
}

/// Points from an (n, 3) array; refuses coordinates that are not finite.
pub(crate) fn points(name: &str, array: &PyReadonlyArrayDyn<'_, f64>) -> PyResult<Vec<Point>> {
    let values = slice(name, array, &[None, Some(3)])?;
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
pub(crate) fn matrix4(name: &str, array: &PyReadonlyArrayDyn<'_, f64>) -> PyResult<[[f64; 4]; 4]> {
    let values = slice(name, array, &[Some(4), Some(4)])?;
    Ok(std::array::from_fn(|r| {
        std::array::from_fn(|c| values[4 * r + c])
    }))
}

/// Points as an (n, 3) array.
pub(crate) fn from_points(points: &[Point]) -> Array2<f64> {
    Array2::from_shape_fn((points.len(), 3), |(row, axis)| points[row][axis])
}

/// Colours as an (n, 3) array.
pub(crate) fn from_colours(colours: &[[u8; 3]]) -> Array2<u8> {
    Array2::from_shape_fn((colours.len(), 3), |(row, channel)| colours[row][channel])
}
