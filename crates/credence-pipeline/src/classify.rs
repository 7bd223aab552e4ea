use credence_gp::{
    Covariance, DirichletGp, Fit, FitConfig, Hyperparameters, Points, Smoothness,
    TrainingSet as GpSet,
};
use credence_types::{Category, Point, Prediction, Predictions, stream};
use rand::seq::SliceRandom as _;

use crate::{GpConfig, ModelChoice, PipelineError, SmoothnessChoice, TrainingSet};

/// Seed of the choice of points to fit on: fixed, so that a training set alone decides a fit.
const FIT_SEED: u64 = 0;

/// Predictions, and the processes that made them.
#[derive(Debug, Clone, PartialEq)]
pub struct Classification {
    /// What is said of each test point. A point's confidence is the expectation of the softmax
    /// under the posterior, for the object's category, times the segmenter's score; no calibration
    /// follows.
    pub predictions: Predictions,
    /// Outcome of the fit of each class in `predictions.classes`: its hyperparameters, and whether
    /// the search ended by its tolerances and inside its range.
    pub fits: Vec<Fit>,
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
    /// Position of the category asked for in `classes`.
    asked: usize,
    fits: Vec<Fit>,
}

impl Fitted {
    /// Fits a model's hyperparameters on a stratified part of the training set, to tell `category`
    /// from the rest.
    pub(crate) fn new(
        training: &TrainingSet,
        category: Category,
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
        let asked = classes
            .binary_search(&category.class())
            .map_err(|_place| PipelineError::CategoryNotTrained { category })?;
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
        let fits = gp.fit(&set, &covariance, &fit)?;
        Ok(Self {
            gp,
            covariance,
            set,
            classes,
            asked,
            fits,
        })
    }

    /// Predicts the class of each test point and how likely it lies on an object of the category,
    /// which the segmenter is `segmenter_score` sure of.
    pub(crate) fn predict(
        self,
        test_points: &[Point],
        segmenter_score: f64,
    ) -> Result<Classification, PipelineError> {
        let test = gp_points("test points", test_points)?;
        let hyperparameters: Vec<Hyperparameters> =
            self.fits.iter().map(|fit| fit.hyperparameters).collect();
        let posterior = self
            .gp
            .posterior(&self.set, &self.covariance, &hyperparameters, &test)?;
        let probabilities = posterior.probabilities();
        let count = self.classes.len();
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
                confidence: row[self.asked] * segmenter_score,
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
            fits: self.fits,
        })
    }
}

fn gp_points(name: &'static str, points: &[Point]) -> Result<Points, PipelineError> {
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

    #[test]
    fn a_category_that_is_not_in_the_training_set_is_an_error() {
        let points = (0..4).map(|i| Point::new(0.01 * f64::from(i), 0.0, 0.0));
        let bowl = Category::Bowl.class();
        let training = TrainingSet::new(points.collect(), vec![0, 0, bowl, bowl]).unwrap();
        let config = GpConfig::default();
        let refused = Fitted::new(&training, Category::Mug, ModelChoice::Classic, &config);
        assert_eq!(
            refused.unwrap_err().to_string(),
            "the object is a mug, and no training point is of that category; draw the training \
             set for this object"
        );
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
            let (mug, classic) = (Category::Mug, ModelChoice::Classic);
            Fitted::new(&training, mug, classic, &GpConfig::default())
                .unwrap()
                .predict(&test, segmenter_score)
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
