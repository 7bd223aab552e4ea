//! The query network corrected by the scene: a Gaussian process with the network as prior mean.

#[cfg(test)]
mod tests;

use credence_embed::QueryEmbedder;
use credence_gp::{
    Covariance, Fit, GpError, Hyperparameters, Points, Posterior, Prior, TrainingSet as GpSet,
};

use super::{
    Answer, Question, Stopwatch, classic,
    gaussian::{Setting, answer_of, fitted_hyperparameters, gp_points},
    most_likely,
    network::{Belief, Embedded},
};
use crate::{Config, KernelInput, MetricConfig, PipelineError};

pub(super) fn answer(
    question: &Question<'_>,
    config: &Config,
    embedder: &QueryEmbedder,
    watch: &mut Stopwatch,
) -> Result<Answer, PipelineError> {
    let metric = &config.metric;
    let belief = watch.time("embed", || {
        Belief::new(question, metric, metric.parts, embedder)
    })?;
    correct(question, config, belief, watch)
}

/// Corrects what the network says by the scene's training points.
pub(super) fn correct(
    question: &Question<'_>,
    config: &Config,
    belief: Belief,
    watch: &mut Stopwatch,
) -> Result<Answer, PipelineError> {
    let metric = &config.metric;
    let (setting, gate) = watch.time("fit", || {
        let setting = Setting::new(question, &config.gp)?;
        let gate = metric
            .gate
            .then(|| Gate::weigh(question, &setting, &belief, config))
            .transpose()?;
        Ok::<_, PipelineError>((setting, gate))
    })?;
    let mut answer = watch.time("posterior", || {
        let posterior = posterior(question, &setting, &belief, metric)?;
        let fits = gate
            .as_ref()
            .map_or_else(Vec::new, |gate| gate.fits.clone());
        let mut answer = answer_of(
            question,
            &posterior,
            hyperparameters(question, metric),
            fits,
        )?;
        if let Some(gate) = &gate {
            gate.mix(question, &setting, &mut answer)?;
        }
        answer.class = most_likely(&answer.probabilities, question.classes.len());
        Ok::<_, PipelineError>(answer)
    })?;
    answer.network = Some(belief.view(question));
    Ok(answer)
}

/// One set for all classes: the network has taken their differences into the prior means.
fn hyperparameters(question: &Question<'_>, config: &MetricConfig) -> Vec<Hyperparameters> {
    let shared = Hyperparameters {
        lengthscale: config.lengthscale_m,
        outputscale: config.outputscale,
        mean: 0.0,
    };
    vec![shared; question.classes.len()]
}

/// What the kernel compares: coordinates, with the embeddings beside them if the configuration
/// says so.
fn inputs(
    coordinates: Points,
    embedded: &Embedded,
    config: &MetricConfig,
) -> Result<Points, GpError> {
    match config.kernel_input {
        KernelInput::Xyz => Ok(coordinates),
        KernelInput::XyzEmbedding => {
            let rows = embedded.embeddings.as_flattened();
            let embeddings = Points::from_rows("embeddings", rows, 3)?;
            coordinates.joined(
                &embeddings,
                config.lengthscale_m / config.embedding_lengthscale,
            )
        }
    }
}

fn posterior(
    question: &Question<'_>,
    setting: &Setting,
    belief: &Belief,
    config: &MetricConfig,
) -> Result<Posterior, PipelineError> {
    let classes = question.classes.len();
    let test = gp_points("test points", question.test)?;
    let test = inputs(test, &belief.test, config)?;
    let prior = Prior {
        training: &setting
            .gp
            .prior_means(&belief.training.probabilities, classes)?,
        test: &setting
            .gp
            .prior_means(&belief.test.probabilities, classes)?,
    };
    Ok(setting.gp.posterior_given(
        &training(question, setting, belief, config)?,
        &Covariance::Classic,
        &hyperparameters(question, config),
        prior,
        &test,
    )?)
}

fn training(
    question: &Question<'_>,
    setting: &Setting,
    belief: &Belief,
    config: &MetricConfig,
) -> Result<GpSet, GpError> {
    let points = inputs(setting.set.points().clone(), &belief.training, config)?;
    GpSet::new(points, &question.labels, question.classes.len())
}

/// How far the scene's evidence speaks for the network against coordinates alone.
struct Gate {
    /// pi = sigmoid((ln p(y | Metric) - ln p(y | Classic)) / temperature).
    weight: f64,
    /// Of the classic process.
    fits: Vec<Fit>,
}

impl Gate {
    /// Both evidences are of the same part of the training points, that which the classic process
    /// is fitted on.
    fn weigh(
        question: &Question<'_>,
        setting: &Setting,
        belief: &Belief,
        config: &Config,
    ) -> Result<Self, PipelineError> {
        let fits = setting.fit(&Covariance::Classic, &config.gp)?;
        let subset = &setting.fit_points;
        let classic: f64 = fits
            .iter()
            .map(|fit| fit.per_datum * subset.len() as f64)
            .sum();
        let metric: f64 = evidence(question, setting, belief, &config.metric)?;
        let ratio = (metric - classic) / config.metric.gate_temperature;
        Ok(Self {
            weight: 1.0 / (1.0 + (-ratio).exp()),
            fits,
        })
    }

    /// Mixes the classic process's probabilities in. The likelier of the two is the process whose
    /// variances and hyperparameters are told.
    fn mix(
        &self,
        question: &Question<'_>,
        setting: &Setting,
        answer: &mut Answer,
    ) -> Result<(), PipelineError> {
        answer.gate = Some(self.weight);
        // Evidences as a rule differ so much that one of the two has it all.
        if self.weight < 1.0 {
            let hyperparameters = fitted_hyperparameters(&self.fits);
            let classic = classic::posterior(question, setting, &hyperparameters)?;
            for (own, other) in answer.probabilities.iter_mut().zip(classic.probabilities()) {
                *own = self.weight * *own + (1.0 - self.weight) * other;
            }
            if self.weight < 0.5 {
                let fits = self.fits.clone();
                answer.process = answer_of(question, &classic, hyperparameters, fits)?.process;
            }
        }
        Ok(())
    }
}

/// ln p(y | Metric) of the points that a fit sees.
fn evidence(
    question: &Question<'_>,
    setting: &Setting,
    belief: &Belief,
    config: &MetricConfig,
) -> Result<f64, PipelineError> {
    let classes = question.classes.len();
    let subset = training(question, setting, belief, config)?.select(&setting.fit_points)?;
    let probabilities: Vec<f64> = setting
        .fit_points
        .iter()
        .flat_map(|point| &belief.training.probabilities[point * classes..(point + 1) * classes])
        .copied()
        .collect();
    let prior = setting.gp.prior_means(&probabilities, classes)?;
    let of_classes = setting.gp.evidence(
        &subset,
        &Covariance::Classic,
        &hyperparameters(question, config),
        &prior,
    )?;
    Ok(of_classes.iter().sum())
}
