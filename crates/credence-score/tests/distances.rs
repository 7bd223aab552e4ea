//! Distances to meshes, against worked examples and against every face in turn.

use credence_score::MeshTruth;
use credence_types::{Point, TriMesh};
use nalgebra::{Isometry3, Rotation3, Vector3};
use proptest::prelude::*;

fn mesh(vertices: &[[f64; 3]], faces: &[[u32; 3]]) -> TriMesh {
    let vertices = vertices.iter().copied().map(Point::from).collect();
    TriMesh::new(vertices, faces.to_vec()).expect("the test's mesh is valid")
}

fn right_triangle() -> TriMesh {
    mesh(
        &[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
        &[[0, 1, 2]],
    )
}

/// A unit cube centred on the origin.
fn cube() -> TriMesh {
    let corner = |i: u32| [0, 1, 2].map(|k| f64::from(i >> k & 1) - 0.5);
    let vertices: Vec<[f64; 3]> = (0..8).map(corner).collect();
    let quads = [
        [0, 2, 3, 1],
        [4, 5, 7, 6],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 4, 6, 2],
        [1, 3, 7, 5],
    ];
    let faces: Vec<[u32; 3]> = quads
        .iter()
        .flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]])
        .collect();
    mesh(&vertices, &faces)
}

/// The distance to a triangle as the least of the distances to its three edges and, where the
/// point projects into it, to its plane.
fn reference_distance([a, b, c]: [Point; 3], p: Point) -> f64 {
    let edge = |from: Point, to: Point| {
        let along = to - from;
        let share = (along.dot(&(p - from)) / along.norm_squared()).clamp(0.0, 1.0);
        (p - (from + along * share)).norm()
    };
    let mut best = edge(a, b).min(edge(b, c)).min(edge(c, a));
    let normal = (b - a).cross(&(c - a)).normalize();
    let inside = [(a, b), (b, c), (c, a)]
        .iter()
        .all(|(from, to)| normal.cross(&(to - from)).dot(&(p - from)) >= 0.0);
    if inside {
        best = best.min(normal.dot(&(p - a)).abs());
    }
    best
}

fn corners(mesh: &TriMesh) -> Vec<[Point; 3]> {
    let vertex = |i: u32| mesh.vertices()[i as usize];
    mesh.faces().iter().map(|face| face.map(vertex)).collect()
}

#[test]
fn a_single_triangle_is_measured_to_its_face_edges_and_corners() {
    let truth = MeshTruth::new(&right_triangle()).unwrap();
    let cases = [
        ([0.25, 0.25, 0.5], 0.5),
        ([0.25, 0.25, -0.5], 0.5),
        ([0.5, -2.0, 0.0], 2.0),
        ([1.0, 1.0, 0.0], 0.5_f64.sqrt()),
        ([4.0, 0.0, 4.0], 5.0),
        ([-3.0, -4.0, 0.0], 5.0),
        ([0.1, 0.1, 0.0], 0.0),
    ];
    for (point, expected) in cases {
        let found = truth.distances(&[Point::from(point)]).unwrap()[0];
        assert!((found - expected).abs() < 1e-15, "{point:?}: {found}");
    }
    assert_eq!(truth.distances(&[]), Ok(vec![]));
}

#[test]
fn distance_is_unsigned_inside_a_closed_mesh() {
    let truth = MeshTruth::new(&cube()).unwrap();
    let points = [[0.0, 0.0, 0.0], [0.0, 0.0, 0.4], [0.0, 0.0, 0.75]].map(Point::from);
    let found = truth.distances(&points).unwrap();
    for (found, expected) in found.into_iter().zip([0.5, 0.1, 0.25]) {
        assert!((found - expected).abs() < 1e-15);
    }
}

#[test]
fn degenerate_and_duplicate_faces_change_nothing() {
    let point = [Point::new(0.3, 0.1, 2.0)];
    let plain = MeshTruth::new(&right_triangle()).unwrap();
    let messy = MeshTruth::new(&mesh(
        &[
            [0.0, 0.0, 0.0],
            [1.0, 0.0, 0.0],
            [0.0, 1.0, 0.0],
            [0.0, 0.0, 0.0],
            [2.0, 0.0, 0.0],
            [0.3, 0.1, 1.9],
        ],
        // The face, a copy over duplicate vertices, a point off the surface, two lines.
        &[[0, 1, 2], [3, 1, 2], [5, 5, 5], [0, 1, 4], [1, 5, 1]],
    ))
    .unwrap();
    assert_eq!(messy.degenerate_faces(), 3);
    assert_eq!(messy.distances(&point), plain.distances(&point));
}

#[test]
fn a_mesh_without_area_is_refused() {
    let line = mesh(
        &[[0.0, 0.0, 0.0], [1.0, 1.0, 1.0], [2.0, 2.0, 2.0]],
        &[[0, 1, 2], [0, 0, 0]],
    );
    let message = MeshTruth::new(&line).unwrap_err().to_string();
    assert!(message.contains("all 2 faces of the mesh have zero area"));
}

#[test]
fn points_and_vertices_beyond_the_world_are_refused_by_index() {
    let truth = MeshTruth::new(&right_triangle()).unwrap();
    for value in [f64::NAN, f64::INFINITY, -1.1e6] {
        let points = [Point::origin(), Point::new(0.0, value, 0.0)];
        let message = truth.distances(&points).unwrap_err().to_string();
        assert!(message.starts_with("points[1] is [0.0, "), "{message}");
        assert!(message.contains("within 1e6 m"), "{message}");
    }
    let far = mesh(
        &[[0.0, 0.0, 0.0], [1e7, 0.0, 0.0], [0.0, 1.0, 0.0]],
        &[[0, 1, 2]],
    );
    let message = MeshTruth::new(&far).unwrap_err().to_string();
    assert!(message.starts_with("vertices[1]"), "{message}");
}

#[test]
fn results_do_not_depend_on_threads_order_or_company() {
    let truth = MeshTruth::new(&cube()).unwrap();
    let points: Vec<Point> = (0..3000)
        .map(|i| {
            let angle = f64::from(i);
            Point::new(angle.sin(), (1.7 * angle).cos(), (2.3 * angle).sin())
        })
        .collect();
    let together = truth.distances(&points).unwrap();
    let alone: Vec<f64> = points
        .iter()
        .map(|&point| truth.distances(&[point]).unwrap()[0])
        .collect();
    assert_eq!(together, alone);
    let one_thread = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()
        .unwrap()
        .install(|| truth.distances(&points).unwrap());
    assert_eq!(together, one_thread);
}

/// Triangles of which many are slivers: the third corner lies at 1 down to 1e-7 of the first
/// edge's length over its line.
fn faces() -> impl Strategy<Value = Vec<[Point; 3]>> {
    let face = (
        prop::array::uniform3(-1.0..1.0_f64),
        prop::array::uniform3(-3.0..3.0_f64),
        0.05..1.0_f64,
        -0.2..1.2_f64,
        0..8_i32,
    );
    let face = face.prop_map(|(corner, turn, length, share, thinness)| {
        let turn = Rotation3::new(Vector3::from(turn));
        let height = length * 10.0_f64.powi(-thinness);
        let a = Point::from(corner);
        let along = |x: f64, y: f64| a + turn * Vector3::new(x, y, 0.0);
        [a, along(length, 0.0), along(length * share, height)]
    });
    prop::collection::vec(face, 1..200)
}

fn soup(faces: &[[Point; 3]]) -> TriMesh {
    let indices = (0..faces.len() as u32)
        .map(|i| [3 * i, 3 * i + 1, 3 * i + 2])
        .collect();
    TriMesh::new(faces.concat(), indices).expect("a soup is a mesh")
}

proptest! {
    #[test]
    fn agrees_with_every_face(
        faces in faces(),
        points in prop::collection::vec(prop::array::uniform3(-2.0..2.0_f64), 1..50),
    ) {
        let points: Vec<Point> = points.into_iter().map(Point::from).collect();
        let mesh = soup(&faces);
        let truth = MeshTruth::new(&mesh).unwrap();
        prop_assert_eq!(truth.degenerate_faces(), 0);
        let found = truth.distances(&points).unwrap();
        for (point, found) in points.iter().zip(found) {
            let expected = corners(&mesh)
                .into_iter()
                .map(|face| reference_distance(face, *point))
                .fold(f64::INFINITY, f64::min);
            prop_assert!((found - expected).abs() <= 1e-9, "{found} for {expected}");
        }
    }

    #[test]
    fn moving_the_world_moves_the_points_with_it(
        faces in faces(),
        point in prop::array::uniform3(-2.0..2.0_f64),
        shift in prop::array::uniform3(-3.0..3.0_f64),
        turn in prop::array::uniform3(-3.0..3.0_f64),
    ) {
        let mesh = soup(&faces);
        let world_from_mesh = Isometry3::new(Vector3::from(shift), turn.into());
        let world = |mesh_point: &Point| world_from_mesh * mesh_point;
        let vertices = mesh.vertices().iter().map(world).collect();
        let moved = TriMesh::new(vertices, mesh.faces().to_vec()).unwrap();
        let point = Point::from(point);
        let here = MeshTruth::new(&mesh).unwrap().distances(&[point]).unwrap()[0];
        let there = MeshTruth::new(&moved).unwrap().distances(&[world(&point)]).unwrap()[0];
        prop_assert!((here - there).abs() <= 1e-9);
    }
}
