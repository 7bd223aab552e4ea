use crate::Point;

/// World points with their colours, one colour per point.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct PointCloud {
    /// World coordinates, metres.
    pub points_world: Vec<Point>,
    /// Colour of each point.
    pub rgb: Vec<[u8; 3]>,
}

impl PointCloud {
    /// Adds a point.
    pub fn push(&mut self, point_world: Point, rgb: [u8; 3]) {
        self.points_world.push(point_world);
        self.rgb.push(rgb);
    }

    /// Adds all points of another cloud.
    pub fn extend(&mut self, other: &Self) {
        self.points_world.extend_from_slice(&other.points_world);
        self.rgb.extend_from_slice(&other.rgb);
    }

    /// Number of points.
    pub const fn len(&self) -> usize {
        self.points_world.len()
    }

    /// Whether there is no point.
    pub const fn is_empty(&self) -> bool {
        self.points_world.is_empty()
    }
}
