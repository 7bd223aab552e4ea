/// What a classifier says of one test point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Prediction {
    /// Class index: 0 is free space, 1 to 6 the categories.
    pub class: u8,
    /// Variance of the latent function of that class; 0 if the model has none.
    pub variance: f64,
    /// The seed's score: variance scaled to \[0, 1\] over the test points, 1 at the smallest (Hong
    /// et al., Eqs. 2 and 3), times the segmenter's score. Comparable within one call only. The
    /// confidence if the model has no variance.
    pub score: f64,
    /// Probability of the object's category at the point, recalibrated, times the segmenter's score
    /// and, for a completed point, the completer's: how likely something of that category is
    /// there. Comparable between scenes; it does not tell two objects of one category apart.
    pub confidence: f64,
}

/// The predictions of one classifier for one object's test points.
#[derive(Debug, Clone, PartialEq)]
pub struct Predictions {
    /// One prediction per test point, in the order of the points.
    pub points: Vec<Prediction>,
    /// Class indices that the classifier chose from, free space first.
    pub classes: Vec<u8>,
    /// Probability of each of `classes` per point, row-major (points x classes).
    pub probabilities: Vec<f64>,
    /// Share of the test points whose variance was below zero and clamped: 0 for every sound model.
    pub clamped_share: f64,
    /// Diagonal jitter that the covariance needed to factorise, 0 as a rule.
    pub jitter: f64,
}
