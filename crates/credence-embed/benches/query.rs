//! Cost of the query embedding of one observation's 4,600 queries.
//!
//! `RAYON_NUM_THREADS=2 cargo bench -p credence-embed --bench query` times it on two threads.

use std::{hint::black_box, time::Duration};

use credence_embed::{Observation, QueryEmbedder};
use credence_types::{Point, stream};
use criterion::{Criterion, criterion_group, criterion_main};
use rand::RngExt as _;

/// Observed points and free points of a training set of the Gaussian process.
const SUPPORT: usize = 1800;

/// Its 3,600 training points and 1,000 test points.
const QUERIES: usize = 4600;

fn query(criterion: &mut Criterion) {
    let embedder = QueryEmbedder::embedded().expect("the built-in weights fit");
    let mut rng = stream(0, "bench");
    let mut coordinate = || rng.random_range(-0.05..0.05);
    let mut cloud = |count| -> Vec<Point> {
        let point = |_| Point::new(coordinate(), coordinate(), 0.05 + coordinate());
        (0..count).map(point).collect()
    };
    let observation = Observation {
        object: cloud(SUPPORT),
        free: cloud(SUPPORT),
        viewpoint: Point::new(0.3, 0.3, 0.4),
        table_height_m: 0.0,
    };
    let queries = cloud(QUERIES);
    let mut group = criterion.benchmark_group("query");
    group
        .sample_size(20)
        .warm_up_time(Duration::from_secs(1))
        .measurement_time(Duration::from_secs(5));
    group.bench_function("embed_4600", |bencher| {
        bencher.iter(|| {
            let answers = embedder.embed(black_box(&observation), black_box(&queries));
            answers.expect("finite points")
        });
    });
    group.finish();
}

criterion_group!(benches, query);
criterion_main!(benches);
