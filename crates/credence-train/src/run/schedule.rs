use std::f64::consts::PI;

/// Learning rate: a linear warm-up, then half a cosine down to the last value.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Schedule {
    /// Optimiser steps in all.
    pub steps: u64,
    /// Steps of the warm-up.
    pub warm_up: u64,
    /// Rate after the warm-up.
    pub peak: f64,
    /// Rate at the last step.
    pub last: f64,
}

impl Schedule {
    /// The rate of a step, counted from 1.
    pub fn rate(&self, step: u64) -> f64 {
        if step <= self.warm_up {
            return self.peak * step as f64 / self.warm_up as f64;
        }
        let length = self.steps.saturating_sub(self.warm_up).max(1);
        let done = (step - self.warm_up) as f64 / length as f64;
        self.last + (self.peak - self.last) * (1.0 + (PI * done.min(1.0)).cos()) / 2.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn climbs_then_falls_to_the_last_rate() {
        let schedule = Schedule {
            steps: 210,
            warm_up: 10,
            peak: 1.0,
            last: 0.2,
        };
        let rates = [1, 5, 10, 110, 210].map(|step| schedule.rate(step));
        let expected = [0.1, 0.5, 1.0, 0.6, 0.2];
        assert!(
            rates
                .iter()
                .zip(expected)
                .all(|(a, b)| (a - b).abs() < 1e-12),
            "{rates:?}"
        );
    }
}
