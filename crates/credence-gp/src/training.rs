use crate::{GpError, Points};

/// Labelled points to learn from, checked: every class has at least one.
#[derive(Debug, Clone, PartialEq)]
pub struct TrainingSet {
    points: Points,
    labels: Vec<usize>,
    classes: usize,
}

impl TrainingSet {
    /// Pairs points with their labels.
    ///
    /// # Arguments
    ///
    /// * `points`: N points. Duplicates are allowed, also with different labels.
    /// * `labels`: class index of each point, in `0..classes`.
    /// * `classes`: number of classes, at least 2.
    ///
    /// # Errors
    /// Fewer than 2 classes, no points, labels of another number or out of range, a class without
    /// a point.
    pub fn new(points: Points, labels: &[usize], classes: usize) -> Result<Self, GpError> {
        if classes < 2 {
            return Err(GpError::TooFewClasses { classes });
        }
        if points.is_empty() {
            return Err(GpError::NoTrainingPoints);
        }
        if labels.len() != points.len() {
            return Err(GpError::Length {
                name: "labels",
                found: labels.len(),
                expected: points.len(),
                per: "training point",
            });
        }
        // No more classes than labels can be filled: bounds the allocation before it is made.
        let mut seen = vec![false; classes.min(labels.len() + 1)];
        for (index, &label) in labels.iter().enumerate() {
            if label >= classes {
                return Err(GpError::Label {
                    index,
                    label,
                    last: classes - 1,
                });
            }
            if let Some(seen) = seen.get_mut(label) {
                *seen = true;
            }
        }
        if let Some(class) = seen.iter().position(|seen| !seen) {
            return Err(GpError::EmptyClass { class });
        }
        Ok(Self {
            points,
            labels: labels.to_vec(),
            classes,
        })
    }

    /// The points at `indices`, in that order, with their labels.
    ///
    /// # Errors
    /// An index that does not exist, a class of which no point is chosen.
    pub fn select(&self, indices: &[usize]) -> Result<Self, GpError> {
        let label = |&index: &usize| {
            self.labels.get(index).copied().ok_or(GpError::Subset {
                index,
                points: self.len(),
            })
        };
        let labels = indices.iter().map(label).collect::<Result<Vec<_>, _>>()?;
        Self::new(self.points.select(indices), &labels, self.classes)
    }

    /// The points.
    pub const fn points(&self) -> &Points {
        &self.points
    }

    /// Class index of each point.
    pub fn labels(&self) -> &[usize] {
        &self.labels
    }

    /// Number of classes.
    pub const fn classes(&self) -> usize {
        self.classes
    }

    /// Number of points.
    pub const fn len(&self) -> usize {
        self.points.len()
    }

    /// Whether there are no points: never, as construction refuses that.
    pub const fn is_empty(&self) -> bool {
        self.points.is_empty()
    }
}
