use crate::{ScoreError, error::same_length};

/// Slack by which a coverage times the number of points may exceed a whole number by rounding.
const COUNT_ROUNDING: f64 = 1e-9;

/// Risk against coverage: points are kept by falling confidence in their decision, and the risk is
/// the share of wrong decisions among the kept ones (Geifman & El-Yaniv 2017).
///
/// Where a cut falls between points of equal confidence, the risk is its expected value over their
/// random order: nothing here depends on the order in which the points are given.
#[derive(Debug, Clone, PartialEq)]
pub struct RiskCoverage {
    /// Points and errors of each group of equal confidence, by falling confidence.
    groups: Vec<(usize, usize)>,
    points: usize,
    errors: usize,
}

impl RiskCoverage {
    /// Ranks decisions. Only the order of the confidences counts, so any finite scale will do.
    ///
    /// # Errors
    /// Arrays of different lengths, a confidence that is not finite.
    pub fn new(decision_confidence: &[f64], correct: &[bool]) -> Result<Self, ScoreError> {
        same_length(
            ("decision_confidence", decision_confidence.len()),
            ("truth", correct.len()),
        )?;
        if let Some(index) = decision_confidence.iter().position(|c| !c.is_finite()) {
            return Err(ScoreError::Confidence {
                index,
                value: decision_confidence[index],
            });
        }
        let mut points: Vec<(f64, bool)> = decision_confidence
            .iter()
            // Adding 0 turns -0 into 0, so that both fall into one group.
            .map(|c| c + 0.0)
            .zip(correct.iter().copied())
            .collect();
        points.sort_unstable_by(|a, b| b.0.total_cmp(&a.0));
        let groups: Vec<(usize, usize)> = points
            .chunk_by(|a, b| a.0 == b.0)
            .map(|tied| {
                let errors = tied.iter().filter(|(_, correct)| !correct).count();
                (tied.len(), errors)
            })
            .collect();
        Ok(Self {
            points: points.len(),
            errors: groups.iter().map(|(_, errors)| errors).sum(),
            groups,
        })
    }

    /// Number of points.
    pub const fn points(&self) -> usize {
        self.points
    }

    /// The curve: risk among the 1, 2, ... most confident points. Its k-th value, from 1, belongs
    /// to coverage k / [`points`](Self::points).
    pub fn risks(&self) -> impl Iterator<Item = f64> + '_ {
        let mut kept_before = 0;
        let mut errors_before = 0;
        self.groups.iter().flat_map(move |&(size, errors)| {
            let (kept, wrong) = (kept_before, errors_before);
            kept_before += size;
            errors_before += errors;
            let rate = errors as f64 / size as f64;
            (1..=size)
                .map(move |taken| (wrong as f64 + taken as f64 * rate) / (kept + taken) as f64)
        })
    }

    /// Area under the curve: the mean risk over all coverages. `None` without points.
    pub fn aurc(&self) -> Option<f64> {
        (self.points > 0).then(|| self.risks().sum::<f64>() / self.points as f64)
    }

    /// [`aurc`](Self::aurc) less that of the best order there is, which puts all errors last.
    /// 0 is perfect ranking, whatever the error rate. `None` without points.
    pub fn excess_aurc(&self) -> Option<f64> {
        let correct = self.points - self.errors;
        let best = (1..=self.errors)
            .map(|wrong| wrong as f64 / (correct + wrong) as f64)
            .sum::<f64>()
            / self.points as f64;
        self.aurc().map(|aurc| (aurc - best).max(0.0))
    }

    /// The expected area under the curve when points are kept in random order: the error rate. A
    /// confidence must beat it. `None` without points.
    pub fn random_aurc(&self) -> Option<f64> {
        (self.points > 0).then(|| self.errors as f64 / self.points as f64)
    }

    /// Risk among the most confident share of the points, rounded up to whole points. `None`
    /// without points.
    ///
    /// # Errors
    /// A coverage outside (0, 1\].
    pub fn risk_at(&self, coverage: f64) -> Result<Option<f64>, ScoreError> {
        if !(coverage > 0.0 && coverage <= 1.0) {
            return Err(ScoreError::Coverage { value: coverage });
        }
        let kept = (coverage * self.points as f64 - COUNT_ROUNDING).ceil();
        Ok(self.risks().nth((kept.max(1.0) as usize) - 1))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(found: Option<f64>, expected: f64) -> bool {
        found.is_some_and(|found| (found - expected).abs() < 1e-15)
    }

    #[test]
    fn risk_grows_as_errors_come_in() {
        // Falling confidence: right, wrong, right, wrong -> risks 0, 1/2, 1/3, 1/2.
        let confidence = [0.2, 0.9, 0.4, 0.3];
        let ranked = RiskCoverage::new(&confidence, &[false, true, false, true]).unwrap();
        let risks: Vec<f64> = ranked.risks().collect();
        assert_eq!(risks, [0.0, 0.5, 1.0 / 3.0, 0.5]);
        assert!(close(ranked.aurc(), 1.0 / 3.0));
        // Best order: 0, 0, 1/3, 1/2.
        assert!(close(ranked.excess_aurc(), 1.0 / 3.0 - 5.0 / 24.0));
        assert_eq!(ranked.random_aurc(), Some(0.5));
        assert_eq!(ranked.risk_at(0.5), Ok(Some(0.5)));
        assert_eq!(ranked.risk_at(0.51), Ok(Some(1.0 / 3.0)));
        assert_eq!(ranked.risk_at(1e-9), Ok(Some(0.0)));
        assert_eq!(ranked.risk_at(1.0), Ok(Some(0.5)));
    }

    #[test]
    fn ties_take_their_expected_risk() {
        // All tied: every cut has the error rate, as random order has.
        let tied = RiskCoverage::new(&[0.7; 4], &[true, false, false, true]).unwrap();
        assert_eq!(tied.aurc(), Some(0.5));
        assert_eq!(tied.risk_at(0.5), Ok(Some(0.5)));
        // One right point ahead of a tie of one right and one wrong: 0, (1/2)/2, 1/3.
        let mixed = [[true, true, false], [true, false, true]]
            .map(|correct| RiskCoverage::new(&[0.9, 0.5, 0.5], &correct).unwrap());
        assert!(close(mixed[0].aurc(), (0.25 + 1.0 / 3.0) / 3.0));
        assert_eq!(mixed[0], mixed[1]);
        let signed_zeros = RiskCoverage::new(&[0.0, -0.0], &[true, false]).unwrap();
        assert_eq!(signed_zeros.risk_at(0.5), Ok(Some(0.5)));
    }

    #[test]
    fn perfect_ranking_has_no_excess() {
        let ranked = RiskCoverage::new(&[4.0, 3.0, 2.0, 1.0], &[true, true, false, false]).unwrap();
        assert_eq!(ranked.excess_aurc(), Some(0.0));
        let faultless = RiskCoverage::new(&[1.0, 1.0], &[true; 2]).unwrap();
        assert_eq!(faultless.aurc(), Some(0.0));
        assert_eq!(faultless.excess_aurc(), Some(0.0));
    }

    #[test]
    fn whole_counts_survive_rounding() {
        // 0.55 * 100 is 55.00000000000001 in f64, which must keep 55 points, not 56.
        let confidence: Vec<f64> = (0..100).map(|i| -f64::from(i)).collect();
        let correct: Vec<bool> = (0..100).map(|i| i < 55).collect();
        let ranked = RiskCoverage::new(&confidence, &correct).unwrap();
        assert_eq!(ranked.risk_at(0.55), Ok(Some(0.0)));
    }

    #[test]
    fn nothing_kept_has_no_risk() {
        let empty = RiskCoverage::new(&[], &[]).unwrap();
        assert_eq!(empty.aurc(), None);
        assert_eq!(empty.excess_aurc(), None);
        assert_eq!(empty.random_aurc(), None);
        assert_eq!(empty.risk_at(0.8), Ok(None));
    }

    #[test]
    fn refuses_what_cannot_be_ranked() {
        for value in [f64::NAN, f64::INFINITY] {
            let message = RiskCoverage::new(&[0.5, value], &[true; 2]).unwrap_err();
            assert!(message.to_string().contains("decision_confidence[1] is"));
        }
        assert!(RiskCoverage::new(&[0.5], &[]).is_err());
        let ranked = RiskCoverage::new(&[0.5], &[true]).unwrap();
        for coverage in [0.0, -0.1, 1.1, f64::NAN] {
            let message = ranked.risk_at(coverage).unwrap_err().to_string();
            assert!(message.contains("(0, 1]"), "{message}");
        }
    }
}
