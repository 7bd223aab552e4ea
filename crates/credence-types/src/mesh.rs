use crate::{InvalidInput, Point};

/// A triangle mesh: not necessarily watertight, oriented or free of duplicates.
#[derive(Debug, Clone, PartialEq)]
pub struct TriMesh {
    vertices: Vec<Point>,
    faces: Vec<[u32; 3]>,
}

impl TriMesh {
    /// A mesh of vertices (metres) and triangles that index them.
    ///
    /// # Errors
    /// No face, a coordinate that is not finite, an index past the last vertex.
    pub fn new(vertices: Vec<Point>, faces: Vec<[u32; 3]>) -> Result<Self, InvalidInput> {
        if vertices.is_empty() || faces.is_empty() {
            return Err(InvalidInput::EmptyMesh {
                vertices: vertices.len(),
                faces: faces.len(),
            });
        }
        let finite = |v: &Point| v.iter().all(|c| c.is_finite());
        if let Some(index) = vertices.iter().position(|v| !finite(v)) {
            return Err(InvalidInput::NonFinitePoint {
                name: "vertices",
                index,
            });
        }
        for (face, corners) in faces.iter().enumerate() {
            if let Some(&vertex) = corners.iter().find(|&&v| v as usize >= vertices.len()) {
                return Err(InvalidInput::FaceIndex {
                    face,
                    vertex,
                    vertices: vertices.len(),
                });
            }
        }
        Ok(Self { vertices, faces })
    }

    /// Corner coordinates, metres.
    pub fn vertices(&self) -> &[Point] {
        &self.vertices
    }

    /// Vertex indices of each triangle.
    pub fn faces(&self) -> &[[u32; 3]] {
        &self.faces
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn refuses_broken_meshes() {
        let corner = Point::new(0.0, 0.0, 0.0);
        let message = |v, f| TriMesh::new(v, f).unwrap_err().to_string();
        assert!(message(vec![], vec![]).contains("0 vertices and 0 faces"));
        assert!(message(vec![corner; 3], vec![[0, 1, 3]]).contains("face 0 names vertex 3"));
        let nan = Point::new(f64::NAN, 0.0, 0.0);
        assert!(message(vec![corner, nan], vec![[0, 0, 1]]).contains("vertices[1]"));
    }
}
