//! Depths along rays, against worked examples and against every face in turn.

use credence_score::MeshTruth;
use credence_types::{Intrinsics, Point, TriMesh};
use nalgebra::Vector3;
use proptest::prelude::*;

/// A square of side 2 around the z axis at a height, as two triangles.
fn square(height: f64) -> TriMesh {
    let vertices =
        [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]].map(|[x, y]| Point::new(x, y, height));
    TriMesh::new(vertices.to_vec(), vec![[0, 1, 2], [0, 2, 3]]).expect("a square is a mesh")
}

fn depth(truth: &MeshTruth, origin: [f64; 3], direction: [f64; 3]) -> f64 {
    truth
        .ray_depths(&[Point::from(origin)], &[Vector3::from(direction)])
        .expect("a valid ray")[0]
}

#[test]
fn both_sides_of_a_face_are_hit() {
    let truth = MeshTruth::new(&square(1.0)).unwrap();
    assert_eq!(depth(&truth, [0.3, 0.2, 0.0], [0.0, 0.0, 1.0]), 1.0);
    assert_eq!(depth(&truth, [0.3, 0.2, 3.0], [0.0, 0.0, -1.0]), 2.0);
    // The diagonal that both triangles share is no gap.
    assert_eq!(depth(&truth, [0.0, 0.0, 0.0], [0.0, 0.0, 1.0]), 1.0);
}

#[test]
fn a_miss_is_nan() {
    let truth = MeshTruth::new(&square(1.0)).unwrap();
    assert!(depth(&truth, [0.0, 0.0, 0.0], [0.0, 0.0, -1.0]).is_nan());
    assert!(depth(&truth, [1.1, 0.0, 0.0], [0.0, 0.0, 1.0]).is_nan());
    assert!(depth(&truth, [0.0, 0.0, 0.0], [1.0, 0.0, 0.0]).is_nan());
}

#[test]
fn depth_counts_in_lengths_of_the_direction() {
    let truth = MeshTruth::new(&square(1.0)).unwrap();
    assert_eq!(depth(&truth, [0.3, 0.2, 0.0], [0.0, 0.0, 0.5]), 2.0);
    // A camera at the origin sees the square at z = 1 in every pixel that it covers.
    let camera = Intrinsics::new([5, 5], [4.0, 4.0], [2.0, 2.0]).unwrap();
    let rays: Vec<Vector3<f64>> = (0..25)
        .map(|i| camera.ray(f64::from(i % 5), f64::from(i / 5)))
        .collect();
    let depths = truth.ray_depths(&[Point::origin(); 25], &rays).unwrap();
    assert!(depths.iter().all(|depth| (depth - 1.0).abs() < 1e-15));
}

#[test]
fn broken_rays_are_refused_by_index() {
    let truth = MeshTruth::new(&square(1.0)).unwrap();
    let message = |origins: &[Point], directions: &[Vector3<f64>]| {
        truth
            .ray_depths(origins, directions)
            .unwrap_err()
            .to_string()
    };
    let (origin, up) = (Point::origin(), Vector3::z());
    assert!(message(&[origin; 2], &[up]).contains("directions holds 1 values and origins 2"));
    assert!(message(&[origin; 2], &[up, Vector3::zeros()]).contains("directions[1] is [0.0, "));
    let nan = Point::new(f64::NAN, 0.0, 0.0);
    assert!(message(&[origin, nan], &[up; 2]).contains("origins[1]"));
}

/// Where a ray meets a triangle, from the three signed volumes it spans with its edges.
fn reference_depth([a, b, c]: [Point; 3], origin: Point, direction: Vector3<f64>) -> Option<f64> {
    let volume = |from: Point, to: Point| direction.dot(&(from - origin).cross(&(to - origin)));
    let signs = [volume(a, b), volume(b, c), volume(c, a)];
    let inside = signs.iter().all(|v| *v > 0.0) || signs.iter().all(|v| *v < 0.0);
    let normal = (b - a).cross(&(c - a));
    let depth = normal.dot(&(a - origin)) / normal.dot(&direction);
    (inside && depth >= 0.0).then_some(depth)
}

proptest! {
    #[test]
    fn agrees_with_every_face(
        corners in prop::collection::vec(prop::array::uniform3(-1.0..1.0_f64), 3..300),
        origins in prop::collection::vec(prop::array::uniform3(-2.0..2.0_f64), 1..40),
        target in prop::array::uniform3(-0.5..0.5_f64),
    ) {
        let corners: Vec<Point> = corners.into_iter().map(Point::from).collect();
        let faces: Vec<[Point; 3]> = corners
            .chunks_exact(3)
            .map(|face| [face[0], face[1], face[2]])
            .collect();
        let indices = (0..faces.len() as u32)
            .map(|i| [3 * i, 3 * i + 1, 3 * i + 2])
            .collect();
        let truth = MeshTruth::new(&TriMesh::new(faces.concat(), indices).unwrap()).unwrap();
        let origins: Vec<Point> = origins.into_iter().map(Point::from).collect();
        let directions: Vec<Vector3<f64>> =
            origins.iter().map(|o| Point::from(target) - o).collect();
        let depths = truth.ray_depths(&origins, &directions).unwrap();
        for ((origin, direction), depth) in origins.iter().zip(&directions).zip(depths) {
            let expected = faces
                .iter()
                .filter_map(|face| reference_depth(*face, *origin, *direction))
                .fold(f64::NAN, f64::min);
            let agree = (depth - expected).abs() <= 1e-9 || (depth.is_nan() && expected.is_nan());
            prop_assert!(agree, "{depth} for {expected}");
        }
    }
}
