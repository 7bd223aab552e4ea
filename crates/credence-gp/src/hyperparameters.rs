use crate::GpError;

/// Hyperparameters of one class.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hyperparameters {
    /// Distance over which the latent function varies, in the units of the points.
    pub lengthscale: f64,
    /// Prior variance of the latent function.
    pub outputscale: f64,
    /// Constant prior mean of the latent function.
    pub mean: f64,
}

impl Hyperparameters {
    pub(crate) fn check(&self) -> Result<(), GpError> {
        check_scale("lengthscale", self.lengthscale)?;
        check_scale("outputscale", self.outputscale)?;
        if !self.mean.is_finite() {
            return Err(GpError::Setting {
                name: "mean",
                value: self.mean,
                range: "finite",
            });
        }
        Ok(())
    }

    /// The error that says that `quantity` of `class` is not finite under these hyperparameters.
    pub(crate) const fn overflow(&self, quantity: &'static str, class: usize) -> GpError {
        GpError::Overflow {
            quantity,
            class,
            lengthscale: self.lengthscale,
            outputscale: self.outputscale,
            mean: self.mean,
        }
    }
}

/// A scale must be positive and finite, and so must its inverse.
pub(crate) fn check_scale(name: &'static str, value: f64) -> Result<(), GpError> {
    if value > 0.0 && value.is_finite() && value.recip().is_finite() {
        Ok(())
    } else {
        Err(GpError::Setting {
            name,
            value,
            range: "positive and finite",
        })
    }
}
