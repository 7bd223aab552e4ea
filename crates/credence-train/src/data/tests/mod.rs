//! Boxes on the table, whose truth can be computed by hand.

mod cache;
mod rays;
mod scenes;

use std::{fs, path::Path};

use credence_types::Category;
use parry3d_f64::math::Vector;

use super::{
    mesh_set::{Mesh, MeshSet},
    ply::{self, Triangles},
};

/// The generator's encoding, with normals and texture coordinates of 0.
pub(super) fn ply_bytes(vertices: &[[f32; 3]], faces: &[[u32; 3]]) -> Vec<u8> {
    let fields = ["x", "y", "z", "nx", "ny", "nz", "s", "t"];
    let fields = fields
        .map(|name| format!("property float {name}\n"))
        .concat();
    let header = format!(
        "ply\nformat binary_little_endian 1.0\nelement vertex {}\n{fields}element face {}\n\
         property list uchar int vertex_indices\nend_header\n",
        vertices.len(),
        faces.len()
    );
    let mut bytes = header.into_bytes();
    for [x, y, z] in vertices {
        let vertex = [*x, *y, *z, 0.0, 0.0, 0.0, 0.0, 0.0];
        bytes.extend(vertex.iter().flat_map(|field| field.to_le_bytes()));
    }
    for face in faces {
        bytes.push(3);
        bytes.extend(face.iter().flat_map(|corner| corner.to_le_bytes()));
    }
    bytes
}

/// Corners and outward faces of an upright box about the z axis, from z = 0.
fn cuboid([x, y, z]: [f32; 3]) -> Triangles {
    let vertices = (0..8)
        .map(|corner| {
            let side = |bit: i32, half: f32| if corner & bit == 0 { -half } else { half };
            [
                side(1, x / 2.0),
                side(2, y / 2.0),
                if corner & 4 == 0 { 0.0 } else { z },
            ]
        })
        .collect();
    let quads: [[u32; 4]; 6] = [
        [0, 2, 3, 1],
        [4, 5, 7, 6],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 4, 6, 2],
        [1, 3, 7, 5],
    ];
    let faces = quads
        .iter()
        .flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]])
        .collect();
    Triangles { vertices, faces }
}

fn cuboid_mesh(size: [f32; 3], category: Category) -> Mesh {
    Mesh::new(cuboid(size), category).unwrap()
}

/// Distance from the surface of such a box, negative inside.
fn signed_distance(size: [f64; 3], point: Vector) -> f64 {
    let [x, y, z] = size;
    let centred = point - Vector::new(0.0, 0.0, z / 2.0);
    let outside = centred.abs() - Vector::new(x, y, z) / 2.0;
    let apart = outside.max(Vector::ZERO).length();
    if apart > 0.0 {
        apart
    } else {
        outside.max_element()
    }
}

/// A folder with two boxes per category.
fn write_boxes(folder: &Path) {
    let mut entries = Vec::new();
    for category in Category::ALL {
        for number in 0..2 {
            let path = format!("{category}-{number}.ply");
            let size = [
                0.06,
                0.08 + 0.02 * number as f32,
                0.05 + 0.01 * f32::from(category.class()),
            ];
            let Triangles { vertices, faces } = cuboid(size);
            fs::write(folder.join(&path), ply_bytes(&vertices, &faces)).unwrap();
            entries.push(serde_json::json!({ "path": path, "category": category.name() }));
        }
    }
    let manifest = serde_json::to_vec(&entries).unwrap();
    fs::write(folder.join("MANIFEST.json"), manifest).unwrap();
}

pub(crate) fn boxes() -> (tempfile::TempDir, MeshSet) {
    let folder = tempfile::tempdir().unwrap();
    write_boxes(folder.path());
    let meshes = MeshSet::open(folder.path()).unwrap();
    (folder, meshes)
}

#[test]
fn a_set_of_meshes_opens() {
    let (_folder, meshes) = boxes();
    assert_eq!(meshes.len(), 12);
    assert!(!meshes.is_empty());
}

#[test]
fn the_fingerprint_follows_the_meshes() {
    let (folder, meshes) = boxes();
    let again = MeshSet::open(folder.path()).unwrap();
    assert_eq!(meshes.fingerprint(), again.fingerprint());
    let Triangles { vertices, faces } = cuboid([0.1; 3]);
    fs::write(
        folder.path().join("mug-0.ply"),
        ply_bytes(&vertices, &faces),
    )
    .unwrap();
    let other = MeshSet::open(folder.path()).unwrap();
    assert_ne!(meshes.fingerprint(), other.fingerprint());
}

#[test]
fn bad_meshes_are_named() {
    let (folder, _) = boxes();
    let folder = folder.path();
    let message = || MeshSet::open(folder).unwrap_err().to_string();
    let bad = |bytes: &[u8]| {
        fs::write(folder.join("can-1.ply"), bytes).unwrap();
        let message = message();
        assert!(message.contains("can-1.ply cannot be used: "), "{message}");
        assert!(message.ends_with("generate the meshes again with `harness assets`"));
        message
    };
    assert!(bad(b"").contains("no PLY header"));
    let flat = ply_bytes(&[[0.0; 3]], &[[0, 0, 0]]);
    assert!(bad(&flat).contains("its faces have no area"));
    let in_millimetres = cuboid([60.0, 60.0, 80.0]);
    let in_millimetres = ply_bytes(&in_millimetres.vertices, &in_millimetres.faces);
    assert!(bad(&in_millimetres).contains("80.000 m, at least 1 m"));
    fs::remove_file(folder.join("can-1.ply")).unwrap();
    assert!(message().contains("can-1.ply: ") && message().starts_with("cannot read "));

    let manifest = |text: &str| {
        fs::write(folder.join("MANIFEST.json"), text).unwrap();
        message()
    };
    assert!(manifest("[").contains("MANIFEST.json cannot be used: it is not a list of meshes"));
    let unknown = manifest(r#"[{"path": "can-0.ply", "category": "jar"}]"#);
    assert!(unknown.contains("can-0.ply: ") && unknown.contains("'jar'"));
    let only_cans = manifest(r#"[{"path": "can-0.ply", "category": "can"}]"#);
    assert!(only_cans.contains("it lists no bottle"));
    fs::remove_file(folder.join("MANIFEST.json")).unwrap();
    assert!(message().starts_with("cannot read "));
}

#[test]
fn a_mesh_stands_on_the_table_about_the_axis() {
    let Triangles { vertices, faces } = cuboid([0.2, 0.1, 0.06]);
    let vertices: Vec<[f32; 3]> = vertices
        .iter()
        .map(|[x, y, z]| [x + 1.0, y - 3.0, z + 2.0])
        .collect();
    let parsed = ply::parse(&ply_bytes(&vertices, &faces)).unwrap();
    let mesh = Mesh::new(parsed, Category::Can).unwrap();
    // The coordinates are f32 near 3.
    let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-6, "{a} {b}");
    near(mesh.height, 0.06);
    near(mesh.half_extents[0], 0.1);
    near(mesh.half_extents[1], 0.05);
    near(mesh.radius, 0.1_f64.hypot(0.05));
    let distance = |point: Vector| mesh.nearest(point).distance(point);
    near(distance(Vector::new(0.0, 0.0, 0.01)), 0.01);
    near(distance(Vector::new(0.13, 0.09, 0.03)), 0.05);
}
