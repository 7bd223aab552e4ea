//! The classifiers: each answers the same question from the same training and test points.

mod classic;
mod gaussian;
mod literal;
mod metric;
mod nearest;
mod network;
#[cfg(test)]
mod tests;

use std::time::{Duration, Instant};

use credence_gp::{Fit, GpError, Hyperparameters};
use credence_types::{Category, FREE_CLASS, Point};
pub(crate) use network::embed_from;

use crate::{Config, ModelChoice, PipelineError, TrainingSet, embedders::Embedders};

/// Which class each test point has, to be answered from a training set.
#[derive(Debug)]
pub(crate) struct Question<'a> {
    pub(crate) training: &'a TrainingSet,
    pub(crate) test: &'a [Point],
    /// Classes to choose from, rising.
    pub(crate) classes: Vec<u8>,
    /// Position of each training point's class in `classes`.
    pub(crate) labels: Vec<usize>,
    /// Position in `classes` of the category that is asked about.
    pub(crate) asked: usize,
    pub(crate) category: Category,
}

impl<'a> Question<'a> {
    /// Asks `model` about `category`. A network or a distance can say that a point is free even
    /// where no training point is; a process on its own can choose from the training set's classes
    /// only.
    pub(crate) fn new(
        training: &'a TrainingSet,
        test: &'a [Point],
        category: Category,
        model: ModelChoice,
    ) -> Result<Self, PipelineError> {
        let mut classes = training.classes().to_vec();
        match model {
            ModelChoice::Classic | ModelChoice::ClassicTuned | ModelChoice::MetricLiteral => {}
            ModelChoice::Metric | ModelChoice::Network | ModelChoice::Nearest => {
                classes.push(FREE_CLASS);
            }
        }
        classes.sort_unstable();
        classes.dedup();
        if classes.len() < 2 {
            let classes = classes.len();
            return Err(GpError::TooFewClasses { classes }.into());
        }
        let place = |class: &u8| classes.partition_point(|c| c < class);
        let asked = classes
            .binary_search(&category.class())
            .map_err(|_place| PipelineError::CategoryNotTrained { category })?;
        Ok(Self {
            training,
            test,
            labels: training.classes().iter().map(place).collect(),
            classes,
            asked,
            category,
        })
    }
}

/// What a model says of the test points.
#[derive(Debug, Default)]
pub(crate) struct Answer {
    /// Position of each test point's class among the question's classes.
    pub(crate) class: Vec<usize>,
    /// Probability of each class per test point, row-major.
    pub(crate) probabilities: Vec<f64>,
    /// What a Gaussian process adds.
    pub(crate) process: Option<Process>,
    /// What the query network says.
    pub(crate) network: Option<NetworkView>,
    /// Weight of the model against its fallback, if it has one.
    pub(crate) gate: Option<f64>,
}

/// What a Gaussian process says beside probabilities.
#[derive(Debug)]
pub(crate) struct Process {
    /// Variance of the predicted class's latent function per test point.
    pub(crate) variance: Vec<f64>,
    /// The seed's score per test point.
    pub(crate) score: Vec<f64>,
    /// Variance per test point of the latent difference between the category asked about and free
    /// space.
    pub(crate) difference_variance: Vec<f64>,
    /// Whether the variance was below zero per test point.
    pub(crate) clamped: Vec<bool>,
    pub(crate) clamped_share: f64,
    pub(crate) jitter: f64,
    /// Per class.
    pub(crate) hyperparameters: Vec<Hyperparameters>,
    /// The searches for hyperparameters that were made.
    pub(crate) fits: Vec<Fit>,
}

/// What the query network says of the test points, before a process corrects it.
#[derive(Debug, Clone, PartialEq)]
pub struct NetworkView {
    /// Probability of the object's category per test point.
    pub probability: Vec<f64>,
    /// Embedding per test point: sigmoid(logit) times the unit direction, in the unit ball.
    pub embedding: Vec<[f64; 3]>,
    /// Mean negative log likelihood of the scene's own training points under the network: near 0
    /// where it explains them, above ln 2 where a coin would do better. High values say that the
    /// object or the frame is not of the kind that the network was trained on.
    pub ood: f64,
}

/// Notes how long stages take.
#[derive(Debug, Default)]
pub(crate) struct Stopwatch(pub(crate) Vec<(&'static str, Duration)>);

impl Stopwatch {
    pub(crate) fn time<T>(&mut self, stage: &'static str, work: impl FnOnce() -> T) -> T {
        let start = Instant::now();
        let result = work();
        self.0.push((stage, start.elapsed()));
        result
    }
}

/// Has `model` answer.
pub(crate) fn answer(
    model: ModelChoice,
    question: &Question<'_>,
    config: &Config,
    embedders: &mut Embedders,
    watch: &mut Stopwatch,
) -> Result<Answer, PipelineError> {
    match model {
        ModelChoice::Classic => classic::fitted(question, &config.gp, watch),
        ModelChoice::ClassicTuned => classic::tuned(question, &config.gp, watch),
        ModelChoice::MetricLiteral => literal::answer(question, config, embedders.metric()?, watch),
        ModelChoice::Metric => metric::answer(question, config, embedders.query()?, watch),
        ModelChoice::Network => network::answer(question, config, embedders.query()?, watch),
        ModelChoice::Nearest => Ok(watch.time("posterior", || nearest::answer(question))),
    }
}

/// Position of the largest number in each row, the first of equals.
fn most_likely(probabilities: &[f64], classes: usize) -> Vec<usize> {
    let largest =
        |row: &[f64]| (1..classes).fold(0, |best, c| if row[c] > row[best] { c } else { best });
    probabilities.chunks_exact(classes).map(largest).collect()
}
