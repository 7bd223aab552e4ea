//! What the classifier gives on small inputs whose answer is known.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use credence_gp::{
    Covariance, DirichletGp, FitConfig, Hyperparameters, Points, Smoothness, Start, TrainingSet,
};

const CLASSIC: Covariance = Covariance::Classic;

fn points(rows: &[f64], dim: usize) -> Points {
    Points::from_rows("points", rows, dim).unwrap()
}

fn own(lengthscale: f64, outputscale: f64, mean: f64) -> Hyperparameters {
    Hyperparameters {
        lengthscale,
        outputscale,
        mean,
    }
}

/// Own target and noise, then other target and noise, at `alpha_epsilon` 0.01.
const OWN: (f64, f64) = (-0.334_141_864_755_740_04, 0.688_184_391_217_816_3);
const OTHER: (f64, f64) = (-6.912_730_444_408_721, 4.615_120_516_841_26);

#[test]
fn posterior_at_a_training_point_far_from_the_others_is_that_of_one_observation() {
    // Distance 1000 lengthscales: the two points do not know of each other.
    let training = TrainingSet::new(points(&[0.0, 1000.0], 1), &[0, 1], 2).unwrap();
    let hyperparameters = [own(1.0, 2.0, -3.0), own(1.0, 4.0, -1.0)];
    let posterior = DirichletGp::default()
        .posterior(&training, &CLASSIC, &hyperparameters, training.points())
        .unwrap();
    for (class, own) in hyperparameters.iter().enumerate() {
        for point in 0..2 {
            let (target, noise) = if point == class { OWN } else { OTHER };
            let gain = own.outputscale / (own.outputscale + noise);
            let mean = own.mean + gain * (target - own.mean);
            let variance = own.outputscale * (1.0 - gain);
            assert!((posterior.mean()[class][point] - mean).abs() < 1e-14);
            assert!((posterior.variance()[class][point] - variance).abs() < 1e-14);
        }
    }
    assert_eq!(posterior.class(), [0, 1]);
    assert_eq!(
        posterior.predicted_variance(),
        [posterior.variance()[0][0], posterior.variance()[1][1]]
    );
    assert_eq!(posterior.confidence().unwrap(), [1.0, 0.0]);
    assert_eq!((posterior.classes(), posterior.points()), (2, 2));
}

#[test]
fn far_from_all_training_points_the_posterior_is_the_prior() {
    let training = TrainingSet::new(points(&[0.0, 1.0], 1), &[0, 1], 2).unwrap();
    let hyperparameters = [own(0.1, 2.0, -3.0), own(0.1, 4.0, -1.0)];
    let posterior = DirichletGp::default()
        .posterior(&training, &CLASSIC, &hyperparameters, &points(&[1e6], 1))
        .unwrap();
    assert_eq!(posterior.mean(), [[-3.0], [-1.0]]);
    assert_eq!(posterior.variance(), [[2.0], [4.0]]);
    assert_eq!(posterior.confidence().unwrap(), [1.0]);
}

#[test]
fn no_test_points_give_an_empty_posterior() {
    let training = TrainingSet::new(points(&[0.0, 1.0], 1), &[0, 1], 2).unwrap();
    let posterior = DirichletGp::default()
        .posterior(
            &training,
            &CLASSIC,
            &[own(1.0, 1.0, 0.0); 2],
            &points(&[], 1),
        )
        .unwrap();
    assert_eq!((posterior.classes(), posterior.points()), (2, 0));
    assert_eq!(posterior.clamped_share(), 0.0);
    assert!(posterior.class().is_empty());
    assert!(posterior.probabilities().is_empty());
    assert!(posterior.confidence().unwrap().is_empty());
}

#[test]
fn equal_latents_choose_the_first_class_and_probability_one_half() {
    let training = TrainingSet::new(points(&[0.0, 1.0], 1), &[0, 1], 2).unwrap();
    let posterior = DirichletGp::default()
        .posterior(
            &training,
            &CLASSIC,
            &[own(0.5, 3.0, -2.0); 2],
            &points(&[1e6], 1),
        )
        .unwrap();
    assert_eq!(posterior.class(), [0]);
    for probability in posterior.probabilities() {
        assert!((probability - 0.5).abs() < 1e-15);
    }
}

#[test]
fn duplicates_with_contradicting_labels_share_the_place_evenly() {
    let training = TrainingSet::new(points(&[0.3; 40], 1), &[0, 1].repeat(20), 2).unwrap();
    let gp = DirichletGp::default();
    let fits = gp.fit(&training, &CLASSIC, &FitConfig::default()).unwrap();
    let hyperparameters: Vec<_> = fits.iter().map(|fit| fit.hyperparameters).collect();
    let posterior = gp
        .posterior(&training, &CLASSIC, &hyperparameters, &points(&[0.3], 1))
        .unwrap();
    assert_eq!(posterior.jitter(), 0.0);
    for probability in posterior.probabilities() {
        assert!((probability - 0.5).abs() < 1e-9);
    }
}

#[test]
fn gradient_is_the_derivative_of_the_likelihood() {
    let rows: Vec<f64> = (0..60).map(|i| f64::from(i * i % 61) / 61.0).collect();
    let labels: Vec<usize> = (0..30).map(|i| i % 3).collect();
    let training = TrainingSet::new(points(&rows, 2), &labels, 3).unwrap();
    let base = [
        own(0.3, 2.0, -3.0),
        own(0.1, 5.0, -1.0),
        own(1.0, 0.5, -6.0),
    ];
    for smoothness in [
        Smoothness::Half,
        Smoothness::ThreeHalves,
        Smoothness::FiveHalves,
    ] {
        let gp = DirichletGp {
            smoothness,
            ..DirichletGp::default()
        };
        let at = |change: [f64; 3]| {
            let moved = base.map(|h| {
                own(
                    h.lengthscale + change[0],
                    h.outputscale + change[1],
                    h.mean + change[2],
                )
            });
            gp.likelihood(&training, &CLASSIC, &moved).unwrap()
        };
        let here = at([0.0; 3]);
        let step = 1e-5;
        for axis in 0..3 {
            let mut change = [0.0; 3];
            change[axis] = step;
            let (up, down) = (at(change), at(change.map(|c| -c)));
            for class in 0..3 {
                let difference = (up[class].per_datum - down[class].per_datum) / (2.0 * step);
                let gradient = here[class].gradient;
                let gradient = [gradient.lengthscale, gradient.outputscale, gradient.mean][axis];
                assert!(
                    (gradient - difference).abs() < 1e-7 * (1.0 + gradient.abs()),
                    "{smoothness:?} class {class} axis {axis}: {gradient} {difference}"
                );
            }
        }
    }
}

/// Two slabs along x with a gap, on a grid: `count`^2 points.
fn slabs(count: usize, size: f64) -> TrainingSet {
    let (mut rows, mut labels) = (Vec::new(), Vec::new());
    for i in 0..count {
        for j in 0..count {
            let (x, y) = (i as f64 / count as f64, j as f64 / count as f64);
            rows.extend([size * x, size * y]);
            labels.push(usize::from(x >= 0.5));
        }
    }
    TrainingSet::new(points(&rows, 2), &labels, 2).unwrap()
}

#[test]
fn a_fit_separates_two_slabs_whatever_their_size() {
    let gp = DirichletGp::default();
    let mut likelihoods = Vec::new();
    for size in [1e-6, 0.1, 1.0, 1e6] {
        let training = slabs(10, size);
        let fits = gp.fit(&training, &CLASSIC, &FitConfig::default()).unwrap();
        assert!(fits.iter().all(|fit| fit.converged), "{fits:?}");
        let hyperparameters: Vec<_> = fits.iter().map(|fit| fit.hyperparameters).collect();
        let posterior = gp
            .posterior(&training, &CLASSIC, &hyperparameters, training.points())
            .unwrap();
        assert_eq!(posterior.class(), training.labels());
        likelihoods.push(fits[0].per_datum);
    }
    // The search knows no unit of length.
    for likelihood in &likelihoods {
        assert!(
            (likelihood - likelihoods[2]).abs() < 1e-6,
            "{likelihoods:?}"
        );
    }
}

#[test]
fn a_fit_reports_its_likelihood_and_a_mean_without_gradient() {
    let training = slabs(8, 0.1);
    let gp = DirichletGp::default();
    let fits = gp.fit(&training, &CLASSIC, &FitConfig::default()).unwrap();
    let hyperparameters: Vec<_> = fits.iter().map(|fit| fit.hyperparameters).collect();
    let likelihoods = gp
        .likelihood(&training, &CLASSIC, &hyperparameters)
        .unwrap();
    for (fit, likelihood) in fits.iter().zip(likelihoods) {
        assert!((fit.per_datum - likelihood.per_datum).abs() < 1e-12);
        assert!(likelihood.gradient.mean.abs() < 1e-12);
        assert!((likelihood.gradient.outputscale * fit.hyperparameters.outputscale).abs() < 1e-4);
        assert!((likelihood.gradient.lengthscale * fit.hyperparameters.lengthscale).abs() < 1e-4);
    }
}

#[test]
fn fits_from_far_starts_end_at_the_same_likelihood() {
    let training = slabs(8, 1.0);
    let gp = DirichletGp::default();
    let best = gp.fit(&training, &CLASSIC, &FitConfig::default()).unwrap();
    for (lengthscale, outputscale) in [(0.05, 1.0), (0.7, 0.7), (5.0, 100.0)] {
        let config = FitConfig {
            start: Some(Start {
                lengthscale,
                outputscale,
            }),
            ..FitConfig::default()
        };
        for (fit, best) in gp
            .fit(&training, &CLASSIC, &config)
            .unwrap()
            .iter()
            .zip(&best)
        {
            assert!(
                (fit.per_datum - best.per_datum).abs() < 1e-6,
                "{fit:?} {best:?}"
            );
        }
    }
}

#[test]
fn a_fit_on_a_subset_is_the_fit_of_those_points() {
    let training = slabs(8, 1.0);
    let subset: Vec<usize> = (0..64).step_by(2).collect();
    let rows: Vec<f64> = subset
        .iter()
        .flat_map(|i| [(i / 8) as f64 / 8.0, (i % 8) as f64 / 8.0])
        .collect();
    let labels: Vec<usize> = subset.iter().map(|&i| training.labels()[i]).collect();
    let alone = TrainingSet::new(points(&rows, 2), &labels, 2).unwrap();
    let gp = DirichletGp::default();
    let config = FitConfig {
        subset: Some(subset),
        ..FitConfig::default()
    };
    assert_eq!(
        gp.fit(&training, &CLASSIC, &config).unwrap(),
        gp.fit(&alone, &CLASSIC, &FitConfig::default()).unwrap()
    );
}

#[test]
fn without_iterations_the_start_is_returned_with_its_best_mean() {
    let training = slabs(4, 1.0);
    let config = FitConfig {
        start: Some(Start {
            lengthscale: 0.4,
            outputscale: 3.0,
        }),
        max_iterations: 0,
        ..FitConfig::default()
    };
    let gp = DirichletGp::default();
    for fit in gp.fit(&training, &CLASSIC, &config).unwrap() {
        assert!((fit.hyperparameters.lengthscale - 0.4).abs() < 1e-12);
        assert!((fit.hyperparameters.outputscale - 3.0).abs() < 1e-12);
        assert_eq!((fit.evaluations, fit.converged), (1, false));
    }
}

#[test]
fn one_point_of_each_class_is_enough_for_a_fit() {
    let training = TrainingSet::new(points(&[0.0, 1.0], 1), &[0, 1], 2).unwrap();
    let fits = DirichletGp::default()
        .fit(&training, &CLASSIC, &FitConfig::default())
        .unwrap();
    for (class, fit) in fits.iter().enumerate() {
        assert!(fit.converged && !fit.at_bound, "{class}: {fit:?}");
        // Lengthscales within the edge of the range searched.
        assert!((1e-4..=1e2).contains(&fit.hyperparameters.lengthscale));
    }
    // Each class has one own and one other target: the fits are the same.
    let [first, second] = [0, 1].map(|class| fits[class].hyperparameters);
    assert!((first.outputscale - second.outputscale).abs() < 1e-9);
    assert!((first.mean - second.mean).abs() < 1e-9);
}

#[test]
fn a_start_beyond_the_range_is_moved_to_its_edge_and_reported() {
    let training = slabs(4, 1.0);
    let diagonal = 0.75 * 2.0_f64.sqrt();
    for (lengthscale, outputscale) in [(1e9, 1.0), (1e-9, 1.0), (0.3, 1e9), (0.3, 1e-9)] {
        let config = FitConfig {
            start: Some(Start {
                lengthscale,
                outputscale,
            }),
            max_iterations: 0,
            ..FitConfig::default()
        };
        for fit in DirichletGp::default()
            .fit(&training, &CLASSIC, &config)
            .unwrap()
        {
            let own = fit.hyperparameters;
            assert!(fit.at_bound, "{fit:?}");
            assert!((1e-4..=1e2).contains(&(own.lengthscale / diagonal)));
            assert!((1e-4..=1e4).contains(&own.outputscale));
        }
    }
}

#[test]
fn metric_literal_on_the_coordinates_themselves_is_classic() {
    let training = slabs(6, 1.0);
    let hyperparameters = [own(0.3, 5.0, -3.0), own(0.4, 6.0, -2.0)];
    let literal = Covariance::MetricLiteral {
        embeddings: training.points().clone(),
        coordinate_lengthscales: vec![0.3, 0.4],
    };
    let gp = DirichletGp::default();
    let test = points(&[0.1, 0.2, 0.7, 0.4, 2.0, 2.0], 2);
    assert_eq!(
        gp.posterior(&training, &literal, &hyperparameters, &test)
            .unwrap(),
        gp.posterior(&training, &CLASSIC, &hyperparameters, &test)
            .unwrap()
    );
    assert_eq!(
        gp.fit(&training, &literal, &FitConfig::default()).unwrap(),
        gp.fit(&training, &CLASSIC, &FitConfig::default()).unwrap()
    );
}

#[test]
fn metric_literal_clamps_variances_below_zero_and_reports_their_share() {
    // Embeddings far apart make K(X,X) nearly diagonal, while all coordinates are close to the
    // first test point: its variance is s - s^2 sum 1/(s + noise), far below zero. The second test
    // point is far from all of them: its variance is s.
    let training = TrainingSet::new(points(&[0.0; 20], 1), &[0, 1].repeat(10), 2).unwrap();
    let rows: Vec<f64> = (0..20).map(|i| 1e3 * f64::from(i)).collect();
    let covariance = Covariance::MetricLiteral {
        embeddings: points(&rows, 1),
        coordinate_lengthscales: vec![0.5; 2],
    };
    let hyperparameters = [own(1.0, 1.0, -3.0); 2];
    let test = points(&[0.0, 1e3], 1);
    let gp = DirichletGp::default();
    let posterior = gp
        .posterior(&training, &covariance, &hyperparameters, &test)
        .unwrap();
    assert_eq!(posterior.variance(), [[0.0, 1.0], [0.0, 1.0]]);
    assert_eq!(posterior.clamped(), [true, false]);
    assert_eq!(posterior.clamped_share(), 0.5);

    let raw = gp
        .posterior_covariance(&training, &covariance, &hyperparameters, 0, &test)
        .unwrap();
    let expected = 1.0 - 10.0 / (1.0 + OWN.1) - 10.0 / (1.0 + OTHER.1);
    assert!((raw[0] - expected).abs() < 1e-12);
}

#[test]
fn metric_literal_is_equation_1_computed_densely() {
    // Three training points in the plane of embeddings and in space, two test points in space.
    let embeddings = [[0.0, 0.0], [0.6, 0.8], [-1.0, 0.0]];
    let coordinates = [[0.00, 0.00, 0.00], [0.03, 0.00, 0.04], [0.00, 0.12, 0.05]];
    let tests = [[0.01, 0.02, 0.00], [0.05, 0.05, 0.05]];
    let labels = [0, 1, 1];
    let hyperparameters = [own(0.7, 2.0, -3.0), own(1.3, 0.9, -1.0)];
    let coordinate_lengthscales = [0.08, 0.05];

    // Matern 5/2: s (1 + a + a^2 / 3) exp(-a), a = sqrt(5) |p - q| / l.
    let matern = |p: &[f64], q: &[f64], lengthscale: f64, outputscale: f64| {
        let square: f64 = p.iter().zip(q).map(|(p, q)| (p - q).powi(2)).sum();
        let a = (5.0 * square).sqrt() / lengthscale;
        outputscale * (1.0 + a + a * a / 3.0) * (-a).exp()
    };
    // Inverse of a symmetric 3 x 3 matrix by its cofactors.
    let inverse = |m: [[f64; 3]; 3]| {
        let cofactor = |i: usize, j: usize| {
            let ([a, b], [c, d]) = ([(i + 1) % 3, (i + 2) % 3], [(j + 1) % 3, (j + 2) % 3]);
            m[a][c] * m[b][d] - m[a][d] * m[b][c]
        };
        let determinant: f64 = (0..3).map(|j| m[0][j] * cofactor(0, j)).sum();
        [0, 1, 2].map(|i| [0, 1, 2].map(|j| cofactor(j, i) / determinant))
    };

    let space = |rows: &[[f64; 3]]| points(&rows.concat(), 3);
    let training = TrainingSet::new(space(&coordinates), &labels, 2).unwrap();
    let covariance = Covariance::MetricLiteral {
        embeddings: points(&embeddings.concat(), 2),
        coordinate_lengthscales: coordinate_lengthscales.to_vec(),
    };
    let posterior = DirichletGp::default()
        .posterior(&training, &covariance, &hyperparameters, &space(&tests))
        .unwrap();
    for (class, h) in hyperparameters.iter().enumerate() {
        let seen = labels.map(|label| if label == class { OWN } else { OTHER });
        let gram = [0, 1, 2].map(|i| {
            [0, 1, 2].map(|j| {
                let k = matern(&embeddings[i], &embeddings[j], h.lengthscale, h.outputscale);
                k + if i == j { seen[i].1 } else { 0.0 }
            })
        });
        let gram = inverse(gram);
        for (point, test) in tests.iter().enumerate() {
            let lengthscale = coordinate_lengthscales[class];
            let cross = coordinates.map(|x| matern(&x, test, lengthscale, h.outputscale));
            let (mut mean, mut variance) = (h.mean, h.outputscale);
            for i in 0..3 {
                for j in 0..3 {
                    mean += cross[i] * gram[i][j] * (seen[j].0 - h.mean);
                    variance -= cross[i] * gram[i][j] * cross[j];
                }
            }
            assert!(variance > 0.1, "not clamped: {variance}");
            assert!((posterior.mean()[class][point] - mean).abs() < 1e-13);
            assert!((posterior.variance()[class][point] - variance).abs() < 1e-13);
        }
    }
    assert_eq!(posterior.clamped_share(), 0.0);
}

#[test]
fn a_limit_beyond_counting_is_no_problem() {
    let config = FitConfig {
        max_iterations: u64::MAX,
        ..FitConfig::default()
    };
    let training = slabs(4, 1.0);
    let fits = DirichletGp::default().fit(&training, &CLASSIC, &config);
    for fit in fits.unwrap() {
        assert!(fit.converged);
        assert_eq!(fit.jitter, 0.0);
    }
}
