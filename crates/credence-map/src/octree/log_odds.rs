//! `OctoMap`'s sensor model and defaults (Hornung et al. 2013), as the nearest f32 to ln(p/(1-p)).

use credence_types::OccupancyTree;

/// A ray ends in the voxel: p = 0.7.
pub(super) const HIT: f32 = 0.847_297_85;
/// A ray passes through: p = 0.4.
pub(super) const MISS: f32 = -0.405_465_1;
pub(super) const MIN: f32 = OccupancyTree::MIN_LOG_ODDS;
pub(super) const MAX: f32 = OccupancyTree::MAX_LOG_ODDS;

/// Log-odds after one more observation; a voxel already past its clamp stays as it is.
pub(super) fn updated(log_odds: f32, observation: f32) -> f32 {
    let saturated = if observation >= 0.0 {
        log_odds >= MAX
    } else {
        log_odds <= MIN
    };
    if saturated {
        log_odds
    } else {
        (log_odds + observation).clamp(MIN, MAX)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn constants_are_the_log_odds_of_octomaps_probabilities() {
        for (constant, p) in [(HIT, 0.7), (MISS, 0.4_f64)] {
            assert_eq!(constant, (p / (1.0 - p)).ln() as f32);
        }
    }

    #[test]
    fn evidence_adds_up_to_the_clamp() {
        assert_eq!(updated(0.0, HIT), HIT);
        assert_eq!(updated(3.0, HIT), MAX);
        assert_eq!(updated(MAX, HIT), MAX);
        assert_eq!(updated(-1.9, MISS), MIN);
        assert_eq!(updated(-5.0, MISS), -5.0);
        assert_eq!(updated(-5.0, HIT), MIN);
    }
}
