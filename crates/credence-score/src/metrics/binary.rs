use super::{
    calibration::{
        Binning, DEFAULT_BINS, brier_of, calibration_error_of, negative_log_likelihood_of,
        reliability_of,
    },
    confusion::Confusion,
    ranking::{auroc_of, average_precision_of, tie_groups},
    selective::RiskCoverage,
};
use crate::{ScoreError, error::same_length};

/// Every metric of binary predictions. `None` marks what is undefined on these points, or what
/// needs an array that was not given.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BinaryMetrics {
    /// Counts of decisions against the truth, with precision, recall, F1, accuracy and MCC.
    pub confusion: Confusion,
    /// Area under the ROC curve of the probability.
    pub auroc: Option<f64>,
    /// Average precision of the probability.
    pub average_precision: Option<f64>,
    /// Expected calibration error of the probability over [`DEFAULT_BINS`] bins of equal width.
    pub ece: Option<f64>,
    /// Expected calibration error of the probability over [`DEFAULT_BINS`] bins of equal mass.
    pub ece_equal_mass: Option<f64>,
    /// Mean squared error of the probability.
    pub brier: Option<f64>,
    /// Mean negative log-likelihood of the truth under the probability, nats.
    pub nll: Option<f64>,
    /// Mean risk over all coverages, points kept by falling decision confidence.
    pub aurc: Option<f64>,
    /// AURC above that of the best order.
    pub excess_aurc: Option<f64>,
    /// AURC expected of random order: the error rate.
    pub random_aurc: Option<f64>,
    /// Risk among the 50 % of points with the most confident decisions.
    pub risk_at_50: Option<f64>,
    /// Risk among the 80 % of points with the most confident decisions.
    pub risk_at_80: Option<f64>,
    /// Precision among the most confident 50 % of the points predicted to lie on the object.
    pub precision_at_50: Option<f64>,
    /// Precision among the most confident 80 % of the points predicted to lie on the object.
    pub precision_at_80: Option<f64>,
}

impl BinaryMetrics {
    /// Scores decisions, one per point in every array.
    ///
    /// `probability` is P(the point lies on the object) whatever was decided.
    /// `decision_confidence` ranks decisions of both kinds: a confident "free" stands high.
    ///
    /// # Errors
    /// Arrays of different lengths, a probability outside \[0, 1\], a confidence that is not
    /// finite.
    pub fn evaluate(
        predicted: &[bool],
        truth: &[bool],
        probability: Option<&[f64]>,
        decision_confidence: Option<&[f64]>,
    ) -> Result<Self, ScoreError> {
        let mut metrics = Self {
            confusion: Confusion::count(predicted, truth)?,
            auroc: None,
            average_precision: None,
            ece: None,
            ece_equal_mass: None,
            brier: None,
            nll: None,
            aurc: None,
            excess_aurc: None,
            random_aurc: None,
            risk_at_50: None,
            risk_at_80: None,
            precision_at_50: None,
            precision_at_80: None,
        };
        if let Some(probability) = probability {
            metrics.score_probability(probability, truth)?;
        }
        if let Some(confidence) = decision_confidence {
            metrics.score_confidence(confidence, predicted, truth)?;
        }
        Ok(metrics)
    }

    fn score_probability(&mut self, probability: &[f64], truth: &[bool]) -> Result<(), ScoreError> {
        let groups = tie_groups(probability, truth)?;
        let calibration_error =
            |binning| calibration_error_of(&reliability_of(&groups, binning, DEFAULT_BINS));
        self.auroc = auroc_of(&groups);
        self.average_precision = average_precision_of(&groups);
        self.ece = calibration_error(Binning::EqualWidth);
        self.ece_equal_mass = calibration_error(Binning::EqualMass);
        self.brier = brier_of(&groups);
        self.nll = negative_log_likelihood_of(&groups);
        Ok(())
    }

    fn score_confidence(
        &mut self,
        confidence: &[f64],
        predicted: &[bool],
        truth: &[bool],
    ) -> Result<(), ScoreError> {
        same_length(
            ("decision_confidence", confidence.len()),
            ("truth", truth.len()),
        )?;
        let correct: Vec<bool> = predicted.iter().zip(truth).map(|(p, t)| p == t).collect();
        let all = RiskCoverage::new(confidence, &correct)?;
        self.aurc = all.aurc();
        self.excess_aurc = all.excess_aurc();
        self.random_aurc = all.random_aurc();
        self.risk_at_50 = all.risk_at(0.5)?;
        self.risk_at_80 = all.risk_at(0.8)?;

        let (kept, on_object): (Vec<f64>, Vec<bool>) = confidence
            .iter()
            .zip(predicted)
            .zip(truth)
            .filter(|((_, predicted), _)| **predicted)
            .map(|((confidence, _), truth)| (*confidence, *truth))
            .unzip();
        let positives = RiskCoverage::new(&kept, &on_object)?;
        self.precision_at_50 = positives.risk_at(0.5)?.map(|risk| 1.0 - risk);
        self.precision_at_80 = positives.risk_at(0.8)?.map(|risk| 1.0 - risk);
        Ok(())
    }
}
