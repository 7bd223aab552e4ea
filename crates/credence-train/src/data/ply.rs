//! Meshes as this project's generator writes them: little-endian PLY of float vertices, triangles.

/// A mesh's vertices (metres) and triangles, every index valid and every coordinate finite.
#[derive(Debug)]
pub(super) struct Triangles {
    pub(super) vertices: Vec<[f32; 3]>,
    pub(super) faces: Vec<[u32; 3]>,
}

/// Longest header that is read for its end; the generator's has about 300 bytes.
const MAX_HEADER_BYTES: usize = 4096;
const HEADER_END: &[u8] = b"\nend_header\n";
/// A triangle's bytes: the count 3, three i32.
const FACE_BYTES: usize = 13;

/// Reads a mesh, or says what is wrong with its bytes.
pub(super) fn parse(bytes: &[u8]) -> Result<Triangles, String> {
    let head = &bytes[..bytes.len().min(MAX_HEADER_BYTES)];
    let end = head
        .windows(HEADER_END.len())
        .position(|window| window == HEADER_END)
        .ok_or("it has no PLY header that ends with 'end_header'")?;
    let header = str::from_utf8(&bytes[..end])
        .map_err(|err| format!("its header is not text: {err}"))
        .and_then(Header::parse)?;
    let body = &bytes[end + HEADER_END.len()..];
    let vertex_bytes = 4 * header.fields;
    let expected = (header.vertices as u128) * (vertex_bytes as u128)
        + (header.faces as u128) * (FACE_BYTES as u128);
    if body.len() as u128 != expected {
        return Err(format!(
            "{} bytes follow its header, which announces {expected}",
            body.len()
        ));
    }
    let (vertices, faces) = body.split_at(header.vertices * vertex_bytes);
    let vertices = vertices
        .chunks_exact(vertex_bytes)
        .enumerate()
        .map(|(index, fields)| {
            let point = header
                .xyz
                .map(|field| f32::from_le_bytes(word(fields, 4 * field)));
            let finite = point.iter().all(|c| c.is_finite());
            finite
                .then_some(point)
                .ok_or_else(|| format!("its vertex {index} is not finite"))
        })
        .collect::<Result<_, _>>()?;
    let faces = faces
        .chunks_exact(FACE_BYTES)
        .enumerate()
        .map(|(index, face)| {
            if face[0] != 3 {
                return Err(format!("its face {index} has {} corners, not 3", face[0]));
            }
            let corners = [1, 5, 9].map(|at| u32::from_le_bytes(word(face, at)));
            match corners.iter().find(|c| **c as usize >= header.vertices) {
                Some(corner) => Err(format!(
                    "its face {index} names vertex {corner} of {}",
                    header.vertices
                )),
                None => Ok(corners),
            }
        })
        .collect::<Result<_, _>>()?;
    Ok(Triangles { vertices, faces })
}

fn word(bytes: &[u8], at: usize) -> [u8; 4] {
    [bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]]
}

struct Header {
    vertices: usize,
    /// Floats per vertex, and which of them are x, y and z.
    fields: usize,
    xyz: [usize; 3],
    faces: usize,
}

impl Header {
    fn parse(text: &str) -> Result<Self, String> {
        let mut lines = text.lines().filter(|line| !line.starts_with("comment "));
        let mut expect = |wanted: &str| match lines.next() {
            Some(line) if line == wanted => Ok(()),
            line => Err(format!(
                "its header has '{}' for '{wanted}'",
                line.unwrap_or("")
            )),
        };
        expect("ply")?;
        expect("format binary_little_endian 1.0")?;
        let count = |line: Option<&str>, what: &str| {
            line.and_then(|line| line.strip_prefix(what)?.trim().parse::<usize>().ok())
                .filter(|count| (1..=u32::MAX as usize).contains(count))
                .ok_or_else(|| format!("its header lacks '{what}' with a count of at least 1"))
        };
        let vertices = count(lines.next(), "element vertex")?;
        let mut names = Vec::new();
        let mut line = lines.next();
        while let Some(name) = line.and_then(|line| line.strip_prefix("property float ")) {
            names.push(name);
            line = lines.next();
        }
        let faces = count(line, "element face")?;
        if lines.next() != Some("property list uchar int vertex_indices") || lines.next().is_some()
        {
            return Err("its faces are not lists 'uchar int vertex_indices'".to_owned());
        }
        let mut xyz = [0; 3];
        for (slot, name) in xyz.iter_mut().zip(["x", "y", "z"]) {
            *slot = names
                .iter()
                .position(|n| *n == name)
                .ok_or_else(|| format!("its vertices have no float property '{name}'"))?;
        }
        Ok(Self {
            vertices,
            fields: names.len(),
            xyz,
            faces,
        })
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::{super::tests::ply_bytes, *};

    const TRIANGLE: [[f32; 3]; 3] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 2.0, 0.0]];

    fn triangle() -> Vec<u8> {
        ply_bytes(&TRIANGLE, &[[0, 1, 2]])
    }

    #[test]
    fn reads_what_the_generator_writes() {
        let parsed = parse(&triangle()).unwrap();
        assert_eq!(parsed.vertices, TRIANGLE);
        assert_eq!(parsed.faces, [[0, 1, 2]]);
    }

    #[test]
    fn every_cut_is_noticed() {
        let whole = triangle();
        for length in 0..whole.len() {
            parse(&whole[..length]).unwrap_err();
        }
        let longer = [whole, vec![0]].concat();
        let message = parse(&longer).unwrap_err();
        assert_eq!(message, "110 bytes follow its header, which announces 109");
    }

    #[test]
    fn says_what_is_wrong() {
        let message = |from: &str, to: &str| {
            let bytes = triangle();
            let at = bytes.windows(from.len()).position(|w| w == from.as_bytes());
            let at = at.unwrap();
            parse(&[&bytes[..at], to.as_bytes(), &bytes[at + from.len()..]].concat()).unwrap_err()
        };
        assert!(message("little", "big").contains("'format binary_big_endian 1.0' for"));
        assert!(message("vertex 3", "vertex 0").contains("'element vertex' with a count"));
        assert!(message("vertex 3", "vertex 4").contains("announces 141"));
        let huge = message("vertex 3", "vertex 4294967295");
        assert!(huge.contains("109 bytes follow"), "{huge}");
        assert!(message("face 1", "face 18446744073709551616").contains("'element face'"));
        assert!(message("float y", "float w").contains("no float property 'y'"));
        assert!(message("uchar int", "uchar uint").contains("not lists"));
        assert!(message("property float x", "property double x").contains("'element face'"));
        let faces = |faces: &[[u32; 3]]| parse(&ply_bytes(&TRIANGLE, faces)).unwrap_err();
        assert_eq!(faces(&[[0, 1, 3]]), "its face 0 names vertex 3 of 3");
        assert_eq!(
            faces(&[[0, 1, u32::MAX]]),
            "its face 0 names vertex 4294967295 of 3"
        );
        let nan = ply_bytes(&[[f32::NAN, 0.0, 0.0]], &[[0, 0, 0]]);
        assert_eq!(parse(&nan).unwrap_err(), "its vertex 0 is not finite");
        let mut quad = triangle();
        let at = quad.len() - FACE_BYTES;
        quad[at] = 4;
        assert_eq!(parse(&quad).unwrap_err(), "its face 0 has 4 corners, not 3");
    }

    proptest! {
        #[test]
        fn no_bytes_panic(
            at in 0_usize..400,
            value: u8,
            noise in proptest::collection::vec(any::<u8>(), 0..64),
        ) {
            let mut bytes = triangle();
            let at = at % bytes.len();
            bytes[at] = value;
            if let Ok(parsed) = parse(&bytes) {
                prop_assert!(parsed.faces.iter().flatten().all(|c| *c < 3));
            }
            prop_assert!(parse(&noise).is_err());
        }
    }
}
