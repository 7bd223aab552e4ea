use credence_gp::{Fit, Hyperparameters};
use credence_types::{InvalidInput, Prediction, Predictions};

use crate::{
    NetworkView, PipelineError, Platt,
    models::{Answer, Question},
};

/// Predictions, and what made them.
#[derive(Debug, Clone, PartialEq)]
pub struct Classification {
    /// What is said of each test point. The probabilities are the model's own; confidences follow
    /// from them by [`Pipeline::classify`](crate::Pipeline::classify)'s rule. A model without
    /// variances has 0 there, and its confidences as scores.
    pub predictions: Predictions,
    /// Hyperparameters of each class in `predictions.classes`; none if the model is no process.
    pub hyperparameters: Vec<Hyperparameters>,
    /// Outcome of each class's search for hyperparameters, whether it ended by its tolerances and
    /// inside its range; none if the model searches none. Those of `metric` are of the classic
    /// process that its gate weighs it against.
    pub fits: Vec<Fit>,
    /// Whether each test point's variance was below zero and clamped: only by `metric_literal`.
    pub clamped: Vec<bool>,
    /// Variance per test point of the latent difference between the object's category and free
    /// space, if the model is a process.
    pub difference_variance: Option<Vec<f64>>,
    /// Weight of `metric` against `classic`, 1 where there is no gate.
    pub gate: f64,
    /// What the query network says, if the model asks it.
    pub network: Option<NetworkView>,
}

/// What turns a probability into a confidence.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Evidence<'a> {
    pub(crate) recalibration: Platt,
    /// How sure the segmenter is of the object.
    pub(crate) segmenter_score: f64,
    /// How sure the completer is that each test point exists; `None` for points of no completer.
    pub(crate) completion: Option<&'a [f64]>,
}

impl Evidence<'_> {
    pub(crate) fn check(&self, test_points: usize) -> Result<(), PipelineError> {
        let Some(completion) = self.completion else {
            return Ok(());
        };
        if completion.len() != test_points {
            return Err(PipelineError::CompletionLength {
                found: completion.len(),
                expected: test_points,
            });
        }
        match completion.iter().find(|q| !(0.0..=1.0).contains(*q)) {
            None => Ok(()),
            Some(value) => Err(InvalidInput::Score {
                name: "completion_confidence",
                value: *value,
            }
            .into()),
        }
    }

    /// The confidence of test point `point`, whose probability of the object's category is
    /// `probability`: the product of that, recalibrated, and of what other stages are sure of,
    /// the segmenter of the object and the completer of the point. The three judge by different
    /// data, and are taken as independent; one that says nothing counts as 1.
    fn confidence(&self, point: usize, probability: f64) -> f64 {
        let completion = self.completion.map_or(1.0, |q| q[point]);
        self.recalibration.apply(probability) * completion * self.segmenter_score
    }
}

impl Classification {
    pub(crate) fn new(question: Question<'_>, answer: Answer, evidence: &Evidence<'_>) -> Self {
        let Question { classes, asked, .. } = question;
        let Answer {
            class,
            probabilities,
            process,
            network,
            gate,
        } = answer;
        let rows = probabilities.chunks_exact(classes.len());
        let points = class
            .iter()
            .zip(rows)
            .enumerate()
            .map(|(point, (class, row))| {
                let confidence = evidence.confidence(point, row[asked]);
                let (variance, score) = process.as_ref().map_or((0.0, confidence), |process| {
                    let score = process.score[point] * evidence.segmenter_score;
                    (process.variance[point], score)
                });
                Prediction {
                    class: classes[*class],
                    variance,
                    score,
                    confidence,
                }
            })
            .collect();
        let (clamped_share, jitter) = process.as_ref().map_or((0.0, 0.0), |process| {
            (process.clamped_share, process.jitter)
        });
        let predictions = Predictions {
            points,
            classes,
            probabilities,
            clamped_share,
            jitter,
        };
        let mut classification = Self {
            clamped: vec![false; predictions.points.len()],
            predictions,
            hyperparameters: Vec::new(),
            fits: Vec::new(),
            difference_variance: None,
            gate: gate.unwrap_or(1.0),
            network,
        };
        if let Some(process) = process {
            classification.clamped = process.clamped;
            classification.hyperparameters = process.hyperparameters;
            classification.fits = process.fits;
            classification.difference_variance = Some(process.difference_variance);
        }
        classification
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_confidence_is_the_product_of_what_the_stages_are_sure_of() {
        let completion = [1.0, 0.5, 0.0];
        let with = |completion| Evidence {
            recalibration: Platt {
                slope: 2.0,
                intercept: 0.0,
            },
            segmenter_score: 0.8,
            completion,
        };
        // Recalibrated: logit(0.8) = ln 4, doubled ln 16.
        let sure = 16.0 / 17.0 * 0.8;
        for (point, expected) in [sure, 0.5 * sure, 0.0].into_iter().enumerate() {
            let confidence = with(Some(&completion)).confidence(point, 0.8);
            assert!((confidence - expected).abs() < 1e-15);
        }
        assert!((with(None).confidence(2, 0.8) - sure).abs() < 1e-15);
    }

    #[test]
    fn completion_confidences_are_probabilities_one_per_point() {
        let message = |completion: &[f64]| {
            let evidence = Evidence {
                recalibration: Platt::default(),
                segmenter_score: 1.0,
                completion: Some(completion),
            };
            evidence.check(2).unwrap_err().to_string()
        };
        assert_eq!(
            message(&[0.5]),
            "completion_confidence holds 1 values; 2 test points need one each"
        );
        assert_eq!(
            message(&[0.5, 1.5]),
            "completion_confidence is 1.5; it must lie in [0, 1]"
        );
        assert!(message(&[f64::NAN, 0.5]).contains("NaN"));
    }
}
