use thiserror::Error;

use crate::truth::MAX_COORDINATE_M;

/// An input that cannot be scored. The message names the value and the remedy.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum ScoreError {
    /// A mesh whose faces are all degenerate.
    #[error(
        "all {faces} faces of the mesh have zero area; \
         export it again, or check that its vertices are in metres and distinct"
    )]
    NoSurface {
        /// Number of faces.
        faces: usize,
    },
    /// A point that is not finite or absurdly far away.
    #[error(
        "{name}[{index}] is {point:?}; coordinates must be finite and within \
         {MAX_COORDINATE_M:e} m of the origin: remove the point or convert to metres"
    )]
    Point {
        /// Which array.
        name: &'static str,
        /// Row of the array.
        index: usize,
        /// The offending coordinates.
        point: [f64; 3],
    },
    /// A ray that points nowhere.
    #[error("directions[{index}] is {direction:?}; it must be finite and not zero")]
    Direction {
        /// Row of the array.
        index: usize,
        /// The offending direction.
        direction: [f64; 3],
    },
    /// Two arrays that should run in parallel.
    #[error("{name} holds {found} values and {reference} {expected}; pass one value per row")]
    Length {
        /// Which array.
        name: &'static str,
        /// Its length.
        found: usize,
        /// The array it is held against.
        reference: &'static str,
        /// That array's length.
        expected: usize,
    },
    /// No observed point to be near to.
    #[error("observed holds no point; pass the points that the sensor saw")]
    NoObservation,
    /// Observed points that cannot be indexed.
    #[error("observed cannot be indexed ({why}); pass fewer points")]
    ObservationIndex {
        /// The index's own words.
        why: String,
    },
    /// A probability outside its range.
    #[error("probability[{index}] is {value}; it must lie in [0, 1]")]
    Probability {
        /// Position in the array.
        index: usize,
        /// The offending value.
        value: f64,
    },
    /// A confidence that cannot be ranked.
    #[error("decision_confidence[{index}] is {value}; it must be finite to be ranked")]
    Confidence {
        /// Position in the array.
        index: usize,
        /// The offending value.
        value: f64,
    },
    /// A share of points to keep that is none.
    #[error("coverage is {value}; it must lie in (0, 1]")]
    Coverage {
        /// The offending value.
        value: f64,
    },
    /// A histogram without bins.
    #[error("bins is 0; calibration needs at least one, 15 is usual")]
    Bins,
}

/// Refuses arrays of different lengths.
pub(crate) const fn same_length(
    (name, found): (&'static str, usize),
    (reference, expected): (&'static str, usize),
) -> Result<(), ScoreError> {
    if found == expected {
        Ok(())
    } else {
        Err(ScoreError::Length {
            name,
            found,
            reference,
            expected,
        })
    }
}
