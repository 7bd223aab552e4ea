//! Agreement with the reference implementation, see `fixtures/README.md`.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::{fs::File, path::Path};

use credence_gp::{
    Covariance, DirichletGp, FitConfig, Hyperparameters, Points, Smoothness, TrainingSet,
};
use ndarray::{ArrayD, IxDyn, OwnedRepr};
use ndarray_npy::NpzReader;

const CASES: [(&str, Smoothness, usize); 7] = [
    ("dirichlet_matern05_c2_n300", Smoothness::Half, 2),
    ("dirichlet_matern05_c3_n240", Smoothness::Half, 3),
    ("dirichlet_matern15_c2_n300", Smoothness::ThreeHalves, 2),
    ("dirichlet_matern15_c3_n240", Smoothness::ThreeHalves, 3),
    ("dirichlet_matern25_c2_n300", Smoothness::FiveHalves, 2),
    ("dirichlet_matern25_c3_n240", Smoothness::FiveHalves, 3),
    ("dirichlet_matern25_c7_n350", Smoothness::FiveHalves, 7),
];

struct Case {
    name: &'static str,
    arrays: NpzReader<File>,
    gp: DirichletGp,
    training: TrainingSet,
    test: Points,
}

impl Case {
    fn all() -> impl Iterator<Item = Self> {
        CASES.into_iter().map(|(name, smoothness, classes)| {
            let path = Path::new(env!("CARGO_MANIFEST_DIR"))
                .join("tests/fixtures")
                .join(name)
                .with_extension("npz");
            let mut arrays = NpzReader::new(File::open(path).unwrap()).unwrap();
            let labels: Vec<usize> = arrays
                .by_name::<OwnedRepr<i64>, IxDyn>("label.npy")
                .unwrap()
                .iter()
                .map(|&label| usize::try_from(label).unwrap())
                .collect();
            let mut points = |name: &'static str| {
                let rows: ArrayD<f64> = arrays.by_name(name).unwrap();
                let rows: Vec<f64> = rows.iter().copied().collect();
                Points::from_rows(name, &rows, 3).unwrap()
            };
            let (train, test) = (points("x_train.npy"), points("x_test.npy"));
            Self {
                name,
                arrays,
                gp: DirichletGp {
                    smoothness,
                    ..DirichletGp::default()
                },
                training: TrainingSet::new(train, &labels, classes).unwrap(),
                test,
            }
        })
    }

    fn array(&mut self, name: &str) -> Vec<f64> {
        let array: ArrayD<f64> = self.arrays.by_name(&format!("{name}.npy")).unwrap();
        array.iter().copied().collect()
    }

    fn hyperparameters(&mut self, prefix: &str) -> Vec<Hyperparameters> {
        let lengthscales = self.array(&format!("{prefix}lengthscale"));
        let outputscales = self.array(&format!("{prefix}outputscale"));
        let means = self.array(&format!("{prefix}mean_constant"));
        lengthscales
            .into_iter()
            .zip(outputscales)
            .zip(means)
            .map(|((lengthscale, outputscale), mean)| Hyperparameters {
                lengthscale,
                outputscale,
                mean,
            })
            .collect()
    }

    /// Each value within `tolerance` of the reference, relative to the reference; values below
    /// `floor` times the array's largest are compared with that floor instead.
    fn compare(&mut self, what: &str, ours: &[f64], tolerance: f64, floor: f64) {
        let reference = self.array(what);
        assert_eq!(ours.len(), reference.len());
        let largest = reference.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
        let worst = ours
            .iter()
            .zip(&reference)
            .map(|(ours, theirs)| (ours - theirs).abs() / theirs.abs().max(floor * largest))
            .fold(0.0, f64::max);
        assert!(worst <= tolerance, "{} {what}: {worst:e}", self.name);
    }
}

#[test]
fn targets_and_noise() {
    for mut case in Case::all() {
        let targets = case.gp.targets(&case.training).unwrap();
        let all: Vec<f64> = targets.iter().flat_map(|t| t.target.clone()).collect();
        case.compare("transformed_target", &all, 1e-14, 0.0);
        let all: Vec<f64> = targets.iter().flat_map(|t| t.noise.clone()).collect();
        case.compare("noise", &all, 1e-14, 0.0);
    }
}

#[test]
fn likelihood_and_gradient() {
    for mut case in Case::all() {
        let hyperparameters = case.hyperparameters("");
        let likelihoods = case
            .gp
            .likelihood(&case.training, &Covariance::Classic, &hyperparameters)
            .unwrap();
        let values: Vec<f64> = likelihoods.iter().map(|l| l.per_datum).collect();
        case.compare("mll_per_datum", &values, 1e-10, 0.0);
        let values: Vec<f64> = likelihoods.iter().map(|l| l.gradient.lengthscale).collect();
        case.compare("dmll_dlengthscale", &values, 1e-10, 0.0);
        let values: Vec<f64> = likelihoods.iter().map(|l| l.gradient.outputscale).collect();
        case.compare("dmll_doutputscale", &values, 1e-10, 0.0);
        let values: Vec<f64> = likelihoods.iter().map(|l| l.gradient.mean).collect();
        case.compare("dmll_dmean", &values, 1e-10, 0.0);
    }
}

#[test]
fn posterior_mean_and_covariance() {
    for mut case in Case::all() {
        let hyperparameters = case.hyperparameters("");
        let classic = Covariance::Classic;
        let posterior = case
            .gp
            .posterior(&case.training, &classic, &hyperparameters, &case.test)
            .unwrap();
        case.compare("posterior_mean", &posterior.mean().concat(), 1e-10, 0.0);
        assert_eq!(posterior.clamped_share(), 0.0);
        assert_eq!(posterior.jitter(), 0.0);

        let m = case.test.len();
        let mut covariances = Vec::new();
        for class in 0..case.training.classes() {
            let covariance = case
                .gp
                .posterior_covariance(
                    &case.training,
                    &classic,
                    &hyperparameters,
                    class,
                    &case.test,
                )
                .unwrap();
            for (point, variance) in posterior.variance()[class].iter().enumerate() {
                let diagonal = covariance[point * m + point];
                assert!((variance - diagonal).abs() <= 1e-12 * diagonal);
            }
            covariances.extend(covariance);
        }
        // Entries between far points cancel to almost nothing, in the reference as here.
        case.compare("posterior_cov", &covariances, 1e-8, 1e-6);
    }
}

#[test]
fn posterior_at_the_reference_fit() {
    for mut case in Case::all() {
        let hyperparameters = case.hyperparameters("adam200_");
        let posterior = case
            .gp
            .posterior(
                &case.training,
                &Covariance::Classic,
                &hyperparameters,
                &case.test,
            )
            .unwrap();
        case.compare(
            "adam200_posterior_mean",
            &posterior.mean().concat(),
            1e-8,
            0.0,
        );
        case.compare(
            "adam200_posterior_var",
            &posterior.variance().concat(),
            1e-8,
            0.0,
        );
    }
}

#[test]
fn fit_is_at_least_as_likely_as_the_reference_for_every_class() {
    for mut case in Case::all() {
        let theirs = case.hyperparameters("adam200_");
        let classic = Covariance::Classic;
        let theirs = case
            .gp
            .likelihood(&case.training, &classic, &theirs)
            .unwrap();
        let fits = case
            .gp
            .fit(&case.training, &classic, &FitConfig::default())
            .unwrap();
        for (class, (fit, theirs)) in fits.iter().zip(&theirs).enumerate() {
            assert!(fit.per_datum >= theirs.per_datum, "{} {class}", case.name);
            assert!(fit.converged && !fit.at_bound, "{} {fit:?}", case.name);
        }
    }
}
