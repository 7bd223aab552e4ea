use credence_gp::{
    Covariance, DirichletGp, FitConfig, Hyperparameters, Points, Smoothness, TrainingSet as GpSet,
};
use credence_types::{Category, Point, Prediction, Predictions};

use crate::{GpConfig, ModelChoice, PipelineError, SmoothnessChoice, TrainingSet};

/// Predictions, and the processes that made them.
#[derive(Debug, Clone, PartialEq)]
pub struct Classification {
    /// What is said of each test point.
    pub predictions: Predictions,
    /// Fitted hyperparameters of each class in `predictions.classes`.
    pub hyperparameters: Vec<Hyperparameters>,
}

impl From<SmoothnessChoice> for Smoothness {
    fn from(choice: SmoothnessChoice) -> Self {
        match choice {
            SmoothnessChoice::Half => Self::Half,
            SmoothnessChoice::ThreeHalves => Self::ThreeHalves,
            SmoothnessChoice::FiveHalves => Self::FiveHalves,
        }
    }
}

/// A model fitted to one training set: what is left to do is to ask it.
#[derive(Debug)]
pub(crate) struct Fitted {
    gp: DirichletGp,
    covariance: Covariance,
    set: GpSet,
    classes: Vec<u8>,
    hyperparameters: Vec<Hyperparameters>,
}

impl Fitted {
    /// Fits a model's hyperparameters on a stratified part of the training set.
    pub(crate) fn new(
        training: &TrainingSet,
        model: ModelChoice,
        config: &GpConfig,
    ) -> Result<Self, PipelineError> {
        let mut classes = training.classes().to_vec();
        classes.sort_unstable();
        classes.dedup();
        let labels: Vec<usize> = training
            .classes()
            .iter()
            .map(|class| classes.partition_point(|c| c < class))
            .collect();
        let set = GpSet::new(
            gp_points("training points", training.points_world())?,
            &labels,
            classes.len(),
        )?;
        let gp = DirichletGp {
            smoothness: config.smoothness.into(),
            ..DirichletGp::default()
        };
        let covariance = match model {
            ModelChoice::Classic => Covariance::Classic,
        };
        let fit = FitConfig {
            subset: Some(stratified(&labels, classes.len(), config.fit_points)),
            max_iterations: config.fit_iterations as u64,
            ..FitConfig::default()
        };
        let hyperparameters = gp
            .fit(&set, &covariance, &fit)?
            .iter()
            .map(|fit| fit.hyperparameters)
            .collect();
        Ok(Self {
            gp,
            covariance,
            set,
            classes,
            hyperparameters,
        })
    }

    /// Predicts the class of each test point and how likely it lies on an object of `category`,
    /// which the segmenter is `segmenter_score` sure of.
    pub(crate) fn predict(
        self,
        test_points: &[Point],
        category: Category,
        segmenter_score: f64,
    ) -> Result<Classification, PipelineError> {
        let test = gp_points("test points", test_points)?;
        let posterior =
            self.gp
                .posterior(&self.set, &self.covariance, &self.hyperparameters, &test)?;
        let probabilities = posterior.probabilities();
        let count = self.classes.len();
        let column = self.classes.iter().position(|c| *c == category.class());
        let points = posterior
            .class()
            .into_iter()
            .zip(posterior.predicted_variance())
            .zip(posterior.confidence()?)
            .zip(probabilities.chunks_exact(count))
            .map(|(((class, variance), score), row)| Prediction {
                class: self.classes[class],
                variance,
                score: score * segmenter_score,
                confidence: column.map_or(0.0, |c| row[c]) * segmenter_score,
            })
            .collect();
        Ok(Classification {
            predictions: Predictions {
                points,
                classes: self.classes,
                probabilities,
                clamped_share: posterior.clamped_share(),
                jitter: posterior.jitter(),
            },
            hyperparameters: self.hyperparameters,
        })
    }
}

fn gp_points(name: &'static str, points: &[Point]) -> Result<Points, PipelineError> {
    let rows: Vec<f64> = points.iter().flat_map(|p| [p.x, p.y, p.z]).collect();
    Ok(Points::from_rows(name, &rows, 3)?)
}

/// The first points of each class, in proportion to its size and at least one of each: about
/// `count` in all. Training points come in random order, so the first are a random choice.
fn stratified(labels: &[usize], classes: usize, count: usize) -> Vec<usize> {
    let mut quota = vec![0_usize; classes];
    for &label in labels {
        quota[label] += 1;
    }
    for quota in &mut quota {
        *quota = (*quota * count).div_ceil(labels.len().max(count)).max(1);
    }
    (0..labels.len())
        .filter(|&index| {
            let left = &mut quota[labels[index]];
            let take = *left > 0;
            *left -= usize::from(take);
            take
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fit_sees_every_class_in_proportion() {
        let labels = [0, 0, 0, 0, 1, 1, 1, 1, 1, 1, 1, 1, 2];
        // 4, 8 and 1 of 13 points; 6 asked for: 1.8, 3.7 and 0.5, rounded up.
        assert_eq!(stratified(&labels, 3, 6), [0, 1, 4, 5, 6, 7, 12]);
        assert_eq!(stratified(&labels, 3, 99), (0..13).collect::<Vec<_>>());
    }

    #[test]
    fn the_nearer_class_wins_and_the_segmenter_scales_the_confidence() {
        let points = |x: f64| (0..8).map(move |i| Point::new(x, 0.01 * f64::from(i), 0.0));
        let training = TrainingSet::new(
            points(0.0).chain(points(0.1)).collect(),
            [[Category::Mug.class(); 8], [0; 8]].concat(),
        )
        .unwrap();
        let test = [Point::new(0.0, 0.035, 0.0), Point::new(0.1, 0.035, 0.0)];
        let ask = |segmenter_score| {
            Fitted::new(&training, ModelChoice::Classic, &GpConfig::default())
                .unwrap()
                .predict(&test, Category::Mug, segmenter_score)
                .unwrap()
                .predictions
        };
        let sure = ask(1.0);
        assert_eq!(sure.classes, [0, 6]);
        assert_eq!([sure.points[0].class, sure.points[1].class], [6, 0]);
        assert_eq!(sure.points[0].confidence, sure.probabilities[1]);
        assert!(sure.points[0].confidence > 0.8 && sure.points[1].confidence < 0.2);
        assert_eq!(sure.clamped_share, 0.0);
        assert_eq!(
            ask(0.5).points[0].confidence,
            0.5 * sure.points[0].confidence
        );
    }
}
