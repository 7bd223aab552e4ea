use thiserror::Error;

/// What the classifier refuses. The message names the value and the remedy.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum GpError {
    /// Points without coordinates.
    #[error("{name} has dimension 0; each point needs at least one coordinate")]
    NoDimension {
        /// Which array.
        name: &'static str,
    },
    /// A buffer that is not a whole number of points.
    #[error("{name} holds {values} values, which is not a multiple of the dimension {dim}")]
    RaggedPoints {
        /// Which array.
        name: &'static str,
        /// Values found.
        values: usize,
        /// Coordinates per point.
        dim: usize,
    },
    /// A coordinate whose square is not a finite number.
    #[error(
        "{name}[{index}] has the coordinate {value}; remove non-finite points, \
         and keep coordinates within 1e150 of zero"
    )]
    Coordinate {
        /// Which array.
        name: &'static str,
        /// Row of the array.
        index: usize,
        /// The coordinate.
        value: f64,
    },
    /// Two arrays that should have one entry per point each.
    #[error("{name} has {found} entries; it needs {expected}, one per {per}")]
    Length {
        /// Which array.
        name: &'static str,
        /// Entries found.
        found: usize,
        /// Entries needed.
        expected: usize,
        /// What each entry belongs to.
        per: &'static str,
    },
    /// Points of one space met points of another.
    #[error("{name} has dimension {found}, but {other} has {expected}; use one space for both")]
    Dimension {
        /// Which array.
        name: &'static str,
        /// Its dimension.
        found: usize,
        /// The array it is compared with.
        other: &'static str,
        /// That array's dimension.
        expected: usize,
    },
    /// Nothing to tell apart.
    #[error("a classifier of {classes} classes has nothing to decide; use at least 2 classes")]
    TooFewClasses {
        /// Number of classes.
        classes: usize,
    },
    /// Nothing to learn from.
    #[error("there are no training points; pass at least one point of each class")]
    NoTrainingPoints,
    /// A label that is no class.
    #[error("label {label} of training point {index} is out of range; labels run from 0 to {last}")]
    Label {
        /// Position of the point.
        index: usize,
        /// Its label.
        label: usize,
        /// The largest valid label.
        last: usize,
    },
    /// A class that no training point speaks for.
    #[error("class {class} has no training point; add one, or leave the class out")]
    EmptyClass {
        /// The class.
        class: usize,
    },
    /// A position in a subset that names no training point.
    #[error("the subset names training point {index}, but there are {points}")]
    Subset {
        /// The position asked for.
        index: usize,
        /// Number of training points.
        points: usize,
    },
    /// A hyperparameter or setting outside its range.
    #[error("{name} is {value}; it must be {range}")]
    Setting {
        /// Which one.
        name: &'static str,
        /// The value.
        value: f64,
        /// The range that is allowed, in words.
        range: &'static str,
    },
    /// A class index that does not exist.
    #[error("class {class} does not exist; the classifier has {classes}")]
    NoSuchClass {
        /// The index asked for.
        class: usize,
        /// Number of classes.
        classes: usize,
    },
    /// A covariance without a Cholesky factor.
    #[error(
        "the covariance of class {class} is not positive definite, not even with {jitter:e} added \
         to its diagonal; lower its outputscale ({outputscale:e})"
    )]
    NotPositiveDefinite {
        /// The class.
        class: usize,
        /// The largest jitter tried.
        jitter: f64,
        /// The class's outputscale.
        outputscale: f64,
    },
    /// Hyperparameters so extreme that the arithmetic overflows.
    #[error(
        "{quantity} of class {class} overflows with lengthscale {lengthscale:e}, \
         outputscale {outputscale:e} and mean {mean:e}; use less extreme hyperparameters"
    )]
    Overflow {
        /// What overflowed.
        quantity: &'static str,
        /// The class.
        class: usize,
        /// The class's lengthscale.
        lengthscale: f64,
        /// The class's outputscale.
        outputscale: f64,
        /// The class's mean.
        mean: f64,
    },
    /// A variance that cannot be ranked.
    #[error("variance {index} is {value}; variances must be finite")]
    Variance {
        /// Its position.
        index: usize,
        /// The value.
        value: f64,
    },
}
