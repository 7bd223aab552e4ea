//! The seed paper's Eq. 1 as written.

use credence_embed::MetricEmbedder;
use credence_gp::{Covariance, Points};
use credence_types::FREE_CLASS;

use super::{
    Answer, Question, Stopwatch,
    gaussian::{Setting, answer_of, fitted_hyperparameters, gp_points},
};
use crate::{Config, PipelineError};

/// K(X,X) on embeddings, with free space at the zero vector, and hyperparameters by the marginal
/// likelihood of those; K(X,X*) and K(X*,X*) on coordinates, whose lengthscale is a setting of its
/// own, as embeddings say nothing about metres.
pub(super) fn answer(
    question: &Question<'_>,
    config: &Config,
    embedder: &MetricEmbedder,
    watch: &mut Stopwatch,
) -> Result<Answer, PipelineError> {
    let training = question.training;
    let embeddings = watch.time("embed", || embedder.embed(training.points_world()))?;
    let rows: Vec<f64> = embeddings
        .into_iter()
        .zip(training.classes())
        .flat_map(|(direction, class)| match *class {
            FREE_CLASS => [0.0; 3],
            _ => direction,
        })
        .collect();
    let covariance = Covariance::MetricLiteral {
        embeddings: Points::from_rows("embeddings", &rows, 3)?,
        coordinate_lengthscales: vec![config.metric.literal_lengthscale_m; question.classes.len()],
    };
    let (setting, fits) = watch.time("fit", || {
        let setting = Setting::new(question, &config.gp)?;
        let fits = setting.fit(&covariance, &config.gp)?;
        Ok::<_, PipelineError>((setting, fits))
    })?;
    let hyperparameters = fitted_hyperparameters(&fits);
    watch.time("posterior", || {
        let test = gp_points("test points", question.test)?;
        let posterior = setting
            .gp
            .posterior(&setting.set, &covariance, &hyperparameters, &test)?;
        answer_of(question, &posterior, hyperparameters, fits)
    })
}
