use thiserror::Error;

/// An input that no stage can work with. The message names the value and the remedy.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum InvalidInput {
    /// An image without pixels.
    #[error("image size {width} x {height} has no pixels; both sides must be at least 1")]
    EmptyImage {
        /// Columns.
        width: usize,
        /// Rows.
        height: usize,
    },
    /// A focal length or principal point that no camera has.
    #[error(
        "intrinsics fx={fx}, fy={fy}, cx={cx}, cy={cy} are not a camera's; \
         focal lengths must be positive and all four finite (pixels)"
    )]
    Intrinsics {
        /// Focal length along columns, pixels.
        fx: f64,
        /// Focal length along rows, pixels.
        fy: f64,
        /// Principal point's column, pixels.
        cx: f64,
        /// Principal point's row, pixels.
        cy: f64,
    },
    /// A 4x4 matrix that is not a rotation and a translation.
    #[error(
        "{name} is not a rigid transform: {why}; \
         pass a 4x4 row-major matrix of a rotation and a translation in metres"
    )]
    Pose {
        /// Which pose, as `target_from_source`.
        name: String,
        /// What is wrong with it.
        why: String,
    },
    /// A buffer whose length does not fit the image.
    #[error("{name} holds {found} values; a {width} x {height} image needs {expected}")]
    BufferLength {
        /// Which buffer.
        name: &'static str,
        /// Values found.
        found: usize,
        /// Values needed.
        expected: usize,
        /// Columns.
        width: usize,
        /// Rows.
        height: usize,
    },
    /// A depth that no sensor reports.
    #[error(
        "depth_m is {value} at pixel ({column}, {row}); depths are positive metres, \
         and a pixel without a measurement is NaN"
    )]
    Depth {
        /// The offending value.
        value: f32,
        /// Its column.
        column: usize,
        /// Its row.
        row: usize,
    },
    /// A depth image without one measurement.
    #[error("depth_m has no valid pixel; drop the frame or check the sensor")]
    NoDepth,
    /// An instance that covers no pixel.
    #[error("the mask of instance {index} is empty; leave the instance out")]
    EmptyMask {
        /// Position in the list of instances.
        index: usize,
    },
    /// A score outside its range.
    #[error("{name} is {value}; it must lie in [0, 1]")]
    Score {
        /// Which score.
        name: &'static str,
        /// The offending value.
        value: f64,
    },
    /// Class probabilities that add up to more than one.
    #[error(
        "class_scores add up to {sum}; they are probabilities of exclusive categories and must add \
         up to at most 1: divide them by their sum"
    )]
    ClassScores {
        /// Their sum.
        sum: f64,
    },
    /// An instance id in the mask that has no category.
    #[error("the mask holds instance id {id}, which has no category; list it or set it to 0")]
    UnknownInstance {
        /// The id.
        id: u16,
    },
    /// A category outside the six of NOCS.
    #[error("unknown category '{name}'; choose one of bottle, bowl, camera, can, laptop, mug")]
    Category {
        /// The name as given.
        name: String,
    },
    /// A point with a NaN or infinite coordinate.
    #[error("{name}[{index}] is not finite; remove such points first")]
    NonFinitePoint {
        /// Which array.
        name: &'static str,
        /// Row of the array.
        index: usize,
    },
    /// An object of which no point was seen.
    #[error("the observation has no object points; ask about an object only once it has been seen")]
    UnseenObject,
    /// A table height that is no number.
    #[error("table_height_m is {value}; give the table's height in world metres")]
    TableHeight {
        /// The offending value.
        value: f64,
    },
    /// A flat occupancy tree that is not one.
    #[error("node {index} of the occupancy tree {why}; export the tree again from its map")]
    Tree {
        /// Position of the node.
        index: usize,
        /// What is wrong with it.
        why: &'static str,
    },
    /// A voxel edge that is no length.
    #[error(
        "the occupancy tree's voxel edge is {value}; give resolution_m in metres, positive and \
         finite"
    )]
    TreeResolution {
        /// The offending value.
        value: f64,
    },
    /// A mesh that has no surface.
    #[error("the mesh has {vertices} vertices and {faces} faces; it needs at least one face")]
    EmptyMesh {
        /// Number of vertices.
        vertices: usize,
        /// Number of faces.
        faces: usize,
    },
    /// A face that names a vertex which is not there.
    #[error("face {face} names vertex {vertex}, but the mesh has {vertices}")]
    FaceIndex {
        /// Position of the face.
        face: usize,
        /// The index it holds.
        vertex: u32,
        /// Number of vertices.
        vertices: usize,
    },
}
