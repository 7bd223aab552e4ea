use std::fmt;

use credence_types::{Completion, Frame, Instance};

use crate::CompleteError;

/// Imagines the whole shapes of the objects in a frame.
pub trait Completer: Send + Sync {
    /// A completion of each instance, in their order, or the reason why it has none.
    ///
    /// # Errors
    /// A frame or instances that the completer cannot work with.
    fn complete(
        &self,
        frame: &Frame,
        instances: &[Instance],
    ) -> Result<Vec<Result<Completion, Uncompleted>>, CompleteError>;
}

/// Fewest measured points of an instance that a completion is made from: without any, even its
/// distance would be a guess.
const LEAST_POINTS: usize = 50;

/// Refuses an instance of too few measured points.
pub(crate) const fn check_measured(found: usize) -> Result<(), Uncompleted> {
    if found < LEAST_POINTS {
        return Err(Uncompleted::TooFewPoints {
            found,
            least: LEAST_POINTS,
        });
    }
    Ok(())
}

/// Why an instance has no completion: no error, a thing that happens.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Uncompleted {
    /// Too few of its pixels have a valid depth.
    TooFewPoints {
        /// Valid pixels.
        found: usize,
        /// Fewest that a completion is made from.
        least: usize,
    },
    /// A completer that finds objects by itself did not find this one.
    NotDetected,
    /// The completer declined, with its reason.
    Declined(String),
}

impl fmt::Display for Uncompleted {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::TooFewPoints { found, least } => write!(
                f,
                "{found} of its pixels have a valid depth; a completion needs at least {least}"
            ),
            Self::NotDetected => f.write_str("the network did not find it in the image"),
            Self::Declined(why) => f.write_str(why),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fifty_measured_points_are_enough() {
        assert_eq!(check_measured(50), Ok(()));
        assert_eq!(
            check_measured(49).unwrap_err().to_string(),
            "49 of its pixels have a valid depth; a completion needs at least 50"
        );
    }
}
