use crate::Point;

/// What has been seen of one object: its points, the free space around it, and from where.
#[derive(Debug, Clone, PartialEq)]
pub struct Observation {
    /// Points on the object, world metres.
    pub object: Vec<Point>,
    /// Points that the camera's rays passed through near the object, world metres.
    pub free: Vec<Point>,
    /// Where it was seen from: the mean of the camera's positions, world metres.
    pub viewpoint: Point,
    /// Height of the surface that the object stands on, world metres.
    pub table_height_m: f64,
}
