use rayon::prelude::*;

use crate::{
    Covariance, Fit, FitConfig, GpError, Hyperparameters, Likelihood, Points, Posterior,
    Smoothness, Targets, TrainingSet,
    conditioned::Conditioned,
    covariance::check_length,
    factor::{Factor, Storage},
    fit::fit_class,
    kernel::Matern,
    likelihood::{Mean, evaluate},
    targets::check_alpha_epsilon,
};

/// Exact Dirichlet Gaussian-process classification: one independent regression per class.
///
/// With N training points, C classes and M test points, [`posterior`](Self::posterior) takes
/// C (N^3 / 3 + N^2 M) multiplications and [`likelihood`](Self::likelihood) C N^3. One triangle of
/// an N x N matrix is held at a time (4 N^2 bytes), except in [`fit`](Self::fit), which holds one
/// per class. All run on the current rayon pool and give the same bits whatever its size.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DirichletGp {
    /// Smoothness of the Matérn kernel, by default 5/2.
    pub smoothness: Smoothness,
    /// Concentration of every class a point does not have, by default 0.01; in \[1e-12, 1\].
    pub alpha_epsilon: f64,
}

impl Default for DirichletGp {
    fn default() -> Self {
        Self {
            smoothness: Smoothness::default(),
            alpha_epsilon: 0.01,
        }
    }
}

impl DirichletGp {
    /// Regression targets and noise of each class.
    ///
    /// # Errors
    /// `alpha_epsilon` outside its range.
    pub fn targets(&self, training: &TrainingSet) -> Result<Vec<Targets>, GpError> {
        check_alpha_epsilon(self.alpha_epsilon)?;
        Ok((0..training.classes())
            .map(|class| Targets::of_class(training.labels(), class, self.alpha_epsilon))
            .collect())
    }

    /// Log marginal likelihood of each class and its gradient.
    ///
    /// # Errors
    /// A setting or hyperparameter outside its range, another number of them than classes, a
    /// covariance that cannot be factorised, arithmetic that overflows.
    pub fn likelihood(
        &self,
        training: &TrainingSet,
        covariance: &Covariance,
        hyperparameters: &[Hyperparameters],
    ) -> Result<Vec<Likelihood>, GpError> {
        check(training, covariance, hyperparameters)?;
        let points = covariance.inputs(training);
        let mut storage = Storage::new(points.len());
        let mut likelihoods = Vec::with_capacity(training.classes());
        for (class, (targets, own)) in self
            .targets(training)?
            .iter()
            .zip(hyperparameters)
            .enumerate()
        {
            let kernel = self.kernel(own);
            let mean = Mean::Given(own.mean);
            let evaluation = evaluate(storage, &kernel, points, targets, mean, class)?;
            let Likelihood {
                per_datum,
                gradient,
            } = evaluation.likelihood;
            let values = [
                per_datum,
                gradient.lengthscale,
                gradient.outputscale,
                gradient.mean,
            ];
            if !values.iter().all(|value| value.is_finite()) {
                return Err(own.overflow("the likelihood", class));
            }
            likelihoods.push(evaluation.likelihood);
            storage = evaluation.storage;
        }
        Ok(likelihoods)
    }

    /// Hyperparameters of each class that maximise its marginal likelihood.
    ///
    /// With [`Covariance::MetricLiteral`] the likelihood is that of the embeddings, as K(X,X) is.
    ///
    /// # Errors
    /// A setting outside its range, a subset with an index that does not exist or without a class,
    /// a covariance that cannot be factorised, arithmetic that overflows.
    pub fn fit(
        &self,
        training: &TrainingSet,
        covariance: &Covariance,
        config: &FitConfig,
    ) -> Result<Vec<Fit>, GpError> {
        covariance.check(training)?;
        config.check()?;
        let inputs = covariance.inputs(training);
        let chosen = match &config.subset {
            None => TrainingSet::new(inputs.clone(), training.labels(), training.classes())?,
            Some(subset) => {
                let labels = subset
                    .iter()
                    .map(|&index| {
                        training
                            .labels()
                            .get(index)
                            .copied()
                            .ok_or(GpError::Subset {
                                index,
                                points: training.len(),
                            })
                    })
                    .collect::<Result<Vec<_>, _>>()?;
                TrainingSet::new(inputs.select(subset), &labels, training.classes())?
            }
        };
        let targets = self.targets(&chosen)?;
        let fits: Vec<_> = targets
            .par_iter()
            .enumerate()
            .map(|(class, targets)| {
                fit_class(self.smoothness, chosen.points(), targets, class, config)
            })
            .collect();
        fits.into_iter().collect()
    }

    /// Latent posterior at `test`, without observation noise.
    ///
    /// # Errors
    /// Those of [`likelihood`](Self::likelihood), and test points of another dimension than the
    /// training points.
    pub fn posterior(
        &self,
        training: &TrainingSet,
        covariance: &Covariance,
        hyperparameters: &[Hyperparameters],
        test: &Points,
    ) -> Result<Posterior, GpError> {
        check(training, covariance, hyperparameters)?;
        check_test(training, test)?;
        let (mut means, mut variances) = (Vec::new(), Vec::new());
        let mut jitter: f64 = 0.0;
        let mut storage = Storage::new(training.len());
        for (class, (targets, own)) in self
            .targets(training)?
            .iter()
            .zip(hyperparameters)
            .enumerate()
        {
            let points = covariance.inputs(training);
            let conditioned = self.condition(storage, points, targets, own, class)?;
            let cross = self.cross_kernel(covariance, own, class);
            let correction = conditioned.predict(&cross, training.points(), test);
            let mean: Vec<f64> = correction
                .mean
                .iter()
                .map(|value| own.mean + value)
                .collect();
            if !mean
                .iter()
                .chain(&correction.variance)
                .all(|v| v.is_finite())
            {
                return Err(own.overflow("the posterior", class));
            }
            means.push(mean);
            variances.push(correction.variance);
            let factor = conditioned.into_factor();
            jitter = jitter.max(factor.jitter());
            storage = factor.into_storage();
        }
        Ok(Posterior::new(means, variances, jitter))
    }

    /// Latent posterior covariance between all test points for one class, M x M, as computed.
    ///
    /// # Errors
    /// Those of [`posterior`](Self::posterior), and a class that does not exist.
    pub fn posterior_covariance(
        &self,
        training: &TrainingSet,
        covariance: &Covariance,
        hyperparameters: &[Hyperparameters],
        class: usize,
        test: &Points,
    ) -> Result<Vec<f64>, GpError> {
        check(training, covariance, hyperparameters)?;
        check_test(training, test)?;
        let Some(own) = hyperparameters.get(class) else {
            return Err(GpError::NoSuchClass {
                class,
                classes: training.classes(),
            });
        };
        check_alpha_epsilon(self.alpha_epsilon)?;
        let targets = Targets::of_class(training.labels(), class, self.alpha_epsilon);
        let storage = Storage::new(training.len());
        let points = covariance.inputs(training);
        let conditioned = self.condition(storage, points, &targets, own, class)?;
        let cross = self.cross_kernel(covariance, own, class);
        Ok(conditioned.covariance(&cross, training.points(), test))
    }

    fn kernel(&self, own: &Hyperparameters) -> Matern {
        Matern {
            smoothness: self.smoothness,
            lengthscale: own.lengthscale,
            outputscale: own.outputscale,
        }
    }

    fn cross_kernel(&self, covariance: &Covariance, own: &Hyperparameters, class: usize) -> Matern {
        Matern {
            lengthscale: covariance.cross_lengthscale(class, own.lengthscale),
            ..self.kernel(own)
        }
    }

    fn condition(
        &self,
        storage: Storage,
        points: &Points,
        targets: &Targets,
        own: &Hyperparameters,
        class: usize,
    ) -> Result<Conditioned, GpError> {
        let factor = Factor::new(storage, &self.kernel(own), points, &targets.noise, class)?;
        let residuals = targets.target.iter().map(|y| y - own.mean).collect();
        Ok(Conditioned::new(factor, residuals))
    }
}

fn check(
    training: &TrainingSet,
    covariance: &Covariance,
    hyperparameters: &[Hyperparameters],
) -> Result<(), GpError> {
    covariance.check(training)?;
    check_length(
        "hyperparameters",
        hyperparameters.len(),
        training.classes(),
        "class",
    )?;
    hyperparameters.iter().try_for_each(Hyperparameters::check)
}

fn check_test(training: &TrainingSet, test: &Points) -> Result<(), GpError> {
    if test.dim() == training.points().dim() {
        Ok(())
    } else {
        Err(GpError::Dimension {
            name: "test points",
            found: test.dim(),
            other: "training points",
            expected: training.points().dim(),
        })
    }
}
