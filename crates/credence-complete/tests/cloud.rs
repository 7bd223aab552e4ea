//! The completer of partial clouds from outside: what changes it, what does not, what it refuses.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::{fs, path::Path};

use credence_complete::{Completer as _, Uncompleted, cloud::CloudCompleter};
use credence_types::{Category, Completion, Frame, Instance, Intrinsics, Point, Pose};

const WIDTH: usize = 160;
const HEIGHT: usize = 120;

/// A camera 0.5 m from the foot of an upright can, 40 degrees above the table, `aside` to its
/// right: depth of can and table by ray casting, and the can's mask.
fn view(aside: f64) -> (Frame, Vec<bool>) {
    const RADIUS: f64 = 0.035;
    const TALL: f64 = 0.1;
    let (sin, cos) = 40_f64.to_radians().sin_cos();
    let eye = Point::new(0.5 * cos, aside, 0.5 * sin + 0.04);
    let pose = [
        [0.0, sin, -cos, eye.x],
        [1.0, 0.0, 0.0, eye.y],
        [0.0, -cos, -sin, eye.z],
        [0.0, 0.0, 0.0, 1.0],
    ];
    let pose = Pose::from_matrix("world_from_camera", &pose).unwrap();
    let intrinsics = Intrinsics::new([WIDTH, HEIGHT], [154.0; 2], [79.5, 59.5]).unwrap();
    let mut depth_m = Vec::new();
    let mut mask = Vec::new();
    for pixel in 0..WIDTH * HEIGHT {
        let ray = intrinsics.ray((pixel % WIDTH) as f64, (pixel / WIDTH) as f64);
        let ray = pose.transform_vector(&ray);
        let table = -eye.z / ray.z;
        let lid = (TALL - eye.z) / ray.z;
        let at = eye + lid * ray;
        let mut hit = (at.x.hypot(at.y) <= RADIUS).then_some(lid);
        let (a, b) = (ray.x.powi(2) + ray.y.powi(2), eye.x * ray.x + eye.y * ray.y);
        let c = eye.x.powi(2) + eye.y.powi(2) - RADIUS * RADIUS;
        let square = b * b - a * c;
        if hit.is_none() && square >= 0.0 {
            let wall = (-b - square.sqrt()) / a;
            let z = eye.z + wall * ray.z;
            hit = (0.0..=TALL).contains(&z).then_some(wall);
        }
        mask.push(hit.is_some());
        depth_m.push(hit.unwrap_or(table) as f32);
    }
    let rgb = vec![[90; 3]; WIDTH * HEIGHT];
    let frame = Frame::new(rgb, depth_m, intrinsics, pose, None).unwrap();
    (frame, mask)
}

fn can(mask: Vec<bool>) -> Instance {
    Instance::certain(0, mask, Category::Can).unwrap()
}

fn completer() -> CloudCompleter {
    CloudCompleter::embedded(0.0, 512).unwrap()
}

fn complete(frame: &Frame, mask: Vec<bool>) -> Result<Completion, Uncompleted> {
    completer().complete(frame, &[can(mask)]).unwrap().remove(0)
}

/// Distances of the completed points from the can's true surface.
fn distances(frame: &Frame, completion: &Completion) -> Vec<f64> {
    let points = completion.points_camera.iter();
    let world = points.map(|p| frame.world_from_camera().transform_point(p));
    let distance = |p: Point| {
        let out = p.x.hypot(p.y) - 0.035;
        let up = (p.z - 0.1).max(-p.z);
        if out.max(up) <= 0.0 {
            -out.max(up)
        } else {
            out.max(0.0).hypot(up.max(0.0))
        }
    };
    world.map(distance).collect()
}

#[test]
fn a_can_seen_from_one_side_is_completed_all_around() {
    let (frame, mask) = view(0.0);
    let completion = complete(&frame, mask).unwrap();
    assert_eq!(
        (completion.category, completion.points_camera.len()),
        (Category::Can, 512)
    );
    assert!(
        completion
            .spread_m
            .iter()
            .all(|s| s.is_finite() && *s > 0.0)
    );
    let near = distances(&frame, &completion)
        .iter()
        .filter(|d| **d < 0.005)
        .count();
    assert!(near > 400, "{near} of 512 points within 5 mm");
    let world = |p: &Point| frame.world_from_camera().transform_point(p);
    let behind = completion
        .points_camera
        .iter()
        .map(world)
        .filter(|p| p.x < -0.02);
    assert!(behind.count() > 60);
    assert!(
        (0.5..=1.0).contains(&completion.score),
        "{}",
        completion.score
    );
}

#[test]
fn neither_threads_nor_repetition_change_a_bit() {
    let (frame, mask) = view(0.0);
    let expected = complete(&frame, mask.clone());
    for threads in [1, 2] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
        let found = pool
            .build()
            .unwrap()
            .install(|| complete(&frame, mask.clone()));
        assert_eq!(found, expected);
    }
}

#[test]
fn no_object_is_an_empty_list() {
    let (frame, _) = view(0.0);
    assert_eq!(completer().complete(&frame, &[]).unwrap(), []);
}

#[test]
fn an_object_cut_by_the_border_is_completed_beyond_it() {
    let (frame, mask) = view(0.26);
    let rows = mask.chunks(WIDTH);
    assert!(rows.clone().any(|row| row[0]), "the border cuts it");
    let completion = complete(&frame, mask).unwrap();
    assert_eq!(completion.points_camera.len(), 512);
    assert!(
        completion
            .points_camera
            .iter()
            .all(|p| p.coords.norm() < 1.0)
    );
}

#[test]
fn an_object_without_depth_has_a_reason_instead_of_a_completion() {
    let (frame, mask) = view(0.0);
    let mut left = 7;
    let depth_m = frame.depth_m().iter().zip(&mask).map(|(depth, inside)| {
        let keep = !inside || left > 0;
        left -= i32::from(*inside && keep);
        if keep { *depth } else { f32::NAN }
    });
    let frame = Frame::new(
        frame.rgb().to_vec(),
        depth_m.collect(),
        *frame.intrinsics(),
        *frame.world_from_camera(),
        None,
    );
    let why = complete(&frame.unwrap(), mask).unwrap_err();
    assert_eq!(
        why.to_string(),
        "7 of its pixels have a valid depth; a completion needs at least 50"
    );
}

#[test]
fn a_mask_of_another_size_is_refused() {
    let (frame, mut mask) = view(0.0);
    mask.push(false);
    let error = completer().complete(&frame, &[can(mask)]).unwrap_err();
    assert_eq!(
        error.to_string(),
        "mask holds 19201 values; a 160 x 120 image needs 19200"
    );
}

#[test]
fn weights_that_cannot_be_used_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let message = |path: &Path| {
        CloudCompleter::from_file(path, 0.0, 512)
            .unwrap_err()
            .to_string()
    };
    let path = folder.path().join("cloud.safetensors");
    assert!(message(&path).contains(&path.display().to_string()));
    fs::write(&path, [7; 100]).unwrap();
    assert!(message(&path).contains("is not a whole safetensors file"));
}
