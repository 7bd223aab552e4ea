use std::f64::consts::TAU;

use credence_types::Category;
use nalgebra::{Isometry3, Rotation3};
use proptest::prelude::*;

use super::*;

/// A mug of 8 cm on the table z = 0, with a handle towards +x: wall, inner wall, bottom, handle,
/// each point with its outward normal, about `step_m` apart.
fn mug(step_m: f64) -> Vec<(Point, Vector3<f64>)> {
    let mut points = Vec::new();
    let steps = |length: f64| (length / step_m).ceil() as usize;
    for (radius, bottom, sign) in [(0.04, 0.0, 1.0), (0.036, 0.004, -1.0)] {
        let around = steps(TAU * radius);
        let up = steps(0.09 - bottom);
        for (i, j) in (0..around).flat_map(|i| (0..=up).map(move |j| (i, j))) {
            let (sin, cos) = (TAU * i as f64 / around as f64).sin_cos();
            let z = bottom + (0.09 - bottom) * j as f64 / up as f64;
            points.push((
                Point::new(radius * cos, radius * sin, z),
                Vector3::new(cos, sin, 0.0) * sign,
            ));
        }
        let across = steps(2.0 * radius);
        for (i, j) in (0..across).flat_map(|i| (0..across).map(move |j| (i, j))) {
            let at = |i: usize| radius * (2.0 * (i as f64 + 0.5) / across as f64 - 1.0);
            if at(i).hypot(at(j)) < radius {
                let normal = Vector3::z() * if sign > 0.0 { -1.0 } else { 1.0 };
                points.push((Point::new(at(i), at(j), bottom), normal));
            }
        }
    }
    // Half a torus in the plane y = 0.
    let (ring, tube) = (0.025, 0.006);
    let (along, around) = (steps(TAU / 2.0 * ring), steps(TAU * tube));
    for (i, j) in (0..=along).flat_map(|i| (0..around).map(move |j| (i, j))) {
        let (sin, cos) = (TAU / 2.0 * (i as f64 / along as f64 - 0.5)).sin_cos();
        let (high, out) = (TAU * j as f64 / around as f64).sin_cos();
        let normal = Vector3::new(cos * out, high, sin * out);
        let point = Point::new(0.038 + ring * cos, 0.0, 0.045 + ring * sin) + normal * tube;
        points.push((point, normal));
    }
    points
}

/// What a camera at `eye` sees of them: those that face it and are the nearest within 3 mrad.
fn seen_from(eye: &Point, points: &[(Point, Vector3<f64>)]) -> Vec<Point> {
    let forward = (Point::new(0.0, 0.0, 0.045) - eye).normalize();
    let right = forward.cross(&Vector3::z()).normalize();
    let down = forward.cross(&right);
    let cell = |p: &Point| {
        let offset = p - eye;
        let depth = offset.dot(&forward);
        let at = |axis: &Vector3<f64>| (offset.dot(axis) / depth / 0.003).round() as i32;
        ((at(&right), at(&down)), depth)
    };
    let mut nearest = std::collections::BTreeMap::new();
    for (point, _) in points {
        let (at, depth) = cell(point);
        let known = nearest.entry(at).or_insert(depth);
        *known = depth.min(*known);
    }
    let seen = points.iter().filter(|(point, normal)| {
        let (at, depth) = cell(point);
        depth < nearest[&at] + 0.003 && normal.dot(&(eye - point)) > 0.0
    });
    seen.map(|(point, _)| *point).collect()
}

/// The eye of a wrist camera that sees the handle.
const EYE: [f64; 3] = [0.25, -0.3, 0.35];

/// World to the camera there, which is rolled by 20 degrees, and the vertical in it.
fn to_camera() -> (Isometry3<f64>, Vector3<f64>) {
    let eye = Point::from(EYE);
    let look = Isometry3::look_at_lh(&eye, &Point::new(0.0, 0.0, 0.045), &-Vector3::z());
    let camera = Isometry3::rotation(Vector3::z() * 0.35) * look;
    (camera, camera * Vector3::z())
}

fn completion(points: impl Iterator<Item = Point>) -> Completion {
    let points_camera: Vec<Point> = points.collect();
    Completion {
        category: Category::Mug,
        score: 1.0,
        spread_m: vec![0.001; points_camera.len()],
        points_camera,
    }
}

/// Mean distance of corresponding points.
fn apart_m(a: &Completion, b: &Completion) -> f64 {
    let pairs = a.points_camera.iter().zip(&b.points_camera);
    pairs.map(|(a, b)| (a - b).norm()).sum::<f64>() / a.points_camera.len() as f64
}

/// The whole mug in the camera frame, and what is seen of it.
fn scene() -> (Completion, Vec<Point>) {
    let (camera, _) = to_camera();
    let whole = mug(0.005).into_iter().map(|(p, _)| camera * p);
    let seen = seen_from(&Point::from(EYE), &mug(0.0015));
    (completion(whole), seen.iter().map(|p| camera * p).collect())
}

#[test]
fn recovers_a_known_motion_from_one_side() {
    let (camera, up) = to_camera();
    let (truth, observed) = scene();

    for (shift, yaw, [wide, high]) in [
        ([0.008, -0.005, 0.006], 0.0, [1.0, 1.0]),
        ([0.0, 0.0, 0.0], 0.25, [1.0, 1.0]),
        ([0.0, 0.0, 0.0], 0.0, [1.15, 0.9]),
        ([-0.01, 0.01, 0.005], -0.2, [0.88, 1.1]),
    ] {
        let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), yaw);
        let displace = |p: &Point| {
            let p = turn * (camera.inverse() * p);
            let scaled = Point::new(p.x * wide, p.y * wide, p.z * high);
            camera * (scaled + Vector3::from(shift))
        };
        let displaced = completion(truth.points_camera.iter().map(displace));
        let refined = refine(&displaced, &observed, &up).unwrap();
        let [before, after] = [&displaced, &refined.completion].map(|c| apart_m(c, &truth));
        assert!(before > 0.007 && after < 0.001, "{before} {after}");
        assert!(refined.residual_before_m > 0.001 && refined.residual_after_m < 0.0005);
        let mended = refined.residual_after_m / refined.residual_before_m;
        let spread_m = &refined.completion.spread_m;
        assert!(spread_m.iter().all(|s| (s - 0.001 * mended).abs() < 1e-12));
        assert_eq!(refined.completion.score, displaced.score);
    }
}

#[test]
fn what_fits_stays() {
    let (_, up) = to_camera();
    let (truth, observed) = scene();
    let refined = refine(&truth, &observed, &up).unwrap();
    let moved = apart_m(&refined.completion, &truth);
    assert!(moved < 3e-4, "{moved}");
    assert!(refined.residual_after_m < 5e-4, "{refined:?}");
}

#[test]
fn clouds_without_a_surface_are_no_trouble() {
    let (_, up) = to_camera();
    let (truth, observed) = scene();
    let one = completion(std::iter::once(observed[0]));
    assert!(refine(&one, &observed, &up).is_ok());
    let same = completion(std::iter::repeat_n(observed[7], 20_000));
    let refined = refine(&same, &observed, &up).unwrap();
    assert!(refined.residual_after_m <= refined.residual_before_m);
    assert_eq!(refined.completion.points_camera.len(), 20_000);
    let refined = refine(&truth, &[], &up).unwrap();
    assert!(refined.residual_before_m.is_nan() && refined.completion == truth);
    let empty = completion(std::iter::empty());
    assert_eq!(refine(&empty, &observed, &up).unwrap().completion, empty);
}

#[test]
fn refuses_what_is_no_point_or_no_vertical() {
    let (_, up) = to_camera();
    let (truth, observed) = scene();
    let message = |refused: Result<Refined, CompleteError>| refused.unwrap_err().to_string();
    let nan = [Point::new(0.0, f64::NAN, 1.0)];
    assert!(message(refine(&truth, &nan, &up)).contains("observed points[0] is not finite"));
    let broken = completion(nan.into_iter());
    assert!(message(refine(&broken, &observed, &up)).contains("completed points[0]"));
    assert_eq!(
        message(refine(&truth, &observed, &Vector3::zeros())),
        "the vertical [0.0, 0.0, 0.0] has no direction; pass the world's z axis in the camera frame"
    );
}

fn anywhere(most: usize) -> impl Strategy<Value = Vec<Point>> {
    let axis = || -0.1..0.1_f64;
    let points = prop::collection::vec((axis(), axis(), 0.3..0.6_f64), 1..most);
    points.prop_map(|points| {
        points
            .into_iter()
            .map(|(x, y, z)| Point::new(x, y, z))
            .collect()
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn no_completion_gets_worse(
        completed in anywhere(300), observed in anywhere(300), up in [-1.0..1.0_f64, 0.1..1.0, -1.0..1.0],
    ) {
        let before = completion(completed.into_iter());
        let up = Vector3::from(up);
        let refined = refine(&before, &observed, &up).unwrap();
        prop_assert!(refined.residual_after_m <= refined.residual_before_m);
        let is_moved = refined.completion != before;
        prop_assert_eq!(is_moved, refined.residual_after_m < refined.residual_before_m);
        // What it reports is the residual of its outcome.
        let again = refine(&refined.completion, &observed, &up).unwrap();
        prop_assert!((again.residual_before_m - refined.residual_after_m).abs() < 1e-9);
        prop_assert!(refined.completion.points_camera.iter().all(|p| p.iter().all(|c| c.is_finite())));
        let repeated = refine(&before, &observed, &up).unwrap();
        prop_assert_eq!(refined, repeated);
    }
}
