//! Cost of exact inference at the size of the benchmark's scenes: 2 classes, 3 coordinates.
//!
//! `RAYON_NUM_THREADS=2 cargo bench -p credence-gp` times it on two threads.

use std::{hint::black_box, time::Duration};

use credence_gp::{Covariance, DirichletGp, Hyperparameters, Points, TrainingSet};
use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};

const TEST_POINTS: usize = 1000;

/// Points of the unit cube by the additive recurrence of the plastic number's kin (R3 sequence).
fn cube(count: usize, offset: f64) -> Vec<f64> {
    const STEPS: [f64; 3] = [
        0.819_172_513_396_164_4,
        0.671_043_606_703_789_3,
        0.549_700_477_901_970_2,
    ];
    (1..=count)
        .flat_map(|i| STEPS.map(|step| (offset + step * i as f64).fract()))
        .collect()
}

/// A ball in the middle of the cube is class 1, the rest class 0.
fn training(count: usize) -> TrainingSet {
    let rows = cube(count, 0.5);
    let labels: Vec<usize> = rows
        .chunks_exact(3)
        .map(|p| usize::from(p.iter().map(|x| (x - 0.5).powi(2)).sum::<f64>() < 0.12))
        .collect();
    TrainingSet::new(
        Points::from_rows("points", &rows, 3).expect("finite"),
        &labels,
        2,
    )
    .expect("both classes occur")
}

fn hyperparameters() -> [Hyperparameters; 2] {
    [(0.15, -3.0), (0.2, -5.0)].map(|(lengthscale, mean)| Hyperparameters {
        lengthscale,
        outputscale: 6.0,
        mean,
    })
}

fn exact(criterion: &mut Criterion) {
    let gp = DirichletGp::default();
    let hyperparameters = hyperparameters();
    let test = Points::from_rows("test", &cube(TEST_POINTS, 0.25), 3).expect("finite");

    let mut group = criterion.benchmark_group("exact");
    group
        .sample_size(10)
        .warm_up_time(Duration::from_secs(1))
        .measurement_time(Duration::from_secs(10));
    for count in [500, 1000, 2000, 3600] {
        let training = training(count);
        group.bench_with_input(
            BenchmarkId::new("posterior_1000", count),
            &training,
            |bencher, training| {
                bencher.iter(|| {
                    gp.posterior(
                        black_box(training),
                        &Covariance::Classic,
                        &hyperparameters,
                        &test,
                    )
                });
            },
        );
        group.bench_with_input(
            BenchmarkId::new("likelihood_and_gradient", count),
            &training,
            |bencher, training| {
                bencher.iter(|| {
                    gp.likelihood(black_box(training), &Covariance::Classic, &hyperparameters)
                });
            },
        );
    }
    group.finish();
}

criterion_group!(benches, exact);
criterion_main!(benches);
