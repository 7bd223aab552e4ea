use std::io::BufRead;

use credence_types::{Point, PointCloud};

use super::{
    header::{Element, Header, Property},
    scalar::{Encoding, Scalar, word},
};
use crate::{bytes::end, error::Fault};

/// What a cloud is made of, in the order of a row's slots.
const NEEDED: [&str; 6] = ["x", "y", "z", "red", "green", "blue"];
const EXPORT: &str =
    "export the cloud with x, y, z as float or double and red, green, blue as uchar";
/// Most points that room is made for before any has been read.
const POINTS_AHEAD: u64 = 1 << 16;

pub(super) fn parse(source: &mut impl BufRead) -> Result<PointCloud, Fault> {
    let Header { encoding, elements } = Header::read(source)?;
    let is_vertex = |element: &Element| element.name == "vertex";
    match elements.iter().filter(|e| is_vertex(e)).count() {
        0 => return Fault::unsupported("it has no element 'vertex'", EXPORT),
        1 => {}
        _ => return Fault::damaged("it has several elements 'vertex'"),
    }
    let mut cloud = PointCloud::default();
    for element in &elements {
        if is_vertex(element) {
            cloud = read_vertices(element, source, encoding)?;
        } else {
            for _ in 0..element.rows {
                for property in &element.properties {
                    skip(property, source, encoding)?;
                }
            }
        }
    }
    if encoding == Encoding::Ascii
        && let Some(word) = word(source)?
    {
        return Fault::damaged(format!("'{word}' follows where the data should end"));
    }
    end(source)?;
    Ok(cloud)
}

fn read_vertices(
    element: &Element,
    source: &mut impl BufRead,
    encoding: Encoding,
) -> Result<PointCloud, Fault> {
    let columns = columns(element)?;
    let room = element.rows.min(POINTS_AHEAD) as usize;
    let mut cloud = PointCloud {
        points_world: Vec::with_capacity(room),
        rgb: Vec::with_capacity(room),
    };
    for row in 0..element.rows {
        let mut slots = [0.0; NEEDED.len()];
        for (property, column) in element.properties.iter().zip(&columns) {
            match column {
                Some((slot, kind)) => slots[*slot] = kind.read(source, encoding)?,
                None => skip(property, source, encoding)?,
            }
        }
        let [x, y, z, red, green, blue] = slots;
        if ![x, y, z].iter().all(|c| c.is_finite()) {
            return Fault::unsupported(
                format!("vertex {row} is at ({x}, {y}, {z})"),
                "remove the points that are not finite",
            );
        }
        // Of type uchar, hence whole numbers from 0 to 255.
        cloud.push(Point::new(x, y, z), [red as u8, green as u8, blue as u8]);
    }
    Ok(cloud)
}

/// For each property its slot in a row and its type, if it is needed.
fn columns(element: &Element) -> Result<Vec<Option<(usize, Scalar)>>, Fault> {
    let mut columns = Vec::with_capacity(element.properties.len());
    let mut found = [false; NEEDED.len()];
    for property in &element.properties {
        let Property::Scalar { name, kind } = property else {
            columns.push(None);
            continue;
        };
        let Some(slot) = NEEDED.iter().position(|needed| needed == name) else {
            columns.push(None);
            continue;
        };
        let fits = if slot < 3 {
            kind.is_real()
        } else {
            *kind == Scalar::U8
        };
        if !fits {
            let what = format!("the type of vertex property '{name}' is {kind:?}");
            return Fault::unsupported(what, EXPORT);
        }
        if found[slot] {
            return Fault::damaged(format!("vertex property '{name}' stands there twice"));
        }
        found[slot] = true;
        columns.push(Some((slot, *kind)));
    }
    if let Some(missing) = found.iter().position(|found| !found) {
        let what = format!("its vertices have no property '{}'", NEEDED[missing]);
        return Fault::unsupported(what, EXPORT);
    }
    Ok(columns)
}

fn skip(property: &Property, source: &mut impl BufRead, encoding: Encoding) -> Result<(), Fault> {
    match property {
        Property::Scalar { kind, .. } => {
            kind.read(source, encoding)?;
        }
        Property::List { count, item } => {
            let count = count.read(source, encoding)?;
            if count < 0.0 {
                return Fault::damaged(format!("a list has {count} items"));
            }
            for _ in 0..count as u64 {
                item.read(source, encoding)?;
            }
        }
    }
    Ok(())
}
