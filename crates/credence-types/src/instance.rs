use crate::{Category, Intrinsics, InvalidInput};

/// Excess over 1 of the sum of class scores that still counts as rounding.
const SUM_TOLERANCE: f64 = 1e-6;

/// One detected object in one frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Instance {
    mask: Vec<bool>,
    class_scores: [f64; Category::ALL.len()],
    score: f64,
}

impl Instance {
    /// Checks that the mask is of a camera's image.
    ///
    /// # Errors
    /// A mask of another size.
    pub fn check_fits(&self, intrinsics: &Intrinsics) -> Result<(), InvalidInput> {
        if self.mask.len() == intrinsics.pixels() {
            return Ok(());
        }
        Err(InvalidInput::BufferLength {
            name: "mask",
            found: self.mask.len(),
            expected: intrinsics.pixels(),
            width: intrinsics.width(),
            height: intrinsics.height(),
        })
    }

    /// A detection: `mask` is row-major at full resolution, `class_scores` the probability of each
    /// category in [`Category::ALL`]'s order, what they leave of 1 that of being none of them, and
    /// `score` the detector's confidence in \[0, 1\].
    ///
    /// # Errors
    /// An empty mask (`index` names the instance), a score outside \[0, 1\], class scores
    /// whose sum exceeds 1 by more than 1e-6.
    pub fn new(
        index: usize,
        mask: Vec<bool>,
        class_scores: [f64; Category::ALL.len()],
        score: f64,
    ) -> Result<Self, InvalidInput> {
        if !mask.contains(&true) {
            return Err(InvalidInput::EmptyMask { index });
        }
        let in_range = |v: f64| (0.0..=1.0).contains(&v);
        if let Some(&value) = class_scores.iter().find(|v| !in_range(**v)) {
            return Err(InvalidInput::Score {
                name: "class_scores",
                value,
            });
        }
        let sum: f64 = class_scores.iter().sum();
        if sum > 1.0 + SUM_TOLERANCE {
            return Err(InvalidInput::ClassScores { sum });
        }
        if !in_range(score) {
            return Err(InvalidInput::Score {
                name: "score",
                value: score,
            });
        }
        Ok(Self {
            mask,
            class_scores,
            score,
        })
    }

    /// A detection that is certain of its category, as the oracle's are.
    ///
    /// # Errors
    /// An empty mask.
    pub fn certain(
        index: usize,
        mask: Vec<bool>,
        category: Category,
    ) -> Result<Self, InvalidInput> {
        let class_scores = Category::ALL.map(|c| f64::from(u8::from(c == category)));
        Self::new(index, mask, class_scores, 1.0)
    }

    /// Which pixels belong to the object, row-major.
    pub fn mask(&self) -> &[bool] {
        &self.mask
    }

    /// Probability of each category in [`Category::ALL`]'s order.
    pub const fn class_scores(&self) -> &[f64; Category::ALL.len()] {
        &self.class_scores
    }

    /// The detector's confidence in \[0, 1\].
    pub const fn score(&self) -> f64 {
        self.score
    }

    /// The most probable category; the first of equals.
    pub fn category(&self) -> Category {
        let mut best = 0;
        for (i, score) in self.class_scores.iter().enumerate() {
            if *score > self.class_scores[best] {
                best = i;
            }
        }
        Category::ALL[best]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_category_is_the_most_probable() {
        let scores = [0.1, 0.4, 0.0, 0.0, 0.1, 0.4];
        let instance = Instance::new(0, vec![true], scores, 0.5).unwrap();
        assert_eq!(instance.category(), Category::Bowl);
        let certain = Instance::certain(0, vec![true], Category::Mug).unwrap();
        assert_eq!((certain.category(), certain.score()), (Category::Mug, 1.0));
    }

    #[test]
    fn refuses_empty_masks_and_scores_out_of_range() {
        let empty = Instance::certain(3, vec![false; 4], Category::Mug).unwrap_err();
        assert!(empty.to_string().contains("mask of instance 3 is empty"));
        for score in [-0.1, 1.1, f64::NAN] {
            assert!(Instance::new(0, vec![true], [0.0; 6], score).is_err());
        }
    }

    #[test]
    fn refuses_class_scores_that_add_up_to_more_than_one() {
        let new = |last: f64| Instance::new(0, vec![true], [0.5, 0.25, 0.0, 0.0, 0.0, last], 1.0);
        assert!(new(0.25 + 1e-7).is_ok());
        assert_eq!(
            new(0.75).unwrap_err().to_string(),
            "class_scores add up to 1.5; they are probabilities of exclusive categories and must \
             add up to at most 1: divide them by their sum"
        );
    }
}
