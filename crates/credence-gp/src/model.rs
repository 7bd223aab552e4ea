use rayon::prelude::*;

use crate::{
    Covariance, Fit, FitConfig, GpError, Hyperparameters, Likelihood, Points, Posterior, Prior,
    PriorMeans, Smoothness, Start, Targets, TrainingSet,
    conditioned::Conditioned,
    covariance::check_length,
    factor::{Factor, Storage},
    fit::fit_class,
    kernel::Matern,
    likelihood::{Mean, Whitened, evaluate},
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
        let inputs = covariance.inputs(training).clone();
        let mut chosen = TrainingSet::new(inputs, training.labels(), training.classes())?;
        if let Some(subset) = &config.subset {
            chosen = chosen.select(subset)?;
        }
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

    /// Hyperparameters of the given scales, with the constant mean of each class that maximises
    /// its marginal likelihood.
    ///
    /// # Arguments
    ///
    /// * `scales`: lengthscale and outputscale per class.
    ///
    /// # Errors
    /// Those of [`likelihood`](Self::likelihood).
    pub fn best_means(
        &self,
        training: &TrainingSet,
        covariance: &Covariance,
        scales: &[Start],
    ) -> Result<Vec<Hyperparameters>, GpError> {
        let unknown = |scales: &Start| Hyperparameters {
            lengthscale: scales.lengthscale,
            outputscale: scales.outputscale,
            mean: 0.0,
        };
        let given: Vec<_> = scales.iter().map(unknown).collect();
        check(training, covariance, &given)?;
        let points = covariance.inputs(training);
        let mut storage = Storage::new(points.len());
        let mut best = Vec::with_capacity(given.len());
        for (class, (targets, own)) in self.targets(training)?.iter().zip(&given).enumerate() {
            let kernel = self.kernel(own);
            let whitened = Whitened::new(storage, &kernel, points, targets, Mean::BestFit, class)?;
            let own = Hyperparameters {
                mean: whitened.mean,
                ..*own
            };
            if !own.mean.is_finite() {
                return Err(own.overflow("the mean", class));
            }
            best.push(own);
            storage = whitened.factor.into_storage();
        }
        Ok(best)
    }

    /// What a model that gives class probabilities expects of the latent functions.
    ///
    /// Probability P(c) counts as that share of one observation of the class: the prior mean is the
    /// target of the Dirichlet likelihood at a = `alpha_epsilon` + P(c), so ln a - ln(1/a + 1)/2.
    /// A certain model expects what a label would say.
    ///
    /// # Arguments
    ///
    /// * `probabilities`: one row of `classes` numbers in \[0, 1\] per point, row-major.
    ///
    /// # Errors
    /// Fewer than 2 classes, probabilities that are no whole number of rows or not in \[0, 1\],
    /// `alpha_epsilon` outside its range.
    pub fn prior_means(
        &self,
        probabilities: &[f64],
        classes: usize,
    ) -> Result<PriorMeans, GpError> {
        check_alpha_epsilon(self.alpha_epsilon)?;
        PriorMeans::new(probabilities, classes, self.alpha_epsilon)
    }

    /// Log marginal likelihood ln p(y | X) of each class under prior means at the training points.
    ///
    /// # Errors
    /// Those of [`likelihood`](Self::likelihood), prior means of another number of points or
    /// classes.
    pub fn evidence(
        &self,
        training: &TrainingSet,
        covariance: &Covariance,
        hyperparameters: &[Hyperparameters],
        prior: &PriorMeans,
    ) -> Result<Vec<f64>, GpError> {
        check(training, covariance, hyperparameters)?;
        let points = covariance.inputs(training);
        prior.check("prior means at training points", points, training.classes())?;
        let mut storage = Storage::new(points.len());
        let mut evidence = Vec::with_capacity(training.classes());
        for (class, (mut targets, own)) in self
            .targets(training)?
            .into_iter()
            .zip(hyperparameters)
            .enumerate()
        {
            prior.take_off(class, &mut targets.target);
            let kernel = self.kernel(own);
            let mean = Mean::Given(own.mean);
            let whitened = Whitened::new(storage, &kernel, points, &targets, mean, class)?;
            let log_density = whitened.log_density();
            if !log_density.is_finite() {
                return Err(own.overflow("the evidence", class));
            }
            evidence.push(log_density);
            storage = whitened.factor.into_storage();
        }
        Ok(evidence)
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
        self.posterior_from(training, covariance, hyperparameters, None, test)
    }

    /// Latent posterior at `test` under prior means m: mean m(X*) + K(X*,X) K^-1 (y - m(X)) and the
    /// variance of [`posterior`](Self::posterior), which does not depend on them.
    ///
    /// # Errors
    /// Those of [`posterior`](Self::posterior), prior means of another number of points or classes.
    pub fn posterior_given(
        &self,
        training: &TrainingSet,
        covariance: &Covariance,
        hyperparameters: &[Hyperparameters],
        prior: Prior<'_>,
        test: &Points,
    ) -> Result<Posterior, GpError> {
        let classes = training.classes();
        let at_training = "prior means at training points";
        prior
            .training
            .check(at_training, training.points(), classes)?;
        prior
            .test
            .check("prior means at test points", test, classes)?;
        self.posterior_from(training, covariance, hyperparameters, Some(prior), test)
    }

    fn posterior_from(
        &self,
        training: &TrainingSet,
        covariance: &Covariance,
        hyperparameters: &[Hyperparameters],
        prior: Option<Prior<'_>>,
        test: &Points,
    ) -> Result<Posterior, GpError> {
        check(training, covariance, hyperparameters)?;
        check_test(training, test)?;
        let (mut means, mut variances) = (Vec::new(), Vec::new());
        let mut jitter: f64 = 0.0;
        let mut storage = Storage::new(training.len());
        for (class, (mut targets, own)) in self
            .targets(training)?
            .into_iter()
            .zip(hyperparameters)
            .enumerate()
        {
            if let Some(prior) = prior {
                prior.training.take_off(class, &mut targets.target);
            }
            let points = covariance.inputs(training);
            let conditioned = self.condition(storage, points, &targets, own, class)?;
            let cross = self.cross_kernel(covariance, own, class);
            let correction = conditioned.predict(&cross, training.points(), test);
            let mut mean: Vec<f64> = correction
                .mean
                .iter()
                .map(|value| own.mean + value)
                .collect();
            if let Some(prior) = prior {
                prior.test.add_to(class, &mut mean);
            }
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
