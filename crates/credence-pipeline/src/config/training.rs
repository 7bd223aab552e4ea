use serde::{Deserialize, Serialize};

/// How training points are drawn (the seed's protocol).
///
/// Observed points come from the object and from whatever else was seen in its padded box, so that
/// a neighbour is neither free space nor ignored. Neighbours take their share of the points seen
/// in the box, but at most half: a large one cannot crowd out a small object. The object's points
/// take the rest, as far as it has them, and free space fills what is left.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct TrainingConfig {
    /// Training points of one object, observed and free together.
    pub points: usize,
    /// Share of them that is drawn from observed points, of the object and its neighbours; the rest
    /// is free space.
    pub object_share: f64,
    /// Free points keep this distance from every observed point, metres.
    pub free_margin_m: f64,
    /// Free points are drawn in the observed points' box, padded on each side by this, metres.
    pub box_padding_m: f64,
}

impl Default for TrainingConfig {
    fn default() -> Self {
        Self {
            points: 3600,
            object_share: 0.5,
            free_margin_m: 0.01,
            box_padding_m: 0.03,
        }
    }
}
