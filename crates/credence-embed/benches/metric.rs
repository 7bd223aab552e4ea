//! Cost of the metric embedding of one cloud of 2,048 points.
//!
//! `RAYON_NUM_THREADS=2 cargo bench -p credence-embed --bench metric` times it on two threads.

use std::{hint::black_box, time::Duration};

use credence_embed::{MetricEmbedder, metric::CLOUD_POINTS};
use credence_types::{Point, stream};
use criterion::{Criterion, criterion_group, criterion_main};
use rand::RngExt as _;

fn metric(criterion: &mut Criterion) {
    let embedder = MetricEmbedder::embedded().expect("the built-in weights fit");
    let mut rng = stream(0, "bench");
    let mut coordinate = || rng.random_range(-0.1..0.1);
    let points: Vec<Point> = (0..CLOUD_POINTS)
        .map(|_| Point::new(coordinate(), coordinate(), coordinate()))
        .collect();
    let mut group = criterion.benchmark_group("metric");
    group
        .sample_size(20)
        .warm_up_time(Duration::from_secs(1))
        .measurement_time(Duration::from_secs(5));
    group.bench_function("embed_2048", |bencher| {
        bencher.iter(|| embedder.embed(black_box(&points)).expect("finite points"));
    });
    group.finish();
}

criterion_group!(benches, metric);
criterion_main!(benches);
