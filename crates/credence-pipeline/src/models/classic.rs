//! Processes on coordinates alone.

use credence_gp::{Covariance, Hyperparameters, Posterior, Start};

use super::{
    Answer, Question, Stopwatch,
    gaussian::{Setting, answer_of, fitted_hyperparameters, gp_points},
};
use crate::{GpConfig, PipelineError};

/// Hyperparameters that maximise the marginal likelihood of this scene's training points.
pub(super) fn fitted(
    question: &Question<'_>,
    config: &GpConfig,
    watch: &mut Stopwatch,
) -> Result<Answer, PipelineError> {
    let (setting, fits) = watch.time("fit", || {
        let setting = Setting::new(question, config)?;
        let fits = setting.fit(&Covariance::Classic, config)?;
        Ok::<_, PipelineError>((setting, fits))
    })?;
    let hyperparameters = fitted_hyperparameters(&fits);
    watch.time("posterior", || {
        let posterior = posterior(question, &setting, &hyperparameters)?;
        answer_of(question, &posterior, hyperparameters, fits)
    })
}

/// Scales from the configuration; the constant means are those that this scene's points favour.
pub(super) fn tuned(
    question: &Question<'_>,
    config: &GpConfig,
    watch: &mut Stopwatch,
) -> Result<Answer, PipelineError> {
    let scales = Start {
        lengthscale: config.classic_tuned.lengthscale_m,
        outputscale: config.classic_tuned.outputscale,
    };
    let (setting, hyperparameters) = watch.time("fit", || {
        let setting = Setting::new(question, config)?;
        let subset = setting.set.select(&setting.fit_points)?;
        let scales = vec![scales; question.classes.len()];
        let best = setting
            .gp
            .best_means(&subset, &Covariance::Classic, &scales)?;
        Ok::<_, PipelineError>((setting, best))
    })?;
    watch.time("posterior", || {
        let posterior = posterior(question, &setting, &hyperparameters)?;
        answer_of(question, &posterior, hyperparameters, Vec::new())
    })
}

pub(super) fn posterior(
    question: &Question<'_>,
    setting: &Setting,
    hyperparameters: &[Hyperparameters],
) -> Result<Posterior, PipelineError> {
    let test = gp_points("test points", question.test)?;
    Ok(setting
        .gp
        .posterior(&setting.set, &Covariance::Classic, hyperparameters, &test)?)
}
