use crate::ScoreError;

/// Tolerance within which a point counts as lying on a mesh, metres.
pub const DEFAULT_TOLERANCE_M: f64 = 0.005;

/// Tolerances at which every run is scored, metres.
pub const TOLERANCES_M: [f64; 3] = [0.0025, DEFAULT_TOLERANCE_M, 0.01];

/// Which points lie on the mesh: those at most `tolerance_m` away from it.
///
/// # Errors
/// A tolerance or a distance that is negative or NaN, an infinite tolerance.
pub fn on_surface(distances_m: &[f64], tolerance_m: f64) -> Result<Vec<bool>, ScoreError> {
    if !(tolerance_m.is_finite() && tolerance_m >= 0.0) {
        return Err(ScoreError::Tolerance { value: tolerance_m });
    }
    distances_m
        .iter()
        .enumerate()
        .map(|(index, &value)| {
            if value >= 0.0 {
                Ok(value <= tolerance_m)
            } else {
                Err(ScoreError::Distance { index, value })
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_tolerance_itself_still_lies_on_the_mesh() {
        let distances = [0.0, 0.0025, 0.005, 0.0051, 0.01, f64::INFINITY];
        let counts = TOLERANCES_M.map(|tolerance| {
            let on = on_surface(&distances, tolerance).unwrap();
            on.into_iter().filter(|&on| on).count()
        });
        assert_eq!(counts, [2, 3, 5]);
        assert_eq!(on_surface(&[0.0, 1e-300], 0.0), Ok(vec![true, false]));
    }

    #[test]
    fn refuses_what_is_no_length() {
        for tolerance in [-0.001, f64::NAN, f64::INFINITY] {
            let message = on_surface(&[], tolerance).unwrap_err().to_string();
            assert!(message.contains(&format!("tolerance_m is {tolerance}")));
        }
        let message = on_surface(&[0.0, f64::NAN], 0.005).unwrap_err().to_string();
        assert!(message.contains("distances_m[1] is NaN"));
        assert!(on_surface(&[-1e-9], 0.005).is_err());
    }
}
