//! What follows a completer: 2,048 completed points onto 1,500 observed ones, and 2,048 of 8,000
//! in an even order.

use std::{f64::consts::TAU, hint::black_box};

use credence_complete::{even_order, refine};
use credence_types::{Category, Completion, Point};
use criterion::{Criterion, criterion_group, criterion_main};
use nalgebra::Vector3;

/// A tin of 8 cm, half a metre from the camera, whose y axis points down along it.
fn tin(count: usize) -> Vec<Point> {
    // Golden-angle spiral: evenly spread around and along.
    let on_wall = |i: usize| {
        let angle = TAU * 0.618_034 * i as f64;
        let along = (i as f64 + 0.5) / count as f64;
        Point::new(
            0.04 * angle.sin(),
            0.12 * along - 0.06,
            0.5 - 0.04 * angle.cos(),
        )
    };
    (0..count).map(on_wall).collect()
}

fn register(criterion: &mut Criterion) {
    let shifted = tin(2048)
        .into_iter()
        .map(|p| p + Vector3::new(0.008, -0.006, 0.01));
    let completion = Completion {
        category: Category::Can,
        score: 1.0,
        points_camera: shifted.collect(),
        spread_m: vec![0.003; 2048],
    };
    let mut observed = tin(4000);
    observed.retain(|point| point.z < 0.5);
    observed.truncate(1500);
    let up = -Vector3::y();
    criterion.bench_function("refine 2048 points on 1500", |bencher| {
        bencher.iter(|| refine(black_box(&completion), &observed, &up));
    });
}

fn order(criterion: &mut Criterion) {
    let points = tin(8000);
    criterion.bench_function("2048 of 8000 points in even order", |bencher| {
        bencher.iter(|| even_order(black_box(&points), 2048));
    });
}

criterion_group!(benches, register, order);
criterion_main!(benches);
