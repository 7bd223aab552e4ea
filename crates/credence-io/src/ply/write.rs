use std::{io, path::Path};

use credence_types::PointCloud;

use crate::{IoError, atomic::write_file};

pub(super) fn write(cloud: &PointCloud, path: &Path) -> Result<(), IoError> {
    let refused = |what, remedy| {
        Err(IoError::Refused {
            path: path.to_path_buf(),
            what,
            remedy,
        })
    };
    let (points, colours) = (cloud.points_world.len(), cloud.rgb.len());
    if points != colours {
        let what = format!("the cloud has {points} points and {colours} colours");
        return refused(what, "give each point one colour");
    }
    let finite = |point: &credence_types::Point| point.iter().all(|c| c.is_finite());
    if let Some(index) = cloud.points_world.iter().position(|p| !finite(p)) {
        let point = cloud.points_world[index];
        let what = format!(
            "point {index} is at ({}, {}, {})",
            point.x, point.y, point.z
        );
        return refused(what, "remove the points that are not finite");
    }
    write_file(path, |out| {
        out.write_all(header(points).as_bytes())?;
        for (point, rgb) in cloud.points_world.iter().zip(&cloud.rgb) {
            for coordinate in point.iter() {
                out.write_all(&coordinate.to_le_bytes())?;
            }
            out.write_all(rgb)?;
        }
        io::Result::Ok(())
    })
}

fn header(points: usize) -> String {
    format!(
        "ply\n\
         format binary_little_endian 1.0\n\
         element vertex {points}\n\
         property double x\n\
         property double y\n\
         property double z\n\
         property uchar red\n\
         property uchar green\n\
         property uchar blue\n\
         end_header\n"
    )
}
