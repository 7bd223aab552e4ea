use crate::{ScoreError, error::same_length};

/// How many points were predicted to lie on the object, and how many of them do.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Confusion {
    /// Predicted to lie on the object, and does (TP).
    pub true_positives: usize,
    /// Predicted to be free, and is (TN).
    pub true_negatives: usize,
    /// Predicted to lie on the object, but is free (FP).
    pub false_positives: usize,
    /// Predicted to be free, but lies on the object (FN).
    pub false_negatives: usize,
}

impl Confusion {
    /// Counts decisions against the truth.
    ///
    /// # Errors
    /// Arrays of different lengths.
    pub fn count(predicted: &[bool], truth: &[bool]) -> Result<Self, ScoreError> {
        same_length(("predicted", predicted.len()), ("truth", truth.len()))?;
        let of = |p: bool, t: bool| {
            let pairs = predicted.iter().zip(truth);
            pairs.filter(|&(&pi, &ti)| (pi, ti) == (p, t)).count()
        };
        Ok(Self {
            true_positives: of(true, true),
            true_negatives: of(false, false),
            false_positives: of(true, false),
            false_negatives: of(false, true),
        })
    }

    /// Number of points.
    pub const fn total(&self) -> usize {
        self.true_positives + self.true_negatives + self.false_positives + self.false_negatives
    }

    /// TP, TN, FP, FN as fractions of all points; `None` without points.
    pub fn fractions(&self) -> Option<[f64; 4]> {
        let counts = [
            self.true_positives,
            self.true_negatives,
            self.false_positives,
            self.false_negatives,
        ];
        (self.total() > 0).then(|| counts.map(|count| count as f64 / self.total() as f64))
    }

    /// TP / (TP + FP): the seed's "Acc." column. `None` where no point was predicted positive.
    pub fn precision(&self) -> Option<f64> {
        ratio(
            self.true_positives,
            self.true_positives + self.false_positives,
        )
    }

    /// TP / (TP + FN). `None` where no point is positive.
    pub fn recall(&self) -> Option<f64> {
        ratio(
            self.true_positives,
            self.true_positives + self.false_negatives,
        )
    }

    /// 2 TP / (2 TP + FP + FN), the harmonic mean of precision and recall.
    ///
    /// `None` where no point is positive, since nothing could have been found. It is 0 where
    /// positives exist and none was predicted.
    pub fn f1(&self) -> Option<f64> {
        let missed_or_false = self.false_positives + self.false_negatives;
        self.recall()?;
        ratio(
            2 * self.true_positives,
            2 * self.true_positives + missed_or_false,
        )
    }

    /// (TP + TN) / all. `None` without points.
    pub fn accuracy(&self) -> Option<f64> {
        ratio(self.true_positives + self.true_negatives, self.total())
    }

    /// Matthews' correlation coefficient: (TP TN - FP FN) over the root of
    /// (TP + FP) (TP + FN) (TN + FP) (TN + FN).
    ///
    /// `None` where predictions or truth are all alike: a constant correlates with nothing.
    pub fn mcc(&self) -> Option<f64> {
        let [tp, tn, fp, fn_] = [
            self.true_positives,
            self.true_negatives,
            self.false_positives,
            self.false_negatives,
        ]
        .map(|count| count as f64);
        let norm = ((tp + fp) * (tp + fn_) * (tn + fp) * (tn + fn_)).sqrt();
        (norm > 0.0).then(|| ((tp * tn - fp * fn_) / norm).clamp(-1.0, 1.0))
    }
}

fn ratio(part: usize, whole: usize) -> Option<f64> {
    (whole > 0).then(|| part as f64 / whole as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    const fn confusion(tp: usize, tn: usize, fp: usize, fn_: usize) -> Confusion {
        Confusion {
            true_positives: tp,
            true_negatives: tn,
            false_positives: fp,
            false_negatives: fn_,
        }
    }

    #[test]
    fn counts_each_kind() {
        let predicted = [true, true, true, false, false, false, false];
        let truth = [true, true, false, true, false, false, false];
        let counted = Confusion::count(&predicted, &truth).unwrap();
        assert_eq!(counted, confusion(2, 3, 1, 1));
        assert_eq!(
            counted.fractions(),
            Some([2.0 / 7.0, 3.0 / 7.0, 1.0 / 7.0, 1.0 / 7.0])
        );
        assert_eq!(counted.precision(), Some(2.0 / 3.0));
        assert_eq!(counted.recall(), Some(2.0 / 3.0));
        assert_eq!(counted.f1(), Some(2.0 / 3.0));
        assert_eq!(counted.accuracy(), Some(5.0 / 7.0));
        // (2 * 3 - 1 * 1) / sqrt(3 * 3 * 4 * 4)
        assert!((counted.mcc().unwrap() - 5.0 / 12.0).abs() < 1e-15);
    }

    #[test]
    fn reproduces_the_seeds_columns() {
        // Table III, mug, metric model with shape completion: precision .659, accuracy .872.
        let mug = confusion(161, 711, 83, 45);
        assert!((mug.precision().unwrap() - 0.659).abs() < 1e-3);
        assert!((mug.accuracy().unwrap() - 0.872).abs() < 1e-12);
    }

    #[test]
    fn undefined_values_are_none() {
        let empty = confusion(0, 0, 0, 0);
        assert_eq!(empty.fractions(), None);
        for value in [
            empty.precision(),
            empty.recall(),
            empty.f1(),
            empty.accuracy(),
            empty.mcc(),
        ] {
            assert_eq!(value, None);
        }
        let nothing_to_find = confusion(0, 3, 1, 0);
        assert_eq!(nothing_to_find.precision(), Some(0.0));
        assert_eq!(nothing_to_find.recall(), None);
        assert_eq!(nothing_to_find.f1(), None);
        assert_eq!(nothing_to_find.mcc(), None);
        let nothing_predicted = confusion(0, 3, 0, 1);
        assert_eq!(nothing_predicted.precision(), None);
        assert_eq!(nothing_predicted.recall(), Some(0.0));
        assert_eq!(nothing_predicted.f1(), Some(0.0));
        assert_eq!(nothing_predicted.mcc(), None);
    }

    #[test]
    fn mcc_is_one_for_the_truth_and_minus_one_for_its_opposite() {
        assert_eq!(confusion(3, 5, 0, 0).mcc(), Some(1.0));
        assert_eq!(confusion(0, 0, 5, 3).mcc(), Some(-1.0));
        assert_eq!(confusion(2, 2, 2, 2).mcc(), Some(0.0));
    }

    #[test]
    fn refuses_different_lengths() {
        let message = Confusion::count(&[true], &[true, false]).unwrap_err();
        assert_eq!(
            message.to_string(),
            "predicted holds 1 values and truth 2; pass one value per row"
        );
    }
}
