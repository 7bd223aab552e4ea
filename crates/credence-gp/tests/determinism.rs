//! The same bits whatever the number of threads.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use credence_gp::{
    Covariance, DirichletGp, FitConfig, Hyperparameters, Points, Smoothness, TrainingSet,
};

/// Enough points for several tiles and a last one that is not full.
const POINTS: usize = 700;

fn cube(count: usize, offset: f64) -> Points {
    let rows: Vec<f64> = (1..=count)
        .flat_map(|i| [0.8192, 0.671, 0.5497].map(|step| (offset + step * i as f64).fract()))
        .collect();
    Points::from_rows("cube", &rows, 3).unwrap()
}

fn bits(values: impl IntoIterator<Item = f64>) -> Vec<u64> {
    values.into_iter().map(f64::to_bits).collect()
}

/// Everything the crate computes, as bits.
fn everything(gp: DirichletGp, threads: usize) -> Vec<Vec<u64>> {
    let training = {
        let labels: Vec<usize> = (0..POINTS).map(|i| (i / 40) % 3).collect();
        TrainingSet::new(cube(POINTS, 0.5), &labels, 3).unwrap()
    };
    let test = cube(150, 0.25);
    let hyperparameters = [0.1, 0.2, 0.4].map(|lengthscale| Hyperparameters {
        lengthscale,
        outputscale: 5.0,
        mean: -4.0,
    });
    let config = FitConfig {
        subset: Some((0..POINTS).step_by(3).collect()),
        ..FitConfig::default()
    };
    let classic = Covariance::Classic;
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .unwrap();
    pool.install(|| {
        let likelihood = gp
            .likelihood(&training, &classic, &hyperparameters)
            .unwrap();
        let fits = gp.fit(&training, &classic, &config).unwrap();
        let posterior = gp
            .posterior(&training, &classic, &hyperparameters, &test)
            .unwrap();
        vec![
            bits(likelihood.iter().flat_map(|l| {
                [
                    l.per_datum,
                    l.gradient.lengthscale,
                    l.gradient.outputscale,
                    l.gradient.mean,
                ]
            })),
            bits(fits.iter().flat_map(|f| {
                let own = f.hyperparameters;
                [own.lengthscale, own.outputscale, own.mean, f.per_datum]
            })),
            bits(posterior.mean().concat()),
            bits(posterior.variance().concat()),
            bits(posterior.probabilities()),
            bits(posterior.confidence().unwrap()),
        ]
    })
}

#[test]
fn results_are_bit_identical_on_1_2_and_5_threads() {
    for smoothness in [
        Smoothness::Half,
        Smoothness::ThreeHalves,
        Smoothness::FiveHalves,
    ] {
        let gp = DirichletGp {
            smoothness,
            ..DirichletGp::default()
        };
        let one = everything(gp, 1);
        for threads in [2, 5] {
            for repeat in 0..2 {
                assert!(
                    everything(gp, threads) == one,
                    "{smoothness:?} differs on {threads} threads, repeat {repeat}"
                );
            }
        }
    }
}
