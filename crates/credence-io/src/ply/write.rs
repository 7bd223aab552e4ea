use std::{io, path::Path};

use credence_types::{Point, PointCloud};

use crate::{IoError, atomic::write_file};

pub(super) fn write(cloud: &PointCloud, path: &Path) -> Result<(), IoError> {
    let (points, colours) = (cloud.points_world.len(), cloud.rgb.len());
    if points != colours {
        let what = format!("the cloud has {points} points and {colours} colours");
        return Err(refused(path, what, "give each point one colour"));
    }
    check_finite(&cloud.points_world, path)?;
    write_file(path, |out| {
        let colours = ["uchar red", "uchar green", "uchar blue"];
        out.write_all(header(points, &colours).as_bytes())?;
        for (point, rgb) in cloud.points_world.iter().zip(&cloud.rgb) {
            for coordinate in point.iter() {
                out.write_all(&coordinate.to_le_bytes())?;
            }
            out.write_all(rgb)?;
        }
        io::Result::Ok(())
    })
}

pub(super) fn write_spreads(
    points_world: &[Point],
    spread_m: &[f64],
    path: &Path,
) -> Result<(), IoError> {
    let (points, spreads) = (points_world.len(), spread_m.len());
    if points != spreads {
        let what = format!("the cloud has {points} points and {spreads} spreads");
        return Err(refused(path, what, "give each point one spread"));
    }
    check_finite(points_world, path)?;
    write_file(path, |out| {
        out.write_all(header(points, &["double spread"]).as_bytes())?;
        for (point, spread) in points_world.iter().zip(spread_m) {
            for value in point.iter().chain([spread]) {
                out.write_all(&value.to_le_bytes())?;
            }
        }
        io::Result::Ok(())
    })
}

fn refused(path: &Path, what: String, remedy: &'static str) -> IoError {
    IoError::Refused {
        path: path.to_path_buf(),
        what,
        remedy,
    }
}

fn check_finite(points: &[Point], path: &Path) -> Result<(), IoError> {
    let finite = |point: &Point| point.iter().all(|c| c.is_finite());
    let Some(index) = points.iter().position(|p| !finite(p)) else {
        return Ok(());
    };
    let point = points[index];
    let what = format!(
        "point {index} is at ({}, {}, {})",
        point.x, point.y, point.z
    );
    Err(refused(path, what, "remove the points that are not finite"))
}

/// A header whose vertices have, after their coordinates, the given properties.
fn header(points: usize, properties: &[&str]) -> String {
    let mut lines = String::new();
    for property in properties {
        lines.extend(["property ", property, "\n"]);
    }
    format!(
        "ply\n\
         format binary_little_endian 1.0\n\
         element vertex {points}\n\
         property double x\n\
         property double y\n\
         property double z\n\
         {lines}\
         end_header\n"
    )
}
