use crate::{Category, Point};

/// An object's whole shape, seen and unseen, as a completer imagines it from one frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Completion {
    /// What the completer takes the object for.
    pub category: Category,
    /// How sure the completer is of the object, in \[0, 1\].
    pub score: f64,
    /// Points spread evenly over the completed surface, camera frame, metres. Every prefix is
    /// spread evenly too.
    pub points_camera: Vec<Point>,
    /// Expected distance of each point from the true surface, metres: the completer's own doubt.
    pub spread_m: Vec<f64>,
}
