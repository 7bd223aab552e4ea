use std::io::BufRead;

use super::scalar::{Encoding, Scalar};
use crate::{bytes::line, error::Fault};

/// One value, or a counted list of them, of every row of an element.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Property {
    Scalar { name: String, kind: Scalar },
    List { count: Scalar, item: Scalar },
}

/// A table of the file.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Element {
    pub(super) name: String,
    /// Number of rows as declared: not to be trusted.
    pub(super) rows: u64,
    pub(super) properties: Vec<Property>,
}

/// What stands before the data.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Header {
    pub(super) encoding: Encoding,
    pub(super) elements: Vec<Element>,
}

impl Header {
    pub(super) fn read(source: &mut impl BufRead) -> Result<Self, Fault> {
        match line(source) {
            Ok(first) if first == "ply" => {}
            // A damaged first line is as little PLY's as a wrong one.
            Ok(_) | Err(Fault::Damaged(_)) => {
                return Fault::unsupported("its first line is not 'ply'", "pass a PLY file");
            }
            Err(fault) => return Err(fault),
        }
        let mut encoding = None;
        let mut elements: Vec<Element> = Vec::new();
        loop {
            let line = line(source)?;
            let words: Vec<&str> = line.split_whitespace().collect();
            let not_understood = || format!("header line '{line}' is not understood");
            match words[..] {
                [] | ["comment" | "obj_info", ..] => {}
                ["end_header"] => break,
                ["format", name, "1.0"] => encoding = Some(read_encoding(name)?),
                ["element", name, rows] => {
                    let Ok(rows) = rows.parse() else {
                        return Fault::damaged(not_understood());
                    };
                    elements.push(Element {
                        name: name.to_owned(),
                        rows,
                        properties: Vec::new(),
                    });
                }
                ["property", ref words @ ..] => {
                    let (Some(element), Some(property)) =
                        (elements.last_mut(), read_property(words))
                    else {
                        return Fault::damaged(not_understood());
                    };
                    element.properties.push(property);
                }
                _ => return Fault::damaged(not_understood()),
            }
        }
        let Some(encoding) = encoding else {
            return Fault::damaged("the header has no 'format'");
        };
        // Rows without bytes could go on for ever.
        if let Some(empty) = elements.iter().find(|e| e.properties.is_empty()) {
            return Fault::damaged(format!("element '{}' has no property", empty.name));
        }
        Ok(Self { encoding, elements })
    }
}

fn read_encoding(name: &str) -> Result<Encoding, Fault> {
    match name {
        "ascii" => Ok(Encoding::Ascii),
        "binary_little_endian" => Ok(Encoding::LittleEndian),
        "binary_big_endian" => Ok(Encoding::BigEndian),
        _ => Fault::damaged(format!("the format '{name}' is none of PLY's three")),
    }
}

fn read_property(words: &[&str]) -> Option<Property> {
    match *words {
        ["list", count, item, _name] => Some(Property::List {
            count: Scalar::from_name(count).filter(|count| !count.is_real())?,
            item: Scalar::from_name(item)?,
        }),
        [kind, name] => Some(Property::Scalar {
            name: name.to_owned(),
            kind: Scalar::from_name(kind)?,
        }),
        _ => None,
    }
}
