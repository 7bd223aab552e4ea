use serde::{Deserialize, Serialize};

use super::strict::{finite, positive};
use crate::{ModelChoice, PipelineError};

/// Distance from 0 and 1 at which a probability's logit is taken, as where the lines are fitted.
const LOGIT_CLIP: f64 = 1e-6;

/// Platt's recalibration of a probability: sigmoid(`slope` logit(p) + `intercept`) (Platt 1999,
/// "Probabilistic outputs for support vector machines"). The default changes nothing.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Platt {
    /// Factor of the logit, positive: the order of the points stays.
    pub slope: f64,
    /// Added to the logit.
    pub intercept: f64,
}

impl Default for Platt {
    fn default() -> Self {
        Self {
            slope: 1.0,
            intercept: 0.0,
        }
    }
}

impl Platt {
    /// The recalibrated probability.
    pub(crate) fn apply(&self, probability: f64) -> f64 {
        if *self == Self::default() {
            return probability;
        }
        let clipped = probability.clamp(LOGIT_CLIP, 1.0 - LOGIT_CLIP);
        let logit = clipped.ln() - (-clipped).ln_1p();
        1.0 / (1.0 + (-self.slope * logit - self.intercept).exp())
    }
}

/// Recalibration of each model's probability of the object, by default as `harness tune` fitted it
/// to validation scenes.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct RecalibrationConfig {
    /// Of `classic`.
    pub classic: Platt,
    /// Of `classic_tuned`.
    pub classic_tuned: Platt,
    /// Of `metric_literal`.
    pub metric_literal: Platt,
    /// Of `metric`.
    pub metric: Platt,
    /// Of `network`.
    pub network: Platt,
    /// Of `nearest`.
    pub nearest: Platt,
}

impl Default for RecalibrationConfig {
    fn default() -> Self {
        let platt = |slope, intercept| Platt { slope, intercept };
        Self {
            classic: platt(0.459, -0.623),
            classic_tuned: platt(1.02, -0.22),
            metric_literal: platt(0.541, 0.0858),
            metric: platt(1.04, 0.22),
            network: platt(1.0, 0.246),
            nearest: platt(1.17, 1.47),
        }
    }
}

impl RecalibrationConfig {
    pub(super) fn check(&self) -> Result<(), PipelineError> {
        for model in ModelChoice::ALL {
            let Platt { slope, intercept } = self.of(model);
            positive(&format!("recalibration.{model}.slope"), slope)?;
            finite(&format!("recalibration.{model}.intercept"), intercept)?;
        }
        Ok(())
    }

    /// The recalibration of one model.
    pub const fn of(&self, model: ModelChoice) -> Platt {
        match model {
            ModelChoice::Classic => self.classic,
            ModelChoice::ClassicTuned => self.classic_tuned,
            ModelChoice::MetricLiteral => self.metric_literal,
            ModelChoice::Metric => self.metric,
            ModelChoice::Network => self.network,
            ModelChoice::Nearest => self.nearest,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_default_changes_no_bit() {
        for p in [0.0, 1e-300, 0.1, 0.3, 1.0] {
            assert_eq!(Platt::default().apply(p), p);
        }
    }

    #[test]
    fn slope_and_intercept_act_on_the_logit() {
        // logit(0.8) = ln 4: doubled it is ln 16, and with ln 2 off ln 8.
        let platt = Platt {
            slope: 2.0,
            intercept: -(2.0_f64.ln()),
        };
        assert!((platt.apply(0.8) - 8.0 / 9.0).abs() < 1e-15);
        // Certainty is taken for odds of a million to one, whose square is halved.
        assert!((platt.apply(0.0) - 0.5e-12).abs() < 1e-17);
        assert!((platt.apply(1.0) - (1.0 - 2e-12)).abs() < 1e-15);
    }
}
