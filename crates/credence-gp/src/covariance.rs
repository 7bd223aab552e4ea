use crate::{GpError, Points, TrainingSet, hyperparameters::check_scale};

/// Which space each covariance of the model is computed in.
#[derive(Debug, Clone, PartialEq)]
pub enum Covariance {
    /// K(X,X), K(X,X*) and K(X*,X*) on the coordinates: a Gaussian process.
    Classic,
    /// The seed paper's Eq. 1 as written: K(X,X) on embeddings, K(X,X*) and K(X*,X*) on
    /// coordinates, which are all that is known of a test point.
    ///
    /// The three are not blocks of one covariance, so the result is no posterior: its variance goes
    /// below zero. It is clamped there, and the share of points concerned is reported.
    MetricLiteral {
        /// Embedding of each training point.
        embeddings: Points,
        /// Lengthscale of each class between coordinates, in their units. The hyperparameter of
        /// the same name rules the embeddings, which live on another scale.
        coordinate_lengthscales: Vec<f64>,
    },
}

impl Covariance {
    /// The points between which K(X,X) is computed.
    pub(crate) fn inputs<'a>(&'a self, training: &'a TrainingSet) -> &'a Points {
        match self {
            Self::Classic => training.points(),
            Self::MetricLiteral { embeddings, .. } => embeddings,
        }
    }

    /// Lengthscale of K(X,X*) and K(X*,X*) for `class`, whose K(X,X) has `lengthscale`.
    pub(crate) fn cross_lengthscale(&self, class: usize, lengthscale: f64) -> f64 {
        match self {
            Self::Classic => lengthscale,
            Self::MetricLiteral {
                coordinate_lengthscales,
                ..
            } => coordinate_lengthscales[class],
        }
    }

    pub(crate) fn check(&self, training: &TrainingSet) -> Result<(), GpError> {
        match self {
            Self::Classic => Ok(()),
            Self::MetricLiteral {
                embeddings,
                coordinate_lengthscales,
            } => {
                check_length(
                    "embeddings",
                    embeddings.len(),
                    training.len(),
                    "training point",
                )?;
                check_length(
                    "coordinate_lengthscales",
                    coordinate_lengthscales.len(),
                    training.classes(),
                    "class",
                )?;
                coordinate_lengthscales
                    .iter()
                    .try_for_each(|&value| check_scale("coordinate_lengthscale", value))
            }
        }
    }
}

/// `name` must have one entry per `per`.
pub(crate) const fn check_length(
    name: &'static str,
    found: usize,
    expected: usize,
    per: &'static str,
) -> Result<(), GpError> {
    if found == expected {
        Ok(())
    } else {
        Err(GpError::Length {
            name,
            found,
            expected,
            per,
        })
    }
}
