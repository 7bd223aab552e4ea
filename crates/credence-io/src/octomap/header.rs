use std::io::{self, BufRead, Write};

use crate::{bytes::line, error::Fault};

const BINARY: &str = "# Octomap OcTree binary file";
const FULL: &str = "# Octomap OcTree file";
const ADVICE: &str =
    "# (feel free to add / change comments, but leave the first line as it is!)\n#";
const TREE_TYPE: &str = "OcTree";
const CONVERT: &str = "convert it to an OcTree with OctoMap's convert_octree";

/// Which of the two formats.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    Binary,
    Full,
}

/// What stands before the data.
#[derive(Debug, PartialEq)]
pub(super) struct Header {
    pub(super) kind: Kind,
    /// Number of nodes as declared: not to be trusted.
    pub(super) nodes: u64,
    pub(super) resolution_m: f64,
}

impl Header {
    pub(super) const fn new(kind: Kind, nodes: usize, resolution_m: f64) -> Self {
        Self {
            kind,
            nodes: nodes as u64,
            resolution_m,
        }
    }

    pub(super) fn write(&self, out: &mut dyn Write) -> io::Result<()> {
        let first = match self.kind {
            Kind::Binary => BINARY,
            Kind::Full => FULL,
        };
        let resolution = number(self.resolution_m);
        write!(
            out,
            "{first}\n{ADVICE}\nid {TREE_TYPE}\nsize {}\nres {resolution}\ndata\n",
            self.nodes
        )
    }

    pub(super) fn read(source: &mut impl BufRead) -> Result<Self, Fault> {
        let kind = read_kind(source)?;
        let (mut id, mut nodes, mut resolution_m) = (None, None, None);
        loop {
            let line = line(source)?;
            let mut words = line.split_whitespace();
            match (words.next(), words.next()) {
                (None, _) => {}
                (Some(word), _) if word.starts_with('#') => {}
                (Some("data"), _) => break,
                (Some("id"), Some(value)) => id = Some(value.to_owned()),
                (Some("size"), Some(value)) => nodes = Some(read_size(value)?),
                (Some("res"), Some(value)) => resolution_m = Some(read_resolution(value)?),
                _ => return Fault::damaged(format!("header line '{line}' is not understood")),
            }
        }
        match id.as_deref() {
            Some(TREE_TYPE) => {}
            Some(id) => {
                return Fault::unsupported(format!("it holds a tree of type '{id}'"), CONVERT);
            }
            None => return Fault::damaged("the header has no 'id'"),
        }
        let Some(nodes) = nodes else {
            return Fault::damaged("the header has no 'size'");
        };
        let Some(resolution_m) = resolution_m else {
            return Fault::damaged("the header has no 'res'");
        };
        Ok(Self {
            kind,
            nodes,
            resolution_m,
        })
    }
}

fn read_kind(source: &mut impl BufRead) -> Result<Kind, Fault> {
    match line(source) {
        Ok(first) if first.starts_with(BINARY) => Ok(Kind::Binary),
        Ok(first) if first.starts_with(FULL) => Ok(Kind::Full),
        // A first line without an end is as little OctoMap's as a wrong one.
        Ok(_) | Err(Fault::Damaged(_)) => Fault::unsupported(
            format!("its first line is neither '{BINARY}' nor '{FULL}'"),
            "pass an OctoMap .bt or .ot file",
        ),
        Err(fault) => Err(fault),
    }
}

fn read_size(value: &str) -> Result<u64, Fault> {
    value.parse().or_else(|_| {
        Fault::damaged(format!(
            "the header's size '{value}' is not a number of nodes"
        ))
    })
}

fn read_resolution(value: &str) -> Result<f64, Fault> {
    match value.parse::<f64>() {
        Ok(resolution) if resolution.is_finite() && resolution > 0.0 => Ok(resolution),
        _ => Fault::damaged(format!(
            "the header's resolution '{value}' is not a positive number of metres"
        )),
    }
}

/// The number as a C++ stream prints it (`%g`), but with as many digits as it takes to read the
/// same number back instead of six at most.
fn number(value: f64) -> String {
    let scientific = format!("{value:e}");
    let parts = scientific.split_once('e').and_then(|(mantissa, exponent)| {
        let exponent: i32 = exponent.parse().ok()?;
        Some((mantissa, exponent))
    });
    match parts {
        Some((mantissa, exponent)) if !(-4..6).contains(&exponent) => {
            let sign = if exponent < 0 { '-' } else { '+' };
            format!("{mantissa}e{sign}{:02}", exponent.unsigned_abs())
        }
        _ => format!("{value}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_look_as_octomap_prints_them() {
        let printed = [
            (0.05, "0.05"),
            (1e-5, "1e-05"),
            (2.5e-5, "2.5e-05"),
            (0.0001, "0.0001"),
            (1000.0, "1000"),
            (100_000.0, "100000"),
            (1e6, "1e+06"),
            (0.123_456_789, "0.123456789"),
        ];
        for (value, text) in printed {
            assert_eq!(number(value), text);
        }
    }

    #[test]
    fn accepts_comments_blank_lines_and_windows_line_ends() {
        let text = "# Octomap OcTree file v2\r\n\r\n  # res 7\r\nres 0.1\r\nsize 3\r\nid OcTree\r\ndata x\r\n!";
        let mut source = text.as_bytes();
        let header = Header::read(&mut source).unwrap();
        assert_eq!(header, Header::new(Kind::Full, 3, 0.1));
        assert_eq!(source, b"!");
    }
}
