//! What the models that are Gaussian processes share.

use credence_gp::{
    Covariance, DirichletGp, Fit, FitConfig, Hyperparameters, Points, Posterior, Smoothness,
    TrainingSet as GpSet,
};
use credence_types::{FREE_CLASS, Point, stream};
use rand::seq::SliceRandom as _;

use super::{Answer, Process, Question};
use crate::{GpConfig, PipelineError, SmoothnessChoice};

/// Seed of the choice of points to fit on: fixed, so that a training set alone decides a fit.
const FIT_SEED: u64 = 0;

impl From<SmoothnessChoice> for Smoothness {
    fn from(choice: SmoothnessChoice) -> Self {
        match choice {
            SmoothnessChoice::Half => Self::Half,
            SmoothnessChoice::ThreeHalves => Self::ThreeHalves,
            SmoothnessChoice::FiveHalves => Self::FiveHalves,
        }
    }
}

/// The process and its labelled training points, coordinates only.
#[derive(Debug)]
pub(super) struct Setting {
    pub(super) gp: DirichletGp,
    pub(super) set: GpSet,
    /// Positions of the training points that a fit sees.
    pub(super) fit_points: Vec<usize>,
}

impl Setting {
    pub(super) fn new(question: &Question<'_>, config: &GpConfig) -> Result<Self, PipelineError> {
        let classes = question.classes.len();
        let points = gp_points("training points", question.training.points_world())?;
        Ok(Self {
            gp: DirichletGp {
                smoothness: config.smoothness.into(),
                ..DirichletGp::default()
            },
            set: GpSet::new(points, &question.labels, classes)?,
            fit_points: stratified(&question.labels, classes, config.fit_points),
        })
    }

    /// Hyperparameters by marginal likelihood.
    pub(super) fn fit(
        &self,
        covariance: &Covariance,
        config: &GpConfig,
    ) -> Result<Vec<Fit>, PipelineError> {
        let fit = FitConfig {
            subset: Some(self.fit_points.clone()),
            max_iterations: config.fit_iterations as u64,
            ..FitConfig::default()
        };
        Ok(self.gp.fit(&self.set, covariance, &fit)?)
    }
}

pub(super) fn fitted_hyperparameters(fits: &[Fit]) -> Vec<Hyperparameters> {
    fits.iter().map(|fit| fit.hyperparameters).collect()
}

/// The answer of a posterior: the class of the largest latent mean, as Milios et al. choose it.
pub(super) fn answer_of(
    question: &Question<'_>,
    posterior: &Posterior,
    hyperparameters: Vec<Hyperparameters>,
    fits: Vec<Fit>,
) -> Result<Answer, PipelineError> {
    Ok(Answer {
        class: posterior.class(),
        probabilities: posterior.probabilities(),
        process: Some(Process {
            variance: posterior.predicted_variance(),
            score: posterior.confidence()?,
            difference_variance: difference_variance(question, posterior),
            clamped: posterior.clamped().to_vec(),
            clamped_share: posterior.clamped_share(),
            jitter: posterior.jitter(),
            hyperparameters,
            fits,
        }),
        ..Answer::default()
    })
}

/// Variance of the difference of two independent latent functions: the sum of theirs.
fn difference_variance(question: &Question<'_>, posterior: &Posterior) -> Vec<f64> {
    let free = question.classes.iter().position(|c| *c == FREE_CLASS);
    let of_free = |point: usize| free.map_or(0.0, |free| posterior.variance()[free][point]);
    let of_asked = posterior.variance()[question.asked].iter().enumerate();
    of_asked.map(|(point, v)| v + of_free(point)).collect()
}

pub(super) fn gp_points(name: &'static str, points: &[Point]) -> Result<Points, PipelineError> {
    let rows: Vec<f64> = points.iter().flat_map(|p| [p.x, p.y, p.z]).collect();
    Ok(Points::from_rows(name, &rows, 3)?)
}

/// A random choice of about `count` points, of each class in proportion to its size and at least
/// one. Points may come in any order, sorted ones too.
fn stratified(labels: &[usize], classes: usize, count: usize) -> Vec<usize> {
    let mut quota = vec![0_usize; classes];
    for &label in labels {
        quota[label] += 1;
    }
    for quota in &mut quota {
        *quota = (*quota * count).div_ceil(labels.len().max(count)).max(1);
    }
    let mut order: Vec<usize> = (0..labels.len()).collect();
    order.shuffle(&mut stream(FIT_SEED, "pipeline/fit"));
    order.retain(|&index| {
        let left = &mut quota[labels[index]];
        let take = *left > 0;
        *left -= usize::from(take);
        take
    });
    order.sort_unstable();
    order
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fit_sees_every_class_in_proportion() {
        let labels = [0, 0, 0, 0, 1, 1, 1, 1, 1, 1, 1, 1, 2];
        // 4, 8 and 1 of 13 points; 6 asked for: 1.8, 3.7 and 0.5, rounded up.
        let chosen = stratified(&labels, 3, 6);
        assert!(chosen.is_sorted_by(|a, b| a < b));
        let classes: Vec<usize> = chosen.iter().map(|index| labels[*index]).collect();
        assert_eq!(classes, [0, 0, 1, 1, 1, 1, 2]);
        assert_eq!(stratified(&labels, 3, 6), chosen);
        assert_eq!(stratified(&labels, 3, 99), (0..13).collect::<Vec<_>>());
    }

    #[test]
    fn a_fit_sees_all_of_a_sorted_set() {
        // 500 of 1000 points along a line: 250 of each half, give or take 6 standard deviations of
        // a draw without replacement, sqrt(500 x 1/4 x 500/999).
        let chosen = stratified(&[0; 1000], 1, 500);
        let first = chosen.partition_point(|index| *index < 500);
        assert!(first.abs_diff(250) < 48, "{first}");
        assert_eq!(chosen.len(), 500);
    }
}
