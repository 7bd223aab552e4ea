//! Frames: from a call's arguments, and to those of a call to Python.

use std::collections::BTreeMap;

use credence_types::{Category, Frame, FrameTruth, Intrinsics, Pose};
use numpy::{
    ToPyArray as _,
    ndarray::{Array2, Array3},
};
use pyo3::{
    exceptions::{PyTypeError, PyValueError},
    prelude::*,
    types::{PyDict, PyMapping},
};

use crate::{arrays::Array, errors::to_python};

/// The frame that keyword arguments describe.
pub(crate) fn read_frame(
    py: Python<'_>,
    rgb: &Array<'_, u8>,
    depth_m: &Array<'_, f32>,
    intrinsics: &Bound<'_, PyAny>,
    world_from_camera: &Array<'_, f64>,
    instance_ids: Option<&Array<'_, u16>>,
    categories: Option<&Bound<'_, PyMapping>>,
) -> PyResult<Frame> {
    let [height, width] = depth_m.image_size("depth_m")?;
    let image = [Some(height), Some(width)];
    let [fx, fy, cx, cy] = focal_and_centre(intrinsics)?;
    let camera =
        Intrinsics::new([width, height], [fx, fy], [cx, cy]).map_err(|err| to_python(&err))?;
    let pose = world_from_camera.matrix4("world_from_camera")?;
    let pose = Pose::from_matrix("world_from_camera", &pose).map_err(|err| to_python(&err))?;
    let rgb: Vec<[u8; 3]> = rgb
        .values("rgb", &[image[0], image[1], Some(3)])?
        .chunks_exact(3)
        .map(|c| [c[0], c[1], c[2]])
        .collect();
    let depth_m = depth_m.values("depth_m", &image)?;
    let truth = match instance_ids {
        None => None,
        Some(ids) => Some(FrameTruth {
            instance_ids: ids.values("instance_ids", &image)?,
            categories: named_categories(categories)?,
        }),
    };
    py.detach(|| Frame::new(rgb, depth_m, camera, pose, truth))
        .map_err(|err| to_python(&err))
}

/// What a function in Python is told of a frame, as keyword arguments.
pub(crate) fn frame_arguments<'py>(py: Python<'py>, frame: &Frame) -> PyResult<Bound<'py, PyDict>> {
    let camera = frame.intrinsics();
    let (height, width) = (camera.height(), camera.width());
    let rgb = Array3::from_shape_fn((height, width, 3), |(row, column, channel)| {
        frame.rgb()[row * width + column][channel]
    });
    let depth_m = Array2::from_shape_fn((height, width), |(row, column)| {
        frame.depth_m()[row * width + column]
    });
    let ([fx, fy], [cx, cy]) = (camera.focal_px(), camera.centre_px());
    let pose = frame.world_from_camera().to_matrix().to_vec();
    let arguments = PyDict::new(py);
    arguments.set_item("rgb", rgb.to_pyarray(py))?;
    arguments.set_item("depth_m", depth_m.to_pyarray(py))?;
    arguments.set_item("intrinsics", (fx, fy, cx, cy))?;
    let pose = Array2::from(pose).to_pyarray(py);
    arguments.set_item("world_from_camera", pose)?;
    Ok(arguments)
}

fn focal_and_centre(intrinsics: &Bound<'_, PyAny>) -> PyResult<[f64; 4]> {
    intrinsics.extract().map_err(|_err| {
        let text = intrinsics.to_string();
        let found: Vec<&str> = text.split_whitespace().collect();
        PyTypeError::new_err(format!(
            "intrinsics is {}; expected the four numbers (fx, fy, cx, cy), in pixels",
            found.join(" ")
        ))
    })
}

fn named_categories(
    categories: Option<&Bound<'_, PyMapping>>,
) -> PyResult<BTreeMap<u16, Category>> {
    let mut named = BTreeMap::new();
    let Some(categories) = categories else {
        return Ok(named);
    };
    for item in categories.items()? {
        let (id, name): (Bound<'_, PyAny>, Bound<'_, PyAny>) = item.extract()?;
        let key = id
            .extract()
            .ok()
            .filter(|id: &u16| *id > 0)
            .ok_or_else(|| {
                PyValueError::new_err(format!(
                    "categories has the key {}; instance ids are whole numbers from 1 to 65535",
                    id.repr()
                        .map_or_else(|_err| String::new(), |text| text.to_string())
                ))
            })?;
        let name: String = name.extract().map_err(|_err| {
            PyTypeError::new_err(format!(
                "categories[{key}] is {name}; expected a category's name, such as 'mug'"
            ))
        })?;
        named.insert(key, name.parse().map_err(|err| to_python(&err))?);
    }
    Ok(named)
}
