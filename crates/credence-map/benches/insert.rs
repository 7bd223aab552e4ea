//! 20 full 640 x 480 scans at 5 mm with free space.
//!
//! The scene is that of `harness/benchmarks/octomap_peer.py`, which times `OctoMap` on it: a table
//! at z = 0 with a ball of 8 cm radius on it, seen from an arc of 120 degrees, depth up to 1.5 m.

use std::{hint::black_box, time::Duration};

use credence_map::OccupancyMap;
use credence_types::{Intrinsics, Point};
use criterion::{BatchSize, Criterion, criterion_group, criterion_main};
use nalgebra::Vector3;

const VIEWS: usize = 20;
const RESOLUTION_M: f64 = 0.005;

/// Sensor and points of view `index`.
fn scan(index: usize) -> (Point, Vec<Point>) {
    let angle = (-60.0 + 120.0 * index as f64 / (VIEWS - 1) as f64).to_radians();
    let eye = Point::new(0.7 * angle.cos(), 0.7 * angle.sin(), 0.55);
    let forward = (Point::new(0.0, 0.0, 0.05) - eye).normalize();
    let right = forward.cross(&Vector3::z()).normalize();
    let down = forward.cross(&right);
    let camera = Intrinsics::new([640, 480], [525.0, 525.0], [319.5, 239.5]).expect("a camera");
    let pixels = (0..480).flat_map(|v| (0..640).map(move |u| (f64::from(u), f64::from(v))));
    let points = pixels.map(|(u, v)| {
        let ray = camera.ray(u, v);
        let direction = right * ray.x + down * ray.y + forward;
        eye + direction * depth(&eye, &direction)
    });
    (eye, points.collect())
}

/// Distance along `direction` to the table or the ball, at most 1.5.
fn depth(eye: &Point, direction: &Vector3<f64>) -> f64 {
    let mut depth: f64 = 1.5;
    let table = -eye.z / direction.z;
    if table > 0.0 {
        depth = depth.min(table);
    }
    let from_centre = eye - Point::new(0.0, 0.0, 0.08);
    let a = direction.norm_squared();
    let b = direction.dot(&from_centre);
    let discriminant = b * b - a * (from_centre.norm_squared() - 0.08 * 0.08);
    if discriminant > 0.0 {
        depth = depth.min((-b - discriminant.sqrt()) / a);
    }
    depth
}

fn insert(criterion: &mut Criterion) {
    let scans: Vec<_> = (0..VIEWS).map(scan).collect();
    let threads = |count| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(count);
        pool.build().expect("a thread pool")
    };
    let mut group = criterion.benchmark_group("insert 20 scans of 640x480 at 5 mm");
    group
        .sample_size(10)
        .measurement_time(Duration::from_secs(60));
    for count in [1, 2] {
        let pool = threads(count);
        group.bench_function(format!("{count} threads"), |bencher| {
            bencher.iter_batched(
                || OccupancyMap::new(RESOLUTION_M).expect("a map"),
                |mut map| {
                    pool.install(|| {
                        for (eye, points) in &scans {
                            let update = map.insert_scan(eye, points, None);
                            black_box(update.expect("a scan"));
                        }
                    });
                    map
                },
                BatchSize::PerIteration,
            );
        });
    }
    group.finish();
}

criterion_group!(benches, insert);
criterion_main!(benches);
