use credence_types::InvalidInput;
use thiserror::Error;

/// What the map cannot do, with the value and the remedy.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum MapError {
    /// An input that no stage accepts.
    #[error(transparent)]
    Input(#[from] InvalidInput),
    /// A voxel edge that the tree's arithmetic does not hold.
    #[error(
        "resolution_m is {value}; the edge of a voxel must lie between \
         {min} and {max} metres"
    )]
    Resolution {
        /// The offending value.
        value: f64,
        /// Smallest edge.
        min: f64,
        /// Largest edge.
        max: f64,
    },
    /// A range that cuts nothing.
    #[error("{name} is {value}; it must be positive and finite (metres)")]
    NotPositive {
        /// Which setting.
        name: &'static str,
        /// The offending value.
        value: f64,
    },
    /// A sensor outside the volume of the tree.
    #[error(
        "the sensor at {origin:?} lies outside the map, which reaches {reach_m} m from the world's \
         origin; choose a coarser resolution or a nearer world origin"
    )]
    SensorOutside {
        /// The sensor's position, metres.
        origin: [f64; 3],
        /// Half the edge of the map, metres.
        reach_m: f64,
    },
    /// A scan whose rays cross more space than a scan may.
    #[error(
        "the scan's rays cross more than {limit} blocks of 4 x 4 x 4 voxels; \
         set max_range_m, drop far points or choose a coarser resolution"
    )]
    ScanTooLarge {
        /// Largest number of blocks.
        limit: usize,
    },
    /// An object that is not tracked.
    #[error("there is no object {id}; it was deleted or never seen (list the objects first)")]
    UnknownObject {
        /// The id asked for.
        id: u32,
    },
    /// Two lists that must have one length.
    #[error("{name} holds {found} values; {expected} points need one each")]
    Length {
        /// Which list.
        name: &'static str,
        /// Values found.
        found: usize,
        /// Values needed.
        expected: usize,
    },
    /// A share outside its range.
    #[error("{name} is {value}; it must lie in [0, 1]")]
    Share {
        /// Which setting.
        name: &'static str,
        /// The offending value.
        value: f64,
    },
    /// More points than a nearest-neighbour search can number.
    #[error("{count} points are too many for one nearest-neighbour search; thin them out")]
    TooManyPoints {
        /// Number of points.
        count: usize,
    },
    /// A box whose minimum is not below its maximum.
    #[error("the box from {min:?} to {max:?} has no volume; give its lower corner first (metres)")]
    EmptyBox {
        /// Lower corner.
        min: [f64; 3],
        /// Upper corner.
        max: [f64; 3],
    },
    /// No place, or too little, for free-space samples.
    #[error(
        "found {found} of {count} free points {min_distance_m} m away from the observed points in \
         the box from {min:?} to {max:?}; insert views that look through the box, enlarge it or \
         lower min_distance_m"
    )]
    NoFreeSpace {
        /// Number of points found.
        found: usize,
        /// Number of points asked for.
        count: usize,
        /// Lower corner of the box.
        min: [f64; 3],
        /// Upper corner of the box.
        max: [f64; 3],
        /// Distance kept from observed points, metres.
        min_distance_m: f64,
    },
}
